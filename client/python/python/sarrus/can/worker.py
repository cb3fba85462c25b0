"""Work that must not hold up a cycle.

It is done by a thread of its own, without the cycle's priority.
"""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

Item = TypeVar("Item")


class Worker(Generic[Item]):
    """A thread that does one thing with each item that it is given, in their order.

    What finds no room is lost and counted.
    """

    def __init__(self, work: Callable[[Item], object], room: int) -> None:
        self._work, self._room = work, room
        self._items: queue.SimpleQueue[Item | None] = queue.SimpleQueue()
        self._thread = start(self._run)
        self.done = 0
        self.lost = 0
        self.error: Exception | None = None
        """What went wrong first."""

    def put(self, item: Item) -> None:
        """Give an item; never waits."""
        if self._items.qsize() < self._room:
            self._items.put(item)
        else:
            self.lost += 1

    def end(self, seconds: float) -> None:
        """Let it finish what it has, if that takes no longer than this."""
        self._items.put(None)
        self._thread.join(seconds)
        self.lost += max(self._items.qsize() - 1, 0)

    def _run(self) -> None:
        while (item := self._items.get()) is not None:
            try:
                self._work(item)
                self.done += 1
            except Exception as error:
                self.lost += 1
                self.error = self.error or error


def start(work: Callable[[], object]) -> threading.Thread:
    """Start a thread of ordinary priority, which ends with the program."""

    def run() -> None:
        # a thread inherits its maker's priority
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        work()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def stderr_worker() -> Worker[str]:
    """A worker that writes lines on stderr.

    Nobody may be there to read them, or somebody who reads slowly: the program goes on.
    """
    return Worker(lambda line: os.write(2, f"sarrus.can: {line}\n".encode()), 100)
