"""Vectors of the SDF files in this folder, by Drake alone: `python generate.py`.

Drake reads the files without the joints that close loops; the rows of these are its Jacobians of
the two links, in the axes of the joint at the parent. Coordinates are those of sarrus: zero in the
file's pose, quaternions x y z w, the velocity of a free joint in the link. States are closed by
Newton's method on Drake's poses.
"""

import json
import pathlib
import xml.etree.ElementTree as xml

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces

HERE = pathlib.Path(__file__).parent
# joints that close loops, and the link that floats
MODELS = {
    "rules": ([], None),
    "old": ([], "trunk"),
    "loops": (["pin", "rod_ball", "stroke"], None),
}
NAMES = {"gimbal": ["gimbal/r1", "gimbal/r2"], "rod_cross": ["rod_cross/r1", "rod_cross/r2"]}
FREE_Q = [f"floating_base/{of}" for of in "x y z qx qy qz qw".split()]
FREE_V = [f"floating_base/{of}" for of in "rx ry rz tx ty tz".split()]


def numbers(element, default):
    text = element.text if element is not None else default
    return np.array([float(x) for x in text.split()])


def pose(x):
    return RigidTransform(RollPitchYaw(x[3:]), x[:3])


class Model:
    def __init__(self, name):
        cuts, self.floating = MODELS[name]
        root = xml.parse(HERE / f"{name}.sdf").getroot()
        model = next(of for of in root.iter("model") if of.get("name") == name)
        closing = [of for of in model.findall("joint") if of.get("name") in cuts]
        for joint in closing:
            model.remove(joint)
        alone = xml.Element("sdf", version=root.get("version"))
        alone.append(model)
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModelsFromString(xml.tostring(alone, "unicode"), "sdf")
        self.plant.mutable_gravity_field().set_gravity_vector([0, 0, -9.81])
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.start = np.array(self.plant.GetPositions(self.context))
        # our coordinates: name, index in Drake's positions and velocities
        self.joints = []
        for j in self.plant.GetJointIndices():
            joint = self.plant.get_joint(j)
            if joint.type_name() == "quaternion_floating":
                continue
            scope = "hand::" if joint.name() == "grip" else ""
            for k, of in enumerate(NAMES.get(joint.name(), [joint.name()])):
                if joint.num_positions():
                    i = joint.position_start() + k
                    self.joints.append((scope + of, i, joint.velocity_start() + k))
        self.loops = [self.loop(joint) for joint in closing]
        self.q_names = (FREE_Q if self.floating else []) + [of for of, _, _ in self.joints]
        self.v_names = (FREE_V if self.floating else []) + [of for of, _, _ in self.joints]

    def loop(self, joint):
        parent, child = (self.plant.GetBodyByName(joint.find(of).text) for of in ("parent", "child"))
        given = joint.find("pose")
        frame = child if given is None or not given.get("relative_to") else None
        frame = frame or self.plant.GetBodyByName(given.get("relative_to"))
        at = frame.EvalPoseInWorld(self.context) @ pose(numbers(given, "0 0 0 0 0 0"))
        ends = [of.EvalPoseInWorld(self.context).inverse() @ at for of in (parent, child)]
        axis = numbers(joint.find("axis/xyz"), "0 0 1")
        across = np.linalg.svd(axis.reshape(1, 3))[2][1:]
        held = {
            "ball": (np.eye(3), np.zeros((0, 3))),
            "revolute": (np.eye(3), across),
            "prismatic": (across, np.eye(3)),
        }[joint.get("type")]
        return parent.body_frame(), child.body_frame(), ends, held

    def rows(self):
        """Residual, K and K̇q̇; the answers hold −K̇q̇."""
        plant, context, wrt = self.plant, self.context, JacobianWrtVariable.kV
        n = plant.num_velocities()
        residual, K, bias = [np.zeros(0)], [np.zeros((0, n))], [np.zeros(0)]
        for parent, child, (first, second), (linear, angular) in self.loops:
            R, point = first.rotation().matrix(), second.translation()
            J = plant.CalcJacobianSpatialVelocity(context, wrt, child, point, parent, parent)
            b = plant.CalcBiasSpatialAcceleration(context, wrt, child, point, parent, parent)
            gap = first.inverse() @ child.CalcPose(context, parent) @ second
            D = gap.rotation().matrix()
            turn = np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]]) / 2
            residual += [linear @ gap.translation(), angular @ turn]
            K += [linear @ R.T @ J[3:], angular @ R.T @ J[:3]]
            bias += [linear @ R.T @ b.translational(), angular @ R.T @ b.rotational()]
        return np.concatenate(residual), np.vstack(K), np.concatenate(bias)

    def state(self, seed):
        rng = np.random.default_rng(seed)
        plant, context = self.plant, self.context
        at = self.start.copy()
        n = plant.num_velocities()
        S, rate = np.zeros((n, n)), np.zeros(n)
        v = rng.uniform(-1, 1, n)
        first = 6 if self.floating else 0
        for _, i, _ in self.joints:
            at[i] = rng.uniform(-0.15, 0.15) if self.loops else rng.uniform(-0.7, 0.7)
        if self.floating:
            # the pose in the file, then ours
            turn = rng.normal(size=4)
            x = np.concatenate([rng.uniform(-1, 1, 3), turn / np.linalg.norm(turn)])
            i = self.plant.GetBodyByName(self.floating).floating_positions_start()
            start = RigidTransform(Quaternion(self.start[i : i + 4]), self.start[i + 4 : i + 7])
            own = start @ RigidTransform(Quaternion(x[[6, 3, 4, 5]]), x[:3])
            turn = own.rotation().ToQuaternion().wxyz()
            at[i : i + 7] = np.concatenate([turn, own.translation()])
            j = self.plant.GetBodyByName(self.floating).floating_velocities_start_in_v()
            R = own.rotation().matrix()
            S[j : j + 3, :3] = S[j + 3 : j + 6, 3:6] = R
            rate[j + 3 : j + 6] = R @ np.cross(v[:3], v[3:6])
        for k, (_, _, j) in enumerate(self.joints):
            S[j, first + k] = 1
        for _ in range(50):
            plant.SetPositions(context, at)
            residual, K, _ = self.rows()
            if not self.loops:
                break
            step = -np.linalg.pinv(K, rcond=1e-9) @ residual
            for _, i, j in self.joints:
                at[i] += step[j]
        assert not len(residual) or np.abs(residual).max() < 1e-14, residual
        _, K, _ = self.rows()
        w = S @ v
        if self.loops:
            w -= np.linalg.pinv(K, rcond=1e-9) @ (K @ w)
            v = np.linalg.solve(S, w)
        plant.SetVelocities(context, w)
        _, K, bias = self.rows()
        M = plant.CalcMassMatrix(context)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        h = S.T @ plant.CalcInverseDynamics(context, rate, forces)
        q = np.concatenate([x, [at[i] for _, i, _ in self.joints]]) if self.floating else [
            at[i] for _, i, _ in self.joints
        ]
        return {
            "q": dict(zip(self.q_names, map(float, q))),
            "v": dict(zip(self.v_names, map(float, v))),
            "M": (S.T @ M @ S).tolist(),
            "h": h.tolist(),
            "K": (K @ S).tolist(),
            "k_bias": (-(bias + K @ rate)).tolist(),
        }


if __name__ == "__main__":
    for name in MODELS:
        model = Model(name)
        states = [model.state(seed) for seed in range(3)]
        (HERE / f"{name}.json").write_text(
            json.dumps({"tree": model.v_names, "states": states}, indent=1) + "\n"
        )
