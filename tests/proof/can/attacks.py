"""Replays logs on bridges of the package, call by call, and writes their frames and faults.

`attacks.py FOLDER N`: reads `0.yml` and `0.jsonl` … in the folder, and writes `0.frames` and
`0.faults.json` beside them.
"""

import json
import math
import sys
from pathlib import Path

from sarrus.can import Bridge, Configuration, Frame


def frame_of(text):
    """A frame as `candump -L` writes it."""
    fd = "##" in text
    number, _, data = text.partition("##" if fd else "#")
    flags, data = (int(data[0], 16), data[1:]) if fd else (0, data)
    return Frame(
        int(number, 16),
        bytes.fromhex(data),
        extended=len(number) == 8,
        fd=fd,
        bit_rate_switch=bool(flags & 1),
    )


def numbers(values):
    """Numbers of a log, where NaN is null."""
    return [math.nan if value is None else value for value in values]


def main(folder, n):
    """All logs of the folder."""
    for place in range(n):
        configuration = Configuration.load(str(folder / f"{place}.yml"))
        names = [bus["name"] for bus in configuration.buses]
        bridge = Bridge(configuration)
        frames, faults, known = [], [], 0
        for text in (folder / f"{place}.jsonl").read_text().splitlines():
            line = json.loads(text)
            t = line["t"]
            if "frame" in line:
                bridge.receive(t, names.index(line["bus"]), frame_of(line["frame"]))
            elif "event" in line:
                bus = names.index(line["bus"])
                bridge.bus_event(t, bus, line["event"], line.get("count", 1))
            elif "operate" in line:
                bridge.operate(t, line["operate"], line.get("actuator"))
            elif "command" in line:
                command = line["command"]
                command.pop("n_u")
                for name, values in command.items():
                    if isinstance(values, list):
                        command[name] = numbers(values)
                bridge.command(t, **command)
            else:
                bridge.cycle(t)
                seconds, micros = t // 1_000_000_000, t % 1_000_000_000 // 1000
                frames += [
                    f"({seconds}.{micros:06}) {name} {frame}\n"
                    for bus, name in enumerate(names)
                    for frame in bridge.frames(bus)
                ]
            count, fault = bridge.faults
            if count != known:
                known = count
                faults.append(f"{t} ns {fault}")
        (folder / f"{place}.frames").write_text("".join(frames))
        (folder / f"{place}.faults.json").write_text(json.dumps(faults))


main(Path(sys.argv[1]), int(sys.argv[2]))
