"""A small motion of one actuator and back, which shows its sign and scale."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

from sarrus.can.commissioning import PERIOD, Failed
from sarrus.can.leaving import at_the_end

if TYPE_CHECKING:
    from sarrus.can.commissioning import Commissioning

FARTHEST = 1.5
"""Largest distance to the set-point, relative to the distance of the motion."""


def within_limits(
    motors: Commissioning, motor: int, start: float, way: tuple[float, float], gains: list[float]
) -> None:
    """Refuse a motion beyond a limit of the configuration, which would look like a faulty motor.

    The motion is a distance and a time; gains are stiffness and damping.
    """
    (distance, seconds), (stiffness, damping) = way, gains
    limits, name = motors.motors[motor]["limits"], motors.name(motor)
    lower, upper = limits["lower"], limits["upper"]
    for what, position in (("is at", start), ("would go to", start + distance)):
        if not lower <= position <= upper:
            side, limit = ("lower", lower) if position < lower else ("upper", upper)
            raise Failed(
                f"{name} {what} {position:.6g}, beyond its {side} limit of position, {limit:g}: "
                "the limit stops it, not the motor; "
                + (
                    "correct `offset` or the limit, or turn it by hand"
                    if what == "is at"
                    else f"expected --distance from {lower - start:.4g} to {upper - start:.4g}"
                )
            )
    speed = abs(distance) * math.pi / 2 / seconds
    if speed > limits["velocity"]:
        raise Failed(
            f"{name} would move at {speed:.4g}, beyond its limit of velocity, "
            f"{limits['velocity']:g}; expected --seconds "
            f"{abs(distance) * math.pi / 2 / limits['velocity']:.3g} or more"
        )
    effort = stiffness * FARTHEST * abs(distance) + damping * speed
    if effort > limits["effort"]:
        raise Failed(
            f"{name} could be pushed with {effort:.4g}, beyond its limit of effort, "
            f"{limits['effort']:g}; give a smaller --stiffness, --damping or --distance"
        )


def direction(
    motors: Commissioning,
    motor: int,
    distance: float,
    stiffness: float,
    damping: float,
    seconds: float,
) -> dict[str, float]:
    """Move an actuator by a small distance and back.

    Give its start, farthest and last position `[rad, m]`, and the share of the distance.

    A motion beyond a limit of the configuration is refused. The motor gets power once it confirms
    its watchdog. The set-point follows p₀ + d (1 - cos(π t / T)) / 2. The motor loses power when it
    reports a fault, falls silent, or is farther than 1.5 d from its set-point (wrong sign of its
    control, or load), and when an end is requested.
    """
    limit = FARTHEST * abs(distance)

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
            raise Failed(f"{motors.name(motor)} reports its fault {fault}")
        return latest

    motors.ending.defer()
    with at_the_end(lambda: motors.disable(motor)):
        start = motors.guarded(motor)
        within_limits(motors, motor, start, (distance, seconds), [stiffness, damping])
        end = time.monotonic() + motors.ready
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
            if now - heard_at > motors.silence:
                raise Failed(f"{motors.name(motor)} went silent")
            if abs(position - setpoint) > limit:
                raise Failed(
                    f"{motors.name(motor)} is {position - setpoint:+.4g} from its set-point; check "
                    "sign, load and stiffness"
                )
    return {
        "start": start,
        "farthest": farthest,
        "end": position,
        "share": (farthest - start) / distance,
    }
