"""Commissioning of one motor at a time, under supervision and without a controller."""

from __future__ import annotations

import contextlib
import math
import time
from collections import Counter
from typing import TYPE_CHECKING, Any, cast

from sarrus._native import Drives, Frame
from sarrus.can.adapters import Adapter, Address, BusError, close_all, open_bus
from sarrus.can.leaving import Ending, Leave
from sarrus.can.telling import WrongFlags

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from sarrus._native import Configuration

PERIOD = 0.005
"""Time between two cycles of one motor `[s]`."""
SILENCE = 0.1
"""Time after which a motor under power that sends no measurement has failed, at least the
configuration's `feedback_ms` `[s]`."""
STORING = 0.5
"""Time in which a motor stores a value `[s]`."""
ANSWER = 1.0
"""Time in which a motor answers, at least the configuration's `arming_ms` `[s]`."""


class Failed(Exception):
    """An operation failed; the motor has no power."""


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
        timeouts = configuration.timeouts
        self.silence = max(SILENCE, timeouts["feedback"])
        self.ready = max(ANSWER, timeouts["arming"])
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
        """Close the buses."""
        close_all(self._adapters.values())

    def __enter__(self) -> Commissioning:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def send(self, motor: int, frames: list[Frame]) -> None:
        """Send frames to a motor."""
        self.send_to(self.motors[motor]["bus"], frames)

    def send_to(self, bus: int, frames: list[Frame]) -> None:
        """Send frames on a bus."""
        if dropped := self._adapters[bus].send(frames):
            raise BusError(
                f"{self.bus_name(bus)}: "
                f"no room for {dropped} frame(s); is the bus connected and powered?"
            )

    def bus_name(self, bus: int) -> str:
        """The name of a bus."""
        return cast("str", self._buses[bus]["name"])

    def open_buses(self) -> list[tuple[int, dict[str, Any]]]:
        """The buses that are open."""
        return [(place, self._buses[place]) for place in self._adapters]

    def hear(self, seconds: float) -> Iterator[tuple[int, str, Any]]:
        """Give the motors' answers within a time: `(motor, kind, value)`."""
        for _, _, of_motors in self._hear(seconds):
            yield from of_motors

    def hear_frames(self, bus: int, seconds: float) -> Iterator[Frame]:
        """Give all frames of a bus within a time."""
        for place, frame, _ in self._hear(seconds):
            if place == bus:
                yield frame

    def _hear(self, seconds: float) -> Iterator[tuple[int, Frame, list[tuple[int, str, Any]]]]:
        """Give frames within a time, with their buses and their meaning for motors.

        Raise `Leave` when an end is requested.
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
                        yield place, heard, of_motors
                    elif heard[0] in ("bus_off", "error_passive"):
                        raise BusError(
                            f"{self._buses[place]['name']} is {heard[0].replace('_', '-')}: "
                            "check wiring, termination, bit rate"
                        )
            if time.monotonic() >= end:
                return
            time.sleep(0.0005)

    def measure(self, motor: int, frames: Callable[[], list[Frame]]) -> dict[str, float]:
        """Send the frames of a cycle until the motor sends a measurement; give the measurement."""
        end = time.monotonic() + self.ready
        malformed = 0
        while time.monotonic() < end:
            self.send(motor, frames())
            for place, what, value in self.hear(PERIOD):
                if place == motor and what == "measured":
                    return cast("dict[str, float]", value)
                malformed += place == motor and what == "malformed"
        if malformed:
            raise Failed(
                f"{self.name(motor)} answers, and its {malformed} answer(s) are malformed; correct "
                "protocol, variant or model in the configuration"
            )
        raise Failed(
            f"{self.name(motor)} does not answer; is it powered, and are its identifiers right?"
        )

    def name(self, motor: int) -> str:
        """The actuator of a motor."""
        return cast("str", self.motors[motor]["actuator"])

    def off(self, motor: int) -> Callable[[], list[Frame]]:
        """Give the frames of a cycle without power."""
        return lambda: self.drives.off(motor, time.monotonic_ns())

    def guarded(self, motor: int) -> float:
        """Wait without power until the motor confirms its watchdog; give the position then."""
        end = time.monotonic() + self.ready
        while True:
            position = self.measure(motor, self.off(motor))["position"]
            if (why := self.drives.unguarded(motor)) is None:
                return position
            state = self.drives.state(motor)["watchdog"]
            if state == "unreadable" or time.monotonic() > end:
                raise Failed(
                    f"{self.name(motor)} gets no power: {why}, its watchdog is {state}; "
                    "see `watchdog` of the configuration"
                )

    def disable(self, motor: int) -> None:
        """Remove a motor's power, three times since a frame may be lost."""
        for _ in range(3):
            # a bus that refuses these frames may accept the next
            with contextlib.suppress(Exception):
                self._adapters[self.motors[motor]["bus"]].send(self.drives.disable(motor))
            time.sleep(PERIOD)


def scan(motors: Commissioning, seconds: float) -> tuple[list[list[str]], bool]:
    """Ask every motor for a heartbeat.

    Give rows of `actuator, bus, protocol, identifiers, answer`, and whether all answered.
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

    Give rows of `actuator, parameter, value, unit`, and whether all were answered.
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
    """Give the configuration's offset, q - s q_m / N, for an actuator at the position q."""
    return at - float(motor["sign"] / motor["gear"]) * measured["motor_position"]


def storing(motors: Commissioning, motor: int) -> list[Frame]:
    """Give the frames that make a motor store its zero; `Failed` if its protocol has none."""
    frames = motors.drives.save_zero(motor)
    if frames is None:
        entry = motors.motors[motor]
        kind = " ".join(dict.fromkeys((entry["protocol"], entry["variant"]))).rstrip()
        raise Failed(
            f"{motors.name(motor)}: {kind} cannot store its zero by command: it is lost with the "
            "supply; use `zero --at` and the offset, or the maker's tool"
        )
    return frames


def zero(motors: Commissioning, motor: int, *, save: bool = False) -> float:
    """Make the motor's present position its zero, and store it with `save`.

    Give the position that the motor then reports, at its own shaft `[rad]`.
    """
    stored = storing(motors, motor) if save else []
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
    if stored:
        motors.send(motor, stored)
        list(motors.hear(STORING))
    return motors.measure(motor, motors.off(motor))["motor_position"]


def confirm(question: str, yes: bool) -> None:
    """Ask for a confirmation unless `yes` is set; any answer but `yes` ends the program."""
    print(question)
    if yes:
        return
    try:
        answer = input("type `yes` to go on: ")
    except EOFError:
        answer = ""
    if answer.strip() != "yes":
        raise Leave("not confirmed")
