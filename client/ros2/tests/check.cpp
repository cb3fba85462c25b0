// The transmission and the node against the stub of ROS: prints nothing where all is well.
#include <cmath>
#include <cstdlib>
#include <new>

#include "rclcpp/rclcpp.hpp"
#define main node_main
#include "../src/complete_joint_states.cpp"
#undef main
#include "../src/closed_transmission_loader.cpp"

static std::size_t allocations = 0;

[[gnu::noinline]] void *operator new(std::size_t size) {
    ++allocations;
    if (void *block = std::malloc(size)) {
        return block;
    }
    throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void *block) noexcept { std::free(block); }
[[gnu::noinline]] void operator delete(void *block, std::size_t) noexcept { std::free(block); }

#define CHECK(x)                                                                                   \
    ((x) ? (void)0 : (std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #x), std::exit(1)))

using transmission_interface::ActuatorHandle;
using transmission_interface::JointHandle;

static const char *const KINDS[] = {"position", "velocity", "effort"};

// joints and actuators of the ankle, these with a gear, in another order than the model's
struct Ankle {
    hardware_interface::TransmissionInfo info{
        .name = "ankle",
        .type = "sarrus_transmission/ClosedTransmission",
        .joints = {{"AnkleRoll", 1.0, 0.1}, {"AnklePitch", 1.0, 0.0}},
        .actuators = {{"AnkleActR", 20.0, 0.0}, {"AnkleActL", -20.0, 0.5}},
        .parameters = {{"urdf", "ankle"}},
    };
    double joints[2][3] = {{0.15, 0.7, 2.0}, {0.1, -0.4, -3.0}};
    double actuators[2][3] = {};

    std::vector<JointHandle> joint_handles(std::size_t kinds) {
        std::vector<JointHandle> handles;
        for (std::size_t j = 0; j < 2; ++j) {
            for (std::size_t k = 0; k < kinds; ++k) {
                handles.emplace_back(info.joints[j].name, KINDS[k], &joints[j][k]);
            }
        }
        return handles;
    }
    std::vector<ActuatorHandle> actuator_handles(std::size_t kinds) {
        std::vector<ActuatorHandle> handles;
        for (std::size_t j = 0; j < 2; ++j) {
            for (std::size_t k = 0; k < kinds; ++k) {
                handles.emplace_back(info.actuators[j].name, KINDS[k], &actuators[j][k]);
            }
        }
        return handles;
    }
};

static void there_and_back() {
    Ankle ankle;
    const auto transmission = made_plugin()->load(ankle.info);
    CHECK(transmission && transmission->num_joints() == 2 && transmission->num_actuators() == 2);
    transmission->configure(ankle.joint_handles(3), ankle.actuator_handles(3));
    transmission->joint_to_actuator();
    // the motors by the library: y is pitch, roll
    auto robot = *sarrus::robot::bundled("ankle");
    const double y[] = {0.1, 0.05}, yd[] = {-0.4, 0.7}, none[] = {0.0, 0.0};
    double u[2], ud[2], udd[2];
    CHECK(robot.to_actuators(y, yd, none, u, ud, udd));
    CHECK(std::abs(ankle.actuators[0][0] - 20.0 * u[1]) < 1e-12);
    CHECK(std::abs(ankle.actuators[1][0] - (0.5 - 20.0 * u[0])) < 1e-12);
    CHECK(std::abs(ankle.actuators[0][1] - 20.0 * ud[1]) < 1e-12);
    double power[2] = {};
    for (int j = 0; j < 2; ++j) {
        power[0] += ankle.joints[j][1] * ankle.joints[j][2];
        power[1] += ankle.actuators[j][1] * ankle.actuators[j][2];
    }
    CHECK(std::abs(power[0] - power[1]) < 1e-11);
    double before[2][3];
    std::copy_n(&ankle.joints[0][0], 6, &before[0][0]);
    std::fill_n(&ankle.joints[0][0], 6, 0.0);
    const std::size_t allocated = allocations;
    for (int k = 0; k < 100; ++k) {
        transmission->actuator_to_joint();
        transmission->joint_to_actuator();
    }
    CHECK(allocations == allocated);
    for (int k = 0; k < 6; ++k) {
        CHECK(std::abs((&ankle.joints[0][0])[k] - (&before[0][0])[k]) < 1e-9);
    }
    // what no pose has is no number
    ankle.actuators[0][0] = 1e3;
    transmission->actuator_to_joint();
    CHECK(std::isnan(ankle.joints[0][0]) && std::isnan(ankle.joints[1][2]));
    ankle.actuators[0][0] = 20.0 * u[1];
    transmission->actuator_to_joint();
    CHECK(std::abs(ankle.joints[1][0] - 0.1) < 1e-9);
}

static void faults() {
    const auto fails = [](auto change, std::size_t joints, std::size_t actuators) {
        Ankle ankle;
        change(ankle.info);
        const auto transmission = made_plugin()->load(ankle.info);
        if (!transmission) {
            return true;
        }
        try {
            transmission->configure(ankle.joint_handles(joints),
                                    ankle.actuator_handles(actuators));
        } catch (const std::runtime_error &) {
            return true;
        }
        return false;
    };
    const auto same = [](auto &) {};
    CHECK(!fails(same, 1, 1) && fails(same, 2, 1) && fails(same, 0, 0));
    CHECK(fails([](auto &info) { info.joints[0].name = "Knee"; }, 3, 3));
    CHECK(fails([](auto &info) { info.joints.pop_back(); }, 3, 3));
    CHECK(fails([](auto &info) { info.actuators[0].mechanical_reduction = 0.0; }, 3, 3));
    CHECK(fails([](auto &info) { info.parameters["urdf"] = "nothing.urdf"; }, 3, 3));
}

static void node() {
    rclcpp::parameters["urdf"] = "ankle";
    sensor_msgs::msg::JointState measured;
    measured.name = {"Knee", "AnkleRoll", "AnklePitch"};
    measured.position = {3.0, 0.05, 0.1};
    measured.velocity = {0.0, 0.7, -0.4};
    rclcpp::queued.push_back(measured);
    measured.name = {"Knee"};
    rclcpp::queued.push_back(measured);
    CHECK(node_main(0, nullptr) == 0);
    CHECK(rclcpp::published.size() == 1);
    const auto &all = rclcpp::published[0];
    auto robot = *sarrus::robot::bundled("ankle");
    const double y[] = {0.1, 0.05}, yd[] = {-0.4, 0.7}, none[] = {0.0, 0.0};
    double q[8], qd[8], qdd[8];
    CHECK(robot.state(y, yd, none, q, qd, qdd));
    const auto names = robot.names(SARRUS_ORDER_TREE);
    for (std::size_t k = 0; k < 8; ++k) {
        CHECK(all.name[k] == names[k]);
        CHECK(all.position[k] == q[k] && std::abs(all.velocity[k] - qd[k]) < 1e-14);
    }
}

int main() {
    there_and_back();
    faults();
    node();
    return 0;
}
