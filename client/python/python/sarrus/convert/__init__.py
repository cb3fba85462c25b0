"""Robots of formats that need a package: Lua of RBDL (`lupa`) and USD (`usd-core`).

`python -m sarrus.convert FILE` prints a URDF, with its loops in `<loop>` elements. `sarrus import
FILE` and `sarrus.Robot.load(FILE)` run this for files of these formats.
"""

import os
from pathlib import Path

from sarrus.convert import lua, usd
from sarrus.convert.urdf import Robot
from sarrus.errors import LoadError

LUA = (".lua",)
USD = (".usd", ".usda", ".usdc", ".usdz")

# largest file [bytes]
MOST = 64 << 20


def reads(path: str | os.PathLike[str]) -> bool:
    """True for the ending of a format that is converted here."""
    return Path(path).suffix.lower() in LUA + USD


def convert(
    path: str | os.PathLike[str], include: list[Path] | None = None, *, lenient: bool = False
) -> Robot:
    """Convert a file; those that it names are read below its folder or a folder of `include`.

    A `LoadError` names a fault, a `ModuleNotFoundError` the package that is missing. Effects that
    are not modelled are faults, with `lenient` notes.
    """
    path = Path(path)
    if path.stat().st_size > MOST:
        raise LoadError(f"{path}: more than {MOST >> 20} MiB", [])
    is_lua = path.suffix.lower() in LUA
    robot = lua.convert(path) if is_lua else usd.convert(path, include or [])
    if robot.effects and not lenient:
        effects = "; ".join(robot.effects)
        raise LoadError(f"{path}: effects that are not modelled, see --lenient: {effects}", [])
    robot.notes += [f"{effect} is left out, and changes the motion" for effect in robot.effects]
    return robot
