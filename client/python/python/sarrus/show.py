"""`python -m sarrus.show`: a robot in a browser, live, and logs of the CAN bridge.

A robot moves by sliders, answered in this process or by a server; a running bridge moves two, by
the measured and by the commanded positions of its actuators. A log of a bridge is replayed
likewise, with its faults on the time line; a recording of a server, with the states that it was
asked about.
Needs viser, and mcap for `--mcap`: `pip install 'sarrus[show]'`.
"""

from __future__ import annotations

import argparse
import importlib
import json
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sarrus import _native
from sarrus.errors import Error
from sarrus.query import Array
from sarrus.robot import Robot, bundled

# of the page that `Robot.show` gives
MEASURED, COMMANDED = (74, 95, 125), (31, 111, 235)
STEP = 0.05
# first bytes of a recording of a server, and seconds between two of its states
RECORDING, SPARSE = b"sarrusRC", 0.01
# most buttons of a time line, and seconds for a bridge's first state
MARKS, WAIT = 30, 5.0


class Moment(NamedTuple):
    """A cycle of a log: measurements and set-points of the bridge, and a new fault."""

    seconds: float
    measured: dict[str, Any]
    commanded: dict[str, Any]
    fault: str | None


def moments(configuration: _native.Configuration, lines: Sequence[str]) -> Iterator[Moment]:
    """Replay the lines of a log of the bridge, one moment each cycle."""
    bridge = _native.Bridge(configuration)
    begin: float | None = None
    commanded: dict[str, Any] = {}
    fault: str | None = None
    for text in filter(str.strip, lines):
        line = json.loads(text)
        _, found = bridge.replay(text)
        # the line's own time stands in the moment
        fault = re.sub(r"^at \d+ ns ", "", found) if found else fault
        commanded = line.get("command", commanded)
        if "cycle" in line:
            begin = line["t"] if begin is None else begin
            yield Moment(1e-9 * (line["t"] - begin), bridge.state(), commanded, fault)
            fault = None


def write_mcap(path: Path, actuators: Sequence[str], listed: Sequence[Moment]) -> None:
    """Write moments as MCAP, each topic in JSON: measured, commanded, mechanisms, faults."""
    writers = _module("mcap.writer")
    names = ("position", "velocity", "effort")
    joints = {"name": {"type": "array", "items": {"type": "string"}}}
    joints |= {name: {"type": "array", "items": {"type": ["number", "null"]}} for name in names}
    texts = {"states": {"type": "array"}, "reasons": {"type": "array"}}
    topics = {
        "/measured": joints,
        "/commanded": joints,
        "/mechanisms": texts,
        "/faults": {"fault": {"type": "string"}},
    }
    with path.open("wb") as file:
        writer = writers.Writer(file)
        writer.start(library="sarrus")
        channels = {}
        for topic, fields in topics.items():
            schema = json.dumps({"type": "object", "properties": fields}).encode()
            of = writer.register_schema(f"sarrus{topic.replace('/', '.')}", "jsonschema", schema)
            channels[topic] = writer.register_channel(topic, "json", of)

        def add(topic: str, seconds: float, value: dict[str, Any]) -> None:
            stamp = round(1e9 * seconds)
            data = json.dumps(value).encode()
            writer.add_message(channels[topic], log_time=stamp, publish_time=stamp, data=data)

        for moment in listed:
            for topic, of in (("/measured", moment.measured), ("/commanded", moment.commanded)):
                numbers = {name: [_known(x) for x in of.get(name, ())] for name in names}
                add(topic, moment.seconds, {"name": list(actuators), **numbers})
            states = {name: moment.measured[name] for name in ("states", "reasons")}
            add("/mechanisms", moment.seconds, states)
            if moment.fault is not None:
                add("/faults", moment.seconds, {"fault": moment.fault})
        writer.finish()


def _known(x: float | None) -> float | None:
    return None if x is None or not np.isfinite(x) else float(x)


# --- the view -------------------------------------------------------------------------------------


class Figure:
    """A robot in a viser scene: one frame for each link, with its rods and shapes."""

    def __init__(self, server: Any, robot: Robot, scene: dict[str, Any], name: str) -> None:
        """Draw the links at y = 0; commanded robots are wires in another colour."""
        self.robot = robot
        self.links = [link["name"] for link in scene["links"]]
        is_wire = name != "measured"
        colour = COMMANDED if is_wire else MEASURED
        self.frames: list[Any] = []
        for k, link in enumerate(scene["links"]):
            frame = f"/{name}/{k}"
            self.frames.append(server.scene.add_frame(frame, show_axes=False))
            ends = [of["joint"]["at"][:3] for of in scene["links"] if _is_child(of, k)]
            if ends:
                rods = np.array([[np.zeros(3), end] for end in ends])
                rods = rods[np.linalg.norm(rods[:, 1], axis=1) > 1e-9]
                server.scene.add_line_segments(f"{frame}/rods", rods, colour)
            if link["box"] is not None and link["joint"] is not None:
                at, half = link["box"]["at"], np.array(link["box"]["half"])
                server.scene.add_box(
                    f"{frame}/box",
                    colour,
                    2 * half,
                    wireframe=is_wire,
                    opacity=0.4,
                    position=at[:3],
                    wxyz=[at[6], *at[3:6]],
                )

    def extent(self) -> tuple[Array, float]:
        """Give the middle of all links at y = 0, and their distance from each other."""
        y = [float(name.endswith("/qw")) for name in self.robot.independent_coordinates]
        at = np.asarray(self.robot.frames(self.links, y).pose)[:, :3]
        low, high = at.min(axis=0), at.max(axis=0)
        return (low + high) / 2, max(0.2, float(np.linalg.norm(high - low)))

    def move(self, y: Array) -> bool:
        """Take the robot to a pose; false where it has none."""
        try:
            poses = self.robot.frames(self.links, y).pose
        except Error:
            return False
        for frame, pose in zip(self.frames, poses, strict=True):
            frame.position = pose[:3]
            frame.wxyz = [pose[6], *pose[3:6]]
        return True

    def follow(self, names: Sequence[str], positions: Sequence[float]) -> bool:
        """Take the robot to where the actuators of these names stand; false where it has none."""
        y = independent(self.robot, names, positions)
        return y is not None and self.move(y)


def _is_child(link: dict[str, Any], parent: int) -> bool:
    return link["joint"] is not None and link["joint"]["parent"] == parent


def independent(robot: Robot, names: Sequence[str], positions: Sequence[float]) -> Array | None:
    """Give y where the actuators of these names stand there; others are at zero."""
    known = dict(zip(names, positions, strict=False))
    u = np.array([_known(known.get(name, 0.0)) or 0.0 for name in robot.actuators])
    try:
        return np.asarray(robot.to_independent(u).y)
    except Error:
        return None


def sliders(server: Any, figure: Figure, scene: dict[str, Any]) -> None:
    """Move the robot by a slider for each independent joint."""
    status = server.gui.add_markdown("")
    handles: list[Any] = []

    def update(_: Any = None) -> None:
        good = figure.move(np.array([handle.value for handle in handles]))
        status.content = "ok" if good else "**no pose here: the last one stands**"

    for of in scene["y"]:
        lower = -np.pi if of["lower"] is None else of["lower"]
        upper = lower + 2 * np.pi if of["upper"] is None else of["upper"]
        value = 1.0 if of["part"] == "qw" else min(max(0.0, lower), upper)
        handle = server.gui.add_slider(of["name"], lower, upper, (upper - lower) / 500, value)
        handle.on_update(update)
        handles.append(handle)
    update()


def timeline(
    server: Any, end: float, marks: Sequence[tuple[float, str]], show_at: Callable[[float], str]
) -> None:
    """Show what was at the time of a slider, in words too, with a button to each mark."""
    status = server.gui.add_markdown("")
    clock = server.gui.add_slider("time, s", 0.0, max(end, STEP), STEP / 5, 0.0)

    def update(_: Any = None) -> None:
        status.content = show_at(clock.value)

    clock.on_update(update)
    play = server.gui.add_checkbox("play", initial_value=False)
    for seconds, words in marks[:MARKS]:
        button = server.gui.add_button(f"{seconds:.3f} s: {words}")
        button.on_click(lambda _, at=seconds: setattr(clock, "value", at))
    update()

    def playing() -> None:
        while True:
            time.sleep(STEP)
            if play.value:
                clock.value = 0.0 if clock.value >= end else min(end, clock.value + STEP)

    threading.Thread(target=playing, daemon=True).start()


def replayed(
    server: Any, figures: tuple[Figure, Figure], names: Sequence[str], listed: Sequence[Moment]
) -> None:
    """Show a log by a slider of its time, with a button to each fault."""
    times = np.array([moment.seconds for moment in listed])

    def show_at(seconds: float) -> str:
        moment = listed[max(0, int(np.searchsorted(times, seconds, side="right")) - 1)]
        for figure, of in zip(figures, (moment.measured, moment.commanded), strict=True):
            figure.follow(names, of.get("position", ()))
        return state_text(names, moment.measured)

    marks = [(moment.seconds, moment.fault) for moment in listed if moment.fault is not None]
    timeline(server, listed[-1].seconds, marks, show_at)


class Question(NamedTuple):
    """A request of a recording: the coordinates that it is about, and its status."""

    seconds: float
    client: str
    request: str
    status: str
    field: str
    numbers: list[float]


def posed(robot: Robot, question: Question) -> Array | None:
    """Give y of a request by y, by u or by q."""
    if question.field == "y":
        return np.array(question.numbers)
    if question.field == "u":
        return independent(robot, robot.actuators, question.numbers)
    known = dict(zip(robot.coordinates, question.numbers, strict=True))
    return np.array([known[name] for name in robot.independent_coordinates])


def recalled(server: Any, figure: Figure, asked: Sequence[Question]) -> None:
    """Show a recording by a slider of its time, with a button to each state without an answer."""
    begin = asked[0].seconds
    times = np.array([question.seconds - begin for question in asked])

    def show_at(seconds: float) -> str:
        question = asked[max(0, int(np.searchsorted(times, seconds, side="right")) - 1)]
        y = posed(figure.robot, question)
        good = y is not None and figure.move(y)
        words = f"**{question.status}** {question.request} of {question.client}"
        return words if good else f"{words}, **no pose here: the last one stands**"

    marks = [(q.seconds - begin, f"{q.status}, {q.client}") for q in asked if q.status != "ok"]
    timeline(server, float(times[-1]), marks, show_at)


def state_text(names: Sequence[str], state: dict[str, Any]) -> str:
    """Give each mechanism that is not enabled with its reason, one line each."""
    lines: dict[str, list[str]] = {}
    for name, now, reason in zip(names, state["states"], state["reasons"], strict=False):
        lines.setdefault(f"{now}: {reason}", []).append(name)
    return "\n\n".join(f"**{words}** {', '.join(of)}" for words, of in lines.items())


def watched(server: Any, figures: tuple[Figure, Figure], bridge: str) -> None:
    """Follow the measured and the commanded positions of a running bridge."""
    controller = _native.Controller(bridge, watch=True)
    status = server.gui.add_markdown("")
    measured, commanded = figures
    names = list(measured.robot.actuators)

    def following() -> None:
        while True:
            time.sleep(STEP)
            if (command := controller.commanded()) is not None:
                commanded.follow(names, command["position"])
            if (state := controller.state()) is None:
                continue
            if state["fingerprint"] not in (0, measured.robot.fingerprint):
                status.content = f"**the bridge has another robot, {state['fingerprint']:016x}**"
                continue
            measured.follow(names, state["position"])
            status.content = state_text(names, state)

    threading.Thread(target=following, daemon=True).start()


# --- the command ----------------------------------------------------------------------------------


def _module(name: str) -> Any:
    """A package that only this module needs."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise SystemExit(f"sarrus.show needs {name}: pip install 'sarrus[show]'") from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("python -m sarrus.show", description=__doc__)
    parser.add_argument("robot", nargs="*", help="a bundled robot, or FILE.urdf [FILE.yml]")
    parser.add_argument("--connect", metavar="NAME", help="a server answers for the robot")
    parser.add_argument("--bridge", metavar="NAME", help="a running CAN bridge moves the robot")
    parser.add_argument(
        "--log", type=Path, metavar="FILE", help="a log of the CAN bridge, or a server's recording"
    )
    parser.add_argument("--config", metavar="FILE", help="the configuration of the log's bridge")
    parser.add_argument("--mcap", type=Path, metavar="FILE", help="write the log as MCAP and end")
    parser.add_argument("--port", type=int, default=8080)
    parser.add_argument("--seconds", type=float, help="end after this time")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Show until the end; 0 done, 1 a faulty robot or log, 2 wrong flags."""
    parser = _parser()
    flags = parser.parse_args(arguments)
    try:
        recorded = flags.log is not None and _is_recording(flags.log)
        if recorded and (flags.robot or flags.config or flags.mcap):
            parser.error("a recording has its robot: give --log FILE alone")
        if not recorded and (flags.log is None) != (flags.config is None):
            parser.error("the log of a bridge needs --config FILE")
        if flags.mcap and flags.log is None:
            parser.error("--mcap needs --log FILE and --config FILE")
        if not (flags.robot or flags.mcap or recorded or flags.connect or flags.bridge):
            parser.error("name a bundled robot, or its files")
        return _recalled(flags) if recorded else _show(flags)
    except (Error, OSError, ValueError) as error:
        print(f"sarrus.show: {error}", file=sys.stderr)
        return 1


def _is_recording(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(RECORDING)) == RECORDING


def _recalled(flags: argparse.Namespace) -> int:
    origin, entries = _native.recording(flags.log, SPARSE)
    asked = [Question(*entry) for entry in entries]
    if not asked:
        raise ValueError(f"{flags.log} has no request with a state")
    robot = Robot(origin)
    server, figure, _ = _opened(flags, robot, robot)
    recalled(server, figure, asked)
    return _until_end(server, flags)


def _show(flags: argparse.Namespace) -> int:
    listed: list[Moment] = []
    names: list[str] = []
    if flags.log is not None:
        configuration = _native.Configuration.load(flags.config)
        names = list(configuration.actuators)
        listed = list(moments(configuration, flags.log.read_text(encoding="utf-8").splitlines()))
        if not listed:
            raise ValueError(f"{flags.log} has no cycle")
        if flags.mcap is not None:
            write_mcap(flags.mcap, names, listed)
            print(flags.mcap)
            return 0
    read = _read(flags)
    robot = read
    if flags.connect is not None:
        robot = Robot.connect(flags.connect, fingerprint=read.fingerprint)
    server, figure, scene = _opened(flags, read, robot)
    if listed:
        replayed(server, (figure, Figure(server, robot, scene, "commanded")), names, listed)
    elif flags.bridge is not None:
        watched(server, (figure, Figure(server, robot, scene, "commanded")), flags.bridge)
    else:
        sliders(server, figure, scene)
    return _until_end(server, flags)


def _read(flags: argparse.Namespace) -> Robot:
    """The robot whose files are given, or the bundled one of a server or a bridge."""
    if flags.robot:
        is_file = Path(flags.robot[0]).suffix in {".urdf", ".smurf", ".xml"}
        return Robot.load(*flags.robot) if is_file else Robot.bundled(flags.robot[0])
    name = flags.connect or flags.bridge
    if flags.connect is not None:
        fingerprint = Robot.connect(flags.connect).fingerprint
    else:
        fingerprint = _state_of(flags.bridge)["fingerprint"]
    for bundled_name in bundled():
        if (robot := Robot.bundled(bundled_name)).fingerprint == fingerprint:
            return robot
    raise ValueError(f"`{name}` has no bundled robot: give its files too")


def _state_of(bridge: str) -> dict[str, Any]:
    """The first state of a bridge that can be seen."""
    controller = _native.Controller(bridge, watch=True)
    end = time.monotonic() + WAIT
    while time.monotonic() < end:
        if (state := controller.state()) is not None:
            controller.close()
            return state
        time.sleep(STEP)
    raise ValueError(f"the bridge `{bridge}` publishes no state")


def _opened(
    flags: argparse.Namespace, read: Robot, robot: Robot
) -> tuple[Any, Figure, dict[str, Any]]:
    """A viewer with a robot that was read, and that this robot answers for."""
    scene = json.loads(read._scene())
    server = _module("viser").ViserServer(port=flags.port, verbose=False)
    server.scene.set_up_direction("+z")
    figure = Figure(server, robot, scene, "measured")
    middle, size = figure.extent()
    server.initial_camera.look_at = tuple(middle)
    server.initial_camera.position = tuple(middle + size * np.array([1.2, -1.2, 0.6]))
    return server, figure, scene


def _until_end(server: Any, flags: argparse.Namespace) -> int:
    print(f"http://localhost:{server.get_port()}", flush=True)
    begin = time.monotonic()
    try:
        while flags.seconds is None or time.monotonic() - begin < flags.seconds:
            time.sleep(STEP)
    except KeyboardInterrupt:
        pass
    server.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
