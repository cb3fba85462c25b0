// Writes C by CasADi from Pinocchio's algorithms on the tree of a robot with loops; the program
// `casadi_code.py` has its input and uses its output.
//
// In, from standard input, numbers apart by blanks: gravity; the number of joints, each with its
// parent (0 the root), a letter R or P, its axis, its pose in the parent joint (rotation by rows,
// translation) and the mass, the centre and the inertia (xx xy xz yy yz zz, about the centre) of
// its body; the number of motors and their joints; the number of loops, each with two times a
// joint and a pose in it, the number of rows, and as many directions of the first frame.
//
// Out: casadi_code.c in the working folder with three functions of one vector each.
//   rnea: q, q̇, q̈ to τ of the tree, loops ignored
//   inverse: closed q, q̇, q̈ to τ_u, by the forces of each mechanism's loops
//   forward: closed q, q̇ and τ_u to q̈, by the KKT system, factorised as L D Lᵀ from leaves to root,
//   then the loops: sparse, and no pivot is zero where the rows are independent
#include <pinocchio/autodiff/casadi.hpp>

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include <algorithm>
#include <iostream>

namespace pin = pinocchio;
using casadi::Slice;
using casadi::SX;
using Vector = Eigen::Matrix<SX, Eigen::Dynamic, 1>;
using Matrix = Eigen::Matrix<SX, Eigen::Dynamic, Eigen::Dynamic>;
using Three = Eigen::Matrix<SX, 3, 1>;

static double number() {
    double x;
    if (!(std::cin >> x)) std::exit(1);
    return x;
}

static Eigen::Vector3d three() {
    const double x = number(), y = number();
    return Eigen::Vector3d(x, y, number());
}

static pin::SE3 pose() {
    Eigen::Matrix3d R;
    for (int i = 0; i < 9; i++) R(i / 3, i % 3) = number();
    return pin::SE3(R, three());
}

// The joint type that Pinocchio's own reader takes: aligned with an axis where that is exact.
static pin::JointModel joint_model(char kind, const Eigen::Vector3d& axis) {
    const bool turns = kind == 'R';
    if (axis == Eigen::Vector3d::UnitX()) return turns ? pin::JointModel(pin::JointModelRX())
        : pin::JointModel(pin::JointModelPX());
    if (axis == Eigen::Vector3d::UnitY()) return turns ? pin::JointModel(pin::JointModelRY())
        : pin::JointModel(pin::JointModelPY());
    if (axis == Eigen::Vector3d::UnitZ()) return turns ? pin::JointModel(pin::JointModelRZ())
        : pin::JointModel(pin::JointModelPZ());
    return turns ? pin::JointModel(pin::JointModelRevoluteUnaligned(axis))
        : pin::JointModel(pin::JointModelPrismaticUnaligned(axis));
}

struct Loop {
    pin::FrameIndex first, second;
    std::vector<Eigen::Vector3d> held;
};

static Vector to_eigen(const SX& x) {
    Vector y(x.size1());
    for (casadi_int i = 0; i < x.size1(); i++) y[i] = x(i);
    return y;
}

static SX to_casadi(const Matrix& x) {
    SX y(x.rows(), x.cols());
    for (Eigen::Index i = 0; i < x.rows(); i++)
        for (Eigen::Index j = 0; j < x.cols(); j++)
            if (!x(i, j).is_zero()) y(i, j) = x(i, j);
    return y;
}

// Kᵀ λ = τ at the joints without motors, for each mechanism by itself: rows that share such joints.
static SX multipliers(const SX& K, const SX& tau, const std::vector<casadi_int>& motors) {
    const casadi_int n_rows = K.size1();
    std::vector<casadi_int> passive, of_row(n_rows), of_joint(K.size2(), -1);
    for (casadi_int j = 0; j < K.size2(); j++)
        if (std::find(motors.begin(), motors.end(), j) == motors.end()) passive.push_back(j);
    for (casadi_int i = 0; i < n_rows; i++) of_row[i] = i;
    for (casadi_int j : passive)
        for (casadi_int i = 0; i < n_rows; i++) {
            if (!K.sparsity().has_nz(i, j)) continue;
            if (of_joint[j] < 0) of_joint[j] = of_row[i];
            const casadi_int from = of_row[i], to = of_joint[j];
            std::replace(of_row.begin(), of_row.end(), from, to);
            std::replace(of_joint.begin(), of_joint.end(), from, to);
        }
    SX lambda(n_rows, 1);
    for (casadi_int group = 0; group < n_rows; group++) {
        std::vector<casadi_int> rows, joints;
        for (casadi_int i = 0; i < n_rows; i++)
            if (of_row[i] == group) rows.push_back(i);
        for (casadi_int j : passive)
            if (of_joint[j] == group) joints.push_back(j);
        if (!rows.empty()) lambda(rows) = solve(K(rows, joints).T(), tau(joints));
    }
    return lambda;
}

int main() {
    pin::Model numbers;
    numbers.gravity.linear() = three();
    for (int n = static_cast<int>(number()), k = 1; k <= n; k++) {
        const auto parent = static_cast<pin::JointIndex>(number());
        char kind;
        std::cin >> kind;
        const Eigen::Vector3d axis = three();
        const pin::SE3 at = pose();
        const auto joint = numbers.addJoint(parent, joint_model(kind, axis), at,
            "joint" + std::to_string(k));
        const double mass = number();
        const Eigen::Vector3d centre = three();
        Eigen::Matrix3d I;
        for (int i = 0; i < 3; i++)
            for (int j = i; j < 3; j++) I(i, j) = I(j, i) = number();
        numbers.appendBodyToJoint(joint, pin::Inertia(mass, centre, I), pin::SE3::Identity());
    }
    std::vector<casadi_int> motors(static_cast<size_t>(number()));
    for (casadi_int& motor : motors) motor = static_cast<casadi_int>(number()) - 1;
    std::vector<Loop> loops(static_cast<size_t>(number()));
    casadi_int n_rows = 0;
    for (Loop& loop : loops) {
        for (pin::FrameIndex* frame : {&loop.first, &loop.second}) {
            const auto joint = static_cast<pin::JointIndex>(number());
            *frame = numbers.addFrame(pin::Frame("cut" + std::to_string(numbers.nframes), joint, 0,
                pose(), pin::OP_FRAME));
        }
        loop.held.resize(static_cast<size_t>(number()));
        for (Eigen::Vector3d& held : loop.held) held = three();
        n_rows += static_cast<casadi_int>(loop.held.size());
    }

    // symbols, and the tree's terms
    const pin::ModelTpl<SX> model = numbers.cast<SX>();
    pin::DataTpl<SX> data(model), still(model);
    const casadi_int n = model.nv, n_u = static_cast<casadi_int>(motors.size());
    const SX given = SX::sym("x", 3 * n);
    const SX q = given(Slice(0, n)), v = given(Slice(n, 2 * n)), a = given(Slice(2 * n, 3 * n));
    const SX tau_u = SX::sym("tau_u", n_u);
    const Vector Q = to_eigen(q), V = to_eigen(v), none = Vector::Constant(n, SX(0));
    const SX tau = to_casadi(pin::rnea(model, data, Q, V, to_eigen(a)));
    const SX bias = to_casadi(pin::rnea(model, still, Q, V, none));
    pin::crba(model, data, Q, pin::Convention::WORLD);
    Matrix M = data.M;
    M.triangularView<Eigen::StrictlyLower>() = M.transpose();

    // rows of the loops, and what they lack of the accelerations
    pin::forwardKinematics(model, still, Q, V, none);
    pin::computeJointJacobians(model, still, Q);
    pin::updateFramePlacements(model, still);
    SX K(0, n), rate(0, 1);
    for (const Loop& loop : loops) {
        const auto axes = pin::LOCAL_WORLD_ALIGNED;
        Matrix J[2];
        Three speed[2], acceleration[2];
        for (int end = 0; end < 2; end++) {
            const auto frame = end == 0 ? loop.first : loop.second;
            J[end] = Matrix::Constant(6, n, SX(0));
            pin::getFrameJacobian(model, still, frame, axes, J[end]);
            speed[end] = pin::getFrameVelocity(model, still, frame, axes).linear();
            acceleration[end] =
                pin::getFrameClassicalAcceleration(model, still, frame, axes).linear();
        }
        const Three turning = pin::getFrameVelocity(model, still, loop.first, axes).angular();
        const Three apart = speed[1] - speed[0];
        const Three drift = acceleration[1] - acceleration[0] - SX(2) * turning.cross(apart);
        Matrix rows = J[1].topRows(3) - J[0].topRows(3);
        // joints that carry both ends do not move them apart
        for (const auto joint : numbers.supports[numbers.frames[loop.first].parentJoint])
            for (const auto other : numbers.supports[numbers.frames[loop.second].parentJoint])
                if (joint > 0 && joint == other)
                    rows.col(numbers.joints[joint].idx_v()).setConstant(SX(0));
        for (const Eigen::Vector3d& held : loop.held) {
            const Three along = still.oMf[loop.first].rotation() * held.cast<SX>();
            K = vertcat(K, to_casadi(along.transpose() * rows));
            rate = vertcat(rate, along.dot(drift));
        }
    }

    // the loops' forces λ leave none at joints without motors, then motors bear the rest
    SX forces(n, n_u);
    for (casadi_int k = 0; k < n_u; k++) forces(motors[k], k) = 1;
    const SX shares = (tau - mtimes(K.T(), multipliers(K, tau, motors)))(motors);

    // leaves first, then the loops
    std::vector<casadi_int> order;
    for (casadi_int i = n; i-- > 0;) order.push_back(i);
    const SX of_tree = SX::densify(to_casadi(M))(order, order);
    const SX mass = sparsify(of_tree), rows = K(Slice(), order);
    const SX system = blockcat(mass, rows.T(), rows, SX(n_rows, n_rows));
    const SX right = vertcat((mtimes(forces, tau_u) - bias)(order), -rate);
    SX D, LT;
    std::vector<casadi_int> p;
    ldl(system, D, LT, p, false);
    const SX found = ldl_solve(right, D, LT, p)(Slice(0, n))(order);

    casadi::CodeGenerator code("casadi_code", {{"with_header", false}});
    code.add(casadi::Function("rnea", {given}, {tau}));
    code.add(casadi::Function("inverse", {given}, {shares}));
    const SX state = vertcat(q, v, tau_u);
    code.add(casadi::Function("forward", {state}, {found}));
    code.generate();
    std::printf("Pinocchio %s, CasADi %s\n", PINOCCHIO_VERSION, casadi::CasadiMeta::version());
    return 0;
}
