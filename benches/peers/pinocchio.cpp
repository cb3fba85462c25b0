// Pinocchio on the robots and states of `sarrus report`: what an expert writes on top.
// `peer.hpp` has the format of its input and output.
//
// Everything starts from y: a warm Newton, each group's own block of G (K_d factorised once), then
// Pinocchio's recursions.
#include <pinocchio/algorithm/constrained-dynamics.hpp>
#include <pinocchio/algorithm/contact-dynamics.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/loop-constrained-aba.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/multibody/joint.hpp>

#include <Eigen/Dense>

#include "peer.hpp"

namespace pin = pinocchio;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// blocks of a group live on the stack
constexpr int LARGEST = 24;
using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, LARGEST, LARGEST>;
using Part = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, LARGEST, 1>;

using peer::stop;

// --- the robot -----------------------------------------------------------------------------------

// Where a link is: the joint that carries it, and its frame there.
struct Place {
    pin::JointIndex joint = 0;
    pin::SE3 on_joint = pin::SE3::Identity();
};

// A cut: both frames, the held directions and axes, and the velocities that move one end only.
struct Loop {
    int group = 0, row = 0, n_held = 0, n_fixed = 0;
    pin::JointIndex predecessor = 0, successor = 0;
    pin::SE3 on_predecessor, on_successor;
    Matrix3d directions = Matrix3d::Zero(), axes = Matrix3d::Zero();
    std::vector<int> before, behind;
};

// A damper and a spring of a joint, by its velocity and its position.
struct Spring {
    int v, q;
    double damping, stiffness, rest;
};

// A row that is linear in positions: their factors by velocity, the position of each, the offset.
struct Linear {
    std::vector<std::pair<int, double>> factors;
    std::vector<int> positions;
    double offset;
    int row = 0;
};

// Joints that loops tie together.
struct Group {
    std::vector<int> tree, independent, dependent, active;
    // places among y and u
    std::vector<int> y, u;
    int row = 0, n_rows = 0;
    // dependent velocities per independent one, from the last factorisation of K_d
    Block G;
    Eigen::PartialPivLU<Block> factors;
};

struct Robot {
    pin::Model model;
    std::vector<Loop> loops;
    std::vector<Group> groups;
    // positions in the order of q and y (-1 for one that stays at zero), velocities in that of ẏ, u
    std::vector<int> tree, y, independent, active;
    std::vector<Spring> springs;
    std::vector<Linear> couplings;
    // each group has as many actuators as freedoms; some loop holds an angle
    bool is_square = true, holds_angles = false;
};

struct State {
    VectorXd y, yd, ydd, tau_u, guess;
};

// --- reading -------------------------------------------------------------------------------------

static pin::SE3 se3(const peer::Frame& frame) {
    Matrix3d R;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) R(i, j) = frame.R[i][j];
    return pin::SE3(R, Vector3d(frame.p.data()));
}

static VectorXd vector(const std::vector<double>& x) {
    return Eigen::Map<const VectorXd>(x.data(), x.size());
}

// The joint type that Pinocchio's own reader takes: aligned with an axis where that is exact.
static pin::JointModel joint_model(char kind, const Vector3d& axis) {
    if (kind == 'S') return pin::JointModel(pin::JointModelSpherical());
    if (kind == 'X') return pin::JointModel(pin::JointModelFreeFlyer());
    const bool turns = kind == 'R';
    if (axis == Vector3d::UnitX()) return turns ? pin::JointModel(pin::JointModelRX())
        : pin::JointModel(pin::JointModelPX());
    if (axis == Vector3d::UnitY()) return turns ? pin::JointModel(pin::JointModelRY())
        : pin::JointModel(pin::JointModelPY());
    if (axis == Vector3d::UnitZ()) return turns ? pin::JointModel(pin::JointModelRZ())
        : pin::JointModel(pin::JointModelPZ());
    return turns ? pin::JointModel(pin::JointModelRevoluteUnaligned(axis))
        : pin::JointModel(pin::JointModelPrismaticUnaligned(axis));
}

static Robot robot_of(const peer::Input& input) {
    Robot robot;
    pin::Model& model = robot.model;
    model.gravity.linear() = Vector3d(input.gravity.data());

    std::vector<pin::Inertia> inertias;
    for (const peer::Link& link : input.links) {
        const pin::SE3 origin = se3(link.com);
        const auto& I = link.inertia;
        Matrix3d about_center;
        about_center << I[0], I[1], I[2], I[1], I[3], I[4], I[2], I[4], I[5];
        inertias.emplace_back(link.mass, origin.translation(), origin.rotation() * about_center
            * origin.rotation().transpose());
    }
    const std::vector<peer::Joint>& joints = input.joints;
    std::vector<bool> is_child(inertias.size(), false);
    for (const peer::Joint& joint : joints) is_child.at(joint.child) = true;

    // depth first, as Pinocchio wants it; fixed joints are merged away
    std::vector<Place> places(inertias.size());
    std::vector<int> velocity(joints.size(), -1), position(joints.size(), -1);
    const std::function<void(int)> add = [&](int link) {
        const Place& on = places[link];
        if (on.joint > 0 && inertias[link].mass() > 0) model.appendBodyToJoint(on.joint,
            inertias[link], on.on_joint);
        for (size_t j = 0; j < joints.size(); j++) {
            const peer::Joint& joint = joints[j];
            if (joint.parent != link) continue;
            Place place{places[link].joint, places[link].on_joint * se3(joint.origin)};
            if (joint.kind != 'F' && joint.kind != 'I') {
                const Vector3d axis(joint.axis.data());
                place.joint = model.addJoint(place.joint, joint_model(joint.kind, axis),
                    place.on_joint, "joint" + std::to_string(j));
                place.on_joint.setIdentity();
                velocity[j] = model.joints[place.joint].idx_v();
                position[j] = model.joints[place.joint].idx_q();
                model.armature[velocity[j]] = joint.rotor;
                if (joint.damping != 0 || joint.stiffness != 0)
                    robot.springs.push_back({velocity[j], position[j], joint.damping,
                        joint.stiffness, joint.rest});
            }
            places[joint.child] = place;
            add(joint.child);
        }
    };
    for (size_t link = 0; link < inertias.size(); link++)
        if (!is_child[link]) add(static_cast<int>(link));

    const auto velocities = [&](const std::vector<int>& list) {
        std::vector<int> found;
        for (int j : list)
            for (int k = 0, n = joints[j].n_v(); velocity.at(j) >= 0 && k < n; k++)
                // of a free joint Pinocchio has v before ω
                found.push_back(velocity[j] + (n == 6 ? (k + 3) % 6 : k));
        return found;
    };
    const auto positions = [&](const std::vector<int>& list) {
        std::vector<int> found;
        for (int j : list)
            for (int k = 0; k < joints[j].n_q(); k++)
                found.push_back(position.at(j) < 0 ? -1 : position[j] + k);
        return found;
    };
    robot.tree = positions(input.tree);
    robot.y = positions(input.independent);
    robot.independent = velocities(input.independent);
    robot.active = velocities(input.active);
    const auto place_in = [](const std::vector<int>& list, int x) {
        const auto found = std::find(list.begin(), list.end(), x);
        return found == list.end() ? -1 : static_cast<int>(found - list.begin());
    };

    for (const std::vector<int>& of_group : input.groups) {
        Group& group = robot.groups.emplace_back();
        group.tree = velocities(of_group);
        for (int v : group.tree) {
            const int y = place_in(robot.independent, v), u = place_in(robot.active, v);
            if (y >= 0) group.independent.push_back(v), group.y.push_back(y);
            if (y < 0) group.dependent.push_back(v);
            if (u >= 0) group.active.push_back(v), group.u.push_back(u);
        }
        if (group.active.size() != group.independent.size()) robot.is_square = false;
        if (group.tree.size() > LARGEST) stop("a group is too large");
    }

    // velocities from a joint to the root
    const auto support = [&](pin::JointIndex j) {
        std::vector<int> list;
        for (; j > 0; j = model.parents[j])
            for (int k = 0; k < model.joints[j].nv(); k++)
                list.push_back(model.joints[j].idx_v() + k);
        return list;
    };
    for (const peer::Loop& given : input.loops) {
        Loop& loop = robot.loops.emplace_back();
        loop.group = given.group;
        const Place &predecessor = places.at(given.predecessor),
                    &successor = places.at(given.successor);
        loop.predecessor = predecessor.joint;
        loop.successor = successor.joint;
        loop.on_predecessor = predecessor.on_joint * se3(given.on_predecessor);
        loop.on_successor = successor.on_joint * se3(given.on_successor);
        const auto rows = [](const std::vector<peer::Vec3>& given, Matrix3d& rows) {
            if (given.size() > 3) stop("a loop has more than three rows of a kind");
            for (size_t a = 0; a < given.size(); a++)
                rows.row(a) = Vector3d(given[a].data()).transpose();
            return static_cast<int>(given.size());
        };
        loop.n_held = rows(given.held, loop.directions);
        loop.n_fixed = rows(given.fixed, loop.axes);
        robot.holds_angles |= loop.n_fixed > 0;
        const std::vector<int> p = support(loop.predecessor), s = support(loop.successor);
        for (int v : p)
            if (place_in(s, v) < 0) loop.before.push_back(v);
        for (int v : s)
            if (place_in(p, v) < 0) loop.behind.push_back(v);
    }

    // rows of a group stand together
    int row = 0;
    for (size_t k = 0; k < robot.groups.size(); k++) {
        Group& group = robot.groups[k];
        group.row = row;
        for (size_t l = 0; l < robot.loops.size(); l++) {
            if (robot.loops[l].group != static_cast<int>(k)) continue;
            robot.loops[l].row = row;
            row += robot.loops[l].n_held + robot.loops[l].n_fixed;
        }
        for (const peer::Coupling& given : input.couplings) {
            if (place_in(group.tree, velocity[given.joint]) < 0) continue;
            Linear& of = robot.couplings.emplace_back();
            of.row = row++;
            of.offset = given.offset;
            const auto add = [&](int joint, double factor) {
                if (place_in(group.tree, velocity[joint]) < 0) stop("a coupling joins groups");
                of.factors.emplace_back(velocity[joint], factor);
                of.positions.push_back(position[joint]);
            };
            add(given.joint, 1);
            for (const auto& [joint, multiplier] : given.terms) add(joint, -multiplier);
        }
        group.n_rows = row - group.row;
        if (group.n_rows != static_cast<int>(group.dependent.size()))
            stop("a group has not as many rows as dependent joints");
    }
    return robot;
}

// --- loops ---------------------------------------------------------------------------------------

struct Closed {
    const Robot& robot;
    const pin::Model& model;
    pin::Data data;
    std::vector<Group> groups;
    VectorXd phi, k, q, next, change, qd, qdd, g, zero, tau, reduced;
    MatrixXd K, M, MG, My;
    Eigen::LLT<MatrixXd> factors;

    explicit Closed(const Robot& robot) : robot(robot), model(robot.model), data(robot.model),
        groups(robot.groups) {
        const int n = model.nv, p = static_cast<int>(robot.independent.size()), m = n - p;
        q = next = pin::neutral(model);
        for (VectorXd* x : {&change, &qd, &qdd, &g, &zero, &tau}) x->setZero(n);
        for (VectorXd* x : {&phi, &k}) x->setZero(m);
        reduced.setZero(p);
        K.setZero(m, n);
        MG.setZero(n, p);
        My.setZero(p, p);
        for (Group& group : groups) group.G.setZero(group.dependent.size(),
            group.independent.size());
    }

    // φ and K at q
    void constraints() {
        pin::computeJointJacobians(model, data, q);
        for (const Loop& loop : robot.loops) {
            const pin::SE3 P = data.oMi[loop.predecessor] * loop.on_predecessor, S =
                data.oMi[loop.successor] * loop.on_successor;
            const Vector3d at = S.translation();
            const Matrix3d A = loop.directions * P.rotation().transpose();
            const Vector3d gap = A * (at - P.translation());
            const int angles = loop.row + loop.n_held;
            phi.segment(loop.row, loop.n_held) = gap.head(loop.n_held);
            Matrix3d B;
            if (loop.n_fixed > 0) {
                B = loop.axes * P.rotation().transpose();
                const Matrix3d D = P.rotation().transpose() * S.rotation();
                const Vector3d turn = loop.axes * Vector3d(D(2, 1) - D(1, 2), D(0, 2) - D(2, 0),
                    D(1, 0) - D(0, 1)) / 2;
                phi.segment(angles, loop.n_fixed) = turn.head(loop.n_fixed);
            }
            const auto column = [&](int v, double sign) {
                const Vector3d moved = A * (data.J.col(v).head<3>()
                    + data.J.col(v).tail<3>().cross(at));
                K.col(v).segment(loop.row, loop.n_held) = sign * moved.head(loop.n_held);
                if (loop.n_fixed == 0) return;
                const Vector3d turned = B * data.J.col(v).tail<3>();
                K.col(v).segment(angles, loop.n_fixed) = sign * turned.head(loop.n_fixed);
            };
            for (int v : loop.behind) column(v, 1);
            for (int v : loop.before) column(v, -1);
        }
        for (const Linear& of : robot.couplings) {
            phi(of.row) = -of.offset;
            for (size_t i = 0; i < of.factors.size(); i++) {
                const auto& [v, factor] = of.factors[i];
                phi(of.row) += factor * q(of.positions[i]);
                K(of.row, v) = factor;
            }
        }
    }

    void factorise(Group& group) {
        const int m = group.n_rows;
        Block Kd(m, m);
        for (int j = 0; j < m; j++) Kd.col(j) = K.col(group.dependent[j]).segment(group.row, m);
        group.factors.compute(Kd);
    }

    // Newton's method for the dependent joints; K is at q, or a step of tolerance² away
    void close(const State& state, double tolerance) {
        for (size_t i = 0; i < robot.tree.size(); i++)
            if (robot.tree[i] >= 0) q(robot.tree[i]) = state.guess(i);
        for (size_t i = 0; i < robot.y.size(); i++) q(robot.y[i]) = state.y(i);
        for (int step = 0; step < 20; step++) {
            constraints();
            if (phi.size() == 0 || phi.lpNorm<Eigen::Infinity>() < tolerance) break;
            for (Group& group : groups) {
                if (group.n_rows == 0) continue;
                factorise(group);
                const Part d = group.factors.solve(Part(phi.segment(group.row, group.n_rows)));
                if (model.nq == model.nv)
                    for (int i = 0; i < group.n_rows; i++) q(group.dependent[i]) -= d(i);
                else
                    for (int i = 0; i < group.n_rows; i++) change(group.dependent[i]) = -d(i);
            }
            if (model.nq == model.nv) continue;
            pin::integrate(model, q, change, next);
            q.swap(next);
        }
    }

    // G_d = −K_d⁻¹ K_i, and the velocities
    void velocities(const State& state) {
        for (Group& group : groups) {
            if (group.n_rows == 0) continue;
            factorise(group);
            Block Ki(group.n_rows, static_cast<int>(group.independent.size()));
            for (size_t j = 0; j < group.independent.size(); j++) Ki.col(j) =
                K.col(group.independent[j]).segment(group.row, group.n_rows);
            group.G = -group.factors.solve(Ki);
        }
        spread(state.yd, qd);
    }

    // x_q = G x_y
    void spread(const VectorXd& from, VectorXd& to) const {
        for (const Group& group : groups) {
            Part part(static_cast<int>(group.y.size()));
            for (size_t j = 0; j < group.y.size(); j++) to(group.independent[j]) = part(j) =
                from(group.y[j]);
            const Part rest = group.G * part;
            for (int i = 0; i < group.n_rows; i++) to(group.dependent[i]) = rest(i);
        }
    }

    // x_y = Gᵀ x_q
    void gather(const VectorXd& from, VectorXd& to) const {
        for (const Group& group : groups) {
            Part rest(group.n_rows);
            for (int i = 0; i < group.n_rows; i++) rest(i) = from(group.dependent[i]);
            const Part part = group.G.transpose() * rest;
            for (size_t j = 0; j < group.y.size(); j++) to(group.y[j]) = from(group.independent[j])
                + part(j);
        }
    }

    // g from k: accelerations of the cuts at q̈ = 0
    void bias() {
        pin::forwardKinematics(model, data, q, qd, zero);
        for (const Loop& loop : robot.loops) {
            const Motion p = motion(loop.predecessor, loop.on_predecessor), s =
                motion(loop.successor, loop.on_successor);
            const Vector3d r = s.at.translation() - p.at.translation(), rd = s.v - p.v;
            const Vector3d seen = s.a - p.a - p.wd.cross(r) - 2 * p.w.cross(rd)
                + p.w.cross(p.w.cross(r));
            const Vector3d a = loop.directions * (p.at.rotation().transpose() * seen);
            k.segment(loop.row, loop.n_held) = -a.head(loop.n_held);
            if (loop.n_fixed == 0) continue;
            const Vector3d b = loop.axes
                * (p.at.rotation().transpose() * (s.wd - p.wd - p.w.cross(s.w - p.w)));
            k.segment(loop.row + loop.n_held, loop.n_fixed) = -b.head(loop.n_fixed);
        }
        for (const Group& group : groups) {
            if (group.n_rows == 0) continue;
            const Part part = group.factors.solve(Part(k.segment(group.row, group.n_rows)));
            for (int i = 0; i < group.n_rows; i++) g(group.dependent[i]) = part(i);
        }
    }

    // A frame of a joint: pose, rates and classical accelerations in the root.
    struct Motion {
        pin::SE3 at;
        Vector3d w, wd, v, a;
    };

    Motion motion(pin::JointIndex j, const pin::SE3& on) const {
        if (j == 0) return {on, Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero(),
            Vector3d::Zero()};
        const Matrix3d& R = data.oMi[j].rotation();
        const pin::Motion &v = data.v[j], &a = data.a[j];
        const Vector3d r = R * on.translation(), w = R * v.angular(), wd = R * a.angular();
        const Vector3d linear = R * (a.linear() + v.angular().cross(v.linear()));
        return {data.oMi[j] * on, w, wd, R * v.linear() + w.cross(r), linear + wd.cross(r)
            + w.cross(w.cross(r))};
    }

    void state(const State& state, double tolerance) {
        close(state, tolerance);
        velocities(state);
    }

    // what springs and dampers take of joint forces
    void resist(VectorXd& tau, double sign) const {
        for (const Spring& of : robot.springs)
            tau(of.v) += sign * (of.damping * qd(of.v) + of.stiffness * (q(of.q) - of.rest));
    }

    // τ_u from y, ẏ, ÿ
    void inverse_dynamics(const State& state, double tolerance, VectorXd& tau_u) {
        this->state(state, tolerance);
        bias();
        spread(state.ydd, qdd);
        qdd += g;
        pin::rnea(model, data, q, qd, qdd);
        resist(data.tau, 1);
        gather(data.tau, reduced);
        // G_uᵀ τ_u = τ_y, group by group
        for (const Group& group : groups) {
            const int n = static_cast<int>(group.y.size());
            Block Gu(n, n);
            Part tau_y(n);
            for (int a = 0; a < n; a++) {
                tau_y(a) = reduced(group.y[a]);
                for (int b = 0; b < n; b++) Gu(b, a) = of_actuator(group, b, a);
            }
            if (group.n_rows > 0) tau_y = Gu.transpose().partialPivLu().solve(tau_y).eval();
            for (int b = 0; b < n; b++) tau_u(group.u[group.n_rows > 0 ? b : at(group.active,
                group.independent[b])]) = tau_y(b);
        }
    }

    static int at(const std::vector<int>& list,
        int x) { return static_cast<int>(std::find(list.begin(), list.end(), x) - list.begin()); }

    // How fast an actuator moves with an independent velocity.
    static double of_actuator(const Group& group, int actuator, int independent) {
        const int v = group.active[actuator], i = at(group.dependent, v);
        if (i < static_cast<int>(group.dependent.size())) return group.G(i, independent);
        return v == group.independent[independent] ? 1.0 : 0.0;
    }

    // ÿ from y, ẏ, τ_u: M_y = GᵀMG, block by block
    void forward_dynamics(const State& state, double tolerance, VectorXd& ydd) {
        this->state(state, tolerance);
        bias();
        tau = -pin::rnea(model, data, q, qd, g);
        resist(tau, -1);
        for (size_t a = 0; a < robot.active.size(); a++) tau(robot.active[a]) += state.tau_u(a);
        gather(tau, reduced);
        pin::crba(model, data, q, pin::Convention::LOCAL);
        data.M.triangularView<Eigen::StrictlyLower>() =
            data.M.transpose().triangularView<Eigen::StrictlyLower>();
        for (const Group& group : groups)
            for (size_t j = 0; j < group.y.size(); j++) {
                auto column = MG.col(group.y[j]);
                column = data.M.col(group.independent[j]);
                for (int i = 0; i < group.n_rows; i++) column.noalias() += group.G(i, j)
                    * data.M.col(group.dependent[i]);
            }
        for (int c = 0; c < My.cols(); c++)
            for (const Group& group : groups)
                for (size_t j = 0; j < group.y.size(); j++) {
                    if (group.y[j] < c) continue;
                    double sum = MG(group.independent[j], c);
                    for (int i = 0; i < group.n_rows; i++) sum += group.G(i, j)
                        * MG(group.dependent[i], c);
                    My(group.y[j], c) = sum;
                }
        factors.compute(My);
        ydd = reduced;
        factors.solveInPlace(ydd);
    }
};

// --- Pinocchio's own closed loops ----------------------------------------------------------------

// It has no closure of two rows: each loop holds a point, and the proximal term takes the row that
// is too many.
struct Proximal {
    using Constraint = pin::RigidConstraintModelTpl<double, 0>;
    using ConstraintData = pin::RigidConstraintDataTpl<double, 0>;
    std::vector<Constraint, Eigen::aligned_allocator<Constraint>> constraints;
    std::vector<ConstraintData, Eigen::aligned_allocator<ConstraintData>> datas;
    pin::Model model;
    pin::Data data;
    VectorXd tau;

    explicit Proximal(const Robot& robot) : model(robot.model), data(model),
        tau(VectorXd::Zero(model.nv)) {
        for (const Loop& loop : robot.loops)
            constraints.emplace_back(pin::CONTACT_3D, model, loop.predecessor, loop.on_predecessor,
                loop.successor, loop.on_successor, pin::LOCAL);
        for (const Constraint& constraint : constraints) datas.push_back(constraint.createData());
        pin::initConstraintDynamics(model, data, constraints, datas);
        pin::computeJointMinimalOrdering(model, data, constraints);
    }

    // ÿ from y, ẏ, τ_u
    void forward_dynamics(Closed& closed, const State& state, bool recursive,
        pin::ProximalSettings& settings, VectorXd& ydd) {
        closed.state(state, 1e-12);
        const Robot& robot = closed.robot;
        tau.setZero();
        for (size_t a = 0; a < robot.active.size(); a++) tau(robot.active[a]) = state.tau_u(a);
        closed.resist(tau, -1);
        const VectorXd& qdd = recursive ? pin::lcaba(model, data, closed.q, closed.qd, tau,
            constraints, datas, settings)
                                        : pin::constraintDynamics(model, data, closed.q, closed.qd,
                                            tau, constraints, datas, settings);
        for (size_t i = 0; i < robot.independent.size(); i++) ydd(i) = qdd(robot.independent[i]);
    }
};

int main() {
    const peer::Input input = peer::read_input(true);
    const Robot robot = robot_of(input);
    const int n = static_cast<int>(robot.tree.size()), p =
        static_cast<int>(robot.independent.size());
    std::vector<State> states;
    for (const peer::State& of : input.states)
        states.push_back({vector(of.y), vector(of.yd), vector(of.ydd), vector(of.tau_u),
            vector(of.guess)});

    Closed closed(robot);
    VectorXd q(n), tau_u(p), ydd(p);
    std::vector<peer::Method> methods;
    const auto add = [&](const std::string& name, const VectorXd& answer, auto call) {
        methods.push_back({name, [&states, call](size_t k) mutable { call(states[k]); },
            answer.data(), static_cast<size_t>(answer.size())});
    };
    for (const char* text : {"1e-3", "1e-6", "1e-9", "1e-12", "1e-14"}) {
        const double tolerance = std::atof(text);
        const std::string setting = std::string("; tolerance ") + text;
        add("STATE Newton and G" + setting, q, [&, tolerance](const State& state) {
            closed.state(state, tolerance);
            for (int i = 0; i < n; i++) q(i) = robot.tree[i] < 0 ? 0 : closed.q(robot.tree[i]);
        });
        if (robot.is_square) add("ID RNEA, explicit G" + setting, tau_u, [&, tolerance](const State& state) {
            closed.inverse_dynamics(state, tolerance, tau_u);
        });
        add("FD CRBA, explicit G" + setting, ydd, [&, tolerance](const State& state) {
            closed.forward_dynamics(state, tolerance, ydd);
        });
    }
    // analytic derivatives of explicit G are not Pinocchio's: differences are what is at hand
    const auto differences = [&](bool forward, double step, VectorXd& answer) {
        const VectorXd& value = forward ? ydd : tau_u;
        std::vector<VectorXd State::*> by{&State::y, &State::yd};
        if (forward) by.push_back(&State::tau_u);
        return [&, forward, step, by](State state) {
            const auto call = [&] {
                if (forward) closed.forward_dynamics(state, 1e-12, ydd);
                else closed.inverse_dynamics(state, 1e-12, tau_u);
                return value;
            };
            answer.head(p) = call();
            for (size_t k = 0; k < by.size(); k++)
                for (int column = 0; column < p; column++) {
                    double& x = (state.*by[k])(column);
                    const double at = x;
                    x = at + step;
                    const VectorXd ahead = call();
                    x = at - step;
                    const VectorXd change = (ahead - call()) / (2 * step);
                    x = at;
                    for (int row = 0; row < p; row++)
                        answer(p + (static_cast<int>(k) * p + row) * p + column) = change(row);
                }
        };
    };
    VectorXd did(p + 2 * p * p), dfd(p + 3 * p * p);
    for (const char* text : {"1e-3", "1e-4", "1e-5", "1e-6", "1e-7"}) {
        // of a long chain nobody asks for them: a call takes a tenth of a second
        if (p > 64 || !robot.is_square || robot.y.size() != robot.independent.size()) break;
        const std::string setting = std::string("; step ") + text;
        add("DID differences of RNEA, explicit G" + setting, did,
            differences(false, std::atof(text), did));
        add("DFD differences of CRBA, explicit G" + setting, dfd,
            differences(true, std::atof(text), dfd));
    }
    // each its own data: what one leaves there spoils the other
    Proximal whole(robot), articulated(robot);
    for (const bool recursive : {false, true})
        for (const char* mu : {"1e-10", "1e-8", "1e-6", "1e-4"})
            for (const int iterations : {1, 2, 3}) {
                if (robot.loops.empty() || robot.holds_angles || !robot.couplings.empty()) continue;
                const std::string name = recursive ? "FD lcaba" : "FD constraintDynamics";
                Proximal& proximal = recursive ? articulated : whole;
                pin::ProximalSettings settings(1e-14, std::atof(mu), iterations);
                add(name + "; mu " + mu + ", iterations " + std::to_string(iterations), ydd,
                    [&, recursive, settings](const State& state) mutable {
                        proximal.forward_dynamics(closed, state, recursive, settings, ydd);
                    });
            }
    std::printf("engine Pinocchio %s, clang %s\n", PINOCCHIO_VERSION, __clang_version__);
    peer::measure(methods, input);
    return 0;
}
