// See transmission_interface/transmission.hpp: topics that live in this process, and log lines on
// stderr. `spin` publishes the messages that a test has queued.
#pragma once
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "sensor_msgs/msg/joint_state.hpp"

namespace rclcpp {

inline std::map<std::string, std::string> parameters;
inline std::vector<sensor_msgs::msg::JointState> queued, published;
inline std::function<void(std::shared_ptr<const sensor_msgs::msg::JointState>)> subscriber;

struct Logger {
    const char *name;
};
inline Logger get_logger(const char *name) { return {name}; }

template <class Message>
struct Publisher {
    using SharedPtr = std::shared_ptr<Publisher>;
    void publish(const Message &message) { published.push_back(message); }
};

template <class Message>
struct Subscription {
    using SharedPtr = std::shared_ptr<Subscription>;
};

class Node {
  public:
    explicit Node(const char *name) : name_(name) {}
    Logger get_logger() const { return {name_}; }
    template <class T>
    T declare_parameter(const std::string &name, T usual) {
        const auto at = parameters.find(name);
        return at == parameters.end() ? usual : T(at->second);
    }
    template <class Message>
    std::shared_ptr<Publisher<Message>> create_publisher(const std::string &, int) {
        return std::make_shared<Publisher<Message>>();
    }
    template <class Message, class Call>
    std::shared_ptr<Subscription<Message>> create_subscription(const std::string &, int,
                                                               Call call) {
        subscriber = call;
        return std::make_shared<Subscription<Message>>();
    }

  private:
    const char *name_;
};

inline void init(int, char **) {}
inline void shutdown() {}
inline void spin(const std::shared_ptr<Node> &) {
    for (const auto &message : queued) {
        subscriber(std::make_shared<const sensor_msgs::msg::JointState>(message));
    }
}

} // namespace rclcpp

#define RCLCPP_ERROR(logger, ...)                                                                  \
    ((void)(logger), (void)std::fprintf(stderr, __VA_ARGS__), (void)std::fputs("\n", stderr))
#define RCLCPP_WARN(logger, ...) RCLCPP_ERROR(logger, __VA_ARGS__)
