"""Vectors of the MJCF models in this folder, by MuJoCo alone: `python generate.py`.

Each state is closed by Newton's method on MuJoCo's own residuals. Coordinates are those of sarrus:
zero in the file's pose, quaternions x y z w, the velocity of a free joint in the body. Rows of K
are in the axes of body1; forces contain springs, dampers and gravity. A free joint that a loop
holds in part is three slides, along the axes of its body in the file's pose, and a ball.
"""

import json
import pathlib

import mujoco
import numpy as np

HERE = pathlib.Path(__file__).parent
# independent joints, idle velocities, and joints of tendons with their coefficients
MODELS = {
    "ankle": ("motor_1 motor_2", [], {}),
    "gripper": (
        "right_spring_link_joint left_spring_link_joint split",
        [],
        {"split": {"right_driver_joint": 0.5, "left_driver_joint": 0.5}},
    ),
    "leg": (
        "root hip_roll hip_pitch knee tarsus heel_spring foot_crank",
        ["achilles/rz"],
        {},
    ),
    "rules": (
        "a b c d e f g h spin-0 spin-1 spin-2 i",
        [],
        {"pull": {"a": 0.5, "c": -2.0}},
    ),
    "tied": ("a d crank arm", [], {}),
    "knee": ("hip knee", [], {}),
    "tendons": (
        "wrist a b d",
        [],
        {"finger": {"a": 0.5, "b": 0.3, "f": 0.2}, "thumb": {"c": 1.0, "d": -0.4}},
    ),
    "attached": (
        "root r/roll l/front l/back l/end.left hip r/front r/back r/end.left turn "
        "spare.left-0 spare.left-1",
        [],
        {f"{leg}/sum": {f"{leg}/front": 1.0, f"{leg}/back": 0.5} for leg in "lr"},
    ),
    "geared": ("craft reel", [], {}),
    "held": (
        "root hip knee swing lift",
        [],
        {"sinew": {"lift": 1.5}, "across": {"knee": 0.5, "swing": -1.0}},
    ),
}
# free joints that a loop holds in part
HELD = ["root"]
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
AMPLITUDES = [0.0, 0.05, 0.12]


class Model:
    def __init__(self, name):
        self.m = mujoco.MjModel.from_xml_path(str(HERE / f"{name}.xml"))
        self.d = mujoco.MjData(self.m)
        self.independent, self.idle, self.tendons = MODELS[name]
        self.independent = self.independent.split()
        self.held = HELD if name == "held" else []
        self.names = []
        for j in range(self.m.njnt):
            own = self.m.joint(j).name
            parts = {FREE: "tx ty tz rx ry rz", BALL: "rx ry rz"}.get(self.m.jnt_type[j])
            self.names += [f"{own}/{part}" for part in parts.split()] if parts else [own]
        # MuJoCo's columns of the tree, then those of tendons
        self.nv = self.m.nv
        self.locked = set()

    def rows(self):
        """Residual, K and K̇q̇ of the equalities, from the motion of points."""
        m, d = self.m, self.d
        residual, K, bias = [], [], []
        v = d.qvel
        for e in range(m.neq):
            if not m.eq_active0[e]:
                continue
            kind, data = mujoco.mjtEq(int(m.eq_type[e])), m.eq_data[e]
            if kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
                is_weld = kind == mujoco.mjtEq.mjEQ_WELD
                if m.eq_objtype[e] == mujoco.mjtObj.mjOBJ_SITE:
                    sites = [m.eq_obj1id[e], m.eq_obj2id[e]]
                    bodies = [m.site_bodyid[s] for s in sites]
                    local = [m.site_pos[s] for s in sites]
                else:
                    bodies = [m.eq_obj1id[e], m.eq_obj2id[e]]
                    local = [data[3:6], data[0:3]] if is_weld else [data[0:3], data[3:6]]
                R = d.xmat[bodies[0]].reshape(3, 3)
                frame = R
                if is_weld:
                    turn = np.zeros(9)
                    mujoco.mju_quat2Mat(turn, data[6:10])
                    frame = R @ turn.reshape(3, 3)
                points, J, dJ = [], [], []
                for body, at in zip(bodies, local):
                    point = d.xpos[body] + d.xmat[body].reshape(3, 3) @ at
                    jp, jr, dp, dr = (np.zeros((3, m.nv)) for _ in range(4))
                    mujoco.mj_jac(m, d, jp, jr, point, body)
                    mujoco.mj_jacDot(m, d, dp, dr, point, body)
                    points.append(point)
                    J.append((jp, jr))
                    dJ.append((dp, dr))
                residual += list(frame.T @ (points[0] - points[1]))
                K += list(frame.T @ (J[0][0] - J[1][0]))
                # the frame turns, but the difference and its rate vanish where the loop is closed
                bias += list(frame.T @ ((dJ[0][0] - dJ[1][0]) @ v))
                if is_weld:
                    other = d.xmat[bodies[1]].reshape(3, 3)
                    D = frame.T @ other
                    residual += [(D[1, 2] - D[2, 1]) / 2, (D[2, 0] - D[0, 2]) / 2,
                                 (D[0, 1] - D[1, 0]) / 2]
                    K += list(frame.T @ (J[0][1] - J[1][1]))
                    bias += list(frame.T @ ((dJ[0][1] - dJ[1][1]) @ v))
            else:
                first, second = m.eq_obj1id[e], m.eq_obj2id[e]
                if kind == mujoco.mjtEq.mjEQ_JOINT:
                    def side(j):
                        row = np.zeros(m.nv)
                        row[m.jnt_dofadr[j]] = 1
                        at = m.jnt_qposadr[j]
                        return d.qpos[at] - m.qpos0[at], row
                else:
                    def side(t):
                        row = np.zeros(m.nv)
                        for w in range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t]):
                            row[m.jnt_dofadr[m.wrap_objid[w]]] += m.wrap_prm[w]
                        return d.ten_length[t] - m.tendon_length0[t], row
                x, row = side(first)
                y, other = side(second) if second >= 0 else (0.0, 0 * row)
                poly = np.polynomial.Polynomial(data[:5])
                residual.append(x - poly(y))
                K.append(row - poly.deriv()(y) * other)
                bias.append(-poly.deriv(2)(y) * (other @ v) ** 2)
        return np.array(residual), np.array(K).reshape(-1, m.nv), np.array(bias)

    def free_columns(self):
        """Columns of the independent velocities in MuJoCo's order; tendons are solved for."""
        m = self.m
        columns = []
        for name in self.independent:
            if name in self.tendons:
                columns.append([(m.joint(j).dofadr[0], c) for j, c in self.tendons[name].items()])
                continue
            j = m.joint(name).id
            n = {FREE: 6, BALL: 3}.get(int(m.jnt_type[j]), 1)
            first = 3 if name in self.held else 0
            columns += [[(m.jnt_dofadr[j] + k, 1.0)] for k in range(first, n)]
        columns += [[(self.names.index(name), 1.0)] for name in self.idle]
        A = np.zeros((len(columns), m.nv))
        for k, column in enumerate(columns):
            for at, c in column:
                A[k, at] = c
        return A

    def close(self, y):
        """The closed pose whose independents are displaced by y from the file's pose."""
        m, d = self.m, self.d
        A = self.free_columns()
        d.qpos[:] = m.qpos0
        step = np.linalg.lstsq(A, y, rcond=None)[0]
        done = np.zeros(m.nv)
        mujoco.mj_integratePos(m, d.qpos, step, 1.0)
        done += step
        for _ in range(50):
            mujoco.mj_kinematics(m, d)
            mujoco.mj_comPos(m, d)
            mujoco.mj_tendon(m, d)
            residual, K, _ = self.rows()
            full = np.vstack([A, K])
            error = np.concatenate([0 * y, -residual])
            step = np.linalg.lstsq(full, error, rcond=1e-12)[0]
            mujoco.mj_integratePos(m, d.qpos, step, 1.0)
        mujoco.mj_forward(m, d)
        residual, _, _ = self.rows()
        assert not residual.size or abs(residual).max() < 1e-14, residual
        # couplings of joints have the rows that MuJoCo makes of them
        _, K, _ = self.rows()
        for e in range(m.neq) if (m.eq_type == mujoco.mjtEq.mjEQ_JOINT).all() else []:
            assert np.allclose(d.efc_J.reshape(-1, m.nv)[e], K[e], rtol=0, atol=1e-14)


def unit(q):
    return q / np.linalg.norm(q)


def conjugate(q):
    return q * [1, -1, -1, -1]


def times(a, b):
    out = np.zeros(4)
    mujoco.mju_mulQuat(out, a, b)
    return out


def turned(q, v):
    out = np.zeros(3)
    mujoco.mju_rotVecQuat(out, v, q)
    return out


def coordinates(model):
    """q of sarrus, and the map from MuJoCo's velocities to those of sarrus."""
    m, d = model.m, model.d
    q, S, names = [], [], []
    for j in range(m.njnt):
        at, dof = m.jnt_qposadr[j], m.jnt_dofadr[j]
        own = m.joint(j).name
        if m.jnt_type[j] == FREE:
            p0, r0 = m.qpos0[at : at + 3], unit(m.qpos0[at + 3 : at + 7])
            r = unit(d.qpos[at + 3 : at + 7])
            p = turned(conjugate(r0), d.qpos[at : at + 3] - p0)
            w, x, y, z = times(conjugate(r0), r)
            q += zip([f"{own}/{part}" for part in "x y z qx qy qz qw".split()], [*p, x, y, z, w])
            is_held = own in model.held
            R = np.zeros(9)
            mujoco.mju_quat2Mat(R, r0 if is_held else r)
            block = np.zeros((6, m.nv))
            block[0:3, dof + 3 : dof + 6] = np.eye(3)
            block[3:6, dof : dof + 3] = R.reshape(3, 3).T
            S += list(block)
            parts = "rx ry rz x y z" if is_held else "rx ry rz tx ty tz"
            names += [f"{own}/{part}" for part in parts.split()]
        elif m.jnt_type[j] == BALL:
            w, x, y, z = unit(d.qpos[at : at + 4])
            q += zip([f"{own}/{part}" for part in "qx qy qz qw".split()], [x, y, z, w])
            S += list(np.eye(m.nv)[dof : dof + 3])
            names += [f"{own}/{part}" for part in "rx ry rz".split()]
        else:
            q.append((own, d.qpos[at] - m.qpos0[at]))
            S.append(np.eye(m.nv)[dof])
            names.append(own)
    return dict(q), np.array(S), names


def state(name, k, rng):
    model = Model(name)
    m, d = model.m, model.d
    A = model.free_columns()
    n_y = len(A) - len(model.idle)
    d.qvel[:] = 0
    y = np.concatenate([AMPLITUDES[k] * rng.uniform(-1, 1, n_y), np.zeros(len(model.idle))])
    model.close(y)
    q, S, names = coordinates(model)
    yd = np.concatenate([rng.uniform(-1, 1, n_y), np.zeros(len(model.idle))])
    ydd = np.concatenate([rng.uniform(-1, 1, n_y), np.zeros(len(model.idle))])
    # independents of sarrus: a free joint's velocity is in the body
    inverse = np.linalg.inv(S)
    B = A @ inverse
    free = [
        j
        for j in range(m.njnt)
        if m.jnt_type[j] == FREE and m.joint(j).name not in model.held
    ]
    for j in (j for j in free if m.joint(j).name in model.independent):
        dof = m.jnt_dofadr[j]
        row = next(i for i in range(len(A)) if A[i, dof] == 1.0)
        B[row : row + 6] = np.eye(m.nv)[names.index(m.joint(j).name + "/rx") :][:6]
    _, K, _ = model.rows()
    K = K @ inverse
    full = np.vstack([B, K])
    qd = np.linalg.lstsq(full, np.concatenate([yd, np.zeros(len(K))]), rcond=1e-12)[0]
    d.qvel[:] = inverse @ qd
    mujoco.mj_forward(m, d)
    _, _, bias = model.rows()
    # the velocity of a free joint in the body: v_body = Rᵀ v, so that d(S)/dt v is −ω × v
    Sd = np.zeros(m.nv)
    for j in free:
        r = names.index(m.joint(j).name + "/rx")
        Sd[r + 3 : r + 6] = -np.cross(qd[r : r + 3], qd[r + 3 : r + 6])
    # K (S v): K̇q̇ in these coordinates has the part of Sd
    k_bias = -(bias - K @ Sd)
    qdd = np.linalg.lstsq(full, np.concatenate([ydd, k_bias]), rcond=1e-12)[0]
    units = np.vstack([np.eye(len(B)), np.zeros((len(K), len(B)))])
    G = np.linalg.lstsq(full, units, rcond=1e-12)[0]
    G = G[:, :n_y]
    d.qacc[:] = inverse @ (qdd - Sd)
    M = np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, d, M) if mujoco.__version__ >= "4" else mujoco.mj_fullM(m, M, d.qM)
    tau = M @ d.qacc + d.qfrc_bias - d.qfrc_passive
    tau_q = inverse.T @ tau
    M = inverse.T @ M @ inverse
    return {
        "yd": list(yd[:n_y]),
        "ydd": list(ydd[:n_y]),
        "q": q,
        "qd": list(qd),
        "qdd": list(qdd),
        "K": [list(row) for row in K],
        "k_bias": list(k_bias),
        "tau_q": list(tau_q),
        "tau_y": list(G.T @ tau_q),
        "M_y": [list(row) for row in G.T @ M @ G],
    }, names


def main():
    for name, (independent, _, tendons) in MODELS.items():
        rng = np.random.default_rng(7)
        states = []
        for k in range(len(AMPLITUDES)):
            found, names = state(name, k, rng)
            states.append(found)
        vectors = {
            "engine": f"MuJoCo {mujoco.__version__}, numpy {np.__version__}",
            "tree": names,
            "independent": independent.split(),
            "tendons": tendons,
            "states": states,
        }
        text = json.dumps(vectors, indent=None, separators=(",", ":"))
        (HERE / f"{name}.json").write_text(text.replace('{"yd"', '\n{"yd"') + "\n")


main()
