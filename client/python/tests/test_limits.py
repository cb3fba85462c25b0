"""What is too much: memory, words of a call that stand for nothing, and what a fork cuts off."""

import copy
import os
import pickle
import subprocess
import sys
import unittest
import warnings
from pathlib import Path

import numpy as np
import sarrus
import sarrus.distributed


class Tagged(sarrus.Robot):
    """A robot with something of its own."""

    label = "none"


def resident():
    """Memory of this process [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def run(script):
    """Run a script in a process of its own: what it says, and how it ends."""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    return done.returncode, done.stdout.strip(), done.stderr


class Memory(unittest.TestCase):
    def test_answers_without_room_are_a_memory_error(self):
        # no field of the motion has a number, so rows of it take no memory
        robot = sarrus.Robot.bundled("lambda", lock=["*"])
        y = np.zeros((10**16, 0))
        for ask in (
            lambda: robot.inverse_dynamics(y, y, y),
            lambda: robot.forward_dynamics(y, y, y),
            lambda: robot.mass_matrix(y),
            lambda: robot.query("kinematics", ["y"], ["q"])(y=y),
        ):
            with self.assertRaises(MemoryError):
                ask()

    def test_answers_beyond_a_limit_are_a_memory_error_with_out_as_well(self):
        script = """
import resource
import numpy as np
import sarrus
robot = sarrus.Robot.bundled("lambda")
few = np.zeros((3000, 1))
robot.inverse_dynamics(few, few, few, threads=1)
robot.mass_matrix(few, threads=1)
rows = 10_000_000
y, out = np.zeros((rows, 1)), np.zeros((rows, 1))
pages = int(open("/proc/self/statm").read().split()[0])
limit = pages * resource.getpagesize() + (30 << 20)
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
for ask in (
    lambda: robot.inverse_dynamics(y, y, y, threads=1),
    lambda: robot.inverse_dynamics(y, y, y, out=out, threads=1),
    lambda: robot.mass_matrix(y, threads=1),
):
    try:
        ask()
    except MemoryError:
        print("MemoryError")
"""
        self.assertEqual(run(script), (0, "\n".join(["MemoryError"] * 3), ""))

    @unittest.skipIf((os.cpu_count() or 1) > 16, "what a thread for each processor needs is kept")
    def test_what_many_threads_needed_is_not_kept(self):
        robot = sarrus.Robot.bundled("rh5v2_full")
        y = np.zeros((100 * 256, len(robot.independents)))
        fields = ("q", "u", "qd", "ud", "G_u")
        queries = [robot.query("kinematics", ["y", "yd"], [field]) for field in fields]
        reached = []
        for query in queries:
            query(y=y, yd=y, threads=100)
            reached.append(resident())
        # 400 more would be there, each of half a megabyte
        self.assertLess(reached[-1] - reached[0], 100, reached)


class Words(unittest.TestCase):
    def setUp(self):
        self.robot = sarrus.Robot.bundled("lambda")

    def test_numbers_out_of_range_are_named(self):
        y = [[0.1]] * 3
        for wrong in (0, -1, 10**30):
            words = f"`threads` is {wrong}, expected 1 or more"
            with self.assertRaisesRegex(ValueError, words):
                self.robot.mass_matrix(y, threads=wrong)
            with self.assertRaisesRegex(ValueError, words):
                self.robot.forward_dynamics(y, y, y, threads=wrong)
        for wrong in (-1, 2**64):
            with self.assertRaisesRegex(ValueError, f"`fingerprint` is {wrong}, expected"):
                sarrus.Robot.connect("nobody", fingerprint=wrong)
        with self.assertRaisesRegex(ValueError, "`timeout` is -1, expected seconds"):
            sarrus.distributed.map(self.robot, {"y": y}, None, timeout=-1)
        self.assertEqual(self.robot.mass_matrix(y, threads=np.int64(2)).shape, (3, 1, 1))

    def test_a_progress_that_cannot_be_called_is_refused_first(self):
        y, out = np.zeros((3, 1)), np.full((3, 1), 7.0)
        for ask in (
            lambda: self.robot.inverse_dynamics(y, y, y, out=out, progress=5),
            lambda: self.robot.mass_matrix(y, progress=5),
            lambda: self.robot.simulate(0.001, [0.1], progress=5),
            lambda: sarrus.distributed.map(self.robot, {"y": y}, None, progress=5),
        ):
            with self.assertRaisesRegex(TypeError, "`progress` is 5, expected a function"):
                ask()
        self.assertTrue((out == 7.0).all())

    def test_one_array_for_two_outputs_of_a_state_is_refused(self):
        query = self.robot.query("kinematics", ["y", "yd"], ["qd", "q"])
        size = len(self.robot.joints)
        both, long = np.empty(size), np.empty(size + 1)
        for one, other in ((both, both), (long[1:], long[:-1])):
            with self.assertRaisesRegex(ValueError, "shares memory with another output"):
                query(y=[0.1], yd=[1.0], out={"q": one, "qd": other})
        beside = np.empty(2 * size)
        out = {"q": beside[:size], "qd": beside[size:]}
        answer = query(y=[0.1], yd=[1.0], out=out)
        np.testing.assert_array_equal(answer.q, self.robot.state([0.1], [1.0]).q)
        np.testing.assert_array_equal(answer.qd, self.robot.state([0.1], [1.0]).qd)

    def test_a_simulation_takes_what_the_other_questions_take(self):
        for wrong in (["0.1"], [True], [None], [1j]):
            with self.assertRaisesRegex(TypeError, "`y` holds .*, expected real numbers"):
                self.robot.simulate(0.01, wrong)
        for wrong in (0.1, [[0.1]]):
            with self.assertRaisesRegex(ValueError, "`y` has the shape .*, expected one dimension"):
                self.robot.simulate(0.01, wrong)
        with self.assertRaisesRegex(ValueError, "`forces` has the shape"):
            self.robot.simulate(0.01, [0.1], tau_u=0.1)
        self.assertEqual(self.robot.simulate(0.01, np.array([0.5], np.float32)).y[0], 0.5)

    def test_a_joint_is_locked_once(self):
        for twice in (["Elbow=0.1", "Elbow=0.2"], ["Elbow", " Elbow = 0.2"]):
            with self.assertRaisesRegex(ValueError, "`lock` has `Elbow` twice"):
                sarrus.Robot.bundled("lambda", lock=twice)

    def test_a_file_that_is_missing_is_not_found(self):
        with self.assertRaises(FileNotFoundError) as caught:
            sarrus.Robot.load("nowhere.urdf")
        error = caught.exception
        self.assertEqual((error.errno, error.filename), (2, "nowhere.urdf"))
        with self.assertRaises(IsADirectoryError):
            sarrus.Robot.load("/")

    def test_each_caller_is_warned_where_it_asks(self):
        y = [[0.1], [np.nan]]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self.robot.to_actuators(y)
            self.robot.to_independent(y)
            self.robot.mass_matrix(y)
        self.assertEqual([warning.filename for warning in caught], [__file__] * 3)

    def test_attributes_of_a_robot_go_with_it(self):
        robot = Tagged.bundled("lambda")
        robot.label, robot.notes = "left", ["first"]
        # kept by the robot itself, and made anew
        self.assertEqual(robot.joints, self.robot.joints)
        robot.mass_matrix([0.1])
        for other in (pickle.loads(pickle.dumps(robot)), copy.copy(robot), copy.deepcopy(robot)):
            self.assertEqual((type(other), other.label, other.notes), (Tagged, "left", ["first"]))
            self.assertEqual({*vars(other)}, {"label", "notes"})
            np.testing.assert_array_equal(other.mass_matrix([0.1]), robot.mass_matrix([0.1]))


if __name__ == "__main__":
    unittest.main()
