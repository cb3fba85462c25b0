"""Queries by the names of fields."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from sarrus import _native
from sarrus.errors import QueryError, state_error
from sarrus.status import Status, Warnings

Array = npt.NDArray[np.float64]
Progress = Callable[[int, int], object]
RequestName = Literal[
    "kinematics",
    "inverse-dynamics",
    "forward-dynamics",
    "map",
    "observe",
    "ik",
    "diff-ik",
    "step",
]
AxesName = Literal["mixed", "world", "local"]


class Answer(dict[str, Any]):
    """The fields of an answer by name, as keys and as attributes.

    `status` and `warnings` are a `Status` and `Warnings` for one state, arrays of their numbers for
    rows of states.
    """

    status: Any
    warnings: Any

    def __init__(self, fields: dict[str, Any], status: Any, warnings: Any) -> None:
        super().__init__(fields)
        self.status = status
        self.warnings = warnings

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"no field `{name}`, there are {', '.join(self)}") from None

    def __reduce__(self) -> tuple[Any, ...]:
        return (Answer, (dict(self), self.status, self.warnings))


class Query:
    """A query that a robot has prepared.

    `given` and `want` have the names of the fields, in order, with their shapes for one state.
    """

    def __init__(self, native: _native.Query) -> None:
        self._native = native
        self.given: dict[str, tuple[int, ...]] = {k: tuple(v) for k, v in native.given}
        self.want: dict[str, tuple[int, ...]] = {k: tuple(v) for k, v in native.want}

    def __repr__(self) -> str:
        return f"<sarrus.Query {', '.join(self.given)} → {', '.join(self.want)}>"

    def __call__(
        self,
        *,
        out: dict[str, Array] | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
        return_status: bool = False,
        **given: npt.ArrayLike,
    ) -> Answer:
        """Answer one state or rows of states; every given field is an argument by name.

        One state without an answer raises `StateError`, whose `answer` has the surviving fields;
        with `return_status`, and for rows, the answer has a status instead. The arrays in `out`, by
        wanted fields, are written in place.
        """
        if given.keys() != self.given.keys():
            raise QueryError(
                f"found {', '.join(given) or 'nothing'} where {', '.join(self.given)} go in"
            )
        arrays = None
        if out is not None:
            if unknown := out.keys() - self.want.keys():
                raise QueryError(f"`out` has {', '.join(unknown)}, which nobody wants")
            arrays = [out.get(name) for name in self.want]
        return self.ask(
            [given[name] for name in self.given], arrays, threads, progress, return_status
        )

    def ask(
        self,
        given: Sequence[npt.ArrayLike],
        out: Sequence[Array | None] | None = None,
        threads: int | None = None,
        progress: Progress | None = None,
        return_status: bool = False,
    ) -> Answer:
        """Do the same with one array for each given field, in order."""
        fields, status, warnings = self._native.ask(given, out, threads, progress)
        named = dict(zip(self.want, fields, strict=True))
        if not isinstance(status, int):
            return Answer(named, status, warnings)
        answer = Answer(named, Status(status), Warnings(warnings))
        if status and not return_status:
            raise state_error(status, answer)
        return answer
