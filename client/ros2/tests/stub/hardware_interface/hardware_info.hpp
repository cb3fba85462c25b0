// See transmission_interface/transmission.hpp.
#pragma once
#include <string>
#include <unordered_map>
#include <vector>

namespace hardware_interface {

struct JointInfo {
    std::string name;
    double mechanical_reduction = 1.0;
    double offset = 0.0;
};

using ActuatorInfo = JointInfo;

struct TransmissionInfo {
    std::string name;
    std::string type;
    std::vector<JointInfo> joints;
    std::vector<ActuatorInfo> actuators;
    std::unordered_map<std::string, std::string> parameters;
};

} // namespace hardware_interface
