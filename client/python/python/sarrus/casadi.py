"""Queries as functions of CasADi, with the Jacobians of sarrus.

Needs `pip install 'sarrus[casadi]'`.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from sarrus.external import External
from sarrus.query import Array, RequestName

if TYPE_CHECKING:
    from sarrus.robot import Robot

Places = npt.NDArray[np.intp]
Pattern = tuple[Any, Any]
"""A pattern of CasADi, and the order of its numbers in an array, `None` of a block of zeros."""
Patterns = dict[Any, Pattern]


def function(
    robot: Robot,
    request: RequestName,
    given: Sequence[str],
    want: Sequence[str],
    *,
    rows: int = 1,
    name: str = "sarrus",
    frames: Sequence[str] = (),
    wrenches: Sequence[str] = (),
    friction: bool = False,
    raises: bool = False,
    threads: int | None = None,
) -> Any:
    """Give a query as a `casadi.Callback`, whose derivatives are fields of sarrus.

    It takes the `given` fields and returns the `want` ones. Columns are states: with `rows` states
    a call answers them as one batch, and its Jacobians are block diagonal. A field of frames has a
    column for each frame. Keep the function as long as expressions use it.

    `frames`, `wrenches` and `friction` are those of `Robot.query`. A state without an answer is
    NaN, which IPOPT answers with a shorter step; with `raises` it is an error of CasADi instead.
    Second derivatives are those of forward dynamics; for others set IPOPT's
    `hessian_approximation` to `limited-memory`.

    >>> import sarrus, sarrus.casadi
    >>> robot = sarrus.Robot.bundled("lambda")
    >>> forward = sarrus.casadi.function(
    ...     robot, "forward-dynamics", ["y", "yd", "tau_u"], ["ydd"]
    ... )
    >>> forward(0.2, 0.0, 50.0).shape
    (1, 1)
    """
    if rows < 1:
        raise ValueError(f"`rows` is {rows}, expected at least one")
    options: Any = {"frames": frames, "wrenches": wrenches, "friction": friction}
    external = External(robot, request, given, want, raises=raises, threads=threads, **options)
    return _classes(_casadi())(external, rows, name)


def _casadi() -> Any:
    """The package `casadi`, which only this module needs."""
    try:
        return importlib.import_module("casadi")
    except ImportError as error:
        raise ImportError("`sarrus.casadi` needs CasADi: pip install 'sarrus[casadi]'") from error


@cache
def _classes(casadi: Any) -> type:
    """The callback of values, from which those of first and second derivatives come."""

    class Blocks(casadi.Callback):  # type: ignore[misc]
        """A function whose outputs are blocks of an `External`."""

        def prepare(self, name: str, options: Any, inputs: Patterns, outputs: Patterns) -> None:
            self.patterns_in, self.patterns_out = [*inputs.items()], [*outputs.items()]
            # CasADi does not own callbacks of Python
            self.kept: list[Any] = []
            self.construct(name, options)

        def get_n_in(self) -> int:
            return len(self.patterns_in)

        def get_n_out(self) -> int:
            return len(self.patterns_out)

        def get_name_in(self, k: int) -> str:
            return "_".join(self.patterns_in[k][0])

        def get_name_out(self, k: int) -> str:
            return "_".join(self.patterns_out[k][0])

        def get_sparsity_in(self, k: int) -> Any:
            return self.patterns_in[k][1][0]

        def get_sparsity_out(self, k: int) -> Any:
            return self.patterns_out[k][1][0]

        def eval(self, arguments: Sequence[Any]) -> list[Any]:
            found = self.numbers(arguments)
            return [
                casadi.DM(pattern, [] if order is None else found[key].ravel()[order])
                for key, (pattern, order) in self.patterns_out
            ]

    class Values(Blocks):
        """The outputs of a query from its inputs."""

        def __init__(self, external: External, rows: int, name: str) -> None:
            super().__init__()
            self.external, self.rows = external, rows
            inputs = {(field,): self.columns(shape) for field, shape in external.inputs.items()}
            outputs = {(field,): self.columns(shape) for field, shape in external.outputs.items()}
            self.prepare(name, {}, inputs, outputs)

        def columns(self, shape: tuple[int, ...]) -> Pattern:
            """A column for each state, or for each frame of each state."""
            columns = self.rows * int(np.prod(shape[:-1]))
            return casadi.Sparsity.dense(shape[-1], columns), slice(None)

        def given(self, arguments: Sequence[Any]) -> list[Array]:
            """The inputs among the arguments, as rows of states."""
            return [
                np.array(argument).T.reshape(self.rows, *shape)
                for argument, shape in zip(arguments, self.external.inputs.values(), strict=False)
            ]

        def numbers(self, arguments: Sequence[Any]) -> dict[Any, Array]:
            found = self.external(*self.given(arguments))
            return {
                (name,): array for name, array in zip(self.external.outputs, found, strict=True)
            }

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, name: str, _inputs: Any, _outputs: Any, options: Any) -> Any:
            self.kept.append(Jacobians(self, name, options))
            return self.kept[-1]

    class Jacobians(Blocks):
        """The Jacobian of each output by each input, from inputs and outputs."""

        def __init__(self, values: Values, name: str, options: Any) -> None:
            super().__init__()
            self.values, self.external = values, values.external
            outputs = {
                ("jac", output, by): self.block(output, by)
                for output in self.external.outputs
                for by in self.external.inputs
            }
            given = {("out", *key): pattern for key, pattern in values.patterns_out}
            self.prepare(name, options, dict(values.patterns_in) | given, outputs)

        def block(self, output: str, by: str) -> Pattern:
            """A block for each state."""
            m, n, rows = self.external.size(output), self.external.size(by), self.values.rows
            if (output, by) not in self.external.rules:
                return casadi.Sparsity(m * rows, n * rows), None
            r, i, j = np.indices((rows, m, n))
            return _pattern(casadi, (m * rows, n * rows), r * m + i, r * n + j)

        def numbers(self, arguments: Sequence[Any]) -> dict[Any, Array]:
            blocks = self.external.jacobians(*self.values.given(arguments))
            return {("jac", *pair): block for pair, block in blocks.items()}

        def has_jacobian(self) -> bool:
            return self.external.second

        def get_jacobian(self, name: str, _inputs: Any, _outputs: Any, options: Any) -> Any:
            self.external.refuse_second()
            self.kept.append(Curvature(self, name, options))
            return self.kept[-1]

    class Curvature(Blocks):
        """The derivatives of each Jacobian by each argument of these."""

        def __init__(self, first: Jacobians, name: str, options: Any) -> None:
            super().__init__()
            self.values, self.external = first.values, first.external
            outputs = {
                (*block, *by): self.block(block[1:], by)
                for block, _ in first.patterns_out
                for by, _ in first.patterns_in
            }
            given = {("out", *key): pattern for key, pattern in first.patterns_out}
            self.prepare(name, options, dict(first.patterns_in) | given, outputs)

        def block(self, pair: tuple[str, ...], by: tuple[str, ...]) -> Pattern:
            m, n, p = (self.external.size(name) for name in (*pair, by[-1]))
            rows = self.values.rows
            shape = (m * rows * n * rows, p * rows)
            if by[-1] not in self.external.inputs:
                return casadi.Sparsity(*shape), None
            k, r, i, j = np.indices((p, rows, m, n))
            return _pattern(casadi, shape, (r * n + j) * (m * rows) + r * m + i, r * p + k)

        def numbers(self, arguments: Sequence[Any]) -> dict[Any, Array]:
            given = self.values.given(arguments)
            found: dict[Any, Array] = {}
            for place, by in enumerate(self.external.inputs):
                # all directions of this input at all states are one batch
                size = self.external.size(by)
                at = [np.broadcast_to(x, (size, *x.shape)) for x in given]
                along = [np.zeros_like(x) for x in at]
                along[place][:] = np.eye(size)[:, None]
                for pair, block in self.external.curvature(at, along).items():
                    found[("jac", *pair, by)] = block
            return found

    return Values


def _pattern(casadi: Any, shape: tuple[int, int], rows: Places, columns: Places) -> Pattern:
    """A pattern of these places, and the order in which it holds their numbers."""
    rows, columns = rows.ravel(), columns.ravel()
    order = np.lexsort((rows, columns))
    return casadi.Sparsity.triplet(*shape, rows.tolist(), columns.tolist()), order
