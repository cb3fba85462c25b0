// MuJoCo on the robots and states of `sarrus report`; `peer.hpp` has the format of its input and
// output.
//
// Loops are `connect` constraints between two sites. MuJoCo does not solve for positions and its
// inverse dynamics is not that of the actuators; so only forward dynamics is asked, and from the
// closed q and q̇, which are given. A constraint is soft: its impedance d below 1 lets the loop
// accelerate open by the fraction 1 - d. Contact, limits and warm starts are off, Jacobians dense.
#include <mujoco/mujoco.h>

#include "peer.hpp"

using peer::stop;

struct Robot {
    mjModel* model;
    mjData* data;
    // places in qpos and qvel, in the order of q, y and u
    std::vector<int> tree, independent, active;
};

static std::string site(size_t loop, const char* end) { return std::to_string(loop) + end; }

static Robot robot_of(const peer::Input& input) {
    mjSpec* spec = mj_makeSpec();
    spec->compiler.degree = false;
    spec->compiler.boundmass = spec->compiler.boundinertia = 0;
    spec->compiler.balanceinertia = spec->compiler.fusestatic = false;
    mju_copy3(spec->option.gravity, input.gravity.data());
    spec->option.solver = mjSOL_NEWTON;
    spec->option.jacobian = mjJAC_DENSE;
    spec->option.tolerance = 1e-10;
    spec->option.iterations = 100;
    spec->option.disableflags |= mjDSBL_CONTACT | mjDSBL_LIMIT | mjDSBL_WARMSTART;

    const auto add_site = [](mjsBody* body, const std::string& name, const peer::Vec3& at) {
        mjsSite* made = mjs_addSite(body, nullptr);
        mjs_setName(made->element, name.c_str());
        mju_copy3(made->pos, at.data());
    };
    const std::function<void(int, mjsBody*)> add = [&](int link, mjsBody* body) {
        const peer::Link& of = input.links[link];
        if (of.mass > 0) {
            body->explicitinertial = true;
            body->mass = of.mass;
            mju_copy3(body->ipos, of.com.p.data());
            // I in the axes of the link: R I Rᵀ
            const auto& I = of.inertia;
            const double own[3][3] = {{I[0], I[1], I[2]}, {I[1], I[3], I[4]}, {I[2], I[4], I[5]}};
            double turned[3][3] = {};
            for (int i = 0; i < 9; i++)
                for (int j = 0; j < 9; j++)
                    turned[i / 3][i % 3] += of.com.R[i / 3][j / 3] * own[j / 3][j % 3]
                        * of.com.R[i % 3][j % 3];
            // it refuses an inertia on the bound of the triangle inequality, which is a thin rod's
            const double least = 1e-12 * (I[0] + I[3] + I[5]);
            for (int i = 0; i < 3; i++) body->fullinertia[i] = turned[i][i] + least;
            body->fullinertia[3] = turned[0][1];
            body->fullinertia[4] = turned[0][2];
            body->fullinertia[5] = turned[1][2];
        }
        for (size_t l = 0; l < input.loops.size(); l++) {
            const peer::Loop& loop = input.loops[l];
            if (loop.predecessor == link) add_site(body, site(l, "p"), loop.on_predecessor.p);
            if (loop.successor == link) add_site(body, site(l, "s"), loop.on_successor.p);
        }
        for (size_t j = 0; j < input.joints.size(); j++) {
            const peer::Joint& joint = input.joints[j];
            if (joint.parent != link) continue;
            mjsBody* child = mjs_addBody(body, nullptr);
            mju_copy3(child->pos, joint.origin.p.data());
            mju_copy4(child->quat, joint.origin.quaternion().data());
            if (joint.kind != 'F') {
                mjsJoint* made = mjs_addJoint(child, nullptr);
                mjs_setName(made->element, std::to_string(j).c_str());
                made->type = joint.kind == 'R' ? mjJNT_HINGE : mjJNT_SLIDE;
                mju_copy3(made->axis, joint.axis.data());
            }
            add(joint.child, child);
        }
    };
    std::vector<bool> is_child(input.links.size(), false);
    for (const peer::Joint& joint : input.joints) is_child.at(joint.child) = true;
    for (size_t link = 0; link < input.links.size(); link++)
        if (!is_child[link])
            add(static_cast<int>(link), mjs_addBody(mjs_findBody(spec, "world"), nullptr));
    for (size_t l = 0; l < input.loops.size(); l++) {
        if (input.loops[l].held.size() < 2) stop("a loop of one row");
        mjsEquality* made = mjs_addEquality(spec, nullptr);
        made->type = mjEQ_CONNECT;
        made->objtype = mjOBJ_SITE;
        mjs_setString(made->name1, site(l, "p").c_str());
        mjs_setString(made->name2, site(l, "s").c_str());
    }

    mjModel* model = mj_compile(spec, nullptr);
    if (!model) stop(mjs_getError(spec));
    Robot robot{model, mj_makeData(model), {}, {}, {}};
    const auto places = [&](const std::vector<int>& joints) {
        std::vector<int> list;
        for (int j : joints) {
            const int joint = mj_name2id(model, mjOBJ_JOINT, std::to_string(j).c_str());
            // one coordinate a joint: the same place in qpos and qvel
            list.push_back(model->jnt_dofadr[joint]);
        }
        return list;
    };
    robot.tree = places(input.tree);
    robot.independent = places(input.independent);
    robot.active = places(input.active);
    return robot;
}

int main() {
    const peer::Input input = peer::read_input();
    const Robot robot = robot_of(input);
    mjModel* model = robot.model;
    mjData* data = robot.data;
    std::vector<double> ydd(robot.independent.size());
    std::vector<peer::Method> methods;
    for (const char* text : {"0.9", "0.99", "0.999", "0.9999"}) {
        if (input.loops.empty()) continue;
        const double impedance = std::atof(text);
        const auto call = [&, impedance](size_t k) {
            const peer::State& state = input.states[k];
            for (int i = 0; i < model->neq; i++)
                model->eq_solimp[i * mjNIMP] = model->eq_solimp[i * mjNIMP + 1] = impedance;
            for (size_t i = 0; i < robot.tree.size(); i++) {
                data->qpos[robot.tree[i]] = state.q[i];
                data->qvel[robot.tree[i]] = state.qd[i];
            }
            for (size_t i = 0; i < robot.active.size(); i++)
                data->qfrc_applied[robot.active[i]] = state.tau_u[i];
            mj_forward(model, data);
            for (size_t i = 0; i < ydd.size(); i++) ydd[i] = data->qacc[robot.independent[i]];
        };
        methods.push_back({std::string("FD mj_forward from a closed pose; dmax ") + text, call,
            ydd.data(), ydd.size()});
    }
    std::printf("engine MuJoCo %s\n", mj_versionString());
    peer::measure(methods, input);
    return 0;
}
