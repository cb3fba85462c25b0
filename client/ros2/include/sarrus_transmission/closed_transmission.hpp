// A mechanism with closed loops as a transmission of ros2_control, and its dependent joints.
#ifndef SARRUS_TRANSMISSION_CLOSED_TRANSMISSION_HPP
#define SARRUS_TRANSMISSION_CLOSED_TRANSMISSION_HPP

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sarrus.hpp>

#include "transmission_interface/transmission.hpp"

namespace sarrus_transmission {

/// A robot from a file, or one that comes with the library where its name has no dot.
inline sarrus::robot load(const std::string &urdf, const std::string &submechanisms) {
    if (!sarrus::abi_matches()) {
        throw std::runtime_error("libsarrus has another ABI than the header of this package");
    }
    auto loaded = urdf.find('.') == std::string::npos
                      ? sarrus::robot::bundled(urdf.c_str())
                      : sarrus::robot::load(urdf.c_str(), submechanisms.empty()
                                                              ? nullptr
                                                              : submechanisms.c_str());
    if (!loaded) {
        throw std::runtime_error(std::string(sarrus::last_error()));
    }
    return *std::move(loaded);
}

/// A query of the robot, which throws where it has no plan.
inline sarrus::plan prepared(sarrus::robot &robot, const sarrus::query &query) {
    auto plan = robot.prepare(query);
    if (!plan) {
        throw std::runtime_error(std::string(sarrus::last_error()));
    }
    return *std::move(plan);
}

/// Gear and zero of a joint or motor beyond those of the model.
struct Scale {
    std::string name;
    double reduction = 1.0;
    double offset = 0.0;
};

/// Joints are the independents of a robot, actuators its actuators: u(y), u̇ = G_u ẏ and τ_y = G_uᵀ
/// τ_u, exactly and with no allocation after `configure`. A pose that the mechanism does not reach
/// leaves NaN in every value that depends on it, and `last_status` says why.
class ClosedTransmission : public transmission_interface::Transmission {
  public:
    /// `joints` and `actuators` in any order; they are all independents and all actuators.
    ClosedTransmission(sarrus::robot robot, const std::vector<Scale> &joints,
                       const std::vector<Scale> &actuators)
        : robot_(std::move(robot)), joints_(ordered(SARRUS_ORDER_INDEPENDENT, joints)),
          actuators_(ordered(SARRUS_ORDER_ACTIVE, actuators)) {}

    void configure(const std::vector<transmission_interface::JointHandle> &joints,
                   const std::vector<transmission_interface::ActuatorHandle> &actuators) override {
        for (std::size_t kind = 0; kind < KINDS.size(); ++kind) {
            joint_values_[kind] = handles(joints, joints_, KINDS[kind]);
            actuator_values_[kind] = handles(actuators, actuators_, KINDS[kind]);
            if (joint_values_[kind].empty() != actuator_values_[kind].empty()) {
                throw std::runtime_error(std::string("only joints or only actuators have `") +
                                         KINDS[kind] + "`");
            }
        }
        if (joint_values_[POSITION].empty()) {
            throw std::runtime_error("velocity and effort change over the pose: give positions");
        }
        const std::array<const char *, 3> of_joints{"y", "yd", "tau_y"};
        const std::array<const char *, 3> of_actuators{"u", "ud", "tau_u"};
        sarrus::query forth{.request = SARRUS_REQUEST_MAP};
        sarrus::query back{.request = SARRUS_REQUEST_MAP};
        for (std::size_t kind = 0; kind < KINDS.size(); ++kind) {
            if (!joint_values_[kind].empty()) {
                forth.given.push_back(of_joints[kind]);
                forth.want.push_back(of_actuators[kind]);
                back.given.push_back(of_actuators[kind]);
                back.want.push_back(of_joints[kind]);
            }
        }
        // the pose before chooses between two that have the same actuators
        back.given.push_back("q_guess");
        back.want.push_back("q");
        to_actuators_ = way(forth);
        to_joints_ = way(back);
        for (std::size_t kind = 0; kind < KINDS.size(); ++kind) {
            if (!joint_values_[kind].empty()) {
                to_actuators_.in[kind] = *to_actuators_.plan.given(of_joints[kind]);
                to_actuators_.out[kind] = *to_actuators_.plan.want(of_actuators[kind]);
                to_joints_.in[kind] = *to_joints_.plan.given(of_actuators[kind]);
                to_joints_.out[kind] = *to_joints_.plan.want(of_joints[kind]);
            }
        }
        guess_ = *to_joints_.plan.given("q_guess");
        found_ = *to_joints_.plan.want("q");
    }

    void actuator_to_joint() override {
        carry(to_joints_, actuator_values_, actuators_, joint_values_, joints_);
        const auto pose = to_joints_.output.begin() + static_cast<std::ptrdiff_t>(found_.offset);
        if (status_ == SARRUS_STATUS_OK) {
            std::copy_n(pose, guess_.rows, to_joints_.input.begin() +
                                               static_cast<std::ptrdiff_t>(guess_.offset));
        }
    }

    void joint_to_actuator() override {
        carry(to_actuators_, joint_values_, joints_, actuator_values_, actuators_);
    }

    std::size_t num_actuators() const override { return actuators_.size(); }
    std::size_t num_joints() const override { return joints_.size(); }

    /// How the last map ended.
    sarrus_status last_status() const noexcept { return status_; }

  private:
    static constexpr std::array<const char *, 3> KINDS{"position", "velocity", "effort"};
    static constexpr std::size_t POSITION = 0;
    static constexpr std::size_t EFFORT = 2;

    /// A plan with its numbers, and the places of position, velocity and effort in them.
    struct Way {
        sarrus::plan plan;
        std::vector<double> input;
        std::vector<double> output;
        std::array<sarrus_slot, 3> in{};
        std::array<sarrus_slot, 3> out{};
    };

    Way way(const sarrus::query &query) {
        Way way;
        way.plan = prepared(robot_, query);
        way.input.resize(way.plan.inputs(), 0.0);
        way.output.resize(way.plan.outputs(), 0.0);
        return way;
    }

    /// The given ones in the order of the model.
    std::vector<Scale> ordered(sarrus_order order, const std::vector<Scale> &given) const {
        std::vector<Scale> found;
        for (const std::string_view name : robot_.names(order)) {
            const auto is_it = [&](const Scale &scale) { return scale.name == name; };
            const auto at = std::find_if(given.begin(), given.end(), is_it);
            if (at == given.end()) {
                throw std::runtime_error("the transmission lacks `" + std::string(name) + "`");
            }
            if (at->reduction == 0.0) {
                throw std::runtime_error("the reduction of `" + std::string(name) + "` is zero");
            }
            found.push_back(*at);
        }
        if (found.size() != given.size()) {
            throw std::runtime_error("the transmission has joints or actuators that are not those "
                                     "of the mechanism");
        }
        return found;
    }

    /// The handles of one interface in the order of the model; all or none.
    template <class Handle>
    static std::vector<Handle> handles(const std::vector<Handle> &given,
                                       const std::vector<Scale> &order, const char *kind) {
        std::vector<Handle> found;
        for (const Scale &scale : order) {
            for (const Handle &handle : given) {
                if (handle.get_prefix_name() == scale.name && handle.get_interface_name() == kind) {
                    found.push_back(handle);
                    break;
                }
            }
        }
        if (!found.empty() && found.size() != order.size()) {
            throw std::runtime_error(std::string("some lack the interface `") + kind + "`");
        }
        return found;
    }

    template <class From, class To>
    void carry(Way &way, std::array<std::vector<From>, 3> &from, const std::vector<Scale> &scales,
               std::array<std::vector<To>, 3> &to, const std::vector<Scale> &other) {
        for (std::size_t kind = 0; kind < KINDS.size(); ++kind) {
            for (std::size_t k = 0; k < from[kind].size(); ++k) {
                const double x = from[kind][k].get_value();
                way.input[way.in[kind].offset + k] =
                    kind == EFFORT ? x * scales[k].reduction
                                   : (x - (kind == POSITION ? scales[k].offset : 0.0)) /
                                         scales[k].reduction;
            }
        }
        status_ = robot_.ask(way.plan, way.input, way.output).status;
        for (std::size_t kind = 0; kind < KINDS.size(); ++kind) {
            for (std::size_t k = 0; k < to[kind].size(); ++k) {
                const double x = status_ == SARRUS_STATUS_OK
                                     ? way.output[way.out[kind].offset + k]
                                     : std::numeric_limits<double>::quiet_NaN();
                to[kind][k].set_value(kind == EFFORT
                                          ? x / other[k].reduction
                                          : x * other[k].reduction +
                                                (kind == POSITION ? other[k].offset : 0.0));
            }
        }
    }

    sarrus::robot robot_;
    std::vector<Scale> joints_;
    std::vector<Scale> actuators_;
    std::array<std::vector<transmission_interface::JointHandle>, 3> joint_values_;
    std::array<std::vector<transmission_interface::ActuatorHandle>, 3> actuator_values_;
    Way to_actuators_;
    Way to_joints_;
    sarrus_slot guess_{};
    sarrus_slot found_{};
    sarrus_status status_ = SARRUS_STATUS_OK;
};

/// The whole tree from the joints that somebody publishes: the independents or the actuators.
class Completion {
  public:
    explicit Completion(sarrus::robot robot)
        : robot_(std::move(robot)), names_(texts(SARRUS_ORDER_TREE)),
          independents_(texts(SARRUS_ORDER_INDEPENDENT)), actuators_(texts(SARRUS_ORDER_ACTIVE)) {
        if (robot_.sizes().n_q != robot_.sizes().n_v) {
            throw std::runtime_error("a floating or ball joint has no place in joint states");
        }
        const auto of = [&](const char *x, const char *xd) {
            return prepared(robot_, {.request = SARRUS_REQUEST_KINEMATICS,
                                     .given = {x, xd},
                                     .want = {"q", "qd"}});
        };
        from_independents_ = of("y", "yd");
        from_actuators_ = of("u", "ud");
    }

    /// The names of `position` and `velocity`.
    const std::vector<std::string> &names() const noexcept { return names_; }

    /// Positions and velocities of all joints from those of some; false where these are neither
    /// all independents nor all actuators, or no pose has them.
    bool complete(const std::vector<std::string> &names, const std::vector<double> &positions,
                  const std::vector<double> &velocities, std::vector<double> &position,
                  std::vector<double> &velocity) {
        const bool has_y = read(independents_, names, positions, velocities);
        if (!has_y && !read(actuators_, names, positions, velocities)) {
            return false;
        }
        const sarrus::plan &plan = has_y ? from_independents_ : from_actuators_;
        output_.resize(2 * names_.size());
        const bool is_there = static_cast<bool>(robot_.ask(plan, input_, output_));
        const auto half = output_.begin() + static_cast<std::ptrdiff_t>(names_.size());
        position.assign(output_.begin(), half);
        velocity.assign(half, output_.end());
        return is_there;
    }

  private:
    std::vector<std::string> texts(sarrus_order order) const {
        const auto names = robot_.names(order);
        return {names.begin(), names.end()};
    }

    /// Packs the numbers of the wanted names; false where one is missing.
    bool read(const std::vector<std::string> &wanted, const std::vector<std::string> &names,
              const std::vector<double> &positions, const std::vector<double> &velocities) {
        input_.assign(2 * wanted.size(), 0.0);
        for (std::size_t k = 0; k < wanted.size(); ++k) {
            const auto at = std::find(names.begin(), names.end(), wanted[k]);
            const auto place = static_cast<std::size_t>(at - names.begin());
            if (at == names.end() || place >= positions.size()) {
                return false;
            }
            input_[k] = positions[place];
            input_[wanted.size() + k] = place < velocities.size() ? velocities[place] : 0.0;
        }
        return true;
    }

    sarrus::robot robot_;
    std::vector<std::string> names_;
    std::vector<std::string> independents_;
    std::vector<std::string> actuators_;
    sarrus::plan from_independents_;
    sarrus::plan from_actuators_;
    std::vector<double> input_;
    std::vector<double> output_;
};

} // namespace sarrus_transmission

#endif
