"""Inverse kinematics beside pink, mink and placo, on the same targets with the same limits.

    pip install ./client/python pin-pink mink placo daqp
    cargo build --release -p sarrus-server
    python benches/peers/ik.py --sarrus target/release/sarrus [--targets 10000] [--peers 10000]
    python benches/peers/ik.py --picture benches/ik.svg [--robots "upper body"] [--targets 300]
    python benches/peers/ik.py --rows <robot.json

Each target is the pose of the hands at a random state that keeps all limits, and each search starts
at the same pose. It succeeds where its last state has the hands within 1e-6 of their targets [m and
rad], the loops closed to 1e-6 m, and every joint and motor inside its limits to 1e-6, by Pinocchio
on the exported robot for all. sarrus alone is also counted at its own bound of 1e-9. The peers get
the loops as their pages say: as equality constraints (pink, mink), as hard tasks (placo), the
motors' strokes as limits of joints, a full step for each iteration, and at most 100 of them; they
stop at 1e-7. Times are those of the searches alone, called from Python, one thread. A peer whose
wheel is missing is "not run".

With `--picture` it draws error over time instead, for one robot: the peers stop at 1e-1 … 1e-9, a
mark has the medians of time and of the error of the hands over all targets, the legend the share
found at 1e-9 (needs matplotlib). sarrus has no such setting: its search goes on to 1e-9 or the end
of its budget.

With `--rows` it serves `sarrus report` (`build.sh ik` makes it a program): the standard input has
files, start and targets of a robot, the output a run of each peer for each stop, with the error of
each target, the larger of the distance of the hand and the widest gap of a loop.
"""

import argparse
import importlib.metadata
import json
import os
import pathlib
import runpy
import subprocess
import sys
import tempfile
import time

for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np

STEPS, STOP, GOOD = 100, 1e-7, 1e-6
STOPS = [10.0**-k for k in range(1, 10)]

# a leg as of a Unitree G1: two motors on the shank turn cranks, whose rods move the foot
LEG_JOINTS = [
    # name, parent, child, origin, axis, limits, effort
    ("hip_pitch", "pelvis", "hip", (0, 0, 0), (0, 1, 0), (-2.5, 2.8), 88),
    ("hip_roll", "hip", "thigh_side", (0, 0, -0.03), (1, 0, 0), (-0.5, 2.9), 139),
    ("hip_yaw", "thigh_side", "thigh", (0, 0, -0.1), (0, 0, 1), (-2.7, 2.7), 88),
    ("knee", "thigh", "shank", (0, 0, -0.2), (0, 1, 0), (-0.08, 2.8), 139),
    ("ankle_pitch", "shank", "cross", (0, 0, -0.3), (0, 1, 0), (-0.87, 0.52), 50),
    ("ankle_roll", "cross", "foot", (0, 0, 0), (1, 0, 0), (-0.26, 0.26), 50),
]
for side, sign, up in (("left", 1, 0.20), ("right", -1, 0.13)):
    LEG_JOINTS += [
        (
            f"{side}_motor",
            "shank",
            f"{side}_crank",
            (0, 0.035 * sign, up - 0.3),
            (0, 1, 0),
            (-0.9, 0.9),
            50,
        ),
        (f"{side}_rod_a", f"{side}_crank", f"{side}_cross", (-0.05, 0, 0), (0, 1, 0), (-3, 3), 0),
        (f"{side}_rod_b", f"{side}_cross", f"{side}_rod", (0, 0, 0), (1, 0, 0), (-3, 3), 0),
    ]


def leg(folder):
    """Write the leg's files."""
    links = dict.fromkeys([name for row in LEG_JOINTS for name in row[1:3]])
    inertial = (
        "<inertial><mass value='0.5'/><inertia ixx='1e-3' iyy='1e-3' izz='1e-3' ixy='0' ixz='0'"
        " iyz='0'/></inertial>"
    )
    text = [f"<link name='{name}'>{inertial}</link>" for name in links]
    for name, parent, child, origin, axis, (lower, upper), effort in LEG_JOINTS:
        text.append(
            f"<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/>"
            f"<origin xyz='{' '.join(map(str, origin))}'/><axis xyz='{' '.join(map(str, axis))}'/>"
            f"<limit lower='{lower}' upper='{upper}' effort='{effort}' velocity='20'/></joint>"
        )
    urdf = folder / "leg.urdf"
    urdf.write_text(f"<robot name='leg'>{''.join(text)}</robot>")
    names = [row[0] for row in LEG_JOINTS]
    ankle = names[4:]
    cuts = "".join(
        f"  - cut_joint: {side}_end\n    cut_joint_type: spherical\n"
        f"    predecessor_body: {side}_rod\n    successor_body: foot\n"
        f"    predecessor_placement: {{xyz: [0, 0, {-up}]}}\n"
        f"    successor_placement: {{xyz: [-0.05, {0.035 * sign}, 0]}}\n"
        for side, sign, up in (("left", 1, 0.20), ("right", -1, 0.13))
    )
    (folder / "leg.yml").write_text(
        "submechanisms:\n"
        f"- name: leg\n  type: 4R\n  jointnames: {names[:4]}\n  jointnames_active: {names[:4]}\n"
        f"  jointnames_independent: {names[:4]}\n  jointnames_spanningtree: {names[:4]}\n"
        f"- name: ankle\n  type: NUMERICAL\n  jointnames: {ankle}\n"
        f"  jointnames_active: [left_motor, right_motor]\n"
        f"  jointnames_independent: [ankle_pitch, ankle_roll]\n"
        f"  jointnames_spanningtree: {ankle}\n  loop_constraints:\n{cuts}".replace("'", "")
    )
    return urdf


# the bundled robot, its hands, and y at the start [rad, m], off the poses with straight limbs
ROBOTS = {
    "upper body": ("rh5v2_upper_body", ["ALWristRoll_Link"], 0.1),
    "full robot": ("rh5v2_full", ["ALHandRoll_Link", "ARHandRoll_Link"], 0.1),
    "Stewart": ("stewart", ["HipRotZ_Link"], 0.0),
    "leg": (None, ["foot"], 0.1),
}


def with_ends(files):
    """A URDF that has links at both ends of each loop, and their names."""
    script = next(files.glob("*.py"))
    text, pairs = [], []
    for name, _, *cut in runpy.run_path(str(script))["CUTS"]:
        pair = [f"{name}/predecessor", f"{name}/successor"]
        for end, link, pose in zip(pair, cut[::2], cut[1::2]):
            place = " ".join(map(str, pose[:3]))
            text.append(
                f'<link name="{end}"/><joint name="{end}/fixed" type="fixed">'
                f'<parent link="{link}"/><child link="{end}"/><origin xyz="{place}"/></joint>'
            )
        pairs.append(pair)
    plain = script.with_suffix(".urdf").read_text()
    ends = files / "ends.urdf"
    ends.write_text(plain.replace("</robot>", "".join(text) + "</robot>"))
    return str(ends), pairs


class Given:
    """A robot as the standard input of `--rows` has it."""

    def __init__(self, given, folder):
        for name, text in given["files"].items():
            (folder / name).write_text(text)
        self.urdf, self.loops = with_ends(folder)
        self.mjcf = next(folder.glob("*.xml"))
        self.hands, self.q = given["hands"], given["start"]
        self.poses = np.array(given["targets"])


class Case:
    """A robot of the table, its files for the peers, and targets that it reaches."""

    def __init__(self, name, program, folder, count):
        import sarrus

        self.sarrus = sarrus
        self.name = name
        bundled, self.hands, start = ROBOTS[name]
        if bundled:
            flags = ["--robot", bundled]
            self.robot = sarrus.Robot.bundled(bundled)
        else:
            urdf = leg(folder)
            flags = ["--urdf", str(urdf), "--submechanisms", str(urdf.with_suffix(".yml"))]
            self.robot = sarrus.Robot.load(str(urdf), str(urdf.with_suffix(".yml")))
        files = folder / "files"
        for to in ("pinocchio", "mjcf"):
            command = [program, "export", *flags, "--to", to, "--out", str(files)]
            subprocess.run(command, check=False, capture_output=True)
        self.mjcf = next(files.glob("*.xml"))
        self.urdf, self.loops = with_ends(files)
        self.targets(count, start)

    def targets(self, count, start):
        """Draw states within all limits, and the poses of the hands there."""
        robot, random = self.robot, np.random.default_rng(36)
        rows = [list(robot.joints).index(name) for name in robot.independents]
        low, high = robot.limits["lower"][rows], robot.limits["upper"][rows]
        low = np.where(np.isfinite(low), np.maximum(low, -3.0), -0.6)
        high = np.where(np.isfinite(high), np.minimum(high, 3.0), 0.6)
        look = robot.query("kinematics", ["y"], ["q", "u", "frame_pose"], frames=self.hands)
        poses = np.zeros((0, len(self.hands), 7))
        self.drawn = 0
        while len(poses) < count:
            y = random.uniform(low, high, (max(count, 1000), len(low)))
            answer = look(y=y)
            kept = (answer.status == self.sarrus.Status.ok) & (answer.warnings == 0)
            self.drawn += len(y)
            poses = np.concatenate((poses, answer.frame_pose[kept]))
        self.poses = poses[:count]
        self.start = np.clip(np.full(len(low), start), low, high)
        state = look(y=self.start)
        assert state.warnings == 0, "the start exceeds a limit"
        self.q = dict(zip(robot.coordinates, state.q))


class Ours:
    """The search of this project."""

    name = "sarrus"

    def __init__(self, case):
        self.case = case
        self.tree = list(case.robot.coordinates)
        self.exact = 0
        # both parts of each frame: its place (1) and its axes (2)
        want = ["q", "task_residual"]
        parts = [1 + 2] * len(case.hands)
        self.query = case.robot.query(
            "ik", ["task_target", "y_guess"], want, frames=case.hands, tasks=parts
        )
        # the numbers of each target: a pose, an axis, a weight
        self.rows = np.zeros((len(case.hands), 11))
        self.rows[:, 9:] = 1.0

    def search(self, poses, _=STOP):
        begin = time.perf_counter()
        self.rows[:, :7] = poses
        answer = self.query(task_target=self.rows, y_guess=self.case.start, return_status=True)
        spent = time.perf_counter() - begin
        self.exact += answer.status == self.case.sarrus.Status.ok
        return dict(zip(self.tree, answer.q)), spent


def descend(peer, at, solve, failed, stop):
    """Steps of pink or mink, whose interfaces agree, from `at` to the targets of the hands."""
    for _ in range(STEPS):
        off = [task.compute_error(at) for task in [*peer.hands, *peer.loops]]
        if max(np.abs(error).max() for error in off) < stop:
            return
        try:
            v = solve(
                at,
                peer.hands,
                1.0,
                solver="daqp",
                limits=peer.limits,
                constraints=peer.loops,
                safety_break=False,
            )
        except failed:
            return
        at.integrate_inplace(v, 1.0)


class Pink:
    """Pink: frame tasks, the loops as equality constraints."""

    def __init__(self, case):
        import pink
        import pinocchio as pin

        self.name = f"pink {pink.__version__}"
        self.pink, self.pin = pink, pin
        self.model = pin.buildModelFromUrdf(case.urdf)
        self.data = self.model.createData()
        self.q = np.zeros(self.model.nq)
        put(self.model, case.q, self.q)
        self.hands = [pink.tasks.FrameTask(hand, 1.0, 1.0, lm_damping=1e-3) for hand in case.hands]
        self.loops = []
        for first, second in case.loops:
            loop = pink.tasks.RelativeFrameTask(second, first, 1.0, 0.0)
            loop.set_target(pin.SE3.Identity())
            self.loops.append(Point(loop))
        self.limits = [pink.limits.ConfigurationLimit(self.model, config_limit_gain=1.0)]

    def search(self, poses, stop=STOP):
        pink = self.pink
        for hand, pose in zip(self.hands, poses):
            hand.set_target(self.pin.XYZQUATToSE3(pose))
        begin = time.perf_counter()
        at = pink.Configuration(self.model, self.data, self.q)
        descend(self, at, pink.solve_ik, pink.exceptions.PinkError, stop)
        return got(self.model, at.q), time.perf_counter() - begin


class Point:
    """The three rows of a task of two frames that are about their places."""

    def __init__(self, task):
        self.task = task
        self.gain = 1.0

    def compute_error(self, at):
        return self.task.compute_error(at)[:3]

    def compute_jacobian(self, at):
        return self.task.compute_jacobian(at)[:3]


class Mink:
    """Mink: frame tasks, the equalities of the MJCF as constraints."""

    def __init__(self, case):
        import mink
        import mujoco

        self.name = f"mink {importlib.metadata.version('mink')}"
        self.mink, self.mujoco = mink, mujoco
        self.model = mujoco.MjModel.from_xml_path(str(case.mjcf))
        self.q = self.model.qpos0.copy()
        names = [mujoco.mj_id2name(self.model, 3, j) for j in range(self.model.njnt)]
        self.places = {name: self.model.jnt_qposadr[j] for j, name in enumerate(names)}
        for name, x in case.q.items():
            self.q[self.places[name]] = x
        self.hands = [
            mink.FrameTask(hand, "body", 1.0, 1.0, lm_damping=1e-3) for hand in case.hands
        ]
        self.loops = [mink.EqualityConstraintTask(self.model, 1.0, gain=1.0)]
        self.limits = [mink.ConfigurationLimit(self.model, gain=1.0)]

    def search(self, poses, stop=STOP):
        mink = self.mink
        for hand, pose in zip(self.hands, poses):
            quat = mink.SO3(np.array(pose[[6, 3, 4, 5]]))
            hand.set_target(mink.SE3.from_rotation_and_translation(quat, pose[:3]))
        begin = time.perf_counter()
        at = mink.Configuration(self.model, self.q)
        descend(self, at, mink.solve_ik, mink.MinkError, stop)
        spent = time.perf_counter() - begin
        return {name: at.q[place] for name, place in self.places.items()}, spent


class Placo:
    """PlaCo: frame tasks, the loops as hard tasks of relative places."""

    def __init__(self, case):
        import placo

        self.name = f"placo {importlib.metadata.version('placo')}"
        flags = placo.Flags.ignore_collisions
        self.robot = placo.RobotWrapper(case.urdf, flags)
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.solver.enable_joint_limits(True)
        self.names = list(self.robot.joint_names())
        self.case = case
        self.hands = []
        for hand in case.hands:
            task = self.solver.add_frame_task(hand, np.eye(4))
            task.configure(hand, "soft", 1.0, 1.0)
            self.hands.append(task)
        self.loops = []
        for k, pair in enumerate(case.loops):
            task = self.solver.add_relative_position_task(*pair, np.zeros(3))
            task.configure(f"loop{k}", "hard", 1.0)
            self.loops.append(task)
        self.solver.add_regularization_task(1e-6)
        # a loop in a plane has no row across it
        self.start()
        for task in self.loops:
            task.update()
            task.mask.set_axises(
                "".join(axis for axis, row in zip("xyz", task.A) if np.abs(row).max() > 1e-9)
            )

    def start(self):
        for name in self.names:
            self.robot.set_joint(name, self.case.q[name])
        self.robot.update_kinematics()

    def search(self, poses, stop=STOP):
        self.start()
        for task, pose in zip(self.hands, poses):
            task.T_world_frame = matrix(pose)
        begin = time.perf_counter()
        self.robot.update_kinematics()
        for _ in range(STEPS):
            try:
                self.solver.solve(True)
            except RuntimeError:
                break
            self.robot.update_kinematics()
            off = [task.position().error_norm() for task in self.hands]
            off += [task.orientation().error_norm() for task in self.hands]
            off += [task.error_norm() for task in self.loops]
            if max(off) < stop:
                break
        spent = time.perf_counter() - begin
        return {name: self.robot.get_joint(name) for name in self.names}, spent


def matrix(pose):
    x, y, z, w = pose[3:]
    T = np.eye(4)
    T[:3, 3] = pose[:3]
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return T


def put(model, named, q):
    """Write joints by name; one that turns without limits has its cosine and sine."""
    for name, x in named.items():
        joint = model.joints[model.getJointId(name)]
        at = joint.idx_q
        q[at : at + joint.nq] = [x] if joint.nq == 1 else [np.cos(x), np.sin(x)]


def got(model, q):
    """Read joints by name."""
    named = {}
    for name in list(model.names)[1:]:
        joint = model.joints[model.getJointId(name)]
        x = q[joint.idx_q : joint.idx_q + joint.nq]
        named[name] = float(x[0] if joint.nq == 1 else np.arctan2(x[1], x[0]))
    return named


class Judge:
    """The same look at the last state of every search."""

    def __init__(self, case):
        import pinocchio as pin

        self.pin, self.case = pin, case
        self.model = pin.buildModelFromUrdf(case.urdf)
        self.data = self.model.createData()
        self.q = pin.neutral(self.model)
        frame = self.model.getFrameId
        self.hands = [frame(hand) for hand in case.hands]
        self.loops = [[frame(end) for end in pair] for pair in case.loops]

    def away(self, named, poses):
        """The largest distance of a hand from its target [m or rad]."""
        pin = self.pin
        put(self.model, named, self.q)
        pin.framesForwardKinematics(self.model, self.data, self.q)
        of = self.data.oMf
        away = 0.0
        for frame, pose in zip(self.hands, poses):
            error = pin.log6(of[frame].actInv(pin.XYZQUATToSE3(pose))).vector
            away = max(away, np.linalg.norm(error[:3]), np.linalg.norm(error[3:]))
        return away

    def gap(self):
        """The widest gap of a loop where `away` has looked [m]."""
        of = self.data.oMf
        gaps = [np.linalg.norm(of[a].translation - of[b].translation) for a, b in self.loops]
        return max(gaps, default=0.0)

    def faults(self, named, poses):
        """Whether hands are away, loops open, limits exceeded."""
        away, gap = self.away(named, poses), self.gap()
        limits = self.case.robot.limits
        limits = dict(zip(self.case.robot.joints, zip(limits["lower"], limits["upper"])))
        over = 0.0
        for name, x in named.items():
            lower, upper = limits[name]
            over = max(over, lower - x, x - upper)
        return not away <= GOOD, not gap <= GOOD, not over <= GOOD


def rows(case, stops):
    """Print the runs of all peers, in the form that `sarrus report` reads."""
    judge = Judge(case)
    print("engine inverse kinematics")
    for kind in (Pink, Mink, Placo):
        solver = kind(case)
        for stop in stops:
            searches = [solver.search(poses, stop) for poses in case.poses]
            nanoseconds = 1e9 * np.median([found[1] for found in searches])
            print(f"run IK {solver.name}; stops at {stop:.0e}; {nanoseconds:.0f}")
            for poses, found in zip(case.poses, searches):
                print(max(judge.away(found[0], poses), judge.gap()))


def draw(case, path):
    """The picture: error over time for each solver, and its numbers as a table."""
    import matplotlib.pyplot as plt

    plt.rcParams |= {"svg.fonttype": "none", "svg.hashsalt": "ik"}
    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    judge = Judge(case)
    print("| solver | stops at | median time | median error | share below 1e-6 |")
    print("|---|--:|--:|--:|--:|")
    for kind, mark in ((Ours, "o"), (Pink, "s--"), (Mink, "^--"), (Placo, "v--")):
        try:
            solver = kind(case)
        except ImportError as error:
            print(f"{kind.__name__.lower()}: not run, {error}")
            continue
        points = []
        for stop in STOPS[-1:] if kind is Ours else STOPS:
            searches = [solver.search(poses, stop) for poses in case.poses]
            away = [judge.away(found[0], poses) for found, poses in zip(searches, case.poses)]
            seconds = np.median([found[1] for found in searches])
            points.append((1e6 * seconds, max(np.median(away), 1e-16)))
            share = np.mean(np.array(away) < GOOD)
            row = f"{points[-1][0]:.0f} us | {points[-1][1]:.1e} | {share:.2f}"
            print(f"| {solver.name} | {stop:.0e} | {row} |", flush=True)
        name = f"{solver.name}, {100 * share:.0f} % found"
        axes.loglog(*zip(*points, strict=True), mark, label=name, ms=5)
    axes.set_xlabel("median time of a search, called from Python [us]")
    axes.set_ylabel("median error of the hands [m, rad]")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", fontsize=8, ncols=5)
    figure.savefig(path)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--sarrus", default="target/release/sarrus")
    parser.add_argument("--targets", type=int, default=10_000)
    parser.add_argument("--peers", type=int, help="targets of the peers, the first ones")
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--picture", help="draws error over time for one robot instead")
    parser.add_argument("--rows", action="store_true", help="serves `sarrus report`")
    arguments = parser.parse_args()
    if arguments.rows:
        with tempfile.TemporaryDirectory() as folder:
            given = json.load(sys.stdin)
            rows(Given(given, pathlib.Path(folder)), given["stops"])
        return
    for package in ("pin-pink", "pin", "mink", "mujoco", "placo", "daqp", "numpy"):
        try:
            print(f"{package} {importlib.metadata.version(package)}", end="  ")
        except importlib.metadata.PackageNotFoundError:
            print(f"{package} not installed", end="  ")
    print()
    if arguments.picture:
        with tempfile.TemporaryDirectory() as folder:
            name = arguments.robots.split(",")[0]
            case = Case(name, arguments.sarrus, pathlib.Path(folder), arguments.targets)
            draw(case, arguments.picture)
            print(f"load at the end {os.getloadavg()[0]:.1f}")
        return
    head = f"{'robot':12} {'solver':15} {'targets':>7} {'found':>6} {'away':>5} {'open':>5}"
    head += f" {'limits':>7} {'median us':>10} {'mean us':>8} {'ratio':>7}"
    for name in arguments.robots.split(","):
        with tempfile.TemporaryDirectory() as folder:
            case = Case(name, arguments.sarrus, pathlib.Path(folder), arguments.targets)
            print(f"\nload {os.getloadavg()[0]:.1f}; {case.drawn} states drawn\n{head}")
            judge, ours = Judge(case), None
            for kind in (Ours, Pink, Mink, Placo):
                try:
                    solver = kind(case)
                except ImportError as error:
                    print(f"{name:12} {kind.__name__.lower()}: not run: {error}")
                    continue
                count = len(case.poses) if kind is Ours else arguments.peers or len(case.poses)
                faults, times = [], []
                for poses in case.poses[:count]:
                    named, spent = solver.search(poses)
                    faults.append(judge.faults(named, poses))
                    times.append(spent)
                faults = np.array(faults)
                found = count - np.count_nonzero(faults.any(axis=1))
                away, opened, over = faults.sum(axis=0)
                times = 1e6 * np.array(times)
                ours = ours or np.median(times)
                print(
                    f"{name:12} {solver.name:15} {count:7} {found:6} {away:5} {opened:5} {over:7}"
                    f" {np.median(times):10.0f} {times.mean():8.0f} {np.median(times) / ours:7.1f}",
                    flush=True,
                )
                if kind is Ours:
                    print(f"{name:12} of these within 1e-9, status ok: {solver.exact}")


if __name__ == "__main__":
    main()
