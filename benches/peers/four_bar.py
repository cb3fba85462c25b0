"""The four-bar of `motion.py`: one freedom in closed form.

Crank 0.4 m, coupler 1 m, rocker 0.8 m, ground 1.1 m, uniform rods of 2 kg/m in a vertical plane.
The tree is crank, coupler on the crank, rocker on the ground; the coupler lies above the line from
the crank's end to the rocker's pivot.
"""

import functools

import numpy as np
from scipy.integrate import solve_ivp

A, B, C, D = 0.4, 1.0, 0.8, 1.1
DENSITY, THIN, GRAVITY = 2.0, 1e-4, 9.81
START, END, EVERY = 1.0, 5.0, 0.01
# angle and speed of the crank at the end by another program, from longer steps
KNOWN = (0.530574186158647, -5.07993968646649)
ROWS = EVERY * np.arange(round(END / EVERY) + 1)


def closed(crank):
    """Angles of coupler and rocker, and how they turn with the crank: first and second order."""
    x, y = D - A * np.cos(crank), -A * np.sin(crank)
    reach = np.hypot(x, y)
    coupler = np.arctan2(y, x) + np.arccos((B * B + reach**2 - C * C) / (2 * B * reach))
    rocker = np.arctan2(B * np.sin(coupler) - y, B * np.cos(coupler) - x)
    of_coupler = A * np.sin(rocker - crank) / (B * np.sin(coupler - rocker))
    of_rocker = A * np.sin(coupler - crank) / (C * np.sin(coupler - rocker))
    turns = [(A, crank, 1.0), (B, coupler, of_coupler**2), (-C, rocker, of_rocker**2)]
    along = [
        sum(length * turn * np.cos(angle - other) for length, angle, turn in turns)
        for other in (rocker, coupler)
    ]
    d_coupler = -along[0] / (B * np.sin(coupler - rocker))
    d_rocker = -along[1] / (C * np.sin(coupler - rocker))
    return (coupler, rocker), (of_coupler, of_rocker), (d_coupler, d_rocker)


def acceleration(crank, speed):
    """The crank's acceleration without forces, from the kinetic energy of the one freedom."""
    (coupler, rocker), (p, s), (dp, ds) = closed(crank)
    m = [DENSITY * length for length in (A, B, C)]
    # the coupler's centre, its velocity by the crank's and how that changes
    v = 1j * A * np.exp(1j * crank) + 0.5j * B * p * np.exp(1j * coupler)
    dv = -A * np.exp(1j * crank) + 0.5 * B * (1j * dp - p * p) * np.exp(1j * coupler)
    inertia = m[0] * A * A / 3 + m[2] * C * C / 3 * s * s
    inertia += m[1] * (abs(v) ** 2 + B * B / 12 * p * p)
    change = m[1] * ((np.conj(v) * dv).real + B * B / 12 * p * dp) + m[2] * C * C / 3 * s * ds
    weight = m[0] * A / 2 * np.cos(crank) + m[1] * v.imag + m[2] * C / 2 * np.cos(rocker) * s
    return -(change * speed * speed + GRAVITY * weight) / inertia


@functools.cache
def solution():
    """The motion. Steps of 1 ms leave rounding alone, in the dense output too."""
    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13, "max_step": 1e-3}

    def rate(_, x):
        return [x[1], acceleration(*x)]

    found = solve_ivp(rate, (0, END), [START, 0], dense_output=True, **options)
    assert np.abs(found.y[:, -1] - KNOWN).max() < 1e-10, found.y[:, -1]
    return found.sol


def reference(times):
    """The crank's angle at these times, to some 1e-12."""
    return solution()(times)[0]


def gap(q):
    """Distance between the ends of coupler and rocker, from crank, coupler to crank, rocker."""
    crank, coupler, rocker = q[:, 0], q[:, 0] + q[:, 1], q[:, 2]
    return abs(A * np.exp(1j * crank) + B * np.exp(1j * coupler) - D - C * np.exp(1j * rocker))


def energy(q, qd):
    """Kinetic and potential energy of the three rods."""
    angles = [q[:, 0], q[:, 0] + q[:, 1], q[:, 2]]
    speeds = [qd[:, 0], qd[:, 0] + qd[:, 1], qd[:, 2]]
    total = 0.0
    for length, angle, speed, on_crank in zip((A, B, C), angles, speeds, (0, A, 0), strict=True):
        mass = DENSITY * length
        centre = on_crank * np.exp(1j * angles[0]) + length / 2 * np.exp(1j * angle)
        v = 1j * (
            on_crank * speeds[0] * np.exp(1j * angles[0]) + length / 2 * speed * np.exp(1j * angle)
        )
        total = total + mass * (abs(v) ** 2 / 2 + length**2 / 24 * speed**2 + GRAVITY * centre.imag)
    return total


def first():
    """The closed pose at the start."""
    (coupler, rocker), *_ = closed(START)
    return np.array([START, coupler - START, rocker])


def rod(length):
    """Mass, distance of the centre, and moments of inertia about it."""
    mass = DENSITY * length
    return mass, length / 2, (THIN * mass, mass * length**2 / 12, mass * length**2 / 12)
