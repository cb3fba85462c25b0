"""USD stages with UsdPhysics, text or binary.

A link is a prim with `PhysicsRigidBodyAPI`; lengths, masses and angles are turned into m, kg and
rad. Joints form a tree from the world or the articulation root; joints with
`excludeFromArticulation`, and those that the tree does not need, close loops. The coordinate of a
joint is that of USD, zero where its two frames agree.
"""

import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees, inf, isfinite, radians
from pathlib import Path
from typing import Any

import numpy as np

from sarrus.convert.urdf import Array, Joint, Link, Loop, Robot, frame_of, inverse
from sarrus.errors import LoadError

WORLD = "world"
AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0])}
AXES |= {"Z": np.array([0.0, 0.0, 1.0])}

# attributes of bodies and joints that describe physics, those that change motion and forces, and
# those of contact, of the solver and of the first state
PHYSICS = ("physics:", "drive:", "limit:", "physx", "newton:", "mjc:")
DYNAMIC: tuple[str, ...] = ("jointFriction", "linearDamping", "angularDamping", "disableGravity")
DYNAMIC += ("frictionloss", "stiffness", "springref", ":damping")
HARMLESS: tuple[str, ...] = ("physics:velocity", "physics:angularVelocity", "startsAsleep")
HARMLESS += ("collisionEnabled", "breakForce", "breakTorque", "IterationCount", "Threshold")
HARMLESS += ("density",)

# the freedoms of a joint without a type, as its limits leave them
TURNS = ("rotX", "rotY", "rotZ")
SLIDES = ("transX", "transY", "transZ")


@dataclass
class Draft:
    """A joint as written: bodies, frames in these, type of URDF and axis."""

    name: str
    prim: Any
    bodies: tuple[str, str]
    frames: tuple[Array, Array]
    kind: str
    axis: Array
    closes: bool

    def reversed(self) -> "Draft":
        """The same joint with its ends exchanged; its coordinate stays."""
        ends = (self.bodies[1], self.bodies[0]), (self.frames[1], self.frames[0])
        return Draft(self.name, self.prim, *ends, self.kind, -self.axis, self.closes)


def convert(path: Path, include: list[Path]) -> Robot:
    """Convert the robot of a stage."""
    try:
        # its stubs do not hold what UsdPhysics has
        pxr: Any = importlib.import_module("pxr")
        for module in ("Sdf", "Usd", "UsdGeom", "UsdPhysics"):
            importlib.import_module(f"pxr.{module}")
    except ModuleNotFoundError as error:
        message = f"{path}: files of USD need a package: pip install usd-core"
        raise ModuleNotFoundError(message, name="pxr") from error
    check_files(pxr, path, include)
    return Stage(pxr, path).robot()


def check_files(pxr: Any, path: Path, include: list[Path]) -> None:
    """Follow the layers that a file names, each only below the file's folder or an included one."""
    allowed = [folder.resolve() for folder in (path.parent, *include)]
    todo, seen = [path.resolve()], set()
    while todo:
        file = todo.pop()
        if file in seen:
            continue
        seen.add(file)
        try:
            layer = pxr.Sdf.Layer.FindOrOpen(str(file))
        except pxr.Tf.ErrorException as error:
            # behind the place in the sources of USD
            said = " ".join(str(error).split(" : ", 1)[-1].split()).strip("' ")
            raise LoadError(f"{file}: {said}", []) from error
        if layer is None:
            raise LoadError(f"{file}: no file of USD, or none that can be read", [])
        for name in layer.GetCompositionAssetDependencies():
            inner = Path(layer.ComputeAbsolutePath(name)).resolve()
            if not any(inner.is_relative_to(folder) for folder in allowed):
                flag = f"--include-dir={inner.parent}"
                raise LoadError(f"{file}: it names {inner}, outside of its folder; {flag}", [])
            todo.append(inner)


class Stage:
    """A stage, with its units."""

    def __init__(self, pxr: Any, path: Path) -> None:
        self.pxr = pxr
        self.path = path
        self.stage = pxr.Usd.Stage.Open(str(path))
        self.meter = pxr.UsdGeom.GetStageMetersPerUnit(self.stage)
        self.kilogram = pxr.UsdPhysics.GetStageKilogramsPerUnit(self.stage)
        self.cache = pxr.UsdGeom.XformCache()
        self.notes: list[str] = []
        self.read: set[tuple[Any, str]] = set()
        rigid = pxr.UsdPhysics.RigidBodyAPI
        self.bodies = [of for of in self.prims() if of.HasAPI(rigid) and self.is_enabled(of)]
        self.names = names([of.GetPath() for of in self.bodies])
        if not self.bodies:
            raise LoadError(f"{path}: no prim has PhysicsRigidBodyAPI", [])

    def prims(self) -> Iterator[Any]:
        """All prims, those of instances too."""
        usd = self.pxr.Usd
        yield from usd.PrimRange.Stage(self.stage, usd.TraverseInstanceProxies())

    def is_enabled(self, prim: Any) -> bool:
        """False for a body that does not move."""
        is_on = self.get(prim, "physics:rigidBodyEnabled") is not False
        if not is_on or self.get(prim, "physics:kinematicEnabled"):
            self.notes.append(f"{prim.GetPath()} is part of the world: it does not move freely")
            return False
        return True

    def get(self, prim: Any, name: str) -> Any:
        """The value of an attribute, which counts as read; `None` without one."""
        self.read.add((prim.GetPath(), name))
        return prim.GetAttribute(name).Get()

    def report_unread(self, robot: Robot) -> None:
        """Report the physical attributes of bodies and joints that were not read."""
        places = [*self.bodies, *(of for of in self.prims() if of.IsA(self.pxr.UsdPhysics.Joint))]
        for prim in places:
            for attribute in prim.GetAuthoredAttributes():
                name, value = attribute.GetName(), attribute.Get()
                if (prim.GetPath(), name) in self.read or not name.startswith(PHYSICS):
                    continue
                message = f"{prim.GetPath()}: {name} = {value}"
                if name.endswith(DYNAMIC) and value:
                    robot.effects.append(message)
                elif not name.endswith(HARMLESS):
                    robot.notes.append(f"{message} is left out")

    def fault(self, prim: Any, message: str) -> LoadError:
        """An error at a prim."""
        return LoadError(f"{self.path}: {prim.GetPath()}: {message}", [])

    def pose(self, prim: Any) -> tuple[Array, Array]:
        """The pose of a prim in the world [m], and the lengths of its axes there."""
        of = np.array(self.cache.GetLocalToWorldTransform(prim)).T
        scale = np.linalg.norm(of[:3, :3], axis=0)
        if not scale.all():
            raise self.fault(prim, "a scale of zero")
        where = f"{self.path}: {prim.GetPath()}"
        return frame_of(of[:3, :3] / scale, of[:3, 3] * self.meter, where), scale * self.meter

    def robot(self) -> Robot:
        """The whole robot."""
        name = self.stage.GetDefaultPrim().GetName() if self.stage.HasDefaultPrim() else ""
        robot = Robot(name or self.path.stem, notes=self.notes)
        joints = [of for of in self.prims() if of.IsA(self.pxr.UsdPhysics.Joint)]
        of_joints = names([of.GetPath() for of in joints])
        drafts = [self.draft(of, of_joints[of.GetPath()]) for of in joints if self.is_joint(of)]
        tree, loops, roots = self.spanning(drafts)
        links = {self.names[of.GetPath()]: self.link(of) for of in self.bodies}
        # a link's frame in URDF is that of its joint
        own = {draft.bodies[1]: draft.frames[1] for draft in tree}
        place = {name: inverse(own.get(name, np.eye(4))) for name in (WORLD, *links)}
        has_world = len(roots) != 1 or any(WORLD in of.bodies for of in drafts)
        if has_world:
            robot.links.append(Link(WORLD))
        for name in roots:
            if has_world:
                origin = self.pose(self.body(name))[0]
                free = "floating_base" if len(roots) == 1 else f"{name}/free"
                robot.joints.append(Joint(free, "floating", WORLD, name, origin))
                self.notes.append(f"{name} has no joint: it moves freely")
        for name, link in links.items():
            r = place[name][:3, :3]
            link.com = (place[name] @ [*link.com, 1.0])[:3]
            link.inertia = symmetric(r @ link.inertia @ r.T)
            robot.links.append(link)
        for draft in tree:
            origin = place[draft.bodies[0]] @ draft.frames[0]
            joint = Joint(draft.name, draft.kind, *draft.bodies, origin, draft.axis)
            self.add_terms(draft, joint, of_joints)
            robot.joints.append(joint)
        for draft in loops:
            ends = zip(draft.bodies, draft.frames, strict=True)
            frames = [place[body] @ frame for body, frame in ends]
            kind = "ball" if draft.kind == "spherical" else draft.kind
            loop = Loop(draft.name, kind, draft.bodies, (frames[0], frames[1]), draft.axis)
            robot.loops.append(loop)
            terms = Joint(draft.name, draft.kind, *draft.bodies)
            self.add_terms(draft, terms, of_joints)
            if terms.dynamics or terms.is_driven or terms.limit or terms.mimic:
                self.notes.append(f"{draft.name} closes a loop: its limits and drive are left out")
        if not has_world:
            self.notes.append(f"{roots[0]} is the root: --floating-base lets it move freely")
        self.report_unread(robot)
        return robot

    def body(self, name: str) -> Any:
        """The prim of a body."""
        return next(of for of in self.bodies if self.names[of.GetPath()] == name)

    def link(self, prim: Any) -> Link:
        """The link of a body; com and inertia in the axes of the prim, without its scale."""
        name = self.names[prim.GetPath()]
        mass = self.number(prim, "physics:mass") * self.kilogram
        moments = np.array(self.get(prim, "physics:diagonalInertia") or (0.0, 0.0, 0.0))
        com = np.array(self.get(prim, "physics:centerOfMass") or (-inf, -inf, -inf))
        if not mass > 0.0 or not moments.all() or not np.isfinite(com).all():
            help_text = "write physics:mass, diagonalInertia and centerOfMass of PhysicsMassAPI"
            raise self.fault(prim, f"mass or inertia would come from its colliders; {help_text}")
        axes = self.get(prim, "physics:principalAxes")
        # without one all four numbers are zero
        has_axes = axes is not None and any((axes.GetReal(), *axes.GetImaginary()))
        r = rotation(axes) if has_axes else np.eye(3)
        inertia = r @ np.diag(moments) @ r.T * (self.kilogram * self.meter**2)
        return Link(name, mass, com * self.pose(prim)[1], symmetric(inertia))

    def number(self, prim: Any, name: str, usual: float = 0.0) -> float:
        """A finite number of a prim."""
        value = self.get(prim, name)
        return float(value) if value is not None and isfinite(value) else usual

    def is_joint(self, prim: Any) -> bool:
        """False for a joint that holds nothing."""
        is_on = self.get(prim, "physics:jointEnabled") is not False
        if not is_on:
            self.notes.append(f"{prim.GetPath()} is left out: it is not enabled")
        return is_on

    def end(self, prim: Any, k: int) -> tuple[str, Array]:
        """The body of an end, and the joint's frame in it."""
        targets = prim.GetRelationship(f"physics:body{k}").GetTargets()
        p = np.array(self.get(prim, f"physics:localPos{k}") or (0.0, 0.0, 0.0))
        quaternion = self.get(prim, f"physics:localRot{k}")
        r = np.eye(3) if quaternion is None else rotation(quaternion)
        if len(targets) > 1:
            raise self.fault(prim, f"physics:body{k} names {len(targets)} prims; expected one")
        frame = self.stage.GetPrimAtPath(targets[0]) if targets else None
        if targets and not frame:
            raise self.fault(prim, f"physics:body{k} is {targets[0]}; expected a prim")
        pose, scale = self.pose(frame) if frame else (np.eye(4), np.full(3, self.meter))
        at = pose @ frame_of(r, p * scale, f"{self.path}: {prim.GetPath()}")
        while frame and frame.GetPath() not in self.names:
            frame = frame.GetParent()
        if not frame:
            return WORLD, at
        body_pose, _ = self.pose(frame)
        return self.names[frame.GetPath()], inverse(body_pose) @ at

    def draft(self, prim: Any, name: str) -> Draft:
        """A joint as written."""
        (a, frame_a), (b, frame_b) = self.end(prim, 0), self.end(prim, 1)
        kinds = {"PhysicsRevoluteJoint": "continuous", "PhysicsPrismaticJoint": "prismatic"}
        kinds |= {"PhysicsSphericalJoint": "spherical", "PhysicsFixedJoint": "fixed"}
        axis = AXES[self.get(prim, "physics:axis") or "X"]
        written = prim.GetTypeName()
        if written in kinds:
            kind = kinds[written]
        elif written == "PhysicsJoint":
            kind, axis = self.free(prim)
        else:
            known = "a revolute, prismatic, spherical or fixed joint, or one with limits"
            raise self.fault(prim, f"a joint of type {written}; expected {known}")
        if a == b:
            raise self.fault(prim, f"both ends are {a}; expected two bodies")
        closes = bool(self.get(prim, "physics:excludeFromArticulation"))
        return Draft(name, prim, (a, b), (frame_a, frame_b), kind, axis, closes)

    def free(self, prim: Any) -> tuple[str, Array]:
        """Type and axis of a joint whose limits lock some of its freedoms."""
        api = self.pxr.UsdPhysics.LimitAPI
        locked = set()
        for freedom in (*SLIDES, *TURNS):
            low, high = (
                self.get(prim, f"limit:{freedom}:physics:{end}") for end in ("low", "high")
            )
            if prim.HasAPI(api, freedom) and low is not None and high is not None and low > high:
                locked.add(freedom)
        slides = [of for of in SLIDES if of not in locked]
        turns = [of for of in TURNS if of not in locked]
        match (len(slides), len(turns)):
            case (0, 0):
                return "fixed", AXES["Z"]
            case (0, 1):
                return "continuous", AXES[turns[0][-1]]
            case (1, 0):
                return "prismatic", AXES[slides[0][-1]]
            case (0, 3):
                return "spherical", AXES["Z"]
        expected = "one that turns about or slides along one axis, a ball joint or a fixed one"
        raise self.fault(prim, f"a joint with the freedoms {' '.join(slides + turns)}; {expected}")

    def spanning(self, drafts: list[Draft]) -> tuple[list[Draft], list[Draft], list[str]]:
        """The joints of the tree in its order, those that close loops, and the free links."""
        root_api = self.pxr.UsdPhysics.ArticulationRootAPI
        order = [WORLD]
        # an articulation root is a body, a joint of the world or a prim above them
        order += [self.names[of.GetPath()] for of in self.bodies if of.HasAPI(root_api)]
        order += list(self.names.values())
        rest = [of for of in drafts if not of.closes]
        tree: list[Draft] = []
        roots: list[str] = []
        reached: set[str] = set()
        for start in order:
            if start in reached:
                continue
            reached.add(start)
            if start != WORLD:
                roots.append(start)
            queue = [start]
            while queue:
                at = queue.pop(0)
                for draft in [of for of in rest if at in of.bodies]:
                    rest.remove(draft)
                    one = draft if draft.bodies[0] == at else draft.reversed()
                    if one.bodies[1] in reached:
                        draft.closes = True
                        continue
                    reached.add(one.bodies[1])
                    tree.append(one)
                    queue.append(one.bodies[1])
        return tree, [of for of in drafts if of.closes], roots

    def add_terms(self, draft: Draft, joint: Joint, names: dict[Any, str]) -> None:
        """Limits, drive and terms of a joint of one freedom."""
        prim = draft.prim
        if draft.kind not in ("continuous", "prismatic"):
            return
        is_turn = draft.kind == "continuous"
        length = radians(1.0) if is_turn else self.meter
        ends = [self.get(prim, f"physics:{end}Limit") for end in ("lower", "upper")]
        if prim.GetTypeName() == "PhysicsJoint":
            letter = "XYZ"[int(np.argmax(np.abs(draft.axis)))]
            freedom = f"{'rot' if is_turn else 'trans'}{letter}"
            ends = [self.get(prim, f"limit:{freedom}:physics:{end}") for end in ("low", "high")]
        if all(of is not None and isfinite(of) for of in ends):
            if ends[0] > ends[1]:
                raise self.fault(prim, "its lower limit is above the upper one: it is locked")
            joint.limit = {"lower": ends[0] * length, "upper": ends[1] * length}
            joint.kind = "revolute" if is_turn else joint.kind
        elif any(of is not None and isfinite(of) for of in ends):
            self.notes.append(f"{draft.name} has a limit on one side only: it is left out")
        self.add_drive(prim, is_turn, joint)
        armature = self.number(prim, "physxJoint:armature")
        if armature:
            unit = self.kilogram * (self.meter**2 if is_turn else 1.0)
            joint.dynamics = {"damping": 0.0, "rotor_inertia": armature * unit}
        speed = self.number(prim, "physxJoint:maxJointVelocity", inf)
        if isfinite(speed) and speed < 1e5:
            joint.limit["velocity"] = speed * length
        for of in prim.GetAppliedSchemas():
            if of.startswith("PhysxMimicJointAPI:"):
                joint.mimic = self.mimic(prim, of.split(":")[1], is_turn, names)

    def add_drive(self, prim: Any, is_turn: bool, joint: Joint) -> None:
        """A drive as an actuator, whose stiffness and damping belong to its controller."""
        drive = f"drive:{'angular' if is_turn else 'linear'}:physics"
        if not prim.GetAttribute(f"{drive}:stiffness"):
            return
        joint.is_driven = True
        most = self.number(prim, f"{drive}:maxForce", inf)
        if isfinite(most):
            unit = self.kilogram * self.meter * (self.meter if is_turn else 1.0)
            joint.limit["effort"] = most * unit
        gains = [self.number(prim, f"{drive}:{of}") for of in ("stiffness", "damping")]
        for of in ("type", "targetPosition", "targetVelocity"):
            self.get(prim, f"{drive}:{of}")
        if any(gains):
            note = "stiffness and damping of its drive are its controller's: they are left out"
            self.notes.append(f"{joint.name}: {note}")

    def mimic(
        self, prim: Any, freedom: str, is_turn: bool, names: dict[Any, str]
    ) -> tuple[str, float, float]:
        """Leader, factor and offset of q + gearing · leader + offset = 0."""
        of = f"physxMimicJoint:{freedom}"
        targets = prim.GetRelationship(f"{of}:referenceJoint").GetTargets()
        if len(targets) != 1 or targets[0] not in names:
            raise self.fault(prim, f"{of}:referenceJoint names no joint")
        is_slide = self.stage.GetPrimAtPath(targets[0]).GetTypeName() == "PhysicsPrismaticJoint"
        unit = radians(1.0) if is_turn else self.meter
        # gearing counts degrees and the stage's lengths
        factor = -self.number(prim, f"{of}:gearing", 1.0) * unit
        factor *= 1.0 / self.meter if is_slide else degrees(1.0)
        return names[targets[0]], factor, -self.number(prim, f"{of}:offset") * unit


def rotation(quaternion: Any) -> Array:
    """The rotation of a quaternion of USD."""
    x, y, z = quaternion.GetImaginary()
    v = np.array([quaternion.GetReal(), x, y, z], dtype=np.float64)
    length = np.linalg.norm(v)
    if not np.isfinite(length) or length == 0.0:
        raise LoadError("an orientation that is no rotation", [])
    w, x, y, z = v / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def symmetric(of: Array) -> Array:
    """A matrix without the rounding that makes it unsymmetric."""
    return 0.5 * (of + of.T)


def names(paths: list[Any]) -> dict[Any, str]:
    """Names of prims: the last part of a path, or all of it where two share that."""
    last = [path.name for path in paths]
    return {
        path: name if last.count(name) == 1 and name != WORLD else path.pathString.strip("/")
        for path, name in zip(paths, last, strict=True)
    }
