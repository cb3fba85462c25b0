"""Robots of formats that need a package: Lua of RBDL (`lupa`) and USD (`usd-core`).

`python -m sarrus.convert FILE` prints a URDF, with its loops in `<loop>` elements. `sarrus import
FILE` and `sarrus.Robot.load(FILE)` run this for files of these formats.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from sarrus.convert import lua, usd
from sarrus.convert.urdf import Robot, check_file
from sarrus.errors import LoadError

LUA = (".lua",)
USD = (".usd", ".usda", ".usdc", ".usdz")

# longest time of a reader [s]
LONGEST = 60
# the module as a program, which takes no module of the current folder
PROGRAM = """
import sys
sys.path = [of for of in sys.path if of]
from sarrus.convert.__main__ import main
sys.exit(main())
"""


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
    is_lua = path.suffix.lower() in LUA
    check_file(path)
    with np.errstate(all="ignore"):
        robot = lua.convert(path) if is_lua else usd.convert(path, include or [])
    robot.check(str(path))
    if robot.effects and not lenient:
        effects = "; ".join(robot.effects)
        raise LoadError(f"{path}: effects that are not modelled, see --lenient: {effects}", [])
    robot.notes += [f"{effect} is left out, and changes the motion" for effect in robot.effects]
    return robot


def text(path: str | os.PathLike[str], *, lenient: bool = False) -> tuple[bytes, list[str]]:
    """Convert a file to a URDF, with notes, in a process of its own of bounded memory and time.

    A reader in C that a damaged file makes crash ends that process only.
    """
    path = Path(path)
    check_file(path)
    is_lua = path.suffix.lower() in LUA
    module, package = ("lupa", "lupa") if is_lua else ("pxr", "usd-core")
    if importlib.util.find_spec(module) is None:
        message = f"{path}: its reader needs a package: pip install {package}"
        raise ModuleNotFoundError(message, name=module)
    flags = ["--lenient"] if lenient else []
    paths = os.pathsep.join(filter(None, sys.path))
    try:
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, *flags, "--", path],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env={**os.environ, "PYTHONPATH": paths},
            timeout=LONGEST,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise LoadError(f"{path}: its reader takes more than {LONGEST} s", []) from error
    said = done.stderr.decode(errors="replace").splitlines()
    if done.returncode == 0:
        return done.stdout, said
    said = [of for of in said if of[:7] == "error: "]
    ended = f"{path}: its reader ended with {done.returncode}"
    raise LoadError(said[-1][7:] if said else ended, [])
