"""One state at a time: answers, arrays that do not fit, errors, files, pickles."""

import copy
import gc
import pickle
import resource
import tempfile
import unittest
from pathlib import Path

import numpy as np
import sarrus

ROBOTS = ("lambda", "torso", "stewart", "rh5v2_upper_body", "wrist")


def text_of(robot):
    """The contents of a robot's files."""
    urdf, submechanisms, _ = robot.origin.contents()
    return urdf, submechanisms


def resident():
    """Memory of this process [KiB]."""
    fields = Path("/proc/self/statm").read_text().split()
    return int(fields[1]) * resource.getpagesize() // 1024


class Answers(unittest.TestCase):
    def test_inverse_and_forward_dynamics_are_inverse_to_each_other(self):
        for name in ROBOTS:
            robot = sarrus.Robot.bundled(name)
            random = np.random.default_rng(1)
            y, yd, ydd = 0.1 * random.standard_normal((3, len(robot.independents)))
            tau_u = robot.inverse_dynamics(y, yd, ydd)
            self.assertEqual((tau_u.dtype, tau_u.shape), (float, (len(robot.actuators),)))
            back = robot.forward_dynamics(y, yd, tau_u)
            np.testing.assert_allclose(back, ydd, atol=1e-8)

    def test_dynamics_are_mass_matrix_and_bias_force(self):
        robot = sarrus.Robot.bundled("torso")
        y, yd, ydd = np.array([[0.1, -0.2], [0.5, 0.3], [1.0, -2.0]])
        tau_y = robot.mass_matrix(y) @ ydd + robot.bias_force(y, yd)
        actuators = robot.to_actuators(y, yd, ydd, tau_y=tau_y)
        np.testing.assert_allclose(actuators.tau_u, robot.inverse_dynamics(y, yd, ydd), rtol=1e-12)
        resting = robot.bias_force(y)
        np.testing.assert_allclose(resting, robot.bias_force(y, [0, 0]), rtol=0)

    def test_a_state_closes_all_loops_and_rates_default_to_zero(self):
        robot = sarrus.Robot.bundled("lambda")
        state = robot.state([0.2], [1.0])
        self.assertEqual(state.q[robot.joints.place(robot.independents[0])], 0.2)
        self.assertEqual([field.shape for field in state], [(len(robot.joints),)] * 3)
        np.testing.assert_array_equal(robot.state([0.2]).qd, np.zeros(len(robot.joints)))

    def test_frames_and_jacobians_agree(self):
        robot = sarrus.Robot.bundled("rh5v2_upper_body")
        random = np.random.default_rng(2)
        y, yd = 0.1 * random.standard_normal((2, len(robot.independents)))
        link = robot.links[-1]
        frame = robot.frames(link, y, yd)
        self.assertEqual([field.shape for field in frame], [(7,), (6,), (6,)])
        np.testing.assert_allclose(robot.jacobian(link, y) @ yd, frame.twist, atol=1e-12)
        tree = robot.jacobian(link, y, columns="tree") @ robot.state(y, yd).qd
        np.testing.assert_allclose(tree, frame.twist, atol=1e-12)
        u = robot.jacobian(link, y, columns="actuator") @ robot.to_actuators(y, yd).ud
        np.testing.assert_allclose(u, frame.twist, atol=1e-12)
        several = robot.frames([robot.links[0], link], y, yd)
        np.testing.assert_array_equal(several.pose[1], frame.pose)
        with self.assertRaisesRegex(sarrus.QueryError, "columns are independent"):
            robot.jacobian(link, y, columns="u")

    def test_the_sums_over_the_links_fit_each_other(self):
        robot = sarrus.Robot.bundled("rh5v2_upper_body")
        random = np.random.default_rng(3)
        y, yd = 0.1 * random.standard_normal((2, len(robot.independents)))
        want = ["momentum", "centroidal", "com_jacobian", "energy"]
        sums = robot.query("kinematics", ["y", "yd"], want)(y=y, yd=yd)
        np.testing.assert_allclose(sums.centroidal @ yd, sums.momentum, atol=1e-12)
        mass = sums.momentum[3:] / (sums.com_jacobian @ yd)
        np.testing.assert_allclose(mass, mass[0], rtol=1e-9)
        mass_matrix = robot.query("inverse-dynamics", ["y"], ["M_y"])(y=y).M_y
        self.assertAlmostEqual(sums.energy[0], yd @ mass_matrix @ yd / 2, 12)

    def test_what_the_motors_allow_fits_the_map(self):
        robot = sarrus.Robot.bundled("ankle")
        want = ["torque_vertices", "torque_support", "G_u"]
        query = robot.query("kinematics", ["y"], want, directions=3)
        d = np.array([[1.0, 0.0], [0.0, -1.0], [0.5, 0.5]])
        x = query(y=[0.1, 0.05], directions=d)
        self.assertEqual(x.torque_vertices.shape, (4, 2))
        np.testing.assert_allclose((x.torque_vertices @ d.T).max(0), x.torque_support, rtol=1e-12)
        rows = query(y=np.full((2, 2), 0.1), directions=np.stack([d, d]))
        self.assertEqual(rows.torque_support.shape, (2, 3))
        gains = robot.query("map", ["y", "tau_y", "gains_u"], ["gains_y", "margin", "binding"])
        x = gains(y=[0.1, 0.05], tau_y=[1.0, 0.0], gains_u=[[100.0, 5.0], [100.0, 5.0]])
        self.assertEqual((x.gains_y.shape, abs(x.binding).sum()), ((2, 5), 1.0))
        self.assertGreater(x.margin, 0.0)

    def test_second_derivatives_come_as_matrix_with_multipliers_and_in_batches(self):
        robot = sarrus.Robot.bundled("torso")
        n, v = 2, np.array([0.3, -1.0, 0.5, 0.2, 2.0, 0.0])
        given, y = ["y", "tau_u", "direction"], np.array([0.1, -0.05])
        second = robot.query("forward-dynamics", given, ["d2_ydd_v"])
        x = second(y=y, tau_u=np.ones(n), direction=v).d2_ydd_v
        self.assertEqual(x.shape, (n, 3 * n))
        rows = second(y=np.stack([y, y]), tau_u=np.ones((2, n)), direction=np.stack([v, -v]))
        np.testing.assert_array_equal(rows.d2_ydd_v, [x, -x])
        summed = robot.query("forward-dynamics", [*given, "multipliers"], ["d2_ydd_v"])
        mu = np.array([2.0, -3.0])
        both = summed(y=y, tau_u=np.ones(n), direction=v, multipliers=mu).d2_ydd_v
        np.testing.assert_allclose(both, mu @ x, rtol=1e-13, atol=1e-12 * abs(x).max())
        slopes = robot.query("forward-dynamics", ["y", "yd", "tau_u"], ["dydd_dy"])
        h = 1e-4
        moved = [
            slopes(y=y + s * v[:2], yd=s * v[2:4], tau_u=np.ones(n) + s * v[4:]).dydd_dy
            for s in (h, -h)
        ]
        difference = (moved[0] - moved[1]) / (2 * h)
        np.testing.assert_allclose(x[:, :n], difference, rtol=1e-5, atol=1e-5 * abs(x).max())

    def test_base_parameters_explain_the_forces(self):
        robot = sarrus.Robot.bundled("lambda")
        query = robot.query("inverse-dynamics", ["y"], ["base_parameters", "regressor_y", "tau_y"])
        x = query(y=[0.3])
        known = ~np.isnan(x.base_parameters)
        tau_y = x.regressor_y[:, known] @ x.base_parameters[known]
        np.testing.assert_allclose(tau_y, x.tau_y, rtol=1e-9)

    def test_a_joint_that_is_turned_on_its_base_is_one_that_moves(self):
        robot = sarrus.Robot.bundled("lambda")
        query = robot.query("kinematics", ["y"], ["dgamma_dtheta", "G"], frames=["Elbow_Link"])
        x = query(y=[0.3])
        assert x.dgamma_dtheta.shape == (3 + 6, len(robot.geometry)) == (9, 30)
        turned = x.dgamma_dtheta[:, robot.geometry.index("Elbow/rx")]
        np.testing.assert_allclose(turned[:3] + np.eye(3)[0], x.G[:, 0], rtol=1e-12)
        np.testing.assert_allclose(turned[3:], [1, 0, 0, 0, 0, 0], atol=1e-12)
        cut = robot.geometry.index("ElbowAct/successor/y")
        assert abs(x.dgamma_dtheta[robot.joints.index("ElbowAct"), cut]) > 0.5

    def test_an_observer_finds_a_force_that_nothing_explains(self):
        robot = sarrus.Robot.bundled("ankle")
        given = ["y", "yd", "tau_y", "dt", "gain", "observer"]
        step = robot.query("observe", given)
        y, yd = np.array([0.1, 0.05]), np.zeros(2)
        tau_y = robot.bias_force(y) - [1.0, -2.0]
        observer = np.zeros(step.given["observer"])
        for dt in [0.0] + [0.1] * 20:
            x = step(y=y, yd=yd, tau_y=tau_y, dt=dt, gain=20.0, observer=observer)
            observer = x.observer
        self.assertEqual(observer.shape, (2, 3))
        np.testing.assert_allclose(x.tau_external, [1.0, -2.0], atol=1e-12)
        rows = step(
            y=np.stack([y, y]), yd=np.zeros((2, 2)), tau_y=np.stack([tau_y, tau_y]),
            dt=[0.1, 0.1], gain=[20.0, 20.0], observer=np.stack([observer, observer]),
        )  # fmt: skip
        np.testing.assert_array_equal(rows.observer[0], rows.observer[1])

    def test_a_map_of_what_the_motors_allow_is_arrays_and_a_page(self):
        robot = sarrus.Robot.bundled("ankle")
        with tempfile.TemporaryDirectory() as folder:
            page = Path(folder) / "map.html"
            (ankle,) = sarrus.capability(robot, grid=5, page=page)
            self.assertIn("torque_vertices", page.read_text(encoding="utf-8"))
            ankle.save(Path(folder) / "map.npz")
            kept = np.load(Path(folder) / "map.npz")
            np.testing.assert_array_equal(kept["torque_max"], ankle.torque_max)
            ankle.save(Path(folder) / "map.csv")
            table = np.genfromtxt(Path(folder) / "map.csv", delimiter=",", names=True)
            self.assertEqual(len(table), 25)
        self.assertEqual(ankle.reflected_inertia.shape, (25, 2, 2))
        self.assertTrue(np.isnan(ankle.sigma_min[~ankle.reachable]).all())
        with self.assertRaisesRegex(ValueError, "points, expected at most"):
            sarrus.capability(robot, grid=1001)

    def test_friction_counts_where_it_is_asked(self):
        text = """<robot name="arm"><link name="base"/><link name="bob"><inertial>
            <origin xyz="0 0 -0.5"/><mass value="2"/>
            <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
            <joint name="pivot" type="continuous"><parent link="base"/><child link="bob"/>
            <axis xyz="0 1 0"/><dynamics damping="0" friction="0.5"/></joint></robot>"""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_text(text, encoding="utf-8")
            robot = sarrus.Robot(path)
        given = {"y": [0.2], "yd": [0.01]}
        plain = robot.query("inverse-dynamics", ["y", "yd"], ["tau_u"])(**given)
        rough = robot.query("inverse-dynamics", ["y", "yd"], ["tau_u"], friction=True)(**given)
        np.testing.assert_allclose(rough.tau_u - plain.tau_u, [0.5 * np.tanh(1.0)], rtol=1e-12)

    def test_frames_are_seen_in_other_axes_and_from_a_link(self):
        robot = sarrus.Robot.bundled("rh5v2_upper_body")
        random = np.random.default_rng(4)
        y, yd = 0.1 * random.standard_normal((2, len(robot.independents)))
        link, other = robot.links[-1], robot.links[5]
        want = ["frame_twist", "jacobian_independent"]
        for options in ({}, {"axes": "local"}, {"axes": "world", "relative_to": other}):
            query = robot.query("kinematics", ["y", "yd"], want, frames=[link], **options)
            seen = query(y=y, yd=yd)
            jacobian, twist = seen.jacobian_independent[0], seen.frame_twist[0]
            np.testing.assert_allclose(jacobian @ yd, twist, atol=1e-12)
        with self.assertRaisesRegex(ValueError, "expected mixed, world or local"):
            robot.query("kinematics", ["y"], want, frames=[link], axes="body")
        with self.assertRaisesRegex(sarrus.QueryError, "is no link"):
            robot.query("kinematics", ["y"], want, frames=[link], relative_to="hand")

    def test_positions_are_found_for_tasks(self):
        robot = sarrus.Robot.bundled("rh5v2_upper_body")
        link = "ALWristRoll_Link"
        y = np.full((3, len(robot.independents)), 0.1) + 0.05 * np.arange(3)[:, None]
        poses = robot.frames(link, y).pose
        task = {"frame": link, "p": poses[0, :3], "quat": poses[0, 3:]}
        found = robot.ik([task], y_guess=y[0] + 0.01)
        self.assertEqual(found.status, sarrus.Status.ok)
        np.testing.assert_allclose(robot.frames(link, found.y).pose[:3], poses[0, :3], atol=2e-9)
        rows = robot.ik([{"frame": link, "p": poses[:, :3], "quat": poses[:, 3:]}], y_guess=y)
        np.testing.assert_array_equal(rows.status, [0, 0, 0])
        np.testing.assert_allclose(rows.y, y, atol=1e-8)
        far = robot.ik([{"frame": link, "p": [9, 9, 9]}])
        self.assertEqual(far.status, sarrus.Status.not_reached)
        self.assertTrue(np.isfinite(far.y).all() and far.task_residual[0] > 1)
        narrow = np.array([[0.1, -0.1]] * len(robot.independents))
        with self.assertRaises(sarrus.StateError):
            robot.ik([task], bounds={"y": narrow})
        with self.assertRaisesRegex(sarrus.QueryError, "means nothing"):
            robot.ik([{"frame": link, "q": [0, 0, 0]}])

    def test_steps_of_tasks_keep_their_motion_and_their_limits(self):
        robot = sarrus.Robot.bundled("torso")
        link = robot.links[-1]
        y, yd = np.array([0.1, 0.05]), np.array([0.2, -0.1])
        twist = robot.frames(link, y, yd).twist
        task = {"frame": link, "twist": twist}
        found = robot.diff_ik([task], y, 0.01)
        np.testing.assert_allclose(found.yd, yd, atol=1e-6)
        rows = robot.diff_ik([task], np.stack([y, y]), 0.01)
        np.testing.assert_array_equal(rows.yd, np.stack([found.yd] * 2))
        np.testing.assert_allclose(robot.diff_ik([], y, 0.01, yd=yd).yd, yd, atol=1e-9)
        fast = robot.diff_ik([{"frame": link, "twist": 1e4 * twist}], y, 0.01)
        self.assertTrue((fast.binding != 0).any() and fast.task_residual[0] > 1)
        acc = robot.frames(link, y, yd, [1.0, -0.5]).acceleration
        forces = robot.step([{"frame": link, "acc": acc}], y, yd, 0.01)
        np.testing.assert_allclose(forces.ydd, [1.0, -0.5], atol=1e-5)
        expected = robot.forward_dynamics(y, yd, forces.tau_u)
        np.testing.assert_allclose(expected, forces.ydd, atol=1e-7)
        with self.assertRaisesRegex(sarrus.StateError, "infeasible"):
            robot.diff_ik([task], y, 0.01, bounds={"y": [[0.5, 0.6]] * 2})
        with self.assertRaisesRegex(sarrus.QueryError, "means nothing"):
            robot.diff_ik([{"frame": link, "acc": acc}], y, 0.01)

    def test_motion_and_forces_come_back_from_the_actuators(self):
        robot = sarrus.Robot.bundled("torso")
        y, yd, ydd, tau_y = np.array([[0.1, -0.2], [0.5, 0.3], [1.0, -2.0], [3.0, 4.0]])
        there = robot.to_actuators(y, yd, ydd, tau_y=tau_y)
        back = robot.to_independent(there.u, there.ud, there.udd, tau_u=there.tau_u)
        for found, expected in zip(back[:4], (y, yd, ydd, tau_y), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-9)
        self.assertEqual(robot.to_actuators(y)[1:], (None,) * 5)
        only = robot.to_actuators(y, ydd=ydd)
        self.assertIsNone(only.ud)
        np.testing.assert_array_equal(only.udd, robot.to_actuators(y, [0, 0], ydd).udd)

    def test_gains_give_the_same_law_in_both_spaces(self):
        robot = sarrus.Robot.bundled("torso")
        y = np.array([0.1, -0.2])
        there = robot.to_actuators(y, stiffness=[100.0, 50.0], damping=np.diag([3.0, 2.0]))
        back = robot.to_independent(there.u, stiffness=there.stiffness, damping=there.damping)
        np.testing.assert_allclose(back.stiffness, np.diag([100.0, 50.0]), atol=1e-9)
        np.testing.assert_allclose(back.damping, np.diag([3.0, 2.0]), atol=1e-9)
        # τ_y = G_uᵀ K_u G_u δy, for a small δy by the actuators' own motion
        step = np.array([1e-6, -2e-6])
        pushed = there.stiffness @ (robot.to_actuators(y + step).u - there.u)
        found = robot.to_independent(there.u, tau_u=pushed).tau_y
        np.testing.assert_allclose(found, [1e-4, -1e-4], rtol=1e-4)
        with self.assertRaisesRegex(ValueError, r"`damping` has the shape \(3,\)"):
            robot.to_actuators(y, damping=[1, 2, 3])

    def test_a_query_asks_for_anything_and_reports_every_unknown_name(self):
        robot = sarrus.Robot.bundled("lambda")
        query = robot.query("inverse-dynamics", ["y", "yd"], ["M_y", "C_y", "sigma_min"])
        self.assertEqual(query.want, {"M_y": (1, 1), "C_y": (1,), "sigma_min": ()})
        answer = query(y=[0.2], yd=[1.0])
        self.assertEqual(answer.M_y, robot.mass_matrix([0.2]))
        self.assertIsInstance(answer.sigma_min, float)
        self.assertEqual((answer.status, answer.warnings), (sarrus.Status.ok, sarrus.Warnings(0)))
        out = {"C_y": np.zeros(1)}
        self.assertIs(query(y=[0.2], yd=[1.0], out=out).C_y, out["C_y"])
        self.assertEqual(out["C_y"], answer["C_y"])
        self.assertEqual(pickle.loads(pickle.dumps(answer)), answer)
        with self.assertRaisesRegex(sarrus.QueryError, "`tau` is no field(?s:.)*`hand` is no link"):
            robot.query("kinematics", ["y"], ["tau"], frames=["hand"])
        with self.assertRaisesRegex(sarrus.QueryError, "found y where y, yd go in"):
            query(y=[0.2])
        with self.assertRaisesRegex(ValueError, "no request `statics`"):
            robot.query("statics", ["y"])
        with self.assertRaisesRegex(AttributeError, "no field `tau_u`"):
            _ = answer.tau_u

    def test_wrenches_act_on_links(self):
        robot = sarrus.Robot.bundled("lambda")
        link = robot.links[-1]
        query = robot.query("inverse-dynamics", ["y"], ["tau_y"], wrenches=[link])
        wrench = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
        change = query(y=[0.2], wrenches=wrench).tau_y - query(y=[0.2], wrenches=0 * wrench).tau_y
        np.testing.assert_allclose(change, -robot.jacobian(link, [0.2]).T @ wrench[0], atol=1e-12)

    def test_a_simulation_keeps_its_energy(self):
        robot = sarrus.Robot.bundled("lambda")
        run = robot.simulate(1.0, [0.3], every=0.1)
        self.assertEqual((run.end, run.time.shape, run.q.shape[0]), ("finished", (11,), 11))
        self.assertLess(run.drift, 1e-6)
        self.assertLess(np.ptp(run.energy), 1e-6 * np.ptp(run.kinetic))
        gains = sarrus.Gains("y", [1000.0], [10.0], [0.3])
        held = robot.simulate(0.2, [0.3], inputs=[gains], method="rk4", step=1e-3)
        self.assertLess(np.ptp(held.y), np.ptp(run.y))
        with self.assertRaisesRegex(ValueError, "no method `magic`"):
            robot.simulate(1.0, [0.3], method="magic")
        with self.assertRaises(ZeroDivisionError):
            robot.simulate(1e5, [0.3], method="rk4", step=1e-3, progress=lambda *_: 1 / 0)


class Arrays(unittest.TestCase):
    def setUp(self):
        self.robot = sarrus.Robot.bundled("torso")
        self.given = np.array([[0.1, -0.2], [0.5, 0.3], [1.0, -2.0]])
        self.tau_u = self.robot.inverse_dynamics(*self.given)

    def test_everything_that_numpy_reads_as_real_numbers_is_taken(self):
        y, yd, ydd = self.given
        strided = np.zeros((2, 3))
        strided[:, 1] = y
        swapped = y.astype(">f8")
        unaligned = np.frombuffer(b"." + y.tobytes(), np.uint8)[1:].view(float)
        self.assertFalse(unaligned.flags.aligned)
        packed = np.zeros(2, [("a", "i4"), ("b", "f8")])
        packed["b"] = y
        read_only = y.copy()
        read_only.flags.writeable = False
        backward = y[::-1].copy()[::-1]
        for other in (
            *(list(y), tuple(y), strided[:, 1], swapped, unaligned, y.view(np.matrix).A1),
            *(packed["b"], read_only, backward),
        ):
            np.testing.assert_array_equal(self.robot.inverse_dynamics(other, yd, ydd), self.tau_u)
        whole = self.robot.inverse_dynamics([0, 0], np.zeros(2, np.int8), np.zeros(2, np.float32))
        np.testing.assert_array_equal(whole, self.robot.inverse_dynamics(*np.zeros((3, 2))))

    def test_arrays_that_do_not_fit_are_named(self):
        y, yd, ydd = self.given
        ask = self.robot.inverse_dynamics
        with self.assertRaisesRegex(ValueError, r"`yd` has the shape \(3,\), expected \(2,\)"):
            ask(y, np.zeros(3), ydd)
        with self.assertRaisesRegex(ValueError, r"`y` has the shape \(1, 2, 2\)"):
            ask(np.zeros((1, 2, 2)), yd, ydd)
        with self.assertRaisesRegex(ValueError, "`y` has 4 rows and `yd` is one state"):
            ask(np.zeros((4, 2)), yd, ydd)
        with self.assertRaisesRegex(ValueError, "`y` has 4 rows and `ydd` has 3 rows"):
            ask(np.zeros((4, 2)), np.zeros((4, 2)), np.zeros((3, 2)))
        for wrong in (["a", "b"], [1j, 0], [True, False], [None, None]):
            with self.assertRaisesRegex(TypeError, "`y` holds .*, expected real numbers"):
                ask(wrong, yd, ydd)

    def test_masked_elements_are_refused_wherever_numbers_are_read(self):
        y, yd, ydd = self.given
        robot = self.robot
        masked = np.ma.array(y, mask=[False, True])
        rows = np.ma.array([y, y], mask=[[False, True], [False, False]])
        table = sarrus.Table("y", [0.0, 1.0], rows)
        terms = robot.query("inverse-dynamics", ["y"], ["C_y"])
        asks = {
            "y": [
                lambda: robot.inverse_dynamics(masked, yd, ydd),
                lambda: robot.inverse_dynamics(masked.astype(int), yd, ydd),
                lambda: robot.inverse_dynamics(rows, [yd, yd], [ydd, ydd]),
                lambda: robot.inverse_dynamics([y, masked], [yd, yd], [ydd, ydd]),
                lambda: terms(y=masked),
                lambda: robot.simulate(0.1, masked),
            ],
            "yd": [lambda: robot.state(y, masked), lambda: robot.simulate(0.1, y, masked)],
            "tau_u": [lambda: robot.forward_dynamics(y, yd, masked)],
            "damping": [lambda: robot.to_actuators(y, damping=masked)],
            "forces": [
                lambda: robot.simulate(0.1, y, tau_y=masked),
                lambda: robot.simulate(0.1, y, inputs=[table]),
            ],
            "out": [lambda: robot.inverse_dynamics(y, yd, ydd, out=masked.copy())],
        }
        for name, calls in asks.items():
            for call in calls:
                with self.assertRaisesRegex(ValueError, f"`{name}` has masked elements"):
                    call()
        # a mask of nothing hides nothing, and neither do other arrays of numpy's
        for whole in (np.ma.array(y), np.ma.array(y, mask=[False, False]), y.view(np.recarray)):
            np.testing.assert_array_equal(robot.inverse_dynamics(whole, yd, ydd), self.tau_u)
        both = robot.inverse_dynamics(np.ma.array([y, y]), [yd, yd], [ydd, ydd])
        np.testing.assert_array_equal(both, [self.tau_u] * 2)

    def test_out_is_written_in_place_or_refused(self):
        out = np.zeros(2)
        self.assertIs(self.robot.inverse_dynamics(*self.given, out=out), out)
        np.testing.assert_array_equal(out, self.tau_u)
        # one array for in and out
        y = self.given[0].copy()
        self.robot.inverse_dynamics(y, *self.given[1:], out=y)
        np.testing.assert_array_equal(y, self.tau_u)
        read_only = np.zeros(2)
        read_only.flags.writeable = False
        for wrong, error, words in (
            (np.zeros(3), ValueError, r"has the shape \(3,\), expected \(2,\)"),
            (np.zeros((1, 2)), ValueError, "has the shape"),
            (np.zeros(2, np.float32), TypeError, "must be an array of float64"),
            ([0.0, 0.0], TypeError, "must be an array of float64"),
            (np.zeros(4)[::2], ValueError, "contiguous"),
            (read_only, ValueError, "cannot be written"),
        ):
            with self.assertRaisesRegex(error, words):
                self.robot.inverse_dynamics(*self.given, out=wrong)

    def test_a_state_without_an_answer_raises_its_status_and_writes_nan(self):
        robot = sarrus.Robot.bundled("stewart")
        zero = np.zeros(6)
        nan = np.array([np.nan, 0, 0, 0, 0, 0])
        out = np.zeros(6)
        with self.assertRaises(sarrus.StateError) as caught:
            robot.inverse_dynamics(nan, zero, zero, out=out)
        error = caught.exception
        self.assertEqual((error.status, error.code), ("non_finite_input", 2))
        self.assertTrue(str(error).startswith("non_finite_input: an input number is NaN"))
        self.assertTrue(np.isnan(out).all())
        copied = pickle.loads(pickle.dumps(error))
        self.assertEqual((copied.status, str(copied)), (error.status, str(error)))
        tau_u, status = robot.inverse_dynamics(nan, zero, zero, return_status=True)
        self.assertTrue(np.isnan(tau_u).all() and status == sarrus.Status.non_finite_input)
        self.assertIsInstance(error, ValueError)

    def test_what_survives_a_failure_is_in_the_error(self):
        robot = sarrus.Robot.bundled("wrist")
        query = robot.query("kinematics", ["y"], ["q", "nearest_y"], search=True)
        with self.assertRaises(sarrus.StateError) as caught:
            query(y=[2.0, 2.0])
        error = caught.exception
        self.assertEqual(error.status, "unreachable")
        self.assertTrue(np.isnan(error.answer.q).all())
        self.assertTrue(np.isfinite(error.answer.nearest_y).all())
        answer = query(y=[2.0, 2.0], return_status=True)
        self.assertEqual(answer.status, sarrus.Status.unreachable)


class Files(unittest.TestCase):
    def test_a_robot_is_read_from_files_and_from_their_contents(self):
        bundled = sarrus.Robot.bundled("lambda")
        urdf, submechanisms = text_of(bundled)
        with tempfile.TemporaryDirectory() as folder:
            paths = Path(folder, "robot.urdf"), Path(folder, "robot.yml")
            paths[0].write_bytes(urdf)
            paths[1].write_bytes(submechanisms)
            for robot in (
                sarrus.Robot.load(*paths),
                sarrus.Robot.load(str(paths[0]), str(paths[1])),
                sarrus.Robot.from_text(urdf.decode(), submechanisms),
            ):
                self.assertEqual(robot.fingerprint, bundled.fingerprint)
            serial = sarrus.Robot.load(paths[0])
            self.assertEqual(len(serial.independents), len(serial.joints))
        moon = sarrus.Robot.bundled("lambda", gravity=(0, 0, -1.62))
        ratio = moon.bias_force([0.2]) / bundled.bias_force([0.2])
        np.testing.assert_allclose(ratio, 1.62 / 9.81)
        free = sarrus.Robot.bundled("lambda", floating_base=True)
        self.assertEqual(free.joints[0], "floating_base/rx")
        self.assertEqual(free.joints.place("floating_base/tz"), 5)
        upper = sarrus.Robot.bundled("rh5v2_upper_body")
        arm = [name for name in upper.independents if name.startswith("AR")]
        locked = sarrus.Robot.bundled("rh5v2_upper_body", lock=dict.fromkeys(arm))
        self.assertEqual(len(locked.independents), len(upper.independents) - len(arm))
        at = sarrus.Robot.bundled("lambda", floating_base=True, lock=["floating_base"])
        self.assertEqual(at.independents, bundled.independents)

    def test_files_that_are_no_robot_are_refused_with_every_fault(self):
        with self.assertRaises(sarrus.LoadError) as caught:
            sarrus.Robot.from_text("<robot name='x'><link name='a'/><link name='a'/></robot")
        fault = caught.exception.diagnostics[0]
        self.assertEqual(fault["file"], "robot.urdf")
        self.assertEqual({*fault}, {"file", "line", "column", "found", "expected", "help"})
        self.assertIn(f"robot.urdf:{fault['line']}:", str(caught.exception))
        with self.assertRaisesRegex(sarrus.LoadError, "did you mean `torso`"):
            sarrus.Robot.bundled("toso")
        with self.assertRaises(OSError):
            sarrus.Robot.load("nowhere.urdf")
        with self.assertRaisesRegex(TypeError, "found a text"):
            sarrus.Robot.bundled("lambda", only="hand")
        self.assertIn("lambda", sarrus.bundled())

    def test_a_pickled_robot_is_the_same_wherever_it_is_read(self):
        robot = sarrus.Robot.bundled("torso", gravity=(0, 0, -1.62))
        given = np.array([[0.1, -0.2], [0.5, 0.3], [1.0, -2.0]])
        for other in (pickle.loads(pickle.dumps(robot)), copy.deepcopy(robot)):
            self.assertIsInstance(other, sarrus.Robot)
            self.assertEqual(other.fingerprint, robot.fingerprint)
            np.testing.assert_array_equal(
                other.inverse_dynamics(*given), robot.inverse_dynamics(*given)
            )
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "robot.urdf")
            urdf, _ = text_of(robot)
            path.write_bytes(urdf)
            serial = sarrus.Robot.load(path)
            path.write_bytes(urdf.replace(b'mass value="', b'mass value="1'))
            changed = pickle.dumps(serial)
            path.unlink()
            with self.assertRaises(OSError):
                pickle.dumps(serial)
        with self.assertRaisesRegex(sarrus.LoadError, "expected [0-9a-f]{16}"):
            pickle.loads(changed)

    def test_robots_that_are_dropped_leave_no_memory(self):
        def once():
            robot = sarrus.Robot.bundled("lambda")
            robot.inverse_dynamics([0.2], [1.0], [0.0])
            robot.mass_matrix([[0.1], [0.2]])

        def many(n):
            for _ in range(n):
                once()
            gc.collect()
            return resident()

        before = many(200)
        after = many(1000)
        # a robot and its plans take some 100 KiB; allocators keep a little
        self.assertLess(after - before, 2048)


if __name__ == "__main__":
    unittest.main()
