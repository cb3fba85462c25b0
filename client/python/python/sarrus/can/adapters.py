"""Buses of python-can: every loss is counted, and one program owns each bus.

`open_bus` gives an `Adapter` for every interface of python-can that a channel and bit rates open.
Only this module distinguishes interfaces:

- *slcan*: python-can opens the port. The core reads and writes the lines, with one non-blocking
  read and one non-blocking write a call, since python-can reads byte by byte and its `send` can
  block for ever on a stalled port.
- *socketcan*: python-can opens the socket. Error frames become events (`bus.state` never changes
  there), frames lost in the receive buffer are counted, and the echoes of our own frames give the
  number of frames that still wait.
- all others: python-can's `send` and `recv` with a time-out of zero, which some interfaces ignore.

`send_periodic` is never used: the kernel or a thread would continue to send while the program
hangs.
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
"""An event of a bus and a count.

The event is one of `error_active`, `error_warning`, `error_passive`, `bus_off`, `restarted`,
`dropped`, `overrun`.
"""

RECEIVE_BUFFER = 1 << 20
"""Bytes of a socket's receive buffer; the default buffer loses most of a burst."""

MOST_RECEIVED = 256
"""Most frames that one call of `Adapter.receive` gives.

A babbling bus must not keep its thread from sending.
"""

OLDEST = 1.0
"""Frames that seem older when they are read have times of another clock `[s]`."""

SILENCE = 2.0
"""Time after which an interface that neither takes nor gives frames is gone `[s]`."""


class BusError(Exception):
    """A bus cannot be opened or is gone."""


@dataclass(frozen=True)
class Address:
    """The address of a bus, in python-can's terms."""

    name: str
    interface: str
    channel: str
    bitrate: int = 1_000_000
    data_bitrate: int | None = None
    listen_only: bool = False
    """Nothing is sent, and a bus that programs can share is not owned: for recordings."""

    @classmethod
    def of(
        cls, bus: dict[str, Any], interface: str | None = None, channel: str | None = None
    ) -> Address:
        """The address of a bus of a configuration, with another interface or channel if given."""
        address = cls(**bus)
        return replace(
            address, interface=interface or address.interface, channel=channel or address.channel
        )


class Adapter(Protocol):
    """An open bus. Its calls block only if its interface does."""

    address: Address
    age: float
    """Seconds since the last of `receive` came, as far as the interface tells the time; else 0."""

    def send(self, frames: Sequence[Frame]) -> int:
        """Send frames in order until there is no room; give the number of dropped frames."""

    def receive(self) -> Iterator[Frame | Event]:
        """Frames and events that are already there."""

    def backlog(self) -> int:
        """Frames that the adapter took and has not sent yet, as far as it reports them."""

    def close(self) -> None:
        """Close the bus."""


def age_of(timestamp: float) -> float:
    """Seconds since a time of the system's clock; 0 for one that is not within the last second.

    Some interfaces count from another beginning than the system's clock.
    """
    age = time.time() - timestamp
    return age if 0.0 <= age <= OLDEST else 0.0


def open_bus(address: Address) -> Adapter:
    """Open a bus, which this program owns until it is closed.

    Raises `BusError` if there is no such bus, or another program owns it.
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
    """Close buses; an exception of one does not keep the others open."""
    for adapter in adapters:
        with contextlib.suppress(Exception):
            adapter.close()


def open_all(addresses: Iterable[Address]) -> list[Adapter]:
    """Open all buses or none."""
    adapters: list[Adapter] = []
    try:
        adapters.extend(map(open_bus, addresses))
    except BaseException:
        close_all(adapters)
        raise
    return adapters


def to_message(frame: Frame) -> can.Message:
    """Convert a frame to a message of python-can."""
    return can.Message(
        arbitration_id=frame.id,
        data=frame.data,
        is_extended_id=frame.extended,
        is_fd=frame.fd,
        bitrate_switch=frame.bit_rate_switch,
    )


def of_message(message: can.Message) -> Frame | None:
    """Convert a message of python-can to a frame; `None` for remote, error and invalid frames."""
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
    """A mark that one program owns a bus; the system removes it at any end of the program.

    The mark is a name in the abstract namespace of Unix sockets: it leaves no file, and like CAN
    interfaces it belongs to the network namespace. A serial port itself is locked, under all its
    names.
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
        """Remove the mark."""
        while self._marks:
            mark = self._marks.pop()
            if isinstance(mark, int):
                os.close(mark)
            else:
                mark.close()


class AnyAdapter:
    """A bus by python-can's own `send` and `recv`."""

    def __init__(self, address: Address) -> None:
        self.address, self.age = address, 0.0
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
        # interfaces with other names for the same settings
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
        """Send frames in order until there is no room; give the number of dropped frames."""
        for sent, frame in enumerate(frames):
            try:
                self._bus.send(to_message(frame), timeout=0)
                self._heard = time.monotonic()
            except can.CanTimeoutError:
                return self._full(len(frames) - sent)
            except can.CanOperationError as error:
                # `timeout` does not cover a full queue of the interface, and some backends set no
                # code
                if error.error_code not in (None, errno.ENOBUFS, errno.EAGAIN, errno.EINTR):
                    raise self._gone(error) from error
                return self._full(len(frames) - sent)
            except Exception as error:
                raise self._gone(error) from error
        return 0

    def _full(self, dropped: int) -> int:
        # an unplugged interface may give the same error as a full queue
        if time.monotonic() - self._heard > SILENCE:
            raise BusError(
                f"{self.address.name} is gone: no frame was sent or received for {SILENCE:g} s"
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
            self._heard, self.age = time.monotonic(), age_of(message.timestamp)
            if message.is_error_frame:
                yield from events_of_error_frame(message.arbitration_id, bytes(message.data))
            elif (frame := of_message(message)) is not None:
                yield frame

    def backlog(self) -> int:
        """Zero: python-can has no such count."""
        return 0

    def close(self) -> None:
        """Close the bus."""
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
        # python-can blocks on a port that takes no bytes, and reads answers to an earlier owner
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
        # otherwise a read of an idle port looks like one of a closed port
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
        """Send frames in order by one write, after the rest of a partly written line."""
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
        # of the unsent bytes, only a partly written line is kept
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
        """One for a partly written line."""
        return 1 if self._unwritten else 0

    def close(self) -> None:
        """End a partly written line, close the channel and then the port."""
        try:
            bus = cast("Any", self._bus)
            with contextlib.suppress(BusError):
                self._write(self._unwritten)
                self._write(b"C\r")
            # python-can's `shutdown` would block on a port that takes no bytes
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
_TIME = struct.Struct("@ll")
_EXTENDED, _REMOTE, _ERROR, _NUMBER = 1 << 31, 1 << 30, 1 << 29, (1 << 29) - 1
_SO_TIMESTAMPNS, _SO_MEMINFO, _MSG_CONFIRM = 35, 55, 0x800
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
        self._socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._waiting = self._lost = 0
        self._echoed = 0.0
        return bus

    def _look(self, name: str) -> list[Event]:
        """Compare the kernel's interface with the configuration; give events of its state."""
        try:
            with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW) as route:
                route.send(interface_question(name))
                # the kernel answers before `send` returns
                answer = route.recv(16384, socket.MSG_DONTWAIT)
            # any bit rate suffices for listening
            bitrate = None if self.address.listen_only else self.address.bitrate
            event = check_interface(answer, name, bitrate, self.address.data_bitrate)
        except (OSError, ValueError) as error:
            raise BusError(f"{self.address.name}: {error}") from error
        if (advice := interface_advice(answer, name)) is not None:
            say(f"sarrus.can: warning: {advice}")
        return [] if event is None else [event]

    def send(self, frames: Sequence[Frame]) -> int:
        """Send frames in order until there is no room; give the number of dropped frames."""
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
                packed, extra, flags, _ = self._socket.recvmsg(72, 64)
            except BlockingIOError:
                break
            except OSError as error:
                raise self._gone(error) from error
            if flags & _MSG_CONFIRM:
                self._waiting, self._echoed = max(self._waiting - 1, 0), time.monotonic()
                continue
            self.age = 0.0
            for level, kind, times in extra:
                if (level, kind) == (socket.SOL_SOCKET, _SO_TIMESTAMPNS):
                    seconds, nanoseconds = _TIME.unpack(times)
                    self.age = age_of(seconds + 1e-9 * nanoseconds)
            layout = _FD if len(packed) == _FD.size else _CLASSIC
            number, length, *switch, data = layout.unpack(packed)
            if number & _ERROR:
                events = events_of_error_frame(number & _NUMBER, data)
                if any(name in ("bus_off", "restarted") for name, _ in events):
                    # the kernel has discarded the waiting frames, which give no echo
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
            # echoes of our frames may be among them
            self._lost, self._waiting = lost, 0

    def backlog(self) -> int:
        """Frames without an echo; after a second without any echo, none is expected."""
        if self._waiting and time.monotonic() - self._echoed > _LONGEST_ECHO:
            self._waiting = 0
        return self._waiting
