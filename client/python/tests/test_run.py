"""The bridge's loop with buses that fail, and without motors."""

import contextlib
import json
import os
import tempfile
import threading
import time
import unittest
from pathlib import Path
from unittest import mock

from lateness import slowness
from sarrus._native import run_bridge
from sarrus.can import Address, BusError, Configuration, Frame
from sarrus.can import record as recording
from sarrus.can.record import Recorder
from sarrus.can.run import Tap

MOTOR = """
- actuator: {bus}
  bus: {bus}
  drive: {{protocol: mit, variant: mini_cheetah, id: {id}, reply_id: 0, position_range: 12.5,
    velocity_range: 30, torque_range: 10,
    stiffness_range: 50, damping_range: 5}}
  sign: 1
  gear: 1
  offset: 0
  limits: {{position: [-9, 9], effort: 5, velocity: 5}}
  damping: 0.1
  watchdog_ms: 100
  watchdog: believed
"""
BUSES = ("one", "two", "three")
DISABLE = bytes.fromhex("FFFFFFFFFFFFFFFD")
ROUNDS = 5
"""How often the loop sends the shutdown frames."""


def configuration(folder):
    """Three buses with a motor each."""
    text = (
        "rate_hz: 250\nbuses:\n"
        + "".join(f"- {{name: {bus}, interface: virtual, channel: {bus}}}\n" for bus in BUSES)
        + "motors:"
    )
    text += "".join(MOTOR.format(bus=bus, id=place + 1) for place, bus in enumerate(BUSES))
    path = folder / "robot.yml"
    path.write_text(text)
    return Configuration.load(path)


def until(condition):
    """Wait for a condition."""
    end = time.monotonic() + 20 * slowness()
    while not condition():
        if time.monotonic() > end:
            raise AssertionError("it does not happen")
        time.sleep(0.005)


class Bus:
    """A bus that keeps what it is given, and fails as a test says."""

    age = 0.0

    def __init__(self, name):
        self.address = Address(name, "virtual", name)
        self.sent, self.heard = [], []
        self.error = None
        self.room = 100
        self.waiting = self.last = 0
        self.closed = 0
        # the shutdown frames are sent without a call of `receive` between them
        self.has_received = False
        self.shutdown_errors = []

    def send(self, frames):
        if self.error:
            raise self.error
        has_received, self.has_received = self.has_received, False
        if not has_received and self.shutdown_errors:
            raise self.shutdown_errors.pop()
        self.sent += frames[: self.room]
        self.last = len(frames)
        return len(frames[self.room :])

    def receive(self):
        self.has_received = True
        if self.error:
            raise self.error
        yield from self.heard
        self.heard = []

    def backlog(self):
        return self.last + self.waiting

    def close(self):
        self.closed += 1
        if self.error:
            raise self.error


class Loop(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.buses = [Bus(name) for name in BUSES]
        self.opened = []

    def open(self, place):
        self.opened.append(place)
        return self.buses[place]

    @contextlib.contextmanager
    def running(self, opening=None, **options):
        """The loop, while the block runs; it has sent on every bus that sends."""
        stop, ready, ended = threading.Event(), threading.Event(), []

        def run():
            ended.append(
                run_bridge(
                    configuration(self.folder),
                    f"run-{os.getpid()}",
                    opening or self.open,
                    ready.set,
                    lambda: "enough" if stop.is_set() else "",
                    realtime=False,
                    log=self.folder / "log.jsonl",
                    fault_log=self.folder / "faults",
                    **options,
                )
            )

        thread = threading.Thread(target=run)
        self.report = None
        with (self.folder / "stderr").open("wb") as file:
            stderr = os.dup(2)
            os.dup2(file.fileno(), 2)
            try:
                thread.start()
                until(ready.is_set)
                yield
            finally:
                stop.set()
                thread.join()
                os.dup2(stderr, 2)
                os.close(stderr)
        self.assertEqual(ended[0][0], "enough")
        self.report = ended[0][1]

    def said(self):
        """Messages on stderr about the buses."""
        lines = (self.folder / "stderr").read_text().splitlines()
        messages = [line.removeprefix("sarrus.can: ") for line in lines]
        return [message for message in messages if message.startswith(BUSES)]

    def log(self, key, bus=None):
        """Lines of the log that have a key, of a bus."""
        lines = map(json.loads, (self.folder / "log.jsonl").read_text().splitlines())
        return [line for line in lines if key in line and bus in (None, line.get("bus"))]

    def sends(self, bus, count=1):
        """Wait until a bus has sent some frames more."""
        before = len(bus.sent)
        until(lambda: len(bus.sent) >= before + count)


class Losses(Loop):
    def test_a_bus_that_fails_in_any_way_keeps_no_other_from_its_disable_frames(self):
        for error in (OSError("Broken pipe"), BusError("gone"), RuntimeError("anything")):
            with self.subTest(error=error):
                self.buses = [Bus(name) for name in BUSES]
                with self.running():
                    for bus in self.buses:
                        self.sends(bus)
                    self.buses[0].error = error
                for bus in self.buses[1:]:
                    self.assertEqual(
                        [frame.data for frame in bus.sent[-ROUNDS:]], [DISABLE] * ROUNDS
                    )
                self.assertEqual({line.partition(":")[0] for line in self.said()}, {"one"})
                self.assertIn("cannot be commanded off", self.said()[-1])

    def test_a_bus_that_fails_in_one_round_has_the_next(self):
        bus = self.buses[0]
        bus.shutdown_errors = [OSError("once"), OSError("twice")]
        with self.running():
            self.sends(bus)
            before = len(bus.sent)
        self.assertEqual(bus.shutdown_errors, [])
        frames = [frame.data for frame in bus.sent[before:]]
        self.assertEqual(frames[-(ROUNDS - 2) :], [DISABLE] * (ROUNDS - 2))
        self.assertEqual(self.said(), [])

    def test_a_bus_that_cannot_be_closed_keeps_no_other_open(self):
        def fail():
            raise OSError("Input/output error")

        self.buses[0].close = fail
        with self.running():
            pass
        self.assertEqual([bus.closed for bus in self.buses[1:]], [1, 1])

    def test_buses_go_on_without_a_lost_one(self):
        with self.running():
            self.buses[0].error = BusError("one is gone")
            until(lambda: self.said() == ["one is gone"])
            for bus in self.buses[1:]:
                self.sends(bus, 3)
        self.assertIn("bus_off", [line["event"] for line in self.log("event", "one")])

    def test_a_lost_bus_comes_back(self):
        again = Bus("one")
        tries = []

        def opening(place):
            if place != 0 or self.buses[0].error is None:
                return self.open(place)
            tries.append(place)
            if len(tries) < 4:
                raise BusError("not there" if len(tries) < 3 else "not up")
            return again

        with self.running(opening):
            self.sends(self.buses[0])
            self.buses[0].error = BusError("one is gone")
            self.sends(again, 3)
        self.assertEqual((len(tries), self.buses[0].closed, again.closed), (4, 1, 1))
        self.assertEqual(
            self.said(), ["one is gone", "one: not there", "one: not up", "one: open again"]
        )
        events = [line["event"] for line in self.log("event", "one")]
        self.assertEqual(
            [event for event in events if event in ("bus_off", "restarted")],
            ["bus_off", "restarted"],
        )
        self.assertEqual([frame.data for frame in again.sent[-ROUNDS:]], [DISABLE] * ROUNDS)

    def test_a_bus_that_cannot_be_opened_is_an_error_and_closes_the_others(self):
        def opening(place):
            if place == 1:
                raise BusError("two cannot be opened")
            return self.open(place)

        with self.assertRaisesRegex(OSError, "^two cannot be opened$"):
            run_bridge(
                configuration(self.folder), f"run-{os.getpid()}", opening, int, str, realtime=False
            )
        self.assertEqual([bus.closed for bus in self.buses], [1, 0, 0])


class Cycles(Loop):
    def test_only_what_still_waits_in_the_next_cycle_is_a_backlog(self):
        bus = self.buses[0]
        with self.running():
            self.sends(bus, 10)
            for bus.waiting in (3, 0):
                self.sends(bus, 20)
        counts = [line["count"] for line in self.log("event", "one") if line["event"] == "backlog"]
        self.assertIn(3, counts)
        self.assertEqual(counts[-1], 0)

    def test_frames_and_events_of_an_adapter_reach_the_bridge(self):
        with self.running():
            self.buses[2].heard = [Frame(5, b"\1\2"), ("error_warning", 1), ("overrun", 2)]
            until(lambda: not self.buses[2].heard)
            self.sends(self.buses[2], 3)
        self.assertEqual([line["frame"] for line in self.log("frame", "three")], ["005#0102"])
        # a busy machine makes the bridge late
        others = ("dropped", "late")
        events = [line for line in self.log("event", "three") if line["event"] not in others]
        self.assertEqual([line["event"] for line in events], ["error_warning", "overrun"])
        self.assertEqual(events[1]["count"], 2)

    def test_a_busy_interpreter_delays_no_cycle(self):
        with self.running():
            self.sends(self.buses[0])
            numbers, begin, end = 1 << 22, 0, 0
            while end - begin < 200_000_000:
                numbers *= 2
                begin = time.monotonic_ns()
                # one instruction of the interpreter, which gives its lock to nobody meanwhile
                sum(range(numbers))
                end = time.monotonic_ns()
        cycles = [line["t"] for line in self.log("cycle")]
        self.assertEqual(self.report["cycles"], len(cycles))
        self.assertGreater(sum(begin < t < end for t in cycles), 5)

    def test_a_failure_of_python_ends_the_loop_without_power(self):
        def fail():
            raise KeyError("why")

        with self.assertRaises(KeyError):
            run_bridge(
                configuration(self.folder),
                f"run-{os.getpid()}",
                self.open,
                int,
                fail,
                realtime=False,
                fault_log=self.folder / "faults",
            )
        for bus in self.buses:
            self.assertEqual([frame.data for frame in bus.sent[-ROUNDS:]], [DISABLE] * ROUNDS)
            self.assertEqual(bus.closed, 1)


class Records:
    """A recorder that keeps what it is given."""

    def __init__(self):
        self.kept = []

    def put(self, bus, frame, *, received):
        self.kept.append((bus, frame, received))


class Recording(Loop):
    def setUp(self):
        super().setUp()
        self.records = Records()

    def tapped(self, place, *, dry_run=False):
        return Tap(self.open(place), place, self.records, dry_run=dry_run)

    def test_what_was_sent_is_recorded_after_it_was_sent_and_what_was_dropped_is_not(self):
        self.buses[1].room = 1
        put = self.records.put

        def after(bus, frame, *, received):
            self.assertIn(frame, self.buses[bus].sent)
            put(bus, frame, received=received)

        self.records.put = after
        frames = [Frame(1), Frame(2)]
        dropped = [self.tapped(place).send(frames) for place in range(2)]
        self.assertEqual(dropped, [0, 1])
        self.assertEqual(
            self.records.kept,
            [(0, Frame(1), False), (0, Frame(2), False), (1, Frame(1), False)],
        )

    def test_the_shutdown_frames_are_recorded(self):
        with self.running(self.tapped):
            self.sends(self.buses[2])
        of_bus = [
            frame.data for bus, frame, received in self.records.kept if bus == 2 and not received
        ]
        self.assertEqual(of_bus[-ROUNDS:], [DISABLE] * ROUNDS)
        self.assertEqual(of_bus, [frame.data for frame in self.buses[2].sent])

    def test_what_came_is_recorded(self):
        self.buses[2].heard = [Frame(5, b"\1\2"), ("bus_off", 1)]
        self.assertEqual(list(self.tapped(2).receive()), [Frame(5, b"\1\2"), ("bus_off", 1)])
        self.assertEqual(self.records.kept, [(2, Frame(5, b"\1\2"), True)])

    def test_a_dry_run_sends_nothing_and_records_what_it_would_send(self):
        with self.running(lambda place: self.tapped(place, dry_run=True), dry_run=True):
            until(lambda: {bus for bus, _, _ in self.records.kept} == {0, 1, 2})
        self.assertEqual([bus.sent for bus in self.buses], [[], [], []])
        # the bridge counts every frame as dropped
        dropped = [line["count"] for line in self.log("event", "one") if line["event"] == "dropped"]
        self.assertEqual(set(dropped), {1})


class Recorders(unittest.TestCase):
    def recorder(self, write):
        writer = mock.Mock(on_message_received=write)
        patch = mock.patch("can.Logger", return_value=writer)
        patch.start()
        self.addCleanup(patch.stop)
        return Recorder("all.log", BUSES)

    def test_what_finds_no_room_is_lost_and_counted_and_nobody_waits(self):
        go, done = threading.Event(), []

        def write(message):
            go.wait(10 * slowness())
            if message.arbitration_id == 2:
                raise OSError("disk full")
            done.append(message.arbitration_id)

        with mock.patch.object(recording, "ROOM", 5), self.recorder(write) as recorder:
            begin = time.monotonic()
            for number in range(1000):
                recorder.put(0, Frame(number), received=False)
            self.assertLess(time.monotonic() - begin, 5 * slowness())
            go.set()
        self.assertEqual(done, sorted(done))
        self.assertLessEqual(len(done), 6)
        self.assertEqual(
            recorder.summary,
            f"{len(done)} frame(s) in all.log, {1000 - len(done)} lost: disk full",
        )

    def test_who_works_for_ever_holds_up_no_end(self):
        begin = time.monotonic()
        recorder = self.recorder(lambda _: threading.Event().wait())
        with mock.patch.object(recording, "TIMEOUT", 0.1), recorder:
            for number in range(3):
                recorder.put(0, Frame(number), received=True)
        self.assertLess(time.monotonic() - begin, 5 * slowness())
        self.assertEqual(recorder.summary, "0 frame(s) in all.log, 2 lost")


if __name__ == "__main__":
    unittest.main()
