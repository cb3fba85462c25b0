"""Files of the package `robot_descriptions`, by name.

`python -m sarrus.descriptions NAME` prints the file, for `sarrus import --description NAME`.
"""

import importlib
import pkgutil
import sys
from difflib import get_close_matches
from types import ModuleType

from sarrus.errors import LoadError

PACKAGE = "robot_descriptions"


def file(name: str) -> str:
    """The URDF of a description, or the MJCF of one that has no URDF."""
    try:
        package = importlib.import_module(PACKAGE)
    except ModuleNotFoundError as error:
        message = f"descriptions by name need a package: pip install {PACKAGE}"
        raise ModuleNotFoundError(message, name=PACKAGE) from error
    # the import of a description downloads its files where they are not there yet
    module = description(package, name)
    for key in ("URDF_PATH", "MJCF_PATH"):
        path = getattr(module, key, None)
        if path is not None:
            return str(path)
    if hasattr(module, "XACRO_PATH"):
        message = f"{name} is a file of xacro; expand it: sarrus import --xacro {module.XACRO_PATH}"
        raise LoadError(message, [])
    message = f"{PACKAGE}.{name} has neither URDF nor MJCF; choose another description"
    raise LoadError(message, [])


def description(package: ModuleType, name: str) -> ModuleType:
    """The module of a description, which knows its files."""
    known = [of.name for of in pkgutil.iter_modules(package.__path__)]
    if name not in known or not name.endswith("_description"):
        near = get_close_matches(name, [of for of in known if of.endswith("_description")], 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise LoadError(f"{PACKAGE} has no description {name!r}{hint}", [])
    return importlib.import_module(f"{PACKAGE}.{name}")


if __name__ == "__main__":
    try:
        print(file(sys.argv[1]))
    except (LoadError, ModuleNotFoundError) as fault:
        print(f"error: {fault}", file=sys.stderr)
        sys.exit(1 if isinstance(fault, LoadError) else 2)
