// A node that completes `joint_states` with the dependent joints of closed mechanisms.
#include <memory>
#include <string>

#include "rclcpp/rclcpp.hpp"
#include "sarrus_transmission/closed_transmission.hpp"
#include "sensor_msgs/msg/joint_state.hpp"

namespace sarrus_transmission {

class CompleteJointStates : public rclcpp::Node {
  public:
    CompleteJointStates()
        : Node("complete_joint_states"),
          completion_(load(declare_parameter<std::string>("urdf", ""),
                           declare_parameter<std::string>("submechanisms", ""))) {
        using sensor_msgs::msg::JointState;
        publisher_ = create_publisher<JointState>("joint_states", 10);
        subscription_ = create_subscription<JointState>(
            "measured_joint_states", 10, [this](JointState::ConstSharedPtr measured) {
                JointState all;
                all.header = measured->header;
                all.name = completion_.names();
                if (completion_.complete(measured->name, measured->position, measured->velocity,
                                         all.position, all.velocity)) {
                    publisher_->publish(all);
                } else if (failures_++ % 1000 == 0) {
                    RCLCPP_WARN(get_logger(), "no pose for the measured joints: %s",
                                std::string(sarrus::last_error()).c_str());
                }
            });
    }

  private:
    Completion completion_;
    std::size_t failures_ = 0;
    rclcpp::Publisher<sensor_msgs::msg::JointState>::SharedPtr publisher_;
    rclcpp::Subscription<sensor_msgs::msg::JointState>::SharedPtr subscription_;
};

} // namespace sarrus_transmission

int main(int argc, char **argv) {
    rclcpp::init(argc, argv);
    rclcpp::spin(std::make_shared<sarrus_transmission::CompleteJointStates>());
    rclcpp::shutdown();
    return 0;
}
