"""A robot in time."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Space = Literal["y", "u"]
Method = Literal["euler", "rk4", "dop853", "radau5", "baumgarte", "projection"]


class Constant(NamedTuple):
    """The same forces for ever, on the independents (`y`) or the actuators (`u`) [N, N m]."""

    space: Space
    forces: npt.ArrayLike


class Table(NamedTuple):
    """Forces at increasing times [s], straight lines between them, first and last beyond.

    `forces` has a row for each time [N, N m].
    """

    space: Space
    times: npt.ArrayLike
    forces: npt.ArrayLike


class Gains(NamedTuple):
    """τ = stiffness (target − x) − damping ẋ, x the independents (`y`) or actuators (`u`)."""

    space: Space
    stiffness: npt.ArrayLike
    damping: npt.ArrayLike
    target: npt.ArrayLike


class Simulation(NamedTuple):
    """A simulation that has ended, a row for each of its n samples.

    `end` is `finished`, or why it ended before: a status, `step_too_short`, `too_many_steps`.
    """

    time: Array
    """Time [s] (n)."""
    y: Array
    """Independent coordinates as declared (n, n_qy)."""
    yd: Array
    """Their velocities (n, n_vy)."""
    q: Array
    """Tree coordinates (n, n_q)."""
    qd: Array
    """Their velocities (n, n_v)."""
    kinetic: Array
    """Kinetic energy [J] (n)."""
    potential: Array
    """Potential energy, of springs in joints too [J] (n)."""
    work: Array
    """Work of the inputs less losses of dampers since the start [J] (n)."""
    residual: Array
    """Largest scaled residual of the loops (n)."""
    end: str
    drift: float
    """Largest change of energy less work, as a share of the energy that moved."""
    independents: tuple[str, ...]
    """The independents at the end, which may be others near singular poses."""
    events: tuple[tuple[float, str], ...]
    """What happened on the way: time [s] and a word."""

    @property
    def energy(self) -> Array:
        """Kinetic and potential energy less work [J] (n): constant but for errors."""
        return self.kinetic + self.potential - self.work
