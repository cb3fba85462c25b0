"""Search for motors missing in a configuration, and changes of identifiers."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

from sarrus._native import Candidate, Frame, candidates, protocols
from sarrus.can.commissioning import Failed
from sarrus.can.telling import WrongFlags

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from sarrus.can.commissioning import Commissioning

UNASKED = 0.3
"""Time to listen before the first question `[s]`."""
PACE = 0.001
"""Time between two questions `[s]`."""
REPEATS = 10
"""Number of questions to an identifier before and after a change."""
ANSWER = 0.2
"""Time for the answer to one of these questions `[s]`."""
ANSWERS = ("parameter", "noted")
"""Answers that come to questions only, unlike measurements."""


class Kind(NamedTuple):
    """A kind of motor: a protocol and one of its variants, empty if it has none."""

    protocol: str
    variant: str

    def __str__(self) -> str:
        return " ".join(dict.fromkeys(self)).rstrip()


def kinds_of(motors: Commissioning, bus: int, texts: Iterable[str]) -> list[Kind]:
    """Give the kinds to look for on a bus, by the flags or else by the configuration."""
    chosen = []
    for text in texts:
        name, _, variant = text.partition(":")
        known = [entry["name"] for entry in protocols()]
        if name not in known:
            raise WrongFlags(f"no protocol `{name}`, expected one of {', '.join(known)}")
        variants = [word for word, _, _ in candidates(name)]
        if not variants:
            raise WrongFlags(f"motors of {name} cannot be asked: they send unasked")
        if variant and variant not in variants:
            raise WrongFlags(
                f"{name} has no variant `{variant}`, expected one of {', '.join(variants)}"
            )
        chosen += [Kind(name, word) for word in variants if variant in ("", word)]
    if not chosen:
        of_bus = [motor for motor in motors.motors if motor["bus"] == bus]
        chosen = [Kind(motor["protocol"], motor["variant"]) for motor in of_bus]
    return list(dict.fromkeys(kind for kind in chosen if range_of(kind) is not None))


def range_of(kind: Kind) -> tuple[int, int] | None:
    """Give the least and greatest identifier of a kind."""
    of_protocol = candidates(kind.protocol)
    ends = ((least, most) for word, least, most in of_protocol if word == kind.variant)
    return next(ends, None)


class Found(NamedTuple):
    """A motor that answered."""

    protocol: str
    id: int
    reply: int


def scan_all(
    motors: Commissioning,
    seconds: float,
    texts: Iterable[str],
    progress: Callable[[str, int, int], None],
) -> list[list[str]]:
    """Ask every identifier of the kinds to look for, on every bus.

    No motor gets power or is changed, but motors under power lose it. Give rows of `bus, protocol,
    variants, id, reply` for the motors missing in the configuration.
    """
    rows = []
    for bus, entry in motors.open_buses():
        found: dict[Found, set[str]] = {}
        known = {(motor["protocol"], motor["id"]) for motor in motors.motors if motor["bus"] == bus}
        for kind in kinds_of(motors, bus, texts):
            if kind.protocol in FD_ONLY and entry["data_bitrate"] is None:
                continue
            for motor, is_whole in _of_kind(motors, bus, kind, seconds, progress):
                if (motor.protocol, motor.id) not in known:
                    found.setdefault(motor, set()).update([kind.variant] if is_whole else [])
        for motor, variants in sorted(found.items()):
            rows.append(
                [
                    entry["name"],
                    motor.protocol,
                    " or ".join(sorted(variants)) if variants else "malformed",
                    f"id {motor.id}",
                    f"replies on 0x{motor.reply:X}",
                ]
            )
    return rows


FD_ONLY = frozenset(entry["name"] for entry in protocols() if entry["fd"])
"""Protocols with frames of CAN FD."""


def _of_kind(
    motors: Commissioning,
    bus: int,
    kind: Kind,
    seconds: float,
    progress: Callable[[str, int, int], None],
) -> set[tuple[Found, bool]]:
    """Give the answering motors of a kind on a bus, and whether they use its variant's form.

    A frame names its sender, so late answers count too.
    """
    least, most = range_of(kind) or (0, -1)
    # a question must not be a command to a motor of another protocol
    taken = {
        number
        for motor in motors.motors
        if motor["bus"] == bus and motor["protocol"] != kind.protocol
        for number in motor["identifiers"]
    }
    asked: dict[int, Candidate] = {}
    frames: set[Frame] = set()

    def listen(time_left: float) -> None:
        frames.update(motors.hear_frames(bus, time_left))

    # unsolicited frames are not answers
    unasked = {(frame.id, frame.extended) for frame in motors.hear_frames(bus, UNASKED)}
    name = f"{motors.bus_name(bus)}: {kind}"
    for identifier in range(least, most + 1):
        candidate = Candidate(kind.protocol, kind.variant, identifier)
        question = candidate.probe()
        if taken.isdisjoint(frame.id for frame in question):
            asked[identifier] = candidate
            motors.send_to(bus, question)
            listen(PACE)
        progress(name, identifier - least + 1, most - least + 1)
    listen(seconds)

    found = set()
    for frame in frames:
        if (frame.id, frame.extended) in unasked:
            continue
        heard = {
            identifier: what
            for identifier, candidate in asked.items()
            if (what := candidate.hears(time.monotonic_ns(), frame)) is not None
        }
        # some measurements hold only a part of the identifier; answers hold all of it
        sure = [identifier for identifier, what in heard.items() if what in ANSWERS]
        whose = sure or list(heard)
        if len(whose) == 1:
            is_whole = heard[whose[0]] != "malformed"
            found.add((Found(kind.protocol, whose[0], frame.id), is_whole))
    return found


def set_id(motors: Commissioning, motor: int, identifier: int) -> None:
    """Give a motor another identifier, and check that it answers there and only there."""
    name, entry = motors.name(motor), motors.motors[motor]
    protocol, variant = entry["protocol"], entry["variant"]
    frames = motors.drives.set_id(motor, identifier)
    if frames is None:
        raise Failed(
            f"{name}: {Kind(protocol, variant)} cannot be given the identifier {identifier} by "
            "command; use the maker's tool"
        )
    old, new = (Candidate(protocol, variant, number) for number in (entry["id"], identifier))
    motors.disable(motor)
    motors.measure(motor, motors.off(motor))
    is_configured = any(
        (other["bus"], other["protocol"], other["id"]) == (entry["bus"], protocol, identifier)
        for other in motors.motors
    )
    if is_configured or answers(motors, entry["bus"], new):
        raise Failed(
            f"{name} keeps its identifier: somebody has {identifier} already; choose another one"
        )
    motors.send(motor, frames)
    if not answers(motors, entry["bus"], new):
        raise Failed(
            f"{name} does not answer as {identifier}; switch its supply off and on and `scan --all`"
        )
    if answers(motors, entry["bus"], old):
        raise Failed(
            f"{name} answers as before beside {identifier}; switch its supply off and on and "
            "`scan --all`"
        )


def answers(motors: Commissioning, bus: int, candidate: Candidate) -> bool:
    """Whether a motor answers the questions to a candidate, asked `REPEATS` times."""
    for _ in range(REPEATS):
        motors.send_to(bus, candidate.probe())
        for frame in motors.hear_frames(bus, ANSWER):
            if candidate.hears(time.monotonic_ns(), frame) in ANSWERS:
                return True
    return False
