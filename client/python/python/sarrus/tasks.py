"""Tasks of frames: positions that reach them, and one step of a motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from sarrus.described import DescribedRobot
from sarrus.errors import QueryError, state_error
from sarrus.query import Answer, Array, Progress, RequestName
from sarrus.status import Status

if TYPE_CHECKING:
    from sarrus.query import Query

Tasks = Sequence[Mapping[str, Any]]

# bits of the parts of a task, and the places of its numbers in a row: of `task_target`, whose
# weight is the number 10, and of `task_motion`, whose weight is the number 6
PARTS = {"p": (1, slice(0, 3)), "quat": (2, slice(3, 7)), "axis": (4, slice(7, 10))}
TWIST = {"twist": (3, slice(0, 6))}
ACCELERATION = {"acc": (3, slice(0, 6))}
SECOND = 8
HELD = 16 + 3
LARGEST = np.finfo(np.float64).max


def packed(
    tasks: Tasks, known: Mapping[str, tuple[int, slice]] = PARTS
) -> tuple[list[str], list[int], Array]:
    """Give the frames, the parts and the numbers (…, tasks, 11 or 7) of tasks."""
    place = max(of.stop for _, of in known.values())
    frames: list[str] = []
    parts: list[int] = []
    rows: list[Array] = []
    for task in tasks:
        if unknown := task.keys() - known.keys() - {"frame", "weight", "priority"}:
            raise QueryError(f"a task has {', '.join(sorted(unknown))}, which means nothing")
        if "frame" not in task:
            raise QueryError("a task names no frame")
        if (priority := task.get("priority", 0)) not in (0, 1):
            raise QueryError(f"a priority is 0 or 1, not {priority}")
        frames.append(task["frame"])
        asked = {name: np.asarray(task[name], np.float64) for name in known if name in task}
        parts.append(sum(known[name][0] for name in asked) + SECOND * priority)
        weight = np.asarray(task.get("weight", 1.0), np.float64)
        lead = np.broadcast_shapes(weight.shape, *(x.shape[:-1] for x in asked.values()))
        row = np.zeros((*lead, place + 1))
        row[..., place] = weight
        for name, numbers in asked.items():
            row[..., known[name][1]] = numbers
        rows.append(row)
    lead = np.broadcast_shapes(*(row.shape[:-1] for row in rows))
    wide = [np.broadcast_to(row, (*lead, place + 1)) for row in rows]
    return frames, parts, np.stack(wide, axis=-2) if rows else np.zeros((0, place + 1))


def finite(bounds: npt.ArrayLike) -> Array:
    """Give bounds without infinities, which stand for none."""
    return np.clip(np.asarray(bounds, np.float64), -LARGEST, LARGEST)


class TaskRobot(DescribedRobot):
    """A robot that is asked by tasks of its frames."""

    if TYPE_CHECKING:

        def query(self, *words: Any, **options: Any) -> Query:
            """Make a query, as the whole robot does."""
            ...

    def ik(
        self,
        tasks: Tasks = (),
        *,
        com: npt.ArrayLike | None = None,
        bounds: Mapping[str, npt.ArrayLike] | None = None,
        clearance: float | None = None,
        y_guess: npt.ArrayLike | None = None,
        y_preferred: npt.ArrayLike | None = None,
        all: bool = False,
        search: bool = False,
        relative_to: str | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Answer:
        """Give positions at which frames reach their targets, with every loop closed.

        Each of `tasks` has a `frame` and any of `p` [m] (3), `quat` (x, y, z, w) and `axis`, the
        direction of the frame's z axis; further a `weight` (1) and a `priority`: tasks of priority
        1 use only the room that those of 0 leave. `com` is a target of the centre of mass. The
        joints, dependent ones and actuators included, stay inside the model's limits, or inside
        `bounds` (`y` (n_qy, 2), `u` (n_u, 2)), and `sigma_min` above `clearance`. The search starts
        at `y_guess`, and stays near `y_preferred` where the tasks leave room. Rows of targets are a
        batch.

        The answer has `y`, `q`, `u`, `task_residual`, `iterations`, `binding` and, with `all`,
        `solutions`. Its status is `ok`, each residual at most 1e-9, or `not_reached`, the nearest
        pose that breaks no bound; any other status of one state raises `StateError`.

        >>> import sarrus
        >>> robot = sarrus.Robot.bundled("lambda")
        >>> link = robot.links[-1]
        >>> pose = robot.frames(link, [0.3]).pose
        >>> found = robot.ik([{"frame": link, "p": pose[:3], "quat": pose[3:]}])
        >>> found.status.name, bool(abs(found.y[0] - 0.3) < 1e-8)
        ('ok', True)
        """
        frames, parts, target = packed(tasks)
        given: dict[str, npt.ArrayLike | None] = {
            "task_target": target if frames else None,
            "com_target": com,
            "y_guess": y_guess,
            "y_preferred": y_preferred,
            "clearance": None if clearance is None else [clearance],
        }
        for space, pairs in (bounds or {}).items():
            given[f"bounds_{space}"] = finite(pairs)
        want = ["y", "q", "u", "task_residual", "iterations", "binding"]
        return self._with_tasks(
            "ik",
            given,
            [*want, "solutions"] if all else want,
            (frames, parts),
            {"search": search, "relative_to": relative_to},
            (threads, progress),
        )

    def diff_ik(
        self,
        tasks: Tasks,
        y: npt.ArrayLike,
        dt: float,
        *,
        yd: npt.ArrayLike | None = None,
        contacts: Sequence[str] = (),
        com: npt.ArrayLike | None = None,
        bounds: Mapping[str, npt.ArrayLike] | None = None,
        relative_to: str | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Answer:
        """Give the velocity that moves frames as wanted, within all limits.

        Each of `tasks` has a `frame`, a `twist` [ω; v] (6), a `weight` and a `priority` as in `ik`.
        `com` is a velocity of the centre of mass; `contacts` are frames that stand still; the room
        that is left goes to the velocity nearest to `yd`. Velocities, and to first order the
        strokes after `dt` [s], stay inside the model's limits, or those of `bounds`, of all joints.

        The answer has `yd`, `task_residual` and `binding`. Where no velocity keeps the limits and
        the contacts, `StateError` has the status `infeasible`.

        >>> import sarrus
        >>> robot = sarrus.Robot.bundled("lambda")
        >>> link = robot.links[-1]
        >>> twist = robot.frames(link, [0.3], [0.1]).twist
        >>> found = robot.diff_ik([{"frame": link, "twist": twist}], [0.3], 0.01)
        >>> round(float(found.yd[0]), 6)
        0.1
        """
        given = {"y": y, "yd": yd}
        options = {"relative_to": relative_to}
        tasks_of = (tasks, TWIST, contacts, com, bounds)
        want = ["yd", "task_residual", "binding"]
        return self._moved("diff-ik", given, dt, tasks_of, want, options, (threads, progress))

    def step(
        self,
        tasks: Tasks,
        y: npt.ArrayLike,
        yd: npt.ArrayLike,
        dt: float,
        *,
        ydd: npt.ArrayLike | None = None,
        contacts: Sequence[str] = (),
        com: npt.ArrayLike | None = None,
        bounds: Mapping[str, npt.ArrayLike] | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Answer:
        """Give the forces of actuators and contacts that accelerate frames as wanted.

        Each of `tasks` has a `frame`, an `acc` [ω̇; v̇] (6), `weight` and `priority` as in `ik`.
        `com` is an acceleration of the centre of mass; `contacts` are frames that stand still, held
        by the ground; the room that is left goes to the acceleration nearest to `ydd`. The forces
        of the actuators, and after `dt` [s] the velocities and strokes of all joints, stay inside
        the model's limits, or those of `bounds`.

        The answer has `ydd`, `tau_u`, `contact_forces` (tasks and contacts, 6), `task_residual` and
        `binding`. Where nothing keeps the limits and the contacts, `StateError` has the status
        `infeasible`.
        """
        given = {"y": y, "yd": yd, "ydd": ydd}
        tasks_of = (tasks, ACCELERATION, contacts, com, bounds)
        want = ["ydd", "tau_u", "contact_forces", "task_residual", "binding"]
        return self._moved("step", given, dt, tasks_of, want, {}, (threads, progress))

    def _moved(
        self,
        request: RequestName,
        given: dict[str, npt.ArrayLike | None],
        dt: float,
        tasks_of: tuple[Any, ...],
        want: list[str],
        options: dict[str, Any],
        batch: tuple[int | None, Progress | None],
    ) -> Answer:
        tasks, known, contacts, com, bounds = tasks_of
        frames, parts, motion = packed(tasks, known)
        if len(contacts) > 0:
            still = np.zeros((*motion.shape[:-2], len(contacts), 7))
            motion = np.concatenate((motion, still), axis=-2)
        frames, parts = [*frames, *contacts], [*parts, *([HELD] * len(contacts))]
        given |= {"dt": dt, "com_target": com, "task_motion": motion if frames else None}
        for space, pairs in (bounds or {}).items():
            given[f"bounds_{space}"] = finite(pairs)
        return self._with_tasks(request, given, want, (frames, parts), options, batch)

    def _with_tasks(
        self,
        request: RequestName,
        given: Mapping[str, npt.ArrayLike | None],
        want: list[str],
        tasks: tuple[list[str], list[int]],
        options: dict[str, Any],
        batch: tuple[int | None, Progress | None],
    ) -> Answer:
        frames, parts = tasks
        present = {name: array for name, array in given.items() if array is not None}
        query = self.query(request, list(present), want, frames=frames, tasks=parts, **options)
        arrays = [np.asarray(present[name], np.float64) for name in query.given]
        inner = [len(shape) for shape in query.given.values()]
        lead = np.broadcast_shapes(
            *(x.shape[: x.ndim - n] for x, n in zip(arrays, inner, strict=True))
        )
        wide = [
            np.ascontiguousarray(np.broadcast_to(x, (*lead, *x.shape[x.ndim - n :])))
            for x, n in zip(arrays, inner, strict=True)
        ]
        answer = query.ask(wide, None, *batch, return_status=True)
        if not lead and answer.status not in (Status.ok, Status.not_reached):
            raise state_error(answer.status, answer)
        return answer
