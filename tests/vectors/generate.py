"""Reference answers for a robot whose loops are points, pins and hinges, to forty digits.

Nothing but the positions of bodies is written here: K, Jacobians, velocities and accelerations are central differences of them in
arithmetic of 120 digits with steps of 1e-30, so that no formula is shared with what they check.

    pip install mpmath pyyaml numpy gmpy2
    python generate.py ../../models/robots/NAME .    # writes NAME.json (10 states, double) and NAME_mp.json (4 states, forty digits)
"""

import json
import random
import sys
import xml.etree.ElementTree as xml

import numpy
import yaml
from mpmath import matrix, mp, mpf, eye, zeros, lu_solve, norm, cos, sin

mp.dps = 120
STEP = mpf(10) ** -30
GRAVITY = matrix([0, 0, mpf(-9.81)])
# inertia of published motors at their joints
ROTORS = {"N5020-16": 3.609725e-3}


def numbers(text):
    # a decimal in a file means the double that it is read as
    return matrix([mpf(float(x)) for x in text.split()])


def skew(v):
    return matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def unskew(m):
    return matrix([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / 2


def turn(axis, angle):
    k = skew(axis)
    return eye(3) + sin(angle) * k + (1 - cos(angle)) * k * k


def placement(node):
    """Rotation and position of an origin element, or of a mapping of lists."""
    read = (lambda key: matrix([mpf(float(x)) for x in node.get(key, [0, 0, 0])])) if isinstance(node, dict) else None
    read = read or (lambda key: numbers(node.get(key, "0 0 0")) if node is not None else zeros(3, 1))
    r, p, y = read("rpy")
    x, yy, z = (matrix([int(i == k) for i in range(3)]) for k in range(3))
    return turn(z, y) * turn(yy, p) * turn(x, r), read("xyz")


def across(axis):
    a = axis / norm(axis)
    k = min(range(3), key=lambda i: abs(a[i]))
    b = matrix([int(i == k) for i in range(3)]) - a[k] * a
    b = b / norm(b)
    return [b, skew(a) * b]


class Robot:
    def __init__(self, folder):
        self.name = folder.rstrip("/").split("/")[-1]
        root = xml.parse(f"{folder}/{self.name}.urdf").getroot()
        file = yaml.safe_load(open(f"{folder}/{self.name}.yml"))
        entries = file["submechanisms"]
        joined = lambda key: sum((entry[key] for entry in entries), [])
        self.tree, self.independent = joined("jointnames_spanningtree"), joined("jointnames_independent")
        self.active = joined("jointnames_active")
        # inertia of the rotors at their joints
        self.rotors = zeros(len(self.tree), 1)
        for motor in file.get("actuators", []):
            for name in motor["joints"]:
                own = [ROTORS[motor["model"]], 1.0] if "model" in motor else [float(motor["rotor_inertia"]), motor["gear_ratio"]]
                self.rotors[self.tree.index(name)] = mpf(own[0]) * mpf(own[1]) ** 2
        joints = {joint.get("name"): joint for joint in root.findall("joint")}
        # joints that turn as another one does, damping, springs with their rests
        followers = {name: joint.find("mimic") for name, joint in joints.items() if joint.find("mimic") is not None}
        assert all(set(mimic.attrib) == {"joint"} for mimic in followers.values())
        self.couplings = [(self.tree.index(name), self.tree.index(mimic.get("joint"))) for name, mimic in followers.items()]
        self.damping, self.springs = zeros(len(self.tree), 1), {}
        for name, joint in joints.items():
            if joint.find("dynamics") is not None:
                self.damping[self.tree.index(name)] = mpf(float(joint.find("dynamics").get("damping")))
        for spring in root.findall("gazebo"):
            terms = [mpf(float(spring.findtext(f"spring{key}", "0"))) for key in ("Stiffness", "Reference")]
            self.springs[self.tree.index(spring.get("reference"))] = terms
        self.joints = []
        for joint in joints.values():
            axis = joint.find("axis")
            axis = numbers(axis.get("xyz")) if axis is not None else matrix([1, 0, 0])
            index = self.tree.index(joint.get("name")) if joint.get("type") != "fixed" else None
            ends = joint.find("parent").get("link"), joint.find("child").get("link")
            self.joints.append((*ends, placement(joint.find("origin")), axis / norm(axis), joint.get("type"), index))
        self.root = ({end[0] for end in self.joints} - {end[1] for end in self.joints}).pop()
        self.bodies = []
        for link in root.findall("link"):
            inertial = link.find("inertial")
            if inertial is not None:
                I = {key: mpf(float(x)) for key, x in inertial.find("inertia").attrib.items()}
                I = matrix([[I["ixx"], I["ixy"], I["ixz"]], [I["ixy"], I["iyy"], I["iyz"]], [I["ixz"], I["iyz"], I["izz"]]])
                frame = placement(inertial.find("origin"))
                self.bodies.append((link.get("name"), mpf(float(inertial.find("mass").get("value"))), frame, I))
        self.loops = []
        for loop in sum((entry.get("loop_constraints", []) for entry in entries), []):
            kind, unit = loop["cut_joint_type"], [matrix([int(i == k) for i in range(3)]) for k in range(3)]
            axis = matrix([mpf(float(x)) for x in loop.get("axis", [0, 0, 0])])
            axes = across(axis) if kind == "planar_revolute" else unit
            # a hinge keeps its axis a perpendicular to b x a, whose rate there is the speed about b
            hinges = [(skew(b) * axis, axis / norm(axis)) for b in across(axis)] if kind == "revolute" else []
            assert kind in ("spherical", "planar_revolute", "revolute"), kind
            ends = loop["predecessor_body"], loop["successor_body"]
            places = (placement(loop[f"{end}_placement"]) for end in ("predecessor", "successor"))
            self.loops.append((loop["cut_joint"], *ends, *places, axes, hinges))
        self.ind = [self.tree.index(name) for name in self.independent]
        self.act = [self.tree.index(name) for name in self.active]
        self.dep = [i for i in range(len(self.tree)) if i not in self.ind]
        self.sort()

    def sort(self):
        """The rows that do not follow from others, and the joints that only spin idly: they stay."""
        # at the zero pose, which is closed: elsewhere rows may count that follow from others there
        K = numpy.array(self.K(zeros(len(self.tree), 1)).tolist(), dtype=float)
        rank = lambda m: numpy.linalg.matrix_rank(m, 1e-9)
        d = K[:, self.dep]
        self.dep = [i for k, i in enumerate(self.dep) if rank(numpy.delete(d, k, 1)) < rank(d)]
        d, self.kept = K[:, self.dep], []
        for _ in range(len(self.dep)):
            # the row that adds most
            basis = numpy.linalg.qr(d[self.kept].T)[0] if self.kept else numpy.zeros((len(self.dep), 0))
            left = d - d @ basis @ basis.T
            self.kept.append(int(numpy.argmax(numpy.linalg.norm(left, axis=1))))
        self.kept.sort()

    def poses(self, q):
        at = {self.root: (eye(3), zeros(3, 1))}
        left = list(self.joints)
        while left:
            joint = next(j for j in left if j[0] in at)
            left.remove(joint)
            parent, child, (R0, p0), axis, kind, index = joint
            R, p = at[parent]
            R, p = R * R0, R * p0 + p
            if index is not None:
                R, p = (R, p + R * axis * q[index]) if kind == "prismatic" else (R * turn(axis, q[index]), p)
            at[child] = R, p
        return at

    def phi(self, q):
        at, rows = self.poses(q), []
        for _, predecessor, successor, (Rp, pp), (Rs, ps), axes, hinges in self.loops:
            (R, p), (R2, p2) = at[predecessor], at[successor]
            gap = (R * Rp).T * (R2 * ps + p2 - R * pp - p)
            rows += [(axis.T * gap)[0] for axis in axes]
            turned = (R * Rp).T * R2 * Rs
            rows += [(held.T * turned * axis)[0] for held, axis in hinges]
        rows += [q[follower] - q[leader] for follower, leader in self.couplings]
        return matrix(rows)

    def masses(self, q):
        """Centre of mass and orientation of every body."""
        at = self.poses(q)
        return [(at[name][0] * p + at[name][1], at[name][0] * R) for name, _, (R, p), _ in self.bodies]

    def square(self, K):
        return rows(pick(K, self.dep), self.kept)

    def K(self, q):
        K = zeros(sum(len(loop[5]) + len(loop[6]) for loop in self.loops) + len(self.couplings), len(q))
        for i in range(len(q)):
            K[:, i] = self.along(self.phi, q, unit(i, len(q)))
        return K

    def along(self, f, q, direction):
        return (f(q + STEP * direction) - f(q - STEP * direction)) / (2 * STEP)

    def close(self, y):
        """The closed pose at y that is reached from zero."""
        q, parts = zeros(len(self.tree), 1), 8
        for part in range(1, parts + 1):
            for i, value in zip(self.ind, y):
                q[i] = mpf(value) * part / parts
            # in one step the last digits come by themselves: K at the start of the step serves for
            # all of them
            inverse = self.square(self.K(q)) ** -1
            for _ in range(200):
                step = inverse * rows(self.phi(q), self.kept)
                for i, value in zip(self.dep, step):
                    q[i] -= value
                if norm(step) < mpf(10) ** -100:
                    break
        return q

    def answer(self, y, yd, ydd, tau):
        y, yd, ydd, tau = (matrix([mpf(x) for x in v]) for v in (y, yd, ydd, tau))
        n, q = len(self.tree), self.close(y)
        K = self.K(q)
        G = zeros(n, len(y))
        for k, i in enumerate(self.ind):
            G[i, k] = 1
        inverse = self.square(K) ** -1
        set_rows(G, self.dep, -inverse * rows(pick(K, self.ind), self.kept))
        qd = G * yd
        second = lambda f: (f(q + STEP * qd) - 2 * f(q) + f(q - STEP * qd)) / STEP**2
        k = second(self.phi)  # +K̇ q̇
        g = zeros(n, 1)
        set_rows(g, self.dep, -inverse * rows(k, self.kept))
        qdd = G * ydd + g

        # M and C of the tree, from the motion of every centre of mass
        M, C = zeros(n), zeros(n, 1)
        here, ahead, behind = self.masses(q), self.masses(q + STEP * qd), self.masses(q - STEP * qd)
        sides = [(self.masses(q + STEP * unit(i, n)), self.masses(q - STEP * unit(i, n))) for i in range(n)]
        for b, (_, mass, _, I) in enumerate(self.bodies):
            p, R = here[b]
            Jv, Jw = zeros(3, n), zeros(3, n)
            for i, (plus, minus) in enumerate(sides):
                Jv[:, i] = (plus[b][0] - minus[b][0]) / (2 * STEP)
                Jw[:, i] = unskew((plus[b][1] - minus[b][1]) / (2 * STEP) * R.T)
            Rd = (ahead[b][1] - behind[b][1]) / (2 * STEP)
            Rdd = (ahead[b][1] - 2 * R + behind[b][1]) / STEP**2
            w, alpha = unskew(Rd * R.T), unskew(Rdd * R.T + Rd * Rd.T)
            a = (ahead[b][0] - 2 * p + behind[b][0]) / STEP**2 - GRAVITY
            Iw = R * I * R.T
            M += mass * Jv.T * Jv + Jw.T * Iw * Jw
            C += mass * Jv.T * a + Jw.T * (Iw * alpha + skew(w) * (Iw * w))

        for i in range(n):
            M[i, i] += self.rotors[i]
            C[i] += self.damping[i] * qd[i]
        for i, (stiffness, rest) in self.springs.items():
            C[i] += stiffness * (q[i] - rest)
        M_y, C_y, G_u = G.T * M * G, G.T * (C + M * g), rows(G, self.act)
        tree = M * qdd + C
        tau_y = G.T * tree
        # of fewer actuators the least squares
        tau_u = lu_solve(G_u * G_u.T, G_u * tau_y)
        forces = lambda qdd, driven: inverse_t * rows(M * qdd + C - driven, self.dep)
        inverse_t = inverse.T
        driven = lambda force: matrix([force[self.act.index(i)] if i in self.act else 0 for i in range(n)])
        ydd_fd = lu_solve(M_y, G_u.T * tau - C_y)
        qdd_fd = G * ydd_fd + g
        cond = lambda m: float(numpy.linalg.cond(numpy.array(m.tolist(), dtype=float)))
        found = {
            "q": q, "qd": qd, "qdd": qdd, "G": G, "g": g, "K": K, "k": k, "tau_tree": tree, "tau_y": tau_y, "tau_u": tau_u,
            "lambda_id": forces(qdd, driven(tau_u)), "ydd_fd": ydd_fd, "qdd_fd": qdd_fd, "lambda_fd": forces(qdd_fd, driven(tau)),
            "M_y": M_y, "C_y": C_y, "cond_Kd": cond(pick(K, self.dep)), "cond_Gu": cond(G_u), "cond_My": cond(M_y),
        }  # fmt: skip
        # reactions of redundant rows are not determinate
        return found if len(self.kept) == K.rows else {key: x for key, x in found.items() if key not in ("lambda_id", "lambda_fd", "cond_Kd")}


def unit(i, n):
    return matrix([int(i == k) for k in range(n)])


def pick(m, columns):
    return matrix([[m[r, c] for c in columns] for r in range(m.rows)])


def rows(m, which):
    return matrix([[m[r, c] for c in range(m.cols)] for r in which])


def set_rows(m, which, values):
    for r, row in enumerate(which):
        for c in range(m.cols):
            m[row, c] = values[r, c]


def written(value, as_text):
    if isinstance(value, float):
        return value
    one = (lambda x: mp.nstr(x, 40, min_fixed=-5, max_fixed=45)) if as_text else float
    if value.cols == 1:
        return [one(x) for x in value]
    return [[one(value[r, c]) for c in range(value.cols)] for r in range(value.rows)]


def main(folder, out):
    robot = Robot(folder)
    seed = random.Random(sum(map(ord, robot.name)))
    p, u = len(robot.ind), len(robot.act)
    draw = lambda n, reach: [seed.uniform(-reach, reach) for _ in range(n)]
    head = {"name": robot.name, "tree": robot.tree, "ind": robot.independent, "act": robot.active}
    double, exact = [], []
    for k in range(10):
        given = dict(zip(("y", "yd", "ydd", "tau_fd"), (draw(p, 0.25), draw(p, 1), draw(p, 1), draw(u, 1))))
        answer = robot.answer(given["y"], given["yd"], given["ydd"], given["tau_fd"])
        double.append(given | {key: written(value, False) for key, value in answer.items()})
        if k < 4:
            exact.append(given | {key: written(value, True) for key, value in answer.items() if not key.startswith("cond")})
    for suffix, cases, extra in (("", double, {}), ("_mp", exact, {"digits": 40})):
        json.dump(head | extra | {"cases": cases}, open(f"{out}/{robot.name}{suffix}.json", "w"))


main(*sys.argv[1:])
