"""USD stages with UsdPhysics, text or binary.

A link is a prim with `PhysicsRigidBodyAPI`; lengths, masses and angles are turned into m, kg and
rad. Joints form a tree from the world or the articulation root; joints with
`excludeFromArticulation`, and those that the tree does not need, close loops. The coordinate of a
joint is that of USD, zero where its two frames agree.
"""

import importlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan, radians
from pathlib import Path
from typing import Any

import numpy as np

from sarrus.convert.layers import checked_layers, words
from sarrus.convert.urdf import Array, Joint, Link, Loop, Robot, frame_of, inverse
from sarrus.errors import LoadError

WORLD = "world"
AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0])}
AXES |= {"Z": np.array([0.0, 0.0, 1.0])}

# attributes of bodies and joints that describe physics, those that change motion, forces and
# limits, and those of contact, of the solver and of the first state
PHYSICS = ("physics:", "drive:", "limit:", "physx", "newton:", "mjc:")
DYNAMIC: tuple[str, ...] = ("riction", "Damping", ":damping", "disableGravity", "armature")
DYNAMIC += ("frictionloss", "tiffness", "springref", "FrictionEffort", "FrictionCoefficient")
DYNAMIC += ("velocityDependentResistance", "maxActuatorVelocity", "velocityLimit", "Limit", ":low")
DYNAMIC += (":high", "newton:inertia", "mjc:target", "physxForce:force", "physxForce:torque")
DYNAMIC += (
    "mjc:coef2",
    "mjc:coef3",
    "mjc:coef4",
    "mjc:polycoef",
    "lockedPosAxis",
    "lockedRotAxis",
    "gearing",
    "referenceJoint",
    "mimicJoint",
)
HARMLESS: tuple[str, ...] = ("physics:velocity", "physics:angularVelocity", "startsAsleep")
HARMLESS += ("collisionEnabled", "breakForce", "breakTorque", "IterationCount", "Threshold")
HARMLESS += ("density", "simulationOwner")
# prims of engines that tie or drive joints, by the ends of their types
TIES = ("Joint", "Actuator", "Tendon", "Equality", "Connect", "Weld")

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
    # the name of its freedom, where it has one: that of its limits and that of its drive
    freedom: str = ""

    def reversed(self) -> "Draft":
        """The same joint with its ends exchanged; its coordinate stays."""
        bodies = (self.bodies[1], self.bodies[0])
        frames = (self.frames[1], self.frames[0])
        return replace(self, bodies=bodies, frames=frames, axis=-self.axis)


def convert(path: Path, include: list[Path]) -> Robot:
    """Convert the robot of a stage."""
    try:
        # its stubs do not hold what UsdPhysics has
        pxr: Any = importlib.import_module("pxr")
        for module in ("Ar", "Sdf", "Tf", "Usd", "UsdGeom", "UsdPhysics"):
            importlib.import_module(f"pxr.{module}")
    except ModuleNotFoundError as error:
        message = f"{path}: files of USD need a package: pip install usd-core"
        raise ModuleNotFoundError(message, name="pxr") from error
    try:
        # held, so that the stage is of the layers that were checked
        layers = checked_layers(pxr, path.absolute(), include)
        return Stage(pxr, path, layers[0]).robot()
    except (pxr.Tf.ErrorException, UnicodeError, RuntimeError) as error:
        raise LoadError(f"{path}: {words(error)}", []) from error


class Stage:
    """A stage, with its units."""

    def __init__(self, pxr: Any, path: Path, layer: Any) -> None:
        self.pxr = pxr
        self.path = path
        self.stage = pxr.Usd.Stage.Open(layer)
        for error in self.stage.GetCompositionErrors():
            raise LoadError(f"{path}: {' '.join(str(error).split())}", [])
        self.meter = pxr.UsdGeom.GetStageMetersPerUnit(self.stage)
        self.kilogram = pxr.UsdPhysics.GetStageKilogramsPerUnit(self.stage)
        if not all(1e-9 <= of <= 1e9 for of in (self.meter, self.kilogram)):
            found = f"{self.meter} and {self.kilogram}"
            raise LoadError(f"{path}: metersPerUnit and kilogramsPerUnit are {found}", [])
        self.cache = pxr.UsdGeom.XformCache()
        self.notes: list[str] = []
        self.effects: list[str] = []
        self.read: set[tuple[Any, str]] = set()
        self.still: set[Any] = set()
        # those of instances too
        usd = pxr.Usd
        self.prims = list(usd.PrimRange.Stage(self.stage, usd.TraverseInstanceProxies()))
        for prim in self.prims:
            # these would be read from files that are not layers of the stage
            if prim.HasAuthoredMetadata("clips"):
                raise self.fault(prim, "clips of values, where a robot has numbers")
        rigid = pxr.UsdPhysics.RigidBodyAPI
        self.bodies = [of for of in self.prims if of.HasAPI(rigid) and self.is_enabled(of)]
        self.joints = [of for of in self.prims if of.IsA(pxr.UsdPhysics.Joint)]
        self.names = names([of.GetPath() for of in self.bodies])
        self.of_names = {self.names[of.GetPath()]: of for of in self.bodies}
        self.of_joints = names([of.GetPath() for of in self.joints])
        self.drafts: dict[Any, Draft] = {}
        if not self.bodies:
            raise LoadError(f"{path}: no prim has PhysicsRigidBodyAPI", [])

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
        return self.value(prim, prim.GetAttribute(name))

    def value(self, prim: Any, attribute: Any) -> Any:
        """The value of an attribute at no time."""
        if not attribute:
            return None
        usd = self.pxr.Usd
        source = attribute.GetResolveInfo(usd.TimeCode.Default()).GetSource()
        # older releases have no splines
        has_spline = getattr(attribute, "HasSpline", bool)()
        moves = attribute.GetNumTimeSamples() or has_spline
        if moves and source != usd.ResolveInfoSourceDefault:
            raise self.fault(prim, f"{attribute.GetName()} has values at times only")
        return attribute.Get()

    def typed(self, prim: Any, name: str, read: Callable[[Any], Any], kind: str) -> Any:
        """The value of an attribute as one of a type, `None` without one."""
        value = self.get(prim, name)
        try:
            return None if value is None else read(value)
        except (AttributeError, TypeError, ValueError, OverflowError, KeyError) as error:
            raise self.fault(prim, f"{name} is {str(value)[:80]!r}; expected {kind}") from error

    def number(self, prim: Any, name: str, usual: float = 0.0) -> float:
        """A number of a prim, infinite only where it usually is."""
        value = self.typed(prim, name, float, "a number")
        if value is None or value == usual:
            return usual
        if isnan(value) or (not isfinite(value) and isfinite(usual)):
            raise self.fault(prim, f"{name} is {value}; expected a finite number")
        return float(value)

    def vector(self, prim: Any, name: str, usual: float) -> Array:
        """Three numbers of a prim."""
        value = self.typed(prim, name, lambda of: np.array(of, np.float64), "three numbers")
        value = np.full(3, usual) if value is None else value
        if value.shape != (3,) or np.isnan(value).any():
            raise self.fault(prim, f"{name} is {value}; expected three numbers")
        return np.array(value)

    def turn(self, prim: Any, name: str) -> Array:
        """The rotation of a quaternion of a prim; without one, or of zeros, there is none."""
        v = self.typed(
            prim, name, lambda of: np.array([of.GetReal(), *of.GetImaginary()]), "a quaternion"
        )
        if v is None or not np.any(v):
            return np.eye(3)
        if not np.isfinite(v).all():
            raise self.fault(prim, f"{name} is no rotation")
        return rotation(v)

    def report_unread(self) -> None:
        """Report physical properties of bodies and joints that were not read, and other ties."""
        for prim in self.prims:
            kind = str(prim.GetTypeName())
            if kind.endswith(TIES) and not prim.IsA(self.pxr.UsdPhysics.Joint):
                self.effects.append(f"{prim.GetPath()}: a {kind}")
        for prim in (*self.bodies, *(of.prim for of in self.drafts.values())):
            for of in prim.GetAuthoredProperties():
                name = of.GetName()
                if (prim.GetPath(), name) in self.read or not name.startswith(PHYSICS):
                    continue
                is_attribute = bool(prim.GetAttribute(name))
                value = self.value(prim, of) if is_attribute else of.GetTargets()
                message = f"{prim.GetPath()}: {name} = {str(value)[:80]}"
                if name.endswith(DYNAMIC) and counts(name, value):
                    self.effects.append(message)
                elif not name.endswith(HARMLESS):
                    self.notes.append(f"{message} is left out")

    def fault(self, prim: Any, message: str) -> LoadError:
        """An error at a prim."""
        return LoadError(f"{self.path}: {prim.GetPath()}: {message}", [])

    def check_still(self, prim: Any) -> None:
        """Check that the pose of a prim has values at no time."""
        while prim and prim.GetPath() not in self.still:
            self.still.add(prim.GetPath())
            form = self.pxr.UsdGeom.Xformable(prim)
            if form:
                steps = form.GetOrderedXformOps()
                order = self.typed(prim, "xformOpOrder", list, "names") or []
                if len(steps) != len([of for of in order if of != "!resetXformStack!"]):
                    raise self.fault(prim, "a step of xformOpOrder that is not there")
                for of in steps:
                    self.value(prim, of.GetAttr())
            prim = prim.GetParent()

    def pose(self, prim: Any) -> tuple[Array, Array]:
        """The pose of a prim in the world [m], and the lengths of its axes there."""
        self.check_still(prim)
        of = np.array(self.cache.GetLocalToWorldTransform(prim)).T
        scale = np.linalg.norm(of[:3, :3], axis=0)
        if not (scale.all() and np.isfinite(scale).all()) or list(of[3]) != [0.0, 0.0, 0.0, 1.0]:
            raise self.fault(prim, "a scale of zero, or one that is not finite")
        where = f"{self.path}: {prim.GetPath()}"
        return frame_of(of[:3, :3] / scale, of[:3, 3] * self.meter, where), scale * self.meter

    def gravity(self) -> Array:
        """Gravity in the world [m/s²]: that of the first scene, or the usual one."""
        up = str(self.pxr.UsdGeom.GetStageUpAxis(self.stage))
        if up not in AXES:
            raise LoadError(f"{self.path}: upAxis is {up!r}; expected Y or Z", [])
        down = -AXES[up]
        for scene in self.prims:
            if scene.IsA(self.pxr.UsdPhysics.Scene):
                given = self.vector(scene, "physics:gravityDirection", 0.0)
                size = self.number(scene, "physics:gravityMagnitude", -inf)
                is_on = self.get(scene, "newton:gravityEnabled") is not False
                down = given / np.linalg.norm(given) if np.any(given) else down
                return down * (self.meter * size if isfinite(size) else 9.81) * is_on
        return 9.81 * down

    def robot(self) -> Robot:
        """The whole robot."""
        name = self.stage.GetDefaultPrim().GetName() if self.stage.HasDefaultPrim() else ""
        robot = Robot(name or self.path.stem, notes=self.notes, effects=self.effects)
        for of in self.joints:
            if self.is_joint(of):
                self.drafts[of.GetPath()] = self.draft(of, self.of_joints[of.GetPath()])
        drafts = list(self.drafts.values())
        tree, loops, roots = self.spanning(drafts)
        links = {self.names[of.GetPath()]: self.link(of) for of in self.bodies}
        # a link's frame in URDF is that of its joint
        own = {draft.bodies[1]: draft.frames[1] for draft in tree}
        place = {name: inverse(own.get(name, np.eye(4))) for name in (WORLD, *links)}
        has_world = len(roots) != 1 or any(WORLD in of.bodies for of in drafts)
        gravity = self.gravity()
        if has_world:
            robot.links.append(Link(WORLD))
        for name in roots:
            origin = self.pose(self.of_names[name])[0]
            if has_world:
                free = "floating_base" if len(roots) == 1 else f"{name}/free"
                robot.joints.append(Joint(free, "floating", WORLD, name, origin))
                self.notes.append(f"{name} has no joint: it moves freely")
            else:
                gravity = origin[:3, :3].T @ gravity
        for name, link in links.items():
            r = place[name][:3, :3]
            link.com = (place[name] @ [*link.com, 1.0])[:3]
            link.inertia = symmetric(r @ link.inertia @ r.T)
            robot.links.append(link)
        for draft in tree:
            origin = place[draft.bodies[0]] @ draft.frames[0]
            joint = Joint(draft.name, draft.kind, *draft.bodies, origin, draft.axis)
            self.add_terms(draft, joint)
            robot.joints.append(joint)
        for draft in loops:
            ends = zip(draft.bodies, draft.frames, strict=True)
            frames = [place[body] @ frame for body, frame in ends]
            kind = "ball" if draft.kind == "spherical" else draft.kind
            loop = Loop(draft.name, kind, draft.bodies, (frames[0], frames[1]), draft.axis)
            robot.loops.append(loop)
            terms = Joint(draft.name, draft.kind, *draft.bodies)
            self.add_terms(draft, terms)
            if terms.dynamics or terms.is_driven or terms.limit or terms.mimic:
                message = f"{draft.prim.GetPath()} closes a loop: its limits, rotor and drive"
                self.effects.append(message)
        if not has_world:
            self.notes.append(f"{roots[0]} is the root: --floating-base lets it move freely")
        robot.note_gravity(gravity)
        self.report_unread()
        return robot

    def link(self, prim: Any) -> Link:
        """The link of a body; com and inertia in the axes of the prim, without its scale."""
        name = self.names[prim.GetPath()]
        mass = self.number(prim, "physics:mass") * self.kilogram
        moments = self.vector(prim, "physics:diagonalInertia", 0.0)
        com = self.vector(prim, "physics:centerOfMass", -inf)
        is_given = mass > 0.0 and (moments > 0.0).all() and np.isfinite([*moments, *com]).all()
        if not is_given or not prim.HasAPI(self.pxr.UsdPhysics.MassAPI):
            help_text = "write physics:mass, diagonalInertia and centerOfMass of PhysicsMassAPI"
            raise self.fault(prim, f"mass or inertia would come from its colliders; {help_text}")
        r = self.turn(prim, "physics:principalAxes")
        inertia = r @ np.diag(moments) @ r.T * (self.kilogram * self.meter**2)
        return Link(name, mass, com * self.pose(prim)[1], symmetric(inertia))

    def is_joint(self, prim: Any) -> bool:
        """False for a joint that holds nothing."""
        is_on = self.get(prim, "physics:jointEnabled") is not False
        if not is_on:
            self.notes.append(f"{prim.GetPath()} is left out: it is not enabled")
        return is_on

    def end(self, prim: Any, k: int) -> tuple[str, Array]:
        """The body of an end, and the joint's frame in it."""
        self.read.add((prim.GetPath(), f"physics:body{k}"))
        targets = prim.GetRelationship(f"physics:body{k}").GetTargets()
        p = self.vector(prim, f"physics:localPos{k}", 0.0)
        r = self.turn(prim, f"physics:localRot{k}")
        if len(targets) > 1:
            raise self.fault(prim, f"physics:body{k} names {len(targets)} prims; expected one")
        frame = self.stage.GetPrimAtPath(targets[0]) if targets else None
        is_there = frame and frame.IsActive() and frame.IsDefined() and not frame.IsAbstract()
        if targets and not is_there:
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
        letter = str(self.get(prim, "physics:axis") or "X")
        written, freedom = prim.GetTypeName(), ""
        if letter not in AXES:
            raise self.fault(prim, f"physics:axis is {letter!r}; expected X, Y or Z")
        axis = AXES[letter]
        if written in kinds:
            kind = kinds[written]
        elif written == "PhysicsJoint":
            kind, freedom = self.free(prim)
            axis = AXES[freedom[-1:] or "Z"]
        else:
            known = "a revolute, prismatic, spherical or fixed joint, or one with limits"
            raise self.fault(prim, f"a joint of type {written}; expected {known}")
        if a == b:
            raise self.fault(prim, f"both ends are {a}; expected two bodies")
        closes = bool(self.get(prim, "physics:excludeFromArticulation"))
        return Draft(name, prim, (a, b), (frame_a, frame_b), kind, axis, closes, freedom)

    def free(self, prim: Any) -> tuple[str, str]:
        """Type and freedom of a joint whose limits lock some of its freedoms."""
        locked = set()
        for freedom in (*SLIDES, *TURNS):
            names = [f"limit:{freedom}:physics:{end}" for end in ("low", "high")]
            low, high = self.number(prim, names[0], -inf), self.number(prim, names[1], inf)
            if prim.HasAPI(self.pxr.UsdPhysics.LimitAPI, freedom) and low > high:
                locked.add(freedom)
            else:
                self.read -= {(prim.GetPath(), name) for name in names}
        slides = [of for of in SLIDES if of not in locked]
        turns = [of for of in TURNS if of not in locked]
        match (len(slides), len(turns)):
            case (0, 0):
                return "fixed", ""
            case (0, 1):
                return "continuous", turns[0]
            case (1, 0):
                return "prismatic", slides[0]
            case (0, 3):
                return "spherical", ""
        expected = "one that turns about or slides along one axis, a ball joint or a fixed one"
        raise self.fault(prim, f"a joint with the freedoms {' '.join(slides + turns)}; {expected}")

    def spanning(self, drafts: list[Draft]) -> tuple[list[Draft], list[Draft], list[str]]:
        """The joints of the tree in its order, those that close loops, and the free links."""
        root_api = self.pxr.UsdPhysics.ArticulationRootAPI
        order = [WORLD]
        # an articulation root is a body, a joint of the world or a prim above them
        order += [self.names[of.GetPath()] for of in self.bodies if of.HasAPI(root_api)]
        order += list(self.names.values())
        of_body: dict[str, list[Draft]] = {name: [] for name in order}
        for draft in drafts:
            for body in draft.bodies if not draft.closes else ():
                of_body[body].append(draft)
        tree: list[Draft] = []
        roots: list[str] = []
        reached: set[str] = set()
        used: set[str] = set()
        for start in order:
            if start in reached:
                continue
            reached.add(start)
            if start != WORLD:
                roots.append(start)
            queue = [start]
            for at in queue:
                for draft in [of for of in of_body[at] if of.name not in used]:
                    used.add(draft.name)
                    one = draft if draft.bodies[0] == at else draft.reversed()
                    if one.bodies[1] in reached:
                        draft.closes = True
                        continue
                    reached.add(one.bodies[1])
                    tree.append(one)
                    queue.append(one.bodies[1])
        return tree, [of for of in drafts if of.closes], roots

    def unit(self, kind: str) -> float:
        """The rad or m in the unit of a coordinate."""
        return radians(1.0) if kind == "continuous" else self.meter

    def add_terms(self, draft: Draft, joint: Joint) -> None:
        """Limits, drive and terms of a joint of one freedom."""
        prim = draft.prim
        if draft.kind not in ("continuous", "prismatic"):
            return
        is_turn = draft.kind == "continuous"
        length = self.unit(draft.kind)
        limits = ["physics:lowerLimit", "physics:upperLimit"]
        if draft.freedom:
            limits = [f"limit:{draft.freedom}:physics:{end}" for end in ("low", "high")]
        ends = (self.number(prim, limits[0], -inf), self.number(prim, limits[1], inf))
        if ends[0] > ends[1]:
            raise self.fault(prim, "its lower limit is above the upper one: it is locked")
        for name, value in zip(("lower", "upper"), ends, strict=True):
            if isfinite(value):
                joint.limit[name] = value * length
                joint.kind = "revolute" if is_turn else joint.kind
        self.add_drive(draft, is_turn, joint)
        armature = self.number(prim, "physxJoint:armature")
        if armature:
            unit = self.kilogram * (self.meter**2 if is_turn else 1.0)
            joint.dynamics = {"damping": 0.0, "rotor_inertia": armature * unit}
        speed = self.number(prim, "physxJoint:maxJointVelocity", inf)
        if isfinite(speed) and speed < 1e5:
            joint.limit["velocity"] = speed * length
        joint.mimic = self.mimic(draft)

    def add_drive(self, draft: Draft, is_turn: bool, joint: Joint) -> None:
        """A drive as an actuator, whose stiffness and damping belong to its controller."""
        prim = draft.prim
        drive = f"drive:{draft.freedom or ('angular' if is_turn else 'linear')}:physics"
        if not prim.GetAttribute(f"{drive}:stiffness"):
            return
        most = self.number(prim, f"{drive}:maxForce", inf)
        gains = [self.number(prim, f"{drive}:{of}") for of in ("stiffness", "damping")]
        for of in ("type", "targetPosition", "targetVelocity"):
            self.get(prim, f"{drive}:{of}")
        # one without gains does nothing where a loop closes
        joint.is_driven = any(gains) or not draft.closes
        if isfinite(most) and joint.is_driven:
            unit = self.kilogram * self.meter * (self.meter if is_turn else 1.0)
            joint.limit["effort"] = most * unit
        if any(gains):
            note = "stiffness and damping of its drive are its controller's: they are left out"
            self.notes.append(f"{joint.name}: {note}")

    def mimic(self, draft: Draft) -> tuple[str, float, float] | None:
        """Leader, factor and offset of a joint that follows another one.

        PhysX: q + gearing · leader + offset = 0. Newton: q = offset + factor · leader. Both count
        degrees and the stage's lengths.
        """
        prim = draft.prim
        # the schemas of engines are unknown to USD: their properties tell
        authored = [of.GetName() for of in prim.GetAuthoredProperties()]
        found = []
        for of in sorted({":".join(of.split(":")[:2]) for of in authored}):
            if of.startswith("physxMimicJoint:"):
                terms = (self.number(prim, f"{of}:gearing", 1.0), self.number(prim, f"{of}:offset"))
                self.get(prim, f"{of}:referenceJointAxis")
                found.append((f"{of}:referenceJoint", -terms[0], -terms[1]))
        if any(of.startswith("newton:mimic") for of in authored):
            offset = self.number(prim, "newton:mimicCoef0")
            factor = self.number(prim, "newton:mimicCoef1", 1.0)
            if self.get(prim, "newton:mimicEnabled") is not False:
                found.append(("newton:mimicJoint", factor, offset))
            self.read.add((prim.GetPath(), "newton:mimicJoint"))
            ends = [prim.GetRelationship(of) for of in ("newton:mimicJoint", "mjc:target")]
            if all(ends) and ends[0].GetTargets() == ends[1].GetTargets():
                # MuJoCo's own words for the same
                self.read.add((prim.GetPath(), "mjc:target"))
        mimics: list[tuple[str, float, float]] = []
        for relation, factor, offset in found:
            self.read.add((prim.GetPath(), relation))
            targets = prim.GetRelationship(relation).GetTargets()
            leader = self.drafts.get(targets[0]) if len(targets) == 1 else None
            kinds = ("continuous", "prismatic")
            is_known = leader is not None and leader is not draft and not leader.closes
            if leader is None or not is_known or leader.kind not in kinds:
                raise self.fault(prim, f"{relation} names no joint of the tree with one freedom")
            unit = self.unit(draft.kind)
            mimics.append((leader.name, factor * unit / self.unit(leader.kind), offset * unit))
        if any(
            of[0] != mimics[0][0] or not np.allclose(of[1:], mimics[0][1:], 1e-5, 1e-7)
            for of in mimics
        ):
            raise self.fault(prim, f"it follows {' and '.join(str(of) for of in mimics)}")
        return mimics[0] if mimics else None


def counts(name: str, value: Any) -> bool:
    """True for a value that is not that of no effect: zero, or a limit of none."""
    try:
        numbers = np.array(value, np.float64)
    except (TypeError, ValueError):
        return bool(value)
    if "coneAngle" in name:
        return bool((numbers >= 0.0).any())
    return bool((numbers[np.isfinite(numbers)] != 0.0).any() or np.isnan(numbers).any())


def rotation(v: Array) -> Array:
    """The rotation of a quaternion, its real part first."""
    w, x, y, z = v / np.linalg.norm(v)
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
    count = Counter(path.name for path in paths)
    of = {}
    for path in paths:
        whole = path.pathString.strip("/")
        name = path.name if count[path.name] == 1 else whole
        of[path] = path.pathString if name == WORLD else name
    return of
