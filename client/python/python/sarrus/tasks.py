"""Tasks of frames, as arrays for a query."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from sarrus.errors import QueryError
from sarrus.query import Array

# bits of the parts of a task, and the places of its numbers in a row of `task_target`
PARTS = {"p": (1, slice(0, 3)), "quat": (2, slice(3, 7)), "axis": (4, slice(7, 10))}
SECOND = 8
WEIGHT = 10
LARGEST = np.finfo(np.float64).max


def packed(tasks: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[int], Array]:
    """Give the frames, the parts and the targets (…, tasks, 11) of tasks."""
    frames: list[str] = []
    parts: list[int] = []
    rows: list[Array] = []
    for task in tasks:
        if unknown := task.keys() - PARTS.keys() - {"frame", "weight", "priority"}:
            raise QueryError(f"a task has {', '.join(sorted(unknown))}, which means nothing")
        if "frame" not in task:
            raise QueryError("a task names no frame")
        if (priority := task.get("priority", 0)) not in (0, 1):
            raise QueryError(f"a priority is 0 or 1, not {priority}")
        frames.append(task["frame"])
        asked = {name: np.asarray(task[name], np.float64) for name in PARTS if name in task}
        parts.append(sum(PARTS[name][0] for name in asked) + SECOND * priority)
        weight = np.asarray(task.get("weight", 1.0), np.float64)
        lead = np.broadcast_shapes(weight.shape, *(x.shape[:-1] for x in asked.values()))
        row = np.zeros((*lead, WEIGHT + 1))
        row[..., WEIGHT] = weight
        for name, numbers in asked.items():
            row[..., PARTS[name][1]] = numbers
        rows.append(row)
    lead = np.broadcast_shapes(*(row.shape[:-1] for row in rows))
    wide = [np.broadcast_to(row, (*lead, WEIGHT + 1)) for row in rows]
    return frames, parts, np.stack(wide, axis=-2) if rows else np.zeros((0, WEIGHT + 1))


def finite(bounds: npt.ArrayLike) -> Array:
    """Give bounds without infinities, which stand for none."""
    return np.clip(np.asarray(bounds, np.float64), -LARGEST, LARGEST)
