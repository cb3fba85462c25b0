"""Five seconds of motion beside peers: error, gap of the loop and energy against processor time.

    pip install ./client/python scipy mujoco drake
    benches/peers/build.sh simbody        # needs libsimbody-dev
    python benches/peers/motion.py [--repeats 3] [--only NAME] [--picture FILE.svg]

A four-bar swings without friction from its crank at 1 rad, at rest, under gravity: crank 0.4 m,
coupler 1 m, rocker 0.8 m, ground 1.1 m, uniform rods of 2 kg/m. It has one freedom, whose equation
in closed form scipy integrates to 1e-13 as the reference.

Each engine integrates the same motion by the settings below. Rows are every 10 ms; where they would
cut a method's own steps, these steps are the rows. The table has the largest error of the crank's
angle, the largest gap between the ends of coupler and rocker, the largest change of energy, the
last two by the same formulas for all, and the least processor time of some repetitions, set-up not
included. An engine that is missing is "not run".
"""

import argparse
import collections
import functools
import importlib.metadata
import os
import pathlib
import subprocess
import sys
import time

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np
from four_bar import END, GRAVITY, ROWS, A, B, C, D, energy, first, gap, reference, rod
from scipy.integrate import solve_ivp

# pydrake imports a module `drake`, and this folder has another one
sys.path = [path for path in sys.path if path != str(pathlib.Path(__file__).resolve().parent)]
PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target")) / "peers/motion_simbody"

Motion = collections.namedtuple("Motion", "time q qd seconds")
Run = collections.namedtuple("Run", "engine method setting make")


# --- sarrus and scipy -----------------------------------------------------------------------------


@functools.cache
def sarrus_robot():
    """The four-bar, whose zero pose is that of the start: a loop is closed there."""
    import sarrus

    text = ["<robot name='four_bar'><link name='ground'/>"]
    for (name, parent, at, length), angle in zip(
        (("crank", "ground", 0, A), ("coupler", "crank", A, B), ("rocker", "ground", D, C)),
        first(),
        strict=True,
    ):
        mass, centre, (x, y, z) = rod(length)
        text.append(
            f"<link name='{name}'><inertial><origin xyz='{centre} 0 0'/><mass value='{mass}'/>"
            f"<inertia ixx='{x}' iyy='{y}' izz='{z}' ixy='0' ixz='0' iyz='0'/></inertial></link>"
            f"<joint name='{name}_joint' type='continuous'><parent link='{parent}'/>"
            f"<child link='{name}'/><origin xyz='{at} 0 0' rpy='0 0 {angle}'/>"
            "<axis xyz='0 0 1'/></joint>"
        )
    loops = (
        "submechanisms:\n- type: FOURBAR\n  contextual_name: four_bar\n"
        "  jointnames_spanningtree: [crank_joint, coupler_joint, rocker_joint]\n"
        "  jointnames_independent: [crank_joint]\n  jointnames_active: [crank_joint]\n"
        "  loop_constraints:\n  - cut_joint: pin\n    cut_joint_type: planar_revolute\n"
        "    axis: [0, 0, 1]\n    predecessor_body: coupler\n    successor_body: rocker\n"
        f"    predecessor_placement: {{xyz: [{B}, 0, 0]}}\n"
        f"    successor_placement: {{xyz: [{C}, 0, 0]}}\n"
    )
    return sarrus.Robot.from_text("".join(text) + "</robot>", loops, gravity=(0, -GRAVITY, 0))


def of_sarrus(method, step=None, tolerance=None):
    """`sarrus.Robot.simulate`; DOP853 interpolates rows, Radau5 would step onto them. A motion of
    1 µs has the same set-up, whose least time is subtracted."""
    robot = sarrus_robot()
    exact = {} if tolerance is None else {"rtol": tolerance, "atol": tolerance}
    every = None if method == "radau5" else ROWS[1]

    def timed(end, length):
        start = time.process_time()
        found = robot.simulate(end, [0.0], method=method, step=length, every=every, **exact)
        return found, time.process_time() - start

    setup = min(timed(1e-6, step and 1e-6)[1] for _ in range(9))
    found, seconds = timed(END, step)
    assert found.end == "finished", found.end
    return Motion(found.time, first() + found.q, found.qd, seconds - setup)


def of_scipy(method, tolerance):
    """`solve_ivp` on the forward dynamics of sarrus, called from Python; dense output at rows."""
    robot = sarrus_robot()
    ask = robot.query("forward-dynamics", ["y", "yd", "tau_u"], ["ydd"])
    force = np.zeros(1)

    def rate(_, x):
        return np.concatenate((x[1:], ask(y=x[:1], yd=x[1:], tau_u=force).ydd))

    start = time.process_time()
    options = {"method": method, "rtol": tolerance, "atol": tolerance}
    found = solve_ivp(rate, (0, END), [0.0, 0.0], t_eval=ROWS, **options)
    seconds = time.process_time() - start
    whole = robot.query("kinematics", ["y", "yd"], ["q", "qd"])
    rows = [whole(y=x[:1], yd=x[1:]) for x in found.y.T]
    q, qd = (np.array([row[name] for row in rows]) for name in ("q", "qd"))
    return Motion(ROWS, first() + q, qd, seconds)


# --- MuJoCo, Drake, Simbody -----------------------------------------------------------------------


def of_mujoco(integrator, step):
    """Soft loops, as stiff as the documentation allows: a time constant of two steps, the least
    before MuJoCo raises it, and impedances of 0.9999, its largest. Newton's solver to 1e-15, since
    its residual is in the accelerations. Dense matrices: the sparse Cholesky of 4.0.0 has a known
    fault (issue 3767). Masses and inertias as given: no bound, no balancing."""
    import mujoco

    def body(name, joint, at, length, within=""):
        mass, centre, (x, y, z) = rod(length)
        return (
            f"<body name='{name}' pos='{at} 0 0'><joint name='{joint}' axis='0 0 1'/>"
            f"<inertial pos='{centre} 0 0' mass='{mass}' fullinertia='{x} {y} {z} 0 0 0'/>"
            f"{within}</body>"
        )

    coupler = body("coupler", "q2", A, B, f"<site name='end' pos='{B} 0 0'/>")
    rocker = body("rocker", "q3", D, C, f"<site name='pin' pos='{C} 0 0'/>")
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><compiler angle='radian' autolimits='false' boundmass='0' boundinertia='0'/>"
        f"<option gravity='0 {-GRAVITY} 0' timestep='{step}' integrator='{integrator}'"
        " solver='Newton' tolerance='1e-15' iterations='200' jacobian='dense'/>"
        f"<worldbody>{body('crank', 'q1', 0, A, coupler)}{rocker}</worldbody><equality>"
        f"<connect site1='end' site2='pin' solref='{2 * step} 1'"
        " solimp='0.9999 0.9999 0.001 0.5 2'/></equality></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qpos[:] = first()
    rows = [(data.qpos.copy(), data.qvel.copy())]
    steps = round(ROWS[1] / step)
    start = time.process_time()
    for _ in ROWS[1:]:
        mujoco.mj_step(model, data, nstep=steps)
        rows.append((data.qpos.copy(), data.qvel.copy()))
    seconds = time.process_time() - start
    return Motion(ROWS, *(np.array(x) for x in zip(*rows, strict=True)), seconds)


def of_drake(approximation, step):
    """A discrete plant with a ball constraint, the only loop it knows. Its default approximation
    is TAMSI where no constraint is, which refuses them; SAP is what Drake takes with one."""
    from pydrake.math import RigidTransform
    from pydrake.multibody import plant as plants
    from pydrake.multibody import tree
    from pydrake.systems.analysis import Simulator

    plant = plants.MultibodyPlant(step)

    def add(name, on, at, length):
        mass, centre, moments = rod(length)
        inertia = tree.SpatialInertia.MakeFromCentralInertia(
            mass, [centre, 0, 0], tree.RotationalInertia(*moments)
        )
        body = plant.AddRigidBody(name, inertia)
        frame = plant.AddFrame(tree.FixedOffsetFrame(f"on_{name}", on, RigidTransform([at, 0, 0])))
        plant.AddJoint(tree.RevoluteJoint(f"{name}_joint", frame, body.body_frame(), [0, 0, 1]))
        return body

    crank = add("crank", plant.world_frame(), 0, A)
    coupler = add("coupler", crank.body_frame(), A, B)
    rocker = add("rocker", plant.world_frame(), D, C)
    plant.mutable_gravity_field().set_gravity_vector([0, -GRAVITY, 0])
    plant.AddBallConstraint(coupler, [B, 0, 0], rocker, [C, 0, 0])
    plant.set_discrete_contact_approximation(
        getattr(plants.DiscreteContactApproximation, approximation)
    )
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    plant.SetPositions(context, first())
    plant.SetVelocities(context, np.zeros(3))
    simulator.Initialize()
    rows = [(plant.GetPositions(context), plant.GetVelocities(context))]
    start = time.process_time()
    for row in ROWS[1:]:
        simulator.AdvanceTo(row)
        rows.append((plant.GetPositions(context), plant.GetVelocities(context)))
    seconds = time.process_time() - start
    return Motion(ROWS, *(np.array(x) for x in zip(*rows, strict=True)), seconds)


def of_simbody(method, accuracy):
    """The program of `motion_simbody.cpp`: processor seconds, then a row for each of its steps."""
    if not PROGRAM.exists():
        raise ImportError("benches/peers/build.sh simbody builds its program")
    words = [PROGRAM, method, accuracy, END, *first()]
    text = subprocess.run([str(x) for x in words], check=True, capture_output=True, text=True)
    (seconds,), *rows = [[float(x) for x in line.split()] for line in text.stdout.splitlines()]
    rows = np.array(rows)
    return Motion(rows[:, 0], rows[:, 1:4], rows[:, 4:7], seconds)


# --- the table ------------------------------------------------------------------------------------


def runs():
    """Every engine, method and setting."""
    for step in (1e-2, 5e-3, 1e-3, 1e-4):
        yield Run("sarrus", "euler", f"{step:g} s", lambda h=step: of_sarrus("euler", h))
    for step in (1e-2, 5e-3, 1e-3):
        yield Run("sarrus", "rk4", f"{step:g} s", lambda h=step: of_sarrus("rk4", h))
    for method in ("dop853", "radau5"):
        for e in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
            make = functools.partial(of_sarrus, method, tolerance=e)
            yield Run("sarrus", method, f"{e:g}", make)
    for method in ("DOP853", "Radau", "LSODA"):
        for e in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
            yield Run("scipy", method, f"{e:g}", functools.partial(of_scipy, method, e))
    for integrator in ("Euler", "implicitfast", "RK4"):
        for step in (5e-3, 2e-3, 1e-3, 2e-4):
            make = functools.partial(of_mujoco, integrator, step)
            yield Run("MuJoCo", integrator, f"{step:g} s", make)
    for step in (1e-2, 1e-3, 1e-4):
        yield Run("Drake", "SAP", f"{step:g} s", functools.partial(of_drake, "kSap", step))
    for method in ("RungeKuttaMerson", "SemiExplicitEuler2"):
        for e in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)[: 6 if method[0] == "R" else 2]:
            yield Run("Simbody", method, f"{e:g}", functools.partial(of_simbody, method, e))


def version(engine):
    """Its version, as its wheel states it."""
    try:
        return importlib.metadata.version(engine.lower())
    except importlib.metadata.PackageNotFoundError:
        return "3.7" if engine == "Simbody" else ""


def figures(run, repeats):
    """Error of the crank's angle, gap, change of energy, seconds."""
    motions = [run.make() for _ in range(repeats)]
    time_, q, qd, _ = motions[0]
    of_energy = energy(q, qd)
    error = np.abs(q[:, 0] - reference(time_)).max()
    drift = np.abs(of_energy - of_energy[0]).max()
    return error, gap(q).max(), drift, min(motion.seconds for motion in motions)


def draw(found, path):
    """The picture: error against processor time, a line for each method."""
    import matplotlib.pyplot as plt

    plt.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": "motion"}
    figure, axes = plt.subplots(figsize=(8, 5.5), layout="constrained")
    lines = {}
    for run, (error, _, _, seconds) in found:
        lines.setdefault((run.engine, run.method), []).append((seconds, max(error, 1e-13)))
    marks = {"sarrus": "o-", "scipy": "s:", "MuJoCo": "^--", "Drake": "D--", "Simbody": "v--"}
    for (engine, method), points in lines.items():
        axes.loglog(*zip(*points, strict=True), marks[engine], label=f"{engine} {method}", ms=4)
    axes.set_xlabel("processor time of 5 s of motion [s]")
    axes.set_ylabel("largest error of the crank's angle [rad]")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", fontsize=8, ncols=5)
    figure.savefig(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="the least processor time of these")
    parser.add_argument("--only", default="", help="engines whose name has this in it")
    parser.add_argument("--picture", help="the file for error against time (needs matplotlib)")
    arguments = parser.parse_args()
    found = []
    missing = {}
    for run in runs():
        if arguments.only.lower() not in run.engine.lower() or run.engine in missing:
            continue
        try:
            found.append((run, figures(run, arguments.repeats)))
        except ImportError as error:
            missing[run.engine] = error
            continue
        if len(found) == 1:
            print("| engine | method | step or tolerance | angle | gap | energy | time |")
            print("|---|---|--:|--:|--:|--:|--:|")
        error, open_, drift, seconds = found[-1][1]
        of = f"{run.engine} {version(run.engine)} | {run.method} | {run.setting}"
        print(f"| {of} | {error:.1e} | {open_:.0e} | {drift:.0e} | {1e3 * seconds:.3g} ms |")
    for engine, why in missing.items():
        print(f"{engine}: not run, {why}")
    print(f"load at the end {os.getloadavg()[0]:.1f}")
    if arguments.picture:
        draw(found, arguments.picture)


if __name__ == "__main__":
    main()
