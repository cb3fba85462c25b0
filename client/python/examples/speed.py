"""What a call costs beside the same states as rows, where Rust goes from one to the next.

    python speed.py [ROUNDS]

Inverse dynamics: nanoseconds a state, one state a call (with and without `out=`), rows on one
thread and on all. All ways take turns, and of each the fastest of some rounds counts; the overhead
is that of a call over a row on one thread.
"""

import sys
import time

import numpy as np
import sarrus

ROWS = 2000
WAYS = ("call", "out=", "rows", "threads", "overhead")


def measured(robot, rounds):
    """Nanoseconds a state by each way."""
    one = np.full((3, len(robot.independents)), 0.05)
    many = np.repeat(one[:, None, :], ROWS, axis=1)
    more = np.repeat(many, 10, axis=1)
    out = np.empty(len(robot.actuators))
    outs = np.empty((ROWS, len(robot.actuators)))
    mores = np.empty((10 * ROWS, len(robot.actuators)))
    y, yd, ydd = one
    ask = robot.inverse_dynamics
    least = [np.inf] * 4
    for _ in range(rounds):
        times = [time.perf_counter_ns()]
        for _ in range(ROWS):
            ask(y, yd, ydd)
        times.append(time.perf_counter_ns())
        for _ in range(ROWS):
            ask(y, yd, ydd, out=out)
        times.append(time.perf_counter_ns())
        ask(*many, out=outs, threads=1)
        times.append(time.perf_counter_ns())
        ask(*more, out=mores)
        times.append(time.perf_counter_ns())
        found = np.diff(times) / (ROWS, ROWS, ROWS, 10 * ROWS)
        least = np.minimum(least, found)
    return [*least, least[0] - least[2]]


def main():
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    print(f"{'robot':18}", *(f"{way:>9}" for way in WAYS))
    for name in ("lambda", "torso", "stewart", "rh5v2_upper_body", "rh5v2_full"):
        times = measured(sarrus.Robot.bundled(name), rounds)
        print(f"{name:18}", *(f"{time:9.0f}" for time in times))


if __name__ == "__main__":
    main()
