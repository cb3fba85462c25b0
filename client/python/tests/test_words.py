"""Names, words and warnings of a robot."""

import html
import pickle
import subprocess
import sys
import tempfile
import unittest
import warnings
from pathlib import Path

import numpy as np
import sarrus
from sarrus import _native


class Words(unittest.TestCase):
    def test_names_are_places_in_arrays(self):
        robot = sarrus.Robot.bundled("rh5v2_upper_body")
        name = robot.actuators[3]
        self.assertEqual(getattr(robot.actuators, name), 3)
        self.assertIn(name, dir(robot.actuators))
        with self.assertRaisesRegex(AttributeError, f"did you mean `{name}`"):
            getattr(robot.actuators, name + "x")
        self.assertEqual(pickle.loads(pickle.dumps(robot.links)), robot.links)
        self.assertEqual(robot.limits["lower"].shape, (len(robot.joints),))
        self.assertEqual(len(robot.coordinates), robot.information["sizes"]["n_q"])

    def test_a_robot_says_what_it_is(self):
        robot = sarrus.Robot.bundled("torso")
        self.assertIn("2 independents, 2 actuators", repr(robot))
        page = robot._repr_html_()
        for closure in robot.closures:
            self.assertIn(f"<td>{closure['name']}</td><td>{closure['type']}</td>", page)
        self.assertFalse(robot.is_connected)

    def test_exceeded_limits_are_told(self):
        robot = sarrus.Robot.bundled("lambda")
        for ask in (
            lambda: robot.inverse_dynamics([2.9], [1.0], [0.0]),
            lambda: robot.forward_dynamics([2.9], [1.0], [0.0]),
            lambda: robot.state([2.9]),
            lambda: robot.mass_matrix([2.9]),
        ):
            with self.assertWarnsRegex(sarrus.StateWarning, "has a warning: limits_exceeded"):
                ask()
        rows = np.array([[0.2], [2.9], [0.3], [-2.9]])
        words = "2 of 4 answers have warnings, the first in row 1: limits_exceeded"
        for ask in (lambda: robot.inverse_dynamics(rows), lambda: robot.mass_matrix(rows)):
            with self.assertWarnsRegex(sarrus.StateWarning, words):
                ask()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            robot.inverse_dynamics([2.9], return_status=True)
            robot.inverse_dynamics([0.2], [1.0], [0.0])
            answer = robot.query("kinematics", ["y"])(y=[2.9])
        self.assertEqual(answer.warnings, sarrus.Warnings.limits_exceeded)
        run = robot.simulate(5.0, [0.3])
        since = {name: time for time, name in run.events}
        first = run.time[np.argmax(np.abs(run.y[:, 0]) > 1.5)]
        self.assertEqual(since["limits_exceeded: position of Elbow"], first)
        self.assertIn("limits_exceeded: velocity of Elbow", since)
        self.assertEqual(robot.simulate(0.1, [0.3]).events, ())

    def test_python_behaves_as_a_user_of_numpy_expects(self):
        robot = sarrus.Robot.bundled("lambda")
        with tempfile.TemporaryDirectory() as folder:
            urdf, submechanisms, _ = robot.origin.contents()
            paths = [Path(folder, name) for name in ("a.urdf", "a.yml")]
            paths[0].write_bytes(urdf)
            paths[1].write_bytes(submechanisms)
            same = sarrus.Robot(paths[0], str(paths[1]))
            self.assertEqual(same.fingerprint, robot.fingerprint)
            free = sarrus.Robot(str(paths[0]), gravity=[0, 0, 0])
            self.assertEqual(len(free.independents), len(free.joints))
        with self.assertRaises(FileNotFoundError):
            sarrus.Robot("absent.urdf")
        rest = robot.inverse_dynamics([0.2], [0.0], [0.0])
        np.testing.assert_array_equal(robot.inverse_dynamics([0.2]), rest)
        rows = np.array([[0.2], [0.3]])
        np.testing.assert_array_equal(
            robot.inverse_dynamics(rows, ydd=rows),
            robot.inverse_dynamics(rows, np.zeros((2, 1)), rows),
        )
        both = sarrus.Warnings.limits_exceeded | sarrus.Warnings.loop_open
        self.assertEqual(str(both), "limits_exceeded, loop_open")
        self.assertEqual((str(sarrus.Warnings(0)), str(sarrus.Status.ok)), ("none", "ok"))
        words = repr(robot.simulate(5.0, [0.3]))
        self.assertRegex(words, "finished, .* samples to 5 s, limits_exceeded: .* of Elbow")
        self.assertLess(len(words), 500)
        with self.assertRaisesRegex(sarrus.QueryError, "did you mean `M_y`"):
            robot.query("inverse-dynamics", ["y"], ["M"])
        self.assertEqual(dir(sarrus), sorted(sarrus.__all__))

    def test_a_page_opens_alone_and_in_a_notebook(self):
        robot = sarrus.Robot.bundled("lambda")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "lambda.html"
            robot.save_page(path, swing=True)
            text = path.read_text(encoding="utf-8")
        self.assertTrue(text.startswith("<!DOCTYPE html>"))
        self.assertIn('"swing":true', text)
        self.assertIn("sarrus ask inverse-dynamics", text)
        shown = robot.show()
        self.assertEqual(shown.text, text.replace('"swing":true', '"swing":false'))
        inline = html.unescape(shown._repr_html_())
        self.assertIn(shown.text, inline)

    def test_statuses_and_warnings_are_those_of_the_core(self):
        self.assertEqual([status.name for status in sarrus.Status], _native.statuses())
        self.assertEqual([bit.name for bit in sarrus.Warnings], _native.warning_bits())
        self.assertEqual([*map(int, sarrus.Status)], [*range(len(sarrus.Status))])

    def test_the_bridge_loads_no_numpy(self):
        script = "import sys, sarrus.can; sys.exit('numpy' in sys.modules)"
        self.assertEqual(subprocess.run([sys.executable, "-c", script], check=False).returncode, 0)

    def test_every_public_name_is_there(self):
        for name in sarrus.__all__:
            self.assertTrue(getattr(sarrus, name) is not None, name)
        with self.assertRaises(AttributeError):
            _ = sarrus.nothing


if __name__ == "__main__":
    unittest.main()
