"""Queries as functions of JAX, with the Jacobians of sarrus.

Needs `pip install 'sarrus[jax]'` and double precision, `jax.config.update("jax_enable_x64", True)`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from sarrus.external import External
from sarrus.query import RequestName

if TYPE_CHECKING:
    from sarrus.robot import Robot


def function(
    robot: Robot,
    request: RequestName,
    given: Sequence[str],
    want: Sequence[str],
    *,
    frames: Sequence[str] = (),
    wrenches: Sequence[str] = (),
    friction: bool = False,
    raises: bool = False,
    threads: int | None = None,
) -> Callable[..., Any]:
    """Give a query as a function of arrays of JAX, whose derivatives are fields of sarrus.

    It takes the `given` fields with any leading axes and returns the `want` ones, a tuple of more
    than one. `jit`, `vmap`, `grad`, `jacfwd` and `jacrev` apply to it; a `vmap` is one batch.
    Second derivatives are those of forward dynamics: `jax.hessian`, or any `jvp` of a first
    derivative.

    `frames`, `wrenches` and `friction` are those of `Robot.query`. A state without an answer is
    NaN, also in derivatives; with `raises` it is an error of JAX instead. The numbers are computed
    on the processor by `jax.pure_callback`.

    >>> import sarrus, sarrus.jax
    >>> robot = sarrus.Robot.bundled("lambda")
    >>> forward = sarrus.jax.function(robot, "forward-dynamics", ["y", "yd", "tau_u"], ["ydd"])
    """
    jax = _jax()
    options: Any = {"frames": frames, "wrenches": wrenches, "friction": friction}
    external = External(robot, request, given, want, raises=raises, threads=threads, **options)
    sizes = external.inputs
    blocks = [(external.size(output), external.size(by)) for output, by in external.rules]

    def callback(host: Callable[..., Any], shapes: Any, inputs: Any, *more: Any) -> Any:
        lead = inputs[0].shape[: inputs[0].ndim - len(next(iter(sizes.values())))]
        results = [jax.ShapeDtypeStruct((*lead, *shape), jax.numpy.float64) for shape in shapes]
        return jax.pure_callback(host, results, inputs, *more, vmap_method="broadcast_all")

    def host(*inputs: Any) -> Any:
        return callback(lambda given: external(*given), external.outputs.values(), inputs)

    def host_jacobians(*inputs: Any) -> Any:
        found = callback(lambda given: [*external.jacobians(*given).values()], blocks, inputs)
        return dict(zip(external.rules, found, strict=True))

    def rates(inputs: Any, tangents: Any) -> Any:
        return values(*inputs), external.times(jacobians(*inputs), tangents, jax.numpy)

    def rates_of_jacobians(inputs: Any, tangents: Any) -> Any:
        external.refuse_second()

        def curved(given: Any, along: Any) -> Any:
            found = external.curvature(given, along)
            return [found[pair] for pair in external.rules]

        found = callback(curved, blocks, inputs, tangents)
        return jacobians(*inputs), dict(zip(external.rules, found, strict=True))

    values, jacobians = jax.custom_jvp(host), jax.custom_jvp(host_jacobians)
    values.defjvp(rates)
    jacobians.defjvp(rates_of_jacobians)

    def of_arrays(*inputs: Any) -> Any:
        if not jax.config.jax_enable_x64:
            raise TypeError(
                "`sarrus.jax` needs double precision: jax.config.update('jax_enable_x64', True)"
            )
        if len(inputs) != len(sizes):
            raise TypeError(f"{len(inputs)} arrays, expected {', '.join(sizes)}")
        arrays = [jax.numpy.asarray(array, jax.numpy.float64) for array in inputs]
        leads = []
        for array, (name, shape) in zip(arrays, sizes.items(), strict=True):
            split = array.ndim - len(shape)
            if split < 0 or array.shape[split:] != shape:
                raise ValueError(
                    f"`{name}` has the shape {array.shape}, expected {shape} at its end"
                )
            leads.append(array.shape[:split])
        lead = jax.numpy.broadcast_shapes(*leads)
        alike = [
            jax.numpy.broadcast_to(array, (*lead, *shape))
            for array, shape in zip(arrays, sizes.values(), strict=True)
        ]
        found = values(*alike)
        return found[0] if len(found) == 1 else tuple(found)

    return of_arrays


def _jax() -> Any:
    """The package `jax`, which only this module needs."""
    try:
        return importlib.import_module("jax")
    except ImportError as error:
        raise ImportError("`sarrus.jax` needs JAX: pip install 'sarrus[jax]'") from error
