"""The search for a motion that excites a robot's base parameters; see `sarrus.excite`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from sarrus.query import Array
from sarrus.status import Status, Warnings

if TYPE_CHECKING:
    from sarrus.robot import Robot

# part that a scaled column adds to the others below which the motion does not excite it, as in
# `sarrus.identify`
EXCITED = 1e-7
# rows in the period of the highest harmonic at which limits are checked, and times as many at last
ROWS, FINER = 64, 4
# rows at which a motion is judged
JUDGED = 400
# poses that walk through the limits, and their steps for each joint
WALKERS, STEPS = 64, 8
# factors of the amplitudes, and of the coefficients of a varied motion
SHRINK, GROW, VARY, ALONE = 0.8, 1.25, 0.6, 3.0

Motion = tuple[Array, Array, Array]
Rows = npt.NDArray[np.bool_]


class Limits:
    """The limits of a robot's motion."""

    def __init__(
        self,
        robot: Robot,
        share: float,
        reach: Mapping[str, tuple[float, float]],
        threads: int | None,
    ) -> None:
        """Refuse robots that cannot be excited."""
        self.robot, self.share, self.threads = robot, share, threads
        names = list(robot.independents)
        if names != list(robot.independent_coordinates):
            plain = set(robot.independent_coordinates)
            found = dict.fromkeys(name.rsplit("/", 1)[0] for name in names if name not in plain)
            words = f"found the ball or floating joint {', '.join(found)}"
            raise ValueError(f"{words}, expected joints with one coordinate")
        if not names or len(robot.actuators) < len(names):
            words = f"{len(robot.actuators)} actuators for {len(names)} independent joints"
            raise ValueError(f"found {words}, expected at least one for each")
        self.low, self.high = _positions(robot, share, reach)
        self.velocity = share * robot.limits["velocity"]
        self.single = [k for k, name in enumerate(robot.joints) if name in set(robot.coordinates)]
        self.of_q = [robot.coordinates.place(robot.joints[k]) for k in self.single]
        self.independent = [robot.joints.place(name) for name in names]
        missing = [
            name
            for name, k in zip(names, self.independent, strict=True)
            if not np.isfinite([self.low[k], self.high[k]]).all()
        ]
        if missing:
            words = f"found no limits of position of {', '.join(missing)}"
            raise ValueError(f"{words}: give `reach={{'{missing[0]}': (LOW, HIGH), …}}`")
        given, want = ["y", "yd", "ydd"], ["q", "qd", "tau_u", "margin"]
        self.checked = robot.query("inverse-dynamics", given, want, friction=True)
        self.regressor = robot.query("inverse-dynamics", given, ["regressor_u"])
        self.of_model = robot.query("inverse-dynamics", ["y"], ["base_parameters"])
        self.base: list[int] = []

    def hold(self, motion: Motion) -> Rows:
        """Tell for each row whether the loops close and all limits hold."""
        answer = self.checked.ask(motion, None, self.threads)
        good: Rows = np.equal(answer.status, Status.ok)
        good &= np.bitwise_and(answer.warnings, int(Warnings.limits_exceeded)) == 0
        q, rates = answer["q"][:, self.of_q], np.abs(answer["qd"])
        low, high = self.low[self.single], self.high[self.single]
        with np.errstate(invalid="ignore"):
            good &= ((low <= q) & (q <= high)).all(axis=1) & (rates <= self.velocity).all(axis=1)
            # no number where no force is needed, or nothing limits it
            good &= ~(np.reshape(answer["margin"], len(good)) < 1 / self.share)
        return good

    def judge(self, motion: Motion) -> tuple[int, float]:
        """Give the number of base parameters that are not excited, and the condition number."""
        if not self.base:
            values = self.of_model.ask([motion[0][0]])["base_parameters"]
            self.base = np.flatnonzero(np.isfinite(values)).tolist()
        columns = self.regressor.ask(motion, None, self.threads)["regressor_u"][..., self.base]
        return judged(columns.reshape(-1, len(self.base)))


def _positions(
    robot: Robot, share: float, reach: Mapping[str, tuple[float, float]]
) -> tuple[Array, Array]:
    """The middle share of the joints' ranges, and within them their reach."""
    low, high = robot.limits["lower"].copy(), robot.limits["upper"].copy()
    bounded = np.isfinite(low) & np.isfinite(high)
    cut = (1 - share) / 2 * (high[bounded] - low[bounded])
    low[bounded] += cut
    high[bounded] -= cut
    plain = set(robot.coordinates)
    for name, (lower, upper) in reach.items():
        if name not in robot.joints or name not in plain:
            raise ValueError(f"`reach` names `{name}`, expected a joint with one coordinate")
        k = robot.joints.place(name)
        low[k], high[k] = max(low[k], lower), min(high[k], upper)
        if not low[k] < high[k]:
            raise ValueError(f"`reach` of {name} is ({lower}, {upper}), expected a range in limits")
    return low, high


def judged(columns: Array) -> tuple[int, float]:
    """Count columns that the others tell; condition number of the rest, scaled to length one."""
    sizes = np.linalg.norm(columns, axis=0)
    r: Array = np.asarray(np.linalg.qr(columns / np.where(sizes > 0, sizes, 1.0), mode="r"))
    values = np.linalg.svd(r, compute_uv=False)
    if len(values) == columns.shape[1] and values[-1] > 10 * EXCITED:
        return 0, float(values[0] / values[-1])
    # pivots: the column that adds most to those before it
    rest, kept = r.copy(), []
    for _ in range(rest.shape[1]):
        added = np.linalg.norm(rest, axis=0)
        k = int(np.argmax(added))
        if added[k] <= EXCITED:
            break
        kept.append(k)
        along = rest[:, k] / added[k]
        rest -= np.outer(along, along @ rest)
        rest[:, k] = 0.0
    condition = np.linalg.cond(r[:, kept]) if kept else 1.0
    return columns.shape[1] - len(kept), float(condition)


class Search:
    """The best motion so far."""

    def __init__(
        self, limits: Limits, seconds: float, harmonics: int, random: np.random.Generator
    ) -> None:
        """Find poses within the limits."""
        self.limits, self.seconds, self.random = limits, seconds, random
        self.harmonics = harmonics
        self.low, self.high = (x[limits.independent] for x in (limits.low, limits.high))
        self.times = np.linspace(0.0, seconds, ROWS * harmonics, endpoint=False, dtype=np.float64)
        self.score: tuple[float, float] = (np.inf, np.inf)
        self.poses = self._poses()
        self.coefficients: Array = np.zeros((2, harmonics, len(self.low)))
        self.middle: Array = self.poses[0]

    def draw(self, vary: bool) -> None:
        """Try one motion more, a new one or the best one with a change."""
        n = len(self.low)
        vary = vary and bool(np.isfinite(self.score[0]))
        # sines of equal size of positions, up to velocities
        order = np.arange(1.0, self.harmonics + 1)[:, None]
        phase = self.random.uniform(0.0, 2 * np.pi, (self.harmonics, n))
        size = self.random.uniform(0.5, 1.5, phase.shape) * order ** self.random.uniform(1.0, 2.0)
        change = size * np.array([np.cos(phase), np.sin(phase)])
        if vary:
            old, new = (np.sqrt(np.mean(x**2, (0, 1))) for x in (self.coefficients, change))
            change *= VARY * self.random.uniform() ** 2 * old / new
            # of all joints, or more of one
            if self.random.uniform() < 0.5:
                change *= ALONE * (np.arange(n) == self.random.integers(n))
            coefficients, middle = self.coefficients + change, self.middle
            if self.random.uniform() < 0.2:
                middle = middle + VARY * self.random.uniform() * (self._centre() - middle)
        else:
            coefficients, middle = change, self._centre()
        coefficients = _resting(coefficients)
        most = self._most(coefficients, middle)
        start = np.minimum(1.0, most) if vary else most
        scales = self._scales(coefficients, middle, start, most)
        if scales is None:
            return
        coefficients = scales * coefficients
        times = self.times[:: max(1, len(self.times) // JUDGED)]
        score = self.limits.judge(self._motion(coefficients, middle, times))
        if score < self.score:
            self.score, self.coefficients, self.middle = score, coefficients, middle

    def best(self, times: Array) -> Motion:
        """The best motion at these times; within the limits between those of the search too."""
        if not np.isfinite(self.score[0]):
            raise ValueError("found no motion within the limits: give a smaller `reach`")
        finer = self.times[1] / FINER * np.arange(FINER * len(self.times))
        coefficients = self.coefficients
        while not self._holds(coefficients, self.middle, finer):
            coefficients = 0.99 * coefficients
        return self._motion(coefficients, self.middle, times)

    def _motion(self, coefficients: Array, middle: Array, times: Array) -> Motion:
        """y, ẏ, ÿ of the series."""
        rates = 2 * np.pi / self.seconds * np.arange(1, self.harmonics + 1)
        sine, cosine = np.sin(times[:, None] * rates), np.cos(times[:, None] * rates)
        a, b = coefficients
        y = middle + sine / rates @ a - cosine / rates @ b
        return y, cosine @ a + sine @ b, -(sine * rates) @ a + (cosine * rates) @ b

    def _holds(self, coefficients: Array, middle: Array, times: Array) -> bool:
        return bool(self.limits.hold(self._motion(coefficients, middle, times)).all())

    def _most(self, coefficients: Array, middle: Array) -> Array:
        """Factors with which the joints' series fill their ranges about the middle."""
        y, _, _ = self._motion(coefficients, 0 * middle, self.times)
        up, down = (self.high - middle) / y.max(axis=0), (middle - self.low) / -y.min(axis=0)
        most: Array = np.minimum(up, down)
        return most

    def _scales(
        self, coefficients: Array, middle: Array, start: Array, most: Array
    ) -> Array | None:
        """Factors of amplitudes: smaller for all until limits hold, then larger joint by joint."""
        scales, smallest = start, 1e-3 * start
        while not self._holds(scales * coefficients, middle, self.times):
            scales = SHRINK * scales
            if (scales < smallest).all():
                return None
        for k in np.tile(self.random.permutation(len(middle)), 3):
            more = scales.copy()
            more[k] = min(most[k], GROW * scales[k])
            if more[k] > scales[k] and self._holds(more * coefficients, middle, self.times):
                scales = more
        return scales

    def _rest(self, y: Array) -> Rows:
        """Tell which poses are within the limits at rest."""
        return self.limits.hold((y, 0 * y, 0 * y))

    def _poses(self) -> Array:
        """Poses within the limits: each walks along one joint after the other."""
        n = len(self.low)
        middle = (self.low + self.high) / 2
        start = self.random.uniform(self.low, self.high, (4 * WALKERS, n))
        start[:2] = np.clip(0.0, self.low, self.high), middle
        start = start[self._rest(start)]
        if not len(start):
            raise ValueError("found no pose within the limits: give a `reach` around one")
        poses: Array = start[np.arange(WALKERS) % len(start)]
        every = np.arange(WALKERS)
        for _ in range(STEPS * n):
            k = self.random.integers(0, n, WALKERS)
            moved = poses.copy()
            moved[every, k] = self.random.uniform(self.low[k], self.high[k])
            poses = np.where(self._rest(moved)[:, None], moved, poses)
        return poses

    def _centre(self) -> Array:
        """The mean of some poses, where it is within the limits, else one of them."""
        few = self.poses[self.random.integers(0, WALKERS, self.random.integers(1, 9))]
        mean: Array = few.mean(axis=0)
        pose: Array = mean if self._rest(mean[None])[0] else few[0]
        return pose


def _resting(coefficients: Array) -> Array:
    """The nearest coefficients whose motion begins without velocity and acceleration."""
    a, b = coefficients
    order = np.arange(1.0, len(a) + 1)[:, None]
    return np.array([a - a.mean(axis=0), b - order * (order * b).sum(axis=0) / (order**2).sum()])
