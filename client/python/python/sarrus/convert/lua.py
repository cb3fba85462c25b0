"""Lua files of RBDL's `luamodel`, as in appendix A of the base document.

The file runs without files, clocks, random numbers and coroutines, in bounded memory and steps.
Semantics are those of RBDL 3.3 (`addons/luamodel`, `Constraint_Loop.cc`): `E` of a `joint_frame`
turns coordinates of the parent into those of the child, `E` of a cut frame those of the cut frame
into those of its body; a body without `inertia` has the identity.
"""

import importlib
import re
from collections.abc import Container
from pathlib import Path
from typing import Any

import numpy as np

from sarrus.convert.urdf import Array, Joint, Link, Loop, Robot, frame_of
from sarrus.errors import LoadError

MEMORY = 64 << 20
STEPS = 20_000_000
# processor time, since one step may copy a string of all the memory
SECONDS = 5
# of the model: values, and letters
MOST_ENTRIES = 200_000
MOST_LETTERS = 16 << 20
ROOT = "ROOT"

# functions that neither read, wait nor catch the end of their steps; patterns may take too long. A
# call of the others counts as one step, so that the lengths of their loops are bounded
SANDBOX = f"""
local clock, taken = os.clock, 0
local start = clock()
debug.sethook(function()
    taken = taken + 100
    if taken > {STEPS} then error('it takes more than {STEPS} steps', 0) end
    if clock() - start > {SECONDS} then error('it takes more than {SECONDS} s', 0) end
end, '', 100)
for _, name in ipairs({{'find', 'match', 'gmatch', 'gsub', 'dump'}}) do string[name] = nil end
local function bound(n, what)
    if not (n <= 1 << 22) then error(what .. ' takes too long', 3) end
end
local rep, move = string.rep, table.move
string.rep = function(text, n, between)
    bound(n, 'rep')
    return rep(text, n, between)
end
for name, of in pairs(table) do
    -- where the numbers of a table have gaps, its length may be any of them
    table[name] = name == 'pack' and of or function(list, ...)
        bound(#list, name)
        return of(list, ...)
    end
end
table.move = function(list, first, last, ...)
    bound(last - first, 'move')
    return move(list, first, last, ...)
end
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

# type and axis of a joint; the metres in a radian of one that follows the joint behind it
Motion = tuple[str, Array, float | None]

# joint types by the number of rows that hold turns and translations
ROWS = {(0, 3): "ball", (3, 3): "fixed", (2, 3): "revolute", (3, 2): "prismatic"}
ROWS |= {(2, 2): "cylindrical", (0, 2): "planar_revolute"}

ENDS = ("predecessor", "successor")

# keys that are read, or that do not change the motion
FRAME = {"name", "parent", "body", "joint", "joint_frame", "visuals", "markers", "points"}
LOOP = {"constraint_type", "name", "id", "axis", "axis_sets", "enable_stabilization"}
LOOP |= {"stabilization_parameter", "stabilization_coefficient"}
LOOP |= {f"{end}_{of}" for end in ENDS for of in ("body", "transform", "local_frame")}


def convert(path: Path) -> Robot:
    """Convert the file that returns a model."""
    model = run(path)
    robot = Robot(path.stem, [Link(ROOT)])
    if not isinstance(model, dict):
        raise LoadError(f"{path}: it returns no table; end it by `return model`", [])
    frames = items(model.get("frames"), f"{path}: frames")
    if not frames:
        raise LoadError(f"{path}: `frames` has no frame", [])
    known = {ROOT}
    for k, of in enumerate(frames, 1):
        add_frame(robot, of, known, f"{path}: frames[{k}]")
    local: dict[str, dict[Any, Any]] = {}
    for k, of in enumerate(items(model.get("local_frames"), f"{path}: local_frames"), 1):
        local[own_name(of, local, f"{path}: local_frames[{k}]")] = of
    add_loops(robot, model.get("constraint_sets"), (local, known), str(path))
    # RBDL's own where the file has none
    gravity = vector(model.get("gravity", [0.0, -9.81, 0.0]), 3, f"{path}: gravity")
    robot.note_gravity(gravity)
    note_rest(robot, model, {"frames", "constraint_sets", "local_frames", "gravity"}, "the model")
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
        name = path.name.encode(errors="replace")
        # as Lua does for files: without a mark of UTF-8, and without a first line of `#!`
        text = re.sub(rb"\A(\xef\xbb\xbf)?(#[^\n]*)?", b"", path.read_bytes())
        return plain(call(text, b"=" + name), lua.lua_type, [0, 0], 0)
    except (lua.LuaError, MemoryError, UnicodeError, RecursionError) as error:
        said = str(error).split("stack traceback:")[0].strip() or "an error without a message"
        if isinstance(error, MemoryError):
            said = "it needs more memory than it may"
        if isinstance(error, UnicodeError):
            said = "a text that is not UTF-8"
        raise LoadError(f"{path}: {said}", []) from error


def refuse(*_: object) -> str:
    """No attribute of Python can be reached."""
    raise AttributeError("no Python")


def plain(value: Any, lua_type: Any, count: list[int], depth: int) -> Any:
    """A value of Lua as one of Python; `...` stands for functions, which no part of a robot is."""
    kind = lua_type(value)
    if depth > 50:
        raise RecursionError("its table is too deep, or contains itself")
    if kind != "table":
        count[1] += len(value) if isinstance(value, str) else 0
        return value if kind is None else ...
    pairs = {}
    for key, inner in value.items():
        count[0] += 1
        # True is the key 1 of Python, not of Lua
        key = key if type(key) in (int, str) else f"[{key}]"
        pairs[key] = plain(inner, lua_type, count, depth + 1)
        count[1] += len(str(key))
        if count[0] > MOST_ENTRIES or count[1] > MOST_LETTERS:
            raise RecursionError("its table has too many entries")
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


def own_name(of: dict[Any, Any], known: Container[str], where: str) -> str:
    """The name of a table, which no other one has."""
    name = of.get("name")
    if not isinstance(name, str) or not name or name in known:
        raise LoadError(f"{where}: `name` is {name!r}; expected a name of its own", [])
    return name


def note_rest(robot: Robot, of: Any, known: set[str], owner: str) -> None:
    """Note the keys of a table that are not read."""
    for key in sorted(str(key) for key in of if key not in known) if isinstance(of, dict) else []:
        robot.notes.append(f"`{key}` of {owner} is left out")


def add_frame(robot: Robot, of: dict[Any, Any], known: set[str], where: str) -> None:
    """Add a frame: a link behind the joints of its freedoms."""
    name, parent = own_name(of, known, where), of.get("parent")
    if not isinstance(parent, str) or parent not in known:
        raise LoadError(f"{where}: `parent` is {parent!r}; expected a frame before, or ROOT", [])
    known.add(name)
    place, inertial = of.get("joint_frame"), of.get("body")
    note_rest(robot, of, FRAME, name)
    note_rest(robot, place, {"E", "r"}, f"{name}.joint_frame")
    note_rest(robot, inertial, {"mass", "com", "inertia"}, f"{name}.body")
    E, r = transform(place, f"{where}.joint_frame")
    origin = frame_of(E.T, r, f"{where}.joint_frame")
    chain = motions(of.get("joint"), f"{where}.joint")
    names = [f"{name}/{k}" for k in range(1, len(chain) + 1)] if len(chain) > 1 else [name]
    for k, (kind, axis, pitch) in enumerate(chain):
        child = name if k + 1 == len(chain) else names[k]
        joint = Joint(names[k], kind, parent, child, origin, axis)
        if pitch is not None:
            joint.mimic = (names[k + 1], pitch, 0.0)
        if child != name:
            robot.links.append(Link(child))
        robot.joints.append(joint)
        parent, origin = child, np.eye(4)
    robot.links.append(body(inertial, name, f"{where}.body"))


def motions(of: Any, where: str) -> list[Motion]:
    """The joints of one freedom each that a joint of RBDL consists of."""
    none = np.array([0.0, 0.0, 1.0])
    if of is None or of in ({}, []):
        return [("fixed", none, None)]
    axes = np.eye(3)
    if isinstance(of, list) and len(of) == 1 and isinstance(of[0], str):
        if of[0] in EULER:
            return [("continuous", axes["xyz".index(letter)], None) for letter in EULER[of[0]]]
        if of[0] == "JointTypeTranslationXYZ":
            return [("prismatic", axis, None) for axis in axes]
        whole = {"JointTypeSpherical": "spherical", "JointTypeFloatingBase": "floating"}
        if of[0] in whole:
            return [(whole[of[0]], none, None)]
        raise LoadError(f"{where}: {of[0]!r}, a joint type that is not known", [])
    if not isinstance(of, list) or len(of) > 6:
        raise LoadError(f"{where}: no list of at most 6 axes", [])
    chain: list[Motion] = []
    for k, row in enumerate(of, 1):
        turn, slide = np.split(vector(row, 6, f"{where}[{k}]"), 2)
        if not np.any(row):
            raise LoadError(f"{where}[{k}]: expected an axis that turns or slides", [])
        # RBDL's coordinate counts an axis that is no unit vector by its length
        main = turn if np.any(turn) else slide
        if not abs(np.linalg.norm(main) - 1.0) <= 1e-3:
            raise LoadError(f"{where}[{k}]: expected an axis of length one", [])
        if np.any(turn) and np.any(slide):
            # a screw slides, then turns, by the same coordinate
            pitch = float(np.linalg.norm(slide))
            if not 1e-9 < pitch < 1e9:
                raise LoadError(f"{where}[{k}]: a screw with a pitch of {pitch} m", [])
            chain.append(("prismatic", slide / pitch, pitch))
        chain.append(("continuous" if np.any(turn) else "prismatic", main, None))
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
    is_symmetric = np.abs(inertia - inertia.T).max() <= 1e-9 * np.abs(inertia).max()
    if not mass >= 0.0 or not is_symmetric:
        raise LoadError(f"{where}: a mass below zero, or an inertia that is not symmetric", [])
    return Link(name, mass, com, 0.5 * (inertia + inertia.T))


def add_loops(
    robot: Robot, sets: Any, of_names: tuple[dict[str, dict[Any, Any]], set[str]], path: str
) -> None:
    """Add the loops of all constraint sets: rows between the same frames are one joint."""
    cuts: dict[Any, dict[str, Any]] = {}
    if sets is not None and not isinstance(sets, dict):
        raise LoadError(f"{path}: constraint_sets: no table of named sets", [])
    for set_name, rows in sorted((sets or {}).items(), key=lambda of: str(of[0])):
        for k, of in enumerate(items(rows, f"{path}: constraint_sets.{set_name}"), 1):
            where = f"{path}: constraint_sets.{set_name}[{k}]"
            kind = of.get("constraint_type")
            if kind == "contact":
                robot.notes.append(f"contact {set_name}[{k}] is left out: it closes no loop")
                continue
            if kind != "loop":
                expected = "expected loop or contact"
                raise LoadError(f"{where}: `constraint_type` is {kind!r}; {expected}", [])
            note_rest(robot, of, LOOP, f"{set_name}[{k}]")
            links, frames = ends(of, of_names, where)
            axes = of["axis_sets"] if "axis_sets" in of else [of.get("axis")]
            if not isinstance(axes, list):
                raise LoadError(f"{where}: `axis_sets` is no list of axes", [])
            key = (links, *(frame.tobytes() for frame in frames))
            cut = cuts.setdefault(key, {"links": links, "frames": frames, "rows": []})
            given = of.get("name")
            usual = f"{links[0]}_{links[1]}"
            cut.setdefault("name", given if isinstance(given, str) and given else usual)
            cut["where"] = where
            for row in axes:
                row = vector(row, 6, f"{where}.axis")
                # the sets of a motion's phases repeat their loops
                if not any(np.array_equal(row, other) for other in cut["rows"]):
                    cut["rows"].append(row)
                if len(cut["rows"]) > 6 or not 1e-9 < np.linalg.norm(row) < 1e9:
                    raise LoadError(f"{where}: an axis of zero, or more than 6 axes", [])
    used: dict[str, int] = {}
    for cut in cuts.values():
        kind, axis = joint_of(np.array(cut["rows"]), cut["where"])
        used[cut["name"]] = used.get(cut["name"], 0) + 1
        name = cut["name"] if used[cut["name"]] == 1 else f"{cut['name']}/{used[cut['name']]}"
        robot.loops.append(Loop(name, kind, cut["links"], cut["frames"], axis))


def ends(
    of: dict[Any, Any], of_names: tuple[dict[str, dict[Any, Any]], set[str]], where: str
) -> tuple[tuple[str, str], tuple[Array, Array]]:
    """Links and frames of a loop constraint."""
    local, known = of_names
    links, frames = [], []
    for end in ENDS:
        named = of.get(f"{end}_local_frame")
        if named is None:
            place, link = of.get(f"{end}_transform"), of.get(f"{end}_body")
        elif isinstance(named, str) and named in local:
            place, link = local[named], local[named].get("body")
        else:
            raise LoadError(f"{where}: {named!r} is no local frame", [])
        if not isinstance(link, str) or link not in known:
            raise LoadError(f"{where}: the {end} is {link!r}; expected a frame, or ROOT", [])
        E, r = transform(place, f"{where}.{end}_transform")
        links.append(link)
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
