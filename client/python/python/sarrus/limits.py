"""Maps of what the motors allow at the joints."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import os

    from sarrus.robot import Robot

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Capability:
    """The map of one submechanism, or of chosen joints: arrays with a row for each point.

    A point without a pose is not `reachable`, and its numbers are NaN, as are those of motors
    without a limit. Forces [N m, N] and speeds [rad/s, m/s] are those of each joint.
    """

    name: str
    joints: list[str]
    motors: list[str]
    sizes: list[int]
    ranges: list[list[float]]
    no_limit: list[str]
    unreachable_corners: list[list[float]]
    points: Array
    """Positions of the joints, the last one fastest (n, p)."""
    torque_max: Array
    """Largest force with the others free (n, p)."""
    torque_min: Array
    """Least force with the others free (n, p)."""
    torque_alone: Array
    """Largest force of both directions with the others zero (n, p)."""
    speed_max: Array
    """Largest speed with the others at rest (n, p)."""
    speed_free: Array
    """Largest speed with the others free (n, p)."""
    reflected_inertia: Array
    """Inertia of the rotors [kg m², kg] (n, p, p)."""
    sigma_min: Array
    """Distance to singular poses of the loops (n,)."""
    reachable: npt.NDArray[np.bool_]
    """Whether there is a pose (n,)."""
    u: Array
    """Positions of the motors (n, n_motors)."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map to a file: `.npz` for numpy, else `.csv` with a row for each point."""
        arrays: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        if Path(path).suffix == ".npz":
            np.savez_compressed(path, **arrays)
            return
        table = {k: v.reshape(len(v), -1) for k, v in arrays.items() if isinstance(v, np.ndarray)}
        names = [f"{k}/{i}" for k, v in table.items() for i in range(v.shape[1])]
        rows = np.hstack([v.astype(float) for v in table.values()])
        np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=",".join(names), comments="")


def capability(
    robot: Robot,
    joints: Sequence[str] = (),
    *,
    grid: int | None = None,
    at: npt.ArrayLike | None = None,
    page: str | os.PathLike[str] | None = None,
) -> list[Capability]:
    """Map what the motors allow at the joints, over their ranges, on all processors.

    `joints` are names or patterns of independent joints; without them each submechanism has a map
    by itself. `grid` are points along each coordinate, `at` are all independents, for those that
    the map does not move; `page` is a file for the maps as a page that opens offline. `ValueError`:
    a joint is unknown, or there are more than a million points.

    >>> import sarrus
    >>> ankle, = sarrus.capability(sarrus.Robot.bundled("ankle"), grid=3)
    >>> ankle.torque_max.shape
    (9, 2)
    """
    stand = None if at is None else np.asarray(at, float).tolist()
    text, html = robot._capability(list(joints), grid, stand, page is not None)
    if page is not None:
        Path(page).write_text(html, encoding="utf-8")
    return [_read(json.loads(line)) for line in text.splitlines()]


def _read(found: dict[str, Any]) -> Capability:
    found["name"] = found.pop("submechanism")
    found.pop("torque_vertices", None)
    plain = {"name", "joints", "motors", "sizes", "ranges", "no_limit", "unreachable_corners"}
    for key in found.keys() - plain - {"reachable"}:
        found[key] = np.array(found[key], float)
    found["reachable"] = np.array(found["reachable"], bool)
    return Capability(**found)
