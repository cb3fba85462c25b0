"""The bridge under python-can: one thread, absolute deadlines, disable frames on every way out."""

from __future__ import annotations

import contextlib
import gc
import os
import resource
import time
from typing import TYPE_CHECKING, Any

from sarrus._native import Bridge, Configuration, Frame, Service, Telemetry
from sarrus.can.adapters import Adapter, Address, BusError, open_bus
from sarrus.can.leaving import Parent, at_the_end, signals
from sarrus.can.telling import say

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from sarrus.can.record import Recorder

LAST_WORDS = 5
"""How often the disable frames are sent on the way out: some may be lost."""
PAUSE = 0.005
"""Time between two of them `[s]`."""


class Front:
    """A bridge and its buses."""

    def __init__(self, bridge: Bridge, adapters: Sequence[Adapter | None], *, dry_run: bool = False) -> None:
        self.bridge = bridge
        self.adapters = list(adapters)
        self.dry_run = dry_run
        self.recorder: Recorder | None = None
        self._backlogs = [0] * len(self.adapters)

    def receive(self) -> None:
        """Give the bridge what came on the buses."""
        receive, recorder = self.bridge.receive, self.recorder
        for bus, adapter in enumerate(self.adapters):
            if adapter is None:
                continue
            try:
                now = time.monotonic_ns()
                for heard in adapter.receive():
                    if isinstance(heard, Frame):
                        receive(now, bus, heard)
                        if recorder is not None:
                            recorder.write(bus, heard, received=True)
                    else:
                        self.bridge.bus_event(now, bus, *heard)
            except BusError as error:
                self._lose(bus, error)

    def send(self) -> None:
        """Send the bridge's frames; what finds no room is dropped, since the next cycle knows better."""
        for bus, adapter in enumerate(self.adapters):
            frames = self.bridge.frames(bus)
            if self.recorder is not None:
                for frame in frames:
                    self.recorder.write(bus, frame, received=False)
            dropped = len(frames)
            if adapter is not None and not self.dry_run:
                try:
                    dropped, backlog = adapter.send(frames), adapter.backlog()
                except BusError as error:
                    self._lose(bus, error)
                else:
                    if backlog != self._backlogs[bus]:
                        self._backlogs[bus] = backlog
                        self.bridge.bus_event(time.monotonic_ns(), bus, "backlog", backlog)
            if dropped:
                self.bridge.bus_event(time.monotonic_ns(), bus, "dropped", dropped)

    def disable(self) -> None:
        """Take the power from every motor, over every bus that still takes frames."""
        self.bridge.shutdown()
        for _ in range(LAST_WORDS):
            for bus, adapter in enumerate(self.adapters):
                if adapter is not None and not self.dry_run:
                    with contextlib.suppress(BusError):
                        adapter.send(self.bridge.frames(bus))
            time.sleep(PAUSE)

    def close(self) -> None:
        """Give the buses back."""
        for adapter in self.adapters:
            if adapter is not None:
                adapter.close()

    def _lose(self, bus: int, error: BusError) -> None:
        """A bus that is gone is off; its mechanisms stop, the others go on."""
        say(f"sarrus.can: {error}; start again to use it")
        self.bridge.bus_event(time.monotonic_ns(), bus, "bus_off", 1)
        if (adapter := self.adapters[bus]) is not None:
            adapter.close()
            self.adapters[bus] = None

    @property
    def is_alone(self) -> bool:
        """Whether no bus is left."""
        return all(adapter is None for adapter in self.adapters)


def open_all(buses: Iterable[dict[str, Any]], address: Callable[[dict[str, Any]], Address]) -> list[Adapter]:
    """Open every bus or none."""
    adapters: list[Adapter] = []
    try:
        adapters.extend(open_bus(address(bus)) for bus in buses)
    except BaseException:
        for adapter in adapters:
            adapter.close()
        raise
    return adapters


def realtime() -> list[str]:
    """Ask the system for deadlines that hold; what it does not permit is told."""
    told = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except OSError as error:
        told.append(f"no SCHED_FIFO: {error.strerror}; deadlines are missed under load")
    # with a limit, a lock of future memory would make later requests for memory fail
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY:
        told.append("memory is not locked: RLIMIT_MEMLOCK is limited (`ulimit -l unlimited`)")
    else:
        import ctypes

        mcl_current, mcl_future = 1, 2
        if ctypes.CDLL(None, use_errno=True).mlockall(mcl_current | mcl_future) != 0:
            told.append(f"memory is not locked: {os.strerror(ctypes.get_errno())}")
    return told


def run(
    configuration: Configuration,
    name: str,
    address: Callable[[dict[str, Any]], Address],
    *,
    seconds: float | None = None,
    dry_run: bool = False,
    wants_realtime: bool = True,
    recorder: Callable[[list[str]], Recorder] | None = None,
) -> int:
    """Run the bridge of a configuration until a signal, its parent's end, or for some seconds; its exit code."""
    for warning in configuration.warnings:
        say(f"sarrus.can: warning: {warning}")
    period, fingerprint, buses = configuration.period_ns, configuration.fingerprint, configuration.buses
    parent = Parent()
    with contextlib.ExitStack() as stack:
        noted = stack.enter_context(signals())
        adapters = open_all(buses, address)
        front = Front(Bridge(configuration), adapters, dry_run=dry_run)
        stack.callback(front.close)
        if recorder is not None:
            front.recorder = stack.enter_context(recorder([bus["name"] for bus in buses]))
        service = Service(name)
        stack.callback(service.close)
        # registered last, so that it comes first
        stack.enter_context(at_the_end(front.disable))
        if wants_realtime:
            for line in realtime():
                say(f"sarrus.can: {line}")
        # the loop makes no cycles of references, and a collection takes longer than a cycle of the bridge
        gc.collect()
        gc.freeze()
        gc.disable()
        say(f"ready {name} {fingerprint:016x}", out=True)
        return _loop(front, service, period, noted, parent, seconds)


def in_words(times: dict[str, int]) -> str:
    """A distribution of times, in microseconds."""
    p50, p99, p999, longest = (f"{times[key] / 1000:.0f} µs" for key in ("p50", "p99", "p999", "max"))
    return f"p50 {p50}, p99 {p99}, p99.9 {p999}, longest {longest}"


def _loop(front: Front, service: Service, period: int, noted: list[int], parent: Parent, seconds: float | None) -> int:
    missed = 0
    begin = deadline = time.monotonic_ns()
    telemetry = Telemetry(front.bridge, begin)
    end = None if seconds is None else begin + int(seconds * 1e9)
    why = "the time is over"
    while end is None or deadline < end:
        if (left := deadline - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)
        if noted:
            why = f"signal {noted[0]}"
            break
        if parent.is_gone():
            why = "the parent is gone"
            break
        if front.is_alone:
            why = "no bus is left"
            break
        now = time.monotonic_ns()
        front.receive()
        service.take(time.monotonic_ns(), front.bridge)
        front.bridge.cycle(time.monotonic_ns())
        front.send()
        service.publish(front.bridge)
        done = time.monotonic_ns()
        telemetry.cycle(front.bridge, max(now - deadline, 0), done - now)
        service.publish_statistics(front.bridge, telemetry, done)
        # a deadline that is over is not made up for
        deadline += period
        if done > deadline:
            skipped = (done - deadline) // period + 1
            missed += skipped
            deadline += skipped * period
    times = telemetry.times(front.bridge)
    told = "; ".join(f"{name} {in_words(times[name])}" for name in ("wake", "work"))
    say(f"sarrus.can: {why}; {times['work']['count']} cycles, {missed} missed; {told}")
    return 1 if front.is_alone else 0
