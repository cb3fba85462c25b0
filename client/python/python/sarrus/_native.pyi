from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Literal, overload

import numpy as np
import numpy.typing as npt
from typing_extensions import Self

from sarrus.can.adapters import Adapter

VERSION: str

Parts = tuple[tuple[float, float, float], bool, str | None, list[str], list[str]]
Inputs = tuple[
    list[tuple[bool, list[float]]],
    list[tuple[bool, list[float], list[list[float]]]],
    list[tuple[bool, list[float], list[float], list[float]]],
]
_Array = npt.NDArray[np.float64]
_Codes = npt.NDArray[np.uint32]
_Progress = Callable[[int, int], object] | None

def bundled_names() -> list[tuple[str, str]]: ...
def imported(
    file: str | PathLike[str], urdf: bytes, lenient: bool
) -> tuple[bytes, bytes, list[str]]: ...
def statuses() -> list[str]: ...
def status_help(code: int) -> str: ...
def warning_bits() -> list[str]: ...
def forked() -> None: ...
def refuse_masked(object: object, name: str) -> None: ...

class Origin:
    @staticmethod
    def bundled(name: str, parts: Parts) -> Origin: ...
    @staticmethod
    def files(
        urdf: str | PathLike[str], submechanisms: str | PathLike[str] | None, parts: Parts
    ) -> Origin: ...
    @staticmethod
    def text(urdf: bytes, submechanisms: bytes | None, parts: Parts) -> Origin: ...
    @staticmethod
    def served(
        name: str,
        timeout: float,
        deadline: float | None,
        transport: str,
        wait: str,
        fingerprint: int | None,
    ) -> Origin: ...
    @property
    def is_served(self) -> bool: ...
    @property
    def name(self) -> str: ...
    def notes(self) -> list[str]: ...
    def contents(self) -> tuple[bytes, bytes | None, Parts]: ...

class Query:
    @property
    def given(self) -> list[tuple[str, list[int]]]: ...
    @property
    def want(self) -> list[tuple[str, list[int]]]: ...
    def ask(
        self,
        given: Sequence[npt.ArrayLike],
        out: Sequence[_Array | None] | None = None,
        threads: int | None = None,
        progress: _Progress = None,
    ) -> tuple[tuple[Any, ...], Any, Any]: ...

class Robot:
    def __new__(cls, origin: Origin) -> Self: ...
    @overload
    def inverse_dynamics(
        self,
        y: npt.ArrayLike,
        yd: npt.ArrayLike | None = None,
        ydd: npt.ArrayLike | None = None,
        *,
        out: _Array | None = None,
        threads: int | None = None,
        progress: _Progress = None,
        return_status: Literal[False] = False,
    ) -> _Array:
        """Actuator forces for a motion: τ_u = G_u⁻ᵀ (M_y ÿ + C_y).

        `y` [m, rad] (n_qy), `yd` and `ydd` (n_vy), zero by default; gives `tau_u` [N, N m] (n_u).
        With rows of each (n, …) the states are answered on `threads` threads, with the same bits,
        and `progress` gets how many are done and how many there are; Ctrl-C ends it.

        One state without an answer raises `StateError`. Rows without one are NaN; a `StateWarning`
        tells of them, and of answers with warnings such as `limits_exceeded`. With `return_status`
        the statuses come beside the forces, and nothing is raised or warned of. `out` is written in
        place: float64, contiguous, of the right shape.
        """

    @overload
    def inverse_dynamics(
        self,
        y: npt.ArrayLike,
        yd: npt.ArrayLike | None = None,
        ydd: npt.ArrayLike | None = None,
        *,
        out: _Array | None = None,
        threads: int | None = None,
        progress: _Progress = None,
        return_status: Literal[True],
    ) -> tuple[_Array, int | _Codes]: ...
    @overload
    def forward_dynamics(
        self,
        y: npt.ArrayLike,
        yd: npt.ArrayLike,
        tau_u: npt.ArrayLike,
        *,
        out: _Array | None = None,
        threads: int | None = None,
        progress: _Progress = None,
        return_status: Literal[False] = False,
    ) -> _Array:
        """Motion under actuator forces: ÿ = M_y⁻¹ (G_uᵀ τ_u − C_y).

        `y` [m, rad] (n_qy), `yd` (n_vy), `tau_u` [N, N m] (n_u); gives `ydd` (n_vy). All else is as
        in `inverse_dynamics`.
        """

    @overload
    def forward_dynamics(
        self,
        y: npt.ArrayLike,
        yd: npt.ArrayLike,
        tau_u: npt.ArrayLike,
        *,
        out: _Array | None = None,
        threads: int | None = None,
        progress: _Progress = None,
        return_status: Literal[True],
    ) -> tuple[_Array, int | _Codes]: ...
    def _prepare(
        self,
        request: str,
        given: list[str],
        want: list[str] | None = None,
        frames: list[str] = ...,
        joints: list[str] | None = None,
        wrenches: list[str] = ...,
        checksum: bool = False,
        search: bool = False,
        loop_tolerance: float | None = None,
        projection_tolerance: float | None = None,
        axes: str = "mixed",
        relative_to: str | None = None,
        directions: int = 0,
        friction: bool = False,
        tasks: bytes | None = None,
    ) -> Query: ...
    @property
    def origin(self) -> Origin: ...
    @property
    def fingerprint(self) -> int:
        """A number that differs whenever any name, order or constant of the robot differs."""

    @property
    def late(self) -> int:
        """Answers that came after the deadline of `connect`; 0 in process."""

    def _information_json(self) -> bytes: ...
    def _capability(
        self, joints: list[str], grid: int | None, at: list[float] | None, page: bool
    ) -> tuple[str, str]: ...
    def _identify(self, heads: list[str], rows: list[list[float]]) -> tuple[str, str]: ...
    def _page(self, swing: bool) -> str: ...
    def _scene(self) -> str: ...
    def _run_simulation(
        self,
        y: list[float],
        yd: list[float],
        inputs: Inputs,
        settings: tuple[
            str, float, float | None, float | None, float, float, bool, bool, float | None
        ],
        progress: Callable[[float, float], object] | None = None,
    ) -> tuple[dict[str, _Array], tuple[str, float, float, list[str], list[tuple[float, str]]]]: ...

def slcan_line(frame: Frame) -> bytes: ...
def events_of_error_frame(error_class: int, data: bytes) -> list[tuple[str, int]]: ...
def interface_question(name: str) -> bytes: ...
def check_interface(
    answer: bytes, name: str, bitrate: int | None, data_bitrate: int | None = None
) -> tuple[str, int] | None: ...
def interface_advice(answer: bytes, name: str) -> str | None: ...
def candidates(protocol: str) -> list[tuple[str, int, int]]: ...
def protocols() -> list[dict[str, Any]]: ...

class Frame:
    def __init__(
        self,
        id: int,
        data: bytes = b"",
        *,
        extended: bool = False,
        fd: bool = False,
        bit_rate_switch: bool = False,
    ) -> None: ...
    @property
    def id(self) -> int: ...
    @property
    def extended(self) -> bool: ...
    @property
    def fd(self) -> bool: ...
    @property
    def bit_rate_switch(self) -> bool: ...
    @property
    def data(self) -> bytes: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...

class SlcanReader:
    def __init__(self) -> None: ...
    def take(self, data: bytes) -> list[Frame | tuple[str, int]]: ...

class Configuration:
    @staticmethod
    def load(path: str | PathLike[str]) -> Configuration: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def robot(self) -> str | None: ...
    @property
    def fingerprint(self) -> int: ...
    @property
    def actuators(self) -> list[str]: ...
    @property
    def period_ns(self) -> int: ...
    @property
    def timeouts(self) -> dict[str, float]: ...
    @property
    def buses(self) -> list[dict[str, Any]]: ...
    @property
    def motors(self) -> list[dict[str, Any]]: ...

class Candidate:
    def __init__(self, protocol: str, variant: str, id: int) -> None: ...
    def probe(self) -> list[Frame]: ...
    def hears(self, now_ns: int, frame: Frame) -> str | None: ...

class Drives:
    def __init__(self, configuration: Configuration) -> None: ...
    def probe(self, motor: int) -> list[Frame]: ...
    def disable(self, motor: int) -> list[Frame]: ...
    def off(self, motor: int, now_ns: int) -> list[Frame]: ...
    def on(self, motor: int, now_ns: int, setpoint: list[float]) -> list[Frame]: ...
    def set_zero(self, motor: int) -> list[Frame] | None: ...
    def save_zero(self, motor: int) -> list[Frame] | None: ...
    def set_id(self, motor: int, id: int) -> list[Frame] | None: ...
    def parameters(self, motor: int) -> list[tuple[str, str]]: ...
    def read_parameter(self, motor: int, parameter: int) -> list[Frame]: ...
    def receive(self, now_ns: int, bus: int, frame: Frame) -> list[tuple[int, str, Any]]: ...
    def state(self, motor: int) -> dict[str, Any]: ...
    def unguarded(self, motor: int) -> str | None: ...

class Bridge:
    def __init__(self, configuration: Configuration) -> None: ...
    def receive(self, now_ns: int, bus: int, frame: Frame) -> None: ...
    def bus_event(self, now_ns: int, bus: int, event: str, count: int) -> None: ...
    def command(
        self,
        now_ns: int,
        sequence: int,
        stamp_ns: int,
        position: list[float] | None = None,
        velocity: list[float] | None = None,
        effort: list[float] | None = None,
        stiffness: list[float] | None = None,
        damping: list[float] | None = None,
        fingerprint: int | None = None,
    ) -> str: ...
    def operate(self, now_ns: int, operation: str, actuator: str | None = None) -> None: ...
    def cycle(self, now_ns: int) -> None: ...
    def replay(self, line: str) -> tuple[list[str], str | None]: ...
    @property
    def faults(self) -> tuple[int, str | None]: ...
    def frames(self, bus: int) -> list[Frame]: ...
    def shutdown(self) -> None: ...
    @property
    def mechanism_state(self) -> tuple[str, str]: ...
    def state(self) -> dict[str, Any]: ...
    def counters(self) -> dict[str, Any]: ...

def recording(
    path: str | PathLike[str], step: float
) -> tuple[Origin, list[tuple[float, str, str, str, str, list[float]]]]: ...
def run_bridge(
    configuration: Configuration,
    name: str,
    open: Callable[[int], Adapter],
    ready: Callable[[], object],
    why: Callable[[], str],
    *,
    seconds: float | None = None,
    dry_run: bool = False,
    realtime: bool = True,
    log: str | PathLike[str] | None = None,
    fault_log: str | PathLike[str] | None = None,
) -> tuple[str, dict[str, Any]]: ...

class Service:
    def __init__(self, name: str) -> None: ...
    def take(self, now_ns: int, bridge: Bridge) -> None: ...
    def publish(self, bridge: Bridge) -> bool: ...
    def close(self) -> None: ...

class Controller:
    def __init__(
        self, name: str = "default", *, fingerprint: int | None = None, watch: bool = False
    ) -> None: ...
    def command(
        self,
        sequence: int | None = None,
        stamp_ns: int | None = None,
        fingerprint: int | None = None,
        position: Sequence[float] | npt.NDArray[np.float64] | None = None,
        velocity: Sequence[float] | npt.NDArray[np.float64] | None = None,
        effort: Sequence[float] | npt.NDArray[np.float64] | None = None,
        stiffness: Sequence[float] | npt.NDArray[np.float64] | None = None,
        damping: Sequence[float] | npt.NDArray[np.float64] | None = None,
    ) -> bool: ...
    def operate(self, stamp_ns: int, operation: str, actuator: int | None = None) -> bool: ...
    def state(self) -> dict[str, Any] | None: ...
    def commanded(self) -> dict[str, Any] | None: ...
    def close(self) -> None: ...
