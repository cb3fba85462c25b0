"""`python -m sarrus.show`: a robot in a browser, live, and logs of the CAN bridge.

A robot moves by sliders, answered in this process or by a server; a running bridge moves it by the
measured positions of its actuators; a log is replayed, measured beside commanded, with its faults
on the time line. Needs viser, and mcap for `--mcap`: `pip install 'sarrus[show]'`.
"""

from __future__ import annotations

import argparse
import importlib
import json
import re
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sarrus import _native
from sarrus.errors import Error
from sarrus.query import Array
from sarrus.robot import Robot

# of the page that `Robot.show` gives
MEASURED, COMMANDED = (74, 95, 125), (31, 111, 235)
STEP = 0.05


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


def replayed(
    server: Any, figures: tuple[Figure, Figure], names: Sequence[str], listed: Sequence[Moment]
) -> None:
    """Show a log by a slider of its time, with a button to each fault."""
    end = listed[-1].seconds
    status = server.gui.add_markdown("")
    clock = server.gui.add_slider("time, s", 0.0, max(end, STEP), STEP / 5, 0.0)
    times = np.array([moment.seconds for moment in listed])

    def update(_: Any = None) -> None:
        moment = listed[max(0, int(np.searchsorted(times, clock.value, side="right")) - 1)]
        for figure, of in zip(figures, (moment.measured, moment.commanded), strict=True):
            y = independent(figure.robot, names, of.get("position", ()))
            if y is not None:
                figure.move(y)
        status.content = state_text(names, moment.measured)

    clock.on_update(update)
    play = server.gui.add_checkbox("play", initial_value=False)
    for moment in listed:
        if moment.fault is not None:
            button = server.gui.add_button(f"{moment.seconds:.3f} s: {moment.fault}")
            button.on_click(lambda _, at=moment.seconds: setattr(clock, "value", at))
    update()

    def playing() -> None:
        while True:
            time.sleep(STEP)
            if play.value:
                clock.value = 0.0 if clock.value >= end else min(end, clock.value + STEP)
                update()

    threading.Thread(target=playing, daemon=True).start()


def state_text(names: Sequence[str], state: dict[str, Any]) -> str:
    """Give each mechanism that is not enabled with its reason, one line each."""
    lines: dict[str, list[str]] = {}
    for name, now, reason in zip(names, state["states"], state["reasons"], strict=False):
        lines.setdefault(f"{now}: {reason}", []).append(name)
    return "\n\n".join(f"**{words}** {', '.join(of)}" for words, of in lines.items())


def watched(server: Any, figure: Figure, bridge: str) -> None:
    """Follow the measured positions of a running bridge."""
    controller = _native.Controller(bridge, watch=True)
    status = server.gui.add_markdown("")
    names = list(figure.robot.actuators)

    def following() -> None:
        while True:
            time.sleep(STEP)
            state = controller.state()
            if state is None:
                continue
            y = independent(figure.robot, names, state["position"])
            if y is not None:
                figure.move(y)
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
    parser.add_argument("--log", type=Path, metavar="FILE", help="a log of the CAN bridge")
    parser.add_argument("--config", metavar="FILE", help="the configuration of the log's bridge")
    parser.add_argument("--mcap", type=Path, metavar="FILE", help="write the log as MCAP and end")
    parser.add_argument("--port", type=int, default=8080)
    parser.add_argument("--seconds", type=float, help="end after this time")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Show until the end; 0 done, 1 a faulty robot or log, 2 wrong flags."""
    parser = _parser()
    flags = parser.parse_args(arguments)
    if (flags.log is None) != (flags.config is None) or (flags.mcap and flags.log is None):
        parser.error("--log FILE needs --config FILE, and --mcap both")
    if not flags.robot and not flags.mcap:
        parser.error("name a bundled robot, or its files")
    try:
        return _show(flags)
    except (Error, OSError, ValueError) as error:
        print(f"sarrus.show: {error}", file=sys.stderr)
        return 1


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
    is_file = Path(flags.robot[0]).suffix in {".urdf", ".smurf", ".xml"}
    robot = Robot.load(*flags.robot) if is_file else Robot.bundled(flags.robot[0])
    scene = json.loads(robot._scene())
    if flags.connect is not None:
        robot = Robot.connect(flags.connect, fingerprint=robot.fingerprint)
    server = _module("viser").ViserServer(port=flags.port, verbose=False)
    server.scene.set_up_direction("+z")
    figure = Figure(server, robot, scene, "measured")
    middle, size = figure.extent()
    server.initial_camera.look_at = tuple(middle)
    server.initial_camera.position = tuple(middle + size * np.array([1.2, -1.2, 0.6]))
    if listed:
        replayed(server, (figure, Figure(server, robot, scene, "commanded")), names, listed)
    elif flags.bridge is not None:
        watched(server, figure, flags.bridge)
    else:
        sliders(server, figure, scene)
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
