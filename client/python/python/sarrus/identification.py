"""Masses, inertias and friction from a motion."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from sarrus.excitation import Limits, Search
from sarrus.logs import table

if TYPE_CHECKING:
    import os

    from sarrus.query import Progress
    from sarrus.robot import Robot

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Identification:
    """Estimates of a robot's parameters.

    Base parameters are the combinations that some motion can tell. The nearest links of positive
    density that explain them are those of `parameters` and `urdf`.
    """

    base: list[dict[str, float]]
    """Parameters in each base parameter with their factors, its own first (n_base)."""
    values: Array
    """Estimates; the model's value where the motion does not excite it (n_base)."""
    standard_errors: Array
    """Standard errors, NaN where the motion does not excite it (n_base)."""
    model: Array
    """Values of the model (n_base)."""
    condition: float
    """Condition number of the excited columns, scaled to length one."""
    noise: Array
    """Standard deviation of each force (n_u, or n_vy of robots with another number of motors)."""
    prediction: dict[str, float]
    """Forces left over in units of their noise: `model`, `fitted`, `held_out`, `physical`."""
    parameters: dict[str, float]
    """All parameters by name: JOINT/m, JOINT/mx, …, JOINT/rotor, JOINT/coulomb, JOINT/viscous."""
    urdf: str
    """The URDF with the new masses and inertias; all other bytes are the robot's."""


def identify(
    robot: Robot,
    log: str | os.PathLike[str] | Mapping[str, npt.ArrayLike],
    *,
    config: str | os.PathLike[str] | None = None,
) -> Identification:
    """Estimate masses, inertias and friction of a robot from a motion.

    `log` is a table with the columns `t`, each independent joint by its name, its velocity as
    NAME/yd, its acceleration as NAME/ydd, and the force of each motor as NAME/tau_u: a file of
    CSV, one of Parquet (`.parquet`, read by pyarrow), or arrays by these names. Without
    accelerations rates come from cubics through fifteen rows each.

    A log of the CAN bridge does as well: the table of `sarrus-can log CONFIG FILE --csv`, or FILE
    itself with the bridge's configuration as `config`. Its columns `time`, ACTUATOR/position,
    ACTUATOR/effort and ACTUATOR/state are read: the longest stretch in which all actuators of the
    robot are `enabled` and measure, as means over 10 ms. Poses are followed from one to the next.

    `ValueError`: a column or number is missing, a state has no answer, or the motion is too short.

    >>> import numpy as np, sarrus
    >>> robot = sarrus.Robot.bundled("lambda")
    >>> t = np.linspace(0, 10, 200)
    >>> y, yd, ydd = 0.4 + 0.3 * np.sin(t), 0.3 * np.cos(t), -0.3 * np.sin(t)
    >>> tau_u = robot.inverse_dynamics(*(x[:, None] for x in (y, yd, ydd)))
    >>> name = robot.independents[0]
    >>> log = {"t": t, name: y, f"{name}/yd": yd, f"{name}/ydd": ydd}
    >>> found = sarrus.identify(robot, log | {f"{robot.actuators[0]}/tau_u": tau_u[:, 0]})
    >>> bool(np.nanmax(abs(found.values - found.model)) < 1e-6)
    True
    """
    columns = table(robot, log, config)
    rows: list[list[float]] = np.column_stack(list(columns.values())).tolist()
    text, urdf = robot._identify(list(columns), rows)
    found: dict[str, Any] = json.loads(text)
    base = found["base"]

    def column(key: str) -> Array:
        return np.array([np.nan if of[key] is None else of[key] for of in base], float)

    return Identification(
        base=[of["combination"] for of in base],
        values=column("value"),
        standard_errors=column("standard_error"),
        model=column("model"),
        condition=found["condition"],
        noise=np.array(found["noise"], float),
        prediction=found["prediction"],
        parameters=found["parameters"],
        urdf=urdf,
    )


def excite(
    robot: Robot,
    *,
    seconds: float = 10.0,
    rows: int = 1000,
    seed: int = 0,
    harmonics: int = 5,
    tries: int = 100,
    share: float = 0.95,
    reach: Mapping[str, tuple[float, float]] | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> dict[str, Array]:
    """Design a motion that tells the base parameters apart, for `identify`.

    Each independent joint moves by a finite Fourier series about a pose (J. Swevers, C. Ganseman,
    D. B. Tükel, J. De Schutter, H. Van Brussel: *Optimal robot excitation and identification*, IEEE
    Transactions on Robotics and Automation 13, 1997),

        y(t) = y_0 + Σ_l a_l sin(l ω t) / (l ω) − b_l cos(l ω t) / (l ω),   ω = 2π / seconds,

    with Σ a_l = 0 and Σ l b_l = 0, so that it begins and ends at rest without acceleration. Drive
    to its first row before; its last row is its first one, so it may be repeated.

    Of `tries` motions, drawn from `seed`, the first quarter are new, the others vary the best one.
    The amplitudes of each shrink until all loops close, with positions and velocities of all joints
    and forces of all actuators within the middle `share` of their limits. The one that leaves the
    fewest base parameters without excitation is kept, of equal ones the one with the least
    condition number, as `identify` has it for forces with noise of one size.

    `seconds` is the period, `rows` the number of rows from 0 to `seconds`, `harmonics` the number
    of l, two or more. `reach` are lowest and highest positions [rad, m] of joints by name, within
    their limits: of independent joints without limits, and of any that should stay away from
    something, as collisions are not seen. `progress` gets how many motions are done, and `tries`:
    two joints take seconds, a humanoid minutes.

    Gives columns of length `rows`: `t` [s], each independent joint by its name [rad, m], NAME/yd
    and NAME/ydd. `ValueError`: an independent joint is a ball or floating, or has neither limits
    nor `reach`; there are fewer actuators than independent joints; no pose is within the limits.

    >>> import sarrus
    >>> robot = sarrus.Robot.bundled("lambda")
    >>> motion = sarrus.excite(robot, seconds=4.0, rows=400, tries=8)
    >>> sorted(motion)
    ['Elbow', 'Elbow/yd', 'Elbow/ydd', 't']
    """
    if progress is not None and not callable(progress):
        raise TypeError(f"`progress` is {progress!r}, expected a function")
    for name, value, least in (("rows", rows, 2), ("harmonics", harmonics, 2), ("tries", tries, 1)):
        if value < least:
            raise ValueError(f"`{name}` is {value}, expected {least} or more")
    if not 0 < seconds < np.inf:
        raise ValueError(f"`seconds` is {seconds}, expected a positive number")
    if not 0 < share <= 1:
        raise ValueError(f"`share` is {share}, expected a number above 0, at most 1")
    limits = Limits(robot, share, reach or {}, threads)
    search = Search(limits, seconds, harmonics, np.random.default_rng(seed))
    for done in range(tries):
        search.draw(vary=4 * done >= tries)
        if progress is not None:
            progress(done + 1, tries)
    t = np.linspace(0.0, seconds, rows, dtype=np.float64)
    y, yd, ydd = search.best(t)
    motion: dict[str, Array] = {"t": t}
    for k, name in enumerate(robot.independents):
        motion |= {name: y[:, k], f"{name}/yd": yd[:, k], f"{name}/ydd": ydd[:, k]}
    return motion
