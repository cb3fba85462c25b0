"""Names, orders, limits and closures of a robot."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np

from sarrus import _native
from sarrus.names import Names
from sarrus.query import Array


class DescribedRobot(_native.Robot):
    """A robot with its names."""

    @cached_property
    def information(self) -> dict[str, Any]:
        """Names, orders, sizes, limits and closures, as a server sends them."""
        information: dict[str, Any] = json.loads(super()._information_json())
        return information

    @property
    def name(self) -> str:
        """Name of the robot."""
        return str(self.information["robot"])

    @cached_property
    def joints(self) -> Names:
        """Joints of the tree, in the order of q̇ (n_v)."""
        return Names(self.information["tree"])

    @cached_property
    def coordinates(self) -> Names:
        """Coordinates of the tree, in the order of q (n_q)."""
        return Names(self.information["tree_q"])

    @cached_property
    def independents(self) -> Names:
        """Independent joints, in the order of ẏ (n_vy)."""
        return Names(self.information["independent"])

    @cached_property
    def independent_coordinates(self) -> Names:
        """Independent coordinates, in the order of y (n_qy)."""
        return Names(self.information["independent_q"])

    @cached_property
    def actuators(self) -> Names:
        """Actuators, in the order of u (n_u)."""
        return Names(self.information["active"])

    @cached_property
    def loops(self) -> Names:
        """Rows of K, in their order (n_c)."""
        return Names(self.information["loops"])

    @cached_property
    def geometry(self) -> Names:
        """Places of joints and cuts, in the order of the columns of `dgamma_dtheta`.

        JOINT/rx, ry, rz, x, y, z: turn and slide of the origin of each joint of the tree, on the
        axes of its frame; then of each cut CUT/predecessor/rx … CUT/successor/z.
        """
        single = set(self.coordinates)
        parts = [name if name in single else name.rsplit("/", 1)[0] for name in self.joints]
        rows = [row.rsplit("/", 1) for row in self.loops]
        cuts = [cut for cut, _ in groupby(cut for cut, row in rows if row != "coupling")]
        ends = [f"{cut}/{end}" for cut in cuts for end in ("predecessor", "successor")]
        places = [*dict.fromkeys(parts), *ends]
        return Names(f"{at}/{k}" for at in places for k in ("rx", "ry", "rz", "x", "y", "z"))

    @cached_property
    def links(self) -> Names:
        """Links."""
        return Names(self.information["links"])

    @property
    def closures(self) -> list[dict[str, Any]]:
        """The closure of each submechanism: `name`, `type`, `kind`, `rows`, `rank`, `misfit`, …."""
        return list(self.information["closures"])

    @property
    def warnings(self) -> list[str]:
        """Warnings about the files, one line each."""
        return list(self.information["warnings"])

    @cached_property
    def limits(self) -> dict[str, Array]:
        """`lower`, `upper`, `velocity` and `effort` of the joints (n_v), infinite if unlimited."""
        limits = [limit or {} for limit in self.information["limits"]]

        def column(key: str, absent: float) -> Array:
            values = [limit.get(key) for limit in limits]
            return np.array([absent if value is None else value for value in values], float)

        return {
            "lower": column("lower", -np.inf),
            "upper": column("upper", np.inf),
            "velocity": column("velocity", np.inf),
            "effort": column("effort", np.inf),
        }

    @property
    def is_connected(self) -> bool:
        """True for the robot of a server."""
        return self.origin.is_served

    def __repr__(self) -> str:
        where = f", connected to {self.origin.name}" if self.is_connected else ""
        return (
            f"<sarrus.Robot {self.name}: {len(self.joints)} joints, "
            f"{len(self.independents)} independents, {len(self.actuators)} actuators, "
            f"{len(self.closures)} closures{where}>"
        )

    def _repr_html_(self) -> str:
        """The closures, as a table for notebooks."""
        keys = ("name", "type", "kind", "rows", "rank", "misfit")

        def row(tag: str, cells: Sequence[object]) -> str:
            inside = "".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in cells)
            return f"<tr>{inside}</tr>"

        def cells(closure: dict[str, Any]) -> list[object]:
            return [*(closure[key] for key in keys[:-1]), f"{closure['misfit']:.1e}"]

        rows = "".join(row("td", cells(closure)) for closure in self.closures)
        return (
            f"<p>{html.escape(repr(self)[1:-1])}</p>"
            f"<table><thead>{row('th', keys)}</thead><tbody>{rows}</tbody></table>"
        )
