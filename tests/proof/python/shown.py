"""Live robots in viser: `shown.py served NAME | bridge NAME | recorded NAME FILE`; the links move as
the robot does, and the words say why it does not.
"""

import contextlib
import json
import sys
import threading
import time

import numpy as np
import viser
from sarrus import _native, show


# viser's own words are no answers of this script
answers, sys.stdout = sys.stdout, sys.stderr


class Seen(viser.ViserServer):
    """The server of a view, whose sliders, texts and links a test sees."""

    last = None

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.frames, self.texts, self.sliders, self.buttons = {}, [], {}, {}
        Seen.last = self
        self._watch(self.scene, "add_frame", lambda of, args: self.frames.update({args[0]: of}))
        self._watch(self.gui, "add_markdown", lambda of, _: self.texts.append(of))
        self._watch(self.gui, "add_slider", lambda of, args: self.sliders.update({args[0]: of}))
        self._watch(self.gui, "add_button", lambda of, args: self.buttons.update({args[0]: of}))

    @staticmethod
    def _watch(on, name, note):
        make = getattr(on, name)

        def made(*arguments, **options):
            of = make(*arguments, **options)
            note(of, arguments)
            return of

        setattr(on, name, made)


viser.ViserServer = Seen


@contextlib.contextmanager
def shown(*flags, seconds=60):
    """The view of these flags while it runs."""
    Seen.last = None
    codes = []
    arguments = [*flags, "--port", "0", "--seconds", str(seconds)]
    thread = threading.Thread(target=lambda: codes.append(show.main(arguments)), daemon=True)
    thread.start()
    until(lambda: Seen.last is not None and len(Seen.last.texts) > 0 or codes)
    assert not codes, codes
    yield Seen.last


def until(holds, seconds=30):
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it does not come"
        time.sleep(0.02)


def stands(view, name, robot, y):
    """Whether all links of a drawn robot are where the robot has them at y."""
    poses = np.asarray(robot.frames(list(robot.links), y).pose)
    scene = [view.frames[f"/{name}/{k}"] for k in range(len(robot.links))]
    off = [np.abs(np.asarray(of.position) - pose[:3]).max() for of, pose in zip(scene, poses)]
    return max(off) < 1e-6


def served(name):
    """A server answers for its robot, which needs no other name."""
    robot = show.Robot.connect(name, timeout=30.0)
    with shown("--connect", name) as view:
        assert stands(view, "measured", robot, [0.0])
        view.sliders["Elbow"].value = 0.4
        until(lambda: stands(view, "measured", robot, [0.4]))
        assert view.texts[0].content == "ok"


def bridge(name):
    """A bridge has two robots, measured and commanded, and says why none is armed."""
    robot = show.Robot.bundled("rh5v2_upper_body")
    eye = _native.Controller(name, watch=True)
    seen = {}

    def is_there(drawn, look):
        seen[drawn] = look() or seen.get(drawn)
        u = seen[drawn] and seen[drawn]["position"]
        y = u and show.independent(robot, robot.actuators, u)
        return y is not None and np.isfinite(u).all() and stands(view, drawn, robot, y)

    def is_apart(far):
        apart = np.subtract(seen["commanded"]["position"], seen["measured"]["position"])
        return np.abs(apart - far).max() < 1e-3

    with shown("--bridge", name) as view:
        until(lambda: "disabled" in view.texts[0].content)
        until(lambda: is_there("measured", eye.state))
        for target in (0.01, 0.02):
            print(f"target {target}", file=answers, flush=True)
            assert sys.stdin.readline() == "done\n"
            until(lambda far=float(target): is_there("commanded", eye.commanded) and is_apart(far))
        # motors without power stay where they are
        assert is_there("measured", eye.state)
        words = view.texts[0].content
        assert all(name in words for name in robot.actuators), words
        print(json.dumps(words), file=answers, flush=True)


def recorded(name, path):
    """A recording has its robot, and buttons to the states without an answer."""
    robot = show.Robot.connect(name, timeout=30.0)
    for y in ([0.1], [np.nan], [0.3]):
        with contextlib.suppress(show.Error):
            robot.inverse_dynamics(y)
        time.sleep(0.2)
    with shown("--log", path) as view:
        assert stands(view, "measured", robot, [0.1])
        assert [text.split(" s: ")[1] for text in view.buttons] == ["non_finite_input, lane 0"]
        clock = view.sliders["time, s"]
        assert 0.4 < clock.max < 5
        clock.value = clock.max
        until(lambda: stands(view, "measured", robot, [0.3]))
        assert view.texts[0].content == "**ok** inverse-dynamics of lane 0"


{"served": served, "bridge": bridge, "recorded": recorded}[sys.argv[1]](*sys.argv[2:])
