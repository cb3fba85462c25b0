"""Robots of USD, where the package that reads these is installed."""

import importlib.util
import os
import unittest
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sarrus
from sarrus import convert
from test_convert import Files

HAS_USD = importlib.util.find_spec("pxr") is not None

STAGE = """#usda 1.0
( defaultPrim = "four"
  metersPerUnit = 0.01
  upAxis = "Z" )
def Xform "four" (prepend apiSchemas = ["PhysicsArticulationRootAPI"])
{
    def Xform "base" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
    { BODY
      float physics:mass = 2
      point3f physics:centerOfMass = (0, 0, 0) }
    def Xform "crank" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
    { double3 xformOp:translate = (0, 0, 10)
      uniform token[] xformOpOrder = ["xformOp:translate"]
      BODY
      float physics:mass = 1
      point3f physics:centerOfMass = (0, 0, 0) }
    def Xform "coupler" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
    { double3 xformOp:translate = (20, 0, 20)
      float3 xformOp:scale = (2, 2, 2)
      uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
      BODY
      quatf physics:principalAxes = (0.5, 0.5, 0.5, 0.5)
      float physics:mass = 1.5
      point3f physics:centerOfMass = (0.5, 0, 0) }
    def Xform "rocker" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
    { double3 xformOp:translate = (40, 0, 10)
      uniform token[] xformOpOrder = ["xformOp:translate"]
      BODY
      float physics:mass = 1
      point3f physics:centerOfMass = (0, 0, 2) }
    def PhysicsRevoluteJoint "a" (prepend apiSchemas = ["PhysicsDriveAPI:angular"])
    { uniform token physics:axis = "Y"
      rel physics:body0 = </four/base>
      rel physics:body1 = </four/crank>
      point3f physics:localPos1 = (0, 0, -10)
      float physics:lowerLimit = -60
      float physics:upperLimit = 60
      float drive:angular:physics:stiffness = 100
      float drive:angular:physics:damping = 0
      float drive:angular:physics:maxForce = 50000
      float physxJoint:armature = 10 }
    def PhysicsRevoluteJoint "b"
    { uniform token physics:axis = "Y"
      rel physics:body0 = </four/coupler>
      rel physics:body1 = </four/crank>
      point3f physics:localPos0 = (-10, 0, 0)
      point3f physics:localPos1 = (0, 0, 10) }
    def PhysicsRevoluteJoint "d"
    { uniform token physics:axis = "Y"
      rel physics:body0 = </four/base>
      rel physics:body1 = </four/rocker>
      point3f physics:localPos0 = (40, 0, 0)
      point3f physics:localPos1 = (0, 0, -10) }
    def PhysicsJoint "c" (prepend apiSchemas = ["PhysicsLimitAPI:rotX", "PhysicsLimitAPI:rotZ",
        "PhysicsLimitAPI:transX", "PhysicsLimitAPI:transY", "PhysicsLimitAPI:transZ"])
    { rel physics:body0 = </four/coupler>
      rel physics:body1 = </four/rocker>
      point3f physics:localPos0 = (10, 0, 0)
      point3f physics:localPos1 = (0, 0, 10)
      LOCKED
      uniform bool physics:excludeFromArticulation = 1 }
}
"""
# a closing brace stands on a line of its own
STAGE = STAGE.replace(" }\n", "\n    }\n")
STAGE = STAGE.replace("BODY", "float3 physics:diagonalInertia = (20, 30, 40)").replace(
    "LOCKED",
    "\n".join(
        f"float limit:{of}:physics:{end} = {value}"
        for of in ("rotX", "rotZ", "transX", "transY", "transZ")
        for end, value in (("low", 1), ("high", -1))
    ),
)

HEAD = '#usda 1.0\n( upAxis = "Z"\n metersPerUnit = 1 )\n'
BODY = """def Xform "{0}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
{{ float physics:mass = 1
  float3 physics:diagonalInertia = (1, 1, 2)
  point3f physics:centerOfMass = (0, 0, 0)
  TERMS
}}
"""
BODIES = BODY.format("a") + BODY.format("b")
JOINT = """def PhysicsRevoluteJoint "j"
{ rel physics:body0 = </a>
  rel physics:body1 = </b>
  uniform token physics:axis = "Z"
  TERMS
  }
"""
PAIR = BODIES + JOINT

# the same by hand; the coupler's axes are turned, so that its moments are 40, 20, 30
LINK = """<link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/>
<inertia ixx="{3}" iyy="{4}" izz="{5}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
HINGE = """<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/>
<origin xyz="{3}"/><axis xyz="0 {4} 0"/>{5}</joint>"""
FOUR = (
    '<robot name="four" version="1.2">'
    + LINK.format("base", "0 0 0", 2, 0.002, 0.003, 0.004)
    + LINK.format("crank", "0 0 0.1", 1, 0.002, 0.003, 0.004)
    + LINK.format("coupler", "0.21 0 0", 1.5, 0.004, 0.002, 0.003)
    + LINK.format("rocker", "0 0 0.12", 1, 0.002, 0.003, 0.004)
    + HINGE.format(
        "a", "base", "crank", "0 0 0", 1, '<dynamics damping="0" rotor_inertia="0.001"/>'
    )
    + HINGE.format("b", "crank", "coupler", "0 0 0.2", -1, "")
    + HINGE.format("d", "base", "rocker", "0.4 0 0", 1, "")
    + "</robot>"
)
FOUR_LOOPS = """submechanisms:
- contextual_name: bars
  type: NUMERICAL
  jointnames: [a, b, d]
  jointnames_spanningtree: [a, b, d]
  jointnames_active: [a]
  jointnames_independent: [a]
  loop_constraints:
  - cut_joint: c
    predecessor_body: coupler
    predecessor_placement: {xyz: [0.4, 0, 0]}
    successor_body: rocker
    successor_placement: {xyz: [0, 0, 0.2]}
    cut_joint_type: revolute
    axis: [0, 1, 0]
"""


@dataclass
class Hinged:
    """A random body and the joint to its parent, as USD defines them; lengths in metres."""

    parent: int
    kind: str
    axis: np.ndarray
    # the parent is the second body of the joint
    is_reversed: bool
    frames: list[np.ndarray]
    mass: float
    com: np.ndarray
    inertia: np.ndarray


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """The rotation of a quaternion, by the turned axes."""
    w, v = quaternion[0], quaternion[1:]
    columns = [x + 2 * w * np.cross(v, x) + 2 * np.cross(v, np.cross(v, x)) for x in np.eye(3)]
    return np.array(columns).T


def random_tree(file: Path, seed: int) -> list[Hinged]:
    """A stage of bodies in any poses, scales and units, with joints in any frames."""
    from pxr import Gf, Usd, UsdGeom, UsdPhysics

    of = np.random.default_rng(seed)
    stage = Usd.Stage.CreateNew(str(file))
    meter, kilogram = of.choice([1, 0.01]), of.choice([1, 0.001])
    UsdGeom.SetStageMetersPerUnit(stage, meter)
    UsdPhysics.SetStageKilogramsPerUnit(stage, kilogram)

    def three(size: float) -> np.ndarray:
        return np.float32(of.normal(size=3) * size).astype(float)

    def quaternion() -> np.ndarray:
        v = of.normal(size=4)
        return np.float32(v / np.linalg.norm(v)).astype(float)

    root = UsdGeom.Xform.Define(stage, "/r")
    root.AddOrientOp().Set(Gf.Quatf(*quaternion()))
    bodies: list[Hinged] = []
    scales: list[np.ndarray] = []
    for k in range(4):
        body = UsdGeom.Xform.Define(stage, f"/r/b{k}")
        body.AddTranslateOp().Set(Gf.Vec3d(*three(1)))
        body.AddOrientOp().Set(Gf.Quatf(*quaternion()))
        scale = 1 + np.abs(three(1))
        body.AddScaleOp().Set(Gf.Vec3f(*scale))
        scale = np.float32(scale).astype(float)
        UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
        mass = UsdPhysics.MassAPI.Apply(body.GetPrim())
        com, axes, moments = three(0.3), quaternion(), 1 + 0.25 * k + np.array([0, 0.25, 0.5])
        mass.CreateMassAttr(1.5 + k)
        mass.CreateCenterOfMassAttr(Gf.Vec3f(*com))
        mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments))
        mass.CreatePrincipalAxesAttr(Gf.Quatf(*axes))
        letter, parent = of.integers(3), of.integers(-1, k) if k else -1
        kind, is_reversed = str(of.choice(["rot", "trans"])), bool(of.integers(2))
        path, freedom = f"/r/j{k}", kind + "XYZ"[letter]
        if of.integers(2):
            joint = UsdPhysics.Joint.Define(stage, path)
            for name in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ"):
                if name != freedom:
                    limit = UsdPhysics.LimitAPI.Apply(joint.GetPrim(), name)
                    limit.CreateLowAttr(1)
                    limit.CreateHighAttr(-1)
        else:
            typed = UsdPhysics.RevoluteJoint if kind == "rot" else UsdPhysics.PrismaticJoint
            joint = typed.Define(stage, path)
            joint.CreateAxisAttr("XYZ"[letter])
        scales.append(scale * meter)
        frames = []
        for end, index in enumerate((k, parent) if is_reversed else (parent, k)):
            p, turn, frame = three(0.4), quaternion(), np.eye(4)
            getattr(joint, f"CreateLocalPos{end}Attr")(Gf.Vec3f(*p))
            getattr(joint, f"CreateLocalRot{end}Attr")(Gf.Quatf(*turn))
            frame[:3, :3] = rotation(turn / np.linalg.norm(turn))
            frame[:3, 3] = p * (scales[index] if index >= 0 else meter)
            frames.append(frame)
            if index >= 0:
                getattr(joint, f"CreateBody{end}Rel")().SetTargets([f"/r/b{index}"])
        r = rotation(axes / np.linalg.norm(axes))
        inertia = r @ np.diag(moments) @ r.T * kilogram * meter**2
        sizes = (1.5 + k) * kilogram, com * scale * meter, inertia
        bodies.append(Hinged(parent, kind, np.eye(3)[letter], is_reversed, frames, *sizes))
    stage.Save()
    return bodies


def poses(bodies: list[Hinged], q: np.ndarray) -> list[np.ndarray]:
    """Poses of the bodies: the second frame of a joint moves in the first by q."""
    found: list[np.ndarray] = []
    for body, value in zip(bodies, q, strict=True):
        moved = np.eye(4)
        if body.kind == "rot":
            moved[:3, :3] = rotation(np.append(np.cos(value / 2), np.sin(value / 2) * body.axis))
        else:
            moved[:3, 3] = value * body.axis
        second = body.frames[0] @ moved @ np.linalg.inv(body.frames[1])
        parent = found[body.parent] if body.parent >= 0 else np.eye(4)
        found.append(parent @ (np.linalg.inv(second) if body.is_reversed else second))
    return found


def mass_matrix(bodies: list[Hinged], q: np.ndarray) -> np.ndarray:
    """Σ m vᵀ v + ωᵀ I ω, with the rates of each coordinate by differences of poses."""
    h = 1e-5
    at, rates = poses(bodies, q), []
    for unit in np.eye(len(q)):
        ends = zip(at, poses(bodies, q + h * unit), poses(bodies, q - h * unit), strict=True)
        rate = []
        for (pose, high, low), body in zip(ends, bodies, strict=True):
            d = (high - low) / (2 * h)
            spin = pose[:3, :3].T @ d[:3, :3]
            omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
            rate.append((d[:3, :3] @ body.com + d[:3, 3], omega))
        rates.append(rate)
    return np.array(
        [
            [
                sum(
                    of.mass * v @ w + a @ of.inertia @ b
                    for of, (v, a), (w, b) in zip(bodies, left, right, strict=True)
                )
                for right in rates
            ]
            for left in rates
        ]
    )


@unittest.skipUnless(HAS_USD, "not run: pip install usd-core")
class Usd(Files):
    def file(self, name: str, text: str) -> Path:
        return super().file(name, text.replace("TERMS", ""))

    def same(self, file: Path) -> None:
        robot = sarrus.Robot.load(file)
        by_hand = sarrus.Robot.from_text(FOUR, FOUR_LOOPS)
        self.assertEqual(list(robot.independents), ["a"])
        self.assertEqual(list(robot.actuators), ["a"])
        for y in (-0.6, 0.0, 0.5):
            found, wanted = (
                np.ravel([of.mass_matrix([y])[0, 0], *of.inverse_dynamics([y], [0.7], [0.3])])
                for of in (robot, by_hand)
            )
            # the numbers of a stage have single precision
            np.testing.assert_allclose(found, wanted, rtol=1e-6)

    def test_a_stage_in_centimetres_is_the_robot_that_is_written_by_hand(self):
        self.same(self.file("four.usda", STAGE))

    def test_a_binary_stage_is_the_same(self):
        from pxr import Usd

        Usd.Stage.Open(str(self.file("four.usda", STAGE))).Export(str(self.folder / "four.usdc"))
        self.same(self.folder / "four.usdc")

    def test_limits_drives_and_rotors_are_read_and_the_rest_is_told(self):
        robot = convert.convert(self.file("four.usda", STAGE))
        joint = robot.joints[0]
        found = [joint.limit["lower"], joint.limit["upper"], joint.limit["effort"]]
        np.testing.assert_allclose(found, [-np.pi / 3, np.pi / 3, 5.0], rtol=1e-6)
        self.assertEqual(joint.is_driven, True)
        self.assertTrue(any("its controller's" in note for note in robot.notes), robot.notes)
        friction = STAGE.replace(
            "float physxJoint:armature", "float physxJoint:jointFriction = 0.1\nfloat physxJoint:x"
        )
        self.refused("four.usda", friction, "physxJoint:jointFriction = 0.1")
        robot = convert.convert(self.folder / "four.usda", lenient=True)
        words = " ".join(robot.notes)
        self.assertIn("physxJoint:jointFriction", words)
        self.assertIn("physxJoint:x = 10.0 is left out", words)

    def test_a_robot_without_a_joint_to_the_world_beside_one_with_it(self):
        rocker = "rel physics:body1 = </four/rocker>"
        base = "rel physics:body0 = </four/base>\n      "
        world = STAGE.replace(base + rocker, rocker)
        robot = convert.convert(self.file("four.usda", world))
        kinds = {of.name: (of.kind, of.parent) for of in robot.joints}
        self.assertEqual(kinds["d"], ("continuous", "world"))
        self.assertEqual(kinds["floating_base"], ("floating", "world"))

    def test_faults_are_named(self):
        for old, new, words in (
            ("float physics:mass = 1\n", "", "mass or inertia would come from its colliders"),
            ("(20, 30, 40)", "(0, 0, 0)", "mass or inertia would come from its colliders"),
            ('PhysicsRevoluteJoint "b"', 'PhysicsDistanceJoint "b"', "PhysicsDistanceJoint"),
            ("body1 = </four/crank>", "body1 = </four/nothing>", "expected a prim"),
            ("body1 = </four/crank>", "body1 = </four/base>", "expected two bodies"),
            ("float limit:rotX:physics:low = 1", "", "the freedoms rotX rotY"),
            ("lowerLimit = -60", "lowerLimit = 70", "locked"),
            ("RigidBodyAPI", "NoBodyAPI", "no prim has PhysicsRigidBodyAPI"),
            ("#usda 1.0", "#usda 9.9", ""),
        ):
            with self.subTest(words):
                self.assertIn(old, STAGE)
                self.refused("four.usda", STAGE.replace(old, new), words)

    def test_layers_are_read_below_the_folder_or_an_included_one(self):
        self.file("parts/four.usda", STAGE)
        stage = '#usda 1.0\n( defaultPrim = "four"\n subLayers = [@{}@] )\n'
        self.same(self.file("robot.usda", stage.format("parts/four.usda")))
        inner = self.file("inner/robot.usda", stage.format("../parts/four.usda"))
        with self.assertRaisesRegex(sarrus.LoadError, "--include-dir="):
            convert.convert(inner)
        robot = convert.convert(inner, [self.folder / "parts"])
        self.assertEqual(len(robot.loops), 1)

    def test_trees_in_any_frames_scales_and_units_have_the_energy_of_their_poses(self):
        for seed in range(8):
            file = self.folder / f"tree{seed}.usda"
            bodies = random_tree(file, seed)
            robot = sarrus.Robot.load(file)
            q = np.random.default_rng(seed).uniform(-1, 1, 4)
            order = [int(of[1:]) for of in robot.independents]
            wanted = mass_matrix(bodies, q)
            found = robot.mass_matrix(q[order])
            error = np.abs(found - wanted[np.ix_(order, order)]).max() / np.abs(wanted).max()
            self.assertLess(error, 1e-8, seed)

    def test_references_and_instances_are_read(self):
        text = PAIR.replace('def Xform "a"', 'def Xform "one" { def Xform "a"', 1)
        parts, joint = PAIR.split("def Physics", 1)
        for instance in ("", "instanceable = true"):
            text = f"""{HEAD}
                class Xform "parts" {{ {parts} def Physics{joint} }}
                def Xform "arm" (references = </parts>
                    {instance}) {{}}"""
            text = text.replace("</", "</parts/").replace("= </parts/parts>", "= </parts>")
            robot = convert.convert(self.file("arm.usda", text))
            self.assertEqual([of.name for of in robot.links], ["a", "b"])
            self.assertEqual([(of.kind, of.child) for of in robot.joints], [("continuous", "b")])

    def test_joints_follow_others_as_in_physx_and_newton(self):
        slide = JOINT.replace("Revolute", "Prismatic").replace('"j"', '"k"').replace("</b>", "</c>")
        base = HEAD.replace("metersPerUnit = 1", "metersPerUnit = 0.01")
        for terms, on_turn, expected in (
            ("rel newton:mimicJoint = </j>; float newton:mimicCoef0 = 5", 1, (1.0, np.pi / 36)),
            ("rel newton:mimicJoint = </j>; float newton:mimicCoef1 = -2", 1, (-2.0, 0.0)),
            ("rel newton:mimicJoint = </j>; bool newton:mimicEnabled = 0", 1, None),
            ("rel physxMimicJoint:rotX:referenceJoint = </j>;"
             "float physxMimicJoint:rotX:gearing = -3; float physxMimicJoint:rotX:offset = 90",
             1, (3.0, -np.pi / 2)),
            (
                "rel newton:mimicJoint = </j>; float newton:mimicCoef1 = 3; rel mjc:target = </j>;"
                "rel physxMimicJoint:rotX:referenceJoint = </j>;"
                "float physxMimicJoint:rotX:gearing = -3",
                1,
                (3.0, 0.0),
            ),
            # three centimetres in a degree, four centimetres at zero
            ("rel physxMimicJoint:rotX:referenceJoint = </j>;"
             "float physxMimicJoint:rotX:gearing = 3; float physxMimicJoint:rotX:offset = 4",
             0, (-0.03 * 180 / np.pi, -0.04)),
        ):  # fmt: skip
            with self.subTest(terms):
                follower = slide.replace("Prismatic", "Revolute") if on_turn else slide
                lines = terms.replace(";", "\n")
                text = base + BODIES + BODY.format("c") + JOINT + follower.replace("TERMS", lines)
                robot = convert.convert(self.file("pair.usda", text))
                mimic = robot.joints[1].mimic
                self.assertEqual(mimic is None, expected is None)
                if mimic and expected:
                    np.testing.assert_allclose(mimic[1:], expected, rtol=1e-6)
                    self.assertEqual(mimic[0], "j")

    def test_a_joint_without_a_type_has_its_drive_and_a_limit_on_one_side(self):
        limits = [
            f"float limit:{of}:physics:{end} = {value}"
            for of in ("transX", "transY", "transZ", "rotX", "rotY")
            for end, value in (("low", 1), ("high", -1))
        ]
        limits += ["float limit:rotZ:physics:low = -90", "float drive:rotZ:physics:stiffness = 2"]
        limits += ["float drive:rotZ:physics:maxForce = 7"]
        schemas = [f"PhysicsLimitAPI:{of}" for of in ("transX", "transY", "transZ", "rotX", "rotY")]
        schemas += ["PhysicsLimitAPI:rotZ", "PhysicsDriveAPI:rotZ"]
        joint = JOINT.replace("Revolute", "").replace("TERMS", "\n".join(limits))
        written = ", ".join(f'"{of}"' for of in schemas)
        joint = joint.replace('"j"', f'"j" (apiSchemas = [{written}])')
        (found,) = convert.convert(self.file("pair.usda", HEAD + BODIES + joint)).joints
        self.assertEqual(
            (found.kind, found.is_driven, list(found.axis)), ("revolute", True, [0, 0, 1])
        )
        self.assertEqual(found.limit, {"lower": -np.pi / 2, "effort": 7.0})

    def test_gravity_is_told_in_the_axes_of_the_root(self):
        turned = "quatf xformOp:orient = (0.5, 0.5, 0.5, 0.5)\n"
        turned += 'uniform token[] xformOpOrder = ["xformOp:orient"]'
        scene = 'def PhysicsScene "s" {\n vector3f physics:gravityDirection = (0, 2, 0)\n'
        scene += " float physics:gravityMagnitude = 5\n}\n"
        for up, more, root, expected in (
            ("Z", "", "", None),
            ("Y", "", "", "--gravity=0.0,-9.81,0.0"),
            # z of the world is y of the root
            ("Z", "", turned, "--gravity=0.0,-9.81,0.0"),
            ("Z", scene, "", "--gravity=0.0,5.0,0.0"),
        ):
            text = HEAD.replace('"Z"', f'"{up}"') + PAIR.replace("TERMS", root, 1) + more
            notes = convert.convert(self.file("pair.usda", text)).notes
            found = [of.split("give it as ")[1] for of in notes if "--gravity" in of]
            self.assertEqual(found, [expected] if expected else [])

    def test_parts_that_change_numbers_are_faults_or_effects(self):
        for old, new, words in (
            ("mass = 1", "mass = inf", "/a: physics:mass is inf"),
            ("mass = 1", "mass.timeSamples = {0: 1}", "/a: physics:mass has values at times only"),
            ("(1, 1, 2)", "(1, nan, 2)", "/a: physics:diagonalInertia is"),
            ("(1, 1, 2)", "(1, -1, 2)", "/a: mass or inertia would come"),
            ("\"PhysicsMassAPI\"", "\"Other\"", "/a: mass or inertia would come"),
            ("float3 physics:d", "string physics:d", "Parse"),
            ("TERMS\n}", "matrix4d xformOp:transform = ((1, 1, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), "
             "(0, 0, 0, 1))\nuniform token[] xformOpOrder = [\"xformOp:transform\"]\n}",
             "/a: an orientation that is no rotation"),
            ("TERMS\n}", "uniform token[] xformOpOrder = [\"xformOp:scale\"]\n}", "/a: a step of"),
            ("TERMS\n}", "double3 xformOp:translate.timeSamples = {0: (1, 2, 3)}\n"
             "uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}",
             "/a: xformOp:translate has values at times only"),
            ("TERMS\n}", "vector3f physxForce:force = (0, 0, 1)\n}", "/a: physxForce:force"),
            ("axis = \"Z\"\n", "axis = \"W\"\n", "/j: physics:axis is 'W'"),
            ("metersPerUnit = 1", "metersPerUnit = 0", "metersPerUnit"),
            ("upAxis = \"Z\"", "upAxis = \"W\"", "upAxis is 'W'"),
            ("def Xform \"b\" (", "class Xform \"b\" (", "/j: physics:body1 is /b"),
            ("def Xform \"b\" (", "def Xform \"b\" (active = false\n", "/j: physics:body1 is /b"),
            ("</b>", "</c>", "/j: physics:body1 is /c"),
            ("def Physics", "def PhysxPhysicsGearJoint \"g\" {}\ndef Physics", "/g: a Physx"),
            ("def Physics", "def NewtonActuator \"g\" {}\ndef Physics", "/g: a NewtonActuator"),
            ("def Physics", "def \"g\" (references = </none>) {}\ndef Physics", "Unresolved"),
            ("def Physics", "def \"g\" (references = </g>) {}\ndef Physics", "Cycle"),
            ("def Physics", "def \"g\" (clips = {\n}) {}\ndef Physics", "/g: clips of values"),
            ("TERMS # j", "float newton:armature = 1", "/j: newton:armature = 1.0"),
            ("TERMS # j", "float physics:lowerLimit = nan", "/j: physics:lowerLimit is nan"),
            ("TERMS # j", "quatf physics:localRot0 = (nan, 0, 0, 0)", "/j: physics:localRot0 is"),
            ("TERMS # j", "float newton:mimicCoef1 = 2", "/j: newton:mimicJoint names no joint"),
            ("TERMS # j", "rel mjc:target = </j>", "/j: mjc:target"),
            ("TERMS # j", "rel newton:mimicJoint = </j>", "/j: newton:mimicJoint names no joint"),
        ):  # fmt: skip
            with self.subTest(words):
                text = HEAD + PAIR.replace("TERMS\n  }", "TERMS # j\n}")
                self.assertIn(old, text)
                text = text.replace(old, new, 1)
                self.refused("pair.usda", text, words if words != "Parse" else "")

    def test_what_a_closing_joint_loses_is_an_effect(self):
        again = JOINT.replace('"j"', '"k"')
        for terms in ("float physics:lowerLimit = 3", "float physxJoint:armature = 3"):
            text = HEAD + PAIR + again.replace("TERMS", terms)
            self.refused("pair.usda", text, "/k closes a loop")
            robot = convert.convert(self.folder / "pair.usda", lenient=True)
            self.assertEqual([of.name for of in robot.loops], ["k"])

    def test_a_body_has_no_name_of_the_world(self):
        text = (HEAD + PAIR).replace('"a"', '"world"').replace("</a>", "</world>")
        robot = convert.convert(self.file("pair.usda", text))
        self.assertEqual([of.name for of in robot.links], ["/world", "b"])

    def test_links_and_other_paths_lead_out_of_no_folder(self):
        stage = "#usda 1.0\n( subLayers = [@{}@] )\n"
        text = HEAD + PAIR
        for name in ("x.usda", "out/x.usda", "in/x.usda"):
            self.file(name, text)
        (self.folder / "in/sub/deep").mkdir(parents=True)
        (self.folder / "in/link").symlink_to("sub/deep")
        (self.folder / "in/away.usda").symlink_to("../out/x.usda")
        # from the text of the path, not from the place of the link
        self.file("in/sub/deep/a.usda", stage.format("../../x.usda"))
        for name, words in (
            ("link/a.usda", "outside of its folder"),
            ("away.usda", "outside of its folder"),
            ("../out/x.usda", "outside of its folder"),
            ("/etc/passwd", "outside of its folder"),
            ("none.usda", "it names none.usda, which is not there"),
            ("robot.usda", "cycle"),
        ):
            with self.subTest(name):
                self.refused("in/robot.usda", stage.format(name), words)
        os.mkfifo(self.folder / "in/pipe.usda")
        self.refused("in/robot.usda", stage.format("pipe.usda"), "pipe.usda: no file")

    def test_a_damaged_binary_stage_is_a_fault(self):
        from pxr import Usd

        file = self.file("four.usda", STAGE)
        Usd.Stage.Open(str(file)).Export(str(self.folder / "four.usdc"))
        whole = (self.folder / "four.usdc").read_bytes()
        for size in (0, 8, 88, len(whole) // 2, len(whole) - 1):
            (self.folder / "four.usdc").write_bytes(whole[:size])
            for read in (convert.convert, convert.text):
                with self.assertRaisesRegex(sarrus.LoadError, "four.usdc"):
                    read(self.folder / "four.usdc")


if __name__ == "__main__":
    unittest.main()
