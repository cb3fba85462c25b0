"""Tables of a motion for `sarrus.identify`: CSV, Parquet, and logs of the CAN bridge."""

from __future__ import annotations

import csv
import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sarrus import _native
from sarrus.query import Array
from sarrus.status import Status

if TYPE_CHECKING:
    import os

    from sarrus.robot import Robot

# time between two rows that `sarrus.identify` gets of a bridge [s]
EVERY = 0.01


def table(robot: Robot, log: Any, config: str | os.PathLike[str] | None) -> dict[str, Array]:
    """The columns of a log that `sarrus.identify` reads, also of a log of a bridge."""
    if config is not None:
        columns = replayed(config, log)
    elif isinstance(log, Mapping):
        columns = dict(log)
    elif Path(log).suffix == ".parquet":
        columns = _of_parquet(Path(log))
    else:
        columns = of_csv(log)
    wanted = [f"{name}/{part}" for name in robot.actuators for part in ("position", "effort")]
    if "time" in columns and any(name in columns for name in wanted):
        if missing := [name for name in wanted if name not in columns]:
            raise ValueError(f"found no column `{'`, `'.join(missing)}` in the log of a bridge")
        columns = measured(robot, columns)
    known = {"t", *robot.independent_coordinates}
    known |= {f"{name}/{rate}" for name in robot.independents for rate in ("yd", "ydd")}
    known |= {f"{name}/tau_u" for name in robot.actuators}
    found = {name: numbers(columns[name], name) for name in columns if name in known}
    for name, column in found.items():
        if not (good := np.isfinite(column)).all():
            raise ValueError(f"column `{name}` has no finite number in row {np.argmin(good)}")
    if not found:
        raise ValueError(f"found {', '.join(columns)}, expected columns such as {min(known)}")
    return found


def _of_parquet(path: Path) -> dict[str, Sequence[Any]]:
    try:
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError as error:
        raise ImportError("Parquet needs pyarrow: pip install 'sarrus[parquet]'") from error
    columns: dict[str, Sequence[Any]] = parquet.ParquetFile(path).read().to_pydict()
    return columns


def of_csv(path: str | os.PathLike[str]) -> dict[str, Sequence[Any]]:
    """The columns of a table, as texts."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        heads, *rows = [row for row in csv.reader(file) if row]
    for k, row in enumerate(rows):
        if len(row) != len(heads):
            words = f"found {len(row)} cells in row {k}, expected {len(heads)}"
            raise ValueError(f"{path}: {words}")
    return {head.strip(): [row[k] for row in rows] for k, head in enumerate(heads)}


def numbers(column: Any, name: str) -> Array:
    """A column as numbers; an empty cell is no number."""
    try:
        if isinstance(column, np.ndarray):
            return column.astype(np.float64)
        cells = (np.nan if cell is None or cell == "" else cell for cell in column)
        return np.array([*map(float, cells)])
    except ValueError as error:
        raise ValueError(f"column `{name}`: {error}") from None


def replayed(
    config: str | os.PathLike[str], log: str | os.PathLike[str]
) -> dict[str, Sequence[Any]]:
    """The columns of `sarrus-can log --csv`, without commands, from a log of the bridge."""
    from sarrus.show import moments

    configuration = _native.Configuration.load(config)
    names = list(configuration.actuators)
    with Path(log).open(encoding="utf-8") as file:
        listed = list(moments(configuration, list(file)))
    columns: dict[str, Sequence[Any]] = {"time": [moment.seconds for moment in listed]}
    for k, name in enumerate(names):
        for part in ("position", "velocity", "effort", "states"):
            values = [moment.measured[part][k] for moment in listed]
            columns[f"{name}/{'state' if part == 'states' else part}"] = values
    return columns


def measured(robot: Robot, columns: Mapping[str, Any]) -> dict[str, Any]:
    """The longest stretch of a bridge's cycles in which all actuators are enabled and measure.

    Means over `EVERY` seconds; y is the pose with these u, from the one before it.
    """
    names = list(robot.actuators)
    times = numbers(columns["time"], "time")
    u, tau_u = (
        np.column_stack([numbers(columns[f"{name}/{part}"], f"{name}/{part}") for name in names])
        for part in ("position", "effort")
    )
    good = np.isfinite(np.hstack([u, tau_u])).all(axis=1)
    for name in names:
        if (states := columns.get(f"{name}/state")) is not None:
            good &= np.asarray(states) == "enabled"
    ends = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]])))
    if not len(ends):
        raise ValueError("found no cycle in which all actuators are enabled and measure")
    k = int(np.argmax(ends[1::2] - ends[::2]))
    piece = slice(ends[2 * k], ends[2 * k + 1])
    times, u, tau_u = times[piece], u[piece], tau_u[piece]
    if len(times) > 1:
        many = max(1, round(EVERY / float(np.median(np.diff(times)))))
        times, u, tau_u = (_means(rows, many) for rows in (times, u, tau_u))
    y = _poses(robot, u)
    found: dict[str, Any] = {"t": times - times[:1]}
    found |= {name: y[:, k] for k, name in enumerate(robot.independent_coordinates)}
    return found | {f"{name}/tau_u": tau_u[:, k] for k, name in enumerate(names)}


def _means(rows: Array, many: int) -> Array:
    whole = len(rows) // many
    means: Array = rows[: whole * many].reshape(whole, many, *rows.shape[1:]).mean(axis=1)
    return means


def _poses(robot: Robot, u: Array) -> Array:
    """Follow the actuators from pose to pose."""
    query = robot.query("kinematics", ["u", "q_guess"], ["y", "q"])
    # the first one from the pose where all coordinates are zero
    answer = robot.query("kinematics", ["u"], ["y", "q"]).ask([u[0]], return_status=True)
    y = []
    for k, row in enumerate(u):
        if k:
            answer = query.ask([row, answer["q"]], return_status=True)
        if answer.status != Status.ok:
            words = f"found no pose with the actuators at {row}: {answer.status.name}"
            raise ValueError(f"{words}; has the log another robot, or its configuration offsets?")
        y.append(answer["y"])
    return np.array(y)
