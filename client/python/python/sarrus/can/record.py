"""Recording of frames: `.blf`, `.asc` and `.log` keep everything; other formats lose fields and are not offered."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can

from sarrus.can.adapters import to_message
from sarrus.can.telling import WrongFlags

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from sarrus._native import Frame

ENDINGS = (".blf", ".asc", ".log")
"""Formats by the ending of the file."""


class Recorder:
    """A file of frames. In `.log` a bus has its name, in `.blf` and `.asc` its number in the configuration, from 1."""

    def __init__(self, path: str, names: Sequence[str]) -> None:
        if Path(path).suffix not in ENDINGS:
            raise WrongFlags(f"{path}: the ending must be one of {', '.join(ENDINGS)}; other formats lose fields")
        self._writer: Any = can.Logger(path)
        self._channels: list[str | int] = list(names) if path.endswith(".log") else list(range(len(names)))
        self.count = 0

    def write(self, bus: int, frame: Frame, *, received: bool) -> None:
        """Add a frame with the present time."""
        message = to_message(frame)
        message.timestamp, message.channel, message.is_rx = time.time(), self._channels[bus], received
        self._writer.on_message_received(message)
        self.count += 1

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self._writer.stop()


def recorder(path: str) -> Callable[[list[str]], Recorder]:
    """A recorder for buses whose names are known later."""
    return lambda names: Recorder(path, names)
