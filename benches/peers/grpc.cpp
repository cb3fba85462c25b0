// gRPC beside the lanes of `sarrus-round-trip --rates`: a unary call with packed doubles through a
// Unix socket, the synchronous client and server of its quick start. The server sends the first
// numbers back and computes nothing.
//
// grpc SOCKET NUMBERS_THERE NUMBERS_BACK PROCESSOR_OF_SERVER SECONDS RATE…
// prints `engine gRPC VERSION`, then for each rate in Hz a line: the rate, and the nanoseconds of
// each call from the time at which it is due. The client runs where this process runs.
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "grpc.grpc.pb.h"

using Clock = std::chrono::steady_clock;

constexpr int WARM_UP = 200;
// as in rates.rs: sleep until so long before a call is due, then poll the clock
constexpr auto AWAKE = std::chrono::microseconds(80), LEAD = std::chrono::microseconds(1000);

struct Echo final : RoundTrip::Service {
    explicit Echo(int n_back) : n_back(n_back) {}

    grpc::Status Ask(grpc::ServerContext*, const Numbers* there, Numbers* back) override {
        for (int i = 0; i < n_back; i++) back->add_x(there->x(i));
        return grpc::Status::OK;
    }

    int n_back;
};

// Does not return; ends with the process that started it.
static void serve(const std::string& address, int n_back, int processor) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(processor, &set);
    sched_setaffinity(0, sizeof set, &set);
    Echo echo(n_back);
    grpc::ServerBuilder builder;
    builder.AddListeningPort(address, grpc::InsecureServerCredentials());
    builder.RegisterService(&echo);
    const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
    if (!server) _exit(1);
    server->Wait();
    _exit(0);
}

int main(int argc, char** argv) {
    if (argc < 7) return 2;
    const std::string address = std::string("unix:") + argv[1];
    const int n_there = std::atoi(argv[2]), n_back = std::atoi(argv[3]);
    const double seconds = std::atof(argv[5]);
    // before gRPC has threads
    const pid_t child = fork();
    if (child == 0) serve(address, n_back, std::atoi(argv[4]));

    const auto channel = grpc::CreateChannel(address, grpc::InsecureChannelCredentials());
    if (!channel->WaitForConnected(std::chrono::system_clock::now() + std::chrono::seconds(20))) {
        std::fprintf(stderr, "the server of gRPC does not start\n");
        kill(child, SIGKILL);
        return 1;
    }
    const std::unique_ptr<RoundTrip::Stub> stub = RoundTrip::NewStub(channel);
    const auto ask = [&](int k) {
        Numbers there, back;
        for (int i = 0; i < n_there; i++) there.add_x(k + i);
        grpc::ClientContext context;
        const grpc::Status status = stub->Ask(&context, there, &back);
        if (!status.ok() || back.x_size() != n_back || back.x(0) != k) {
            std::fprintf(stderr, "gRPC: %s\n", status.error_message().c_str());
            kill(child, SIGKILL);
            std::exit(1);
        }
    };
    for (int k = 0; k < WARM_UP; k++) ask(k);
    std::printf("engine gRPC %s\n", grpc::Version().c_str());
    for (int a = 6; a < argc; a++) {
        const int rate = std::atoi(argv[a]), count = static_cast<int>(seconds * rate);
        std::vector<long long> ns;
        ns.reserve(count);
        const auto first = Clock::now() + LEAD;
        for (int k = 0; k < count; k++) {
            const auto due = first + k * std::chrono::nanoseconds(1000000000 / rate);
            if (due > Clock::now() + AWAKE) std::this_thread::sleep_until(due - AWAKE);
            while (Clock::now() < due) {}
            ask(k);
            const std::chrono::nanoseconds late = Clock::now() - due;
            ns.push_back(late.count());
        }
        std::printf("%d", rate);
        for (const long long x : ns) std::printf(" %lld", x);
        std::printf("\n");
    }
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    unlink(argv[1]);
    return 0;
}
