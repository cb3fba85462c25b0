// RBDL on the robots and states of `sarrus report`; `peer.hpp` has the format of its input and
// output.
//
// Each held direction of a loop is a LoopConstraint without Baumgarte's stabilisation, which would
// add to the accelerations. ForwardDynamicsConstraints… starts from the closed q and q̇, which are
// given, by each of its three solvers: of the whole system by Householder's QR, its default, by the
// range of the constraints with sparse factors, by their null space. Positions are not asked: its
// CalcAssemblyQ has weights instead of given independents.
#include <rbdl/rbdl.h>

#include "peer.hpp"

using namespace RigidBodyDynamics;
using namespace RigidBodyDynamics::Math;
using peer::stop;

static Vector3d vec(const peer::Vec3& x) { return Vector3d(x[0], x[1], x[2]); }

static Matrix3d turn(const peer::Frame& frame) {
    Matrix3d R;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) R(i, j) = frame.R[i][j];
    return R;
}

struct Robot {
    Model model;
    // of each link the body that moves it, and the link's pose in that
    std::vector<unsigned> bodies;
    std::vector<peer::Frame> places;
    // of each joint the index of its coordinate
    std::vector<unsigned> of_joint;
    ConstraintSet loops;

    explicit Robot(const peer::Input& input)
        : bodies(input.links.size()), places(input.links.size()), of_joint(input.joints.size()) {
        model.gravity = vec(input.gravity);
        std::vector<bool> is_child(input.links.size(), false);
        for (const peer::Joint& joint : input.joints) is_child.at(joint.child) = true;
        for (size_t link = 0; link < input.links.size(); link++)
            if (!is_child[link]) add(input, static_cast<int>(link));
        for (const peer::Loop& loop : input.loops) {
            const peer::Frame P = places[loop.predecessor] * loop.on_predecessor;
            const peer::Frame S = places[loop.successor] * loop.on_successor;
            for (const peer::Vec3& held : loop.held) {
                SpatialVector axis = SpatialVector::Zero();
                axis.tail<3>() = vec(P.turn(held));
                loops.AddLoopConstraint(bodies[loop.predecessor], bodies[loop.successor],
                    Xtrans(vec(P.p)), Xtrans(vec(S.p)), axis, false);
            }
        }
        loops.SetSolver(LinearSolverColPivHouseholderQR);
        loops.Bind(model);
    }

    // The children of a link; a fixed one is merged into the body that moves it.
    void add(const peer::Input& input, int link) {
        for (size_t j = 0; j < input.joints.size(); j++) {
            const peer::Joint& joint = input.joints[j];
            if (joint.parent != link) continue;
            const peer::Link& of = input.links[joint.child];
            const auto& I = of.inertia;
            Matrix3d about_centre;
            about_centre << I[0], I[1], I[2], I[1], I[3], I[4], I[2], I[4], I[5];
            const Matrix3d R = turn(of.com);
            const Matrix3d inertia = R * about_centre * R.transpose();
            const Body body(of.mass, vec(of.com.p), inertia);
            const peer::Frame at = places[link] * joint.origin;
            const SpatialTransform to(turn(at).transpose(), vec(at.p));
            if (joint.kind == 'F') {
                model.AddBody(bodies[link], to, ::Joint(JointTypeFixed), body);
                bodies[joint.child] = bodies[link];
                places[joint.child] = at;
            } else {
                const JointType type = joint.kind == 'R' ? JointTypeRevolute : JointTypePrismatic;
                of_joint[j] = model.dof_count;
                bodies[joint.child] = model.AddBody(bodies[link], to,
                    ::Joint(type, vec(joint.axis)), body);
            }
            add(input, joint.child);
        }
    }
};

int main() {
    const peer::Input input = peer::read_input();
    Robot robot(input);
    const auto places = [&](const std::vector<int>& joints) {
        std::vector<int> list;
        for (int j : joints) list.push_back(static_cast<int>(robot.of_joint[j]));
        return list;
    };
    const std::vector<int> tree = places(input.tree), independent = places(input.independent),
                           active = places(input.active);
    const auto n = static_cast<Eigen::Index>(robot.model.dof_count);
    VectorNd q = VectorNd::Zero(n), qd = q, qdd = q, tau = q;
    std::vector<double> ydd(independent.size());

    using Solve = void (*)(Model&, const VectorNd&, const VectorNd&, const VectorNd&,
        ConstraintSet&, VectorNd&, bool, std::vector<SpatialVector>*);
    const std::pair<const char*, Solve> solvers[] = {
        {"Direct", ForwardDynamicsConstraintsDirect},
        {"RangeSpaceSparse", ForwardDynamicsConstraintsRangeSpaceSparse},
        {"NullSpace", ForwardDynamicsConstraintsNullSpace},
    };
    std::vector<peer::Method> methods;
    for (const auto& [name, solve] : solvers) {
        const auto accelerate = [&, solve = solve](size_t k) {
            const peer::State& given = input.states[k];
            for (size_t i = 0; i < tree.size(); i++) {
                q[tree[i]] = given.q[i];
                qd[tree[i]] = given.qd[i];
            }
            tau.setZero();
            for (size_t i = 0; i < active.size(); i++) tau[active[i]] = given.tau_u[i];
            if (robot.loops.size() == 0)
                ForwardDynamics(robot.model, q, qd, tau, qdd);
            else
                solve(robot.model, q, qd, tau, robot.loops, qdd, true, nullptr);
            for (size_t i = 0; i < ydd.size(); i++) ydd[i] = qdd[independent[i]];
        };
        methods.push_back({std::string("FD ") + name + "; accuracy of doubles", accelerate,
            ydd.data(), ydd.size()});
        if (robot.loops.size() == 0) break;
    }
    std::printf("engine RBDL %d.%d.%d\n", (RBDL_API_VERSION) >> 16,
        (RBDL_API_VERSION) >> 8 & 255, (RBDL_API_VERSION) & 255);
    peer::measure(methods, input);
    return 0;
}
