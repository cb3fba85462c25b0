#!/usr/bin/env python3
"""Soak: attacks on servers and fuzzed inputs in turn, for some hours.

Goes on where an earlier run stopped; `target/soak/totals.json` has the totals, the next turn, which
is also its seed, and the commands that failed. Exits with 1 if any command of this run failed.
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import time

ATTACKS = [
    "kill-clients", "kill-servers", "stop", "burst", "full", "scribble", "flood", "batches",
    "clear", "fair",
]  # fmt: skip
COUNTS = {
    "requests": [r"(\d+) answers"],
    "kills": [r"(\d+) kills", r"(\d+) of one that starts", r"(\d+) attackers killed"],
    "inputs": [r"(?m)^(\d+) inputs, \d+ kinds"],
}


def commands(programs, turn, seconds, targets):
    """The commands of a turn: requests of every kind, another attack, a reader of inputs."""
    attack = ATTACKS[turn % len(ATTACKS)]
    options = ["--seconds", str(seconds), "--seed", str(turn)]
    fuzz = [targets[turn % len(targets)], "--minutes", str(seconds / 60), "--inputs", str(10**12)]
    return [
        [programs / "torture", "soak", *options],
        [programs / "torture", attack, *options],
        [programs / "sarrus-fuzz", *fuzz, "--seed", str(turn)],
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, required=True)
    parser.add_argument("--seconds", type=float, default=60, help="of each command")
    arguments = parser.parse_args()
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target"))
    programs = target / "release"
    file = target / "soak" / "totals.json"
    totals = {"turn": 0, "seconds": 0, "requests": 0, "kills": 0, "inputs": 0, "failed": []}
    if file.exists():
        totals = json.loads(file.read_text())
    file.parent.mkdir(parents=True, exist_ok=True)
    help_text = subprocess.run(
        [programs / "sarrus-fuzz", "--help"], capture_output=True, text=True, check=True
    ).stdout
    targets = re.search(r"possible values: ([^\]]*)", help_text)[1].split(", ")

    start = time.monotonic()
    failed = 0
    while time.monotonic() - start < 3600 * arguments.hours:
        for command in commands(programs, totals["turn"], arguments.seconds, targets):
            began = time.monotonic()
            done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
            totals["seconds"] += round(time.monotonic() - began)
            for name, patterns in COUNTS.items():
                found = (n for pattern in patterns for n in re.findall(pattern, done.stdout))
                totals[name] += sum(map(int, found))
            if done.returncode != 0:
                failed += 1
                words = " ".join(map(str, command))
                totals["failed"].append({"command": words, "code": done.returncode})
                print(f"FAILED: {words}\n{done.stdout}", flush=True)
        totals["turn"] += 1
        # a file that is cut off by a kill would end the count
        part = file.with_suffix(".part")
        part.write_text(json.dumps(totals, indent=1) + "\n")
        part.replace(file)
        counts = ", ".join(f"{totals[name]:,} {name}" for name in COUNTS)
        hours = (time.monotonic() - start) / 3600
        print(f"{hours:.2f} of {arguments.hours:g} h, turn {totals['turn']}: {counts}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
