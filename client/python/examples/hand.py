"""Move a hand up and down 1000 times a second: hand.py [NAME [FRAME [SECONDS]]].

Each millisecond the server computes the pose and the twist of a frame, and then the step of a
motion: the accelerations that move the hand to its target, and the forces of the motors for them,
within all limits. Here are no motors; the robot does as the step says. Start `sarrus serve` with a
robot of a fixed base first; without NAME the upper body runs in this process.
"""

import sys
import time

import numpy as np
import sarrus

DT = 1e-3
SWING, PERIOD = 0.1, 2.0  # how far the hand goes up [m], and its time [s]
STIFFNESS, DAMPING = 400.0, 40.0  # v̇ = v̇* + K (p* − p) + D (v* − v) [1/s², 1/s]
JOINT_DAMPING = 4.0  # of all joints in the room that the hand leaves [1/s]
START = 0.2  # where each joint begins [rad, m]


def turn(a, b):
    """2 times the vector of b a⁻¹, of quaternions: the small rotation from a to b."""
    part = b[:3] * a[3] - b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.copysign(2.0, a @ b) * part


def main():
    name, hand, seconds = [*sys.argv[1:], *[None] * 3][:3]
    robot = sarrus.Robot.connect(name) if name else sarrus.Robot.bundled("rh5v2_upper_body")
    hand = hand or robot.links[-1]
    look = robot.query("kinematics", ["y", "yd"], ["frame_pose", "frame_twist"], frames=[hand])
    # the task is about the place (1) and the axes (2) of the frame
    given = ["y", "yd", "ydd", "dt"]
    step = robot.query("step", given, ["ydd", "tau_u"], frames=[hand], tasks=[1 + 2])

    y = np.full(len(robot.independents), START)
    yd = np.zeros_like(y)
    first = look(y=y, yd=yd).frame_pose[0]
    dt = np.array([DT])
    task = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    w = 2 * np.pi / PERIOD
    up = np.array([0.0, 0.0, 0.5 * SWING])
    cycles = int(float(seconds or 1.0) / DT)
    late, farthest = 0, 0.0
    begin = time.perf_counter()
    for cycle in range(cycles):
        due = begin + cycle * DT
        time.sleep(max(0.0, due - time.perf_counter()))
        seen = look(y=y, yd=yd)
        pose, twist = seen.frame_pose[0], seen.frame_twist[0]

        # the wanted acceleration of the hand: of its rotation, then of its origin
        t = cycle * DT
        off = first[:3] + up * (1 - np.cos(w * t)) - pose[:3]
        rate = up * w * np.sin(w * t) - twist[3:]
        task[0, :3] = STIFFNESS * turn(pose[3:], first[3:]) - DAMPING * twist[:3]
        task[0, 3:6] = up * w * w * np.cos(w * t) + STIFFNESS * off + DAMPING * rate
        farthest = max(farthest, np.linalg.norm(off))

        # the motors would get moved.tau_u
        moved = step(y=y, yd=yd, ydd=-JOINT_DAMPING * yd, dt=dt, task_motion=task)
        y += DT * (yd + 0.5 * DT * moved.ydd)
        yd += DT * moved.ydd
        late += time.perf_counter() > due + DT
    print(f"{cycles} cycles, {late} late")
    print(f"farthest from its target: {farthest}")
    print(f"tau_u: {moved.tau_u.tolist()}")


if __name__ == "__main__":
    main()
