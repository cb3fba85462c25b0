"""CasADi, JAX, PyTorch and Crocoddyl with derivatives of sarrus: calculus, and a swing-up each."""

import functools
import importlib.util
import logging
import runpy
import sys
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
import sarrus
import sarrus.casadi
import sarrus.jax
import sarrus.torch
from sarrus.external import External

ID = ("inverse-dynamics", ["y", "yd", "ydd"], ["tau_u", "tau_y"])
FD = ("forward-dynamics", ["y", "yd", "tau_u"], ["ydd"])
EXAMPLE = Path(__file__).parents[1] / "examples" / "crocoddyl_action.py"
DURATION, START, TARGET, LOWEST = 2.5, 0.0, 0.85, -0.65


def needs(package):
    """Say that a test does not run without an optional package."""

    def wrapper(test):
        @functools.wraps(test)
        def run(self):
            if importlib.util.find_spec(package) is None:
                print(f"{package} is absent: not run")
            else:
                test(self)

        return run

    return wrapper


def states(robot, rows, seed=1):
    """Random positions, velocities, and accelerations or forces."""
    random = np.random.default_rng(seed)
    return list(0.2 * random.uniform(-1.0, 1.0, (3, rows, len(robot.independents))))


def swinging_elbow():
    """A lambda elbow that hangs down at zero, with a motor too weak to hold it at the target."""
    urdf, submechanisms, _ = sarrus.Robot.bundled("lambda").origin.contents()
    head, tail = urdf.split(b'<joint name="ElbowAct"')
    weak = head + b'<joint name="ElbowAct"' + tail.replace(b'effort="1000"', b'effort="4.2"')
    turned = np.pi - 0.727
    gravity = 9.81 * np.array([0.0, np.sin(turned), -np.cos(turned)])
    return sarrus.Robot.from_text(weak, submechanisms, gravity=gravity)


class Swing(unittest.TestCase):
    """A swing-up by forces that are linear in each interval of time."""

    intervals = 50

    def setUp(self):
        self.robot = swinging_elbow()
        motor = self.robot.joints.index(self.robot.actuators[0])
        self.limit = float(self.robot.limits["effort"][motor])
        self.times = np.linspace(0.0, DURATION, self.intervals + 1)
        self.guess = 0.5 * self.limit * np.sin(6.0 * self.times)
        with self.assertWarnsRegex(sarrus.StateWarning, "limits_exceeded"):
            held = self.robot.inverse_dynamics([TARGET], [0.0], [0.0])
        self.assertGreater(held[0], 4.0 * self.limit)

    def judge(self, forces, position=2e-3, velocity=2e-2):
        """Simulate the forces: the target is reached, and no limit is exceeded."""
        self.assertLessEqual(np.abs(forces).max(), self.limit * (1.0 + 1e-7))
        self.assertGreater(np.abs(forces).max(), 0.9 * self.limit)
        inputs = [sarrus.Table("u", self.times, np.reshape(forces, (-1, 1)))]
        run = self.robot.simulate(DURATION, [START], inputs=inputs, limits=True)
        self.assertEqual((run.end, run.events), ("finished", ()))
        self.assertLess(abs(run.y[-1, 0] - TARGET), position)
        self.assertLess(abs(run.yd[-1, 0]), velocity)
        # the optimisers bound the instants alone
        self.assertGreater(run.y.min(), LOWEST - 1e-2)

    def defects(self, forward, y, yd, tau_u):
        """Defects of collocation by Hermite and Simpson, with (n, 1) arrays of any package."""
        h = DURATION / self.intervals
        ydd = forward(y, yd, tau_u)

        def middle(x, rate):
            return (x[:-1] + x[1:]) / 2 + h / 8 * (rate[:-1] - rate[1:])

        at = middle(y, yd), middle(yd, ydd)
        between = forward(*at, (tau_u[:-1] + tau_u[1:]) / 2)
        pairs = [(y, yd, at[1]), (yd, ydd, between)]
        return [x[1:] - x[:-1] - h / 6 * (a[:-1] + 4 * m + a[1:]) for x, a, m in pairs]


class WithoutPackages(unittest.TestCase):
    def test_a_missing_package_is_reported_with_the_line_that_installs_it(self):
        robot = sarrus.Robot.bundled("lambda")
        for package in ("casadi", "jax", "torch"):
            module = getattr(sarrus, package)
            with (
                mock.patch.dict(sys.modules, {package: None}),
                self.assertRaisesRegex(ImportError, rf"pip install 'sarrus\[{package}\]'"),
            ):
                module.function(robot, *FD)


class CasADi(Swing):
    @needs("casadi")
    def test_jacobians_of_a_batch_are_block_diagonal_fields(self):
        robot = sarrus.Robot.bundled("torso")
        given = states(robot, 4)
        for query in (ID, FD):
            function = sarrus.casadi.function(robot, *query, rows=4)
            of = External(robot, *query)
            columns = [x.T for x in given]
            found = function.call(columns)
            for array, expected in zip(found, of(*given), strict=True):
                np.testing.assert_array_equal(np.array(array).T, expected)
            jacobian, blocks = function.jacobian(), of.jacobians(*given)
            matrices = jacobian.call([*columns, *found])
            self.assertEqual(jacobian.name_out(), [f"jac_{o}_{i}" for o, i in blocks])
            for block, matrix in zip(blocks.values(), matrices, strict=True):
                full = np.array(matrix).reshape(4, 2, 4, 2)
                self.assertEqual(matrix.nnz(), block.size)
                for k in range(4):
                    np.testing.assert_array_equal(full[k, :, k], block[k])

    @needs("casadi")
    def test_frames_are_columns_and_gradients_those_of_differences(self):
        import casadi

        robot = sarrus.Robot.bundled("rh5v2_upper_body")
        links = [robot.links[-1], robot.links[-2]]
        query = ("kinematics", ["y", "yd"], ["frame_pose", "frame_twist"])
        function = sarrus.casadi.function(robot, *query, frames=links, name="hands")
        y, yd = (x[0] for x in states(robot, 1)[:2])
        pose, twist = function(y, yd)
        frames = robot.frames(links, y, yd)
        np.testing.assert_array_equal(np.array(pose).T, frames.pose)
        np.testing.assert_array_equal(np.array(twist).T, frames.twist)
        x = casadi.MX.sym("x", 2 * len(y))
        cost = sum(map(casadi.sumsqr, function(*casadi.vertsplit(x, len(y)))))
        gradient = casadi.Function("gradient", [x], [cost, casadi.gradient(cost, x)])
        at, step = np.concatenate([y, yd]), 1e-5
        found = np.array(gradient(at)[1])[:, 0]
        for k, row in enumerate(step * np.eye(len(at))):
            expected = float(gradient(at + row)[0] - gradient(at - row)[0]) / (2 * step)
            self.assertAlmostEqual(found[k], expected, delta=1e-7 * np.abs(found).max())

    @needs("casadi")
    def test_hessians_of_forward_dynamics(self):
        import casadi

        robot = sarrus.Robot.bundled("torso")
        function = sarrus.casadi.function(robot, *FD, rows=3)
        x, weights = casadi.MX.sym("x", 2, 9), np.arange(6.0).reshape(2, 3)
        value = casadi.dot(weights, function(*casadi.horzsplit(x, 3)))
        column = casadi.MX.sym("column", 18)
        value = casadi.Function("value", [x], [value])(casadi.reshape(column, 2, 9))
        slopes = casadi.Function("slopes", [column], [*casadi.hessian(value, column)])
        at, step = 0.2 * np.random.default_rng(1).uniform(-1.0, 1.0, 18), 1e-5
        found = np.array(slopes(at)[0])
        for k, row in enumerate(step * np.eye(18)):
            expected = np.array(slopes(at + row)[1] - slopes(at - row)[1])[:, 0] / (2 * step)
            np.testing.assert_allclose(found[k], expected, atol=1e-7 * np.abs(found).max())
        inverse = sarrus.casadi.function(robot, *ID)
        first = inverse.jacobian()
        with self.assertRaises(RuntimeError):
            first.jacobian()

    @needs("casadi")
    def test_a_state_without_an_answer_is_nan_or_an_error(self):
        robot = sarrus.Robot.bundled("wrist")
        query = ("inverse-dynamics", ["y", "yd", "ydd"], ["tau_u"])
        far = ([2.0, 2.0], 0.0, 0.0)
        self.assertTrue(np.isnan(np.array(sarrus.casadi.function(robot, *query)(*far))).all())
        loud = sarrus.casadi.function(robot, *query, raises=True)
        with mock.patch("sys.stderr"), self.assertRaisesRegex(RuntimeError, "unreachable"):
            loud(*far)

    @needs("casadi")
    def test_ipopt_swings_the_elbow_up_within_the_limit_of_the_motor(self):
        import casadi

        columns = {}

        def forward(y, yd, tau_u):
            rows = y.numel()
            if rows not in columns:
                columns[rows] = sarrus.casadi.function(self.robot, *FD, rows=rows)
            return columns[rows](y.T, yd.T, tau_u.T).T

        for hessian in ("exact", "limited-memory"):
            problem = casadi.Opti()
            y, yd, tau_u = (problem.variable(self.intervals + 1) for _ in range(3))
            for defect in self.defects(forward, y, yd, tau_u):
                problem.subject_to(defect == 0)
            problem.subject_to(problem.bounded(-self.limit, tau_u, self.limit))
            problem.subject_to(y >= LOWEST)
            for value, number in ((y[0], START), (yd[0], 0), (y[-1], TARGET), (yd[-1], 0)):
                problem.subject_to(value == number)
            problem.minimize(casadi.sumsqr(tau_u / self.limit) / self.intervals)
            problem.set_initial(y, START)
            problem.set_initial(tau_u, self.guess)
            quiet = {"print_level": 0, "sb": "yes", "hessian_approximation": hessian}
            quiet["bound_relax_factor"] = 0.0
            problem.solver("ipopt", {"print_time": False}, quiet)
            solution = problem.solve()
            self.judge(solution.value(tau_u))


class JAX(Swing):
    # the time of SciPy's linear algebra grows with their cube
    intervals = 25

    def setUp(self):
        super().setUp()
        if importlib.util.find_spec("jax"):
            import jax

            jax.config.update("jax_enable_x64", True)
            logging.getLogger("jax").setLevel(logging.CRITICAL)

    @needs("jax")
    def test_derivatives_are_the_fields_through_every_transformation(self):
        import jax
        from jax.test_util import check_grads

        robot = sarrus.Robot.bundled("torso")
        given = states(robot, 5)
        for query in (ID, FD):
            function, of = sarrus.jax.function(robot, *query), External(robot, *query)
            found, blocks = jax.jit(function)(*given), of.jacobians(*given)
            found = found if isinstance(found, tuple) else (found,)
            for array, expected in zip(found, of(*given), strict=True):
                np.testing.assert_array_equal(array, expected)
            for way in (jax.jacfwd, jax.jacrev):
                jacobians = jax.vmap(way(function, (0, 1, 2)))(*given)
                jacobians = jacobians if len(found) > 1 else (jacobians,)
                for (o, i), block in blocks.items():
                    of_output = jacobians[[*of.outputs].index(o)]
                    np.testing.assert_array_equal(of_output[[*of.inputs].index(i)], block)
            check_grads(function, given, order=1, eps=1e-5)
        # one state beside rows, and frames, whose fields are matrices
        y, yd, _ = given
        mixed = sarrus.jax.function(robot, *FD)(y[0], yd, yd)
        np.testing.assert_array_equal(mixed, robot.forward_dynamics(0 * y + y[0], yd, yd))
        query = ("kinematics", ["y", "yd"], ["frame_pose", "frame_twist"])
        frames = sarrus.jax.function(robot, *query, frames=[robot.links[-1], robot.links[-2]])
        self.assertEqual(frames(y, yd)[0].shape, (5, 2, 7))
        check_grads(frames, (y, yd), order=1, eps=1e-5)

    @needs("jax")
    def test_hessians_of_forward_dynamics(self):
        import jax

        robot = sarrus.Robot.bundled("torso")
        forward = sarrus.jax.function(robot, *FD)
        weights = np.array([1.0, -0.5])

        def value(x):
            return weights @ forward(*jax.numpy.split(x, 3))

        at, step = np.concatenate([x[0] for x in states(robot, 1)]), 1e-5
        found, gradient = jax.hessian(value)(at), jax.jit(jax.grad(value))
        for k, row in enumerate(step * np.eye(6)):
            expected = (gradient(at + row) - gradient(at - row)) / (2 * step)
            np.testing.assert_allclose(found[k], expected, atol=1e-7 * np.abs(found).max())
        inverse = sarrus.jax.function(robot, *ID[:2], ["tau_u"])
        with self.assertRaisesRegex(NotImplementedError, "second derivatives are those of forward"):
            jax.hessian(lambda y: inverse(y, at[:2], at[:2])[0])(at[:2])

    @needs("jax")
    def test_precision_shapes_and_states_without_an_answer(self):
        import jax

        robot = sarrus.Robot.bundled("wrist")
        query = (*ID[:2], ["tau_u"])
        function, rest = sarrus.jax.function(robot, *query), np.zeros(2)
        self.assertTrue(np.isnan(function(np.full(2, 2.0), rest, rest)).all())
        loud = sarrus.jax.function(robot, *query, raises=True)
        with self.assertRaisesRegex(Exception, "unreachable"):
            loud(np.full(2, 2.0), rest, rest).block_until_ready()
        with self.assertRaisesRegex(ValueError, r"`yd` has the shape \(3,\)"):
            function(rest, np.zeros(3), rest)
        jax.config.update("jax_enable_x64", False)
        with self.assertRaisesRegex(TypeError, "jax_enable_x64"):
            function(rest, rest, rest)

    @needs("jax")
    def test_sequential_quadratic_programs_swing_the_elbow_up_within_the_limit_of_the_motor(self):
        import jax
        from scipy.optimize import minimize

        forward = sarrus.jax.function(self.robot, *FD)
        n = self.intervals + 1

        @jax.jit
        def defects(x):
            y, yd, part = (column[:, None] for column in jax.numpy.split(x, 3))
            found = self.defects(forward, y, yd, self.limit * part)
            return jax.numpy.concatenate(found)[:, 0]

        slopes = jax.jit(jax.jacrev(defects))
        bounds = np.repeat([[LOWEST, 2.0], [-20.0, 20.0], [-1.0, 1.0]], n, axis=0)
        for place, value in ((0, START), (n, 0.0), (n - 1, TARGET), (2 * n - 1, 0.0)):
            bounds[place] = value
        first = np.concatenate([np.full(n, START), np.zeros(n), self.guess / self.limit])
        found = minimize(
            lambda x: x[2 * n :] @ x[2 * n :] / self.intervals,
            np.clip(first, *bounds.T),
            jac=lambda x: 2.0 / self.intervals * np.where(np.arange(3 * n) < 2 * n, 0.0, x),
            bounds=bounds,
            constraints={
                "type": "eq",
                "fun": lambda x: np.asarray(defects(x)),
                "jac": lambda x: np.asarray(slopes(x)),
            },
            method="SLSQP",
        )
        self.assertTrue(found.success, found.message)
        self.judge(self.limit * found.x[2 * n :])


class PyTorch(Swing):
    @needs("torch")
    def test_gradients_are_the_fields_and_those_of_differences(self):
        import torch

        robot = sarrus.Robot.bundled("torso")
        given = [torch.tensor(x, requires_grad=True) for x in states(robot, 5)]
        for query in (ID, FD):
            function, of = sarrus.torch.function(robot, *query), External(robot, *query)
            self.assertTrue(torch.autograd.gradcheck(function, given, eps=1e-6, atol=1e-5))
            plain = [x.detach() for x in given]
            found = function(*plain)
            found = found if isinstance(found, tuple) else (found,)
            for tensor, expected in zip(found, of(*plain), strict=True):
                np.testing.assert_array_equal(tensor, expected)
            jacobians = torch.func.vmap(torch.func.jacrev(function, (0, 1, 2)))(*plain)
            jacobians = jacobians if len(found) > 1 else (jacobians,)
            for (o, i), block in of.jacobians(*plain).items():
                of_output = jacobians[[*of.outputs].index(o)]
                np.testing.assert_array_equal(of_output[[*of.inputs].index(i)], block)
        half = function(*(x.float() for x in given))
        self.assertEqual(half.dtype, torch.float32)
        half.sum().backward()
        self.assertEqual(given[0].grad.dtype, torch.float64)

    @needs("torch")
    def test_second_gradients_of_forward_dynamics_and_states_without_an_answer(self):
        import torch

        robot = sarrus.Robot.bundled("torso")
        given = [torch.tensor(x, requires_grad=True) for x in states(robot, 3)]
        forward = sarrus.torch.function(robot, *FD)
        self.assertTrue(torch.autograd.gradgradcheck(forward, given, eps=1e-6, atol=1e-4))
        inverse = sarrus.torch.function(robot, *ID[:2], ["tau_u"])
        (slope,) = torch.autograd.grad(inverse(*given).sum(), given[0], create_graph=True)
        with self.assertRaisesRegex(NotImplementedError, "second derivatives are those of forward"):
            slope.sum().backward()
        wrist, rest = sarrus.Robot.bundled("wrist"), torch.zeros(2)
        far = torch.full((2,), 2.0)
        query = (*ID[:2], ["tau_u"])
        self.assertTrue(sarrus.torch.function(wrist, *query)(far, rest, rest).isnan().all())
        with self.assertRaisesRegex(sarrus.StateError, "unreachable"):
            sarrus.torch.function(wrist, *query, raises=True)(far, rest, rest)

    @needs("torch")
    def test_shooting_swings_the_elbow_up_within_the_limit_of_the_motor(self):
        import torch

        forward = sarrus.torch.function(self.robot, *FD)
        h = DURATION / self.intervals
        knobs = torch.tensor(self.guess / self.limit).atanh().requires_grad_()

        def step(y, yd, a, b):
            """The classical method of Runge and Kutta."""
            slopes, at = [], (y, yd)
            for part, force in ((h / 2, a), (h / 2, (a + b) / 2), (h, (a + b) / 2), (0, b)):
                slopes.append((at[1], forward(*at, force)))
                at = y + part * slopes[-1][0], yd + part * slopes[-1][1]
            first, second, third, last = (torch.stack(slope) for slope in slopes)
            mean = (first + 2 * second + 2 * third + last) / 6
            return y + h * mean[0], yd + h * mean[1]

        def cost():
            optimiser.zero_grad()
            forces = self.limit * knobs.tanh()[:, None]
            y, yd, low = torch.tensor([START]).double(), torch.zeros(1).double(), 0.0
            for k in range(self.intervals):
                y, yd = step(y, yd, forces[k], forces[k + 1])
                low = low + torch.relu(LOWEST + 0.02 - y) ** 2
            total = ((y - TARGET) ** 2 + 0.01 * yd**2 + low).sum()
            total.backward()
            return total

        optimiser = torch.optim.LBFGS([knobs], max_iter=100, line_search_fn="strong_wolfe")
        optimiser.step(cost)
        self.judge(self.limit * knobs.detach().tanh().numpy())


class Crocoddyl(unittest.TestCase):
    @needs("crocoddyl")
    def test_the_example_swings_the_elbow_up_with_exact_derivatives(self):
        import crocoddyl

        example = runpy.run_path(str(EXAMPLE))
        with mock.patch("sys.stdout"), self.assertRaises(SystemExit) as ended:
            example["main"]()
        self.assertFalse(ended.exception.code)
        # its derivatives against those that Crocoddyl takes by differences
        action = example["action_of"](crocoddyl)(example["hanging_elbow"](), far=3.0)
        numerical = crocoddyl.DifferentialActionModelNumDiff(action)
        data, other = action.createData(), numerical.createData()
        for x, u in (([0.2, -0.7], [3.0]), ([-0.7, 0.5], [-4.0])):
            for model, of in ((action, data), (numerical, other)):
                model.calc(of, np.array(x), np.array(u))
                model.calcDiff(of, np.array(x), np.array(u))
            for name in ("Fx", "Fu", "Lx", "Lu"):
                expected = getattr(other, name)
                scale = max(1.0, np.abs(expected).max())
                np.testing.assert_allclose(getattr(data, name), expected, atol=1e-5 * scale)


if __name__ == "__main__":
    unittest.main()
