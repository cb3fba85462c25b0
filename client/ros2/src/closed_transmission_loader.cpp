// The plugin: a transmission from the description of a robot.
#include <exception>
#include <memory>
#include <string>

#include "hardware_interface/hardware_info.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/rclcpp.hpp"
#include "sarrus_transmission/closed_transmission.hpp"
#include "transmission_interface/transmission_loader.hpp"

namespace sarrus_transmission {

class ClosedTransmissionLoader : public transmission_interface::TransmissionLoader {
  public:
    std::shared_ptr<transmission_interface::Transmission>
    load(const hardware_interface::TransmissionInfo &info) override {
        const auto parameter = [&](const char *name) {
            const auto at = info.parameters.find(name);
            return at == info.parameters.end() ? std::string() : at->second;
        };
        const auto scales = [](const auto &given) {
            std::vector<Scale> scales;
            for (const auto &one : given) {
                scales.push_back({one.name, one.mechanical_reduction, one.offset});
            }
            return scales;
        };
        try {
            return std::make_shared<ClosedTransmission>(
                sarrus_transmission::load(parameter("urdf"), parameter("submechanisms")),
                scales(info.joints), scales(info.actuators));
        } catch (const std::exception &error) {
            RCLCPP_ERROR(rclcpp::get_logger("sarrus_transmission"), "%s: %s", info.name.c_str(),
                         error.what());
            return nullptr;
        }
    }
};

} // namespace sarrus_transmission

PLUGINLIB_EXPORT_CLASS(sarrus_transmission::ClosedTransmissionLoader,
                       transmission_interface::TransmissionLoader)
