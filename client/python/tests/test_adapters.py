"""Adapters against a pseudo-terminal, python-can's virtual bus and sockets, without motors."""

import errno
import os
import pty
import random
import subprocess
import sys
import tempfile
import time
import tty
import unittest
from pathlib import Path

import can
from can.interfaces.slcan import slcanBus
from sarrus.can import Address, BusError, Frame, open_bus
from sarrus.can.adapters import AnyAdapter, events_of_error_frame, frame_of_line, line_of_frame, of_message, to_message
from sarrus.can.replay import frame_of_text

LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def frames(count, seed=20261121):
    """Random frames of every kind."""
    chance = random.Random(seed)
    for _ in range(count):
        fd, extended = chance.random() < 0.5, chance.random() < 0.5
        length = chance.choice(LENGTHS if fd else LENGTHS[:9])
        yield Frame(
            chance.randrange(1 << 29 if extended else 1 << 11),
            chance.randbytes(length),
            extended=extended,
            fd=fd,
            bit_rate_switch=fd and chance.random() < 0.5,
        )


class Terminal:
    """The adapter's side of a serial port."""

    def __init__(self):
        self.own, self.port = pty.openpty()
        tty.setraw(self.port)
        os.set_blocking(self.own, False)
        self.path = os.ttyname(self.port)

    def read(self):
        time.sleep(0.01)
        try:
            return os.read(self.own, 65536)
        except BlockingIOError:
            return b""

    def write(self, data):
        os.write(self.own, data)
        time.sleep(0.01)

    def close(self):
        for descriptor in (self.own, self.port):
            if descriptor is not None:
                os.close(descriptor)


class Lines(unittest.TestCase):
    def test_frames_come_back_from_lines_messages_and_text(self):
        for frame in frames(2000):
            self.assertEqual(frame_of_line(line_of_frame(frame)[:-1]), frame)
            self.assertEqual(of_message(to_message(frame)), frame)
            self.assertEqual(frame_of_text(str(frame)), frame)

    def test_lines_are_those_of_python_can(self):
        for frame in frames(500):
            written = []

            class Port:
                write_timeout = None
                write = staticmethod(written.append)
                flush = staticmethod(lambda: None)

            bus = slcanBus.__new__(slcanBus)
            bus.serialPortOrig = Port
            bus._is_shutdown = True
            bus.send(to_message(frame))
            self.assertEqual(written, [line_of_frame(frame)])

    def test_what_is_no_frame_gives_none(self):
        for line in (
            b"",
            b"t",
            b"t12",
            b"t123",
            b"t1239",
            b"t12320",
            b"t1232001",
            b"t1231zz",
            b"tFFF0",
            b"TFFFFFFFF0",
            b"x123",
            b"t1231001",
            b"t\xff",
        ):
            with self.subTest(line=line):
                self.assertIsNone(frame_of_line(line))
        # a time stamp may follow
        self.assertEqual(frame_of_line(b"t1231AA1234"), Frame(0x123, b"\xaa"))
        chance = random.Random(5)
        for _ in range(20000):
            frame_of_line(bytes(chance.choice(b"tTdDbB0123456789abcdefABCDEFzs\a\xff") for _ in range(chance.randrange(30))))

    def test_frames_that_cannot_be_are_refused(self):
        for parts in (
            {"id": 0x800},
            {"id": 1 << 29, "extended": True},
            {"id": 1, "data": bytes(9)},
            {"id": 1, "data": bytes(9), "fd": True},
        ):
            with self.assertRaises(ValueError):
                Frame(**parts)

    def test_messages_that_are_no_data_are_none(self):
        self.assertIsNone(of_message(can.Message(is_remote_frame=True)))
        self.assertIsNone(of_message(can.Message(is_error_frame=True)))
        self.assertIsNone(of_message(can.Message(arbitration_id=1, is_extended_id=False, data=bytes(9))))

    def test_error_frames_tell_the_state_of_the_controller(self):
        state = lambda bits: bytes([0, bits, 0, 0, 0, 0, 0, 0])  # noqa: E731
        self.assertEqual(events_of_error_frame(0x40, state(0)), [("bus_off", 1)])
        self.assertEqual(events_of_error_frame(0x100, state(0)), [("restarted", 1)])
        self.assertEqual(events_of_error_frame(0x04, state(0x20)), [("error_passive", 1)])
        self.assertEqual(events_of_error_frame(0x04, state(0x08)), [("error_warning", 1)])
        self.assertEqual(events_of_error_frame(0x04, state(0x40)), [("error_active", 1)])
        self.assertEqual(events_of_error_frame(0x04, state(0x03)), [("overrun", 1), ("dropped", 1)])
        self.assertEqual(events_of_error_frame(0x08, state(0x20)), [])


class Serial(unittest.TestCase):
    def setUp(self):
        self.terminal = Terminal()
        self.address = Address("arm", "slcan", self.terminal.path, 1_000_000)
        self.addCleanup(self.terminal.close)

    def open(self, **other):
        adapter = open_bus(Address("arm", "slcan", self.terminal.path, **{"bitrate": 1_000_000, **other}))
        self.addCleanup(adapter.close)
        return adapter

    def test_the_channel_is_opened_with_its_bit_rate_and_closed(self):
        adapter = self.open()
        opening = self.terminal.read()
        self.assertIn(b"C\rS8\r", opening)
        self.assertTrue(opening.endswith(b"O\r"), opening)
        adapter.close()
        self.assertEqual(self.terminal.read(), b"C\r")

    def test_data_go_at_their_own_rate_with_fd(self):
        self.open(data_bitrate=5_000_000)
        self.assertIn(b"S8\rY5\r", self.terminal.read())

    def test_frames_go_out_in_order_and_come_in(self):
        adapter = self.open()
        self.terminal.read()
        sent = list(frames(20))
        self.assertEqual(adapter.send(sent), 0)
        self.assertEqual(self.terminal.read(), b"".join(map(line_of_frame, sent)))
        # in pieces, with answers between
        data = b"z\r\r" + b"Z\r".join(map(line_of_frame, sent))
        heard = []
        for begin in range(0, len(data), 37):
            self.terminal.write(data[begin : begin + 37])
            heard += adapter.receive()
        self.assertEqual(heard, sent)

    def test_an_idle_port_is_not_a_closed_one(self):
        adapter = self.open()
        for _ in range(3):
            self.assertEqual(list(adapter.receive()), [])

    def test_a_port_that_takes_nothing_drops_whole_frames_and_never_waits(self):
        adapter = self.open()
        self.terminal.read()
        burst = list(frames(400))
        begin = time.monotonic()
        dropped = sum(adapter.send(burst) for _ in range(5))
        self.assertLess(time.monotonic() - begin, 5)
        self.assertGreater(dropped, 1000)
        # after room came, what arrives are whole lines of what was sent, once each, and the line that was begun is ended
        arrived = b""
        while data := self.terminal.read():
            arrived += data
        self.assertEqual(adapter.send([Frame(1)]), 0)
        while data := self.terminal.read():
            arrived += data
        lines = arrived.split(b"\r")
        self.assertEqual(lines.pop(), b"")
        known = {line_of_frame(frame)[:-1] for frame in burst} | {b"t0010"}
        self.assertEqual([line for line in lines if line not in known], [])
        self.assertEqual(len(lines), 5 * len(burst) - dropped + 1)

    def test_refusals_states_and_cut_lines_are_events(self):
        adapter = self.open()
        self.terminal.write(b"\a")
        self.assertEqual(list(adapter.receive()), [], "an answer to the opening")
        adapter.send([Frame(1)])
        self.terminal.write(b"\at12\rsw000100\rsp000130\rsb000255\rsa000000\re1o\rF00\r")
        names = [name for name, _ in adapter.receive()]
        self.assertEqual(names, ["dropped", "overrun", "error_warning", "error_passive", "bus_off", "error_active", "overrun"])

    def test_a_port_has_one_owner(self):
        adapter = self.open()
        with self.assertRaisesRegex(BusError, "in use by another program"):
            open_bus(self.address)
        adapter.close()
        self.open()

    def test_a_port_that_is_gone_is_told(self):
        adapter = self.open()
        os.close(self.terminal.own)
        self.terminal.own = None
        with self.assertRaises(BusError):
            for _ in range(10):
                list(adapter.receive())
                adapter.send([Frame(1)])

    def test_a_dead_port_is_refused_and_does_not_hang(self):
        os.set_blocking(self.terminal.port, False)
        try:
            while os.write(self.terminal.port, bytes(1024)):
                pass
        except OSError as error:
            self.assertEqual(error.errno, errno.EAGAIN)
        with self.assertRaisesRegex(BusError, "takes no bytes"):
            open_bus(self.address)

    def test_bit_rates_that_slcan_has_not_are_refused(self):
        with self.assertRaises(BusError):
            self.open(bitrate=123_456)


class Virtual(unittest.TestCase):
    def test_every_interface_of_python_can_works_by_its_own_send_and_recv(self):
        address = Address("arm", "virtual", "sarrus-test", 1_000_000, 5_000_000)
        one, other = open_bus(address), open_bus(address)
        self.assertIs(type(one), AnyAdapter)
        self.addCleanup(one.close)
        self.addCleanup(other.close)
        sent = list(frames(50))
        self.assertEqual(one.send(sent), 0)
        self.assertEqual(list(other.receive()), sent)
        self.assertEqual(list(one.receive()), [])

    def test_a_full_queue_is_counted_whatever_the_interface_calls_it(self):
        adapter = open_bus(Address("arm", "virtual", "sarrus-full"))
        self.addCleanup(adapter.close)
        for error, dropped in (
            (can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS), 2),
            (can.CanTimeoutError(), 2),
            (can.CanOperationError("Transmit buffer full"), 2),
            (can.CanOperationError("No such device", errno.ENODEV), None),
        ):

            def send(message, timeout=None, error=error):
                raise error

            adapter._bus.send = send
            if dropped is None:
                with self.assertRaises(BusError):
                    adapter.send([Frame(1), Frame(2)])
            else:
                self.assertEqual(adapter.send([Frame(1), Frame(2)]), dropped)

    def test_interfaces_that_are_not_there_are_told(self):
        for interface, channel in (("nonsense", "x"), ("socketcan", "nocan9"), ("slcan", "/dev/nothing")):
            with self.assertRaises(BusError):
                open_bus(Address("arm", interface, channel))


class Ends(unittest.TestCase):
    SCRIPT = """
import os, sys, time
from sarrus.can.leaving import Parent, at_the_end, interrupted, signals
kind, log = sys.argv[1:]
def safe():
    with open(log, "a") as file:
        file.write("safe\\n")
if kind == "loop":
    parent = Parent()
    with signals() as noted, at_the_end(safe):
        print("ready", flush=True)
        while not noted and not parent.is_gone():
            time.sleep(0.01)
elif kind == "people":
    with interrupted(), at_the_end(safe):
        print("ready", flush=True)
        time.sleep(60)
elif kind == "exception":
    with at_the_end(safe):
        raise RuntimeError
else:
    with at_the_end(safe):
        sys.exit(3)
"""

    def ends(self, kind, signal=None):
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "log"
            process = subprocess.Popen([sys.executable, "-c", self.SCRIPT, kind, str(log)], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            if signal:
                self.assertEqual(process.stdout.readline(), b"ready\n")
                process.send_signal(signal)
            process.communicate(timeout=20)
            return log.read_text()

    def test_every_way_out_makes_it_safe_once(self):
        from signal import SIGHUP, SIGINT, SIGTERM

        for kind in ("loop", "people"):
            for signal in (SIGHUP, SIGINT, SIGTERM):
                with self.subTest(kind=kind, signal=signal):
                    self.assertEqual(self.ends(kind, signal), "safe\n")
        for kind in ("exception", "exit"):
            with self.subTest(kind=kind):
                self.assertEqual(self.ends(kind), "safe\n")

    def test_the_end_of_the_parent_is_noticed(self):
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "log"
            middle = "import subprocess, sys; p = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE); p.stdout.readline()"
            subprocess.run([sys.executable, "-c", middle, sys.executable, "-c", self.SCRIPT, "loop", str(log)], check=True, timeout=20)
            end = time.monotonic() + 10
            while not log.exists() and time.monotonic() < end:
                time.sleep(0.02)
            self.assertEqual(log.read_text(), "safe\n")


if __name__ == "__main__":
    unittest.main()
