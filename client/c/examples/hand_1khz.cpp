// A hand that goes up and down 1000 times a second: hand_1khz NAME [FRAME [SECONDS]].
//
// Each millisecond the server computes the pose and the twist of a frame, and then the step of a
// motion: the accelerations that move the hand to its target, and the forces of the motors for
// them, within all limits. Here are no motors; the robot does as the step says. Start
// `sarrus serve` with a robot of a fixed base first; controller_1khz.cpp shows the way to motors.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include <sarrus.hpp>

namespace {

constexpr double dt = 1e-3;
/* How far the hand goes up [m], and its angular frequency [rad/s]. */
constexpr double swing = 0.1;
constexpr double w = 3.14159265358979323846;
/* How stiffly it follows: v' = v'* + K (p* - p) + D (v* - v) [1/s^2, 1/s]. */
constexpr double stiffness = 400.0, damping = 40.0;
/* Damping of all joints in the room that the hand leaves [1/s]. */
constexpr double joint_damping = 4.0;
/* Where each joint begins [rad, m]. */
constexpr double start_y = 0.2;

int fail(const char *what, std::string_view status) {
    std::fprintf(stderr, "%s: %.*s: %s\n", what, static_cast<int>(status.size()), status.data(),
                 sarrus_last_error());
    return EXIT_FAILURE;
}

/* 2 times the vector of b a^-1, of unit quaternions x, y, z, w: the small rotation from a to b in
   the root's axes. */
void turn(const double *a, const double *b, double *by) {
    const double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        const double part = b[i] * a[3] - b[3] * a[i] + b[k] * a[j] - b[j] * a[k];
        by[i] = std::copysign(2.0, cosine) * part;
    }
}

} // namespace

int main(int argc, char **argv) {
    if (argc < 2 || !sarrus::abi_matches()) {
        std::fprintf(stderr, "hand_1khz NAME [FRAME [SECONDS]]\n");
        return 2;
    }
    auto robot = sarrus::robot::connect(argv[1]);
    if (!robot) {
        return fail("robot", robot.name());
    }
    const char *hand = argc > 2 ? argv[2] : robot->names(SARRUS_ORDER_LINKS).back().data();
    const double seconds = argc > 3 ? std::atof(argv[3]) : 5.0;

    sarrus::query question;
    question.given = {"y", "yd"};
    question.want = {"frame_pose", "frame_twist"};
    question.frames = {hand};
    auto look = robot->prepare(question);
    if (!look) {
        return fail("look", look.name());
    }
    question.request = SARRUS_REQUEST_STEP;
    question.given = {"y", "yd", "ydd", "dt"};
    question.want = {"ydd", "tau_u"};
    question.tasks = {SARRUS_TASK_PART_POSITION | SARRUS_TASK_PART_ORIENTATION};
    auto step = robot->prepare(question);
    if (!step) {
        return fail("step", step.name());
    }
    std::vector<double> input(step->inputs()), moved(step->outputs());
    const auto at = [&](const char *field) { return input.data() + step->given(field)->offset; };
    double *const y = at("y"), *const yd = at("yd"), *const ydd = at("ydd");
    double *const task = at("task_motion");
    *at("dt") = dt;
    const std::size_t n = robot->sizes().n_vy;
    std::vector<double> state(2 * n);
    std::fill_n(state.begin(), n, start_y);
    // the pose (7) and the twist (6) of the hand
    std::vector<double> seen(look->outputs());
    if (auto done = robot->ask(*look, state, seen); !done) {
        return fail("start", done.name());
    }
    const std::vector<double> start = seen;

    // nothing allocates after this line
    const long cycles = static_cast<long>(seconds / dt);
    const auto begin = std::chrono::steady_clock::now();
    long late = 0;
    double farthest = 0.0;
    for (long cycle = 0; cycle < cycles; ++cycle) {
        const auto due = begin + cycle * std::chrono::milliseconds(1);
        std::this_thread::sleep_until(due);
        if (auto done = robot->ask(*look, state, seen); !done) {
            return fail("look", done.name());
        }

        // the wanted acceleration of the hand: of its rotation, then of its origin, with weight 1
        const double t = dt * static_cast<double>(cycle), half = 0.5 * swing;
        const double target[3] = {start[0], start[1], start[2] + half * (1.0 - std::cos(w * t))};
        const double rate[3] = {0.0, 0.0, half * w * std::sin(w * t)};
        const double more[3] = {0.0, 0.0, half * w * w * std::cos(w * t)};
        double by[3], away = 0.0;
        turn(&seen[3], &start[3], by);
        for (int k = 0; k < 3; ++k) {
            const double off = target[k] - seen[k];
            away += off * off;
            task[k] = stiffness * by[k] - damping * seen[7 + k];
            task[3 + k] = more[k] + stiffness * off + damping * (rate[k] - seen[10 + k]);
        }
        task[6] = 1.0;
        farthest = std::max(farthest, std::sqrt(away));

        for (std::size_t i = 0; i < n; ++i) {
            y[i] = state[i];
            yd[i] = state[n + i];
            ydd[i] = -joint_damping * state[n + i];
        }
        if (auto done = robot->ask(*step, input, moved); !done) {
            return fail("step", done.name());
        }
        // the motors would get tau_u, which stands behind the accelerations
        for (std::size_t i = 0; i < n; ++i) {
            state[i] += dt * (state[n + i] + 0.5 * dt * moved[i]);
            state[n + i] += dt * moved[i];
        }
        late += std::chrono::steady_clock::now() > due + std::chrono::milliseconds(1) ? 1 : 0;
    }
    std::printf("%ld cycles, %ld late\nfarthest from its target: %.17g\ntau_u: [", cycles, late,
                farthest);
    for (std::size_t k = n; k < moved.size(); ++k) {
        std::printf("%s%.17g", k == n ? "" : ", ", moved[k]);
    }
    std::printf("]\n");
    return EXIT_SUCCESS;
}
