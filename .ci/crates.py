#!/usr/bin/env python3
"""Fails where cargo would compile a crate twice; `.ci/crates.py FILE` prints times of compilation.

After `cargo run --release -- demo`, the tests and every program of the workspace share their
compiled libraries. Cargo's plan of each build (its unit graph) proves this without compiling.
Prints the number of crates that the first build compiles, which also has a bound.

FILE is a page that `cargo build --timings` wrote: every unit that took longer than ten seconds is
printed. These times depend on the machine, so no check uses them.
"""

import json
import os
import re
import subprocess
import sys

# what the demo compiles, build scripts and procedural macros included
MOST = 238
DEMO = ["build"]
OTHERS = [["test", "--workspace", "--no-run"]] + [
    ["build", "-p", name]
    for name in (
        "sarrus-server",
        "sarrus-can",
        "sarrus-benches",
        "sarrus-round-trip",
        "sarrus-fuzz",
        "sarrus-torture",
    )
]


def units(command):
    """{identity: unit} of a build; units with one identity are compiled once."""
    plan = subprocess.run(
        ["cargo", *command, "--release", "--locked", "--offline"]
        + ["--unit-graph", "-Zunstable-options"],
        # every toolchain can print the plan, but only this variable enables it
        env=os.environ | {"RUSTC_BOOTSTRAP": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    graph = json.loads(plan.stdout)["units"]
    known = {}

    def identity(index):
        if index not in known:
            unit = graph[index]
            below = sorted(identity(needed["index"]) for needed in unit["dependencies"])
            own = [unit[key] for key in ("pkg_id", "mode", "platform", "features", "profile")]
            known[index] = hash(repr((own, unit["target"]["name"], unit["target"]["kind"], below)))
        return known[index]

    return {identity(index): unit for index, unit in enumerate(graph)}


def name(unit):
    """A library, for the build or the product; other units are not shared."""
    kinds = unit["target"]["kind"]
    is_library = unit["mode"] == "build" and "bin" not in kinds and "custom-build" not in kinds
    return (unit["pkg_id"], repr(unit["profile"]), *kinds) if is_library else None


def print_seconds(page):
    """The units of a page of timings that took longer than ten seconds, the longest first."""
    with open(page, encoding="utf-8") as file:
        units = json.loads(re.search(r"UNIT_DATA = (\[.*?\]);", file.read(), re.S).group(1))
    for unit in sorted(units, key=lambda unit: -unit["duration"]):
        if unit["duration"] > 10:
            print(f"{unit['duration']:7.1f} s  {unit['name']}{unit['target']}")


def main():
    if len(sys.argv) > 1:
        print_seconds(sys.argv[1])
        return 0
    demo = units(DEMO)
    compiled = {name(unit) for unit in demo.values()} - {None}
    compilations = sum(unit["mode"] == "build" for unit in demo.values())
    print(f"cargo run --release -- demo: {compilations} compilations, at most {MOST}")
    faults = int(compilations > MOST)
    for command in OTHERS:
        planned = units(command)
        again = [u for i, u in planned.items() if i not in demo and name(u) in compiled]
        print(f"cargo {' '.join(command)}: {len(again)} libraries once more, at most 0")
        for unit in again:
            print(f"  {unit['pkg_id']} with the features {', '.join(unit['features'])}")
        faults += len(again)
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
