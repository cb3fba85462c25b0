"""Inputs and results of simulations."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Space = Literal["y", "u"]
Method = Literal["euler", "rk4", "dop853", "radau5", "baumgarte", "projection"]


class Constant(NamedTuple):
    """Constant forces on the independents (`y`) or the actuators (`u`) [N, N m]."""

    space: Space
    forces: npt.ArrayLike


class Table(NamedTuple):
    """Forces at increasing times [s], linear between them, constant before and after.

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
    """The results of a simulation, one row for each of n samples.

    `end` is `finished`, or the reason of an earlier end: a status, `step_too_short` or
    `too_many_steps`.
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
    """Potential energy, springs in joints included [J] (n)."""
    work: Array
    """Work of the inputs less losses of dampers since the start [J] (n)."""
    residual: Array
    """Largest scaled residual of the loops (n)."""
    end: str
    drift: float
    """Largest change of energy less work, relative to the energy exchanged."""
    independents: tuple[str, ...]
    """The independents at the end, which change near singular poses."""
    events: tuple[tuple[float, str], ...]
    """Events: time [s] and name, such as `limits_exceeded: position of Elbow`."""

    def __repr__(self) -> str:
        samples = f"{len(self.time)} samples to {self.time[-1]:g} s"
        events = "".join(f", {name} at {time:g} s" for time, name in self.events)
        return f"<sarrus.Simulation {self.end}, {samples}{events}>"

    @property
    def energy(self) -> Array:
        """Kinetic and potential energy less work [J] (n), constant up to errors."""
        return self.kinetic + self.potential - self.work
