// Times of a call: calls [SERVER], through a lane or in this process. For each line on stdin, COUNT,
// it asks so often and prints how long one call took on average [ns]; the first line that it prints
// is the answer.
#include <array>
#include <chrono>
#include <cstdio>

#include <sarrus.hpp>

int main(int argc, char **argv) {
    auto robot =
        argc > 1 ? sarrus::robot::connect(argv[1]) : sarrus::robot::bundled("lambda");
    if (!robot) {
        std::fprintf(stderr, "%s\n", sarrus_last_error());
        return 1;
    }
    auto plan = robot->prepare({.request = SARRUS_REQUEST_INVERSE_DYNAMICS,
                                .given = {"y", "yd", "ydd"},
                                .want = {"tau_u"}});
    if (!plan) {
        return 1;
    }
    std::array<double, 3> input{0.2, 1.0, 0.0};
    std::array<double, 1> tau_u{};
    if (!robot->ask(*plan, input, tau_u)) {
        return 1;
    }
    std::printf("%.17g\n", tau_u[0]);
    std::fflush(stdout);
    for (long count = 0; std::scanf("%ld", &count) == 1;) {
        const auto start = std::chrono::steady_clock::now();
        for (long k = 0; k < count; ++k) {
            if (!robot->ask(*plan, input, tau_u)) {
                return 1;
            }
        }
        const std::chrono::duration<double, std::nano> took =
            std::chrono::steady_clock::now() - start;
        std::printf("%.1f\n", took.count() / static_cast<double>(count));
        std::fflush(stdout);
    }
    return robot->release(*std::move(plan)) ? 0 : 1;
}
