// Simbody on the robots and states of `sarrus report`; `peer.hpp` has the format of its input and
// output.
//
// A loop of three rows is a ball, one of fewer holds a point in planes. Positions come from
// projectQ, as its integrators close loops (its Assembler takes a hundred times as long), with y
// locked and from the closed pose 1 ms earlier; forward dynamics starts from the closed q and q̇,
// which are given.
#include <Simbody.h>

#include "peer.hpp"

using namespace SimTK;
using peer::stop;

static Vec3 vec(const peer::Vec3& x) { return Vec3(x[0], x[1], x[2]); }

static Transform transform(const peer::Frame& frame) {
    Mat33 R;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) R(i, j) = frame.R[i][j];
    return Transform(Rotation(R), vec(frame.p));
}

struct Robot {
    MultibodySystem system;
    SimbodyMatterSubsystem matter{system};
    GeneralForceSubsystem forces{system};
    std::vector<MobilizedBody> bodies, of_joint;
    std::vector<Force::MobilityDiscreteForce> actuators;

    explicit Robot(const peer::Input& input)
        : bodies(input.links.size()), of_joint(input.joints.size()) {
        Force::Gravity(forces, matter, vec(input.gravity));
        const auto body = [&](int link) {
            const peer::Link& of = input.links[link];
            if (of.mass == 0) return Body::Rigid(MassProperties(0, Vec3(0), Inertia(0)));
            const auto& I = of.inertia;
            const Rotation R = transform(of.com).R();
            const Inertia about_center(Vec3(I[0], I[3], I[5]), Vec3(I[1], I[2], I[4]));
            const Vec3 at = vec(of.com.p);
            return Body::Rigid(MassProperties(of.mass, at,
                about_center.reexpress(~R).shiftFromMassCenter(at, of.mass)));
        };
        const std::function<void(int)> add = [&](int link) {
            for (size_t j = 0; j < input.joints.size(); j++) {
                const peer::Joint& joint = input.joints[j];
                if (joint.parent != link) continue;
                const Transform at = transform(joint.origin);
                MobilizedBody& made = bodies[joint.child];
                if (joint.kind == 'F') {
                    made = MobilizedBody::Weld(bodies[link], at, body(joint.child), Transform());
                } else {
                    // a pin turns about z, a slider moves along x
                    const CoordinateAxis along(joint.kind == 'R' ? 2 : 0);
                    const Transform turn(Rotation(UnitVec3(vec(joint.axis)), along));
                    if (joint.kind == 'R')
                        made = MobilizedBody::Pin(bodies[link], at * turn, body(joint.child), turn);
                    else
                        made = MobilizedBody::Slider(bodies[link], at * turn, body(joint.child),
                            turn);
                    of_joint[j] = made;
                }
                add(joint.child);
            }
        };
        std::vector<bool> is_child(input.links.size(), false);
        for (const peer::Joint& joint : input.joints) is_child.at(joint.child) = true;
        for (size_t link = 0; link < input.links.size(); link++) {
            if (is_child[link]) continue;
            bodies[link] = matter.Ground();
            add(static_cast<int>(link));
        }
        for (int j : input.active) actuators.emplace_back(forces, of_joint[j], MobilizerUIndex(0));
        for (const peer::Loop& loop : input.loops) {
            MobilizedBody &P = bodies[loop.predecessor], &S = bodies[loop.successor];
            const Vec3 at = vec(loop.on_predecessor.p), point = vec(loop.on_successor.p);
            if (loop.held.size() == 3) {
                Constraint::Ball(P, at, S, point);
                continue;
            }
            for (const peer::Vec3& held : loop.held) {
                const UnitVec3 normal(vec(loop.on_predecessor.turn(held)));
                Constraint::PointInPlane(P, normal, dot(normal, at), S, point);
            }
        }
    }
};

int main() {
    const peer::Input input = peer::read_input();
    Robot robot(input);
    State state = robot.system.realizeTopology();
    robot.system.realizeModel(state);
    const auto places = [&](const std::vector<int>& joints) {
        std::vector<int> list;
        for (int j : joints) list.push_back(robot.of_joint[j].getFirstQIndex(state));
        return list;
    };
    // with pins and sliders alone, u has the places of q
    const std::vector<int> tree = places(input.tree), independent = places(input.independent);

    std::vector<double> q(tree.size()), ydd(independent.size());
    std::vector<peer::Method> methods;
    State locked = state;
    for (const char* text : {"1e-3", "1e-6", "1e-9", "1e-12"}) {
        if (input.loops.empty()) continue;
        ProjectOptions options(std::atof(text));
        options.setOption(ProjectOptions::DontThrow);
        options.setOption(ProjectOptions::ForceProjection);
        // y locked, the others from the closed pose 1 ms earlier
        const auto project = [&, options](size_t k) {
            const peer::State& given = input.states[k];
            for (int j : input.independent) robot.of_joint[j].unlock(locked);
            Vector& to = locked.updQ();
            for (size_t i = 0; i < tree.size(); i++) to[tree[i]] = given.guess[i];
            for (size_t i = 0; i < independent.size(); i++) to[independent[i]] = given.y[i];
            for (int j : input.independent) robot.of_joint[j].lock(locked);
            robot.system.realize(locked, Stage::Position);
            ProjectResults results;
            Vector none;
            robot.system.projectQ(locked, none, options, results);
            const bool is_closed = results.getExitStatus() == ProjectResults::Succeeded;
            for (size_t i = 0; i < tree.size(); i++)
                q[i] = is_closed ? locked.getQ()[tree[i]] : NaN;
        };
        methods.push_back({std::string("STATE projectQ; tolerance ") + text, project, q.data(),
            q.size()});
    }
    const auto accelerate = [&](size_t k) {
        const peer::State& given = input.states[k];
        Vector &at = state.updQ(), &speed = state.updU();
        for (size_t i = 0; i < tree.size(); i++) {
            at[tree[i]] = given.q[i];
            speed[tree[i]] = given.qd[i];
        }
        for (size_t i = 0; i < robot.actuators.size(); i++)
            robot.actuators[i].setMobilityForce(state, given.tau_u[i]);
        robot.system.realize(state, Stage::Acceleration);
        for (size_t i = 0; i < ydd.size(); i++) ydd[i] = state.getUDot()[independent[i]];
    };
    methods.push_back({"FD realize from a closed pose; accuracy of doubles", accelerate, ydd.data(),
        ydd.size()});
    int major, minor, build;
    SimTK_version_simbody(&major, &minor, &build);
    std::printf("engine Simbody %d.%d\n", major, minor);
    peer::measure(methods, input);
    return 0;
}
