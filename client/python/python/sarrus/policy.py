"""Motors of parallel mechanisms in a policy's simulator, which has serial joints.

`ActuatorPD` is a law of the motors as forces of the joints, with arrays of numpy or tensors of
torch; `bridge_commands` goes the other way, from a policy's targets and gains to the motors;
`judge` compares limits and armatures of serial joints with what the motors can do; `lines` writes
them for a simulator.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from sarrus.errors import QueryError
from sarrus.limits import capability

if TYPE_CHECKING:
    from sarrus.robot import Robot

Array = npt.NDArray[np.float64]
Simulator = Literal["mujoco", "mjlab", "isaaclab"]


class ActuatorPD:
    """The law τ_u = K (u(y*) − u(y)) − D u̇ of each motor, as forces of the joints.

    These are τ_y = G_uᵀ τ_u, with each τ_u within the limits of its motor.
    `stiffness` and `damping` are those of the motors (n_u, or one number); `effort` are their
    largest forces, those of the model without it. `joints` are the independents in the order of
    the simulator's columns. Called with arrays of numpy it returns one; with tensors of torch, of
    any precision and device, it returns a tensor through which gradients flow: those of the map
    u(y) and of G_u among them. A state that cannot be reached has NaN.

    >>> import sarrus
    >>> law = sarrus.policy.ActuatorPD(sarrus.Robot.bundled("ankle"), 100.0, 2.0)
    >>> law([[0.1, 0.0]], [[0.0, 0.0]], [[0.2, 0.0]]).shape
    (1, 2)
    """

    def __init__(
        self,
        robot: Robot,
        stiffness: npt.ArrayLike,
        damping: npt.ArrayLike,
        *,
        joints: Sequence[str] | None = None,
        effort: npt.ArrayLike | None = None,
    ) -> None:
        names = list(robot.independents)
        if len(robot.coordinates) != len(robot.joints):
            raise QueryError("the robot has a floating or ball joint; load it without, by `only`")
        columns = names if joints is None else list(joints)
        if sorted(columns) != sorted(names):
            raise QueryError(f"joints are {', '.join(columns)}, expected all of {', '.join(names)}")
        self._to_simulator = [names.index(name) for name in columns]
        self._to_model = [columns.index(name) for name in names]
        self._motors = [robot.joints.index(name) for name in robot.actuators]
        n_u = len(self._motors)
        largest = robot.limits["effort"][self._motors]
        # files write zero for a limit that nobody knows
        self.effort: Array = np.where(largest > 0.0, largest, np.inf)
        if effort is not None:
            self.effort = np.broadcast_to(np.asarray(effort, float), n_u).copy()
        self.stiffness: Array = np.broadcast_to(np.asarray(stiffness, float), n_u).copy()
        self.damping: Array = np.broadcast_to(np.asarray(damping, float), n_u).copy()
        self._map = robot.query("kinematics", ["y"], ["u", "G_u"])
        self._slopes = robot.query("map", ["y", "tau_u", "gains_u"], ["gains_y"])
        self._rate = robot.query("kinematics", ["y", "yd"], ["Gd"])

    def __call__(self, y: Any, yd: Any, target: Any) -> Any:
        """Give τ_y of rows of states and targets (n, n_vy)."""
        if hasattr(y, "requires_grad"):
            return _tensors(self, y, yd, target)
        rows = [np.atleast_2d(np.asarray(x, float))[:, self._to_model] for x in (y, yd, target)]
        tau_y: Array = self._forward(*rows)[0][:, self._to_simulator]
        return tau_y if np.ndim(y) > 1 else tau_y[0]

    def motor_forces(self, y: npt.ArrayLike, yd: npt.ArrayLike, target: npt.ArrayLike) -> Array:
        """Give τ_u of the motors in the order of the model (n, n_u)."""
        rows = [np.atleast_2d(np.asarray(x, float))[:, self._to_model] for x in (y, yd, target)]
        return self._forward(*rows)[1]

    def _forward(self, y: Array, yd: Array, target: Array) -> tuple[Array, Array, Array, Array]:
        """τ_y, τ_u, whether a motor is within its limits, and G_u."""
        here = self._map(y=y)
        there = self._map(y=target)
        speed = np.einsum("nuk,nk->nu", here.G_u, yd)
        wanted = self.stiffness * (there.u - here.u) - self.damping * speed
        tau_u = np.clip(wanted, -self.effort, self.effort)
        return np.einsum("nuk,nu->nk", here.G_u, tau_u), tau_u, wanted == tau_u, here.G_u

    def _backward(self, saved: Sequence[Array], grad: Array) -> tuple[Array, Array, Array]:
        """Gradients by y, ẏ and the target of gradᵀ τ_y."""
        y, yd, target, tau_u, within, g_u = saved
        stiffness, damping = self.stiffness * within, self.damping * within
        gains = self._slopes(y=y, tau_u=tau_u, gains_u=np.stack([stiffness, damping], 2)).gains_y
        n = y.shape[1]
        # u̇ changes with y too: by Ġ_u, whose columns are those of ∂u̇/∂y
        motors = np.einsum("nuk,nk->nu", g_u, grad)
        turned = self._rate(y=y, yd=yd).Gd[:, self._motors]
        by_y = -np.einsum("nkl,nk->nl", gains[:, :, :n], grad)
        by_y -= np.einsum("nuk,nu->nk", turned, damping * motors)
        by_yd = -np.einsum("nkl,nk->nl", gains[:, :, n : 2 * n], grad)
        by_target = np.einsum("nuk,nu->nk", self._map(y=target).G_u, stiffness * motors)
        return by_y, by_yd, by_target


def _tensors(law: ActuatorPD, y: Any, yd: Any, target: Any) -> Any:
    """Call a law with tensors of torch."""
    torch: Any = importlib.import_module("torch")

    def forward(ctx: Any, *given: Any) -> Any:
        rows = [x.detach().double().cpu().numpy()[:, law._to_model] for x in given]
        tau_y, *saved = law._forward(*rows)
        ctx.rows = [*rows, *saved]
        return torch.as_tensor(tau_y[:, law._to_simulator]).to(given[0])

    def backward(ctx: Any, grad: Any) -> Any:
        rows = grad.double().cpu().numpy()[:, law._to_model]
        by = law._backward(ctx.rows, rows)
        return tuple(torch.as_tensor(x[:, law._to_simulator]).to(grad) for x in by)

    once = torch.autograd.function.once_differentiable
    ways = {"forward": staticmethod(forward), "backward": staticmethod(once(backward))}
    law_of_torch: Any = type("Law", (torch.autograd.Function,), ways)
    return law_of_torch.apply(y, yd, target)


def bridge_commands(
    robot: Robot,
    y: npt.ArrayLike,
    yd: npt.ArrayLike,
    target: npt.ArrayLike,
    stiffness: npt.ArrayLike,
    damping: npt.ArrayLike,
) -> dict[str, Array]:
    """Give commands of the motors for a policy's joint targets and gains, τ_y = K (y* − y) − D ẏ.

    Position, velocity, effort, stiffness and damping of each motor, as the bridge takes them, for
    one state. Gains of joints couple the motors: a motor has the diagonal of K_u = G_u⁻ᵀ K G_u⁻¹,
    and `effort` makes up the rest, so that the forces are those of the law at this state.
    """
    y, yd, target = (np.asarray(x, float) for x in (y, yd, target))
    n = len(robot.independents)
    gains = [np.broadcast_to(np.asarray(x, float), n) for x in (stiffness, damping)]
    tau_y = gains[0] * (target - y) - gains[1] * yd
    here: Any = robot.to_actuators(y, yd, tau_y=tau_y, stiffness=gains[0], damping=gains[1])
    there = robot.to_actuators(target)
    own = [np.diag(here.stiffness).copy(), np.diag(here.damping).copy()]
    effort = here.tau_u - own[0] * (there.u - here.u) + own[1] * here.ud
    rest = np.zeros_like(effort)
    return {
        "position": there.u,
        "velocity": rest,
        "effort": effort,
        "stiffness": own[0],
        "damping": own[1],
    }


@dataclass(frozen=True)
class Verdict:
    """What a serial joint is given, and what the motors can do at the worst of the poses."""

    joint: str
    what: str
    """`effort`, `velocity` or `armature`."""
    given: float
    able: float
    """What the motors can do there with the other joints free of force, or at rest; or have."""
    at: dict[str, float]

    @property
    def ratio(self) -> float:
        """`given` over `able`."""
        return self.given / self.able if self.able else np.inf

    def __str__(self) -> str:
        where = ", ".join(f"{name} {x:.3g}" for name, x in self.at.items())
        do = "the rotors have" if self.what == "armature" else "the motors can do"
        return f"{self.what} of {self.joint} is {self.ratio:.3g} times what {do} at {where}"


def judge(
    robot: Robot,
    joints: Sequence[str] = (),
    *,
    effort: npt.ArrayLike | None = None,
    velocity: npt.ArrayLike | None = None,
    armature: npt.ArrayLike | None = None,
    grid: int | None = None,
) -> list[Verdict]:
    """Compare numbers of serial joints with those of the motors, at the worst pose of each joint.

    `effort`, `velocity` and `armature` are those of `joints` in the order of the model; poses are
    those that the mechanism reaches of a grid over the ranges of the joints. `ValueError`: a joint
    has no reachable pose with such a number.
    """
    maps = capability(robot, joints, grid=grid)
    names = [name for of in maps for name in of.joints]
    verdicts = []
    given = (("effort", effort), ("velocity", velocity), ("armature", armature))
    for what, numbers in given:
        if numbers is None:
            continue
        rows = np.broadcast_to(np.asarray(numbers, float), len(names))
        each = dict(zip(names, rows, strict=True))
        for of in maps:
            able = {
                "effort": of.torque_alone,
                "velocity": of.speed_max,
                "armature": np.einsum("nkk->nk", of.reflected_inertia),
            }[what]
            for k, joint in enumerate(of.joints):
                here = np.where(of.reachable, able[:, k], np.nan)
                if np.isnan(here).all():
                    raise ValueError(f"no pose has a number for {what} of {joint}")
                # too much is the fault of limits; of an armature, too little too
                with np.errstate(divide="ignore"):
                    far = each[joint] / here
                    far = np.abs(np.log(far)) if what == "armature" else far
                worst = int(np.nanargmax(far))
                at = dict(zip(of.joints, of.points[worst].tolist(), strict=True))
                value = float(here[worst])
                verdicts.append(Verdict(joint, what, float(each[joint]), value, at))
    return verdicts


def lines(robot: Robot, simulator: Simulator, at: npt.ArrayLike | None = None) -> str:
    """Write armature and limits of the serial joints at a pose, at zero without it.

    Effort and velocity are those with the other joints free of force or at rest. A simulator has
    one number a joint: what it leaves out of the coupled motors, `judge` and `ActuatorPD` have.
    """
    y = np.zeros(len(robot.independents)) if at is None else np.asarray(at, float)
    n = len(y)
    state = robot.query("kinematics", ["y"], ["G_u", "reflected_inertia"])(y=y)
    armature = np.diag(state.reflected_inertia)
    largest = {k: robot.limits[k] for k in ("effort", "velocity")}
    motors = [robot.joints.index(name) for name in robot.actuators]
    alone = robot.query("map", ["y", "tau_y"], ["margin"])
    rows = alone(y=np.tile(y, (n, 1)), tau_y=np.eye(n)).margin
    with np.errstate(divide="ignore"):
        speed = (largest["velocity"][motors][:, None] / np.abs(state.G_u)).min(0)
    found = zip(robot.independents, armature, rows, speed, strict=True)
    number = "{:.6g}".format
    text = {
        "mujoco": '<joint name="{}" armature="{}" actuatorfrcrange="-{} {}"/>',
        "mjlab": 'BuiltinPositionActuatorCfg(target_names_expr=("{}",), armature={}, '
        "effort_limit={}, stiffness=…, damping=…)",
        "isaaclab": '"{}": ImplicitActuatorCfg(joint_names_expr=["{}"], armature={}, '
        "effort_limit_sim={}, velocity_limit_sim={}, stiffness=…, damping=…)",
    }[simulator]
    written = []
    for name, inertia, force, most in found:
        numbers = [number(x) for x in (inertia, force, most)]
        fill = {
            "mujoco": [name, numbers[0], numbers[1], numbers[1]],
            "mjlab": [name, *numbers[:2]],
            "isaaclab": [name, name, *numbers],
        }[simulator]
        written.append(text.format(*fill))
    return "\n".join(written)
