"""Every way out of a program that has power on motors."""

from __future__ import annotations

import atexit
import os
import signal
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

IGNORED = (signal.SIGPIPE, signal.SIGXFSZ, signal.SIGTTIN, signal.SIGTTOU)
"""Signals that tell what a read or a write tells anyway, and would end or stop the program."""

_FAULTS = (
    signal.SIGABRT,
    signal.SIGBUS,
    signal.SIGFPE,
    signal.SIGILL,
    signal.SIGSEGV,
    signal.SIGSYS,
    signal.SIGTRAP,
)
_HARMLESS = (signal.SIGCHLD, signal.SIGCONT, signal.SIGURG, signal.SIGWINCH)
_NOBODYS = (signal.SIGKILL, signal.SIGSTOP)

SIGNALS = sorted(signal.valid_signals() - {*IGNORED, *_FAULTS, *_HARMLESS, *_NOBODYS})
"""Every other signal ends or stops a program that does nothing about it.

So each of them asks for an orderly end.
"""


def name_of(number: int) -> str:
    """A signal in words; most real-time signals have no name."""
    return next((known.name for known in signal.Signals if known == number), f"signal {number}")


class Leave(BaseException):
    """Somebody asked for the end; no `except Exception` may hold it up."""


class Ending:
    """Whether somebody asked for the end.

    Asked by a signal, or by the end of the process that started this one.
    """

    def __init__(self, *, deferred: bool) -> None:
        self._parent = os.getppid()
        self._noted: list[int] = []
        self._is_deferred = deferred

    def __bool__(self) -> bool:
        return bool(self.why)

    @property
    def why(self) -> str:
        """Who asked for the end; empty as long as nobody did."""
        if self._noted:
            return name_of(self._noted[0])
        return "" if os.getppid() == self._parent else "the parent is gone"

    def check(self) -> None:
        """Raise `Leave` if somebody asked for the end."""
        if why := self.why:
            raise Leave(why)

    def defer(self) -> None:
        """From now on, and until the program has ended, signals are only noted."""
        self._is_deferred = True

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self._noted.append(number)
        # only the first: a second one must not cut short what is done about the first
        if not self._is_deferred:
            self._is_deferred = True
            self.check()


@contextmanager
def ending(*, deferred: bool = True) -> Iterator[Ending]:
    """Give what tells within this block whether somebody asked for the end.

    If it is not deferred the first signal also raises `Leave` where the program is: for programs
    that wait for people and give no power, which `Ending.defer` makes good before power is given.
    """
    end = Ending(deferred=deferred)
    with ExitStack() as stack:
        for number in (*SIGNALS, *IGNORED):
            before = signal.signal(number, signal.SIG_IGN if number in IGNORED else end._note)
            # a handler that is not Python's cannot be put back
            if before is not None:
                stack.callback(signal.signal, number, before)
        yield end


@contextmanager
def at_the_end(safe: Callable[[], None]) -> Iterator[None]:
    """Call `safe` once when the block ends in any way, or when the interpreter ends inside it.

    No signal may raise here or inside the block: whoever enters it deferred its `Ending`.
    """
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
        try:
            once()
        finally:
            atexit.unregister(once)
