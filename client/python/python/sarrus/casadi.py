"""Queries as functions of CasADi, with the Jacobians of sarrus.

Needs `pip install 'sarrus[casadi]'`.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from sarrus.external import External
from sarrus.query import Array, RequestName

if TYPE_CHECKING:
    from sarrus.robot import Robot


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
    values: type = _classes(_casadi())[0]
    return values(external, rows, name)


def _casadi() -> Any:
    """The package `casadi`, which only this module needs."""
    try:
        return importlib.import_module("casadi")
    except ImportError as error:
        raise ImportError(
            "`sarrus.casadi` needs CasADi: pip install 'sarrus[casadi]'"
        ) from error


@cache
def _classes(casadi: Any) -> tuple[type, type, type]:
    """The callbacks of values, of Jacobians and of second derivatives."""

    class Values(casadi.Callback):  # type: ignore[misc]
        """The outputs of a query from its inputs."""

        def __init__(self, external: External, rows: int, name: str) -> None:
            super().__init__()
            self.external, self.rows, self.kept = external, rows, []
            self.fields = [*external.inputs, *external.outputs]
            self.construct(name, {})

        def get_n_in(self) -> int:
            return len(self.external.inputs)

        def get_n_out(self) -> int:
            return len(self.external.outputs)

        def get_name_in(self, i: int) -> str:
            return self.fields[i]

        def get_name_out(self, i: int) -> str:
            return self.fields[self.get_n_in() + i]

        def get_sparsity_in(self, i: int) -> Any:
            return self.dense(self.fields[i])

        def get_sparsity_out(self, i: int) -> Any:
            return self.dense(self.fields[self.get_n_in() + i])

        def dense(self, field: str) -> Any:
            """A column for each state, or for each frame of each state."""
            shape = (self.external.inputs | self.external.outputs)[field]
            return casadi.Sparsity.dense(shape[-1], self.rows * int(np.prod(shape[:-1])))

        def given(self, arguments: Sequence[Any]) -> list[Array]:
            """Arguments as rows of states."""
            shapes = self.external.inputs.values()
            return [
                np.array(argument).T.reshape(self.rows, *shape)
                for argument, shape in zip(arguments, shapes, strict=False)
            ]

        def eval(self, arguments: Sequence[Any]) -> list[Any]:
            found = self.external(*self.given(arguments))
            return [casadi.DM(array.reshape(-1, array.shape[-1]).T) for array in found]

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, name: str, inputs: Any, outputs: Any, options: Any) -> Any:
            self.kept.append(Jacobians(self, name, options))
            return self.kept[-1]

    class Jacobians(casadi.Callback):  # type: ignore[misc]
        """The Jacobian of each output by each input, from inputs and outputs."""

        def __init__(self, values: Values, name: str, options: Any) -> None:
            super().__init__()
            self.values, self.external, self.kept = values, values.external, []
            pairs = [(o, i) for o in self.external.outputs for i in self.external.inputs]
            self.blocks = {pair: self.block(*pair) for pair in pairs}
            self.construct(name, options)

        def block(self, output: str, by: str) -> tuple[Any, Array | None]:
            """The block-diagonal pattern of all states, and its order of numbers."""
            m, n, rows = self.external.size(output), self.external.size(by), self.values.rows
            if (output, by) not in self.external.rules:
                return casadi.Sparsity(m * rows, n * rows), None
            r, i, j = np.indices((rows, m, n))
            return _pattern(casadi, (m * rows, n * rows), r * m + i, r * n + j)

        def get_n_in(self) -> int:
            return len(self.values.fields)

        def get_n_out(self) -> int:
            return len(self.blocks)

        def get_name_in(self, i: int) -> str:
            own = self.values.get_n_in()
            return self.values.fields[i] if i < own else f"out_{self.values.fields[i]}"

        def get_name_out(self, i: int) -> str:
            output, by = [*self.blocks][i]
            return f"jac_{output}_{by}"

        def get_sparsity_in(self, i: int) -> Any:
            return self.values.dense(self.values.fields[i])

        def get_sparsity_out(self, i: int) -> Any:
            return [*self.blocks.values()][i][0]

        def eval(self, arguments: Sequence[Any]) -> list[Any]:
            found = self.external.jacobians(*self.values.given(arguments))
            return [
                casadi.DM(sparsity, [] if order is None else found[pair].ravel()[order])
                for pair, (sparsity, order) in self.blocks.items()
            ]

        def has_jacobian(self) -> bool:
            return bool(self.external.second)

        def get_jacobian(self, name: str, inputs: Any, outputs: Any, options: Any) -> Any:
            self.external.refuse_second()
            self.kept.append(Curvature(self, name, options))
            return self.kept[-1]

    class Curvature(casadi.Callback):  # type: ignore[misc]
        """The derivatives of each Jacobian of forward dynamics by each argument."""

        def __init__(self, first: Jacobians, name: str, options: Any) -> None:
            super().__init__()
            self.first, self.external, self.values = first, first.external, first.values
            fields = self.values.fields
            self.blocks = {(b, k): self.block(b, fields[k]) for b in first.blocks for k in
                           range(len(fields))}
            self.construct(name, options)

        def block(self, pair: tuple[str, str], by: str) -> tuple[Any, Array | None]:
            (m, n, p), rows = (self.external.size(x) for x in (*pair, by)), self.values.rows
            shape = (m * rows * n * rows, p * rows)
            if by not in self.external.inputs:
                return casadi.Sparsity(*shape), None
            k, r, i, j = np.indices((p, rows, m, n))
            return _pattern(casadi, shape, (r * n + j) * (m * rows) + r * m + i, r * p + k)

        def get_n_in(self) -> int:
            return int(self.first.n_in() + self.first.n_out())

        def get_n_out(self) -> int:
            return len(self.blocks)

        def get_sparsity_in(self, i: int) -> Any:
            n = self.first.n_in()
            return self.first.sparsity_in(i) if i < n else self.first.sparsity_out(i - n)

        def get_sparsity_out(self, i: int) -> Any:
            return [*self.blocks.values()][i][0]

        def eval(self, arguments: Sequence[Any]) -> list[Any]:
            given = self.values.given(arguments)
            found: dict[Any, Array] = {}
            for k, field in enumerate(self.external.inputs):
                # all directions of this input at all states are one batch
                size = self.external.size(field)
                at = [np.broadcast_to(x, (size, *x.shape)) for x in given]
                along = [np.zeros_like(x) for x in at]
                along[k][:] = np.eye(size)[:, None]
                for pair, block in self.external.curvature(at, along).items():
                    found[pair, k] = block
            return [
                casadi.DM(sparsity, [] if order is None else found[block].ravel()[order])
                for block, (sparsity, order) in self.blocks.items()
            ]

    return Values, Jacobians, Curvature


def _pattern(
    casadi: Any, shape: tuple[int, int], rows: Array, columns: Array
) -> tuple[Any, Array]:
    """A pattern of these places, and the order in which it holds their numbers."""
    rows, columns = rows.ravel(), columns.ravel()
    order = np.lexsort((rows, columns))
    return casadi.Sparsity.triplet(*shape, rows.tolist(), columns.tolist()), order
