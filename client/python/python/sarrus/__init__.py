"""Exact dynamics of series-parallel hybrid robots, with numpy's arrays.

>>> import sarrus
>>> robot = sarrus.Robot.bundled("lambda")
>>> robot.inverse_dynamics([0.2], [1.0], [0.0]).shape
(1,)

`Robot.load` reads a robot from files, `Robot.connect` uses a server; `sarrus.can` is the CAN bridge
over python-can.
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

from sarrus import _native
from sarrus._native import VERSION as __version__

if TYPE_CHECKING:
    from sarrus import policy
    from sarrus.errors import (
        ConnectError,
        Error,
        LoadError,
        QueryError,
        StateError,
        StateWarning,
    )
    from sarrus.identification import Identification, excite, identify
    from sarrus.limits import Capability, capability
    from sarrus.names import Names
    from sarrus.query import Answer, Query
    from sarrus.results import Actuators, Frames, Independents, State
    from sarrus.robot import Robot, bundled
    from sarrus.simulation import Constant, Gains, Simulation, Table
    from sarrus.status import Status, Warnings

__all__ = [
    "Actuators",
    "Answer",
    "Capability",
    "ConnectError",
    "Constant",
    "Error",
    "Frames",
    "Gains",
    "Identification",
    "Independents",
    "LoadError",
    "Names",
    "Query",
    "QueryError",
    "Robot",
    "Simulation",
    "State",
    "StateError",
    "StateWarning",
    "Status",
    "Table",
    "Warnings",
    "__version__",
    "bundled",
    "capability",
    "excite",
    "identify",
    "policy",
]

_MODULES = {
    "errors": ("ConnectError", "Error", "LoadError", "QueryError", "StateError", "StateWarning"),
    "identification": ("Identification", "excite", "identify"),
    "limits": ("Capability", "capability"),
    "names": ("Names",),
    "query": ("Answer", "Query"),
    "results": ("Actuators", "Frames", "Independents", "State"),
    "robot": ("Robot", "bundled"),
    "simulation": ("Constant", "Gains", "Simulation", "Table"),
    "status": ("Status", "Warnings"),
}


def __getattr__(name: str) -> Any:
    """Import the dynamics at first use: the CAN bridge runs without numpy."""
    if name == "policy":
        return importlib.import_module("sarrus.policy")
    for module, names in _MODULES.items():
        if name in names:
            value = globals()[name] = getattr(importlib.import_module(f"sarrus.{module}"), name)
            return value
    raise AttributeError(f"module `sarrus` has no attribute `{name}`")


def __dir__() -> list[str]:
    return sorted(__all__)


# batches of other threads do not go on in a forked child
os.register_at_fork(after_in_child=_native.forked)
