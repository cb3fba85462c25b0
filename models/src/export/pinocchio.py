
# of `constraintDynamics`: redundant rows are harmless, and accelerations exact to 1e-14 where the
# rows are well conditioned
SETTINGS = pin.ProximalSettings(1e-14, 1e-8, 2)


def with_balls(model):
    """The model with ball joints in the places of `BALLS`."""
    new = pin.Model()
    for j in range(1, model.njoints):
        name = model.names[j]
        joint = pin.JointModelSpherical() if name in BALLS else model.joints[j]
        parent = new.getJointId(model.names[model.parents[j]])
        new.addJoint(parent, joint, model.jointPlacements[j], name)
        new.appendBodyToJoint(j, model.inertias[j], pin.SE3.Identity())
    for frame in model.frames.tolist()[1:]:
        parent = new.getJointId(model.names[frame.parentJoint])
        new.addFrame(pin.Frame(frame.name, parent, frame.placement, frame.type), False)
    return new


def load():
    """The model, and the constraint models of its loops."""
    model = pin.buildModelFromUrdf(str(pathlib.Path(__file__).with_name(URDF)))
    if BALLS:
        model = with_balls(model)
    model.gravity.linear = np.array(GRAVITY)
    armature = np.zeros(model.nv)
    for name, (_, _, _, rotor) in TERMS.items():
        armature[model.joints[model.getJointId(name)].idx_v] = rotor
    model.armature = armature
    constraints = pin.StdVec_RigidConstraintModel()
    for name, rows, *cut in CUTS:
        ends = []
        for link, pose in (cut[:2], cut[2:]):
            frame = model.frames[model.getBodyId(link)]
            ends += [frame.parentJoint, frame.placement * pin.XYZQUATToSE3(np.array(pose))]
        kind = pin.ContactType.CONTACT_6D if rows == 6 else pin.ContactType.CONTACT_3D
        constraint = pin.RigidConstraintModel(kind, model, *ends, pin.LOCAL)
        constraint.name = name
        constraints.append(constraint)
    return model, constraints


def passive_forces(model, q, v):
    """Forces of springs and dampers, which Pinocchio leaves to its caller."""
    tau = np.zeros(model.nv)
    for name, (damping, stiffness, rest, _) in TERMS.items():
        joint = model.joints[model.getJointId(name)]
        of = slice(joint.idx_v, joint.idx_v + joint.nv)
        tau[of] -= damping * v[of]
        if stiffness:
            # a turn without limits has its cosine and sine
            at = q[joint.idx_q : joint.idx_q + joint.nq]
            angle = at[0] if joint.nq == 1 else np.arctan2(at[1], at[0])
            tau[of] -= stiffness * (angle - rest)
    return tau


def couplings(model):
    """Rows A and numbers b of the couplings: A q = b in joints of one freedom, A v = 0."""
    rows = np.zeros((len(COUPLINGS), model.nv))
    for row, (name, factors, _) in zip(rows, COUPLINGS):
        row[model.joints[model.getJointId(name)].idx_v] = 1
        for other, factor in factors.items():
            row[model.joints[model.getJointId(other)].idx_v] -= factor
    return rows, np.array([offset for _, _, offset in COUPLINGS])
