"""Drake on the robots and states of `sarrus report`; `peer.hpp` has the format of input and output.

Drake has loops in its discrete solvers only, whose accelerations lack the velocity terms. So an
expert takes the terms of the tree and solves M q̈ - Kᵀλ = τ - h, K q̈ = k from the closed q and q̇.
Times are those of calls from Python.
"""

import sys
import time

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    JacobianWrtVariable,
    PrismaticJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)


class Words:
    """Reads numbers and words one after the other."""

    def __init__(self, text):
        self.words = iter(text.split())

    def word(self):
        return next(self.words)

    def number(self):
        return int(self.word())

    def numbers(self, n):
        return np.array([float(self.word()) for _ in range(n)])

    def list(self):
        return [self.number() for _ in range(self.number())]

    def named_list(self, name):
        found = self.word()
        if found != name:
            sys.exit(f"expected `{name}`, found `{found}`")
        return self.list()

    def pose(self):
        x = self.numbers(6)
        return RigidTransform(RollPitchYaw(x[3:]), x[:3])


def read_robot(words):
    """The plant, its joints and loops, with the order of the coordinates."""
    plant = MultibodyPlant(0.0)
    assert words.word() == "gravity"
    plant.mutable_gravity_field().set_gravity_vector(words.numbers(3))
    assert words.word() == "links"
    bodies = []
    for link in range(words.number()):
        mass, com, i = float(words.word()), words.pose(), words.numbers(6)
        if mass == 0:
            inertia = SpatialInertia.Zero()
        else:
            central = RotationalInertia(*i[[0, 3, 5, 1, 2, 4]])
            inertia = SpatialInertia.MakeFromCentralInertia(
                mass, com.translation(), central.ReExpress(com.rotation())
            )
        bodies.append(plant.AddRigidBody(f"link{link}", inertia))
    assert words.word() == "joints"
    # children: the parent and the pose of each child, in the order of the joints
    joints, children, at_zero = [], {}, {}
    for j in range(words.number()):
        kind, parent, child = words.word(), words.number(), words.number()
        origin, axis = words.pose(), words.numbers(3)
        damping, stiffness, _, rotor = words.numbers(4)
        if kind not in "FRP" or damping or stiffness or rotor:
            sys.exit("it knows no joints of several freedoms, springs, dampers and rotors")
        children[child] = (parent, origin)
        frame = plant.AddFrame(
            FixedOffsetFrame(f"frame{j}", bodies[parent].body_frame(), origin)
        )
        if kind == "F":
            plant.WeldFrames(frame, bodies[child].body_frame())
            joints.append(None)
            continue
        make = RevoluteJoint if kind == "R" else PrismaticJoint
        joints.append(
            plant.AddJoint(
                make(name=f"joint{j}", frame_on_parent=frame,
                     frame_on_child=bodies[child].body_frame(), axis=axis / np.linalg.norm(axis))
            )
        )
    for link in range(len(bodies)):
        pose, at = RigidTransform(), link
        while at in children:
            at, origin = children[at]
            pose = origin @ pose
        at_zero[link] = pose
        if at == link:
            plant.WeldFrames(plant.world_frame(), bodies[link].body_frame())
    order = [words.named_list(name) for name in ("tree", "independent", "active")]
    assert words.word() == "groups"
    for _ in range(words.number()):
        words.list()
    assert words.word() == "loops"
    loops = []
    for _ in range(words.number()):
        words.number()
        p, s, where = words.number(), words.number(), words.word()
        if where == "placed":
            ends = words.pose(), words.pose()
        else:
            at = words.number()
            cut = at_zero[list(children)[at] if where == "joint" else at]
            ends = at_zero[p].inverse() @ cut, at_zero[s].inverse() @ cut
        rows = np.array([words.numbers(6) for _ in range(words.number())])
        if rows[:, :3].any():
            sys.exit("it knows no loops that hold angles")
        held = rows[:, 3:]
        loops.append((bodies[p].body_frame(), bodies[s].body_frame(), ends, held))
    if words.named_list("couplings"):
        sys.exit("it knows no couplings")
    plant.Finalize()
    places = [[joints[j].velocity_start() for j in which] for which in order]
    return plant, loops, places


def main():
    words = Words(sys.stdin.read())
    assert words.word() == "seconds"
    seconds = float(words.word())
    plant, loops, (tree, independent, active) = read_robot(words)
    assert words.word() == "states"
    n, p, u = len(tree), len(independent), len(active)
    states = []
    for _ in range(words.number()):
        words.numbers(3 * p)
        tau_u = words.numbers(u)
        words.numbers(n)
        states.append((words.numbers(n), words.numbers(n), tau_u))
    context = plant.CreateDefaultContext()
    world = plant.world_frame()
    v_type = JacobianWrtVariable.kV
    q, v = np.zeros(n), np.zeros(n)

    def forward(state):
        q[tree], v[tree] = state[0], state[1]
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        rows, k = [], []
        for p_frame, s_frame, (on_p, on_s), held in loops:
            # of the successor's point in the predecessor's frame
            jacobian = plant.CalcJacobianTranslationalVelocity(
                context, v_type, s_frame, on_s.translation(), p_frame, p_frame
            )
            bias = plant.CalcBiasTranslationalAcceleration(
                context, v_type, s_frame, on_s.translation(), p_frame, p_frame
            )
            directions = held @ on_p.rotation().matrix().T
            rows.append(directions @ jacobian)
            k.append(-(directions @ bias).ravel())
        tau = plant.CalcGravityGeneralizedForces(context) - plant.CalcBiasTerm(context)
        tau[active] += state[2]
        mass = plant.CalcMassMatrix(context)
        if not rows:
            return np.linalg.solve(mass, tau)[independent]
        K, right = np.vstack(rows), np.concatenate(k)
        m = len(right)
        kkt = np.block([[mass, K.T], [K, np.zeros((m, m))]])
        return np.linalg.solve(kkt, np.concatenate([tau, right]))[:n][independent]

    from importlib.metadata import version

    print(f"engine Drake {version('drake')}, called from Python")
    answers = [forward(state) for state in states]
    times, end = [], time.perf_counter() + seconds
    while not times or time.perf_counter() < end:
        start = time.perf_counter_ns()
        for state in states:
            forward(state)
        times.append((time.perf_counter_ns() - start) / len(states))
    median = float(np.median(times))
    print(f"run FD tree terms and KKT from Python; accuracy of doubles; {median!r}")
    for answer in answers:
        print(*(repr(float(x)) for x in answer))


main()
