"""Robots of Lua (RBDL) and USD, where the packages that read these are installed."""

import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
import sarrus
from sarrus import convert

HAS_LUA = importlib.util.find_spec("lupa") is not None

# the mechanism of appendix A of the base document, with inertias that a body can have
RRPR = """
l1, l2, J3 = 114.02/1000, 364.97/1000, 297.39/1000
q1 = math.acos((l1^2 + l2^2 - J3^2)/(2*l1*l2))
q2 = math.acos((l2*math.cos(q1) - l1)/J3)
local function body(m, l) -- a rod along y
    local I = m*l*l/12
    return { mass = m, com = {0, l/2, 0}, inertia = {{I, 0, 0}, {0, 0, 0}, {0, 0, I}} }
end
local function turned(q, y)
    local c, s = math.cos(q), math.sin(q)
    return { r = {0, y, 0}, E = {{1, 0, 0}, {0, c, s}, {0, -s, c}} }
end
joints = { revX = {{1, 0, 0, 0, 0, 0}}, prsY = {{0, 0, 0, 0, 1, 0}}, fixed = {} }
local function row(axis, name)
    return { constraint_type = 'loop', predecessor_body = 'B1', successor_body = 'B3',
             predecessor_transform = { r = {0, l2, 0} }, axis = axis, name = name }
end
model = {
    gravity = {0, -9.81, 0},
    frames = {
        { name = 'base', parent = 'ROOT', body = body(1, l1), joint = joints.fixed },
        { name = 'B1', parent = 'base', body = body(1.5, l2), joint = joints.revX,
          joint_frame = turned(q1, 0), visuals = {} },
        { name = 'B2', parent = 'base', body = body(0.7, J3), joint = joints.revX,
          joint_frame = turned(q2, l1) },
        { name = 'B3', parent = 'B2', body = body(0.4, 0.1), joint = joints.prsY,
          joint_frame = { r = {0, J3, 0} } },
    },
    constraint_sets = { loop_constraints = {
        row({0, 0, 0, 0, 1, 0}, 'loopTY'), row({0, 0, 0, 0, 0, 1}, 'loopTZ') } },
}
return model
"""


def rrpr_mass(y: float) -> float:
    """Twice the kinetic energy of the mechanism at a rate of one, by differences of poses."""
    l1, l2, j3 = 0.11402, 0.36497, 0.29739
    q1 = np.arccos((l1**2 + l2**2 - j3**2) / (2 * l1 * l2))

    def points(y: float) -> list[tuple[complex, float]]:
        tip = l2 * np.exp(1j * (q1 + y))
        along = tip - l1
        unit = along / abs(along)
        turn = np.angle(along)
        centers = 0.5 * l2 * np.exp(1j * (q1 + y)), l1 + 0.5 * j3 * unit, tip + 0.05 * unit
        return list(zip(centers, (q1 + y, turn, turn), strict=True))

    h = 1e-5
    sizes = (1.5, 1.5 * l2**2 / 12), (0.7, 0.7 * j3**2 / 12), (0.4, 0.4 * 0.01 / 12)
    total = 0.0
    for (p, a), (q, b), (mass, inertia) in zip(points(y + h), points(y - h), sizes, strict=True):
        total += mass * abs((p - q) / (2 * h)) ** 2 + inertia * ((a - b) / (2 * h)) ** 2
    return total


# screws, angles of Euler, slides and turned frames
SIX = """
local c, s = math.cos(0.7), math.sin(0.7)
local function body(m)
    return { mass = m, com = {0.1, -0.2, 0.3},
             inertia = {{0.5, 0.02, -0.03}, {0.02, 0.6, 0.05}, {-0.03, 0.05, 0.4}} }
end
return { gravity = {0.3, -0.2, -9.81}, frames = {
    { name = 'a', parent = 'ROOT', body = body(2), joint = {{0, 0.6, 0.8, 0.1, -0.05, 0.2}},
      joint_frame = { r = {0.1, 0.2, 0.3}, E = {{c, s, 0}, {-s, c, 0}, {0, 0, 1}} } },
    { name = 'b', parent = 'a', body = body(1.5), joint = { 'JointTypeEulerYXZ' },
      joint_frame = { r = {0.4, 0, -0.1}, E = {{1, 0, 0}, {0, c, s}, {0, -s, c}} } },
    { name = 'c', parent = 'b', joint = {}, joint_frame = { r = {0, 0.3, 0} } },
    { name = 'd', parent = 'c', body = { mass = 0.7 },
      joint = {{0, 0, 0, 0, 0.6, 0.8}, {1, 0, 0, 0, 0, 0}, {0, 0.8, -0.6, 0, 0, 0.1}},
      joint_frame = { r = {0.2, 0.1, 0} } },
} }
"""
JOINTS_OF_SIX = ["a/2", "b/1", "b/2", "b/3", "d/1", "d/2", "d/4"]
# q, qd, qdd and the forces that RBDL 3.3 (d2ca0372) computes for this file
SIX_STATES = (
    (
        [-0.315356165270953, -0.634945129293457, 0.689857314242915, -0.587957376934568,
         -0.493235684462467, -0.58849745834642, -0.307206933017451],
        [-0.103089189670556, 0.78800372583233, -0.450699567539012, -0.557443709837945,
         -0.487725998967758, -0.456305777400874, -0.487514154746902],
        [-0.00350433448492748, -0.968650726586883, 0.942837481360341, -0.167009805872575,
         -0.273161384869908, -0.16806646770242, -0.394299076588032],
        [1.93917332195014, -2.13490662720439, 0.438793315037536, 4.50240468729417,
         4.03895361214221, 0.923190680737348, -0.681131393334538],
    ),
    (
        [-0.510385723789402, 0.647523452875914, 0.419618098214091, -0.135787121036922,
         -0.580820591319734, 0.427888541728206, 0.203219264607513],
        [-0.505200383022987, 0.966235953367425, 0.887665431894206, 0.556574454324587,
         -0.554687537045538, -0.907554972873793, -0.149555392167324],
        [-0.380226244861365, 0.0593253518730985, 0.75652430008935, -0.166604278221076,
         0.102244854486661, 0.235540978254537, -0.225894034479695],
        [-0.0594094455813535, -3.90003591463605, 0.133538314963513, 1.6032068842303,
         6.28402510682132, 1.39292564145457, -1.41413120284366],
    ),
)  # fmt: skip


class Files(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def file(self, name: str, text: str) -> Path:
        file = self.folder / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        return file

    def refused(self, name: str, text: str, words: str) -> None:
        with self.assertRaises(sarrus.LoadError) as caught:
            convert.convert(self.file(name, text))
        self.assertIn(words, str(caught.exception))


@unittest.skipUnless(HAS_LUA, "not run: pip install lupa")
class Lua(Files):
    def test_the_mechanism_of_the_base_document_has_its_mass_and_its_closed_form(self):
        robot = sarrus.Robot.load(self.file("rrpr.lua", RRPR), gravity=(0.0, -9.81, 0.0))
        self.assertEqual(list(robot.independents), ["B1"])
        self.assertEqual(list(robot.joints), ["B1", "B2", "B3"])
        for y in (-0.5, 0.0, 0.3, 0.9):
            found = robot.mass_matrix([y])[0, 0]
            self.assertAlmostEqual(found, rrpr_mass(y), delta=1e-8 * found)

    def test_screws_angles_and_slides_have_the_forces_of_rbdl(self):
        robot = sarrus.Robot.load(self.file("six.lua", SIX), gravity=(0.3, -0.2, -9.81))
        self.assertEqual(list(robot.independents), JOINTS_OF_SIX)
        for q, qd, qdd, tau in SIX_STATES:
            np.testing.assert_allclose(robot.inverse_dynamics(q, qd, qdd), tau, atol=1e-13)

    def test_axes_sets_frames_and_joint_types_are_those_of_rbdl(self):
        text = """
        local F = { { name = 'P', body = 'a', r = {0, 0, 1} } }
        local s = math.sqrt(0.5)
        return { local_frames = F, points = {}, frames = {
            { name = 'f', parent = 'ROOT', joint = { 'JointTypeFloatingBase' },
              body = { mass = 2 } },
            { name = 'a', parent = 'f', joint = { 'JointTypeEulerZYX' } },
            { name = 'b', parent = 'a', joint = {{0, 0, 0, 1, 0, 0}, {0, s, s, 0, 0, 0}},
              joint_frame = { E = {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}} } },
            { name = 'c', parent = 'f', joint = { 'JointTypeSpherical' } } },
          constraint_sets = { one = { { constraint_type = 'loop',
              predecessor_local_frame = 'P', successor_body = 'c',
              successor_transform = { E = {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}} },
              axis_sets = {{0, 0, 0, 1, 0, 0}, {0, 0, 0, 0, 1, 0}, {0, 0, 0, 0, 0, 1}} },
              { constraint_type = 'contact' } } } }
        """
        robot = convert.convert(self.file("all.lua", text))
        found = [(of.name, of.kind, list(np.round(of.axis, 3))) for of in robot.joints]
        self.assertEqual(
            found,
            [
                ("f", "floating", [0, 0, 1]),
                ("a/1", "continuous", [0, 0, 1]),
                ("a/2", "continuous", [0, 1, 0]),
                ("a/3", "continuous", [1, 0, 0]),
                ("b/1", "prismatic", [1, 0, 0]),
                ("b/2", "continuous", [0, 0.707, 0.707]),
                ("c", "spherical", [0, 0, 1]),
            ],
        )
        # `E` of a joint turns the parent's coordinates into the child's, that of a cut back
        turned = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        np.testing.assert_array_equal(robot.joints[4].origin[:3, :3], turned)
        (loop,) = robot.loops
        self.assertEqual((loop.kind, loop.links), ("ball", ("a", "c")))
        np.testing.assert_array_equal(loop.frames[0][:3, 3], [0, 0, 1])
        np.testing.assert_array_equal(loop.frames[1][:3, :3], turned)
        # a body without `inertia` has the identity
        np.testing.assert_array_equal(robot.links[1].inertia, np.eye(3))
        self.assertEqual(len(robot.notes), 3)

    def test_a_file_reads_nothing_and_ends(self):
        for text, words in (
            ("while true do end", "it takes more than"),
            ("local x = ('x'):rep(1e9) return x", "robot.lua:1: rep takes too long"),
            ("local x = ('x'):rep(4e6) while true do x = x .. x end", "memory"),
            ("local t = {} while true do t[#t + 1] = ('x'):rep(1000) .. #t end", "memory"),
            ("return io.open('/etc/passwd')", "io"),
            ("return os.getenv('HOME')", "os"),
            ("return python.eval('1')", "python"),
            ("return require 'x'", "require"),
            ("return load('return 1')()", "load"),
            ("pcall(function() while true do end end)", "pcall"),
            ("return ('x'):find('(.-)*')", "find"),
            ("local t = {} t.t = t return t", "too deep, or contains itself"),
            ("local s = ('x'):rep(4e6) s = s .. s .. s while true do local t = s .. 1 end", "5 s"),
            ("('').rep('', 1 << 62)", "rep takes too long"),
            ("table.move({}, 1, 1 << 62, 2)", "move takes too long"),
            (
                "local t = {} for k = 0, 61 do t[1 << k] = 1 end "
                "while #t < 1e9 do t[#t + 1] = 1 end table.remove(t, 1)",
                "remove takes too long",
            ),
            ("local s, t = ('x'):rep(1e6), {} for k = 1, 1e5 do t[k] = s end return t", "too many"),
            ("error({})", "an error without a message"),
            ("error('\\255')", "a text that is not UTF-8"),
            ("\x1bLua", "binary"),
            ("return {", "expected"),
            ("return 3", "it returns no table"),
            ("return { frames = {} }", "has no frame"),
            ("return { frames = { { name = 'a', parent = 'b' } } }", "`parent` is 'b'"),
            ("return { frames = { { name = 'ROOT', parent = 'ROOT' } } }", "`name` is 'ROOT'"),
            ("return { frames = { { name = {}, parent = 'ROOT' } } }", "`name` is {}"),
            ("return { frames = { { name = 'a', parent = {} } } }", "`parent` is {}"),
            ("return { frames = { { name = 'a\\0b', parent = 'ROOT' } } }", "'a\\x00b' is not"),
            ("return { frames = { [true] = { name = 'a', parent = 'ROOT' } } }", "no list"),
            (
                "local j = {{1,0,0,0,0,0}, {0,1,0,0,0,0}} return { frames = { { name = 'a/1', "
                "parent = 'ROOT' }, { name = 'a', parent = 'ROOT', joint = j } } }",
                "'a/1' is not",
            ),
        ):
            with self.subTest(words):
                self.refused("robot.lua", text, words)

    def test_faults_are_named_with_their_place(self):
        for old, new, words in (
            ("mass = m,", "mass = 'x',", "frames[1].body: no table with a `mass`"),
            ("mass = m,", "mass = 0/0,", "frames[1].body: a mass below zero"),
            ("{0, l/2, 0}", "{0, l/2}", "frames[1].body.com: expected 3 numbers"),
            ("{1, 0, 0}, {0, c, s}", "{2, 0, 0}, {0, c, s}", "frames[2].joint_frame: an orient"),
            ("prsY = {{0, 0, 0, 0, 1, 0}}", "prsY = {{0, 2, 0, 0, 1, 0}}", "frames[4].joint[1]"),
            ("prsY = {{0, 0, 0, 0, 1, 0}}", "prsY = {'Sled'}", "'Sled', a joint type"),
            ("successor_body = 'B3'", "successor_body = 'B9'", "the successor is 'B9'"),
            ("row({0, 0, 0, 0, 0, 1}", "row({1, 0, 0, 0, 0, 0}", "2 axes that hold no joint"),
            ("row({0, 0, 0, 0, 0, 1}", "row({0, 0, 0, 0, 2, 0}", "2 axes that hold no joint"),
            ("row({0, 0, 0, 0, 0, 1}", "row({0, 0, 0, 0, 0, 0}", "an axis of zero"),
            ("constraint_type = 'loop'", "constraint_type = 'Loop'", "`constraint_type` is 'Loop'"),
            ("predecessor_body = 'B1'", "predecessor_local_frame = {}", "{} is no local frame"),
            ("loop_constraints = {", "{", "constraint_sets: no table of named sets"),
            ("body = body(1, l1)", "body = math.sin", "frames[1].body: no table"),
            ("body(1, l1)", "body(1 / 0, l1)", "frames[1].body.inertia: a number"),
            ("joint = joints.fixed", "joint = {'x', 2, 3, 4, 5, 6, 7}", "at most 6 axes"),
        ):
            with self.subTest(words):
                self.assertIn(old, RRPR)
                self.refused("robot.lua", RRPR.replace(old, new, 1), words)

    def test_keys_that_are_not_read_are_noted_and_the_gravity_of_rbdl_too(self):
        text = RRPR.replace("gravity = {0, -9.81, 0},", "").replace("com =", "center =")
        robot = convert.convert(self.file("rrpr.lua", text))
        self.assertIn("--gravity=0.0,-9.81,0.0", robot.notes[-1])
        self.assertEqual(robot.notes[0], "`center` of base.body is left out")

    def test_the_module_prints_the_urdf(self):
        command = [sys.executable, "-m", "sarrus.convert", self.file("rrpr.lua", RRPR)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        self.assertIn('<loop name="loopTY" type="planar_revolute">', done.stdout)
        self.assertIn("note: `gravity`", done.stderr)
        self.file("rrpr.lua", "return 3")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.file("rrpr.lua", "error('\\27[2J\\nerror: no')")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        self.assertEqual(
            (done.returncode, done.stderr.count("\n"), "\x1b" in done.stderr), (1, 1, 0)
        )
        command[-1] = self.folder / "none.lua"
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, "none.lua" in done.stderr), (2, True))

    def test_a_loaded_robot_has_the_notes_of_its_readers(self):
        robot = sarrus.Robot.load(self.file("rrpr.lua", RRPR))
        notes = convert.convert(self.file("rrpr.lua", RRPR)).notes
        self.assertTrue(notes)
        for note in notes:
            self.assertTrue(any(note in of for of in robot.reader_notes), robot.reader_notes)
        model = "<mujoco><worldbody><body><joint name='a'/><geom size='1'/></body></worldbody>"
        model += "<option timestep='0.001'/></mujoco>"
        robot = sarrus.Robot.load(self.file("arm.xml", model))
        self.assertTrue(any("timestep" in note for note in robot.reader_notes), robot.reader_notes)
        self.assertEqual(sarrus.Robot.bundled("lambda").reader_notes, [])

    def test_modules_of_the_current_folder_are_not_those_of_the_reader(self):
        self.file("lupa.py", "raise SystemExit('mine')")
        file = self.file("rrpr.lua", RRPR)
        before = Path.cwd()
        os.chdir(self.folder)
        self.addCleanup(os.chdir, before)
        self.assertIn(b'<robot name="rrpr"', convert.text(file)[0])
        with self.assertRaises(sarrus.LoadError) as caught:
            convert.text(self.file("rrpr.lua", "return 3"))
        self.assertIn("rrpr.lua: it returns no table", str(caught.exception))
        with self.assertRaises(FileNotFoundError):
            convert.text("none.lua")
        os.mkfifo("pipe.lua")
        for read in (convert.text, convert.convert):
            with self.assertRaisesRegex(sarrus.LoadError, "pipe.lua: no file"):
                read("pipe.lua")


class WithoutPackages(Files):
    def test_a_missing_package_is_told(self):
        for name, module, words in (
            ("a.lua", "lupa.lua54", "pip install lupa"),
            ("a.usda", "pxr", "pip install usd-core"),
        ):
            with (
                mock.patch.dict(sys.modules, {module: None}),
                self.assertRaisesRegex(ModuleNotFoundError, words),
            ):
                convert.convert(self.file(name, ""))


if __name__ == "__main__":
    unittest.main()
