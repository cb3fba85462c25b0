/*
 * sarrus from C++20: the functions of sarrus.h with spans, results that must be looked at, and
 * handles that free themselves. Header only; needs no exceptions. What a function means, its shapes
 * and units, stands in sarrus.h at the function of the same name.
 */
#ifndef SARRUS_HPP
#define SARRUS_HPP

#if __cplusplus <= 201703L
#error "sarrus.hpp is C++20: compile with -std=c++20 (in CMake cxx_std_20), or include sarrus.h"
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sarrus.h"

namespace sarrus {

/* Numbers that are read, and numbers that are written. */
using input = std::span<const double>;
using output = std::span<double>;

/* Name of a status. */
inline std::string_view name(sarrus_status status) noexcept { return sarrus_status_name(status); }

/* What led to this thread's last status other than SARRUS_STATUS_OK. */
inline std::string_view last_error() noexcept { return sarrus_last_error(); }

/* True where this header and the library are of one kind; a program must not go on otherwise. */
[[nodiscard]] inline bool abi_matches() noexcept {
    return sarrus_abi_version() == SARRUS_ABI_VERSION;
}

/* How a call ended: true where it went well. Never allocates. */
struct [[nodiscard]] outcome {
    sarrus_status status = SARRUS_STATUS_OK;
    /* Bits of sarrus_warning. */
    std::uint32_t warnings = 0;

    explicit operator bool() const noexcept { return status == SARRUS_STATUS_OK; }
    std::string_view name() const noexcept { return sarrus::name(status); }
    bool warns(sarrus_warning warning) const noexcept { return (warnings & warning) != 0; }
};

/* A handle, or why there is none. An empty handle is safe: its calls end with null_pointer. */
template <class T>
class [[nodiscard]] result {
  public:
    result(sarrus_status status, T value) noexcept : status_(status), value_(std::move(value)) {}

    explicit operator bool() const noexcept { return status_ == SARRUS_STATUS_OK; }
    sarrus_status status() const noexcept { return status_; }
    std::string_view name() const noexcept { return sarrus::name(status_); }
    T &operator*() & noexcept { return value_; }
    T operator*() && noexcept { return std::move(value_); }
    const T &operator*() const & noexcept { return value_; }
    T *operator->() & noexcept { return &value_; }
    const T *operator->() const & noexcept { return &value_; }

  private:
    sarrus_status status_;
    T value_;
};

/* A query by names. */
struct query {
    sarrus_request request = SARRUS_REQUEST_KINEMATICS;
    std::vector<const char *> given = {};
    std::vector<const char *> want = {};
    std::vector<const char *> frames = {};
    std::vector<const char *> wrenches = {};
    std::vector<const char *> joints = {};
    /* Bits of sarrus_query_option. */
    std::uint32_t options = 0;
    std::optional<double> loop_tolerance = {};
    std::optional<double> projection_tolerance = {};
    sarrus_axes axes = SARRUS_AXES_MIXED;
    /* The link that takes the root's place for frames; nullptr for the root. */
    const char *relative_to = nullptr;
    /* Number of given directions of supports; adds "directions" to the given fields. */
    std::uint32_t n_directions = 0;
    /* Bits of sarrus_task_part for each of `frames`, of a request with tasks. */
    std::vector<std::uint8_t> tasks = {};
};

/* How a robot is loaded. */
struct load_options {
    double gravity[3] = {0.0, 0.0, -9.81};
    bool lenient = false;
    bool floating_base = false;
    std::vector<const char *> lock = {};
    std::vector<const char *> only = {};
};

namespace detail {

template <class T, void (*release)(T *)>
struct deleter {
    void operator()(T *handle) const noexcept { release(handle); }
};

template <class T, void (*release)(T *)>
using handle = std::unique_ptr<T, deleter<T, release>>;

/* The size of arrays that must agree; where they do not, none has it. */
template <class... Spans>
std::size_t common(std::size_t first, const Spans &...rest) noexcept {
    return ((rest.size() == first) && ...) ? first : 0;
}

/* No number of an earlier call is left where the library cannot know the sizes. */
template <class... Spans>
void forget(const Spans &...outputs) noexcept {
    (std::fill(outputs.begin(), outputs.end(), std::numeric_limits<double>::quiet_NaN()), ...);
}

inline sarrus_load_options plain(const load_options &options) noexcept {
    sarrus_load_options plain = sarrus_load_defaults();
    for (std::size_t k = 0; k < 3; ++k) {
        plain.gravity[k] = options.gravity[k];
    }
    plain.lenient = options.lenient;
    plain.floating_base = options.floating_base;
    plain.lock = options.lock.data();
    plain.n_lock = options.lock.size();
    plain.only = options.only.data();
    plain.n_only = options.only.size();
    return plain;
}

} // namespace detail

/* A prepared query of one robot. */
class plan {
  public:
    plan() = default;
    explicit plan(sarrus_plan *handle) noexcept : handle_(handle) {}

    /* How many numbers go in, and how many come out. */
    std::size_t inputs() const noexcept { return sarrus_plan_inputs(handle_.get()); }
    std::size_t outputs() const noexcept { return sarrus_plan_outputs(handle_.get()); }
    /* Where a field lies among them; none where it is not there. */
    std::optional<sarrus_slot> given(const char *field) const noexcept {
        sarrus_slot slot;
        const bool is_there = sarrus_plan_given(handle_.get(), field, &slot) == SARRUS_STATUS_OK;
        return is_there ? std::optional(slot) : std::nullopt;
    }
    std::optional<sarrus_slot> want(const char *field) const noexcept {
        sarrus_slot slot;
        const bool is_there = sarrus_plan_want(handle_.get(), field, &slot) == SARRUS_STATUS_OK;
        return is_there ? std::optional(slot) : std::nullopt;
    }
    const sarrus_plan *c_handle() const noexcept { return handle_.get(); }

  private:
    detail::handle<sarrus_plan, sarrus_plan_free> handle_;
};

/* A robot that answers. */
class robot {
  public:
    robot() = default;
    explicit robot(sarrus_robot *handle) noexcept : handle_(handle) {}

    static result<robot> bundled(const char *name, const load_options &options = {}) noexcept {
        const sarrus_load_options plain = detail::plain(options);
        sarrus_robot *made = nullptr;
        const sarrus_status status = sarrus_robot_bundled(name, &plain, &made);
        return {status, robot(made)};
    }
    static result<robot> load(const char *urdf, const char *submechanisms = nullptr,
                              const load_options &options = {}) noexcept {
        const sarrus_load_options plain = detail::plain(options);
        sarrus_robot *made = nullptr;
        const sarrus_status status = sarrus_robot_load(urdf, submechanisms, &plain, &made);
        return {status, robot(made)};
    }
    static result<robot> connect(const char *name, const sarrus_connect_options &options =
                                                       sarrus_connect_defaults()) noexcept {
        sarrus_robot *made = nullptr;
        const sarrus_status status = sarrus_robot_connect(name, &options, &made);
        return {status, robot(made)};
    }

    std::string_view name() const noexcept {
        const char *text = sarrus_robot_name(handle_.get());
        return text == nullptr ? std::string_view() : std::string_view(text);
    }
    std::uint64_t fingerprint() const noexcept { return sarrus_robot_fingerprint(handle_.get()); }
    /* All zero for an empty handle. */
    sarrus_sizes sizes() const noexcept {
        sarrus_sizes sizes = {};
        (void)(sarrus_robot_sizes(handle_.get(), &sizes) == SARRUS_STATUS_OK);
        return sizes;
    }
    std::vector<std::string_view> names(sarrus_order order) const {
        std::vector<std::string_view> names(sarrus_robot_name_count(handle_.get(), order));
        for (std::size_t k = 0; k < names.size(); ++k) {
            names[k] = sarrus_robot_name_at(handle_.get(), order, k);
        }
        return names;
    }
    std::optional<sarrus_limits> limits(std::size_t index) const noexcept {
        sarrus_limits limits;
        const bool is_there =
            sarrus_robot_limits(handle_.get(), index, &limits) == SARRUS_STATUS_OK;
        return is_there ? std::optional(limits) : std::nullopt;
    }
    outcome set_options(std::uint32_t options) noexcept {
        return {sarrus_robot_set_options(handle_.get(), options)};
    }
    std::optional<sarrus_times> times() const noexcept {
        sarrus_times times;
        return sarrus_robot_times(handle_.get(), &times) ? std::optional(times) : std::nullopt;
    }
    std::uint64_t late() const noexcept { return sarrus_robot_late(handle_.get()); }

    /* Any question: prepared once, asked as often as needed. */
    result<plan> prepare(const query &query) noexcept {
        sarrus_query plain = {};
        plain.request = query.request;
        plain.options = query.options;
        plain.given = query.given.data();
        plain.n_given = query.given.size();
        plain.want = query.want.data();
        plain.n_want = query.want.size();
        plain.frames = query.frames.data();
        plain.n_frames = query.frames.size();
        plain.wrenches = query.wrenches.data();
        plain.n_wrenches = query.wrenches.size();
        plain.joints = query.joints.data();
        plain.n_joints = query.joints.size();
        plain.loop_tolerance = query.loop_tolerance ? &*query.loop_tolerance : nullptr;
        plain.projection_tolerance =
            query.projection_tolerance ? &*query.projection_tolerance : nullptr;
        plain.axes = query.axes;
        plain.relative_to = query.relative_to;
        plain.n_directions = query.n_directions;
        plain.tasks = query.tasks.size() == query.frames.size() && !query.tasks.empty()
                          ? query.tasks.data()
                          : nullptr;
        sarrus_plan *made = nullptr;
        const sarrus_status status = sarrus_robot_prepare(handle_.get(), &plain, &made);
        return {status, plan(made)};
    }
    outcome ask(const plan &plan, input given, output want) noexcept {
        outcome outcome;
        outcome.status = sarrus_robot_ask(handle_.get(), plan.c_handle(), given.data(),
                                          given.size(), want.data(), want.size(),
                                          &outcome.warnings);
        return outcome;
    }
    /* As many rows as `want` has room for; `statuses` and `warnings` have a number for each, or
       are left out. */
    outcome batch(const plan &plan, input given, output want,
                  std::span<std::int32_t> statuses = {}, std::span<std::uint32_t> warnings = {},
                  std::size_t threads = 0) noexcept {
        const std::size_t rows = plan.outputs() == 0 ? 0 : want.size() / plan.outputs();
        if ((!statuses.empty() && statuses.size() != rows) ||
            (!warnings.empty() && warnings.size() != rows)) {
            detail::forget(want);
            return {SARRUS_STATUS_WRONG_SIZE};
        }
        outcome outcome;
        outcome.status = sarrus_robot_batch(handle_.get(), plan.c_handle(), threads, rows,
                                            given.data(), given.size(), want.data(), want.size(),
                                            statuses.data(), warnings.data());
        return outcome;
    }
    outcome release(plan plan) noexcept {
        return {sarrus_robot_release(handle_.get(), plan.c_handle())};
    }

    /* The simple questions. */
    outcome inverse_dynamics(input y, input yd, input ydd, output tau_u) noexcept {
        outcome outcome;
        outcome.status = sarrus_robot_inverse_dynamics(
            handle_.get(), y.data(), y.size(), yd.data(), ydd.data(),
            detail::common(yd.size(), ydd), tau_u.data(), tau_u.size(), &outcome.warnings);
        return outcome;
    }
    outcome forward_dynamics(input y, input yd, input tau_u, output ydd) noexcept {
        outcome outcome;
        outcome.status = sarrus_robot_forward_dynamics(
            handle_.get(), y.data(), y.size(), yd.data(), yd.size(), tau_u.data(), tau_u.size(),
            ydd.data(), ydd.size(), &outcome.warnings);
        return outcome;
    }
    outcome state(input y, input yd, input ydd, output q, output qd, output qdd) noexcept {
        outcome outcome;
        outcome.status = sarrus_robot_state(
            handle_.get(), y.data(), y.size(), yd.data(), ydd.data(),
            detail::common(yd.size(), ydd), q.data(), q.size(), qd.data(), qdd.data(),
            detail::common(qd.size(), qdd), &outcome.warnings);
        if (outcome.status == SARRUS_STATUS_WRONG_SIZE) {
            detail::forget(q, qd, qdd);
        }
        return outcome;
    }
    outcome to_actuators(input y, input yd, input ydd, output u, output ud, output udd) noexcept {
        outcome outcome;
        outcome.status = sarrus_robot_to_actuators(
            handle_.get(), y.data(), y.size(), yd.data(), ydd.data(),
            detail::common(yd.size(), ydd), u.data(), ud.data(), udd.data(),
            detail::common(u.size(), ud, udd), &outcome.warnings);
        if (outcome.status == SARRUS_STATUS_WRONG_SIZE) {
            detail::forget(u, ud, udd);
        }
        return outcome;
    }
    outcome to_independent(input u, input ud, input udd, output y, output yd,
                           output ydd) noexcept {
        outcome outcome;
        outcome.status = sarrus_robot_to_independent(
            handle_.get(), u.data(), ud.data(), udd.data(), detail::common(u.size(), ud, udd),
            y.data(), y.size(), yd.data(), ydd.data(), detail::common(yd.size(), ydd),
            &outcome.warnings);
        if (outcome.status == SARRUS_STATUS_WRONG_SIZE) {
            detail::forget(y, yd, ydd);
        }
        return outcome;
    }

    /* Prepared ahead of time, so that the first call of each does not allocate either. */
    outcome prepare_inverse_dynamics() noexcept {
        return {sarrus_robot_prepare_inverse_dynamics(handle_.get(), nullptr)};
    }
    outcome prepare_forward_dynamics() noexcept {
        return {sarrus_robot_prepare_forward_dynamics(handle_.get(), nullptr)};
    }
    outcome prepare_state() noexcept {
        return {sarrus_robot_prepare_state(handle_.get(), nullptr)};
    }
    outcome prepare_to_actuators() noexcept {
        return {sarrus_robot_prepare_to_actuators(handle_.get(), nullptr)};
    }
    outcome prepare_to_independent() noexcept {
        return {sarrus_robot_prepare_to_independent(handle_.get(), nullptr)};
    }

    sarrus_robot *c_handle() const noexcept { return handle_.get(); }

  private:
    detail::handle<sarrus_robot, sarrus_robot_free> handle_;
};

/* The controller of a bridge; a bridge has one at a time. */
class controller {
  public:
    controller() = default;
    explicit controller(sarrus_controller *handle) noexcept : handle_(handle) {}

    static result<controller> connect(const char *name, std::uint64_t fingerprint) noexcept {
        sarrus_controller *made = nullptr;
        const sarrus_status status = sarrus_controller_connect(name, fingerprint, &made);
        return {status, controller(made)};
    }
    /* Sequence, stamp and fingerprint of the command are filled in. */
    outcome send(sarrus_actuator_command &command) noexcept {
        return {sarrus_controller_send(handle_.get(), &command)};
    }
    /* The newest state, once: false, with SARRUS_STATUS_NOTHING_NEW, until there is another. */
    outcome state(sarrus_actuator_state &state) const noexcept {
        return {sarrus_controller_state(handle_.get(), &state)};
    }
    outcome operate(sarrus_operation operation) noexcept {
        return {sarrus_controller_operate(handle_.get(), operation, nullptr)};
    }
    outcome operate(sarrus_operation operation, std::size_t actuator) noexcept {
        return {sarrus_controller_operate_mechanism(handle_.get(), operation, actuator, nullptr)};
    }

  private:
    detail::handle<sarrus_controller, sarrus_controller_free> handle_;
};

/* Somebody who watches a bridge, and may operate it. */
class observer {
  public:
    observer() = default;
    explicit observer(sarrus_observer *handle) noexcept : handle_(handle) {}

    static result<observer> connect(const char *name) noexcept {
        sarrus_observer *made = nullptr;
        const sarrus_status status = sarrus_observer_connect(name, &made);
        return {status, observer(made)};
    }
    outcome state(sarrus_actuator_state &state) const noexcept {
        return {sarrus_observer_state(handle_.get(), &state)};
    }
    outcome operate(sarrus_operation operation) noexcept {
        return {sarrus_observer_operate(handle_.get(), operation, nullptr)};
    }
    outcome operate(sarrus_operation operation, std::size_t actuator) noexcept {
        return {sarrus_observer_operate_mechanism(handle_.get(), operation, actuator, nullptr)};
    }

  private:
    detail::handle<sarrus_observer, sarrus_observer_free> handle_;
};

} // namespace sarrus

#endif
