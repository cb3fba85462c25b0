"""Ends of a program whose motors have power."""

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
"""Signals beside an error of a read or write; unhandled they end or stop the program."""

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
_UNCATCHABLE = (signal.SIGKILL, signal.SIGSTOP)

SIGNALS = sorted(signal.valid_signals() - {*IGNORED, *_FAULTS, *_HARMLESS, *_UNCATCHABLE})
"""All other signals end or stop a program without a handler; here each asks for an orderly end."""


def name_of(number: int) -> str:
    """Give a signal's name, or its number: most real-time signals have no name."""
    return next((known.name for known in signal.Signals if known == number), f"signal {number}")


class Leave(BaseException):
    """A request to end, which no `except Exception` catches."""


class Ending:
    """A request to end: a signal, or the end of the parent process."""

    def __init__(self, *, deferred: bool) -> None:
        self._parent = os.getppid()
        self._noted: list[int] = []
        self._is_deferred = deferred

    def __bool__(self) -> bool:
        return bool(self.why)

    @property
    def why(self) -> str:
        """The signal, or the end of the parent; empty without a request."""
        if self._noted:
            return name_of(self._noted[0])
        return "" if os.getppid() == self._parent else "the parent is gone"

    def check(self) -> None:
        """Raise `Leave` if the end was requested."""
        if why := self.why:
            raise Leave(why)

    def defer(self) -> None:
        """Stop signals from raising `Leave`."""
        self._is_deferred = True

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self._noted.append(number)
        # a second signal must not interrupt the handling of the first
        if not self._is_deferred:
            self._is_deferred = True
            self.check()


@contextmanager
def ending(*, deferred: bool = True) -> Iterator[Ending]:
    """Handle signals within this block as requests to end.

    Unless deferred, the first signal raises `Leave` at once, for programs that wait for a user.
    They call `Ending.defer` before they power a motor.
    """
    end = Ending(deferred=deferred)
    with ExitStack() as stack:
        for number in (*SIGNALS, *IGNORED):
            before = signal.signal(number, signal.SIG_IGN if number in IGNORED else end._note)
            # a handler that is not Python's cannot be restored
            if before is not None:
                stack.callback(signal.signal, number, before)
        yield end


@contextmanager
def at_the_end(safe: Callable[[], None]) -> Iterator[None]:
    """Call `safe` once when the block ends in any way, or when the interpreter ends inside it.

    Signals must not raise inside the block: defer the `Ending` first.
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
