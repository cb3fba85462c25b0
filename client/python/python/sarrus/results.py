"""Results of the methods of a robot; rows of states add a first axis."""

from __future__ import annotations

from typing import NamedTuple

from sarrus.query import Array


class State(NamedTuple):
    """The whole tree's motion with all loops closed."""

    q: Array
    """Tree coordinates [m, rad] (n_q)."""
    qd: Array
    """Tree velocities (n_v)."""
    qdd: Array
    """Tree accelerations (n_v)."""


class Frames(NamedTuple):
    """Frames of links; for one link by its name, the axis of links is absent."""

    pose: Array
    """Position and quaternion x, y, z, w in the root frame [m] (n, 7)."""
    twist: Array
    """ω and v in world axes at the frame's origin [rad/s, m/s] (n, 6)."""
    acceleration: Array
    """Classical acceleration, gravity not included (n, 6)."""


class Actuators(NamedTuple):
    """Given quantities of the independents, at the actuators; others are `None`."""

    u: Array
    """Coordinates [m, rad] (n_u)."""
    ud: Array | None
    """Velocities (n_u)."""
    udd: Array | None
    """Accelerations (n_u)."""
    tau_u: Array | None
    """Forces [N, N m] (n_u)."""
    stiffness: Array | None
    """Gains of positions (n_u, n_u)."""
    damping: Array | None
    """Gains of velocities (n_u, n_u)."""


class Independents(NamedTuple):
    """Given quantities of the actuators, at the independents; others are `None`."""

    y: Array
    """Coordinates [m, rad] (n_qy)."""
    yd: Array | None
    """Velocities (n_vy)."""
    ydd: Array | None
    """Accelerations (n_vy)."""
    tau_y: Array | None
    """Generalised forces [N, N m] (n_vy)."""
    stiffness: Array | None
    """Gains of positions (n_vy, n_vy)."""
    damping: Array | None
    """Gains of velocities (n_vy, n_vy)."""
