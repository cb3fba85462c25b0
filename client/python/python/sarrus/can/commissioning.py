"""Commissioning: one motor at a time, with people beside it. No commands of a robot pass here."""

from __future__ import annotations

import contextlib
import math
import time
from collections import Counter
from typing import TYPE_CHECKING, Any, cast

from sarrus._native import Drives, Frame
from sarrus.can.adapters import Adapter, Address, BusError, close_all, open_bus
from sarrus.can.leaving import Ending, Leave, at_the_end
from sarrus.can.telling import WrongFlags

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from sarrus._native import Configuration

PERIOD = 0.005
"""Time between two cycles of one motor `[s]`."""
SILENCE = 0.1
"""A motor under power that has not measured for this time has failed `[s]`."""
READY = 2.0
"""Time in which a motor's watchdog is set and read back `[s]`."""


class Failed(Exception):
    """What was tried did not come about; the motor is without power."""


class Commissioning:
    """The buses of a configuration, open, and its motors one by one."""

    def __init__(
        self,
        configuration: Configuration,
        address: Callable[[dict[str, Any]], Address],
        ending: Ending,
        only: str | None = None,
    ) -> None:
        self.ending = ending
        self.motors: list[dict[str, Any]] = configuration.motors
        self._buses: list[dict[str, Any]] = configuration.buses
        names = [motor["actuator"] for motor in self.motors]
        if only is not None and only not in names:
            raise WrongFlags(
                f"no motor for the actuator `{only}` in the configuration, "
                f"expected one of {', '.join(names)}"
            )
        self.chosen = [names.index(only)] if only is not None else list(range(len(names)))
        self.drives = Drives(configuration)
        self._adapters: dict[int, Adapter] = {}
        try:
            for place, bus in enumerate(self._buses):
                if any(self.motors[motor]["bus"] == place for motor in self.chosen):
                    self._adapters[place] = open_bus(address(bus))
        except BaseException:
            self.close()
            raise
        self.unknown: Counter[tuple[str, str]] = Counter()

    def close(self) -> None:
        """Give the buses back."""
        close_all(self._adapters.values())

    def __enter__(self) -> Commissioning:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def send(self, motor: int, frames: list[Frame]) -> None:
        """Send frames to a motor."""
        if dropped := self._adapters[self.motors[motor]["bus"]].send(frames):
            raise BusError(
                f"{self._buses[self.motors[motor]['bus']]['name']}: "
                f"no room for {dropped} frame(s); is the bus connected and powered?"
            )

    def hear(self, seconds: float) -> Iterator[tuple[int, str, Any]]:
        """What motors say within a time: `(motor, what, value)`.

        Raise `Leave` when somebody asks for the end.
        """
        end = time.monotonic() + seconds
        while True:
            self.ending.check()
            for place, adapter in self._adapters.items():
                for heard in adapter.receive():
                    if isinstance(heard, Frame):
                        of_motors = self.drives.receive(time.monotonic_ns(), place, heard)
                        if not of_motors:
                            kind = "X" if heard.extended else ""
                            self.unknown[self._buses[place]["name"], f"{heard.id:X}{kind}"] += 1
                        yield from of_motors
                    elif heard[0] in ("bus_off", "error_passive"):
                        raise BusError(
                            f"{self._buses[place]['name']} is {heard[0].replace('_', '-')}: "
                            "check wiring, termination, bit rate"
                        )
            if time.monotonic() >= end:
                return
            time.sleep(0.0005)

    def measure(
        self, motor: int, frames: Callable[[], list[Frame]], seconds: float = 1.0
    ) -> dict[str, float]:
        """Send the frames of a cycle until the motor measures."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.send(motor, frames())
            for place, what, value in self.hear(PERIOD):
                if place == motor and what == "measured":
                    return cast("dict[str, float]", value)
        raise Failed(
            f"{self.name(motor)} does not answer; is it powered, and are its identifiers right?"
        )

    def name(self, motor: int) -> str:
        """The actuator of a motor."""
        return cast("str", self.motors[motor]["actuator"])

    def off(self, motor: int) -> Callable[[], list[Frame]]:
        """Frames of a cycle without power."""
        return lambda: self.drives.off(motor, time.monotonic_ns())

    def guarded(self, motor: int) -> float:
        """Wait without power until the motor's own watchdog is known to be on.

        Give the actuator's position then.
        """
        end = time.monotonic() + READY
        while True:
            position = self.measure(motor, self.off(motor))["position"]
            if (why := self.drives.unguarded(motor)) is None:
                return position
            if time.monotonic() > end:
                state = self.drives.state(motor)["watchdog"]
                raise Failed(
                    f"{self.name(motor)} gets no power: {why}, its watchdog is {state}; "
                    "see `watchdog` of the configuration"
                )

    def disable(self, motor: int) -> None:
        """Take a motor's power, some times over: a frame may be lost."""
        for _ in range(3):
            # a bus that takes none now may take the next
            with contextlib.suppress(Exception):
                self._adapters[self.motors[motor]["bus"]].send(self.drives.disable(motor))
            time.sleep(PERIOD)


def scan(motors: Commissioning, seconds: float) -> tuple[list[list[str]], bool]:
    """Ask every motor for a heartbeat.

    Give rows of `actuator, bus, identifiers, answer`; and whether all answered.
    """
    heard: dict[int, Counter[str]] = {motor: Counter() for motor in motors.chosen}
    for motor in motors.chosen:
        motors.send(motor, motors.drives.probe(motor))
        for place, what, _ in motors.hear(seconds / max(len(motors.chosen), 1)):
            if place in heard:
                heard[place][what] += 1
    rows = []
    for motor, answers in heard.items():
        entry = motors.motors[motor]
        identifiers = " ".join(f"0x{identifier:X}" for identifier in entry["identifiers"])
        text = (
            ", ".join(f"{count} {what}" for what, count in sorted(answers.items())) or "no answer"
        )
        rows.append(
            [
                entry["actuator"],
                motors._buses[entry["bus"]]["name"],
                entry["protocol"],
                identifiers,
                text,
            ]
        )
    return rows, all(answers.total() > answers["malformed"] for answers in heard.values())


def read(motors: Commissioning, seconds: float) -> tuple[list[list[str]], bool]:
    """Read every parameter.

    Give rows of `actuator, parameter, value, unit`; and whether all were answered.
    """
    rows, complete = [], True
    for motor in motors.chosen:
        measured = motors.measure(motor, motors.off(motor))
        rows += [
            [motors.name(motor), name, f"{value:g}", ""]
            for name, value in measured.items()
            if not math.isnan(value)
        ]
        state = motors.drives.state(motor)
        rows += [
            [
                motors.name(motor),
                name,
                str(state[name]),
                "ms" if isinstance(state[name], int) and name == "watchdog" else "",
            ]
            for name in state
        ]
        for parameter, (name, unit) in enumerate(motors.drives.parameters(motor)):
            motors.send(motor, motors.drives.read_parameter(motor, parameter))
            found = next(
                (
                    value
                    for place, what, value in motors.hear(seconds)
                    if (place, what) == (motor, "parameter") and value[0] == parameter
                ),
                None,
            )
            complete &= found is not None
            rows.append(
                [motors.name(motor), name, "no answer" if found is None else f"{found[1]:g}", unit]
            )
    return rows, complete


def offset_at(motor: dict[str, Any], measured: dict[str, float], at: float) -> float:
    """Offset of a configuration, q - s q_m / N, of a motor whose actuator is known to be at q."""
    return at - float(motor["sign"] / motor["gear"]) * measured["motor_position"]


def zero(motors: Commissioning, motor: int) -> float:
    """Make the motor's present position its zero.

    Give what it says afterwards, at its own shaft `[rad]`.
    """
    motors.disable(motor)
    motors.measure(motor, motors.off(motor))
    frames = motors.drives.set_zero(motor)
    if frames is None:
        raise Failed(
            f"{motors.name(motor)}: {motors.motors[motor]['protocol']} cannot set a zero by "
            "command; use `zero --at` and the offset"
        )
    motors.send(motor, frames)
    time.sleep(0.1)
    list(motors.hear(0.05))
    return motors.measure(motor, motors.off(motor))["motor_position"]


def direction(
    motors: Commissioning,
    motor: int,
    distance: float,
    stiffness: float,
    damping: float,
    seconds: float,
) -> dict[str, float]:
    """Move an actuator by a little and back, softly.

    Give how far it came `[rad, m]` and what share that is of the distance.


    Power comes when the motor's own watchdog is known to be on. The set-point follows p₀ + d (1 -
    cos(π t / T)) / 2. Power goes when the motor tells a fault, is silent, or is farther from its
    set-point than the whole distance and a half: then the sign of the motor's own control, or the
    load, is not as it should be. It also goes when somebody asks for the end.
    """
    limit = 1.5 * abs(distance)

    def cycle(position: float, velocity: float) -> dict[str, float] | None:
        motors.send(
            motor,
            motors.drives.on(
                motor, time.monotonic_ns(), [position, velocity, 0.0, stiffness, damping]
            ),
        )
        latest = None
        for place, what, value in motors.hear(PERIOD):
            if place == motor and what == "measured":
                latest = value
        if fault := motors.drives.state(motor)["fault"]:
            raise Failed(f"{motors.name(motor)} tells its fault {fault}")
        return latest

    motors.ending.defer()
    with at_the_end(lambda: motors.disable(motor)):
        start = motors.guarded(motor)
        end = time.monotonic() + 1.0
        while motors.drives.state(motor)["power"] != "on":
            if time.monotonic() > end:
                raise Failed(
                    f"{motors.name(motor)} does not take power; "
                    f"its state is {motors.drives.state(motor)}"
                )
            cycle(start, 0.0)
        begin = heard_at = time.monotonic()
        farthest = position = start
        while (now := time.monotonic()) < begin + 2 * seconds:
            phase = math.pi * (now - begin) / seconds
            setpoint = start + distance * (1 - math.cos(phase)) / 2
            measured = cycle(setpoint, distance * math.sin(phase) * math.pi / seconds / 2)
            if measured is not None:
                heard_at, position = now, measured["position"]
                if abs(position - start) > abs(farthest - start):
                    farthest = position
            if now - heard_at > SILENCE:
                raise Failed(f"{motors.name(motor)} went silent")
            if abs(position - setpoint) > limit:
                raise Failed(
                    f"{motors.name(motor)} is {position - setpoint:+.4g} from its set-point; sign, "
                    "load or stiffness are not right"
                )
    return {
        "start": start,
        "farthest": farthest,
        "end": position,
        "share": (farthest - start) / distance,
    }


def confirm(question: str, yes: bool) -> None:
    """Ask a person; `yes` was said beforehand.

    Anything but `yes` ends the program without power.
    """
    print(question)
    if yes:
        return
    try:
        answer = input("type `yes` to go on: ")
    except EOFError:
        answer = ""
    if answer.strip() != "yes":
        raise Leave("not confirmed")
