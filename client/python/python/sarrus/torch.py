"""Queries as functions of PyTorch, with the Jacobians of sarrus.

Needs `pip install 'sarrus[torch]'`; a build for processors will do.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

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
    frames: Sequence[str] = (),
    wrenches: Sequence[str] = (),
    friction: bool = False,
    raises: bool = False,
    threads: int | None = None,
) -> Callable[..., Any]:
    """Give a query as a function of tensors, whose derivatives are fields of sarrus.

    It takes the `given` fields with any leading axes and returns the `want` ones, a tuple of more
    than one. Gradients flow through it, twice for forward dynamics; `torch.func.vmap` is one batch.

    `frames`, `wrenches` and `friction` are those of `Robot.query`. A state without an answer is
    NaN, also in gradients; with `raises` it is a `StateError`. The numbers are computed on the
    processor in double precision, and come back in the precision and on the device of the first
    tensor.
    """
    torch = _torch()
    options: Any = {"frames": frames, "wrenches": wrenches, "friction": friction}
    external = External(robot, request, given, want, raises=raises, threads=threads, **options)
    apply = _functions(torch)[0].apply

    def of_tensors(*inputs: Any) -> Any:
        if len(inputs) != len(external.inputs):
            raise TypeError(f"{len(inputs)} tensors, expected {', '.join(external.inputs)}")
        shapes = external.inputs.values()
        leads = [x.shape[: x.dim() - len(shape)] for x, shape in zip(inputs, shapes, strict=True)]
        lead = torch.broadcast_shapes(*leads)
        alike = [x.expand(*lead, *x.shape[len(at) :]) for x, at in zip(inputs, leads, strict=True)]
        found = apply(external, *alike)
        return found[0] if len(found) == 1 else found

    return of_tensors


def _torch() -> Any:
    """The package `torch`, which only this module needs."""
    try:
        return importlib.import_module("torch")
    except ImportError as error:
        raise ImportError("`sarrus.torch` needs PyTorch: pip install 'sarrus[torch]'") from error


@cache
def _functions(torch: Any) -> tuple[Any, Any]:
    """The functions of values and of gradients."""

    def arrays(tensors: Sequence[Any]) -> list[Array]:
        return [x.detach().cpu().double().numpy() for x in tensors]

    def tensors(found: Sequence[Array], like: Any) -> tuple[Any, ...]:
        return tuple(torch.as_tensor(x, dtype=like.dtype, device=like.device) for x in found)

    class Vmapped(torch.autograd.Function):  # type: ignore[misc]
        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            ctx.external = inputs[0]
            ctx.save_for_backward(*inputs[1:])

        @classmethod
        def vmap(cls, info: Any, places: Any, external: External, *given: Any) -> Any:
            rows = [
                x.expand(info.batch_size, *x.shape) if place is None else x.movedim(place, 0)
                for x, place in zip(given, places[1:], strict=True)
            ]
            found = cls.apply(external, *rows)
            return found, tuple(0 for _ in found)

    class Values(Vmapped):
        """The outputs of a query."""

        @staticmethod
        def forward(external: External, *given: Any) -> Any:
            return tensors(external(*arrays(given)), given[0])

        @staticmethod
        def backward(ctx: Any, *slopes: Any) -> Any:
            return (None, *Gradients.apply(ctx.external, *ctx.saved_tensors, *slopes))

    class Gradients(Vmapped):
        """Jᵀ g of each input, from inputs and the gradients g of outputs."""

        @staticmethod
        def forward(external: External, *given: Any) -> Any:
            n = len(external.inputs)
            found = external.transposed_times(
                external.jacobians(*arrays(given[:n])), arrays(given[n:])
            )
            return tensors(found, given[0])

        @staticmethod
        @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
        def backward(ctx: Any, *along: Any) -> Any:
            external = ctx.external
            external.refuse_second()
            n = len(external.inputs)
            given = arrays(ctx.saved_tensors)
            directions = arrays(along)
            first, rows = external.jacobians(*given[:n]), given[:n]
            by_inputs = external.transposed_times(external.curvature(rows, directions), given[n:])
            by_slopes = external.times(first, directions)
            return (None, *tensors([*by_inputs, *by_slopes], ctx.saved_tensors[0]))

    return Values, Gradients
