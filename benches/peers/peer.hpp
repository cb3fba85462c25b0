// What every peer's program shares: the robot and its states as text, and the clock.
//
// In, from standard input, numbers apart by blanks (server/report/src/peer/text.rs writes it):
//   seconds S                       how long each method is timed
//   gravity x y z
//   links N                         each: mass, x y z r p y of the centre of mass, ixx ixy ixz iyy
//                                   iyz izz; mass 0 for none
//   joints N                        each: F, R, P, S (a ball), X (free) or I (it turns a rod about
//                                   itself and stays at zero); parent link, child link, x y z r p
//                                   y, axis; damping, stiffness, rest and the rotor's inertia
//   tree n, independent n, active n each followed by joints, in the order of q, y and u
//   groups n                        each: number of joints, the joints of one closed loop, or that
//                                   stand alone
//   loops n                         each: group, predecessor link, successor link, `joint J` or
//                                   `link L` (the cut frames at zero) or
//                                   `placed` and two times x y z r p y; number of rows, six
//                                   numbers each: a held axis or a held direction
//   couplings n                     each: joint; number of joints that it follows, with multipliers;
//                                   offset
//   states n                        each: y, ẏ, ÿ, τ_u, a closed q 1 ms earlier, the closed q, q̇;
//                                   quaternions x y z w, rates of S and X in the body, ω before v
// Out: `engine NAME`, then for each method
//   run STATE|ID|FD|DID|DFD METHOD; SETTING; NANOSECONDS    and a line of numbers for each state: q,
//                                   τ_u or ÿ, these with their derivatives by y, ẏ and, of ÿ, τ_u
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <string>
#include <vector>

namespace peer {

using Vec3 = std::array<double, 3>;

[[noreturn]] inline void stop(const std::string& why) {
    std::fprintf(stderr, "%s\n", why.c_str());
    std::exit(1);
}

// A pose of a frame in another one.
struct Frame {
    std::array<Vec3, 3> R{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    Vec3 p{};

    Vec3 turn(const Vec3& x) const {
        Vec3 y;
        for (int i = 0; i < 3; i++) y[i] = R[i][0] * x[0] + R[i][1] * x[1] + R[i][2] * x[2];
        return y;
    }

    Frame operator*(const Frame& other) const {
        Frame product;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                product.R[i][j] = R[i][0] * other.R[0][j] + R[i][1] * other.R[1][j]
                    + R[i][2] * other.R[2][j];
        product.p = turn(other.p);
        for (int i = 0; i < 3; i++) product.p[i] += p[i];
        return product;
    }

    Frame inverse() const {
        Frame inverse;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) inverse.R[i][j] = R[j][i];
        inverse.p = inverse.turn(p);
        for (double& x : inverse.p) x = -x;
        return inverse;
    }

    // w, x, y, z; the largest element first, so that none is lost to cancellation
    std::array<double, 4> quaternion() const {
        const double t = R[0][0] + R[1][1] + R[2][2];
        std::array<double, 4> q{1 + t, 1 + 2 * R[0][0] - t, 1 + 2 * R[1][1] - t,
            1 + 2 * R[2][2] - t};
        const int k = static_cast<int>(std::max_element(q.begin(), q.end()) - q.begin());
        const double sums[4][4] = {
            {q[0], R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]},
            {R[2][1] - R[1][2], q[1], R[0][1] + R[1][0], R[0][2] + R[2][0]},
            {R[0][2] - R[2][0], R[0][1] + R[1][0], q[2], R[1][2] + R[2][1]},
            {R[1][0] - R[0][1], R[0][2] + R[2][0], R[1][2] + R[2][1], q[3]}};
        const double size = 1 / (2 * std::sqrt(q[k]));
        for (int i = 0; i < 4; i++) q[i] = sums[k][i] * size;
        return q;
    }
};

struct Link {
    double mass;
    Frame com;
    // ixx ixy ixz iyy iyz izz about the centre of mass, in the axes of `com`
    std::array<double, 6> inertia;
};

struct Joint {
    char kind;
    int parent, child;
    Frame origin;
    Vec3 axis;
    double damping, stiffness, rest, rotor;

    int n_q() const { return kind == 'X' ? 7 : kind == 'S' ? 4 : kind != 'F'; }
    int n_v() const { return kind == 'X' ? 6 : kind == 'S' ? 3 : kind != 'F'; }
};

struct Loop {
    int group, predecessor, successor;
    Frame on_predecessor, on_successor;
    // directions of the predecessor's frame along which the ends may not part, and axes about which
    // they may not turn
    std::vector<Vec3> held, fixed;
};

// A joint at a sum of multiples of others and an offset.
struct Coupling {
    int joint;
    std::vector<std::pair<int, double>> terms;
    double offset;
};

struct State {
    std::vector<double> y, yd, ydd, tau_u, guess, q, qd;
};

struct Input {
    double seconds;
    Vec3 gravity;
    std::vector<Link> links;
    std::vector<Joint> joints;
    std::vector<int> tree, independent, active;
    std::vector<std::vector<int>> groups;
    std::vector<Loop> loops;
    std::vector<Coupling> couplings;
    std::vector<State> states;
};

inline void expect(const char* word) {
    std::string found;
    if (!(std::cin >> found) || found != word)
        stop("expected `" + std::string(word) + "`, found `" + found + "`");
}

template <class T>
T read() {
    T value;
    if (!(std::cin >> value)) stop("the input ends early");
    return value;
}

template <size_t N>
std::array<double, N> read_numbers() {
    std::array<double, N> x;
    for (double& value : x) value = read<double>();
    return x;
}

inline std::vector<int> read_list() {
    std::vector<int> list(read<int>());
    for (int& x : list) x = read<int>();
    return list;
}

// Translation, then roll, pitch, yaw about fixed axes.
inline Frame read_frame() {
    Frame frame;
    frame.p = read_numbers<3>();
    const Vec3 a = read_numbers<3>();
    const double sr = std::sin(a[0]), cr = std::cos(a[0]), sp = std::sin(a[1]), cp = std::cos(a[1]),
                 sy = std::sin(a[2]), cy = std::cos(a[2]);
    frame.R = {{{cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr},
        {sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr}, {-sp, cp * sr, cp * cr}}};
    return frame;
}

// A robot for a program that knows joints F, R and P without springs, dampers, rotors and
// couplings, and loops that hold no angle; for one that knows all of them with `is_general`.
inline Input read_input(bool is_general = false) {
    Input input;
    const auto needs = [&](bool is_special) {
        if (is_special && !is_general)
            stop("it knows no joints of several freedoms, no springs, dampers, rotors and "
                 "couplings, and no loops that hold angles");
    };
    expect("seconds");
    input.seconds = read<double>();
    expect("gravity");
    input.gravity = read_numbers<3>();
    expect("links");
    for (int n = read<int>(); n > 0; n--) {
        const double mass = read<double>();
        const Frame com = read_frame();
        input.links.push_back({mass, com, read_numbers<6>()});
    }
    expect("joints");
    for (int n = read<int>(); n > 0; n--) {
        Joint joint;
        joint.kind = read<char>();
        joint.parent = read<int>();
        joint.child = read<int>();
        joint.origin = read_frame();
        joint.axis = read_numbers<3>();
        const double length = std::hypot(joint.axis[0], joint.axis[1], joint.axis[2]);
        for (double& x : joint.axis) x /= length;
        joint.damping = read<double>();
        joint.stiffness = read<double>();
        joint.rest = read<double>();
        joint.rotor = read<double>();
        needs(std::string("FRP").find(joint.kind) == std::string::npos || joint.damping != 0
            || joint.stiffness != 0 || joint.rotor != 0);
        input.joints.push_back(joint);
    }
    expect("tree");
    input.tree = read_list();
    expect("independent");
    input.independent = read_list();
    expect("active");
    input.active = read_list();
    expect("groups");
    for (int n = read<int>(); n > 0; n--) input.groups.push_back(read_list());

    // poses of links at zero; a parent may come after its child
    std::vector<Frame> at_zero(input.links.size());
    for (size_t link = 0; link < input.links.size(); link++) {
        int at = static_cast<int>(link);
        for (bool is_child = true; is_child;) {
            is_child = false;
            for (const Joint& joint : input.joints)
                if (joint.child == at) {
                    at_zero[link] = joint.origin * at_zero[link];
                    at = joint.parent;
                    is_child = true;
                    break;
                }
        }
    }
    expect("loops");
    for (int n = read<int>(); n > 0; n--) {
        Loop loop;
        loop.group = read<int>();
        loop.predecessor = read<int>();
        loop.successor = read<int>();
        const std::string where = read<std::string>();
        if (where == "placed") {
            loop.on_predecessor = read_frame();
            loop.on_successor = read_frame();
        } else {
            const int at = read<int>();
            const Frame cut = at_zero.at(where == "joint" ? input.joints.at(at).child : at);
            loop.on_predecessor = at_zero.at(loop.predecessor).inverse() * cut;
            loop.on_successor = at_zero.at(loop.successor).inverse() * cut;
        }
        for (int rows = read<int>(); rows > 0; rows--) {
            const Vec3 axis = read_numbers<3>(), direction = read_numbers<3>();
            const bool turns = axis != Vec3{};
            if (turns && direction != Vec3{}) stop("a row holds an axis and a direction");
            needs(turns);
            (turns ? loop.fixed : loop.held).push_back(turns ? axis : direction);
        }
        input.loops.push_back(loop);
    }
    expect("couplings");
    for (int n = read<int>(); n > 0; n--) {
        needs(true);
        Coupling coupling{read<int>(), {}, 0};
        for (int terms = read<int>(); terms > 0; terms--) {
            const int joint = read<int>();
            coupling.terms.emplace_back(joint, read<double>());
        }
        coupling.offset = read<double>();
        input.couplings.push_back(coupling);
    }
    expect("states");
    for (int n = read<int>(); n > 0; n--) {
        const auto zeros = [&](const std::vector<int>& joints, bool positions) {
            size_t n = 0;
            for (int j : joints) n += positions ? input.joints[j].n_q() : input.joints[j].n_v();
            return std::vector<double>(n);
        };
        const auto y = zeros(input.independent, true), yd = zeros(input.independent, false),
                   q = zeros(input.tree, true), qd = zeros(input.tree, false);
        State state{y, yd, yd, zeros(input.active, false), q, q, qd};
        for (auto* x : {&state.y, &state.yd, &state.ydd, &state.tau_u, &state.guess, &state.q,
                 &state.qd})
            for (double& value : *x) value = read<double>();
        input.states.push_back(state);
    }
    if (input.states.empty()) stop("no states");
    return input;
}

// --- measuring -----------------------------------------------------------------------------------

// A method with one setting, what its batches took per call, and which states a batch goes through.
struct Method {
    std::string name;
    // called with the index of a state; writes the answer
    std::function<void(size_t)> call;
    const double* answer;
    size_t n_numbers;
    std::vector<double> ns = {};
    size_t first = 0, n_states = 0, warm_up = 0;
};

// Batches are short: a long one is interrupted on a machine that others use too. Untimed calls
// before each: the others had the caches.
constexpr double BATCH_NS = 200e3, WARM_UP_NS = 80e3;

// Batches of all methods take turns, so that what else the machine does meets all of them; then
// medians and answers.
inline void measure(std::vector<Method>& methods, const Input& input) {
    using Clock = std::chrono::steady_clock;
    const auto ns_since = [](Clock::time_point start) {
        return std::chrono::duration<double, std::nano>(Clock::now() - start).count();
    };
    const size_t n_states = input.states.size();
    for (Method& method : methods) {
        method.call(0);
        const auto start = Clock::now();
        for (size_t i = 0; i < 4; i++) method.call(i % n_states);
        const double call = ns_since(start) / 4;
        method.n_states = std::min<size_t>(n_states, std::clamp(BATCH_NS / call, 4.0, 64.0));
        method.warm_up = static_cast<size_t>(std::ceil(WARM_UP_NS / call));
    }
    const double whole = 1e9 * input.seconds * methods.size();
    const auto begin = Clock::now();
    // five rounds at least, fewer where a single one takes longer than all should
    for (int round = 0; round < 1 || ns_since(begin) < whole
         || (round < 5 && ns_since(begin) < 3 * whole);
         round++)
        for (Method& method : methods) {
            for (size_t i = 0; i < method.warm_up; i++)
                method.call((method.first + i) % n_states);
            const auto start = Clock::now();
            for (size_t i = 0; i < method.n_states; i++)
                method.call((method.first + i) % n_states);
            method.ns.push_back(ns_since(start) / method.n_states);
            method.first = (method.first + method.n_states) % n_states;
        }
    for (Method& method : methods) {
        std::nth_element(method.ns.begin(), method.ns.begin() + method.ns.size() / 2,
            method.ns.end());
        std::printf("run %s; %.17g\n", method.name.c_str(), method.ns[method.ns.size() / 2]);
        for (size_t state = 0; state < n_states; state++) {
            method.call(state);
            for (size_t i = 0; i < method.n_numbers; i++) std::printf("%.17g ", method.answer[i]);
            std::printf("\n");
        }
    }
}

} // namespace peer
