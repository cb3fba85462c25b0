"""Jacobians of queries against central differences, and fields that are refused."""

import unittest

import numpy as np
import sarrus
from sarrus.external import External

STEP = 1e-5
ID = ("inverse-dynamics", ["y", "yd", "ydd"])
FD = ("forward-dynamics", ["y", "yd", "tau_u"])
MOTION = ("kinematics", ["y", "yd", "ydd"])


def inputs(robot, of, rows=1, seed=1):
    """Random inputs within reach; quaternions have unit length."""
    random = np.random.default_rng(seed)
    found = []
    for name, shape in of.inputs.items():
        array = 0.2 * random.uniform(-1.0, 1.0, (rows, *shape))
        if name == "y":
            for k, coordinate in enumerate(robot.independent_coordinates):
                if coordinate.endswith("/qx"):
                    array[:, k + 3] = 1.0
                    array[:, k : k + 4] /= np.linalg.norm(array[:, k : k + 4], axis=1)[:, None]
        if name in ("tau_u", "tau_y", "wrenches"):
            array *= 50.0
        found.append(array)
    return found


def differences(robot, of, given):
    """Central differences of fourth order of each output by each input, for one state.

    A quaternion is normalised before it is asked about.
    """
    turns = [k for k, name in enumerate(robot.independent_coordinates) if name.endswith("/qx")]
    found = {}
    for i, name in enumerate(of.inputs):
        columns = []
        for k in range(given[i].size):

            def at(step, i=i, k=k, name=name):
                moved = [array.copy() for array in given]
                moved[i].reshape(-1)[k] += step
                if name == "y":
                    for turn in turns:
                        moved[i][0, turn : turn + 4] /= np.linalg.norm(moved[i][0, turn : turn + 4])
                return [array[0].ravel() for array in of(*moved)]

            h = STEP
            parts = zip(at(h), at(-h), at(2 * h), at(-2 * h), strict=True)
            columns.append([(8 * (a - b) - (c - d)) / (12 * h) for a, b, c, d in parts])
        for o, output in enumerate(of.outputs):
            found[output, name] = np.stack([column[o] for column in columns], axis=1)
    return found


class Jacobians(unittest.TestCase):
    def compare(self, robot, request, given, want, *, frames=0, pushed=0, **options):
        robot = sarrus.Robot.bundled(robot) if isinstance(robot, str) else robot
        links = [robot.links[-1 - k] for k in range(frames)]
        if pushed:
            given = [*given, "wrenches"]
            options["wrenches"] = [robot.links[-1 - k] for k in range(pushed)]
        of = External(robot, request, given, want, frames=links, **options)
        rows = inputs(robot, of)
        blocks, values = of.jacobians(*rows), dict(zip(of.outputs, of(*rows), strict=True))
        self.assertEqual(blocks.keys(), of.rules.keys())
        for pair, expected in differences(robot, of, rows).items():
            with self.subTest(robot=robot.name, pair=pair):
                self.assertTrue(np.isfinite(expected).all())
                block = blocks[pair][0] if pair in blocks else np.zeros_like(expected)
                # the rounding of differences grows with the numbers themselves
                scale = max(1.0, np.abs(expected).max(), np.abs(values[pair[0]]).max())
                np.testing.assert_allclose(block / scale, expected / scale, rtol=0, atol=1e-7)

    def test_forces_and_accelerations_are_those_of_differences(self):
        for name in ["lambda", "torso", "stewart", "rh5v2_upper_body", "stewart_floating"]:
            self.compare(name, *ID, ["tau_y", "tau_u"])
            self.compare(name, *FD, ["ydd"])
            self.compare(name, *FD[:1], ["y", "yd", "tau_y"], ["ydd"])

    def test_fewer_and_more_actuators_than_freedoms(self):
        fewer = sarrus.Robot.bundled("torso", floating_base=True)
        self.compare(fewer, *ID, ["tau_y", "tau_u", "tau_unactuated"])
        self.compare(fewer, *FD, ["ydd"])
        more = sarrus.Robot.from_text(*braced())
        self.assertEqual((len(more.actuators), len(more.independents)), (2, 1))
        self.compare(more, *ID, ["tau_y", "tau_u", "tau_unactuated"], pushed=1)
        self.compare(more, *FD, ["ydd"])

    def test_motion_and_frames(self):
        motion = ["q", "qd", "qdd", "u", "ud", "udd", "com", "frame_pose", "frame_twist"]
        for name in ["lambda", "torso", "stewart", "rh5v2_upper_body"]:
            self.compare(name, *MOTION, motion, frames=2)
        for turned in (
            sarrus.Robot.bundled("stewart_floating"),
            sarrus.Robot.bundled("lambda", floating_base=True),
        ):
            still = [name for name in motion if name not in ("qd", "ud")]
            self.compare(turned, *MOTION, still, frames=2)

    def test_wrenches_and_friction(self):
        for robot in [rubbing(), "torso", "stewart_floating"]:
            want = ["tau_y", "tau_u", "frame_pose"]
            self.compare(robot, *ID, want, frames=1, pushed=2, friction=True)
            self.compare(robot, *FD, ["ydd"], pushed=2, friction=True)

    def test_second_derivatives_are_those_of_first_ones(self):
        for robot in [rubbing(), *map(sarrus.Robot.bundled, ["torso", "stewart"])]:
            # in another order of the inputs than that of the field
            of = External(robot, FD[0], ["tau_u", "y", "yd"], ["ydd"], friction=True)
            self.assertTrue(of.second)
            given, along = inputs(robot, of, 3), inputs(robot, of, 3, seed=2)
            second = of.curvature(given, along)
            ahead, behind = (
                of.jacobians(*(x + s * v for x, v in zip(given, along, strict=True)))
                for s in (STEP, -STEP)
            )
            for pair, found in second.items():
                expected = (ahead[pair] - behind[pair]) / (2 * STEP)
                scale = max(1.0, np.abs(expected).max())
                np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-7)


class Rows(unittest.TestCase):
    def test_blocks_are_the_fields_and_rows_have_the_bits_of_single_states(self):
        robot = sarrus.Robot.bundled("torso")
        of = External(robot, *FD, ["ydd"])
        given = inputs(robot, of, 6)
        blocks = of.jacobians(*(x.reshape(2, 3, -1) for x in given))
        fields = {"y": "dydd_dy", "yd": "dydd_dyd", "tau_u": "dydd_dtau_u"}
        answer = robot.query(*FD, [*fields.values()])(**dict(zip(FD[1], given, strict=True)))
        for name, field in fields.items():
            np.testing.assert_array_equal(blocks["ydd", name].reshape(6, 2, 2), answer[field])
        ydd = of(*given)[0]
        np.testing.assert_array_equal(ydd, robot.forward_dynamics(*given))
        for k in range(6):
            np.testing.assert_array_equal(of(*(x[k] for x in given))[0], ydd[k])

    def test_a_state_without_an_answer_is_nan_or_raises(self):
        robot = sarrus.Robot.bundled("wrist")
        of = External(robot, *ID, ["tau_u"])
        y, yd, ydd = inputs(robot, of, 3)
        y[1] = 2.0
        found, blocks = of(y, yd, ydd)[0], of.jacobians(y, yd, ydd)
        for array in (found, *blocks.values()):
            self.assertTrue(np.isnan(array[1]).all())
            self.assertTrue(np.isfinite(array[::2]).all())
        loud = External(robot, *ID, ["tau_u"], raises=True)
        for way in (loud, loud.jacobians):
            with self.assertRaises(sarrus.StateError) as caught:
                way(y, yd, ydd)
            self.assertEqual(caught.exception.status, "unreachable")

    def test_fields_without_jacobians_are_refused_by_name(self):
        robot = sarrus.Robot.bundled("lambda")
        for given, want, words in [
            (
                ["y", "yd", "ydd"],
                ["energy"],
                "no Jacobians of energy; there are those of com,",
            ),
            (["y", "yd"], ["qdd"], "`qdd` depends on ydd; give it too"),
            (["y", "yd", "q_guess"], ["frame_twist"], "no Jacobians by q_guess"),
        ]:
            with self.assertRaisesRegex(sarrus.QueryError, words):
                External(robot, "kinematics", given, want, frames=["Elbow_Link"])
        floating = sarrus.Robot.bundled("stewart_floating")
        with self.assertRaisesRegex(sarrus.QueryError, "no Jacobian of qd by y: a joint is"):
            External(floating, *MOTION, ["qd"])
        of = External(robot, *ID, ["tau_u"])
        with self.assertRaisesRegex(NotImplementedError, "second derivatives are those of forward"):
            of.curvature([[0.1]] * 3, [[0.1]] * 3)
        with self.assertRaisesRegex(ValueError, r"`yd` has the shape \(2,\), expected \(1,\)"):
            of([0.1], [0.1, 0.2], [0.1])


def braced():
    """The files of the lambda elbow with a second motor, at the elbow itself."""
    urdf, submechanisms, _ = sarrus.Robot.bundled("lambda").origin.contents()
    return urdf, submechanisms.replace(b"active: [ElbowAct]", b"active: [Elbow, ElbowAct]")


def rubbing():
    """The lambda elbow with friction and damping in its joints."""
    urdf, submechanisms, _ = sarrus.Robot.bundled("lambda").origin.contents()
    end = b'velocity="10"/></joint>'
    rough = b'velocity="10"/><dynamics damping="0.3" friction="2.0"/></joint>'
    return sarrus.Robot.from_text(urdf.replace(end, rough), submechanisms)


if __name__ == "__main__":
    unittest.main()
