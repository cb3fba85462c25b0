"""Adapters against a pseudo-terminal, python-can's virtual bus and sockets, without motors."""

import errno
import os
import pty
import random
import struct
import time
import tty
import unittest

import can
from can.interfaces.slcan import slcanBus
from lateness import slowness
from sarrus._native import SlcanReader, slcan_line
from sarrus.can import Address, BusError, Frame, open_bus
from sarrus.can.adapters import (
    AnyAdapter,
    SocketcanAdapter,
    age_of,
    events_of_error_frame,
    of_message,
    to_message,
)

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
    def test_frames_come_back_from_lines_and_messages(self):
        reader = SlcanReader()
        for frame in frames(2000):
            self.assertEqual(reader.take(slcan_line(frame)), [frame])
            self.assertEqual(of_message(to_message(frame)), frame)

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
            self.assertEqual(written, [slcan_line(frame)])

    def test_a_line_that_is_too_long_is_none_and_neither_is_its_end(self):
        # what looks like a frame is the end of a line whose beginning was too long to keep
        for length in (150, 1000, 16384, 100_000):
            reader = SlcanReader()
            whole = b"t" * length + b"t1231AA\r" + b"t1231BB\r"
            heard = [
                what
                for begin in range(0, len(whole), 4096)
                for what in reader.take(whole[begin : begin + 4096])
            ]
            self.assertEqual(heard, [("overrun", 1), Frame(0x123, b"\xbb")])

    def test_a_frame_is_as_old_as_its_time_says_on_the_clock_of_the_system_alone(self):
        self.assertGreaterEqual(age_of(time.time() - 0.05), 0.05)
        # times since the start of an interface, and those of a clock that was set
        for timestamp in (0.0, 12.5, time.time() - 3600, time.time() + 3600):
            self.assertEqual(age_of(timestamp), 0.0)

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
        self.assertIsNone(
            of_message(can.Message(arbitration_id=1, is_extended_id=False, data=bytes(9)))
        )

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
        adapter = open_bus(
            Address("arm", "slcan", self.terminal.path, **{"bitrate": 1_000_000, **other})
        )
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
        self.assertEqual(self.terminal.read(), b"".join(map(slcan_line, sent)))
        # in pieces, with answers between
        data = b"z\r\r" + b"Z\r".join(map(slcan_line, sent))
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
        self.assertLess(time.monotonic() - begin, 5 * slowness())
        self.assertGreater(dropped, 1000)
        # after room came, what arrives are whole lines of what was sent, once each, and the line
        # that was begun is ended
        arrived = b""
        while data := self.terminal.read():
            arrived += data
        self.assertEqual(adapter.send([Frame(1)]), 0)
        while data := self.terminal.read():
            arrived += data
        lines = arrived.split(b"\r")
        self.assertEqual(lines.pop(), b"")
        known = {slcan_line(frame)[:-1] for frame in burst} | {b"t0010"}
        self.assertEqual([line for line in lines if line not in known], [])
        self.assertEqual(len(lines), 5 * len(burst) - dropped + 1)

    def test_refusals_states_and_cut_lines_are_events(self):
        adapter = self.open()
        self.terminal.write(b"\a")
        self.assertEqual(list(adapter.receive()), [], "an answer to the opening")
        adapter.send([Frame(1)])
        self.terminal.write(b"\at12\rsw000100\rsp000130\rsb000255\rsa000000\re1o\rF00\r")
        names = [name for name, _ in adapter.receive()]
        self.assertEqual(
            names,
            [
                "dropped",
                "overrun",
                "error_warning",
                "error_passive",
                "bus_off",
                "error_active",
                "overrun",
            ],
        )

    def test_a_port_has_one_owner(self):
        adapter = self.open()
        with self.assertRaisesRegex(BusError, "in use by another program"):
            open_bus(self.address)
        adapter.close()
        self.open()

    def test_a_port_that_is_gone_is_reported(self):
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


class Refusing:
    """A python-can bus that fails in one way."""

    def __init__(self, error):
        self.error = error

    def _fail(self, *_, **__):
        raise self.error

    send = recv = shutdown = _fail


class Interface:
    """What a kernel gives to a raw socket, without a kernel that has CAN."""

    def __init__(self):
        self.answers, self.refusal = [], None

    def send(self, packed):
        if self.refusal is not None:
            raise OSError(self.refusal, os.strerror(self.refusal))

    def recvmsg(self, *_):
        if not self.answers:
            raise BlockingIOError
        answer = self.answers.pop(0)
        if isinstance(answer, int):
            raise OSError(answer, os.strerror(answer))
        return answer

    def getsockopt(self, *_):
        return bytes(36)


class Socketcan(unittest.TestCase):
    def setUp(self):
        self.adapter = SocketcanAdapter.__new__(SocketcanAdapter)
        self.adapter.address = Address("arm", "socketcan", "can0")
        self.adapter._socket = self.socket = Interface()
        self.adapter._waiting = self.adapter._lost = 0
        self.adapter._echoed = 0.0
        self.adapter._news = []

    def test_the_kernel_is_asked_for_an_interface_before_it_is_used(self):
        # every computer has this one: no CAN, so no rate and no controller
        self.assertEqual(self.adapter._look("lo"), [])
        with self.assertRaisesRegex(BusError, "arm: .*No such device"):
            self.adapter._look("none")
        self.adapter.address = Address("arm", "socketcan", "lo", data_bitrate=5_000_000)
        with self.assertRaisesRegex(BusError, "arm: lo: the interface carries no CAN FD"):
            self.adapter._look("lo")

    def test_news_of_the_opening_come_first(self):
        self.adapter._news = [("error_passive", 1)]
        self.assertEqual(list(self.adapter.receive()), [("error_passive", 1)])
        self.assertEqual(list(self.adapter.receive()), [])

    def errors(self, kind):
        return (struct.pack("=IB3x8s", 1 << 29 | kind, 8, bytes(8)), (), 0, None)

    def test_frames_wait_until_their_echo_comes(self):
        self.assertEqual(self.adapter.send([Frame(1), Frame(2), Frame(3)]), 0)
        self.assertEqual(self.adapter.backlog(), 3)
        self.socket.answers = [(bytes(16), (), 0x800, None)] * 2
        self.assertEqual(list(self.adapter.receive()), [])
        self.assertEqual(self.adapter.backlog(), 1)

    def test_nothing_waits_after_a_bus_was_off_or_came_back(self):
        for kind, event in ((0x40, ("bus_off", 1)), (0x100, ("restarted", 1))):
            self.adapter.send([Frame(1), Frame(2)])
            self.socket.answers = [self.errors(kind)]
            self.assertEqual(list(self.adapter.receive()), [event])
            self.assertEqual(self.adapter.backlog(), 0)

    def test_echoes_that_stay_away_are_not_waited_for_for_ever(self):
        self.adapter.send([Frame(1), Frame(2)])
        self.assertEqual(self.adapter.backlog(), 2)
        self.adapter._echoed -= 10
        self.assertEqual(self.adapter.backlog(), 0)

    def test_an_interface_that_goes_down_is_gone_and_a_full_queue_is_not(self):
        self.socket.refusal = errno.ENOBUFS
        self.assertEqual(self.adapter.send([Frame(1), Frame(2)]), 2)
        self.socket.refusal = errno.ENETDOWN
        with self.assertRaisesRegex(BusError, "arm is gone"):
            self.adapter.send([Frame(1)])
        self.socket.answers = [errno.ENETDOWN]
        with self.assertRaisesRegex(BusError, "arm is gone"):
            list(self.adapter.receive())


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
            (
                can.CanOperationError(
                    "Failed to transmit: No buffer space available", errno.ENOBUFS
                ),
                2,
            ),
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

    def test_whatever_an_interface_raises_the_bus_is_gone_and_can_be_closed(self):
        # socketcand and gs_usb let errors of their sockets through, serial ones those of closed
        # files
        for error in (
            can.CanError("gone"),
            OSError(errno.EPIPE, "Broken pipe"),
            ConnectionResetError(),
            ValueError("closed file"),
        ):
            adapter = open_bus(Address("arm", "virtual", "sarrus-gone"))
            adapter._bus.shutdown()
            adapter._bus = Refusing(error)
            with self.subTest(error=error):
                with self.assertRaisesRegex(BusError, "arm is gone"):
                    adapter.send([Frame(1)])
                with self.assertRaisesRegex(BusError, "arm is gone"):
                    list(adapter.receive())
                adapter.close()

    def test_an_interface_that_takes_and_brings_nothing_for_long_is_gone(self):
        adapter = open_bus(Address("arm", "virtual", "sarrus-unplugged"))
        self.addCleanup(adapter.close)
        adapter._bus.send = Refusing(can.CanOperationError("The message could not be sent")).send
        self.assertEqual(adapter.send([Frame(1)]), 1)
        adapter._heard -= 10
        with self.assertRaisesRegex(BusError, "arm is gone"):
            adapter.send([Frame(1)])

    def test_interfaces_that_are_not_there_are_reported(self):
        for interface, channel in (
            ("nonsense", "x"),
            ("socketcan", "nocan9"),
            ("slcan", "/dev/nothing"),
        ):
            with self.assertRaises(BusError):
                open_bus(Address("arm", interface, channel))


if __name__ == "__main__":
    unittest.main()
