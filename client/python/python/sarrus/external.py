"""Queries as functions with Jacobians, for packages that differentiate.

`sarrus.casadi`, `sarrus.jax` and `sarrus.torch` share this module: `RULES` names the fields that
hold the Jacobians of each output.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from sarrus.errors import QueryError, state_error
from sarrus.query import Array, RequestName

if TYPE_CHECKING:
    from sarrus.robot import Robot

Blocks = dict[tuple[str, str], Array]


class External:
    """A query as a function of rows, with Jacobians from fields of sarrus.

    `inputs` and `outputs` have the names of the fields with their shapes for one state; `second`
    is whether second derivatives exist. A row without an answer has NaN, or with `raises` raises a
    `StateError`.
    """

    def __init__(
        self,
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
    ) -> None:
        options: Any = {"wrenches": wrenches, "friction": friction}
        self.raises, self.threads = raises, threads
        self._values = robot.query(request, given, want, frames=frames, **options)
        self.inputs, self.outputs = self._values.given, self._values.want
        _refuse([*self.inputs], [*self.outputs])
        self.coordinates, self.tree = [*robot.independent_coordinates], [*robot.coordinates]
        self._has_turns = len(self.coordinates) != len(robot.independents)
        self.actuated = [robot.joints.index(name) for name in robot.actuators]
        # links of wrenches are frames too: their Jacobians carry the forces
        links = [*frames, *(link for link in wrenches if link not in frames)]
        self.frames = slice(len(frames))
        self._loaded = [links.index(link) for link in wrenches]
        self.rules = {
            (output, name): rule
            for output in self.outputs
            for name, rule in RULES[output].items()
            if name in self.inputs
        }
        if self._has_turns and (wrong := OF_ONE_FREEDOM.intersection(self.rules)):
            output, name = min(wrong)
            raise QueryError(f"no Jacobian of {output} by {name}: a joint is floating or a ball")
        fields = {field for rule in self.rules.values() for field in rule.fields}
        self._fields = robot.query(request, given, sorted(fields), frames=links, **options)
        self.second = (
            request == "forward-dynamics"
            and set(self.inputs) == {"y", "yd", "tau_u"}
            and list(self.outputs) == ["ydd"]
            and not self._has_turns
        )
        if self.second:
            self._curved = robot.query(
                request, [*given, "direction"], ["d2_ydd_v"], friction=friction
            )

    def __call__(self, *rows: npt.ArrayLike) -> list[Array]:
        """Give the outputs (…, shape) of inputs (…, shape) with equal leading axes."""
        lead, flat = self._flat(rows)
        answer = self._asked(self._values, flat)
        return [answer[name].reshape(*lead, *shape) for name, shape in self.outputs.items()]

    def jacobians(self, *rows: npt.ArrayLike) -> Blocks:
        """Give the Jacobians (…, size of the output, size of the input); absent ones are zero."""
        lead, flat = self._flat(rows)
        answer = self._asked(self._fields, flat)
        blocks = {}
        for (output, name), rule in self.rules.items():
            block = rule.block(self, answer)
            if name == "y" and self._has_turns:
                block = _lower(self.coordinates, flat[[*self.inputs].index("y")], block)
            blocks[output, name] = block.reshape(*lead, *block.shape[1:])
        return blocks

    def curvature(self, rows: Sequence[npt.ArrayLike], along: Sequence[npt.ArrayLike]) -> Blocks:
        """Give the derivatives of the Jacobians along a direction of the inputs."""
        self.refuse_second()
        lead, flat = self._flat(rows)
        by_name = dict(zip(self.inputs, self._flat(along)[1], strict=True))
        order = ("y", "yd", "tau_u")
        direction = np.concatenate([by_name[name] for name in order], axis=1)
        d2: Array = self._asked(self._curved, [*flat, direction])["d2_ydd_v"]
        ends = np.cumsum([self.inputs[name][0] for name in order])[:-1]
        parts = np.split(d2.reshape(*lead, *d2.shape[1:]), ends, axis=-1)
        return {("ydd", name): part for name, part in zip(order, parts, strict=True)}

    def refuse_second(self) -> None:
        """Refuse second derivatives where there are none."""
        if not self.second:
            raise NotImplementedError(
                "second derivatives are those of forward-dynamics from y, yd and tau_u to ydd, "
                "without wrenches and without floating or ball joints"
            )

    def times(self, blocks: Any, tangents: Sequence[Any], of: Any = np) -> list[Any]:
        """J t for each output, with arrays of numpy or of another module."""
        sums = []
        lead = self._lead(tangents, self.inputs)
        for output, shape in self.outputs.items():
            total = of.zeros((*lead, self.size(output)))
            for (name, by), block in blocks.items():
                if name == output:
                    tangent = tangents[[*self.inputs].index(by)].reshape(*lead, self.size(by))
                    total = total + of.einsum("...ij,...j->...i", block, tangent)
            sums.append(total.reshape(*lead, *shape))
        return sums

    def transposed_times(self, blocks: Blocks, slopes: Sequence[Array]) -> list[Array]:
        """Jᵀ g for each input."""
        sums = []
        lead = self._lead(slopes, self.outputs)
        for by, shape in self.inputs.items():
            total = np.zeros((*lead, self.size(by)))
            for (output, name), block in blocks.items():
                if name == by:
                    slope = slopes[[*self.outputs].index(output)].reshape(*lead, self.size(output))
                    total += np.einsum("...ij,...i->...j", block, slope)
            sums.append(total.reshape(*lead, *shape))
        return sums

    def size(self, name: str) -> int:
        """Count the numbers of an input or output."""
        shapes: Mapping[str, tuple[int, ...]] = self.inputs | self.outputs
        return int(np.prod(shapes[name]))

    def shown(self, jacobians: Array) -> Array:
        """The Jacobians of `frames` (n, frame, 6, n_vy) among those of all links."""
        return jacobians.reshape(len(jacobians), -1, 6, jacobians.shape[-1])[:, self.frames]

    def loaded(self, jacobians: Array) -> Array:
        """The Jacobians of the links with wrenches (n, link, 6, n_vy)."""
        return jacobians.reshape(len(jacobians), -1, 6, jacobians.shape[-1])[:, self._loaded]

    def _flat(self, rows: Sequence[npt.ArrayLike]) -> tuple[tuple[int, ...], list[Array]]:
        """The common leading axes, and arrays with one leading axis."""
        arrays = [np.asarray(row, np.float64) for row in rows]
        lead = self._lead(arrays, self.inputs)
        flat = []
        for (name, shape), array in zip(self.inputs.items(), arrays, strict=True):
            if array.shape != (expected := (*lead, *shape)):
                raise ValueError(f"`{name}` has the shape {array.shape}, expected {expected}")
            flat.append(np.ascontiguousarray(array.reshape(-1, *shape)))
        return lead, flat

    @staticmethod
    def _lead(arrays: Sequence[Any], shapes: Mapping[str, tuple[int, ...]]) -> tuple[int, ...]:
        shape: tuple[int, ...] = tuple(arrays[0].shape)
        return shape[: len(shape) - len(next(iter(shapes.values())))]

    def _asked(self, query: Any, rows: Sequence[Array]) -> Any:
        answer = query.ask(rows, None, self.threads)
        if self.raises and (failed := np.flatnonzero(answer.status)).size:
            raise state_error(int(answer.status[failed[0]]), answer)
        return answer


# --- the table of Jacobians -----------------------------------------------------------------------


class Rule(NamedTuple):
    """A Jacobian: the fields that it needs, and itself from an answer (n, output, input)."""

    fields: tuple[str, ...]
    block: Callable[[External, Any], Array]


def _is(field: str) -> Rule:
    return Rule((field,), lambda _, answer: answer[field])


def _at_actuators(field: str) -> Rule:
    return Rule((field,), lambda of, answer: answer[field][:, of.actuated])


def _of_frames(field: str) -> Rule:
    return Rule((field,), lambda of, answer: _rows(of.shown(answer[field])))


def _forces(fields: tuple[str, ...], times: Callable[[Any, Array], Array]) -> dict[str, Rule]:
    """Rules of A τ_y, where τ_y = M_y ÿ − Jᵀ w + …: A M_y by ÿ, −A Jᵀ by wrenches w."""

    def by_wrenches(of: External, answer: Any) -> Array:
        return -times(answer, _rows(of.loaded(answer["jacobian_independent"])).swapaxes(1, 2))

    return {
        "ydd": Rule((*fields, "M_y"), lambda _, answer: times(answer, answer["M_y"])),
        "wrenches": Rule((*fields, "jacobian_independent"), by_wrenches),
    }


def _to_actuators(answer: Any, forces: Array) -> Array:
    """τ_u of least length with G_uᵀ τ_u nearest to the forces."""
    shares = _inverse(answer["G_u"].swapaxes(1, 2))
    return shares @ forces


def _unactuated(answer: Any, forces: Array) -> Array:
    given: Array = answer["G_u"].swapaxes(1, 2) @ _to_actuators(answer, forces)
    return forces - given


def _pose(of: External, answer: Any) -> Array:
    """Positions move by v, quaternions x by ½ ω ⊗ x."""
    jacobian = of.shown(answer["jacobian_independent"])
    turns = _turns(answer["frame_pose"][:, of.frames, 3:], -1.0) @ jacobian[:, :, :3]
    return _rows(np.concatenate([jacobian[:, :, 3:], turns], axis=2))


def _tree(of: External, answer: Any) -> Array:
    """Tree coordinates move by G ẏ; those of floating and ball joints follow from their turns."""
    return _lift(of.tree, answer["q"], answer["G"])


_ACCELERATION = _forces(("M_y",), lambda answer, forces: -_inverse(answer["M_y"]) @ forces)
RULES: dict[str, dict[str, Rule]] = {
    "tau_y": {"y": _is("dtau_y_dy"), "yd": _is("dtau_y_dyd"), **_forces((), lambda _, x: x)},
    "tau_u": {
        "y": _is("dtau_u_dy"),
        "yd": _is("dtau_u_dyd"),
        **_forces(("G_u",), _to_actuators),
    },
    "tau_unactuated": {
        "y": _is("dtau_unactuated_dy"),
        "yd": _is("dtau_unactuated_dyd"),
        **_forces(("G_u",), _unactuated),
    },
    "ydd": {
        "y": _is("dydd_dy"),
        "yd": _is("dydd_dyd"),
        "tau_u": _is("dydd_dtau_u"),
        "tau_y": Rule(("M_y",), lambda _, answer: _inverse(answer["M_y"])),
        "wrenches": _ACCELERATION["wrenches"],
    },
    "q": {"y": Rule(("q", "G"), _tree)},
    "qd": {"y": _is("Gd"), "yd": _is("G")},
    "qdd": {"y": _is("dqdd_dy"), "yd": _is("dg_bias_dyd"), "ydd": _is("G")},
    "u": {"y": _is("G_u")},
    "ud": {"y": _at_actuators("Gd"), "yd": _is("G_u")},
    "udd": {
        "y": _at_actuators("dqdd_dy"),
        "yd": _at_actuators("dg_bias_dyd"),
        "ydd": _is("G_u"),
    },
    "frame_pose": {"y": Rule(("frame_pose", "jacobian_independent"), _pose)},
    "frame_twist": {
        "y": _of_frames("djacobian_dy"),
        "yd": _of_frames("jacobian_independent"),
    },
    "com": {"y": _is("com_jacobian")},
}
"""The Jacobians of each output by the inputs that it depends on."""
OF_ONE_FREEDOM = {("qd", "y"), ("ud", "y")}
"""Jacobians that are these fields only where every joint has one freedom."""


def _refuse(inputs: Sequence[str], outputs: Sequence[str]) -> None:
    """Refuse fields without a rule, and outputs that depend on fields which are not given."""
    by = {name for rules in RULES.values() for name in rules}
    for names, known, word in ((outputs, RULES, "of"), (inputs, by, "by")):
        if unknown := ", ".join(name for name in names if name not in known):
            raise QueryError(
                f"no Jacobians {word} {unknown}; there are those {word} {', '.join(sorted(known))}"
            )
    for output in outputs:
        needed = {"y", "yd", "ydd"}.intersection(RULES[output])
        if absent := ", ".join(sorted(needed.difference(inputs))):
            raise QueryError(f"`{output}` depends on {absent}; give it too")


# --- matrices and quaternions ---------------------------------------------------------------------


def _rows(blocks: Array) -> Array:
    """Join the rows of all frames."""
    return blocks.reshape(len(blocks), -1, blocks.shape[-1])


def _inverse(matrices: Array) -> Array:
    """Inverses, pseudo-inverses where not square, NaN of states without an answer."""
    inverse = np.full_like(matrices.swapaxes(1, 2), np.nan)
    good = np.isfinite(matrices).all((1, 2))
    square = matrices.shape[1] == matrices.shape[2]
    inverse[good] = (np.linalg.inv if square else np.linalg.pinv)(matrices[good])
    return inverse


def _turns(quaternion: Array, side: float) -> Array:
    """½ x ⊗ ω of a quaternion x y z w as a matrix (…, 4, 3); with the side −1 it is ½ ω ⊗ x."""
    x, y, z, w = np.moveaxis(0.5 * quaternion, -1, 0)
    a, b, c = side * x, side * y, side * z
    rows = [[w, -c, b], [c, w, -a], [-b, a, w], [-x, -y, -z]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def _rotation(quaternion: Array) -> Array:
    """The matrix (…, 3, 3) of a unit quaternion x y z w."""
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), w * w - x * x + y * y - z * z, 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def _blocks(names: Sequence[str]) -> list[tuple[slice, slice]]:
    """The places of each joint's coordinates and of its velocities."""
    found, at, rate = [], 0, 0
    while at < len(names):
        # a floating joint has x y z before its quaternion
        joint = names[at].rsplit("/", 1)[0]
        quaternion = [f"{joint}/q{axis}" for axis in "xyzw"]
        width, freedoms = 1, 1
        for before, of_joint in ((0, (4, 3)), (3, (7, 6))):
            if [*names[at + before : at + before + 4]] == quaternion:
                width, freedoms = of_joint
        found.append((slice(at, at + width), slice(rate, rate + freedoms)))
        at, rate = at + width, rate + freedoms
    return found


def _lift(names: Sequence[str], numbers: Array, rates: Array) -> Array:
    """Turn velocities (n, n_v, k) into rates of the coordinates (n, n_q, k)."""
    parts = []
    for place, rate in _blocks(names):
        part, x = rates[:, rate], numbers[:, place]
        if x.shape[1] == 7:
            parts.append(_rotation(x[:, 3:]) @ part[:, 3:])
        parts.append(part if x.shape[1] == 1 else _turns(x[:, -4:], 1.0) @ part[:, :3])
    return np.concatenate(parts, axis=1)


def _lower(names: Sequence[str], numbers: Array, by_rates: Array) -> Array:
    """Turn derivatives by velocities (n, k, n_v) into those by the coordinates (n, k, n_q).

    A quaternion is taken as normalised: along itself the derivative is zero.
    """
    parts = []
    for place, rate in _blocks(names):
        part, x = by_rates[:, :, rate], numbers[:, place]
        if x.shape[1] == 7:
            parts.append(part[:, :, 3:] @ _rotation(x[:, 3:]).swapaxes(1, 2))
        if x.shape[1] == 1:
            parts.append(part)
        else:
            parts.append(part[:, :, :3] @ (4.0 * _turns(x[:, -4:], 1.0)).swapaxes(1, 2))
    return np.concatenate(parts, axis=2)
