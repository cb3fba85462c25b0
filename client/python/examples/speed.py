"""Compare the cost of inverse dynamics in Python and in Rust, in alternation in one run.

    cargo build --release --workspace --examples
    python speed.py [ROUNDS] [--rust target/release/examples/speed]

Prints nanoseconds per state: for single calls (in Rust, in Python, in Python with `out=`), and for
100,000 states as rows of a batch, on one thread and on all (in Rust by `Robot::batch`, in Python
with `out=`). The variants alternate, and the fastest round of each counts. `over` is the overhead
of Python: for a call without `out=`, between the fastest rounds; for rows on one thread, the median
over all rounds, each of which measures both in succession.
"""

import argparse
import contextlib
import os
import subprocess
import time

import numpy as np
import sarrus

CALLS, ROWS = 2000, 100_000
THREADS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
ROBOTS = ("lambda", "torso", "stewart", "rh5v2_upper_body", "rh5v2_full")
HEAD = f"{'robot':18} {'call: Rust':>11} {'Python':>7} {'out=':>6} {'over':>6}" + (
    f" {'rows: Rust':>12} {'Python':>7} {'over':>7} {f'{THREADS} threads: Rust':>16} {'Python':>7}"
)


@contextlib.contextmanager
def rust(program):
    """Give a function that asks the Rust program for its nanoseconds; NaN without one."""
    if program is None:
        yield lambda *_: np.nan
        return
    with subprocess.Popen(
        [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
    ) as child:

        def ask(name, way, n, *threads):
            child.stdin.write(" ".join(map(str, (name, way, n, *threads))) + "\n")
            return int(child.stdout.readline()) / n

        yield ask
        child.stdin.close()


def timed(n, f):
    """Nanoseconds per state of a call that answers this many."""
    begin = time.perf_counter_ns()
    f()
    return (time.perf_counter_ns() - begin) / n


def measured(name, rounds, in_rust):
    """Least nanoseconds per state of each variant, and the median ratio of Python to Rust."""
    robot = sarrus.Robot.bundled(name)
    one = np.full((3, len(robot.independents)), 0.05)
    many = np.full((3, ROWS, len(robot.independents)), 0.05)
    out = np.empty(len(robot.actuators))
    outs = np.empty((ROWS, len(robot.actuators)))
    y, yd, ydd = one
    ask = robot.inverse_dynamics

    def calls():
        for _ in range(CALLS):
            ask(y, yd, ydd)

    def calls_with_out():
        for _ in range(CALLS):
            ask(y, yd, ydd, out=out)

    found = np.array(
        [
            (
                in_rust(name, "call", CALLS),
                timed(CALLS, calls),
                timed(CALLS, calls_with_out),
                in_rust(name, "rows", ROWS, 1),
                timed(ROWS, lambda: ask(*many, out=outs, threads=1)),
                in_rust(name, "rows", ROWS, THREADS),
                timed(ROWS, lambda: ask(*many, out=outs, threads=THREADS)),
            )
            for _ in range(rounds)
        ]
    )
    return *found.min(axis=0), np.median(found[:, 4] / found[:, 3])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("rounds", nargs="?", type=int, default=5)
    parser.add_argument("--rust")
    arguments = parser.parse_args()
    with rust(arguments.rust) as in_rust:
        print(HEAD)
        for name in ROBOTS:
            call, python, out, row, rows, *many, over = measured(name, arguments.rounds, in_rust)
            print(f"{name:18} {call:11.0f} {python:7.0f} {out:6.0f} {python - call:6.0f}", end="")
            print(f" {row:12.0f} {rows:7.0f} {over - 1:7.1%} {many[0]:16.0f} {many[1]:7.0f}")


if __name__ == "__main__":
    main()
