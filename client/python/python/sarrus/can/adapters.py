"""Buses by python-can: every loss is counted and one program owns each of them.

`open_bus` gives an `Adapter` for every interface of python-can that a channel and bit rates open.
What differs between interfaces is here and nowhere else:

- *slcan*: python-can opens the port; lines, which the core reads and writes, go out in one write
  and come in by one read that never wait, since python-can reads byte by byte and its `send` can
  wait for ever on a stalled port.
- *socketcan*: python-can opens the socket; error frames become events (`bus.state` never changes
  there), frames that the receive buffer lost are counted, and echoes of our own frames tell how
  many still wait.
- every other one: python-can's `send` and `recv` with a time-out of zero, which some interfaces do
  not keep.

Cyclic sending in the kernel or in a thread (`send_periodic`) is never used: it would go on while
the program hangs.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import select
import socket
import struct
import termios
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, cast

import can

from sarrus._native import (
    Frame,
    SlcanReader,
    check_interface,
    events_of_error_frame,
    interface_advice,
    interface_question,
    slcan_line,
)
from sarrus.can.telling import say

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

Event = tuple[str, int]
"""News of a bus.

One of `error_active`, `error_warning`, `error_passive`, `bus_off`, `restarted`, `dropped`,
`overrun`, and a count.
"""

RECEIVE_BUFFER = 1 << 20
"""Bytes of a socket's receive buffer: the default one loses most of a burst."""

MOST_RECEIVED = 256
"""Frames that one call of `Adapter.receive` gives at most.

A bus that babbles must not keep the cycle from its end.
"""


SILENCE = 2.0
"""An interface that takes no frame and brings none for this time is gone `[s]`."""


class BusError(Exception):
    """A bus cannot be opened or is gone."""


@dataclass(frozen=True)
class Address:
    """Where a bus is, in python-can's words."""

    name: str
    interface: str
    channel: str
    bitrate: int = 1_000_000
    data_bitrate: int | None = None
    listen_only: bool = False
    """Only to record.

    Nothing is sent, and a bus that others can share belongs to whoever drives it.
    """

    @classmethod
    def of(
        cls, bus: dict[str, Any], interface: str | None = None, channel: str | None = None
    ) -> Address:
        """Address of a bus of a configuration, or another one for the same bus."""
        address = cls(**bus)
        return replace(
            address, interface=interface or address.interface, channel=channel or address.channel
        )


class Adapter(Protocol):
    """A bus that is open. It waits as little as its interface lets it."""

    address: Address

    def send(self, frames: Sequence[Frame]) -> int:
        """Send frames in order until one finds no room.

        Give the number of those that did not go and are dropped.
        """

    def receive(self) -> Iterator[Frame | Event]:
        """Frames and events that are already there."""

    def backlog(self) -> int:
        """Frames that were taken and are not on the wire yet, as far as the adapter tells."""

    def close(self) -> None:
        """Give the bus back."""


def open_bus(address: Address) -> Adapter:
    """Open a bus; it is this program's alone until it is closed.

    Raises `BusError` for a bus that is not there or belongs to another program.
    """
    known = {"slcan": SlcanAdapter, "socketcan": SocketcanAdapter}
    try:
        return known.get(address.interface, AnyAdapter)(address)
    except BusError:
        raise
    except Exception as error:
        # each interface, and each driver behind one, fails in its own way
        why = " ".join(str(error).split()) or type(error).__name__
        raise BusError(
            f"{address.name}: {address.interface} {address.channel} cannot be opened: {why}"
        ) from error


def close_all(adapters: Iterable[Adapter]) -> None:
    """Give buses back; one that cannot be closed keeps no other from it."""
    for adapter in adapters:
        with contextlib.suppress(Exception):
            adapter.close()


def to_message(frame: Frame) -> can.Message:
    """Give a frame as python-can's."""
    return can.Message(
        arbitration_id=frame.id,
        data=frame.data,
        is_extended_id=frame.extended,
        is_fd=frame.fd,
        bitrate_switch=frame.bit_rate_switch,
    )


def of_message(message: can.Message) -> Frame | None:
    """Give python-can's message as a frame.

    Give `None` for remote and error frames and for what no frame can be.
    """
    if message.is_remote_frame or message.is_error_frame:
        return None
    try:
        return Frame(
            message.arbitration_id,
            bytes(message.data),
            extended=message.is_extended_id,
            fd=message.is_fd,
            bit_rate_switch=message.is_fd and message.bitrate_switch,
        )
    except (ValueError, OverflowError):
        return None


class Ownership:
    """One owner for each bus, released by the system when the program ends, however it ends.

    The mark is a name in the abstract space of Unix sockets: it leaves no file, and like CAN
    interfaces it belongs to the network namespace. A serial port is locked itself, which every name
    of it meets.
    """

    def __init__(self, address: Address) -> None:
        self._marks: list[socket.socket | int] = []
        # a virtual bus lives in this process only
        if address.interface == "virtual" or (address.listen_only and address.interface != "slcan"):
            return
        taken = BusError(
            f"{address.name}: {address.interface} {address.channel} is in use by another program; "
            "each bus has one owner"
        )
        if address.interface == "slcan":
            port = os.open(
                address.channel.split("@")[0],
                os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC,
            )
            self._marks.append(port)
            try:
                fcntl.flock(port, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                self.release()
                raise taken from None
            return
        mark = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._marks.append(mark)
        try:
            mark.bind(f"\0sarrus-can/{address.interface}/{address.channel}")
        except OSError as error:
            self.release()
            if error.errno == errno.EADDRINUSE:
                raise taken from None
            raise

    def release(self) -> None:
        """Let others have the bus."""
        while self._marks:
            mark = self._marks.pop()
            if isinstance(mark, int):
                os.close(mark)
            else:
                mark.close()


class AnyAdapter:
    """A bus by python-can's own `send` and `recv`."""

    def __init__(self, address: Address) -> None:
        self.address = address
        self._heard = time.monotonic()
        self._ownership = Ownership(address)
        try:
            self._bus = self._open()
        except BaseException:
            self._ownership.release()
            raise

    def _open(self) -> can.BusABC:
        interface, channel, data_bitrate = (
            self.address.interface,
            self.address.channel,
            self.address.data_bitrate,
        )
        settings: dict[str, Any] = {"bitrate": self.address.bitrate}
        if data_bitrate is not None:
            settings |= {"fd": True, "data_bitrate": data_bitrate}
        # where an interface wants the same said otherwise
        if interface == "virtual":
            settings["protocol"] = (
                can.CanProtocol.CAN_20 if data_bitrate is None else can.CanProtocol.CAN_FD
            )
        elif interface == "pcan" and data_bitrate is not None:
            settings = {"fd": True, "timing": _fd_timing(self.address.bitrate, data_bitrate)}
        elif interface == "gs_usb" and channel.isdigit():
            settings["index"] = int(channel)
        return can.Bus(interface=interface, channel=channel, ignore_config=True, **settings)

    def send(self, frames: Sequence[Frame]) -> int:
        """Send frames in order until one finds no room; the number of those that did not go."""
        for sent, frame in enumerate(frames):
            try:
                self._bus.send(to_message(frame), timeout=0)
                self._heard = time.monotonic()
            except can.CanTimeoutError:
                return self._full(len(frames) - sent)
            except can.CanOperationError as error:
                # `timeout` does not cover a full queue of the interface, and not every backend
                # tells its code
                if error.error_code not in (None, errno.ENOBUFS, errno.EAGAIN, errno.EINTR):
                    raise self._gone(error) from error
                return self._full(len(frames) - sent)
            except Exception as error:
                raise self._gone(error) from error
        return 0

    def _full(self, dropped: int) -> int:
        # an interface that was unplugged may say the same as one whose queue is full
        if time.monotonic() - self._heard > SILENCE:
            raise BusError(
                f"{self.address.name} is gone: it has taken and brought nothing for {SILENCE:g} s"
            )
        return dropped

    def _gone(self, error: Exception) -> BusError:
        return BusError(f"{self.address.name} is gone: {error}")

    def receive(self) -> Iterator[Frame | Event]:
        """Frames and events that are already there."""
        for _ in range(MOST_RECEIVED):
            try:
                message = self._bus.recv(0)
            except Exception as error:
                raise self._gone(error) from error
            if message is None:
                return
            self._heard = time.monotonic()
            if message.is_error_frame:
                yield from events_of_error_frame(message.arbitration_id, bytes(message.data))
            elif (frame := of_message(message)) is not None:
                yield frame

    def backlog(self) -> int:
        """Nothing is known."""
        return 0

    def close(self) -> None:
        """Give the bus back."""
        try:
            with contextlib.suppress(Exception):
                self._bus.shutdown()
        finally:
            self._ownership.release()


class SlcanAdapter(AnyAdapter):
    """A serial adapter, or the pseudo-terminal of simulated motors."""

    def _open(self) -> can.BusABC:
        timing: dict[str, Any] = {"bitrate": self.address.bitrate}
        if self.address.data_bitrate is not None:
            timing = {"timing": _fd_timing(self.address.bitrate, self.address.data_bitrate)}
        # python-can waits for a port that takes no bytes, and reads answers of an earlier owner as
        # its own
        port = cast("int", self._ownership._marks[0])
        if not select.select([], [port], [], 0.5)[1]:
            raise BusError(
                f"{self.address.channel} takes no bytes; is the adapter, "
                "or the program behind the terminal, alive?"
            )
        bus = can.Bus(
            interface="slcan",
            channel=self.address.channel,
            ignore_config=True,
            sleep_after_open=0,
            listen_only=self.address.listen_only,
            **timing,
        )
        self._descriptor: int = bus.fileno()
        self._reader = SlcanReader()
        self._unwritten = b""
        self._has_sent = False
        # without this an idle port reads like one that was closed
        settings = termios.tcgetattr(self._descriptor)
        settings[6][termios.VMIN], settings[6][termios.VTIME] = 1, 0
        termios.tcsetattr(self._descriptor, termios.TCSANOW, settings)
        os.set_blocking(self._descriptor, False)
        return bus

    def _write(self, data: bytes) -> int:
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise self._gone(error) from error

    def send(self, frames: Sequence[Frame]) -> int:
        """Send frames in order by one write.

        What finds no room is dropped, but a line that was begun is ended first.
        """
        if self._unwritten:
            self._unwritten = self._unwritten[self._write(self._unwritten) :]
            if self._unwritten:
                return len(frames)
        lines = [slcan_line(frame) for frame in frames]
        if not lines:
            return 0
        self._has_sent = True
        data = b"".join(lines)
        taken = self._write(data)
        if taken == len(data):
            return 0
        # lines that begin in what was not taken are dropped
        rest, dropped = taken, 0
        for line in lines:
            if rest >= len(line):
                rest -= len(line)
            elif rest > 0:
                self._unwritten, rest = line[rest:], 0
            else:
                dropped += 1
        return dropped

    def receive(self) -> Iterator[Frame | Event]:
        """Frames and events that are already there."""
        try:
            data = os.read(self._descriptor, 16384)
        except BlockingIOError:
            return
        except OSError as error:
            raise self._gone(error) from error
        if not data:
            raise BusError(f"{self.address.name} is gone: the port was closed")
        for heard in self._reader.take(data):
            # python-can opens a channel twice, which adapters refuse
            if self._has_sent or heard != ("dropped", 1):
                yield heard

    def backlog(self) -> int:
        """A line that is written in part only."""
        return 1 if self._unwritten else 0

    def close(self) -> None:
        """End a line that was begun, close the channel and give the port back."""
        try:
            bus = cast("Any", self._bus)
            with contextlib.suppress(BusError):
                self._write(self._unwritten)
                self._write(b"C\r")
            # python-can's own way would wait for a port that takes no bytes
            with contextlib.suppress(Exception):
                can.BusABC.shutdown(bus)
                bus.serialPortOrig.close()
        finally:
            self._ownership.release()


def _fd_timing(bitrate: int, data_bitrate: int) -> can.BitTimingFd:
    return can.BitTimingFd.from_sample_point(
        f_clock=80_000_000,
        nom_bitrate=bitrate,
        nom_sample_point=80.0,
        data_bitrate=data_bitrate,
        data_sample_point=75.0,
    )


_CLASSIC = struct.Struct("=IB3x8s")
_FD = struct.Struct("=IBB2x64s")
_MEMORY = struct.Struct("=9I")
_EXTENDED, _REMOTE, _ERROR, _NUMBER = 1 << 31, 1 << 30, 1 << 29, (1 << 29) - 1
_SO_MEMINFO, _MSG_CONFIRM = 55, 0x800
_MOST_WAITING = 4096
_LONGEST_ECHO = 1.0


class SocketcanAdapter(AnyAdapter):
    """A CAN interface of Linux, by `can_frame` and `canfd_frame` on python-can's socket."""

    def _open(self) -> can.BusABC:
        fd, name = self.address.data_bitrate is not None, self.address.channel
        bus = can.Bus(
            interface="socketcan",
            channel=name,
            ignore_config=True,
            fd=fd,
            receive_own_messages=True,
        )
        self._socket: socket.socket = cast("Any", bus).socket
        try:
            self._news = self._look(name)
        except BaseException:
            bus.shutdown()
            raise
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._waiting = self._lost = 0
        self._echoed = 0.0
        return bus

    def _look(self, name: str) -> list[Event]:
        """Ask the kernel for the interface and compare it with the configuration.

        Give what there is to say of its controller.
        """
        try:
            with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW) as route:
                route.send(interface_question(name))
                # the answer is there before the question's call is over
                answer = route.recv(16384, socket.MSG_DONTWAIT)
            # one that only listens takes any bit rate
            bitrate = None if self.address.listen_only else self.address.bitrate
            event = check_interface(answer, name, bitrate, self.address.data_bitrate)
        except (OSError, ValueError) as error:
            raise BusError(f"{self.address.name}: {error}") from error
        if (advice := interface_advice(answer, name)) is not None:
            say(f"sarrus.can: warning: {advice}")
        return [] if event is None else [event]

    def send(self, frames: Sequence[Frame]) -> int:
        """Send frames in order until one finds no room; the number of those that did not go."""
        for sent, frame in enumerate(frames):
            number = frame.id | (_EXTENDED if frame.extended else 0)
            data = frame.data
            parts = (_FD, int(frame.bit_rate_switch)) if frame.fd else (_CLASSIC,)
            packed = parts[0].pack(number, len(data), *parts[1:], data)
            try:
                self._socket.send(packed)
            except OSError as error:
                if error.errno not in (errno.ENOBUFS, errno.EAGAIN, errno.EINTR):
                    raise self._gone(error) from error
                return len(frames) - sent
            if self._waiting == 0:
                self._echoed = time.monotonic()
            self._waiting = min(self._waiting + 1, _MOST_WAITING)
        return 0

    def receive(self) -> Iterator[Frame | Event]:
        """Frames and events that are already there."""
        news, self._news = self._news, []
        yield from news
        for _ in range(MOST_RECEIVED):
            try:
                packed, _, flags, _ = self._socket.recvmsg(72)
            except BlockingIOError:
                break
            except OSError as error:
                raise self._gone(error) from error
            if flags & _MSG_CONFIRM:
                self._waiting, self._echoed = max(self._waiting - 1, 0), time.monotonic()
                continue
            layout = _FD if len(packed) == _FD.size else _CLASSIC
            number, length, *switch, data = layout.unpack(packed)
            if number & _ERROR:
                events = events_of_error_frame(number & _NUMBER, data)
                if any(name in ("bus_off", "restarted") for name, _ in events):
                    # the kernel has thrown away what waited, and no echo of it comes
                    self._waiting = 0
                yield from events
            elif not number & _REMOTE:
                fd = bool(switch)
                try:
                    yield Frame(
                        number & _NUMBER,
                        data[:length],
                        extended=bool(number & _EXTENDED),
                        fd=fd,
                        bit_rate_switch=fd and bool(switch[0] & 1),
                    )
                except ValueError:
                    continue
        lost = _MEMORY.unpack(
            self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, _MEMORY.size)
        )[8]
        if lost != self._lost:
            yield ("overrun", (lost - self._lost) & 0xFFFFFFFF)
            # echoes of ours may be among them
            self._lost, self._waiting = lost, 0

    def backlog(self) -> int:
        """Frames without their echo; echoes that stay away for too long are not waited for."""
        if self._waiting and time.monotonic() - self._echoed > _LONGEST_ECHO:
            self._waiting = 0
        return self._waiting
