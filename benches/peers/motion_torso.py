"""Five seconds of a hanging torso's motion by sarrus, scipy and MuJoCo: error against time.

    pip install ./client/python scipy mujoco
    cargo build --release -p sarrus-server
    python benches/peers/motion_torso.py [--sarrus target/release/sarrus] [--repeats 3]

The bundled torso, a universal joint on two actuators (8 joints, 6 rows), hangs under gravity that
points up, without forces of the actuators, and swings from rest at 0.3 and -0.2 rad; no joint comes
near its limits. Settings are those of `motion.py`; MuJoCo has the file of `sarrus export`. The
reference is scipy's DOP853 at 1e-13 on the accelerations of sarrus. MuJoCo measures gap and energy
for all: distances of the cut points and energies are those of its bodies at the engine's q, q̇.
"""

import argparse
import functools
import os
import pathlib
import subprocess
import tempfile
import time

import numpy as np
import sarrus
from motion import Motion, Run, version
from scipy.integrate import solve_ivp

GRAVITY, END = (0.0, 0.0, 9.81), 5.0
START = np.array([0.3, -0.2])
ROWS = np.linspace(0, END, 501)
ROBOT = sarrus.Robot.bundled("torso", gravity=GRAVITY)


def of_sarrus(method, step=None, tolerance=None):
    """`simulate`, less the least processor time of a motion of 1 µs, which has the same set-up."""
    exact = {} if tolerance is None else {"rtol": tolerance, "atol": tolerance}
    every = None if method == "radau5" else ROWS[1]

    def timed(end, length):
        start = time.process_time()
        found = ROBOT.simulate(end, START, method=method, step=length, every=every, **exact)
        return found, time.process_time() - start

    setup = min(timed(1e-6, step and 1e-6)[1] for _ in range(9))
    found, seconds = timed(END, step)
    assert found.end == "finished", found.end
    return Motion(found.time, found.q, found.qd, seconds - setup)


def solved(method, tolerance, **options):
    """`solve_ivp` on the accelerations of sarrus, called from Python."""
    ask = ROBOT.query("forward-dynamics", ["y", "yd", "tau_u"], ["ydd"])
    force = np.zeros(2)

    def rate(_, x):
        return np.concatenate((x[2:], ask(y=x[:2], yd=x[2:], tau_u=force).ydd))

    options |= {"method": method, "rtol": tolerance, "atol": tolerance}
    return solve_ivp(rate, (0, END), [*START, 0, 0], **options)


def of_scipy(method, tolerance):
    start = time.process_time()
    found = solved(method, tolerance, t_eval=ROWS)
    seconds = time.process_time() - start
    states = ROBOT.state(found.y[:2].T, found.y[2:].T)
    return Motion(ROWS, states.q, states.qd, seconds)


@functools.cache
def reference():
    return solved("DOP853", 1e-13, dense_output=True, max_step=5e-3).sol


class MuJoCo:
    """The robot of the exported file."""

    def __init__(self, path):
        import mujoco

        self.mujoco, self.path = mujoco, path
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        self.data = mujoco.MjData(self.model)
        self.places = [self.model.joint(name).qposadr[0] for name in ROBOT.joints]

    def run(self, integrator, step):
        """As stiff as the step allows, impedances of 0.9999, Newton's solver to 1e-15."""
        mujoco, model, data = self.mujoco, self.model, self.data
        mujoco.mj_resetData(model, data)
        model.opt.timestep, model.opt.integrator = step, integrator
        model.opt.tolerance, model.opt.iterations = 1e-15, 200
        model.eq_solref[:] = 2 * step, 1
        data.qpos[self.places] = ROBOT.state(START, np.zeros(2)).q
        rows = [(data.qpos[self.places], data.qvel[self.places])]
        steps = round(ROWS[1] / step)
        start = time.process_time()
        for _ in ROWS[1:]:
            mujoco.mj_step(model, data, nstep=steps)
            rows.append((data.qpos[self.places], data.qvel[self.places]))
        seconds = time.process_time() - start
        return Motion(ROWS, *(np.array(x) for x in zip(*rows, strict=True)), seconds)

    def measure(self, motion):
        """The largest gap and the largest change of energy."""
        mujoco, model, data = self.mujoco, self.model, self.data
        gaps, energies = [], []
        for q, qd in zip(motion.q, motion.qd, strict=True):
            data.qpos[self.places], data.qvel[self.places] = q, qd
            mujoco.mj_forward(model, data)
            energies.append(data.energy.sum())
            ends = data.site_xpos[model.eq_obj1id] - data.site_xpos[model.eq_obj2id]
            gaps.append(np.linalg.norm(ends, axis=1).max())
        return max(gaps), np.abs(np.array(energies) - energies[0]).max()


def runs(engine):
    for step in (1e-2, 1e-3):
        yield Run("sarrus", "rk4", f"{step:g} s", lambda h=step: of_sarrus("rk4", h))
    yield Run("sarrus", "euler", "0.001 s", lambda: of_sarrus("euler", 1e-3))
    for method in ("dop853", "radau5"):
        for e in (1e-4, 1e-8, 1e-12):
            make = functools.partial(of_sarrus, method, tolerance=e)
            yield Run("sarrus", method, f"{e:g}", make)
    for method in ("DOP853", "Radau"):
        for e in (1e-4, 1e-8):
            yield Run("scipy", method, f"{e:g}", functools.partial(of_scipy, method, e))
    kinds = engine.mujoco.mjtIntegrator
    for name, integrator in (
        ("Euler", kinds.mjINT_EULER),
        ("implicitfast", kinds.mjINT_IMPLICITFAST),
        ("RK4", kinds.mjINT_RK4),
    ):
        for step in (5e-3, 1e-3, 2e-4):
            make = functools.partial(engine.run, integrator, step)
            yield Run("MuJoCo", name, f"{step:g} s", make)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sarrus", default="target/release/sarrus", help="the program")
    parser.add_argument("--repeats", type=int, default=3, help="the least processor time of these")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        gravity = ",".join(map(str, GRAVITY))
        words = [arguments.sarrus, "export", "--robot", "torso", "--gravity", gravity]
        # --lenient: MJCF has no limits of speeds
        words += ["--lenient", "--to", "mjcf", "--out", folder]
        subprocess.run(words, check=True, capture_output=True)
        try:
            engine = MuJoCo(pathlib.Path(folder) / "torso.xml")
        except ImportError as error:
            print(f"MuJoCo: not run, {error}")
            return
    print("| engine | method | step or tolerance | y | gap | energy | time |")
    print("|---|---|--:|--:|--:|--:|--:|")
    for run in runs(engine):
        motions = [run.make() for _ in range(arguments.repeats)]
        of_y = [ROBOT.joints.place(name) for name in ROBOT.independents]
        error = np.abs(motions[0].q[:, of_y] - reference()(motions[0].time)[:2].T).max()
        gap, drift = engine.measure(motions[0])
        seconds = min(motion.seconds for motion in motions)
        of = f"{run.engine} {version(run.engine)} | {run.method} | {run.setting}"
        print(f"| {of} | {error:.1e} | {gap:.0e} | {drift:.0e} | {1e3 * seconds:.3g} ms |")
    print(f"load at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
