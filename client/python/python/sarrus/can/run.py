"""The bridge under python-can: one thread, absolute deadlines, disable frames on every way out."""

from __future__ import annotations

import contextlib
import gc
import os
import resource
import sys
import threading
import time
from collections import deque
from typing import TYPE_CHECKING, Any

from sarrus._native import Bridge, Configuration, Frame, Service, Telemetry
from sarrus.can.adapters import Adapter, Address, BusError, close_all, open_bus
from sarrus.can.leaving import Ending, at_the_end, ending
from sarrus.can.record import Recorder
from sarrus.can.telling import say
from sarrus.can.worker import start, stderr_worker

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

SHUTDOWN_REPEATS = 5
"""How often the disable frames are sent on the way out: some may be lost."""
PAUSE = 0.005
"""Time between two of them `[s]`."""
REOPEN = 0.5
"""Time between two tries to open a bus that is gone `[s]`."""
GIVE_WAY = 1e-4
"""Time after which another thread gives way to the cycle `[s]`."""


class Frontend:
    """A bridge and its buses. A bus that goes away is off, and is opened again when it is back."""

    def __init__(
        self,
        bridge: Bridge,
        adapters: Sequence[Adapter],
        say: Callable[[str], None],
        *,
        dry_run: bool = False,
    ) -> None:
        self.bridge = bridge
        self.adapters: list[Adapter | None] = list(adapters)
        self.names = [adapter.address.name for adapter in adapters]
        self.dry_run = dry_run
        self.recorder: Recorder | None = None
        self._say = say
        self._backlogs = [0] * len(self.adapters)
        # buses that were opened again, by the threads that did it
        self._back: deque[tuple[int, Adapter]] = deque()
        self._closed = threading.Event()

    def receive(self) -> None:
        """Give the bridge what came on the buses."""
        self._take_back()
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
                            recorder.put(bus, heard, received=True)
                    else:
                        self.bridge.bus_event(now, bus, *heard)
            except BusError as error:
                self._lose(bus, adapter, error)

    def send(self) -> None:
        """Send the bridge's frames.

        What finds no room is dropped, since the next cycle knows better.
        """
        for bus, adapter in enumerate(self.adapters):
            frames = self.bridge.frames(bus)
            dropped = len(frames)
            if self.dry_run:
                self._record(bus, frames)
            elif adapter is not None:
                try:
                    # what still waits now is of an earlier cycle
                    backlog, dropped = adapter.backlog(), adapter.send(frames)
                except BusError as error:
                    self._lose(bus, adapter, error)
                else:
                    self._record(bus, frames[: len(frames) - dropped])
                    if backlog != self._backlogs[bus]:
                        self._backlogs[bus] = backlog
                        self.bridge.bus_event(time.monotonic_ns(), bus, "backlog", backlog)
            if dropped:
                self.bridge.bus_event(time.monotonic_ns(), bus, "dropped", dropped)

    def disable(self) -> None:
        """Take the power from every motor, over every bus that still takes frames."""
        self.bridge.shutdown()
        with contextlib.suppress(Exception):
            self._take_back()
        unreached = {
            bus for bus in range(len(self.adapters)) if self.bridge.frames(bus) and not self.dry_run
        }
        for _ in range(SHUTDOWN_REPEATS):
            for bus, adapter in enumerate(self.adapters):
                if adapter is not None and not self.dry_run:
                    # whatever is wrong with this bus now, the others and the next round are tried
                    with contextlib.suppress(Exception):
                        frames = self.bridge.frames(bus)
                        dropped = adapter.send(frames)
                        self._record(bus, frames[: len(frames) - dropped])
                        if dropped == 0:
                            unreached.discard(bus)
            time.sleep(PAUSE)
        for bus in sorted(unreached):
            self._say(
                f"{self.names[bus]}: the frames that take the power found no way; "
                "the motors' own watchdogs are left"
            )

    def close(self) -> None:
        """Give the buses back."""
        self._closed.set()
        close_all(adapter for adapter in self.adapters if adapter is not None)
        close_all(adapter for _, adapter in self._back)

    def _record(self, bus: int, frames: Sequence[Frame]) -> None:
        if self.recorder is not None:
            for frame in frames:
                self.recorder.put(bus, frame, received=False)

    def _lose(self, bus: int, adapter: Adapter, error: BusError) -> None:
        """A bus that is gone is off; its mechanisms stop, the others go on."""
        self.bridge.bus_event(time.monotonic_ns(), bus, "bus_off", 1)
        self.adapters[bus], self._backlogs[bus] = None, 0
        start(lambda: self._reopen(bus, adapter))
        self._say(str(error))

    def _reopen(self, bus: int, adapter: Adapter) -> None:
        """Try to open a bus that is gone until it is back.

        Runs in a thread of its own, since it may take long.
        """
        close_all([adapter])
        said = ""
        while not self._closed.wait(REOPEN):
            try:
                adapter = open_bus(adapter.address)
            except Exception as error:
                if said != (said := str(error)):
                    self._say(said)
                # errors hold cycles of references, and nobody else collects them
                gc.collect()
                continue
            if self._closed.is_set():
                close_all([adapter])
            else:
                self._back.append((bus, adapter))
            return

    def _take_back(self) -> None:
        while self._back:
            bus, adapter = self._back.popleft()
            self.adapters[bus] = adapter
            self.bridge.bus_event(time.monotonic_ns(), bus, "restarted", 1)
            self._say(f"{adapter.address.name}: open again")


def open_all(
    buses: Iterable[dict[str, Any]], address: Callable[[dict[str, Any]], Address]
) -> list[Adapter]:
    """Open every bus or none."""
    adapters: list[Adapter] = []
    try:
        adapters.extend(open_bus(address(bus)) for bus in buses)
    except BaseException:
        close_all(adapters)
        raise
    return adapters


def realtime() -> list[str]:
    """Ask the system for deadlines that hold; what it does not permit is in the notes."""
    notes = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    except OSError as error:
        notes.append(f"no SCHED_FIFO: {error.strerror}; deadlines are missed under load")
    # with a limit, a lock of future memory would make later requests for memory fail
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY:
        notes.append("memory is not locked: RLIMIT_MEMLOCK is limited (`ulimit -l unlimited`)")
    else:
        import ctypes

        mcl_current, mcl_future = 1, 2
        if ctypes.CDLL(None, use_errno=True).mlockall(mcl_current | mcl_future) != 0:
            notes.append(f"memory is not locked: {os.strerror(ctypes.get_errno())}")
    return notes


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
    """Run the bridge of a configuration until a signal, its parent's end, or for some seconds.

    Give its exit code.


    `record` is a file for all frames, `log` one for everything that the bridge is given, which
    `replay` reads; `fault_log` is a folder for what led to each fault, which `replay` reads too.
    """
    for warning in configuration.warnings:
        say(f"sarrus.can: warning: {warning}")
    period, fingerprint, buses = (
        configuration.period_ns,
        configuration.fingerprint,
        configuration.buses,
    )
    # what has nothing to do with power comes last: of these the last one entered is left first
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(ending())
        stderr = stderr_worker()
        stack.callback(stderr.end, 1.0)
        bridge = Bridge(configuration)
        # before the buses: who has the name says more than who has a bus
        service = Service(name)
        stack.callback(service.close)
        frontend = Frontend(bridge, open_all(buses, address), stderr.put, dry_run=dry_run)
        stack.callback(frontend.close)
        # a bus that cannot be opened leaves an earlier recording as it is
        if record is not None:
            frontend.recorder = stack.enter_context(
                Recorder(record, [bus["name"] for bus in buses])
            )
        if log is not None:
            bridge.begin_log(log)
            stack.callback(bridge.end_log)
        bridge.begin_fault_log(name, fault_log)
        stack.callback(bridge.end_fault_log)
        # threads that write and open give way to the cycle soon
        sys.setswitchinterval(GIVE_WAY)
        if wants_realtime:
            for line in realtime():
                stderr.put(line)
        # the loop makes no cycles of references, and a collection takes longer than a cycle of the
        # bridge
        gc.collect()
        gc.freeze()
        gc.disable()
        with at_the_end(frontend.disable):
            say(f"ready {name} {fingerprint:016x}", out=True)
            report = _loop(frontend, service, period, stop, seconds)
        stderr.put(report())
        if (logged := bridge.end_log()) is not None:
            lines, lost = logged
            stderr.put(
                f"{lines} line(s) in {log}"
                + (f", {lost} lost: it cannot be replayed" if lost else "")
            )
        if missing := bridge.end_fault_log():
            stderr.put(f"{missing} input(s) are missing in the logs of faults")
        if frontend.recorder is not None:
            frontend.recorder.end()
            stderr.put(frontend.recorder.summary)
    return 0


def in_words(times: dict[str, int]) -> str:
    """A distribution of times, in microseconds."""
    p50, p99, p999, longest = (
        f"{times[key] / 1000:.0f} µs" for key in ("p50", "p99", "p999", "max")
    )
    return f"p50 {p50}, p99 {p99}, p99.9 {p999}, longest {longest}"


def _loop(
    frontend: Frontend, service: Service, period: int, stop: Ending, seconds: float | None
) -> Callable[[], str]:
    """Cycle until the end.

    Gives what makes the report, which takes time that motors under power do not have.
    """
    missed = 0
    begin = deadline = time.monotonic_ns()
    telemetry = Telemetry(frontend.bridge, begin)
    end = None if seconds is None else begin + int(seconds * 1e9)
    why = ""
    while end is None or deadline < end:
        if (left := deadline - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)
        if why := stop.why:
            break
        now = time.monotonic_ns()
        frontend.receive()
        service.take(time.monotonic_ns(), frontend.bridge)
        frontend.bridge.cycle(time.monotonic_ns())
        frontend.send()
        service.publish(frontend.bridge)
        done = time.monotonic_ns()
        telemetry.cycle(frontend.bridge, max(now - deadline, 0), done - now)
        service.publish_statistics(frontend.bridge, telemetry, done)
        # a deadline that is over is not made up for
        deadline += period
        if done > deadline:
            skipped = (done - deadline) // period + 1
            missed += skipped
            deadline += skipped * period

    def report() -> str:
        times = telemetry.times(frontend.bridge)
        all_of_them = "; ".join(f"{name} {in_words(times[name])}" for name in ("wake", "work"))
        return (
            f"{why or 'the time is over'}; {times['work']['count']} cycles, {missed} missed; "
            f"{all_of_them}"
        )

    return report
