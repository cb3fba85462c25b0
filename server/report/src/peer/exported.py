"""How far the files of `sarrus export` are from the robot, by an engine that reads them.

In: one object of JSON, as `exported.rs` writes it. Out: one object with the engine and the largest
differences, by size. Ends with 3 and the reason where a package is missing.
"""

import faulthandler
import importlib.util
import json
import os
import sys

# ends a program that hangs, with the place
faulthandler.dump_traceback_later(60, exit=True)
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
try:
    import numpy as np
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit(3)


def spread(joints, n):
    """An empty map from our velocities to those of an engine, and its rate times our velocities."""
    return np.zeros((n, sum(joint["nv"] for joint in joints))), np.zeros(n)


class MuJoCo:
    """A file of MJCF; friction and limits are off, as they are here without a request."""

    def __init__(self, given):
        import mujoco

        self.mujoco = mujoco
        self.name = f"MuJoCo {mujoco.__version__}"
        self.why = "a soft constraint gives way by the part 1 - dmax"
        self.joints = given["joints"]
        self.m = mujoco.MjModel.from_xml_path(given["file"])
        flags = mujoco.mjtDisableBit
        self.m.opt.disableflags |= flags.mjDSBL_FRICTIONLOSS | flags.mjDSBL_LIMIT
        self.d = mujoco.MjData(self.m)

    def place(self, q, v):
        """Moves to a state; the map of velocities and its rate times v."""
        m, d, mujoco = self.m, self.d, self.mujoco
        S, rate = spread(self.joints, m.nv)
        d.qpos[:] = m.qpos0
        for joint in self.joints:
            j = m.joint(joint["name"]).id
            at, dof, k = m.jnt_qposadr[j], m.jnt_dofadr[j], joint["v"]
            x = q[joint["q"] : joint["q"] + joint["nq"]]
            if joint["nv"] == 1:
                d.qpos[at] = x[0]
                S[dof, k] = 1
            elif joint["nv"] == 3:
                d.qpos[at : at + 4] = x[[3, 0, 1, 2]]
                S[dof : dof + 3, k : k + 3] = np.eye(3)
            else:
                # the pose of the body in the file, then ours
                start = m.qpos0[at : at + 7]
                p, r, R = np.zeros(3), np.zeros(4), np.zeros(9)
                mujoco.mju_rotVecQuat(p, x[:3], start[3:])
                mujoco.mju_mulQuat(r, start[3:], x[[6, 3, 4, 5]])
                d.qpos[at : at + 7] = np.concatenate([start[:3] + p, r])
                mujoco.mju_quat2Mat(R, r)
                R = R.reshape(3, 3)
                S[dof : dof + 3, k + 3 : k + 6] = R
                S[dof + 3 : dof + 6, k : k + 3] = np.eye(3)
                rate[dof : dof + 3] = R @ np.cross(v[k : k + 3], v[k + 3 : k + 6])
        d.qvel[:] = S @ v
        return S, rate

    def rows(self):
        """K and K̇q̇ of the equalities."""
        m, d, mujoco = self.m, self.d, self.mujoco
        kinds = mujoco.mjtEq
        K, bias = [np.zeros((0, m.nv))], [np.zeros(0)]
        for e in range(m.neq):
            first, second = m.eq_obj1id[e], m.eq_obj2id[e]
            kind = kinds(int(m.eq_type[e]))
            if kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                ends = []
                for site in (first, second):
                    jacobians = [np.zeros((3, m.nv)) for _ in range(4)]
                    body, point = m.site_bodyid[site], d.site_xpos[site]
                    mujoco.mj_jac(m, d, *jacobians[:2], point, body)
                    mujoco.mj_jacDot(m, d, *jacobians[2:], point, body)
                    ends.append(jacobians)
                for part in range(2 if kind == kinds.mjEQ_WELD else 1):
                    K.append(ends[0][part] - ends[1][part])
                    bias.append((ends[0][2 + part] - ends[1][2 + part]) @ d.qvel)
                continue
            row = np.zeros((1, m.nv))
            if kind == kinds.mjEQ_JOINT:
                row[0, m.jnt_dofadr[first]] = 1
                row[0, m.jnt_dofadr[second]] -= m.eq_data[e][1]
            else:
                for w in range(m.tendon_adr[first], m.tendon_adr[first] + m.tendon_num[first]):
                    row[0, m.jnt_dofadr[m.wrap_objid[w]]] += m.wrap_prm[w]
            K.append(row)
            bias.append(np.zeros(1))
        return np.vstack(K), np.concatenate(bias)

    def terms(self, q, v):
        m, d = self.m, self.d
        S, rate = self.place(q, v)
        self.mujoco.mj_forward(m, d)
        M = np.zeros((m.nv, m.nv))
        self.mujoco.mj_fullM(m, d, M)
        h = d.qfrc_bias - d.qfrc_passive + M @ rate
        K, bias = self.rows()
        return S.T @ M @ S, S.T @ h, K @ S, -(bias + K @ rate)

    def accelerations(self, q, v, tau):
        S, rate = self.place(q, v)
        self.d.qfrc_applied[:] = np.linalg.solve(S.T, tau)
        self.mujoco.mj_forward(self.m, self.d)
        return np.linalg.solve(S, self.d.qacc - rate)


class Pinocchio:
    """A URDF with the Python file of the target, or with the YAML file of Gepetto's tools."""

    def __init__(self, given):
        import pinocchio

        self.pin = pinocchio
        self.name = f"Pinocchio {pinocchio.__version__}"
        self.joints = given["joints"]
        if given["file"].endswith(".py"):
            spec = importlib.util.spec_from_file_location("exported", given["file"])
            module = importlib.util.module_from_spec(spec)
            # no cache beside the file
            sys.dont_write_bytecode = True
            spec.loader.exec_module(module)
            self.model, self.constraints = module.load()
            self.settings = module.SETTINGS
            self.passive = lambda q, v: module.passive_forces(self.model, q, v)
            self.couplings = module.couplings(self.model)[0]
        else:
            self.of_yaml(given["file"])
        self.why = f"a proximal term of {self.settings.mu:g}, {self.settings.max_iter} iterations"
        self.data = self.model.createData()

    def of_yaml(self, file):
        """As `completeRobotLoader` of Gepetto's tools reads them."""
        import yaml

        pin = self.pin
        urdf = pin.buildModelFromUrdf(file[: -len(".yaml")] + ".urdf")
        with open(file) as text:
            content = yaml.safe_load(text)
        kinds = dict(zip(content["joint_name"], content["joint_type"]))
        model = pin.Model()
        for j in range(1, urdf.njoints):
            name = urdf.names[j]
            joint = pin.JointModelSpherical() if name in kinds else urdf.joints[j]
            parent = model.getJointId(urdf.names[urdf.parents[j]])
            model.addJoint(parent, joint, urdf.jointPlacements[j], name)
            model.appendBodyToJoint(j, urdf.inertias[j], pin.SE3.Identity())
        for frame in urdf.frames.tolist()[1:]:
            parent = model.getJointId(urdf.names[frame.parentJoint])
            model.addFrame(pin.Frame(frame.name, parent, frame.placement, frame.type), False)
        self.constraints = pin.StdVec_RigidConstraintModel()
        for pair, kind in zip(content["closed_loop"], content["type"]):
            frames = [model.frames[model.getFrameId(name)] for name in pair]
            kind = pin.ContactType.CONTACT_3D if kind == "3d" else pin.ContactType.CONTACT_6D
            ends = [x for frame in frames for x in (frame.parentJoint, frame.placement)]
            self.constraints.append(pin.RigidConstraintModel(kind, model, *ends, pin.LOCAL))
        self.model = model
        self.settings = pin.ProximalSettings(1e-14, 1e-8, 2)
        self.passive = lambda q, v: np.zeros(model.nv)
        self.couplings = np.zeros((0, model.nv))

    def place(self, q, v):
        """Coordinates of Pinocchio, and the map of velocities."""
        S, _ = spread(self.joints, self.model.nv)
        at = np.zeros(self.model.nq)
        for joint in self.joints:
            of = self.model.joints[self.model.getJointId(joint["name"])]
            x, i, k = q[joint["q"] : joint["q"] + joint["nq"]], of.idx_v, joint["v"]
            # a turn without limits has its cosine and sine
            x = np.array([np.cos(x[0]), np.sin(x[0])]) if (of.nq, of.nv) == (2, 1) else x
            at[of.idx_q : of.idx_q + of.nq] = x
            if joint["nv"] == 6:
                S[i : i + 3, k + 3 : k + 6] = S[i + 3 : i + 6, k : k + 3] = np.eye(3)
            else:
                S[i : i + of.nv, k : k + of.nv] = np.eye(of.nv)
        return at, S

    def rows(self):
        """K and K̇q̇ of the cuts, in the axes of the first frame."""
        pin, model, data = self.pin, self.model, self.data
        K, bias = [self.couplings], [np.zeros(len(self.couplings))]
        for constraint in self.constraints:
            ends, turns = [], []
            for j, at in (
                (constraint.joint1_id, constraint.joint1_placement),
                (constraint.joint2_id, constraint.joint2_placement),
            ):
                J = at.toActionMatrixInverse() @ pin.getJointJacobian(model, data, j, pin.LOCAL)
                v = at.actInv(data.v[j])
                a = at.actInv(data.a[j])
                linear = a.linear + np.cross(v.angular, v.linear)
                ends.append((J, np.concatenate([linear, a.angular])))
                turns.append((data.oMi[j] * at).rotation)
            R = np.kron(np.eye(2), turns[0].T @ turns[1])
            n = 3 if constraint.type == pin.ContactType.CONTACT_3D else 6
            K.append((ends[0][0] - R @ ends[1][0])[:n])
            bias.append((ends[0][1] - R @ ends[1][1])[:n])
        return np.vstack(K), np.concatenate(bias)

    def terms(self, q, v):
        pin, model, data = self.pin, self.model, self.data
        q, S = self.place(q, v)
        v = S @ v
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        h = pin.nonLinearEffects(model, data, q, v) - self.passive(q, v)
        pin.computeJointJacobians(model, data, q)
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        K, bias = self.rows()
        return S.T @ M @ S, S.T @ h, K @ S, -bias

    def accelerations(self, q, v, tau):
        # rigid constraints have no couplings
        if len(self.couplings):
            return None
        q, S = self.place(q, v)
        v = S @ v
        datas = self.pin.StdVec_RigidConstraintData()
        datas.extend([constraint.createData() for constraint in self.constraints])
        self.pin.initConstraintDynamics(self.model, self.data, self.constraints, datas)
        tau = np.linalg.solve(S.T, tau) + self.passive(q, v)
        a = self.pin.constraintDynamics(
            self.model, self.data, q, v, tau, self.constraints, datas, self.settings
        )
        return np.linalg.solve(S, a)


class Drake:
    """A file of SDF. Drake reads no joints that close loops: their rows are its Jacobians."""

    def __init__(self, given):
        import xml.etree.ElementTree as xml
        from importlib.metadata import version

        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
        from pydrake.multibody.tree import MultibodyForces

        self.forces = MultibodyForces
        self.name = f"Drake {version('drake')}, loops by its Jacobians"
        self.joints = given["joints"]
        document = xml.parse(given["file"])
        model = document.getroot().find("world/model")
        cuts = given["cuts"]
        self.loops = [joint for joint in model.findall("joint") if joint.get("name") in cuts]
        for joint in self.loops:
            model.remove(joint)
        self.couplings = []
        for joint in model.findall("joint"):
            for mimic in joint.findall("axis/mimic"):
                factor = float(mimic.findtext("multiplier", "1"))
                self.couplings.append((joint.get("name"), mimic.get("joint"), factor))
                joint.find("axis").remove(mimic)
        self.plant = MultibodyPlant(0.0)
        gravity = document.getroot().find("world/gravity").text
        root = xml.Element("sdf", version="1.11")
        root.append(model)
        Parser(self.plant).AddModelsFromString(xml.tostring(root, "unicode"), "sdf")
        self.plant.mutable_gravity_field().set_gravity_vector(
            np.array([float(x) for x in gravity.split()])
        )
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()
        self.start = np.array(self.plant.GetPositions(self.context))
        self.loops = [self.loop(joint) for joint in self.loops]

    def loop(self, joint):
        """Both links of a joint, its frame in them, and the directions that it holds."""
        from pydrake.math import RigidTransform, RollPitchYaw

        parent, child = (
            self.plant.GetFrameByName(joint.find(name).text) for name in ("parent", "child")
        )

        def numbers(path, default):
            return np.array([float(x) for x in joint.findtext(path, default).split()])

        x = numbers("pose", "0 0 0 0 0 0")
        on_child = RigidTransform(RollPitchYaw(x[3:]), x[:3])
        on_parent = child.CalcPose(self.context, parent) @ on_child
        axis = numbers("axis/xyz", "0 0 1")
        across = np.linalg.svd(axis.reshape(1, 3))[2][1:]
        whole, none = np.eye(3), np.zeros((0, 3))
        held = {
            "ball": (whole, none),
            "fixed": (whole, whole),
            "revolute": (whole, across),
            "prismatic": (across, whole),
        }.get(joint.get("type"))
        if held is None:
            raise SystemExit(f"another program reads the loop {joint.get('name')}")
        return parent, child, on_parent.rotation().matrix(), on_child.translation(), held

    def rows(self):
        """K and K̇q̇ of the loops in the axes of the joint in the parent."""
        from pydrake.multibody.tree import JacobianWrtVariable

        plant, context, v = self.plant, self.context, JacobianWrtVariable.kV
        K, bias = [np.zeros((0, plant.num_velocities()))], [np.zeros(0)]
        for parent, child, R, point, (linear, angular) in self.loops:
            J = plant.CalcJacobianSpatialVelocity(context, v, child, point, parent, parent)
            b = plant.CalcBiasSpatialAcceleration(context, v, child, point, parent, parent)
            K += [linear @ R.T @ J[3:], angular @ R.T @ J[:3]]
            bias += [linear @ R.T @ b.translational(), angular @ R.T @ b.rotational()]
        for follower, leader, factor in self.couplings:
            row = np.zeros((1, plant.num_velocities()))
            row[0, plant.GetJointByName(follower).velocity_start()] = 1
            row[0, plant.GetJointByName(leader).velocity_start()] -= factor
            K.append(row)
            bias.append(np.zeros(1))
        return np.vstack(K), np.concatenate(bias)

    @staticmethod
    def pose(x):
        """The pose of a quaternion w x y z and a translation."""
        from pydrake.common.eigen_geometry import Quaternion
        from pydrake.math import RigidTransform

        return RigidTransform(Quaternion(x[:4] / np.linalg.norm(x[:4])), x[4:])

    def terms(self, q, v):
        plant, context = self.plant, self.context
        S, rate = spread(self.joints, plant.num_velocities())
        at = self.start.copy()
        for joint in self.joints:
            x, k = q[joint["q"] : joint["q"] + joint["nq"]], joint["v"]
            if joint["nv"] == 3:
                raise SystemExit("ball joints have other coordinates in Drake")
            if joint["nv"] == 1:
                of = plant.GetJointByName(joint["name"])
                at[of.position_start()] = x[0]
                S[of.velocity_start(), k] = 1
                continue
            # the pose of the body in the file, then ours
            body = plant.GetBodyByName(joint["link"])
            i, j = body.floating_positions_start(), body.floating_velocities_start_in_v()
            start = self.pose(self.start[i : i + 7])
            pose = start @ self.pose(np.concatenate([x[[6, 3, 4, 5]], x[:3]]))
            turn = pose.rotation().ToQuaternion().wxyz()
            at[i : i + 7] = np.concatenate([turn, pose.translation()])
            R = pose.rotation().matrix()
            S[j : j + 3, k : k + 3] = S[j + 3 : j + 6, k + 3 : k + 6] = R
            rate[j + 3 : j + 6] = R @ np.cross(v[k : k + 3], v[k + 3 : k + 6])
        plant.SetPositions(context, at)
        plant.SetVelocities(context, S @ v)
        M = plant.CalcMassMatrix(context)
        forces = self.forces(plant)
        plant.CalcForceElementsContribution(context, forces)
        h = plant.CalcInverseDynamics(context, rate, forces)
        K, bias = self.rows()
        return S.T @ M @ S, S.T @ h, K @ S, -(bias + K @ rate)

    def accelerations(self, q, v, tau):
        return None


def size(x):
    return float(np.abs(x).max()) if np.size(x) else 0.0


def outside(K, k, rows, numbers):
    """How far rows with their numbers are from combinations of K with k, by the size of K."""
    worst = 0.0
    scale = size(K)
    for row, number in zip(rows, numbers):
        c = np.linalg.lstsq(K.T, row, rcond=1e-10)[0]
        worst = max(worst, size(K.T @ c - row) / scale, abs(c @ k - number) / max(size(k), scale))
    return worst


def solved(M, h, K, k, tau):
    """q̈ of M q̈ + h = τ + Kᵀ λ, K q̈ = k."""
    particular = np.linalg.lstsq(K, k, rcond=1e-10)[0] if len(K) else np.zeros(len(h))
    Z = np.eye(len(h))
    if len(K):
        _, sigma, V = np.linalg.svd(K)
        Z = V[int((sigma > 1e-10 * max(sigma[0], 1e-300)).sum()) :].T
    return particular + Z @ np.linalg.solve(Z.T @ M @ Z, Z.T @ (tau - h - M @ particular))


def main():
    given = json.load(sys.stdin)
    try:
        engine = {"MuJoCo": MuJoCo, "Pinocchio": Pinocchio, "Drake": Drake}[given["engine"]](given)
    except ImportError as error:
        print(error, file=sys.stderr)
        sys.exit(3)
    worst = {}

    def note(quantity, difference):
        worst[quantity] = max(worst.get(quantity, 0.0), difference)

    for state in given["states"]:
        q, v, tau = (np.array(state[key], dtype=float) for key in ("q", "qd", "tau"))
        n = len(v)
        M, h = np.array(state["M"]).reshape(n, n), np.array(state["h"])
        K, k = np.array(state["K"]).reshape(-1, n), np.array(state["k"])
        their_M, their_h, their_K, their_k = engine.terms(q, v)
        note("M", size(their_M - M) / size(M))
        note("forces", size(their_h - h) / max(size(h), 1e-9))
        if len(K) or len(their_K):
            note("loops", outside(their_K, their_k, K, k))
            note("loops", outside(K, k, their_K, their_k))
        a = engine.accelerations(q, v, tau)
        if a is not None:
            exact = solved(M, h, K, k, tau)
            note("accelerations", size(a - exact) / max(size(exact), 1e-9))
    rows = [{"quantity": name, "difference": x} for name, x in worst.items()]
    why = engine.why if "accelerations" in worst else ""
    print(json.dumps({"engine": engine.name, "why": why, "rows": rows}))


main()
