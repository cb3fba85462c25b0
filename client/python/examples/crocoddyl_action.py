"""Swing up a lambda elbow by Crocoddyl, with forward dynamics and derivatives of sarrus.

`Elbow` is a differential action: calc gives ÿ = FD(y, ẏ, τ_u) and a cost, calcDiff the fields
`dydd_dy`, `dydd_dyd` and `dydd_dtau_u` of one query. The elbow hangs down, and its motor gives a
fifth of the force that would hold it at the target. Needs `pip install crocoddyl`.
"""

import importlib.util
import sys

import numpy as np
import sarrus

DURATION, INTERVALS = 2.5, 100
TARGET = np.array([0.85, 0.0])  # y [rad], ẏ [rad/s]
LOWEST, LIMIT = -0.6, 5.0  # of y [rad], of the motor [N]


def hanging_elbow():
    """The elbow turned with its base, so that it hangs down at y = 0."""
    down = np.pi - 0.727
    gravity = 9.81 * np.array([0.0, np.sin(down), -np.cos(down)])
    return sarrus.Robot.bundled("lambda", gravity=gravity)


def action_of(crocoddyl):
    """Give the class of the action, which is one of Crocoddyl's."""

    class Elbow(crocoddyl.DifferentialActionModelAbstract):
        """Forward dynamics with the cost ½ (effort |τ_u|² + far |x − target|² + low |…|²)."""

        def __init__(self, robot, effort=1.0, far=0.0, low=1e3):
            n, n_u = len(robot.independents), len(robot.actuators)
            super().__init__(crocoddyl.StateVector(2 * n), n_u, 1)
            self.n, self.effort, self.far, self.low = n, effort, far, low
            given = ["y", "yd", "tau_u"]
            self.forward = robot.query("forward-dynamics", given, ["ydd"])
            slopes = ["dydd_dy", "dydd_dyd", "dydd_dtau_u"]
            self.slopes = robot.query("forward-dynamics", given, slopes)
            self.u_lb, self.u_ub = np.full(n_u, -LIMIT), np.full(n_u, LIMIT)

        def parts(self, x, u):
            u = np.zeros(self.nu) if u is None else u
            below = np.minimum(x - np.repeat([LOWEST, -np.inf], self.n), 0.0)
            return u, x - TARGET, below

        def calc(self, data, x, u=None):
            u, far, below = self.parts(x, u)
            # a state without an answer is NaN, and Crocoddyl shortens its step
            data.xout = self.forward.ask([x[: self.n], x[self.n :], u], return_status=True).ydd
            data.cost = 0.5 * (
                self.effort * u @ u + self.far * far @ far + self.low * below @ below
            )

        def calcDiff(self, data, x, u=None):
            u, far, below = self.parts(x, u)
            found = self.slopes.ask([x[: self.n], x[self.n :], u], return_status=True)
            data.Fx = np.hstack([found.dydd_dy, found.dydd_dyd])
            data.Fu = found.dydd_dtau_u
            data.Lx = self.far * far + self.low * below
            data.Lxx = self.far * np.eye(2 * self.n) + self.low * np.diag((below < 0.0) * 1.0)
            data.Lu, data.Luu = self.effort * u, self.effort * np.eye(self.nu)

    return Elbow


def main():
    if importlib.util.find_spec("crocoddyl") is None:
        print("crocoddyl is absent: not run")
        return
    import crocoddyl

    robot, step = hanging_elbow(), DURATION / INTERVALS
    make = action_of(crocoddyl)

    def step_of(action):
        # the fourth-order method of Runge and Kutta; forces are constant in each interval
        model = crocoddyl.IntegratedActionModelRK(action, crocoddyl.RKType.four, step)
        model.u_lb, model.u_ub = action.u_lb, action.u_ub
        return model

    running = step_of(make(robot, effort=1.0 / LIMIT**2))
    end = crocoddyl.IntegratedActionModelEuler(make(robot, effort=0.0, far=1e5), 0.0)
    problem = crocoddyl.ShootingProblem(np.zeros(2), [running] * INTERVALS, end)
    solver = crocoddyl.SolverBoxFDDP(problem)
    times = step * np.arange(INTERVALS)
    forces = [np.array([0.5 * LIMIT * np.sin(6.0 * t)]) for t in times]
    solver.solve(problem.rollout(forces), forces, 300)

    # the same forces in the simulation of sarrus
    y, yd, low = np.zeros(1), np.zeros(1), 0.0
    for force in solver.us:
        run = robot.simulate(step, y, yd, tau_u=force)
        y, yd, low = run.y[-1], run.yd[-1], min(low, run.y.min())
    most = max(abs(force[0]) for force in solver.us)
    print(
        f"y {y[0]:.4f} rad, yd {yd[0]:.4f} rad/s after {solver.iter} iterations, "
        f"forces up to {most:.3f} N of {LIMIT} N, lowest y {low:.3f} rad"
    )
    reached = np.allclose([*y, *yd], TARGET, atol=0.02)
    sys.exit(not (reached and most <= LIMIT and low > LOWEST - 0.03))


if __name__ == "__main__":
    main()
