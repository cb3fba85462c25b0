"""Andrews' squeezer by scipy on the accelerations of sarrus: digits against processor time.

    pip install ./client/python scipy
    python benches/peers/published.py [--repeats 3]

The measure, the tolerances and the published angles are those of `sarrus-benches --published`: the
largest relative error of the seven angles at 0.03 s. The spring is a wrench on K3 at each state, so
a right-hand side asks twice: for the pose and for the acceleration. scipy chooses its first step.
"""

import argparse
import os
import time

import numpy as np
import sarrus
from scipy.integrate import solve_ivp

END, MOMENT, SPRING, REST = 0.03, 0.033, 4530.0, 0.07785
# the pivot of K3, the other end of the spring, and its end on K3
PIVOT, FIXED, HELD = -0.03635 + 0.03273j, 0.014 + 0.072j, 0.02 - 0.018j
START = np.array(
    [
        -0.0617138900142764496,
        0.0,
        0.455279819163070380,
        0.222668390165885885,
        0.487364979543842550,
        -0.222668390165885885,
        1.23054744454982119,
    ]
)
PUBLISHED = np.array(
    [
        15.81077119629904,
        -15.75637105984298,
        0.04082224013073101,
        -0.5347301163226948,
        0.5244099658805304,
        0.5347301163226948,
        1.048080741042263,
    ]
)
TOLERANCES = (3e-5, 1e-5, 3e-6, 3e-7, 1e-7, 1e-8, 1e-9, 1e-10)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="the least processor time of these")
    arguments = parser.parse_args()
    robot = sarrus.Robot.bundled("squeezer")
    pose = robot.query("kinematics", ["y"], ["q"])
    given = ["y", "yd", "tau_u", "wrenches"]
    ask = robot.query("forward-dynamics", given, ["ydd"], wrenches=["K3"])
    gamma = robot.joints.place("gamma")
    force, wrench = np.array([MOMENT]), np.zeros((1, 6))

    def rate(_, x):
        angle = pose(y=x[:1]).q[gamma] + START[2]
        # the wrench is in root axes about the origin of K3, which is its pivot
        arm = HELD * np.exp(1j * angle)
        apart = PIVOT + arm - FIXED
        pull = -SPRING * (1 - REST / abs(apart)) * apart
        wrench[0] = 0, 0, (arm.conjugate() * pull).imag, pull.real, pull.imag, 0
        ydd = ask(y=x[:1], yd=x[1:], tau_u=force, wrenches=wrench).ydd
        return np.concatenate((x[1:], ydd))

    assert abs(rate(0, np.zeros(2))[1] - 14222.4439199541387) < 1e-7
    print("| method | tolerance | error | ms | evaluations |")
    print("|---|--:|--:|--:|--:|")
    for method in ("DOP853", "Radau", "LSODA"):
        for tolerance in TOLERANCES:
            seconds = []
            for _ in range(arguments.repeats):
                start = time.process_time()
                options = {"method": method, "rtol": tolerance, "atol": tolerance}
                found = solve_ivp(rate, (0, END), [0.0, 0.0], **options)
                seconds.append(time.process_time() - start)
            angles = START + pose(y=found.y[:1, -1]).q
            error = np.abs((angles - PUBLISHED) / PUBLISHED).max()
            ms = 1e3 * min(seconds)
            print(f"| {method} | {tolerance:g} | {error:.1e} | {ms:.3g} | {found.nfev} |")
    print(f"load at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
