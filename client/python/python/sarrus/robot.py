"""A robot in this process or on a server, with the same methods."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from sarrus import _native, convert, descriptions
from sarrus.errors import LoadError, QueryError, StateWarning
from sarrus.options import GRAVITY, contents, parts
from sarrus.page import Page
from sarrus.query import Answer, Array, AxesName, Progress, Query, RequestName
from sarrus.results import Actuators, Frames, Independents, State
from sarrus.simulation import Constant, Gains, Method, Simulation, Table
from sarrus.status import Status, Warnings
from sarrus.tasks import TaskRobot


class Robot(TaskRobot):
    """A robot of `Robot.bundled`, `.load`, `.description`, `.from_text` or `.connect`.

    `Robot(urdf, submechanisms)` is `Robot.load`.

    `y` are the independent coordinates, `u` the actuators, `q` the spanning tree; the suffixes `d`
    and `dd` denote their rates. Units are SI and radians. An array with one dimension is one state,
    an array of rows a batch of states, with the same bits.
    """

    # notes of a conversion by another process
    _converted: Sequence[str] = ()

    @cached_property
    def reader_notes(self) -> list[str]:
        """Choices of the files' reader, and parts without influence on the dynamics, a line each.

        The files are read again. Of a server's robot there are none.
        """
        return [*self._converted, *([] if self.is_connected else self.origin.notes())]

    # --- constructors -----------------------------------------------------------------------------

    def __new__(
        cls,
        urdf: str | os.PathLike[str] | _native.Origin,
        submechanisms: str | os.PathLike[str] | None = None,
        **options: Any,
    ) -> Robot:
        """Load a robot from its files: the same as `Robot.load`."""
        if isinstance(urdf, _native.Origin):
            return super().__new__(cls, urdf)
        return cls.load(urdf, submechanisms, **options)

    @classmethod
    def bundled(
        cls,
        name: str,
        *,
        gravity: Sequence[float] = GRAVITY,
        lenient: bool = False,
        floating_base: bool | str = False,
        lock: Mapping[str, float | None] | Sequence[str] = (),
        only: Sequence[str] = (),
    ) -> Robot:
        """Load a bundled robot; `sarrus.bundled()` has the names."""
        options = parts(gravity, lenient, floating_base, lock, only)
        return cls(_native.Origin.bundled(name, options))

    @classmethod
    def load(
        cls,
        urdf: str | os.PathLike[str],
        submechanisms: str | os.PathLike[str] | None = None,
        *,
        gravity: Sequence[float] = GRAVITY,
        lenient: bool = False,
        floating_base: bool | str = False,
        lock: Mapping[str, float | None] | Sequence[str] = (),
        only: Sequence[str] = (),
    ) -> Robot:
        """Load a robot from its files into this process.

        Without a submechanism file every joint is independent and active; a file of MJCF or SDF in
        place of the URDF, YAML of Gepetto's tools, Lua of RBDL or USD holds both. `gravity` is in
        root axes [m/s²]; with `lenient` faults of inertia and effects that are not modelled are
        warnings; `floating_base` hangs the root on a free joint; `lock` fixes joints at a position
        or at zero; `only` keeps these links and the links that their motion depends on. A
        `LoadError` has every fault of the files; a `ModuleNotFoundError` names the package that
        reads Lua (`lupa`) or USD (`usd-core`).
        """
        options = parts(gravity, lenient, floating_base, lock, only)
        if convert.reads(urdf):
            text, said = convert.text(urdf, lenient=lenient)
            tree, loops, notes = _native.imported(urdf, text, lenient)
            if submechanisms is not None:
                tree, loops, notes = text, Path(submechanisms).read_bytes(), []
            robot = cls(_native.Origin.text(tree, loops, options))
            robot._converted = said + notes
            return robot
        return cls(_native.Origin.files(urdf, submechanisms, options))

    @classmethod
    def description(
        cls, name: str, submechanisms: str | os.PathLike[str] | None = None, **options: Any
    ) -> Robot:
        """Load a description of the package `robot_descriptions`, as `g1_description`.

        Otherwise like `Robot.load`. The package downloads files that it does not have yet. Without
        it the error is a `ModuleNotFoundError`, without a description of this name a `LoadError`.
        """
        return cls.load(descriptions.file(name), submechanisms, **options)

    @classmethod
    def from_text(
        cls,
        urdf: str | bytes,
        submechanisms: str | bytes | None = None,
        *,
        gravity: Sequence[float] = GRAVITY,
        lenient: bool = False,
        floating_base: bool | str = False,
        lock: Mapping[str, float | None] | Sequence[str] = (),
        only: Sequence[str] = (),
    ) -> Robot:
        """Load a robot from the contents of its files; otherwise like `Robot.load`."""
        options = parts(gravity, lenient, floating_base, lock, only)
        texts = contents(urdf), None if submechanisms is None else contents(submechanisms)
        return cls(_native.Origin.text(*texts, options))

    @classmethod
    def connect(
        cls,
        name: str,
        *,
        timeout: float = 1.0,
        deadline: float | None = None,
        transport: str = "lane",
        wait: str = "auto",
        fingerprint: int | None = None,
    ) -> Robot:
        """Connect to a server on this machine, started by `sarrus serve --name NAME`.

        A call waits at most `timeout` [s], also for the return of a lost server. Ctrl-C ends the
        wait, and the next call connects again. Answers later than `deadline` [s] are `late`.
        `transport` is `lane` or `service`, `wait` is `auto`, `busy` or `polite`. A model without
        this `fingerprint` is refused. The message of a `ConnectError` names the remedy.
        """
        origin = _native.Origin.served(name, timeout, deadline, transport, wait, fingerprint)
        return cls(origin)

    # --- pictures ---------------------------------------------------------------------------------

    def show(self, *, swing: bool = False) -> Page:
        """Show the robot with sliders that move it: in a notebook where this is a cell's value.

        The page has its own code and needs neither Python nor a network; with `swing` the robot
        moves at once. `ValueError`: no straight-line code answers for the robot.
        """
        return Page(self._page(swing))

    def save_page(self, path: str | os.PathLike[str], *, swing: bool = False) -> None:
        """Write the page of `show` to a file, for any browser."""
        Path(path).write_text(self._page(swing), encoding="utf-8")

    # --- requests ---------------------------------------------------------------------------------

    def query(
        self,
        request: RequestName,
        given: Sequence[str],
        want: Sequence[str] | None = None,
        *,
        frames: Sequence[str] = (),
        joints: Sequence[str] | None = None,
        wrenches: Sequence[str] = (),
        checksum: bool = False,
        search: bool = False,
        loop_tolerance: float | None = None,
        projection_tolerance: float | None = None,
        axes: AxesName = "mixed",
        relative_to: str | None = None,
        directions: int = 0,
        friction: bool = False,
        tasks: Sequence[int] | None = None,
    ) -> Query:
        """Prepare a query of any fields, by the names of `sarrus ask`.

        `given` and `want` are names of fields, such as `y` and `tau_u`; the default of `want`
        depends on the request. `frames` and `wrenches` are names of links, `joints` names or
        patterns (`AL*`) of the wanted rows. Twists, accelerations and Jacobians of frames are in
        root axes at the frame's origin (`axes="mixed"`), in root axes at the root's origin
        ("world") or in the frame's axes ("local"); the link `relative_to` takes the root's
        place; `directions` is the number of rows of the field of
        that name, which it adds to `given`; with `friction` forces count
        the friction of joints. `tasks` has the bits of the parts of each of `frames`: 1 position, 2
        orientation, 4 direction of z, 8 after the others, 16 held. A `QueryError` has every unknown
        name. The work of a state is bounded; with `search` loops are followed, and `nearest_y` is
        sought, as long as it takes.

        >>> import sarrus
        >>> robot = sarrus.Robot.bundled("lambda")
        >>> terms = robot.query("inverse-dynamics", ["y", "yd"], ["M_y", "C_y"])
        >>> terms(y=[0.2], yd=[1.0]).M_y.shape
        (1, 1)
        """
        return Query(
            self._prepare(
                request,
                list(given),
                None if want is None else list(want),
                list(frames),
                None if joints is None else list(joints),
                list(wrenches),
                checksum,
                search,
                loop_tolerance,
                projection_tolerance,
                axes,
                relative_to,
                directions,
                friction,
                None if tasks is None else bytes(tasks),
            )
        )

    def state(
        self,
        y: npt.ArrayLike,
        yd: npt.ArrayLike | None = None,
        ydd: npt.ArrayLike | None = None,
        *,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> State:
        """Give the whole tree's motion with all loops closed: q, q̇ = G ẏ, q̈ = G ÿ + g.

        `y` [m, rad] (n_qy), `yd` and `ydd` (n_vy), zero by default.
        """
        given = self._motion(y, yd, ydd)
        query = self._cached("kinematics", ("y", "yd", "ydd"), ("q", "qd", "qdd"))
        return State(**_warned(query.ask(given, None, threads, progress)))

    def frames(
        self,
        links: str | Sequence[str],
        y: npt.ArrayLike,
        yd: npt.ArrayLike | None = None,
        ydd: npt.ArrayLike | None = None,
        *,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Frames:
        """Give poses, twists and accelerations of links.

        `y` [m, rad] (n_qy), `yd` and `ydd` (n_vy), zero by default.

        A pose is [x, y, z, qx, qy, qz, qw] in the root frame: position [m], then the quaternion in
        the order x, y, z, w. A twist is [ω; v] [rad/s, m/s]: the angular velocity first, world
        axes, v at the origin of the frame. An acceleration is [ω̇; v̇] [rad/s², m/s²] in the same
        frame: the classical acceleration, without gravity.
        """
        given = self._motion(y, yd, ydd)
        names = (links,) if isinstance(links, str) else tuple(links)
        want = ("frame_pose", "frame_twist", "frame_acc")
        query = self._cached("kinematics", ("y", "yd", "ydd"), want, names)
        answer = _warned(query.ask(given, None, threads, progress))
        fields = [answer[name] for name in want]
        if isinstance(links, str):
            fields = [field[..., 0, :] for field in fields]
        return Frames(*fields)

    def jacobian(
        self,
        link: str,
        y: npt.ArrayLike,
        *,
        columns: str = "independent",
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Array:
        """Give the Jacobian of a link's frame: its twist `[ω; v]` is J ẏ, in world axes (6, n_vy).

        `columns` are those of the velocities `independent`, `tree` (n_v) or `actuator` (n_u).
        """
        if columns not in ("independent", "tree", "actuator"):
            raise QueryError(f"columns are independent, tree or actuator, not `{columns}`")
        field = f"jacobian_{columns}"
        query = self._cached("kinematics", ("y",), (field,), (link,))
        jacobian: Array = _warned(query.ask([y], None, threads, progress))[field]
        return jacobian[..., 0, :, :]

    def mass_matrix(
        self,
        y: npt.ArrayLike,
        *,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Array:
        """Give the reduced mass matrix M_y = GᵀMG (n_vy, n_vy)."""
        query = self._cached("inverse-dynamics", ("y",), ("M_y",))
        mass_matrix: Array = _warned(query.ask([y], None, threads, progress))["M_y"]
        return mass_matrix

    def bias_force(
        self,
        y: npt.ArrayLike,
        yd: npt.ArrayLike | None = None,
        *,
        threads: int | None = None,
        progress: Progress | None = None,
    ) -> Array:
        """Give the reduced bias force C_y: velocity terms, gravity, springs in joints (n_vy)."""
        query = self._cached("inverse-dynamics", ("y", "yd"), ("C_y",))
        given = [y, self._zeros(y) if yd is None else yd]
        bias_force: Array = _warned(query.ask(given, None, threads, progress))["C_y"]
        return bias_force

    def to_actuators(
        self,
        y: npt.ArrayLike,
        yd: npt.ArrayLike | None = None,
        ydd: npt.ArrayLike | None = None,
        *,
        tau_y: npt.ArrayLike | None = None,
        stiffness: npt.ArrayLike | None = None,
        damping: npt.ArrayLike | None = None,
    ) -> Actuators:
        """Map motion, forces and gains from the independents to the actuators.

        u̇ = G_u ẏ, ü = G_u ÿ + g_u, τ_y = G_uᵀ τ_u. `stiffness` and `damping` are diagonals (n_vy)
        or matrices (n_vy, n_vy) of a law τ_y = K δy + D δẏ; the actuators' matrices K_u with K =
        G_uᵀ K_u G_u give the same law, τ_u = K_u δu + D_u δu̇, near this pose.
        """
        gains = _gains(stiffness, damping, len(self.independents))
        if gains and len(self.actuators) < len(self.independents):
            raise QueryError(
                f"{len(self.actuators)} actuators make no gains of {len(self.independents)} "
                "independents; give those of `to_independent`"
            )
        rest = self._zeros(y) if ydd is not None else None
        # forces decide whether actuators and independents determine each other
        forces = self._zeros(y) if gains and tau_y is None else tau_y
        given = {"y": y, "yd": _or(yd, rest), "ydd": ydd, "tau_y": forces}
        answer = self._mapped(given, ("u", "ud", "udd", "tau_u"), bool(gains))
        through = self._inverse(answer) if gains else None
        fields: list[Any] = [answer.get(name) for name in ("u", "ud", "udd", "tau_u")]
        fields[1] = None if yd is None else fields[1]
        fields[3] = None if tau_y is None else fields[3]
        return Actuators(*fields, *(_taken(gains.get(k), through) for k in GAINS))

    def to_independent(
        self,
        u: npt.ArrayLike,
        ud: npt.ArrayLike | None = None,
        udd: npt.ArrayLike | None = None,
        *,
        tau_u: npt.ArrayLike | None = None,
        stiffness: npt.ArrayLike | None = None,
        damping: npt.ArrayLike | None = None,
    ) -> Independents:
        """Map motion, forces and gains from the actuators to the independents.

        The inverse of `to_actuators`, from the pose where all coordinates are zero; gains are
        K = G_uᵀ K_u G_u.
        """
        gains = _gains(stiffness, damping, len(self.actuators))
        rest = np.zeros(np.shape(u)) if udd is not None else None
        given = {"u": u, "ud": _or(ud, rest), "udd": udd, "tau_u": tau_u}
        answer = self._mapped(given, ("y", "yd", "ydd", "tau_y"), bool(gains))
        through = answer.get("G_u")
        fields: list[Any] = [answer.get(name) for name in ("y", "yd", "ydd", "tau_y")]
        fields[1] = None if ud is None else fields[1]
        return Independents(*fields, *(_taken(gains.get(k), through) for k in GAINS))

    def simulate(
        self,
        duration: float,
        y: npt.ArrayLike,
        yd: npt.ArrayLike | None = None,
        *,
        tau_u: npt.ArrayLike | None = None,
        tau_y: npt.ArrayLike | None = None,
        inputs: Sequence[Constant | Table | Gains] = (),
        method: Method = "dop853",
        step: float | None = None,
        every: float | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-8,
        friction: bool = False,
        limits: bool = False,
        stops: float | None = None,
        progress: Callable[[float, float], object] | None = None,
    ) -> Simulation:
        """Simulate the robot for a time [s] from a state; without `yd` it starts at rest.

        Forces are constant by `tau_u` (n_u) or `tau_y` (n_vy), or `inputs`. `method` is `euler` or
        `rk4` with a fixed `step` [s], or `dop853` or, for stiff problems, `radau5` with step
        control. Every step is a sample, or one per `every` [s]. With `friction` that of joints
        counts; with `limits` actuators give what they can; `stops` is the stiffness of stops at the
        limits of joints [N m/rad, N/m]; events name both. Ctrl-C ends it; `progress` gets the
        current time and the duration.
        """
        if self.is_connected:
            raise QueryError("a server does not simulate; load the robot's files by `Robot.load`")
        all_inputs = list(inputs)
        if tau_u is not None:
            all_inputs.append(Constant("u", tau_u))
        if tau_y is not None:
            all_inputs.append(Constant("y", tau_y))
        sorted_inputs = _sorted(all_inputs)
        settings = (method, duration, step, every, rtol, atol, friction, limits, stops)
        start = _list(y, "y"), _list(self._zeros(y) if yd is None else yd, "yd")
        arrays, (end, _, drift, independents, events) = self._run_simulation(
            *start, sorted_inputs, settings, progress
        )
        return Simulation(
            **arrays, end=end, drift=drift, independents=tuple(independents), events=tuple(events)
        )

    # --- within -----------------------------------------------------------------------------------

    @cached_property
    def _queries(self) -> dict[Any, Query]:
        return {}

    def _cached(
        self,
        request: RequestName,
        given: tuple[str, ...],
        want: tuple[str, ...],
        frames: tuple[str, ...] = (),
    ) -> Query:
        """Give the query, prepared at its first use."""
        key = (request, given, want, frames)
        query = self._queries.get(key)
        if query is None:
            query = self._queries[key] = self.query(request, given, want, frames=frames)
        return query

    def _zeros(self, y: npt.ArrayLike) -> Array:
        """Give rates of zero in the shape of these coordinates."""
        return np.zeros((*np.shape(y)[:-1], len(self.independents)))

    def _motion(
        self,
        y: npt.ArrayLike,
        yd: npt.ArrayLike | None,
        ydd: npt.ArrayLike | None,
    ) -> list[npt.ArrayLike]:
        rest = self._zeros(y) if yd is None or ydd is None else None
        return [y, _or(yd, rest), _or(ydd, rest)]

    def _inverse(self, answer: Answer) -> Array:
        """The independents' motion for one of the actuators; NaN in rows without an answer."""
        g_u = answer["G_u"]
        square = len(self.actuators) == len(self.independents)
        inverse = np.full((*g_u.shape[:-2], g_u.shape[-1], g_u.shape[-2]), np.nan)
        good = np.equal(answer.status, Status.ok)
        inverse[good] = np.linalg.inv(g_u[good]) if square else np.linalg.pinv(g_u[good])
        return inverse

    def _mapped(
        self, given: Mapping[str, npt.ArrayLike | None], want: tuple[str, ...], loops: bool
    ) -> Answer:
        """Map the given fields to another space."""
        present = {name: array for name, array in given.items() if array is not None}
        wanted = tuple(b for a, b in zip(given, want, strict=True) if a in present)
        query = self._cached("map", tuple(present), wanted + (("G_u",) if loops else ()))
        # behind `to_actuators` or `to_independent`
        return _warned(query.ask([present[name] for name in query.given]), 4)

    def __reduce__(self) -> tuple[Any, ...]:
        made = (type(self), *self.origin.contents(), self.fingerprint)
        # attributes set by users; its own state is rebuilt
        own = {
            name: value
            for name, value in self.__dict__.items()
            if not isinstance(getattr(type(self), name, None), cached_property)
        }
        return (restored, made, own) if own else (restored, made)


def bundled() -> dict[str, str]:
    """Give the names of the bundled robots, each with a description."""
    return dict(_native.bundled_names())


GAINS = ("stiffness", "damping")


def _warned(answer: Answer, stacklevel: int = 3) -> Answer:
    """Warn of rows without an answer and of answers with warnings, at the caller's line."""
    words = []
    if (failed := np.flatnonzero(answer.status)).size:
        first = int(failed[0])
        words.append(
            f"{failed.size} of {np.size(answer.status)} states have no answer and are NaN, the "
            f"first in row {first}: {Status(int(np.ravel(answer.status)[first])).name}"
        )
    if (warned := np.flatnonzero(answer.warnings)).size:
        first = int(warned[0])
        names = Warnings(int(np.ravel(answer.warnings)[first]))
        rows = np.size(answer.warnings)
        of = f"{warned.size} of {rows} answers have warnings, the first in row {first}"
        words.append(f"{of if np.ndim(answer.warnings) else 'the answer has a warning'}: {names!s}")
    for word in words:
        warnings.warn(word, StateWarning, stacklevel=stacklevel)
    return answer


def restored(
    cls: type[Robot],
    urdf: bytes,
    submechanisms: bytes | None,
    options: _native.Parts,
    fingerprint: int,
) -> Robot:
    """Load a pickled robot and compare its fingerprint."""
    robot = cls(_native.Origin.text(urdf, submechanisms, options))
    if robot.fingerprint != fingerprint:
        raise LoadError(
            f"these files make the model {robot.fingerprint:016x}, expected "
            f"{fingerprint:016x}: they were changed after the robot was loaded, name other files, "
            "or are read by another version of sarrus; load the robot by its files",
            [],
        )
    return robot


def _or(array: npt.ArrayLike | None, other: Any) -> Any:
    return other if array is None else array


def _gains(
    stiffness: npt.ArrayLike | None, damping: npt.ArrayLike | None, n: int
) -> dict[str, Array]:
    """Convert the given gains to matrices."""
    matrices = {}
    for name, gains in zip(GAINS, (stiffness, damping), strict=True):
        if gains is None:
            continue
        array = _real(gains, name)
        if array.shape not in ((n,), (n, n)):
            raise ValueError(f"`{name}` has the shape {array.shape}, expected ({n},) or ({n}, {n})")
        matrices[name] = np.diag(array) if array.ndim == 1 else array
    return matrices


def _taken(gains: Array | None, through: Array | None) -> Array | None:
    """Aᵀ K A."""
    if gains is None or through is None:
        return None
    taken: Array = np.swapaxes(through, -1, -2) @ gains @ through
    return taken


def _real(numbers: npt.ArrayLike, name: str) -> Array:
    """Convert real numbers, none masked, to an array."""
    array = np.asarray(numbers)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"`{name}` holds {array.dtype}, expected real numbers")
    _native.refuse_masked(numbers, name)
    return array.astype(float)


def _list(numbers: npt.ArrayLike, name: str) -> list[float]:
    array = _real(numbers, name)
    if array.ndim != 1:
        raise ValueError(f"`{name}` has the shape {array.shape}, expected one dimension")
    listed: list[float] = array.tolist()
    return listed


def _sorted(inputs: Sequence[Constant | Table | Gains]) -> _native.Inputs:
    """Sort the inputs by kind for the core."""
    constants, tables, gains = [], [], []
    for one in inputs:
        if one.space not in ("y", "u"):
            raise ValueError(f"space is `{one.space}`, expected `y` or `u`")
        actuators = one.space == "u"
        if isinstance(one, Constant):
            constants.append((actuators, _list(one.forces, "forces")))
        elif isinstance(one, Table):
            rows: list[list[float]] = np.atleast_2d(_real(one.forces, "forces")).tolist()
            tables.append((actuators, _list(one.times, "times"), rows))
        else:
            stiffness, damping = _list(one.stiffness, "stiffness"), _list(one.damping, "damping")
            gains.append((actuators, stiffness, damping, _list(one.target, "target")))
    return (constants, tables, gains)
