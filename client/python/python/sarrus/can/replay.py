"""Replay of a log, without bus or clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sarrus._native import Bridge, Configuration
from sarrus.can.telling import say

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


class BadLine(Exception):
    """A malformed line of a log."""


def replay(configuration: Configuration, path: str, lines: Iterable[str]) -> Iterator[str]:
    """Give the frames that the bridge sends for a log, as `candump -L` writes them.

    Faults are reported on stderr.
    """
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
