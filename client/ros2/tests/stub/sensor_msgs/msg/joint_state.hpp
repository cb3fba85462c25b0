// See transmission_interface/transmission.hpp.
#pragma once
#include <memory>
#include <string>
#include <vector>

namespace sensor_msgs::msg {

struct JointState {
    using ConstSharedPtr = std::shared_ptr<const JointState>;
    struct Header {
        long stamp = 0;
    } header;
    std::vector<std::string> name;
    std::vector<double> position, velocity, effort;
};

} // namespace sensor_msgs::msg
