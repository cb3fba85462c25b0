"""Recording of frames in `.blf`, `.asc` and `.log`, which keep all fields of a frame."""

from __future__ import annotations

import queue
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can

from sarrus.can.adapters import to_message
from sarrus.can.telling import WrongFlags

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sarrus._native import Frame

ENDINGS = (".blf", ".asc", ".log")
"""Formats by the ending of the file."""
TIMEOUT = 10.0
"""Longest time to write the waiting frames when a recording ends `[s]`."""
ROOM = 1 << 16
"""Frames that may wait to be written."""


class Recorder:
    """A file of frames, created on entry to the context and closed on exit.

    `.log` identifies a bus by name, `.blf` and `.asc` by its number in the configuration, from 1. A
    separate thread writes; frames are dropped and counted if a slow disk leaves no room.
    """

    def __init__(self, path: str, names: Sequence[str]) -> None:
        if Path(path).suffix not in ENDINGS:
            raise WrongFlags(
                f"{path}: the ending must be one of {', '.join(ENDINGS)}; other formats lose fields"
            )
        self._path = path
        self._channels: Sequence[str | int] = names if path.endswith(".log") else range(len(names))
        self._writer: Any = None
        self._waiting: queue.SimpleQueue[tuple[float, int, Frame, bool] | None]
        self._waiting = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._written = self._lost = 0
        self._error: Exception | None = None

    def put(self, bus: int, frame: Frame, *, received: bool) -> None:
        """Add a frame with the present time; never waits."""
        if self._waiting.qsize() < ROOM:
            self._waiting.put((time.time(), bus, frame, received))
        else:
            self._lost += 1

    @property
    def summary(self) -> str:
        """The number of frames written and lost, and the first error."""
        lost = f", {self._lost} lost" if self._lost else ""
        error = f": {self._error}" if self._error else ""
        return f"{self._written} frame(s) in {self._path}{lost}{error}"

    def _run(self) -> None:
        while (item := self._waiting.get()) is not None:
            stamp, bus, frame, received = item
            message = to_message(frame)
            message.timestamp, message.is_rx = stamp, received
            message.channel = self._channels[bus]
            try:
                self._writer.on_message_received(message)
                self._written += 1
            except Exception as error:
                self._lost += 1
                self._error = self._error or error

    def __enter__(self) -> Recorder:
        self._writer = can.Logger(self._path)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._waiting.put(None)
        self._thread.join(TIMEOUT)
        self._lost += max(self._waiting.qsize() - 1, 0)
        self._writer.stop()
