"""Replay of an input log: the frames that the bridge sends for it, as `candump -L` writes them. No bus, no clock."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from sarrus._native import Bridge, Configuration, Frame

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_FRAME = re.compile(r"([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(#[0-9A-Fa-f])?((?:[0-9A-Fa-f]{2})*)")


def frame_of_text(text: str) -> Frame:
    """Give the frame of candump's text, as `123#0011`, `00000123#0011` or `123##10011`."""
    match = _FRAME.fullmatch(text)
    if match is None:
        raise ValueError(f"`{text}` is no frame, expected as 123#0011 or 123##10011")
    number, flags, data = match.groups()
    fd = flags is not None
    return Frame(
        int(number, 16), bytes.fromhex(data), extended=len(number) == 8, fd=fd, bit_rate_switch=fd and bool(int(flags[1:], 16) & 1)
    )


def replay(configuration: Configuration, lines: Iterable[str]) -> Iterator[str]:
    """Lines of output for lines of an input log; a line that is none is a `ValueError` with its number."""
    names = [bus["name"] for bus in configuration.buses]
    bridge = Bridge(configuration)
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            entry: dict[str, Any] = json.loads(line)
            now = int(entry["t"])
            if "cycle" in entry:
                bridge.cycle(now)
                stamp = f"({now // 10**9}.{now // 1000 % 10**6:06})"
                yield from (f"{stamp} {name} {frame}" for bus, name in enumerate(names) for frame in bridge.frames(bus))
            elif "frame" in entry:
                bridge.receive(now, names.index(entry["bus"]), frame_of_text(entry["frame"]))
            elif "event" in entry:
                bridge.bus_event(now, names.index(entry["bus"]), entry["event"], entry.get("count", 1))
            elif "command" in entry:
                bridge.command(now, **entry["command"])
            elif "operate" in entry:
                bridge.operate(now, entry["operate"])
            else:
                raise ValueError("neither frame, event, command, operate nor cycle")
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
            raise ValueError(f"line {number}: {error}") from error
