// A controller of motors on a CAN bridge, 1000 times a second:
// controller_1khz BRIDGE ROBOT [SECONDS].
//
// The robot, a bundled one in this process, carries its own weight: from the measured positions of
// the actuators come the independent ones, from these the forces against gravity, and a little
// damping keeps it from drifting. Start `sarrus-can run` first, and arm with `sarrus-can arm` while
// this runs. It waits for the first state, and nothing allocates after that.

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include <sarrus.hpp>

namespace {

constexpr std::chrono::microseconds cycle{1000};
/* Damping of every actuator [N m s/rad, N s/m]. */
constexpr double damping = 1.0;

int fail(const char *what, std::string_view status) {
    std::fprintf(stderr, "%s: %.*s: %s\n", what, static_cast<int>(status.size()), status.data(),
                 sarrus_last_error());
    return EXIT_FAILURE;
}

} // namespace

int main(int argc, char **argv) {
    if (argc < 3 || !sarrus::abi_matches()) {
        std::fprintf(stderr, "controller_1khz BRIDGE ROBOT [SECONDS]\n");
        return 2;
    }
    const double seconds = argc > 3 ? std::atof(argv[3]) : 5.0;

    auto robot = sarrus::robot::bundled(argv[2]);
    if (!robot) {
        return fail("robot", robot.name());
    }
    auto controller = sarrus::controller::connect(argv[1], robot->fingerprint());
    if (!controller) {
        return fail("bridge", controller.name());
    }
    if (auto done = robot->prepare_to_independent(); !done) {
        return fail("prepare", done.name());
    }
    if (auto done = robot->prepare_inverse_dynamics(); !done) {
        return fail("prepare", done.name());
    }

    const sarrus_sizes n = robot->sizes();
    const std::vector<double> rest_u(n.n_u), rest_v(n.n_vy);
    std::vector<double> y(n.n_qy), yd(n.n_vy), ydd(n.n_vy), tau_u(n.n_u);
    sarrus_actuator_state state = {};
    sarrus_actuator_command command = {};
    command.n_u = n.n_u;
    for (std::size_t k = 0; k < n.n_u; ++k) {
        command.damping[k] = damping;
    }

    const auto start = std::chrono::steady_clock::now();
    const auto cycles = static_cast<long>(seconds * 1e6 / static_cast<double>(cycle.count()));
    long sent = 0, late = 0, failed = 0;
    bool is_known = false;
    for (long k = 0; k < cycles; ++k) {
        const auto begin = start + k * cycle;
        std::this_thread::sleep_until(begin);

        // the newest state; without a new one the last commands stand
        if (auto news = controller->state(state)) {
            const sarrus::input u(state.position, n.n_u);
            auto done = robot->to_independent(u, rest_u, rest_u, y, yd, ydd);
            if (done) {
                done = robot->inverse_dynamics(y, rest_v, rest_v, tau_u);
            }
            // a pose without an answer, or not measured yet: damped until there is one
            failed += done ? 0 : 1;
            for (std::size_t i = 0; i < n.n_u; ++i) {
                command.effort[i] = done ? tau_u[i] : 0.0;
            }
            is_known = true;
        }
        if (is_known && controller->send(command)) {
            sent += 1;
        }
        late += std::chrono::steady_clock::now() > begin + cycle ? 1 : 0;
    }
    std::printf("%ld cycles, %ld sent, %ld late, %ld poses without an answer, effort", cycles,
                sent, late, failed);
    for (const double effort : tau_u) {
        std::printf(" %.17g", effort);
    }
    std::printf("\n");
    return EXIT_SUCCESS;
}
