"""Robots of the package `robot_descriptions`, and files of SDF."""

import importlib
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import sarrus

ARM = """<robot name="arm"><link name="a"/><link name="b"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
</robot>"""
BOX = """<mujoco model="box"><worldbody><body name="b"><joint name="slide" type="slide"/>
<geom size="0.1" mass="3"/></body></worldbody></mujoco>"""
SDF = """<sdf version="1.9"><model name="tray"><link name="b"><inertial><mass>4</mass></inertial>
</link><joint name="lift" type="prismatic"><parent>world</parent><child>b</child><axis>
<xyz>0 0 1</xyz></axis></joint></model></sdf>"""


class Descriptions(unittest.TestCase):
    """A package of the name `robot_descriptions` in a folder of this test."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        root = Path(self.folder.name)
        package = root / "robot_descriptions"
        package.mkdir()
        (package / "__init__.py").write_text("")
        for name, key, text in (
            ("arm_description", "URDF_PATH", ARM),
            ("box_mj_description", "MJCF_PATH", BOX),
            ("macro_description", "XACRO_PATH", ""),
            ("empty_description", "PACKAGE_PATH", ""),
        ):
            file = root / f"{name}.xml"
            file.write_text(text)
            (package / f"{name}.py").write_text(f"{key} = {str(file)!r}\n")
        (package / "loaders.py").write_text("raise RuntimeError\n")
        sys.path.insert(0, str(root))
        self.addCleanup(sys.path.remove, str(root))
        self.addCleanup(self.forget)
        self.forget()

    def forget(self):
        for name in [of for of in sys.modules if of.startswith("robot_descriptions")]:
            del sys.modules[name]
        importlib.invalidate_caches()

    def test_a_description_is_loaded_by_its_name(self):
        robot = sarrus.Robot.description("arm_description", gravity=(0, 0, 0))
        self.assertEqual(list(robot.independents), ["j"])
        np.testing.assert_array_equal(robot.mass_matrix([0.0]), [[1.0]])
        robot = sarrus.Robot.description("box_mj_description")
        np.testing.assert_array_equal(robot.mass_matrix([0.0]), [[3.0]])

    def test_other_names_are_told(self):
        for name, words in (
            ("arm_descripton", "did you mean arm_description?"),
            ("loaders", "no description 'loaders'"),
            ("os.path", "no description"),
            ("macro_description", "expand it: sarrus import --xacro"),
            ("empty_description", "neither URDF nor MJCF"),
        ):
            with self.assertRaisesRegex(sarrus.LoadError, words.replace("?", r"\?")):
                sarrus.Robot.description(name)

    def test_a_missing_package_is_told(self):
        self.forget()
        sys.modules["robot_descriptions"] = None
        with self.assertRaisesRegex(ModuleNotFoundError, "pip install robot_descriptions"):
            sarrus.Robot.description("arm_description")

    def test_a_file_of_sdf_is_loaded_in_place_of_a_urdf(self):
        file = Path(self.folder.name) / "tray.sdf"
        file.write_text(SDF)
        robot = sarrus.Robot.load(file)
        np.testing.assert_array_equal(robot.mass_matrix([0.0]), [[4.0]])


if __name__ == "__main__":
    unittest.main()
