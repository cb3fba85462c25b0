# A notebook's worth of a torso on two linear actuators: each cell begins with `# %%`.

# %% The robot: a universal joint that two rods of variable length drive (2SPU+1U).
import numpy as np
import sarrus

robot = sarrus.Robot.bundled("torso")
print(robot)
print(*robot.closures, sep="\n")

# %% What the actuators must do for a nod: a cycloid in the pitch joint, 200 states at once.
time = np.linspace(0.0, 1.0, 200)
phase = 2 * np.pi * time
y, yd, ydd = np.zeros((3, len(time), len(robot.independents)))
y[:, 0] = 0.2 * (time - np.sin(phase) / (2 * np.pi))
yd[:, 0] = 0.2 * (1 - np.cos(phase))
ydd[:, 0] = 0.2 * 2 * np.pi * np.sin(phase)
motion = robot.to_actuators(y, yd, ydd)
tau_u = robot.inverse_dynamics(y, yd, ydd)
for name, u, force in zip(robot.actuators, motion.u.T, tau_u.T, strict=True):
    print(f"{name}: {u.min():.4f} to {u.max():.4f} m, {force.min():.1f} to {force.max():.1f} N")

# %% Encoders tell u; where is the robot? The same motion comes back.
back = robot.to_independent(motion.u, motion.ud, motion.udd)
assert np.allclose(back.y, y, atol=1e-9)
assert np.allclose(back.yd, yd, atol=1e-9)

# %% Gains of the joints as the actuators must have them, at the end of the nod.
gains = robot.to_actuators(y[-1], stiffness=[200.0, 200.0], damping=[5.0, 5.0])
print(np.round(gains.stiffness), np.round(gains.damping), sep="\n")

# %% How far from singular poses? A map over the joints' ranges, states without an answer left out.
a, b = np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-0.5, 0.5, 41))
grid = np.stack([a.ravel(), b.ravel()], axis=-1)
answer = robot.query("kinematics", ["y"], ["sigma_min"])(y=grid)
reached = answer.status == sarrus.Status.ok
print(f"{reached.mean():.0%} reached, clearance from {answer.sigma_min[reached].min():.3f}")

# %% Under its weight, held by springs and dampers at the actuators: a second in time.
hold = sarrus.Gains("u", stiffness=[1e5, 1e5], damping=[1e3, 1e3], target=motion.u[0])
run = robot.simulate(1.0, [0.05, 0.0], inputs=[hold], every=0.01)
print(f"{run.end}: {robot.independents[0]} {run.y[0, 0]:.3f} → {run.y[-1, 0]:.3f} rad")
assert abs(run.y[-1, 0]) < abs(run.y[0, 0])
