"""Motions that excite, and estimates from them and from logs of the bridge."""

import csv
import importlib
import importlib.util
import json
import re
import tempfile
import unittest
from pathlib import Path

import numpy as np
import sarrus
from sarrus import _native, logs
from sarrus.excitation import Limits

SECONDS, ROWS = 10.0, 400
PARTS = ("", "/yd", "/ydd")


def states(robot, motion):
    """Rows of y, ẏ and ÿ of a motion."""
    return tuple(
        np.column_stack([motion[name + part] for name in robot.independents]) for part in PARTS
    )


def finer(robot, motion, times):
    """The motion between its rows: the trigonometric polynomial through them, and its rates."""
    y = states(robot, motion)[0][:-1]
    n = len(y)
    rate = 2j * np.pi * np.arange(n // 2 + 1)[:, None] / motion["t"][-1]
    spectrum = np.fft.rfft(y, axis=0)
    many = times * n
    return tuple(times * np.fft.irfft(spectrum * rate**order, many, axis=0) for order in range(3))


def sines(robot, random):
    """A plain sum of sines about the middle of the ranges, as large as the limits let it be."""
    limits = Limits(robot, 1.0, {}, None)
    low, high = limits.low[limits.independent], limits.high[limits.independent]
    rate = 2 * np.pi / SECONDS * np.arange(1, 6)[:, None]
    size = random.uniform(0.5, 1.5, (5, len(low))) * (high - low) / 10
    phase = np.linspace(0, SECONDS, ROWS)[:, None, None] * rate + random.uniform(0, 6, size.shape)
    while True:
        y, yd, ydd = (
            np.sum(size * rate**order * wave(phase), axis=1)
            for order, wave in enumerate((np.sin, np.cos, lambda x: -np.sin(x)))
        )
        motion = (low + high) / 2 + y, yd, ydd
        if limits.hold(motion).all():
            return motion
        size = 0.9 * size


def forces(robot, motion):
    """Forces of the actuators, with friction."""
    query = robot.query("inverse-dynamics", ["y", "yd", "ydd"], ["tau_u"], friction=True)
    answer = query.ask(motion)
    assert not answer.status.any()
    return answer.tau_u


def log_of(robot, motion, tau_u):
    """Columns of a motion and its forces."""
    log = {"t": np.linspace(0, SECONDS, len(tau_u))}
    for part, rows in zip(PARTS, motion, strict=True):
        log |= {name + part: rows[:, k] for k, name in enumerate(robot.independents)}
    return log | {f"{name}/tau_u": tau_u[:, k] for k, name in enumerate(robot.actuators)}


def with_other_masses(robot, random):
    """The robot with other masses, inertias and friction, from another URDF."""
    urdf, submechanisms, _ = robot.origin.contents()

    def other(inertial):
        factor = float(random.uniform(0.7, 1.4))

        def scaled(number):
            return f'{number[1]}="{float(number[2]) * factor!r}"'

        return re.sub(r'\b(value|i[xyz]{2})="([^"]*)"', scaled, inertial[0])

    text = re.sub(r"<inertial>.*?</inertial>", other, urdf.decode(), flags=re.DOTALL)

    def rubbing(end):
        coulomb, viscous = random.uniform(0.1, 1.0, 2).tolist()
        return f'<dynamics friction="{coulomb!r}" damping="{viscous!r}"/>{end[0]}'

    text = re.sub(r"<dynamics[^>]*/>", "", text)
    text = re.sub(r"(?<=>)\s*</joint>", rubbing, text)
    return sarrus.Robot.from_text(text, submechanisms)


def base_of(robot):
    """Values of the base parameters in the model."""
    middle = np.zeros(len(robot.independents))
    values = robot.query("inverse-dynamics", ["y"], ["base_parameters"])(y=middle).base_parameters
    return np.flatnonzero(np.isfinite(values)), values[np.isfinite(values)]


class Excites(unittest.TestCase):
    def test_a_motion_stays_within_limits_between_its_rows_and_begins_and_ends_at_rest(self):
        for name in ("lambda", "torso", "stewart"):
            robot = sarrus.Robot.bundled(name)
            motion = sarrus.excite(robot, seconds=SECONDS, rows=ROWS + 1, tries=20, seed=3)
            self.assertEqual(motion["t"][[0, -1]].tolist(), [0.0, SECONDS])
            y, yd, ydd = states(robot, motion)
            np.testing.assert_allclose(y[0], y[-1], atol=1e-12)
            np.testing.assert_allclose(np.vstack([yd, ydd])[[0, ROWS, ROWS + 1, -1]], 0, atol=1e-9)
            between = finer(robot, motion, 10)
            for rows, found in zip((y, yd, ydd), between, strict=True):
                np.testing.assert_allclose(rows[:-1], found[::10], atol=1e-9)
            state, limits = robot.state(*between), robot.limits
            self.assertTrue(
                (limits["lower"] <= state.q).all() and (state.q <= limits["upper"]).all()
            )
            self.assertTrue((abs(state.qd) <= limits["velocity"]).all(), name)
            places = [robot.joints.place(actuator) for actuator in robot.actuators]
            self.assertTrue((abs(forces(robot, between)) <= limits["effort"][places]).all(), name)
            # and uses them
            moved = np.ptp(state.q[:, places], axis=0)
            self.assertGreater(
                max(moved / np.subtract(limits["upper"], limits["lower"])[places]), 0.6
            )

    def test_forces_of_weak_motors_and_speeds_are_what_bounds_it(self):
        robot = sarrus.Robot.bundled("lambda")
        urdf, submechanisms, _ = robot.origin.contents()
        fast = sarrus.excite(robot, seconds=2.0, rows=ROWS, tries=10)
        largest = abs(forces(robot, states(robot, fast))).max()
        speed = abs(robot.state(*states(robot, fast)).qd).max()
        for key, old, bound in (("effort", "1000", 0.8 * largest), ("velocity", "10", 0.5 * speed)):
            text = re.sub(rf'{key}="{old}(\.0)?"', f'{key}="{bound}"', urdf.decode())
            weak = sarrus.Robot.from_text(text, submechanisms)
            slow = states(weak, sarrus.excite(weak, seconds=2.0, rows=ROWS, tries=10))
            answer = weak.query("inverse-dynamics", ["y", "yd", "ydd"], friction=True).ask(slow)
            self.assertFalse(answer.warnings.any())
            found = abs(forces(weak, slow)) if key == "effort" else abs(weak.state(*slow).qd)
            self.assertTrue(0.5 * bound < found.max() <= bound, (key, found.max(), bound))

    def test_it_conditions_better_than_plain_sums_of_sines(self):
        for name in ("lambda", "torso", "ankle"):
            robot = sarrus.Robot.bundled(name)
            judge = Limits(robot, 1.0, {}, None).judge
            motion = sarrus.excite(robot, seconds=SECONDS, rows=ROWS)
            found = judge(states(robot, motion))
            random = np.random.default_rng(3)
            plain = [judge(sines(robot, random)) for _ in range(5)]
            self.assertLess(found, min(plain), name)

    def test_its_condition_number_is_that_of_the_estimate(self):
        robot = sarrus.Robot.bundled("lambda")
        motion = states(robot, sarrus.excite(robot, rows=ROWS, tries=10))
        for rows in (motion, tuple(0.01 * part for part in motion)):
            hidden, condition = Limits(robot, 1.0, {}, None).judge(rows)
            found = sarrus.identify(robot, log_of(robot, rows, forces(robot, rows)))
            self.assertAlmostEqual(found.condition / condition, 1.0, places=5)
            self.assertEqual(np.isnan(found.standard_errors).sum(), hidden)

    def test_other_masses_are_found_from_a_noisy_log_of_it(self):
        for name in ("lambda", "torso", "ankle"):
            robot = sarrus.Robot.bundled(name)
            random = np.random.default_rng(8)
            other = with_other_masses(robot, random)
            motion = states(robot, sarrus.excite(robot, seconds=SECONDS, rows=4 * ROWS))
            tau_u = forces(other, motion)
            noise = 0.01 * np.sqrt(np.mean(tau_u**2, axis=0))
            tau_u += noise * random.standard_normal(tau_u.shape)
            found = sarrus.identify(robot, log_of(robot, motion, tau_u))
            places, true = base_of(other)
            np.testing.assert_array_equal(places, base_of(robot)[0])
            excited = np.isfinite(found.standard_errors)
            self.assertTrue(excited.all(), name)
            off = abs(found.values - true) / found.standard_errors
            self.assertTrue(0.3 < np.mean(off**2) < 2.0, (name, off))
            self.assertLess(off.max(), 3.0, name)
            np.testing.assert_allclose(found.noise, noise, rtol=0.1)
            # the model's own numbers are refuted
            self.assertGreater(max(abs(found.model - true) / found.standard_errors), 10.0)

    def test_a_seed_is_a_motion(self):
        robot = sarrus.Robot.bundled("torso")
        done = []
        first, same, other = (
            sarrus.excite(robot, rows=50, tries=6, seed=seed, progress=lambda *x: done.append(x))
            for seed in (1, 1, 2)
        )
        for key in first:
            np.testing.assert_array_equal(first[key], same[key])
        self.assertGreater(abs(first["BodyRoll"] - other["BodyRoll"]).max(), 0.01)
        self.assertEqual(done, [(k + 1, 6) for k in range(6)] * 3)

    def test_a_reach_narrows_the_limits_or_stands_for_them(self):
        robot = sarrus.Robot.bundled("lambda")
        reach = {"Elbow": (0.1, 0.5), "ElbowAct": (-0.02, 1.0)}
        motion = sarrus.excite(robot, rows=50, tries=4, reach=reach)
        u = robot.to_actuators(motion["Elbow"][:, None]).u
        self.assertTrue(motion["Elbow"].min() >= 0.1 and motion["Elbow"].max() <= 0.5)
        self.assertTrue(u.min() >= -0.02)
        urdf, submechanisms, _ = robot.origin.contents()
        pattern = r'(<joint name="Elbow" type=")revolute(".*?)<limit[^>]*/>'
        text, count = re.subn(pattern, r"\1continuous\2", urdf.decode(), flags=re.DOTALL)
        self.assertEqual(count, 1)
        free = sarrus.Robot.from_text(text, submechanisms)
        with self.assertRaisesRegex(ValueError, "no limits of position of Elbow: give `reach="):
            sarrus.excite(free)
        motion = sarrus.excite(free, rows=50, tries=10, reach={"Elbow": (-0.3, 0.4)})
        self.assertGreater(np.ptp(motion["Elbow"]), 0.3)

    def test_robots_and_words_that_make_no_motion_are_refused(self):
        robot = sarrus.Robot.bundled("lambda")
        for words, wrong in (
            ("`rows` is 1, expected 2 or more", {"rows": 1}),
            ("`harmonics` is 1, expected 2 or more", {"harmonics": 1}),
            ("`tries` is 0, expected 1 or more", {"tries": 0}),
            ("`seconds` is -1, expected a positive number", {"seconds": -1}),
            ("`share` is 2, expected a number above 0", {"share": 2}),
            ("`reach` names `Elba`", {"reach": {"Elba": (0, 1)}}),
            ("`reach` of Elbow is", {"reach": {"Elbow": (1, 0)}}),
            ("no pose within the limits", {"reach": {"ElbowAct": (0.08, 0.0800000001)}}),
        ):
            with self.assertRaisesRegex(ValueError, words):
                sarrus.excite(robot, **wrong)
        with self.assertRaisesRegex(TypeError, "`progress` is 5, expected a function"):
            sarrus.excite(robot, progress=5)
        for floating in (
            sarrus.Robot.bundled("stewart_floating"),
            sarrus.Robot.bundled("lambda", floating_base=True),
        ):
            with self.assertRaisesRegex(ValueError, "floating joint [^/]*, expected joints with"):
                sarrus.excite(floating)
        with self.assertRaisesRegex(ValueError, "0 actuators for 0 independent joints"):
            sarrus.excite(sarrus.Robot.bundled("lambda", lock=["*"]))


GEAR, RATE, POSITION, SPEED, TORQUE = 100.0, 500, 12.5, 100.0, 2.0
MOTOR = f"""
- actuator: {{name}}
  bus: one
  drive: {{{{protocol: mit, variant: mini_cheetah, id: {{id}}, reply_id: 0, torque_range: {TORQUE},
    position_range: {POSITION}, velocity_range: {SPEED}, stiffness_range: 50, damping_range: 5}}}}
  gear: {GEAR}
  offset: 0
  limits: {{{{position: [-0.1, 0.1], effort: 190, velocity: 0.9}}}}
  damping: 100
  watchdog_ms: 100
  watchdog: believed
"""


def answer_of_motor(place, u, ud, tau_u):
    """A frame of a mini cheetah that measures this, in the codes of its protocol."""

    def code(value, most, bits):
        return round((value / most + 1) / 2 * ((1 << bits) - 1))

    torque = code(tau_u / GEAR, TORQUE, 12)
    number = code(u * GEAR, POSITION, 16) << 24 | code(ud * GEAR, SPEED, 12) << 12 | torque
    return f"000#{(place + 1 << 40 | number):012X}"


def run_of_bridge(robot, other, motion, folder):
    """Configuration and log of a bridge whose motors move another robot, which follows exactly."""
    config, log = folder / "robot.yml", folder / "run.jsonl"
    text = f"rate_hz: {RATE}\nbuses:\n- {{name: one, interface: virtual, channel: one}}\nmotors:"
    # in an order of its own
    order = [*reversed(range(len(robot.actuators)))]
    text += "".join(MOTOR.format(name=robot.actuators[k], id=k + 1) for k in order)
    config.write_text(text)
    # holds for two seconds, moves, and holds
    rows = [np.vstack([part[[0] * (2 * RATE)], part, part[[-1] * RATE]]) for part in motion]
    moved = robot.to_actuators(*rows[:2])
    tau_u = forces(other, rows)
    bridge = _native.Bridge(_native.Configuration.load(config))
    lines = []

    def add(line):
        lines.append(line)
        return bridge.replay(json.dumps(line))[0]

    for k, (u, ud, effort) in enumerate(zip(moved.u, moved.ud, tau_u, strict=True)):
        t = 10**9 + k * 10**9 // RATE
        asked = {"sequence": k + 1, "stamp_ns": t, "position": u, "velocity": ud, "effort": effort}
        asked |= {"stiffness": np.full(2, 5e4), "damping": np.full(2, 1e3)}
        command = {
            key: value if np.ndim(value) == 0 else value[order].tolist()
            for key, value in asked.items()
        }
        add({"t": t, "command": command})
        if k == RATE // 2:
            add({"t": t, "operate": "arm"})
        # a motor answers each frame
        for frame in add({"t": t, "cycle": True}):
            place = int(re.search(r"00([12])#", frame)[1]) - 1
            answer = answer_of_motor(place, u[place], ud[place], effort[place])
            add({"t": t + 300_000, "frame": answer, "bus": "one"})
    log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return config, log


class Bridge(unittest.TestCase):
    def test_a_log_of_a_bridge_gives_the_masses_of_the_robot_that_it_moved(self):
        robot = sarrus.Robot.bundled("torso")
        other = with_other_masses(robot, np.random.default_rng(5))
        rows = int(SECONDS * RATE)
        motion = states(robot, sarrus.excite(robot, seconds=SECONDS, rows=rows, tries=30))
        with tempfile.TemporaryDirectory() as folder:
            config, log = run_of_bridge(robot, other, motion, Path(folder))
            columns = logs.replayed(config, log)
            found = sarrus.identify(robot, log, config=config)
            # the table of `sarrus-can log --csv`: no number is an empty cell, commands go unread
            path = Path(folder, "run.csv")
            with path.open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow([*columns, "BodyActL/commanded_effort", "BodyActL/reason"])
                for row in zip(*columns.values(), strict=True):
                    known = ("" if x != x else x for x in row)
                    writer.writerow([*known, "", "none"])
            same = sarrus.identify(robot, path)
        np.testing.assert_array_equal(found.values, same.values)
        state = columns["BodyActL/state"]
        self.assertEqual([state[0], state[-1]], ["disabled", "enabled"])
        table = logs.measured(robot, columns)
        start, end = table["t"][[0, -1]]
        self.assertTrue(start == 0 and SECONDS + 2 < end < SECONDS + 3, end)
        # means of y are those of the motion, and rates come from them
        self.assertLess(abs(table["BodyRoll"].max() - motion[0][:, 1].max()), 1e-3)
        columns = robot.query("inverse-dynamics", ["y", "yd", "ydd"], ["regressor_u"])
        explained = columns.ask(motion).regressor_u[..., base_of(robot)[0]]
        true = forces(other, motion)
        for values, least, most in ((found.values, 0.0, 0.02), (found.model, 0.1, np.inf)):
            off = np.linalg.norm(explained @ values - true) / np.linalg.norm(true)
            self.assertTrue(least <= off < most, off)

    def test_a_table_of_parquet_is_one_of_csv(self):
        if importlib.util.find_spec("pyarrow") is None:
            print("pyarrow is absent: not run")
            return
        parquet = importlib.import_module("pyarrow.parquet")
        pyarrow = importlib.import_module("pyarrow")
        robot = sarrus.Robot.bundled("lambda")
        motion = states(robot, sarrus.excite(robot, rows=ROWS, tries=2))
        log = log_of(robot, motion, forces(robot, motion))
        with tempfile.TemporaryDirectory() as folder:
            paths = Path(folder, "log.parquet"), Path(folder, "log.csv")
            parquet.write_table(pyarrow.table(log), paths[0])
            rows = np.column_stack([*log.values()])
            np.savetxt(paths[1], rows, "%.17g", ",", header=",".join(log), comments="")
            found = [sarrus.identify(robot, of).values for of in (log, *paths)]
        np.testing.assert_array_equal(found[0], found[1])
        np.testing.assert_array_equal(found[0], found[2])

    def test_logs_that_tell_nothing_are_refused(self):
        robot = sarrus.Robot.bundled("lambda")
        with self.assertRaisesRegex(ValueError, "column `Elbow` has no finite number in row 1"):
            sarrus.identify(robot, {"t": [0, 1], "Elbow": [0.1, np.nan], "note": ["a", "b"]})
        with self.assertRaisesRegex(ValueError, "column `t`: could not convert"):
            sarrus.identify(robot, {"t": ["now"]})
        with self.assertRaisesRegex(ValueError, "found a, b, expected columns such as"):
            sarrus.identify(robot, {"a": [0], "b": [0]})
        with self.assertRaisesRegex(ValueError, "found no column `Elbow`"):
            sarrus.identify(robot, {"t": [0, 1]})
        n = 200
        log = {"time": 0.001 * np.arange(n), "ElbowAct/position": np.full(n, 0.01)}
        with self.assertRaisesRegex(ValueError, "no column `ElbowAct/effort`"):
            sarrus.identify(robot, log)
        log["ElbowAct/effort"] = np.full(n, np.nan)
        with self.assertRaisesRegex(ValueError, "no cycle in which all actuators are enabled"):
            sarrus.identify(robot, log)
        log |= {"ElbowAct/effort": np.zeros(n), "ElbowAct/state": ["fault"] * n}
        with self.assertRaisesRegex(ValueError, "no cycle in which all actuators are enabled"):
            sarrus.identify(robot, log)
        log |= {"ElbowAct/position": np.full(n, 3.0), "ElbowAct/state": ["enabled"] * n}
        with self.assertRaisesRegex(ValueError, "no pose with the actuators at .*: unreachable"):
            sarrus.identify(robot, log)


if __name__ == "__main__":
    unittest.main()
