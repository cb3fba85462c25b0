"""`python -m sarrus.can`: results on stdout, messages on stderr.

Exit codes: 0 done; 1 the configuration is faulty, or the operation failed; 2 wrong flags, or a file
or bus that cannot be opened.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import logging
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sarrus import __version__
from sarrus._native import Configuration, Frame
from sarrus.can import commissioning, finding, moving
from sarrus.can.adapters import Address, BusError, close_all, open_all
from sarrus.can.leaving import Leave, ending
from sarrus.can.record import Recorder
from sarrus.can.replay import BadLine, replay
from sarrus.can.run import run
from sarrus.can.telling import WrongFlags, hush, say

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

HAZARD = (
    "{actuator} gets power and moves by {distance:g} (rad or m) and back within {seconds:g} s.\n"
    "Keep out of its reach, support what gravity pulls, and have a hand on the emergency stop."
)


def main(arguments: list[str] | None = None) -> int:
    """Run one command and give its exit code."""
    options = parser().parse_args(arguments)
    # exceptions report errors of interfaces already
    logging.getLogger("can").setLevel(logging.CRITICAL)
    try:
        code = int(options.command(options))
        if sys.stdout is not None:
            sys.stdout.flush()
        return code
    except (commissioning.Failed, BadLine, ValueError) as error:
        return tell(error, 1)
    except BrokenPipeError:
        # the reader of stdout has closed it
        hush(sys.stdout)
        return 0
    except (WrongFlags, BusError, OSError) as error:
        return tell(error, 2)
    except Leave as error:
        return tell(f"ended: {error}; motors are without power", 1)


def tell(error: object, code: int) -> int:
    """Report an error on stderr."""
    say(f"sarrus.can: {error}".rstrip())
    return code


def parser() -> argparse.ArgumentParser:
    """The flags, each defined once."""
    top = argparse.ArgumentParser(
        prog="python -m sarrus.can",
        description="The CAN bridge under python-can, and commissioning of motors.",
    )
    top.add_argument("--version", action="version", version=__version__)
    commands = top.add_subparsers(required=True, metavar="COMMAND")

    where = argparse.ArgumentParser(add_help=False)
    where.add_argument("config", metavar="CONFIG", help="the robot's buses and motors")
    where.add_argument(
        "--interface",
        type=word,
        help="python-can's interface for all buses, instead of the configuration's",
    )
    where.add_argument(
        "--channel",
        action="append",
        default=[],
        metavar="[BUS=]CHANNEL",
        help="another channel of a bus; may be repeated",
    )
    some = argparse.ArgumentParser(add_help=False)
    some.add_argument(
        "motor", nargs="?", metavar="ACTUATOR", help="one motor, by its actuator; without it all"
    )
    one = argparse.ArgumentParser(add_help=False)
    one.add_argument("motor", metavar="ACTUATOR", help="the motor, by its actuator")
    one.add_argument("--yes", action="store_true", help="do not ask for confirmation")

    command = commands.add_parser(
        "run", parents=[where], help="run the bridge until SIGINT, SIGTERM or the end of its parent"
    )
    command.add_argument("--name", default="default", help="name under which controllers find it")
    command.add_argument("--seconds", type=positive, help="end after this time")
    command.add_argument("--dry-run", action="store_true", help="send nothing")
    command.add_argument("--record", metavar="FILE", help="record all frames: .blf, .asc or .log")
    command.add_argument(
        "--log",
        metavar="FILE",
        help="log all inputs of the bridge, as JSON lines for `replay`",
    )
    command.add_argument(
        "--fault-log",
        metavar="FOLDER",
        help="folder for the inputs before each fault, which `replay` reads; without it "
        "`sarrus/faults` in the user's state directory",
    )
    command.add_argument(
        "--no-realtime",
        action="store_true",
        help="neither request a real-time priority nor lock memory",
    )
    command.set_defaults(command=run_bridge)

    command = commands.add_parser(
        "record", parents=[where], help="record the frames of all buses and send nothing"
    )
    command.add_argument(
        "--out", metavar="FILE", required=True, help="the file: .blf, .asc or .log"
    )
    command.add_argument("--seconds", type=positive, help="end after this time")
    command.set_defaults(command=record)

    command = commands.add_parser(
        "replay", help="print the frames that the bridge sends for a log; no bus is opened"
    )
    command.add_argument("config", metavar="CONFIG", help="the robot's buses and motors")
    command.add_argument(
        "log", metavar="LOG", help="JSON lines of frames, events, commands, operations and cycles"
    )
    command.set_defaults(command=replay_log)

    command = commands.add_parser(
        "scan", parents=[where, some], help="list the motors that answer and other identifiers"
    )
    command.add_argument("--seconds", type=positive, default=1.0, help="time to listen for answers")
    command.add_argument(
        "--all",
        action="store_true",
        help="also ask every identifier, to find motors missing in the configuration; motors under "
        "power lose it",
    )
    command.add_argument(
        "--protocol",
        action="append",
        default=[],
        metavar="NAME[:VARIANT]",
        help="with --all: look for these instead of the kinds configured on a bus; may be repeated",
    )
    command.set_defaults(command=scan)

    command = commands.add_parser(
        "read", parents=[where, some], help="print measurements, state and parameters of motors"
    )
    command.add_argument(
        "--seconds", type=positive, default=0.1, help="time to wait for each parameter"
    )
    command.set_defaults(command=read)

    command = commands.add_parser(
        "zero",
        parents=[where, one],
        help="make the present position the motor's zero, or find the offset",
    )
    command.add_argument(
        "--at",
        type=finite,
        metavar="Q",
        help="the actuator is at Q now (rad or m): print the offset and change nothing",
    )
    command.add_argument(
        "--save",
        action="store_true",
        help="also have the motor store its zero, which then outlasts the supply",
    )
    command.set_defaults(command=zero)

    command = commands.add_parser(
        "set-id", parents=[where, one], help="give a motor another identifier, if its protocol can"
    )
    command.add_argument("id", type=identifier, metavar="ID", help="the new one, also as 0x…")
    command.set_defaults(command=set_id)

    command = commands.add_parser(
        "direction", parents=[where, one], help="move a little and back: direction, sign and scale"
    )
    command.add_argument(
        "--distance",
        type=nonzero,
        required=True,
        help="how far, in rad or m of the actuator, with its sign",
    )
    command.add_argument(
        "--stiffness",
        type=positive,
        required=True,
        help="stiffness at the actuator, N m/rad or N/m",
    )
    command.add_argument(
        "--damping",
        type=positive,
        required=True,
        help="damping at the actuator, N m s/rad or N s/m",
    )
    command.add_argument("--seconds", type=positive, default=2.0, help="time for one way")
    command.set_defaults(command=direction)
    return top


def word(text: str) -> str:
    """A text that is not empty."""
    if not text:
        raise argparse.ArgumentTypeError("it is empty")
    return text


def finite(text: str) -> float:
    """A finite number."""
    try:
        number = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is no number") from None
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text} is not finite")
    return number


def identifier(text: str) -> int:
    """A whole number that is not negative."""
    try:
        number = int(text, 0)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is no whole number") from None
    if number < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return number


def positive(text: str) -> float:
    """A number greater than zero."""
    number = finite(text)
    if number <= 0:
        raise argparse.ArgumentTypeError(f"{text} is not greater than 0")
    return number


def nonzero(text: str) -> float:
    """A number other than zero."""
    number = finite(text)
    if number == 0:
        raise argparse.ArgumentTypeError("0 is no distance")
    return number


def addresses(
    options: argparse.Namespace, configuration: Configuration
) -> Callable[[dict[str, Any]], Address]:
    """Give the address of each bus, by the flags or else by the configuration."""
    names = [bus["name"] for bus in configuration.buses]
    channels: dict[str, str] = {}
    for text in options.channel:
        name, is_named, channel = text.partition("=")
        if not is_named and len(names) == 1:
            name, channel = names[0], text
        if name not in names or not channel:
            near = [] if name in names else difflib.get_close_matches(name, names, 1)
            hint = f"; did you mean `{near[0]}`?" if near else ""
            raise WrongFlags(
                f"--channel `{text}`, "
                f"expected BUS=CHANNEL with one of the buses {', '.join(names)}{hint}"
            )
        if name in channels:
            raise WrongFlags(
                f"--channel `{text}`: {name} has the channel `{channels[name]}` already, "
                "expected one for each bus"
            )
        channels[name] = channel
    return lambda bus: Address.of(bus, options.interface, channels.get(bus["name"]))


@contextlib.contextmanager
def opened(options: argparse.Namespace) -> Iterator[commissioning.Commissioning]:
    """Open the buses of the chosen motors; a signal leaves the block."""
    configuration = Configuration.load(options.config)
    address = addresses(options, configuration)
    with (
        ending(deferred=False) as stop,
        commissioning.Commissioning(configuration, address, stop, options.motor) as motors,
    ):
        yield motors


def table(rows: list[list[str]]) -> None:
    """Print rows in columns."""
    widths = (
        [max(len(row[column]) for row in rows) for column in range(len(rows[0]))] if rows else []
    )
    for row in rows:
        print(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        )


def run_bridge(options: argparse.Namespace) -> int:
    """Run the bridge."""
    configuration = Configuration.load(options.config)
    return run(
        configuration,
        options.name,
        addresses(options, configuration),
        seconds=options.seconds,
        dry_run=options.dry_run,
        wants_realtime=not options.no_realtime,
        record=options.record,
        log=options.log,
        fault_log=options.fault_log,
    )


def record(options: argparse.Namespace) -> int:
    """Record all frames."""
    configuration = Configuration.load(options.config)
    buses, address = configuration.buses, addresses(options, configuration)
    end = math.inf if options.seconds is None else time.monotonic() + options.seconds
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(ending())
        adapters = open_all(replace(address(bus), listen_only=True) for bus in buses)
        stack.callback(close_all, adapters)
        # a bus that cannot be opened leaves an earlier recording unchanged
        file = stack.enter_context(Recorder(options.out, [bus["name"] for bus in buses]))
        say("ready", out=True)
        while not stop and time.monotonic() < end:
            for bus, adapter in enumerate(adapters):
                for heard in adapter.receive():
                    if isinstance(heard, Frame):
                        file.put(bus, heard, received=True)
            time.sleep(0.001)
    say(file.summary)
    return 0


def replay_log(options: argparse.Namespace) -> int:
    """Print the frames of a replay."""
    configuration = Configuration.load(options.config)
    with Path(options.log).open(encoding="utf-8") as lines:
        try:
            for line in replay(configuration, options.log, lines):
                print(line)
        except UnicodeDecodeError as error:
            raise OSError(
                f"cannot read {options.log}: {error}; give the path of a text file"
            ) from error
    return 0


def scan(options: argparse.Namespace) -> int:
    """List the motors that answer, and identifiers of other nodes."""
    with opened(options) as motors:
        rows, complete = commissioning.scan(motors, options.seconds)
        table(rows)
        for (bus, number), count in sorted(motors.unknown.items()):
            print(f"{bus}: 0x{number} of no motor of the configuration, {count} frame(s)")
        if options.all:
            found = finding.scan_all(motors, options.seconds, options.protocol, progress)
            say(f"{len(found)} motor(s) that the configuration does not know")
            table(found)
    return 0 if complete else 1


def progress(name: str, done: int, all_of_them: int) -> None:
    """Report progress: in one line on a terminal, elsewhere four times."""
    if sys.stderr is not None and sys.stderr.isatty():
        ends = "\n" if done == all_of_them else "\r"
        print(f"{name}: {done} of {all_of_them}", end=ends, file=sys.stderr, flush=True)
    elif done == all_of_them or done % max(all_of_them // 4, 1) == 0:
        say(f"{name}: {done} of {all_of_them}")


def set_id(options: argparse.Namespace) -> int:
    """Give a motor another identifier."""
    with opened(options) as motors:
        commissioning.confirm(
            f"{options.motor} gets the identifier {options.id}. It has no power; no other motor of "
            "its bus may have that one.",
            options.yes,
        )
        finding.set_id(motors, motors.chosen[0], options.id)
    print(f"{options.motor} answers as {options.id}: write it into the configuration")
    return 0


def read(options: argparse.Namespace) -> int:
    """Print measurements, states and parameters."""
    with opened(options) as motors:
        rows, complete = commissioning.read(motors, options.seconds)
        table(rows)
    return 0 if complete else 1


def zero(options: argparse.Namespace) -> int:
    """Set a motor's zero, or find the offset for the zero that it has."""
    if options.at is not None and options.save:
        raise WrongFlags("--at changes nothing that --save could store; give one of them")
    with opened(options) as motors:
        motor = motors.chosen[0]
        if options.at is None:
            if options.save:
                # before the confirmation
                commissioning.storing(motors, motor)
            commissioning.confirm(
                f"The present position of {options.motor} becomes the zero of its motor. It has no "
                "power; it must not move.",
                options.yes,
            )
            position = commissioning.zero(motors, motor, save=options.save)
            print(f"motor position {position:g} rad")
            if options.save:
                print("stored: after a new start of its supply `read` must give the same position")
            return 0
        measured = motors.measure(motor, motors.off(motor))
        print(f"offset: {commissioning.offset_at(motors.motors[motor], measured, options.at):.9g}")
    return 0


def direction(options: argparse.Namespace) -> int:
    """Move an actuator by a little."""
    with opened(options) as motors:
        hazard = HAZARD.format(
            actuator=options.motor, distance=options.distance, seconds=2 * options.seconds
        )
        commissioning.confirm(hazard, options.yes)
        result = moving.direction(
            motors,
            motors.chosen[0],
            options.distance,
            options.stiffness,
            options.damping,
            options.seconds,
        )
    print(
        f"from {result['start']:g} to {result['farthest']:g} and back to {result['end']:g}: "
        f"{100 * result['share']:.0f} % of the distance"
    )
    if not 0.5 <= result["share"] <= 1.5:
        print(
            "it did not follow: stiffness too small for its load, or `gear` is wrong",
            file=sys.stderr,
        )
        return 1
    print(
        "if the actuator itself went the other way, turn `sign`; if it went another distance, "
        "correct `gear`"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
