"""Motors of parallel mechanisms in a policy's simulator: laws, gradients, commands, verdicts."""

import importlib.util
import unittest

import numpy as np
import sarrus
from sarrus import policy

STEP = 1e-6


def states(robot, rows, seed=1):
    """Random positions, velocities and targets within reach."""
    random = np.random.default_rng(seed)
    return 0.2 * random.uniform(-1, 1, (3, rows, len(robot.independents)))


def missing(module):
    """Say that a test of an optional package does not run."""
    if importlib.util.find_spec(module) is None:
        print(f"{module} is absent: not run")
        return True
    return False


class Law(unittest.TestCase):
    def test_forces_are_those_of_the_motors_through_the_map(self):
        for name in ["ankle", "torso", "lambda", "rh5v2_upper_body"]:
            robot = sarrus.Robot.bundled(name)
            y, yd, target = states(robot, 7)
            law = policy.ActuatorPD(robot, 500.0, 20.0, effort=np.inf)
            tau_y = law(y, yd, target)
            for row in range(7):
                here = robot.to_actuators(y[row], yd[row])
                wanted = 500.0 * (robot.to_actuators(target[row]).u - here.u) - 20.0 * here.ud
                expected = robot.to_independent(here.u, tau_u=wanted).tau_y
                np.testing.assert_allclose(tau_y[row], expected, rtol=1e-9, atol=1e-9)
                np.testing.assert_array_equal(law(y[row], yd[row], target[row]), tau_y[row])

    def test_motors_give_no_more_than_they_can_in_the_order_of_the_columns(self):
        robot = sarrus.Robot.bundled("ankle")
        y, yd, target = states(robot, 20)
        law = policy.ActuatorPD(robot, 1e5, 0.0, effort=[30.0, 50.0])
        forces = law.motor_forces(y, yd, target)
        self.assertEqual(np.abs(forces).max(0).tolist(), [30.0, 50.0])
        turned = policy.ActuatorPD(
            robot, 1e5, 0.0, effort=[30.0, 50.0], joints=list(robot.independents)[::-1]
        )
        swapped = turned(y[:, ::-1], yd[:, ::-1], target[:, ::-1])
        np.testing.assert_array_equal(swapped[:, ::-1], law(y, yd, target))
        with self.assertRaisesRegex(sarrus.QueryError, "expected all of"):
            policy.ActuatorPD(robot, 1.0, 1.0, joints=["AnklePitch"])

    def test_slopes_are_those_of_differences_at_any_speed_and_at_limits(self):
        for name, effort in [("ankle", np.inf), ("torso", 20.0), ("stewart", np.inf)]:
            robot = sarrus.Robot.bundled(name)
            if len(robot.coordinates) != len(robot.joints):
                continue
            rows = states(robot, 3)
            law = policy.ActuatorPD(robot, 300.0, 40.0, effort=effort)
            weights = np.random.default_rng(2).standard_normal(rows[0].shape)
            slopes = law._backward([*rows, *law._forward(*rows)[1:]], weights)
            for of, slope in enumerate(slopes):
                for k in range(rows.shape[2]):
                    ends = []
                    for sign in (1.0, -1.0):
                        moved = rows.copy()
                        moved[of, :, k] += sign * STEP
                        ends.append((law(*moved) * weights).sum(1))
                    found = (ends[0] - ends[1]) / (2 * STEP)
                    size = 1.0 + np.abs(slope).max()
                    np.testing.assert_allclose(slope[:, k], found, atol=1e-5 * size)

    def test_a_target_out_of_reach_has_no_number(self):
        law = policy.ActuatorPD(sarrus.Robot.bundled("wrist"), 1.0, 1.0)
        tau_y = law(np.zeros((2, 2)), np.zeros((2, 2)), [[0.1, 0.1], [2.0, 2.0]])
        self.assertEqual(np.isnan(tau_y).all(1).tolist(), [False, True])

    def test_tensors_of_torch_carry_gradients(self):
        if missing("torch"):
            return
        import torch

        robot = sarrus.Robot.bundled("ankle")
        law = policy.ActuatorPD(robot, 300.0, 40.0, effort=np.inf)
        rows = [torch.tensor(x, requires_grad=True) for x in states(robot, 3)]
        self.assertTrue(torch.autograd.gradcheck(law, rows, eps=1e-6, atol=1e-4, rtol=1e-5))
        plain = law(*(x.detach().numpy() for x in rows))
        np.testing.assert_array_equal(law(*rows).detach().numpy(), plain)
        half = law(*(x.detach().float() for x in rows))
        self.assertEqual(half.dtype, torch.float32)


class Elsewhere(unittest.TestCase):
    def test_forces_are_those_of_the_loops_in_mujoco(self):
        if missing("mujoco"):
            return
        import mujoco

        robot = sarrus.Robot.bundled("ankle")
        spec = mujoco.MjSpec.from_string(robot.origin.contents()[0].decode())
        spec.compiler.fusestatic = False
        for side in "LR":
            spec.add_equality(
                type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_BODY,
                name1=f"AnkleAct{side}_Link", name2="AnkleRoll_Link", data=np.zeros(12),
            )  # fmt: skip
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
        model = spec.compile()
        data = mujoco.MjData(model)
        place = [model.joint(name).dofadr[0] for name in robot.joints]
        law = policy.ActuatorPD(robot, 3000.0, 100.0, effort=np.inf)
        for y, yd, target in zip(*states(robot, 20), strict=True):
            data.qpos[place] = robot.state(y).q
            mujoco.mj_forward(model, data)
            self.assertLess(np.abs(data.efc_pos).max(), 1e-12)
            jacobian = data.efc_J.reshape(-1, model.nv)[:6, place]
            free = [robot.joints.index(name) for name in robot.independents]
            bound = [k for k in range(model.nv) if k not in free]
            rates = np.zeros((model.nv, 2))
            rates[free] = np.eye(2)
            rates[bound] = -np.linalg.solve(jacobian[:, bound], jacobian[:, free])
            motors = [robot.joints.index(name) for name in robot.actuators]
            now = data.qpos[place][motors]
            wanted = 3000.0 * (robot.state(target).q[motors] - now) - 100.0 * rates[motors] @ yd
            found = law(y, yd, target)
            np.testing.assert_allclose(found, rates[motors].T @ wanted, rtol=0, atol=1e-9)

    def test_commands_of_the_bridge_make_the_forces_of_the_policy(self):
        robot = sarrus.Robot.bundled("ankle")
        y, yd, target = states(robot, 1)[:, 0]
        stiffness, damping = np.array([80.0, 40.0]), np.array([2.0, 1.0])
        sent = policy.bridge_commands(robot, y, yd, target, stiffness, damping)
        here = robot.to_actuators(y, yd)
        # what a motor does with its command
        tau_u = sent["stiffness"] * (sent["position"] - here.u)
        tau_u += sent["damping"] * (sent["velocity"] - here.ud) + sent["effort"]
        tau_y = robot.to_independent(here.u, tau_u=tau_u).tau_y
        np.testing.assert_allclose(tau_y, stiffness * (target - y) - damping * yd, atol=1e-10)

    def test_a_box_is_judged_at_its_worst_pose(self):
        robot = sarrus.Robot.bundled("ankle")
        (ankle,) = sarrus.capability(robot, grid=5)
        effort = [100.0, 60.0]
        inertia = [0.1, 0.1]
        found = policy.judge(robot, effort=effort, velocity=5.0, armature=inertia, grid=5)
        kinds = [x.what for x in found[::2]]
        self.assertEqual((len(found), kinds), (6, ["effort", "velocity", "armature"]))
        for verdict, most, k in zip(found[:2], effort, range(2), strict=True):
            ratio = np.nanmax(most / ankle.torque_alone[:, k])
            self.assertAlmostEqual(verdict.ratio, ratio, 12)
            at = np.flatnonzero((ankle.points == list(verdict.at.values())).all(1))
            self.assertAlmostEqual(ankle.torque_alone[at[0], k], verdict.able, 12)
        words = r"effort of AnklePitch is .* times what the motors can do at"
        self.assertRegex(str(found[0]), words)

    def test_lines_for_simulators_have_the_numbers_of_the_pose(self):
        robot = sarrus.Robot.bundled("torso")
        for simulator, word in [
            ("mujoco", "actuatorfrcrange="), ("mjlab", "effort_limit="), ("isaaclab", "_limit_sim=")
        ]:  # fmt: skip
            text = policy.lines(robot, simulator, at=[0.1, 0.0]).splitlines()
            self.assertEqual(len(text), 2)
            for name, line in zip(robot.independents, text, strict=True):
                self.assertIn(f'"{name}"', line)
                self.assertIn(word, line)


if __name__ == "__main__":
    unittest.main()
