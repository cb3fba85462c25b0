"""Every way out of a program that has power on motors."""

from __future__ import annotations

import atexit
import os
import signal
from contextlib import contextmanager
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that ask for an orderly end."""


class Leave(BaseException):
    """A signal asked for the end; no `except Exception` may hold it up."""


class Parent:
    """The process that started this one; motors are not left under power when it is gone."""

    def __init__(self) -> None:
        self._number = os.getppid()

    def is_gone(self) -> bool:
        """Whether somebody else, or nobody, is the parent now."""
        return os.getppid() != self._number


@contextmanager
def signals() -> Iterator[list[int]]:
    """Within this block signals that ask for an end are only noted, in the list that it gives, for loops that look at it in every cycle."""
    noted: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        noted.append(number)

    before = {number: signal.signal(number, note) for number in SIGNALS}
    try:
        yield noted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def interrupted() -> Iterator[None]:
    """Within this block signals that ask for an end raise `Leave`, for programs that wait for people."""

    def leave(number: int, _frame: FrameType | None) -> NoReturn:
        raise Leave(signal.Signals(number).name)

    before = {number: signal.signal(number, leave) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def at_the_end(safe: Callable[[], None]) -> Iterator[None]:
    """Call `safe` once when the block ends in any way, or when the interpreter ends inside it; signals cannot cut it short."""
    done = False

    def once() -> None:
        nonlocal done
        if not done:
            done = True
            safe()

    atexit.register(once)
    try:
        yield
    finally:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        try:
            once()
        finally:
            atexit.unregister(once)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
