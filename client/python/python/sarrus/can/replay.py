"""Replay of a log: the frames that the bridge sends for it, as `candump -L` writes them.

No bus, no clock.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sarrus._native import Bridge, Configuration
from sarrus.can.telling import say

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


class BadLine(Exception):
    """A line of a log that is none."""


def replay(configuration: Configuration, path: str, lines: Iterable[str]) -> Iterator[str]:
    """Lines of output for the lines of a log; each fault is said on stderr."""
    bridge = Bridge(configuration)
    for number, line in enumerate(lines, 1):
        if line.strip():
            try:
                sent, fault = bridge.replay(line.rstrip("\r\n"))
            except ValueError as error:
                raise BadLine(f"{path}:{number}:1: {error}") from error
            if fault is not None:
                say(f"sarrus.can replay: {fault}")
            yield from sent
