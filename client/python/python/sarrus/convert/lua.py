"""Lua files of RBDL's `luamodel`, as in appendix A of the base document.

The file runs without files, clocks, random numbers and coroutines, in bounded memory and steps.
Semantics are those of RBDL 3.3 (`addons/luamodel`, `Constraint_Loop.cc`): `E` of a `joint_frame`
turns coordinates of the parent into those of the child, `E` of a cut frame those of the cut frame
into those of its body; a body without `inertia` has the identity.
"""

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from sarrus.convert.urdf import Array, Joint, Link, Loop, Robot, frame_of, number
from sarrus.errors import LoadError

MEMORY = 64 << 20
STEPS = 20_000_000
MOST_ENTRIES = 200_000
ROOT = "ROOT"

# functions that neither read, wait nor catch the end of their steps; patterns may take too long
SANDBOX = f"""
local set = debug.sethook
set(function() error('it takes more than {STEPS} steps', 0) end, '', {STEPS})
for _, name in ipairs({{'find', 'match', 'gmatch', 'gsub', 'dump'}}) do string[name] = nil end
math.random, math.randomseed = nil, nil
math.pow = function(a, b) return a ^ b end
local given = {{
    math = math, string = string, table = table, assert = assert, error = error, ipairs = ipairs,
    next = next, pairs = pairs, select = select, tonumber = tonumber, tostring = tostring,
    type = type, unpack = table.unpack, print = function() end,
}}
given._G = given
local load = load
return function(text, name)
    local chunk, fault = load(text, name, 't', given)
    if not chunk then error(fault, 0) end
    return chunk()
end
"""

EULER = {"JointTypeEulerZYX": "zyx", "JointTypeEulerXYZ": "xyz", "JointTypeEulerYXZ": "yxz"}
EULER |= {"JointTypeEulerZXY": "zxy"}

# joint types by the number of rows that hold turns and translations
ROWS = {(0, 3): "ball", (3, 3): "fixed", (2, 3): "revolute", (3, 2): "prismatic"}
ROWS |= {(2, 2): "cylindrical", (0, 2): "planar_revolute"}

KEYS = {"name", "parent", "body", "joint", "joint_frame", "visuals", "markers", "points"}


def convert(path: Path) -> Robot:
    """Convert the file that returns a model."""
    model = run(path)
    robot = Robot(path.stem, [Link(ROOT)])
    if not isinstance(model, dict):
        raise LoadError(f"{path}: it returns no table; end it by `return model`", [])
    frames = items(model.get("frames"), f"{path}: frames")
    if not frames:
        raise LoadError(f"{path}: `frames` has no frame", [])
    for k, of in enumerate(frames, 1):
        add_frame(robot, of, f"{path}: frames[{k}]")
    sets = model.get("constraint_sets") or {}
    local = {of.get("name"): of for of in items(model.get("local_frames"), f"{path}: local_frames")}
    add_loops(robot, sets, local, str(path))
    if "gravity" in model:
        gravity = vector(model["gravity"], 3, f"{path}: gravity")
        if list(gravity) != [0.0, 0.0, -9.81]:
            given = ",".join(number(of) for of in gravity)
            robot.notes.append(f"`gravity` is no part of a robot; give it as --gravity={given}")
    read = {"frames", "constraint_sets", "local_frames", "gravity"}
    for key in sorted(str(key) for key in model if key not in read):
        robot.notes.append(f"`{key}` is left out")
    return robot


def run(path: Path) -> Any:
    """The value that the file returns, with tables as lists or dictionaries."""
    try:
        # its errors are no part of the name that type checkers know
        lua: Any = importlib.import_module("lupa.lua54")
    except ModuleNotFoundError as error:
        message = f"{path}: files of Lua need a package: pip install lupa"
        raise ModuleNotFoundError(message, name="lupa") from error
    runtime = lua.LuaRuntime(
        register_eval=False,
        register_builtins=False,
        attribute_filter=refuse,
        max_memory=MEMORY,
    )
    call = runtime.execute(SANDBOX)
    try:
        # a table that holds itself ends here too
        return plain(call(path.read_bytes(), f"={path}"), lua.lua_type, [0], 0)
    except (lua.LuaError, MemoryError, UnicodeDecodeError, RecursionError) as error:
        said = "it needs more memory than it may" if isinstance(error, MemoryError) else error
        raise LoadError(f"{path}: {said}", []) from error


def refuse(*_: object) -> str:
    """No attribute of Python can be reached."""
    raise AttributeError("no Python")


def plain(value: Any, lua_type: Any, count: list[int], depth: int) -> Any:
    """A value of Lua as one of Python."""
    if lua_type(value) != "table":
        if lua_type(value) is not None:
            return None
        return value.decode() if isinstance(value, bytes) else value
    pairs = {}
    for key, inner in value.items():
        count[0] += 1
        if count[0] > MOST_ENTRIES or depth > 50:
            raise RecursionError("its table has too many entries, or contains itself")
        pairs[key] = plain(inner, lua_type, count, depth + 1)
    n = len(pairs)
    if n and all(k in pairs for k in range(1, n + 1)):
        return [pairs[k] for k in range(1, n + 1)]
    return pairs


def items(value: Any, where: str) -> list[Any]:
    """A list of tables."""
    if value is None or value == {}:
        return []
    if not isinstance(value, list) or not all(isinstance(of, dict) for of in value):
        raise LoadError(f"{where}: no list of tables", [])
    return value


def vector(value: Any, n: int, where: str) -> Array:
    """A list of finite numbers."""
    is_list = isinstance(value, list) and len(value) == n
    if not is_list or not all(type(of) in (int, float) for of in value):
        raise LoadError(f"{where}: expected {n} numbers", [])
    array = np.array(value, dtype=np.float64)
    if not np.isfinite(array).all():
        raise LoadError(f"{where}: a number that is not finite", [])
    return array


def matrix(value: Any, where: str) -> Array:
    """Three rows of three numbers."""
    if not isinstance(value, list) or len(value) != 3:
        raise LoadError(f"{where}: expected 3 rows", [])
    return np.array([vector(row, 3, where) for row in value])


def transform(of: Any, where: str) -> tuple[Array, Array]:
    """`E` and `r` of a transform."""
    if of is None or of == {}:
        return np.eye(3), np.zeros(3)
    if not isinstance(of, dict):
        raise LoadError(f"{where}: no table with `E` and `r`", [])
    E = matrix(of["E"], f"{where}.E") if "E" in of else np.eye(3)
    r = vector(of["r"], 3, f"{where}.r") if "r" in of else np.zeros(3)
    return E, r


def add_frame(robot: Robot, of: dict[Any, Any], where: str) -> None:
    """Add a frame: a link behind the joints of its freedoms."""
    name, parent = of.get("name"), of.get("parent")
    known = {link.name for link in robot.links}
    if not isinstance(name, str) or not name or name in known:
        raise LoadError(f"{where}: `name` is {name!r}; expected a name of its own", [])
    if parent not in known:
        raise LoadError(f"{where}: `parent` is {parent!r}; expected a frame before, or ROOT", [])
    for key in sorted(str(key) for key in of if key not in KEYS):
        robot.notes.append(f"`{key}` of {name} is left out")
    E, r = transform(of.get("joint_frame"), f"{where}.joint_frame")
    origin = frame_of(E.T, r, f"{where}.joint_frame")
    chain = motions(of.get("joint"), f"{where}.joint")
    for k, (kind, axis) in enumerate(chain):
        is_last = k + 1 == len(chain)
        child = name if is_last else f"{name}/{k + 1}"
        joint = name if len(chain) == 1 else f"{name}/{k + 1}"
        if not is_last:
            robot.links.append(Link(child))
        robot.joints.append(Joint(joint, kind, parent, child, origin, axis))
        parent, origin = child, np.eye(4)
    robot.links.append(body(of.get("body"), name, f"{where}.body"))


def motions(of: Any, where: str) -> list[tuple[str, Array]]:
    """Types and axes of the joints that a joint of RBDL consists of."""
    none = np.array([0.0, 0.0, 1.0])
    if of is None or of in ({}, []):
        return [("fixed", none)]
    axes = np.eye(3)
    if isinstance(of, list) and len(of) == 1 and isinstance(of[0], str):
        if of[0] in EULER:
            return [("continuous", axes["xyz".index(letter)]) for letter in EULER[of[0]]]
        if of[0] == "JointTypeTranslationXYZ":
            return [("prismatic", axis) for axis in axes]
        whole = {"JointTypeSpherical": "spherical", "JointTypeFloatingBase": "floating"}
        if of[0] in whole:
            return [(whole[of[0]], none)]
        raise LoadError(f"{where}: {of[0]!r}, a joint type that is not known", [])
    if not isinstance(of, list):
        raise LoadError(f"{where}: no list of axes", [])
    chain = []
    for k, row in enumerate(of, 1):
        turn, slide = np.split(vector(row, 6, f"{where}[{k}]"), 2)
        if np.any(turn) == np.any(slide):
            raise LoadError(f"{where}[{k}]: expected an axis that turns or slides", [])
        axis, kind = (turn, "continuous") if np.any(turn) else (slide, "prismatic")
        # RBDL's coordinate counts an axis that is no unit vector by its length
        if abs(np.linalg.norm(axis) - 1.0) > 1e-3:
            raise LoadError(f"{where}[{k}]: expected an axis of length one", [])
        chain.append((kind, axis))
    return chain


def body(of: Any, name: str, where: str) -> Link:
    """The link of a body."""
    if of is None:
        return Link(name)
    if not isinstance(of, dict) or type(of.get("mass")) not in (int, float):
        raise LoadError(f"{where}: no table with a `mass`", [])
    mass = float(of["mass"])
    com = vector(of["com"], 3, f"{where}.com") if "com" in of else np.zeros(3)
    inertia = matrix(of["inertia"], f"{where}.inertia") if "inertia" in of else np.eye(3)
    if not mass >= 0.0 or np.any(inertia != inertia.T):
        raise LoadError(f"{where}: a mass below zero, or an inertia that is not symmetric", [])
    return Link(name, mass, com, inertia)


def add_loops(robot: Robot, sets: Any, local: dict[Any, Any], path: str) -> None:
    """Add the loops of all constraint sets: rows between the same frames are one joint."""
    cuts: dict[Any, dict[str, Any]] = {}
    names = {link.name for link in robot.links}
    for set_name, rows in sorted(sets.items()) if isinstance(sets, dict) else []:
        for k, of in enumerate(items(rows, f"{path}: constraint_sets.{set_name}"), 1):
            where = f"{path}: constraint_sets.{set_name}[{k}]"
            if of.get("constraint_type") != "loop":
                kind = of.get("constraint_type")
                robot.notes.append(f"{kind} {set_name}[{k}] is left out: it closes no loop")
                continue
            links, frames = ends(of, local, where)
            if any(link not in names for link in links):
                raise LoadError(f"{where}: ends {links[0]!r} and {links[1]!r}; expected frames", [])
            axes = of["axis_sets"] if "axis_sets" in of else [of.get("axis")]
            if not isinstance(axes, list):
                raise LoadError(f"{where}: `axis_sets` is no list of axes", [])
            key = (links, *(frame.tobytes() for frame in frames))
            cut = cuts.setdefault(key, {"links": links, "frames": frames, "rows": []})
            cut.setdefault("name", str(of.get("name") or f"{links[0]}_{links[1]}"))
            cut["where"] = where
            for row in axes:
                row = vector(row, 6, f"{where}.axis")
                # the sets of a motion's phases repeat their loops
                if not any(np.array_equal(row, other) for other in cut["rows"]):
                    cut["rows"].append(row)
    used: dict[str, int] = {}
    for cut in cuts.values():
        kind, axis = joint_of(np.array(cut["rows"]), cut["where"])
        used[cut["name"]] = used.get(cut["name"], 0) + 1
        name = cut["name"] if used[cut["name"]] == 1 else f"{cut['name']}/{used[cut['name']]}"
        robot.loops.append(Loop(name, kind, cut["links"], cut["frames"], axis))


def ends(
    of: dict[Any, Any], local: dict[Any, Any], where: str
) -> tuple[tuple[str, str], tuple[Array, Array]]:
    """Links and frames of a loop constraint."""
    links, frames = [], []
    for end in ("predecessor", "successor"):
        named = of.get(f"{end}_local_frame")
        if named is None:
            place, link = of.get(f"{end}_transform"), of.get(f"{end}_body")
        elif named in local:
            place, link = local[named], local[named].get("body")
        else:
            raise LoadError(f"{where}: {named!r} is no local frame", [])
        E, r = transform(place, f"{where}.{end}_transform")
        links.append(str(link))
        frames.append(frame_of(E, r, f"{where}.{end}_transform"))
    return (links[0], links[1]), (frames[0], frames[1])


def joint_of(rows: Array, where: str) -> tuple[str, Array]:
    """The type and axis of the joint whose constraints span these rows."""
    axis = np.array([0.0, 0.0, 1.0])
    turns = rows[~np.any(rows[:, 3:], axis=1), :3]
    slides = rows[~np.any(rows[:, :3], axis=1), 3:]
    kind = ROWS.get((len(turns), len(slides)))
    held = [of / np.linalg.norm(of, axis=1, keepdims=True) for of in (turns, slides) if len(of)]
    # singular values of unit rows: independent, and with the same free direction
    is_full = all(np.linalg.svd(of, compute_uv=False)[-1] > 1e-6 for of in held)
    free = [np.linalg.svd(of)[2][-1] for of in held if len(of) == 2]
    if len(free) == 2 and np.linalg.norm(np.cross(*free)) > 1e-9:
        kind = None
    if kind is None or not is_full or len(turns) + len(slides) != len(rows):
        expected = "rows of a ball, hinge, slider, cylinder, weld or of a hinge in the plane"
        raise LoadError(f"{where}: {len(rows)} axes that hold no joint; expected {expected}", [])
    if free:
        axis = free[0] * np.sign(free[0][np.argmax(np.abs(free[0]))])
        # across two coordinate axes the third, not its rounded self
        axis = np.where(np.abs(axis) < 1e-15, 0.0, axis)
    return kind, axis
