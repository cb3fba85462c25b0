"""The bridge's loop with buses that fail, and without motors."""

import tempfile
import threading
import time
import unittest
from pathlib import Path
from unittest import mock

from lateness import slowness
from sarrus.can import Address, Bridge, BusError, Configuration, Frame
from sarrus.can import run as running
from sarrus.can.run import Frontend
from sarrus.can.worker import Worker

MOTOR = """
- actuator: {bus}
  bus: {bus}
  drive: {{protocol: mit, variant: mini_cheetah, id: {id}, reply_id: 0, position_range: 12.5,
    velocity_range: 30, torque_range: 10,
    stiffness_range: 50, damping_range: 5}}
  sign: 1
  gear: 1
  offset: 0
  limits: {{effort: 5, velocity: 5}}
  damping: 0.1
  watchdog_ms: 100
  watchdog: believed
"""
BUSES = ("one", "two", "three")


def configuration():
    """Three buses with a motor each."""
    text = (
        "rate_hz: 250\nbuses:\n"
        + "".join(f"- {{name: {bus}, interface: virtual, channel: {bus}}}\n" for bus in BUSES)
        + "motors:"
    )
    text += "".join(MOTOR.format(bus=bus, id=place + 1) for place, bus in enumerate(BUSES))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.yml"
        path.write_text(text)
        return Configuration.load(path)


class Bus:
    """A bus that keeps what it is given, and fails as a test says."""

    def __init__(self, name):
        self.address = Address(name, "virtual", name)
        self.sent, self.heard = [], []
        self.error = None
        self.room = 100
        self.echoes = 0
        self.closed = 0

    def send(self, frames):
        if self.error:
            raise self.error
        self.sent += frames[: self.room]
        return len(frames[self.room :])

    def receive(self):
        if self.error:
            raise self.error
        yield from self.heard
        self.heard = []

    def backlog(self):
        return len(self.sent) - self.echoes

    def close(self):
        self.closed += 1
        if self.error:
            raise self.error


DISABLE = bytes.fromhex("FFFFFFFFFFFFFFFD")


class Losses(unittest.TestCase):
    def setUp(self):
        self.buses = [Bus(name) for name in BUSES]
        self.said = []
        self.frontend = Frontend(Bridge(configuration()), self.buses, self.said.append)
        self.addCleanup(self.frontend.close)
        self.frontend.bridge.cycle(time.monotonic_ns())

    def state(self, bus):
        return self.frontend.bridge.counters()["buses"][bus]["state"]

    def test_a_bus_that_fails_in_any_way_keeps_no_other_from_its_disable_frames(self):
        for error in (OSError("Broken pipe"), BusError("gone"), RuntimeError("anything")):
            with self.subTest(error=error):
                self.buses[0].error = error
                for bus in self.buses:
                    bus.sent.clear()
                self.frontend.disable()
                for bus in self.buses[1:]:
                    self.assertEqual(
                        [frame.data for frame in bus.sent], [DISABLE] * running.SHUTDOWN_REPEATS
                    )
                self.assertEqual([line.partition(":")[0] for line in self.said], ["one"])
                self.said.clear()

    def test_a_bus_that_fails_in_one_round_has_the_next(self):
        bus = self.buses[0]
        send, fails = bus.send, [OSError("once"), None, OSError("twice")]

        def sometimes(frames):
            error = fails.pop() if fails else None
            if error:
                raise error
            return send(frames)

        bus.send = sometimes
        self.frontend.disable()
        self.assertEqual(
            [frame.data for frame in bus.sent], [DISABLE] * (running.SHUTDOWN_REPEATS - 2)
        )
        self.assertEqual(self.said, [])

    def test_a_bus_that_cannot_be_closed_keeps_no_other_open(self):
        self.buses[0].error = OSError("Input/output error")
        self.frontend.close()
        self.assertEqual([bus.closed for bus in self.buses], [1, 1, 1])

    def test_the_core_knows_of_a_lost_bus_before_anybody_hears_of_it(self):
        seen = []
        self.frontend._say = lambda line: seen.append((line, self.state(0)))
        self.buses[0].error = BusError("one is gone")
        self.frontend.receive()
        self.assertEqual(seen, [("one is gone", "off")])
        # and the others go on
        self.frontend.send()
        self.assertTrue(all(bus.sent for bus in self.buses[1:]))

    def test_a_lost_bus_comes_back(self):
        again = Bus("one")
        tries = []

        def opening(address):
            tries.append(address)
            if len(tries) < 4:
                raise BusError("not there" if len(tries) < 3 else "not up")
            return again

        with (
            mock.patch.object(running, "open_bus", opening),
            mock.patch.object(running, "REOPEN", 0.01),
        ):
            self.buses[0].error = BusError("one is gone")
            self.frontend.send()
            self.assertEqual(self.state(0), "off")
            end = time.monotonic() + 10 * slowness()
            while self.frontend.adapters[0] is not again and time.monotonic() < end:
                self.frontend.receive()
                time.sleep(0.005)
        self.assertEqual([address.name for address in tries], ["one"] * 4)
        self.assertEqual(self.buses[0].closed, 1)
        self.assertEqual(self.state(0), "active")
        self.assertEqual(self.frontend.bridge.counters()["buses"][0]["restarted"], 1)
        self.assertEqual(self.said, ["one is gone", "not there", "not up", "one: open again"])
        self.frontend.bridge.cycle(time.monotonic_ns())
        self.frontend.send()
        self.assertTrue(again.sent)

    def test_a_bus_that_came_back_in_the_last_moment_has_the_shutdown_frames_too(self):
        again = Bus("one")
        self.frontend.adapters[0] = None
        self.frontend._back.append((0, again))
        self.frontend.disable()
        self.assertEqual([frame.data for frame in again.sent], [DISABLE] * running.SHUTDOWN_REPEATS)


class Backlogs(unittest.TestCase):
    def test_only_what_still_waits_in_the_next_cycle_is_a_backlog(self):
        bridge = mock.Mock(wraps=Bridge(configuration()))
        bus = Bus("one")
        frontend = Frontend(bridge, [bus], print)
        seen = []
        # echoes come between two cycles, then stay away once, and come again
        for echoes in (1, 2, 2, 4, 5):
            bridge.cycle(time.monotonic_ns())
            frontend.send()
            bus.echoes = echoes
            seen.append([call.args[3] for call in bridge.bus_event.call_args_list])
            bridge.bus_event.reset_mock()
        self.assertEqual(seen, [[], [], [], [1], [0]])


class Records:
    """A recorder that keeps what it is given."""

    def __init__(self):
        self.kept = []

    def put(self, bus, frame, *, received):
        self.kept.append((bus, frame, received))


class Recording(unittest.TestCase):
    def setUp(self):
        self.buses = [Bus(name) for name in BUSES]
        self.records = Records()

    def frontend(self, **other):
        frontend = Frontend(Bridge(configuration()), self.buses, print, **other)
        frontend.recorder = self.records
        self.addCleanup(frontend.close)
        frontend.bridge.cycle(time.monotonic_ns())
        return frontend

    def test_what_was_sent_is_recorded_after_it_was_sent_and_what_was_dropped_is_not(self):
        frontend = self.frontend()
        self.buses[1].room = 0
        put = self.records.put

        def after(bus, frame, *, received):
            self.assertIn(frame, self.buses[bus].sent)
            put(bus, frame, received=received)

        self.records.put = after
        frontend.send()
        self.assertEqual([bus for bus, _, _ in self.records.kept], [0, 2])

    def test_the_shutdown_frames_are_recorded(self):
        self.frontend().disable()
        of_bus = [
            frame.data for bus, frame, received in self.records.kept if bus == 2 and not received
        ]
        self.assertEqual(of_bus, [DISABLE] * running.SHUTDOWN_REPEATS)

    def test_what_came_is_recorded(self):
        frontend = self.frontend()
        self.buses[2].heard = [Frame(5, b"\1\2")]
        frontend.receive()
        self.assertEqual(self.records.kept, [(2, Frame(5, b"\1\2"), True)])

    def test_a_dry_run_sends_nothing_and_records_what_it_would_send(self):
        frontend = self.frontend(dry_run=True)
        frontend.send()
        frontend.disable()
        self.assertEqual([bus.sent for bus in self.buses], [[], [], []])
        self.assertEqual([bus for bus, _, _ in self.records.kept], [0, 1, 2])


class Asides(unittest.TestCase):
    def test_what_finds_no_room_is_lost_and_counted_and_nobody_waits(self):
        go, done = threading.Event(), []

        def work(item):
            go.wait(10 * slowness())
            if item == 2:
                raise OSError("disk full")
            done.append(item)

        worker = Worker(work, 5)
        begin = time.monotonic()
        for item in range(1000):
            worker.put(item)
        self.assertLess(time.monotonic() - begin, 5 * slowness())
        go.set()
        worker.end(10 * slowness())
        self.assertEqual(done, sorted(done))
        self.assertLessEqual(len(done), 6)
        self.assertEqual((len(done), str(worker.error)), (worker.done, "disk full"))
        self.assertEqual(worker.done + worker.lost, 1000)

    def test_who_works_for_ever_holds_up_no_end(self):
        worker = Worker(lambda _: threading.Event().wait(), 5)
        for item in range(3):
            worker.put(item)
        begin = time.monotonic()
        worker.end(0.1)
        self.assertLess(time.monotonic() - begin, 5 * slowness())
        self.assertEqual(worker.lost, 2)


if __name__ == "__main__":
    unittest.main()
