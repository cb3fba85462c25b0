"""Recording of frames: `.blf`, `.asc` and `.log` keep everything.

Other formats lose fields and are not offered.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can

from sarrus.can.adapters import to_message
from sarrus.can.telling import WrongFlags
from sarrus.can.worker import Worker

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sarrus._native import Frame

ENDINGS = (".blf", ".asc", ".log")
"""Formats by the ending of the file."""


TIMEOUT = 10.0
"""Time to write what still waits when a recording ends `[s]`."""
ROOM = 1 << 16
"""Frames that may wait to be written."""


class Recorder:
    """A file of frames.

    In `.log` a bus has its name, in `.blf` and `.asc` its number in the configuration, from 1.

    A thread of its own writes; what a slow disk leaves no room for is lost and counted.
    """

    def __init__(self, path: str, names: Sequence[str]) -> None:
        if Path(path).suffix not in ENDINGS:
            raise WrongFlags(
                f"{path}: the ending must be one of {', '.join(ENDINGS)}; other formats lose fields"
            )
        self._path = path
        self._writer: Any = can.Logger(path)
        self._channels: list[str | int] = (
            list(names) if path.endswith(".log") else list(range(len(names)))
        )
        self._worker: Worker[tuple[float, int, Frame, bool]] = Worker(self._write, ROOM)
        self._is_ended = False

    def put(self, bus: int, frame: Frame, *, received: bool) -> None:
        """Add a frame with the present time; never waits."""
        self._worker.put((time.time(), bus, frame, received))

    @property
    def summary(self) -> str:
        """What was written."""
        lost = f", {self._worker.lost} lost" if self._worker.lost else ""
        error = f": {self._worker.error}" if self._worker.error else ""
        return f"{self._worker.done} frame(s) in {self._path}{lost}{error}"

    def _write(self, item: tuple[float, int, Frame, bool]) -> None:
        stamp, bus, frame, received = item
        message = to_message(frame)
        message.timestamp, message.channel, message.is_rx = stamp, self._channels[bus], received
        self._writer.on_message_received(message)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Write what still waits, and close the file."""
        if not self._is_ended:
            self._is_ended = True
            self._worker.end(TIMEOUT)
            self._writer.stop()
