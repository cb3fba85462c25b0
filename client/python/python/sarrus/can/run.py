"""`run`: the loop of `sarrus-can-run` over adapters of python-can.

The cycle runs in a thread without Python, and each bus in a thread that takes the interpreter's
lock to call its adapter: a busy interpreter may delay a bus, but never the cycle.
"""

from __future__ import annotations

import gc
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from sarrus._native import Frame, run_bridge
from sarrus.can.adapters import Adapter, Address, open_bus
from sarrus.can.leaving import ending
from sarrus.can.record import Recorder
from sarrus.can.telling import say

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from sarrus._native import Configuration
    from sarrus.can.adapters import Event

GIVE_WAY = 1e-4
"""Time after which a thread of Python gives the interpreter's lock to a bus `[s]`."""


class Tap:
    """An adapter that also records its frames, and in a dry run sends none."""

    def __init__(
        self, adapter: Adapter, bus: int, recorder: Recorder | None, *, dry_run: bool
    ) -> None:
        self.address = adapter.address
        self.backlog, self.close = adapter.backlog, adapter.close
        self._adapter, self._bus = adapter, bus
        self._recorder, self._dry_run = recorder, dry_run
        self.age = 0.0

    def send(self, frames: Sequence[Frame]) -> int:
        """Send frames, then record the sent ones; a dry run records all of them."""
        dropped = 0 if self._dry_run else self._adapter.send(frames)
        if self._recorder is not None:
            for frame in frames[: len(frames) - dropped]:
                self._recorder.put(self._bus, frame, received=False)
        return dropped

    def receive(self) -> Iterator[Frame | Event]:
        """Receive, and record the frames."""
        for heard in self._adapter.receive():
            if self._recorder is not None and isinstance(heard, Frame):
                self._recorder.put(self._bus, heard, received=True)
            self.age = self._adapter.age
            yield heard


def run(
    configuration: Configuration,
    name: str,
    address: Callable[[dict[str, Any]], Address],
    *,
    seconds: float | None = None,
    dry_run: bool = False,
    wants_realtime: bool = True,
    record: str | None = None,
    log: str | None = None,
    fault_log: str | None = None,
) -> int:
    """Run the bridge of a configuration, and give its exit code.

    It ends on a signal, with its parent process, or after `seconds`. `record` is a file for all
    frames, `log` one for all inputs of the bridge, `fault_log` a folder for the inputs before each
    fault; `replay` reads the logs.
    """
    for warning in configuration.warnings:
        say(f"sarrus.can: warning: {warning}")
    buses, fingerprint = configuration.buses, configuration.fingerprint
    recorder = None if record is None else Recorder(record, [bus["name"] for bus in buses])
    with ExitStack() as stack:
        stop = stack.enter_context(ending())

        def opening(bus: int) -> Adapter:
            adapter = open_bus(address(buses[bus]))
            return Tap(adapter, bus, recorder, dry_run=dry_run)

        def ready() -> None:
            # only now: a bus that cannot be opened leaves an earlier recording unchanged
            if recorder is not None:
                stack.enter_context(recorder)
            say(f"ready {name} {fingerprint:016x}", out=True)

        # the threads of buses wait neither for other threads of Python nor for long collections
        sys.setswitchinterval(GIVE_WAY)
        gc.collect()
        gc.freeze()
        reason, counts = run_bridge(
            configuration,
            name,
            opening,
            ready,
            lambda: stop.why,
            seconds=seconds,
            dry_run=dry_run,
            realtime=wants_realtime,
            log=log,
            fault_log=fault_log,
        )
    times = "; ".join(f"{key} {in_words(counts[key])}" for key in ("wake", "work"))
    say(f"sarrus.can: {reason}; {counts['cycles']} cycles, {counts['missed']} missed; {times}")
    if recorder is not None:
        say(f"sarrus.can: {recorder.summary}")
    return 0


def in_words(times: dict[str, int]) -> str:
    """A distribution of times, in microseconds."""
    p50, p99, p999, longest = (
        f"{times[key] / 1000:.0f} µs" for key in ("p50", "p99", "p999", "max")
    )
    return f"p50 {p50}, p99 {p99}, p99.9 {p999}, longest {longest}"
