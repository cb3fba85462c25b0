"""What a call costs beside the same call in a batch, where Rust does the rest.

    python speed.py

One state at a time, rows on one thread and on all: nanoseconds a state, the least of some runs.
"""

import timeit

import numpy as np
import sarrus


def least(work, number, states):
    """The least time of a state [ns]."""
    return min(timeit.repeat(work, number=number, repeat=7)) / (number * states) * 1e9


def main():
    print(f"{'robot':18} {'single':>8} {'out=':>8} {'rows':>8} {'threads':>8} {'overhead':>9}")
    for name in ("lambda", "torso", "rh5v2_upper_body", "rh5v2_full"):
        robot = sarrus.Robot.bundled(name)
        rows = 20_000
        one = np.full((3, len(robot.independents)), 0.05)
        many = np.repeat(one[:, None, :], rows, axis=1)
        out, outs = np.empty(len(robot.actuators)), np.empty((rows, len(robot.actuators)))
        ask = robot.inverse_dynamics
        y, yd, ydd = one
        times = [
            least(lambda: ask(y, yd, ydd), 5000, 1),
            least(lambda: ask(y, yd, ydd, out=out), 5000, 1),
            least(lambda: ask(*many, out=outs, threads=1), 1, rows),
            least(lambda: ask(*many, out=outs), 1, rows),
        ]
        words = " ".join(f"{time:8.0f}" for time in times)
        print(f"{name:18} {words} {times[0] - times[2]:9.0f}")


if __name__ == "__main__":
    main()
