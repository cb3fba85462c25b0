/*
 * sarrus: kinematics and dynamics of robots with closed loops, from C99 on and from C++.
 *
 * Written by client/c/header.sh from client/c/src and, for numbers and payloads that travel, from
 * proto/src, whose comments these are: change them there, not here.
 *
 * Units are SI and radians. y are the independent coordinates, u the actuators, q the spanning
 * tree; d and dd behind them are their rates. Sizes are in brackets, by the names of sarrus_sizes.
 * Matrices are packed row by row.
 *
 * Handles. sarrus_robot, sarrus_plan, sarrus_controller and sarrus_observer are made by the library
 * and freed by the ..._free of their kind, once. NULL instead of a handle is a status or, where
 * there is none, the value that the function names; any other pointer that is no handle, or was
 * freed, is undefined.
 *
 * Arrays and texts are the caller's, are looked at during the call only, and are not kept. Each
 * array comes with how many numbers it has, which is checked; NULL is allowed where that is 0. An
 * output may not overlap another array of the same call. Texts are UTF-8 and end with a zero. What
 * the library gives as const char * is its own.
 *
 * Threads. Any thread may use a handle, one at a time; different handles are independent. The text
 * of sarrus_last_error is the thread's own. In a child of fork() a robot that its parent connected
 * gives SARRUS_STATUS_OTHER_PROCESS, and a controller or observer sends and reads nothing; the
 * child may free them, which changes nothing for the parent, and connects its own. No thread may be
 * in a call at the time of the fork.
 *
 * Nothing here throws or exits, and no panic leaves the library.
 */


#ifndef SARRUS_H
#define SARRUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A status that nobody looks at is a warning of the compiler. */
#if defined(__GNUC__) || defined(__clang__)
#define SARRUS_MUST_USE __attribute__((warn_unused_result))
#else
#define SARRUS_MUST_USE
#endif

/**
 * Version of this interface; it grows when a program must be compiled again.
 */
#define SARRUS_ABI_VERSION 0

/**
 * Most actuators of a robot.
 */
#define SARRUS_MAX_ACTUATORS 64

/**
 * How a call ended, 0 for success. From 0 to 99 it is the status of an answer, by the numbers of
 * the wire; from 100 on there was no answer, and sarrus_last_error has the reason. The numbers
 * never change.
 */
enum sarrus_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The answer is complete.
     */
    SARRUS_STATUS_OK = 0,
    /**
     * The request itself is malformed: a field missing, two that exclude each other, a
     * quaternion not of unit length.
     */
    SARRUS_STATUS_BAD_REQUEST = 1,
    /**
     * An input number is NaN or infinite, or so large that the answer overflows.
     */
    SARRUS_STATUS_NON_FINITE_INPUT = 2,
    /**
     * An array does not have the size that the plan or the robot needs.
     */
    SARRUS_STATUS_WRONG_SIZE = 3,
    /**
     * The request was made for a model with another fingerprint.
     */
    SARRUS_STATUS_WRONG_MODEL = 4,
    /**
     * The request or plan number is not known to the server.
     */
    SARRUS_STATUS_UNKNOWN_REQUEST = 5,
    /**
     * Newton's method ran out of steps although the target seems reachable.
     */
    SARRUS_STATUS_NOT_CONVERGED = 6,
    /**
     * The straight path from the guess to the target crosses a singularity onto another
     * branch.
     */
    SARRUS_STATUS_BRANCH_CHANGED = 7,
    /**
     * No closed pose has these coordinates.
     */
    SARRUS_STATUS_UNREACHABLE = 8,
    /**
     * The closure loses rank at the answer: the mechanism gains a freedom.
     */
    SARRUS_STATUS_SINGULAR_CLOSURE = 9,
    /**
     * The declared independent coordinates do not determine the motion at the answer.
     */
    SARRUS_STATUS_SINGULAR_INDEPENDENTS = 10,
    /**
     * The actuators do not determine the motion (or a force cannot be mapped to them) at the
     * answer.
     */
    SARRUS_STATUS_SINGULAR_ACTUATION = 11,
    /**
     * The reduced mass matrix is not positive definite.
     */
    SARRUS_STATUS_MASS_NOT_POSITIVE = 12,
    /**
     * The server has more work than it accepts.
     */
    SARRUS_STATUS_OVERLOADED = 13,
    /**
     * The server is stopping.
     */
    SARRUS_STATUS_SHUTTING_DOWN = 14,
    /**
     * The checksum of the request or of the answer fails: its bytes changed after it was sent.
     * Set by the server for a request, by the client for an answer, where the query asks for
     * checksums.
     */
    SARRUS_STATUS_CORRUPT_ANSWER = 15,
    /**
     * This client does not know the status: the server has another version. The numbers are
     * NaN.
     */
    SARRUS_STATUS_UNKNOWN_STATUS = 16,
    /**
     * The connection was made by another process, from which this one was forked. The numbers
     * are NaN, and the server was not asked.
     */
    SARRUS_STATUS_OTHER_PROCESS = 17,
    /**
     * The deadline of the request passed before its answer was there. The numbers are NaN.
     */
    SARRUS_STATUS_LATE = 18,
    /**
     * No pose was found that meets all tasks; the numbers are those of the nearest one that
     * breaks no bound.
     */
    SARRUS_STATUS_NOT_REACHED = 19,
    /**
     * No pose was found that breaks no bound; `binding` names the bounds that contradict.
     */
    SARRUS_STATUS_INFEASIBLE = 20,
    /**
     * A pointer that must not be NULL is.
     */
    SARRUS_STATUS_NULL_POINTER = 100,
    /**
     * A pointer is not aligned for its type.
     */
    SARRUS_STATUS_UNALIGNED_POINTER = 101,
    /**
     * An output array overlaps another array of the same call.
     */
    SARRUS_STATUS_OVERLAPPING_ARRAYS = 102,
    /**
     * A text is not UTF-8, or malformed.
     */
    SARRUS_STATUS_BAD_TEXT = 103,
    /**
     * A number stands for nothing in its enum, or a place is none of its list.
     */
    SARRUS_STATUS_UNKNOWN_NUMBER = 104,
    /**
     * The files cannot be read or have faults: all of them are in the text.
     */
    SARRUS_STATUS_LOAD_FAILED = 105,
    /**
     * No server or bridge takes this client.
     */
    SARRUS_STATUS_CONNECT_FAILED = 106,
    /**
     * The server is gone and did not come back in time; the next call looks for it again.
     */
    SARRUS_STATUS_SERVER_GONE = 107,
    /**
     * The server is there but did not answer in time.
     */
    SARRUS_STATUS_NO_ANSWER = 108,
    /**
     * Names stand for nothing: all of them are in the text.
     */
    SARRUS_STATUS_UNKNOWN_NAME = 109,
    /**
     * The query cannot be planned.
     */
    SARRUS_STATUS_BAD_QUERY = 110,
    /**
     * The plan moves more numbers than a request carries.
     */
    SARRUS_STATUS_TOO_LARGE = 111,
    /**
     * The server's table of plans is full.
     */
    SARRUS_STATUS_TOO_MANY_PLANS = 112,
    /**
     * The plan is another robot's, be it one of the same model.
     */
    SARRUS_STATUS_UNKNOWN_PLAN = 113,
    /**
     * The plan was released.
     */
    SARRUS_STATUS_RELEASED_PLAN = 114,
    /**
     * There is nothing new since the last call.
     */
    SARRUS_STATUS_NOTHING_NEW = 115,
    /**
     * A command could not be sent.
     */
    SARRUS_STATUS_NOT_SENT = 116,
    /**
     * This processor lacks a feature that this build of the library needs.
     */
    SARRUS_STATUS_OLD_PROCESSOR = 117,
    /**
     * A fault of the library itself; free the handle. Please report it.
     */
    SARRUS_STATUS_INTERNAL = 118,
    /**
     * This process has too little memory left for the call.
     */
    SARRUS_STATUS_NO_MEMORY = 119,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_status sarrus_status;
#else
typedef int32_t sarrus_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Bits that accompany an answer and never change its numbers.
 */
enum sarrus_warning
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * A position, velocity or actuator force lies outside the limits that the model declares.
     */
    SARRUS_WARNING_LIMITS_EXCEEDED = 1,
    /**
     * Some field of the answer may keep fewer than nine digits: near a singular pose, where
     * actuators nearly lose control, or where an inertia nearly cancels. Without it all keep
     * nine.
     */
    SARRUS_WARNING_ILL_CONDITIONED = 2,
    /**
     * A redundant row, which the solution omits, is open by more than the query's tolerance:
     * the loops do not close here.
     */
    SARRUS_WARNING_LOOP_OPEN = 4,
    /**
     * The given q or qd does not fit its loops: the answer's state is farther from it than the
     * query's tolerance (the field `projection`).
     */
    SARRUS_WARNING_INPUT_PROJECTED = 8,
    /**
     * An actuator that a wanted field depends on has no limit, and the field is NaN.
     */
    SARRUS_WARNING_NO_LIMIT = 16,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_warning sarrus_warning;
#else
typedef uint32_t sarrus_warning;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Lists of names.
 */
enum sarrus_order
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The spanning tree's velocities: order of qd (n_v).
     */
    SARRUS_ORDER_TREE = 0,
    /**
     * The spanning tree's coordinates: order of q (n_q).
     */
    SARRUS_ORDER_TREE_Q = 1,
    /**
     * The independent velocities: order of yd (n_vy).
     */
    SARRUS_ORDER_INDEPENDENT = 2,
    /**
     * The independent coordinates: order of y (n_qy).
     */
    SARRUS_ORDER_INDEPENDENT_Q = 3,
    /**
     * The actuators: order of u (n_u).
     */
    SARRUS_ORDER_ACTIVE = 4,
    /**
     * The rows of the loop Jacobian K (n_c).
     */
    SARRUS_ORDER_LOOPS = 5,
    /**
     * Clusters that have an assembly branch (n_branches).
     */
    SARRUS_ORDER_BRANCHES = 6,
    /**
     * Links.
     */
    SARRUS_ORDER_LINKS = 7,
    /**
     * Warnings about the files, one line each.
     */
    SARRUS_ORDER_WARNINGS = 8,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_order sarrus_order;
#else
typedef uint32_t sarrus_order;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Which way requests go.
 */
enum sarrus_transport
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * A lane of one's own: the fastest way; a server has a bounded number of them.
     */
    SARRUS_TRANSPORT_LANE = 0,
    /**
     * The service, shared by all clients; each request makes one small block of memory.
     */
    SARRUS_TRANSPORT_SERVICE = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_transport sarrus_transport;
#else
typedef uint32_t sarrus_transport;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How a client waits for an answer.
 */
enum sarrus_wait_strategy
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Busy where at least three processors are there, else polite.
     */
    SARRUS_WAIT_STRATEGY_AUTO = 0,
    /**
     * Polls without pause: the lowest latency for a whole processor while waiting.
     */
    SARRUS_WAIT_STRATEGY_BUSY = 1,
    /**
     * Polls for some microseconds, then lets others run.
     */
    SARRUS_WAIT_STRATEGY_POLITE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_wait_strategy sarrus_wait_strategy;
#else
typedef uint32_t sarrus_wait_strategy;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The kinds of request.
 */
enum sarrus_request
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Positions, velocities, accelerations, closures, frames.
     */
    SARRUS_REQUEST_KINEMATICS = 1,
    /**
     * Motion to forces.
     */
    SARRUS_REQUEST_INVERSE_DYNAMICS = 2,
    /**
     * Forces to motion.
     */
    SARRUS_REQUEST_FORWARD_DYNAMICS = 3,
    /**
     * Positions, velocities, accelerations and forces from one space to another.
     */
    SARRUS_REQUEST_MAP = 4,
    /**
     * Motion and forces of the actuators to the forces from outside.
     */
    SARRUS_REQUEST_OBSERVE = 5,
    /**
     * Poses of frames to the positions that reach them.
     */
    SARRUS_REQUEST_INVERSE_KINEMATICS = 6,
    /**
     * Twists of frames to the velocity that gives them, within limits.
     */
    SARRUS_REQUEST_DIFFERENTIAL_INVERSE_KINEMATICS = 7,
    /**
     * Accelerations of frames to the forces of actuators and contacts that give them, within
     * limits.
     */
    SARRUS_REQUEST_STEP = 8,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_request sarrus_request;
#else
typedef uint32_t sarrus_request;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Axes and reference point of the twists, accelerations and Jacobians of frames.
 */
enum sarrus_axes
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Root axes, at the frame's origin.
     */
    SARRUS_AXES_MIXED = 0,
    /**
     * Root axes, at the root's origin; accelerations stay those of the frame's origin.
     */
    SARRUS_AXES_WORLD = 1,
    /**
     * The frame's axes, at its origin.
     */
    SARRUS_AXES_LOCAL = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_axes sarrus_axes;
#else
typedef uint32_t sarrus_axes;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The parts of a frame that a task is about, and its priority, as bits.
 */
enum sarrus_task_part
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The place of its origin.
     */
    SARRUS_TASK_PART_POSITION = 1,
    /**
     * Its axes.
     */
    SARRUS_TASK_PART_ORIENTATION = 2,
    /**
     * The direction of its z axis.
     */
    SARRUS_TASK_PART_AXIS = 4,
    /**
     * Only as far as the tasks without this bit leave room.
     */
    SARRUS_TASK_PART_SECOND = 8,
    /**
     * Exactly, by forces of the ground: a contact.
     */
    SARRUS_TASK_PART_HELD = 16,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_task_part sarrus_task_part;
#else
typedef uint32_t sarrus_task_part;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Additions to the heads of a query's requests and answers, and how long it may take, as bits.
 */
enum sarrus_query_option
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Requests and answers have a checksum.
     */
    SARRUS_QUERY_OPTION_CHECKSUM = 1,
    /**
     * Requests have a stamp; answers have the request's age and the time taken.
     */
    SARRUS_QUERY_OPTION_TIMES = 2,
    /**
     * Closures are continued and the nearest independents sought as long as it takes; without it
     * the work of a request is bounded.
     */
    SARRUS_QUERY_OPTION_SEARCH = 4,
    /**
     * Forces count the friction of joints.
     */
    SARRUS_QUERY_OPTION_FRICTION = 8,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_query_option sarrus_query_option;
#else
typedef uint32_t sarrus_query_option;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * State of a mechanism, and of the bridge as a whole.
 */
enum sarrus_mechanism_state
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Its motors have no power.
     */
    SARRUS_MECHANISM_STATE_DISABLED = 0,
    /**
     * It is requested to arm, and waits for a missing condition or for its motors.
     */
    SARRUS_MECHANISM_STATE_ARMING = 1,
    /**
     * Its motors follow the commands.
     */
    SARRUS_MECHANISM_STATE_ENABLED = 2,
    /**
     * Something failed: its motors have no power until an operator resets it.
     */
    SARRUS_MECHANISM_STATE_FAULT = 3,
    /**
     * Its motors are brought to a standstill, and then lose power.
     */
    SARRUS_MECHANISM_STATE_STOPPING = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_mechanism_state sarrus_mechanism_state;
#else
typedef uint32_t sarrus_mechanism_state;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Why a mechanism is in its state.
 */
enum sarrus_reason
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Nothing to report.
     */
    SARRUS_REASON_NONE = 0,
    /**
     * An operator or a controller disarmed it.
     */
    SARRUS_REASON_DISARMED = 1,
    /**
     * No command came for longer than T2.
     */
    SARRUS_REASON_COMMAND_LOST = 2,
    /**
     * The bridge itself was stopped for longer than T2, or heard no motor for `feedback_ms`
     * because it was late itself.
     */
    SARRUS_REASON_STALLED = 3,
    /**
     * No command came since the request to arm.
     */
    SARRUS_REASON_NO_COMMAND = 4,
    /**
     * A motor has no offset in the configuration.
     */
    SARRUS_REASON_NOT_CALIBRATED = 5,
    /**
     * A motor's watchdog is off.
     */
    SARRUS_REASON_WATCHDOG_OFF = 6,
    /**
     * A motor's watchdog was not read, so it counts as off.
     */
    SARRUS_REASON_WATCHDOG_UNKNOWN = 7,
    /**
     * A motor does not measure, or has stopped measuring.
     */
    SARRUS_REASON_FEEDBACK_STALE = 8,
    /**
     * A motor reports a fault.
     */
    SARRUS_REASON_MOTOR_FAULT = 9,
    /**
     * A motor lost power while it was to be enabled.
     */
    SARRUS_REASON_POWER_LOST = 10,
    /**
     * Motors did not take power in time.
     */
    SARRUS_REASON_ARMING_TIMEOUT = 11,
    /**
     * The bus is error-passive.
     */
    SARRUS_REASON_BUS_PASSIVE = 12,
    /**
     * The bus is off.
     */
    SARRUS_REASON_BUS_OFF = 13,
    /**
     * Earlier frames still wait to be sent.
     */
    SARRUS_REASON_BACKLOG = 14,
    /**
     * Another mechanism failed, and the robot stops as a whole.
     */
    SARRUS_REASON_OTHER_MECHANISM = 15,
    /**
     * A motor's watchdog is longer than the configured one.
     */
    SARRUS_REASON_WATCHDOG_LONG = 16,
    /**
     * An actuator is beyond its position limit and moves outwards.
     */
    SARRUS_REASON_POSITION_LIMIT = 17,
    /**
     * An actuator is faster than its limit.
     */
    SARRUS_REASON_VELOCITY_LIMIT = 18,
    /**
     * An actuator lags behind its set-point.
     */
    SARRUS_REASON_FOLLOWING_ERROR = 19,
    /**
     * A motor reports an effort that differs from the commanded one.
     */
    SARRUS_REASON_EFFORT_MISMATCH = 20,
    /**
     * A motor repeats one position while it must have moved.
     */
    SARRUS_REASON_FEEDBACK_FROZEN = 21,
    /**
     * A position changed by more than the speed allows.
     */
    SARRUS_REASON_FEEDBACK_JUMP = 22,
    /**
     * A motor answers old requests.
     */
    SARRUS_REASON_FEEDBACK_LATE = 23,
    /**
     * A motor sent more answers than requests.
     */
    SARRUS_REASON_SECOND_ANSWER = 24,
    /**
     * Another sender uses the bridge's own identifiers.
     */
    SARRUS_REASON_SECOND_MASTER = 25,
    /**
     * A motor is too hot.
     */
    SARRUS_REASON_OVER_TEMPERATURE = 26,
    /**
     * An actuator is outside its limits, where arming is refused.
     */
    SARRUS_REASON_OUTSIDE_LIMITS = 27,
    /**
     * An independent coordinate of the mechanism is beyond its limit.
     */
    SARRUS_REASON_MECHANISM_LIMIT = 28,
    /**
     * No pose of the mechanism has the measured positions.
     */
    SARRUS_REASON_UNREACHABLE = 29,
    /**
     * The mechanism is too near to a singular pose.
     */
    SARRUS_REASON_NEAR_SINGULAR = 30,
    /**
     * Encoders of one closed loop contradict each other.
     */
    SARRUS_REASON_LOOP_RESIDUAL = 31,
    /**
     * Reported efforts contradict the inverse dynamics of the model.
     */
    SARRUS_REASON_MODEL_EFFORT = 32,
    /**
     * An actuator moves, and power is given at rest only.
     */
    SARRUS_REASON_MOVING = 33,
    /**
     * The configuration names a robot, and no record of its commissioning fits.
     */
    SARRUS_REASON_NOT_COMMISSIONED = 34,
    /**
     * A motor is back at another position than the last known one: an operator confirms it.
     */
    SARRUS_REASON_POSITION_CHANGED = 35,
    /**
     * Something pushes a mechanism harder than its threshold.
     */
    SARRUS_REASON_EXTERNAL_FORCE = 36,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_reason sarrus_reason;
#else
typedef uint32_t sarrus_reason;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * An operator's request to the bridge.
 */
enum sarrus_operation
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Give the motors power as soon as all conditions hold.
     */
    SARRUS_OPERATION_ARM = 1,
    /**
     * Remove power.
     */
    SARRUS_OPERATION_DISARM = 2,
    /**
     * Clear a fault; armed mechanisms stay armed.
     */
    SARRUS_OPERATION_RESET = 3,
    /**
     * Move actuators outside their limits back inside, slowly, then remove power.
     */
    SARRUS_OPERATION_RETURN = 4,
    /**
     * Believe the positions of motors that differ from the last known ones.
     */
    SARRUS_OPERATION_CONFIRM = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_operation sarrus_operation;
#else
typedef uint32_t sarrus_operation;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Flags of single actuators, as bits.
 */
enum sarrus_flag
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The effort was limited.
     */
    SARRUS_FLAG_EFFORT_LIMITED = (1 << 0),
    /**
     * The position was limited.
     */
    SARRUS_FLAG_POSITION_LIMITED = (1 << 1),
    /**
     * The velocity was limited, or the commanded position changes faster than the limit.
     */
    SARRUS_FLAG_VELOCITY_LIMITED = (1 << 2),
    /**
     * The commanded effort changes faster than its limit.
     */
    SARRUS_FLAG_RATE_LIMITED = (1 << 3),
    /**
     * Gains and efforts still grow after arming.
     */
    SARRUS_FLAG_RAMPING = (1 << 4),
    /**
     * Commands are late: the actuator is damped.
     */
    SARRUS_FLAG_DAMPED = (1 << 5),
    /**
     * The measurement is missing or too old.
     */
    SARRUS_FLAG_STALE = (1 << 6),
    /**
     * The motor reports a fault.
     */
    SARRUS_FLAG_MOTOR_FAULT = (1 << 7),
    /**
     * The motor has power.
     */
    SARRUS_FLAG_POWERED = (1 << 8),
    /**
     * No motor drives it.
     */
    SARRUS_FLAG_NO_MOTOR = (1 << 9),
    /**
     * The effort is reduced because the motor is hot.
     */
    SARRUS_FLAG_DERATED = (1 << 10),
    /**
     * The actuator is brought to a standstill.
     */
    SARRUS_FLAG_STOPPING = (1 << 11),
    /**
     * An effort that pushes outwards beyond a position limit was removed.
     */
    SARRUS_FLAG_OUTWARD_LIMITED = (1 << 12),
    /**
     * The configuration waives the commissioning of the robot.
     */
    SARRUS_FLAG_UNCOMMISSIONED = (1 << 13),
    /**
     * Nothing tells a frozen encoder from a joint at rest.
     */
    SARRUS_FLAG_FROZEN_UNDETECTABLE = (1 << 14),
    /**
     * The motor is back at another position than the last known one.
     */
    SARRUS_FLAG_POSITION_CHANGED = (1 << 15),
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum sarrus_flag sarrus_flag;
#else
typedef uint32_t sarrus_flag;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The controller of a bridge; a bridge has one at a time. Commands must keep coming: each later
 * than T1 of the configuration is damped, and later than T2 disabled. One thread uses it at a
 * time; any may.
 */
typedef struct sarrus_controller sarrus_controller;

/**
 * An observer of a bridge, which may also operate it. One thread uses it at a time; any may.
 */
typedef struct sarrus_observer sarrus_observer;

/**
 * A prepared query of one robot, with the layouts of its input and output. It belongs to the robot
 * that prepared it and to no other, even of the same model. Freeing it frees this memory alone;
 * sarrus_robot_release releases the plan in the robot and its server.
 */
typedef struct sarrus_plan sarrus_plan;

/**
 * A robot that answers: in this process or in another, by the same functions and with the same
 * bits. One thread uses it at a time; any may.
 */
typedef struct sarrus_robot sarrus_robot;

/**
 * Options for loading a robot. Begin with sarrus_load_defaults() and change single members.
 */
typedef struct sarrus_load_options {
    /**
     * Gravity in root axes [m/s^2].
     */
    double gravity[3];
    /**
     * Faults of mass and inertia, and effects that are not modelled, are warnings.
     */
    bool lenient;
    /**
     * The root link is on a free joint, the first of all: q = [p; x y z w], qd = [w; v] in the
     * root link.
     */
    bool floating_base;
    /**
     * Joints that are held still, each "JOINT" or "JOINT=VALUE" [m, rad].
     */
    const char *const *lock;
    /**
     * How many.
     */
    size_t n_lock;
    /**
     * Links to which the robot is reduced, by names or patterns; none stands for all.
     */
    const char *const *only;
    /**
     * How many.
     */
    size_t n_only;
} sarrus_load_options;

/**
 * Options for connecting. Begin with sarrus_connect_defaults() and change single members.
 */
typedef struct sarrus_connect_options {
    /**
     * A sarrus_transport.
     */
    uint32_t transport;
    /**
     * A sarrus_wait_strategy.
     */
    uint32_t wait_strategy;
    /**
     * How long one call waits at most, for a server that is gone to come back included [ns].
     */
    uint64_t timeout_ns;
    /**
     * How long an answer may take before it is late, without numbers [ns]; 0 for any time.
     */
    uint64_t deadline_ns;
    /**
     * The model that must be served; 0 for any.
     */
    uint64_t fingerprint;
} sarrus_connect_options;

/**
 * How long the last answer took.
 */
typedef struct sarrus_times {
    /**
     * How old the request was when the server took it [ns]; 0 in process.
     */
    uint32_t age_ns;
    /**
     * From then to the publication of the answer [ns].
     */
    uint32_t took_ns;
} sarrus_times;

/**
 * Sizes that fix the shape of every field.
 */
typedef struct sarrus_sizes {
    /**
     * Tree coordinates.
     */
    size_t n_q;
    /**
     * Tree velocities.
     */
    size_t n_v;
    /**
     * Independent coordinates.
     */
    size_t n_qy;
    /**
     * Independent velocities.
     */
    size_t n_vy;
    /**
     * Actuators.
     */
    size_t n_u;
    /**
     * Constraint rows.
     */
    size_t n_c;
    /**
     * Clusters with an assembly branch.
     */
    size_t n_branches;
} sarrus_sizes;

/**
 * Limits of a tree coordinate, in its own unit; infinite where there is none.
 */
typedef struct sarrus_limits {
    /**
     * Least position [m, rad].
     */
    double lower;
    /**
     * Greatest position [m, rad].
     */
    double upper;
    /**
     * Greatest speed [m/s, rad/s].
     */
    double velocity;
    /**
     * Greatest force or moment [N, N m].
     */
    double effort;
} sarrus_limits;

/**
 * A query by names. Begin with zeros, `sarrus_query query = {0};`, and set the members needed.
 */
typedef struct sarrus_query {
    /**
     * A sarrus_request.
     */
    uint32_t request;
    /**
     * Bits of sarrus_query_option.
     */
    uint32_t options;
    /**
     * The fields that each request gives, such as "y".
     */
    const char *const *given;
    /**
     * How many.
     */
    size_t n_given;
    /**
     * The fields that each answer holds, such as "tau_u"; none stands for the request's usual
     * ones.
     */
    const char *const *want;
    /**
     * How many.
     */
    size_t n_want;
    /**
     * The links whose frames are asked; `want` selects the fields of frames.
     */
    const char *const *frames;
    /**
     * How many.
     */
    size_t n_frames;
    /**
     * The links that wrenches act on; adds "wrenches" to the given fields.
     */
    const char *const *wrenches;
    /**
     * How many.
     */
    size_t n_wrenches;
    /**
     * The joints whose rows are asked, by names with * ? [...] as in shells; none stands for all.
     */
    const char *const *joints;
    /**
     * How many.
     */
    size_t n_joints;
    /**
     * How far redundant rows of loops may be open before an answer has the warning loop_open, in
     * radians or lengths of the cluster; NULL for 1e-6.
     */
    const double *loop_tolerance;
    /**
     * How far an answer may be from the q or qd that was given before it has the warning
     * input_projected; NULL for 1e-6.
     */
    const double *projection_tolerance;
    /**
     * The link that takes the root's place for frames; NULL for the root.
     */
    const char *relative_to;
    /**
     * A sarrus_axes: axes and reference point of twists, accelerations and Jacobians of frames.
     */
    uint32_t axes;
    /**
     * Number of given directions of supports; adds "directions" to the given fields.
     */
    uint32_t n_directions;
    /**
     * Of requests with tasks, from SARRUS_REQUEST_INVERSE_KINEMATICS on, for each of `frames` bits
     * of sarrus_task_part; adds "task_target" to the given fields of that one, "task_motion" to
     * those of the others. NULL for other requests.
     */
    const uint8_t *tasks;
    /**
     * Zeros, for members of later versions; other values are refused.
     */
    uint64_t reserved[5];
} sarrus_query;

/**
 * Where a field lies among the numbers that go in or come out.
 */
typedef struct sarrus_slot {
    /**
     * Place of its first number.
     */
    size_t offset;
    /**
     * Rows.
     */
    size_t rows;
    /**
     * Columns; a matrix is packed row by row.
     */
    size_t columns;
} sarrus_slot;

/**
 * One command for all actuators of a robot, in the order of u.
 *
 * An actuator follows tau = effort + stiffness (position - measured) + damping (velocity -
 * measured), as far as its motor's mode allows. A controller that sends the command fills in
 * sequence, stamp and fingerprint.
 */
typedef struct sarrus_actuator_command {
    /**
     * Increases with each command; any other command is rejected.
     */
    uint64_t sequence;
    /**
     * Time at which the command was computed, by the monotonic clock of this machine [ns].
     */
    uint64_t stamp_ns;
    /**
     * Fingerprint of the model behind the command; 0 if the bridge has no model.
     */
    uint64_t fingerprint;
    /**
     * Number of actuators (n_u).
     */
    uint64_t n_u;
    /**
     * Position [rad, m].
     */
    double position[SARRUS_MAX_ACTUATORS];
    /**
     * Velocity [rad/s, m/s].
     */
    double velocity[SARRUS_MAX_ACTUATORS];
    /**
     * Moment or force, tau_u [N m, N].
     */
    double effort[SARRUS_MAX_ACTUATORS];
    /**
     * Stiffness [N m/rad, N/m], at least 0.
     */
    double stiffness[SARRUS_MAX_ACTUATORS];
    /**
     * Damping [N m s/rad, N s/m], at least 0.
     */
    double damping[SARRUS_MAX_ACTUATORS];
} sarrus_actuator_command;

/**
 * The state of all actuators after a cycle of the bridge, in the order of u.
 */
typedef struct sarrus_actuator_state {
    /**
     * Number of the cycle.
     */
    uint64_t sequence;
    /**
     * Time of the cycle, by the monotonic clock of this machine [ns].
     */
    uint64_t stamp_ns;
    /**
     * Fingerprint of the model; 0 without one.
     */
    uint64_t fingerprint;
    /**
     * Number of actuators (n_u).
     */
    uint64_t n_u;
    /**
     * Sequence of the last accepted command.
     */
    uint64_t command;
    /**
     * The worst of the mechanisms, a sarrus_mechanism_state.
     */
    uint32_t state;
    /**
     * Why, a sarrus_reason.
     */
    uint32_t reason;
    /**
     * The sarrus_mechanism_state of each actuator's mechanism.
     */
    uint32_t states[SARRUS_MAX_ACTUATORS];
    /**
     * Why, a sarrus_reason each.
     */
    uint32_t reasons[SARRUS_MAX_ACTUATORS];
    /**
     * Bits of sarrus_flag.
     */
    uint32_t flags[SARRUS_MAX_ACTUATORS];
    /**
     * The motors' own codes of their faults; 0 without one.
     */
    uint32_t faults[SARRUS_MAX_ACTUATORS];
    /**
     * Time of each measurement, by the monotonic clock [ns]; 0 for none.
     */
    uint64_t measured_ns[SARRUS_MAX_ACTUATORS];
    /**
     * Position [rad, m]; NaN before the first measurement, here and below.
     */
    double position[SARRUS_MAX_ACTUATORS];
    /**
     * Velocity [rad/s, m/s].
     */
    double velocity[SARRUS_MAX_ACTUATORS];
    /**
     * Moment or force [N m, N].
     */
    double effort[SARRUS_MAX_ACTUATORS];
    /**
     * Temperature of the motor [degrees Celsius].
     */
    double temperature[SARRUS_MAX_ACTUATORS];
} sarrus_actuator_state;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * SARRUS_ABI_VERSION of the library: a program that was compiled with another one must not go on.
 */
uint32_t sarrus_abi_version(void);

/**
 * Version of the library, such as "0.1.0"; lives for ever.
 */
const char *sarrus_version(void);

/**
 * Name of a status, such as "unreachable"; "unknown" for a number that is none. Lives for ever.
 */
const char *sarrus_status_name(int32_t status);

/**
 * Name of the lowest warning among bits; NULL where there is none. Lives for ever.
 */
const char *sarrus_warning_name(uint32_t bits);

/**
 * The message of this thread's last status other than SARRUS_STATUS_OK; empty before. It is
 * overwritten by the next failure of this thread, and cut at 8 KiB.
 */
const char *sarrus_last_error(void);

/**
 * Standard gravity downwards, strict, on the ground, the whole robot.
 */
struct sarrus_load_options sarrus_load_defaults(void);

/**
 * A lane, one second, waiting as fits the number of processors, no deadline, any model.
 */
struct sarrus_connect_options sarrus_connect_defaults(void);

/**
 * Loads a bundled robot, such as "lambda", into this process. `options` may be NULL. The robot is
 * freed by sarrus_robot_free; `*robot` is NULL after a failure.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_bundled(const char *name,
                                   const struct sarrus_load_options *options,
                                   struct sarrus_robot **robot);

/**
 * Loads a robot from files into this process: a URDF, or a SMURF file that names one, and its
 * submechanisms, which may be NULL. After SARRUS_STATUS_LOAD_FAILED the text has a line for each
 * fault.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_load(const char *urdf,
                                const char *submechanisms,
                                const struct sarrus_load_options *options,
                                struct sarrus_robot **robot);

/**
 * Loads a robot from the contents of files, with their lengths in bytes; `submechanisms` may be
 * NULL.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_load_text(const char *urdf,
                                     size_t urdf_size,
                                     const char *submechanisms,
                                     size_t submechanisms_size,
                                     const struct sarrus_load_options *options,
                                     struct sarrus_robot **robot);

/**
 * Connects to a server on this machine, of this user or below the folder that SARRUS_ROOT names.
 * `options` may be NULL. When the server is killed and started again with the same model, the
 * robot goes on by itself, plans included.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_connect(const char *name,
                                   const struct sarrus_connect_options *options,
                                   struct sarrus_robot **robot);

/**
 * Frees a robot, and its plans with it; NULL does nothing.
 */
void sarrus_robot_free(struct sarrus_robot *robot);

/**
 * Name of the robot, which lives as long as it; NULL for NULL.
 */
const char *sarrus_robot_name(const struct sarrus_robot *robot);

/**
 * A number that differs whenever any name, order or constant of the model differs; 0 for NULL.
 */
uint64_t sarrus_robot_fingerprint(const struct sarrus_robot *robot);

/**
 * Has every simple call from now on (sarrus_robot_inverse_dynamics and those beside it) carry a
 * checksum, times or both: bits of sarrus_query_option. The next call of each prepares its plan.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_set_options(struct sarrus_robot *robot,
                                       uint32_t options);

/**
 * How long the last answer took, where that was asked; false where it was not, or no answer came.
 */
bool sarrus_robot_times(const struct sarrus_robot *robot, struct sarrus_times *times);

/**
 * Answers that came after the deadline of the connection; 0 in process.
 */
uint64_t sarrus_robot_late(const struct sarrus_robot *robot);

/**
 * The sizes of a robot.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_sizes(const struct sarrus_robot *robot,
                                 struct sarrus_sizes *sizes);

/**
 * How many names a list has, by a number of sarrus_order; 0 for NULL and for other numbers.
 */
size_t sarrus_robot_name_count(const struct sarrus_robot *robot, uint32_t order);

/**
 * A name of a list, which lives as long as the robot; NULL beyond its end.
 */
const char *sarrus_robot_name_at(const struct sarrus_robot *robot, uint32_t order, size_t index);

/**
 * The limits of a tree coordinate, by its place in qd.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_limits(const struct sarrus_robot *robot,
                                  size_t index,
                                  struct sarrus_limits *limits);

/**
 * Prepares a query; equal queries of a robot share one plan. Allocates. All names that stand for
 * nothing are reported together. The plan is freed by
 * sarrus_plan_free.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_prepare(struct sarrus_robot *robot,
                                   const struct sarrus_query *query,
                                   struct sarrus_plan **plan);

/**
 * How many numbers go in; 0 for NULL.
 */
size_t sarrus_plan_inputs(const struct sarrus_plan *plan);

/**
 * How many numbers come out; 0 for NULL.
 */
size_t sarrus_plan_outputs(const struct sarrus_plan *plan);

/**
 * Where a given field lies in the input. Fields are packed in a fixed order, independent of the
 * order of their names in the query.
 */
SARRUS_MUST_USE
sarrus_status sarrus_plan_given(const struct sarrus_plan *plan,
                                const char *field,
                                struct sarrus_slot *place);

/**
 * Where a wanted field lies in the output.
 */
SARRUS_MUST_USE
sarrus_status sarrus_plan_want(const struct sarrus_plan *plan,
                               const char *field,
                               struct sarrus_slot *place);

/**
 * Asks: `input` holds the given fields, `output` gets the wanted ones, both packed in the plan's
 * layout. In process and through a lane it never allocates. After any status other than
 * SARRUS_STATUS_OK the outputs that survive a failure keep their numbers and all others are NaN;
 * pointers that cannot be used leave them as they were. `warnings` gets bits of sarrus_warning,
 * and may be NULL.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_ask(struct sarrus_robot *robot,
                               const struct sarrus_plan *plan,
                               const double *input,
                               size_t n_input,
                               double *output,
                               size_t n_output,
                               uint32_t *warnings);

/**
 * Asks for rows of states: `input` and `output` hold those of all rows, one after the other, each
 * packed in the plan's layout. Every number, status and warning is that of sarrus_robot_ask, to
 * the bit. In process `threads` threads work, the calling one among them, 0 standing for one on
 * each processor; a connected robot's server answers them. `statuses` and `warnings` get a number
 * for each row, and may be NULL. All rows are answered; the status of the call is that of the
 * first row without an answer. Where the call fails as a whole, rows that were not answered have
 * its status, and NaN for numbers. Allocates.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_batch(struct sarrus_robot *robot,
                                 const struct sarrus_plan *plan,
                                 size_t threads,
                                 size_t rows,
                                 const double *input,
                                 size_t n_input,
                                 double *output,
                                 size_t n_output,
                                 int32_t *statuses,
                                 uint32_t *warnings);

/**
 * Releases a plan: its resources here and in the server are freed once it was released as often as
 * it was prepared. Its handle is still to be freed, by sarrus_plan_free.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_release(struct sarrus_robot *robot,
                                   const struct sarrus_plan *plan);

/**
 * Frees the memory of a plan handle, before or after its robot; NULL does nothing.
 */
void sarrus_plan_free(struct sarrus_plan *plan);

/**
 * Actuator forces for a motion: tau_u = G_u^-T (M_y ydd + C_y).
 *
 * y [m, rad] (n_qy), yd and ydd (n_vy), tau_u [N, N m] (n_u).
 *
 * This and the four functions below: the first call of each prepares its plan and allocates, later
 * ones never do, in process and through a lane; sarrus_robot_prepare_... does that ahead of time.
 * After a failure all results are NaN, unless a pointer cannot be used. `warnings` gets bits of
 * sarrus_warning after SARRUS_STATUS_OK, and may be NULL.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_inverse_dynamics(struct sarrus_robot *robot,
                                            const double *y,
                                            size_t n_qy,
                                            const double *yd,
                                            const double *ydd,
                                            size_t n_vy,
                                            double *tau_u,
                                            size_t n_u,
                                            uint32_t *warnings);

/**
 * Motion under actuator forces: ydd = M_y^-1 (G_u^T tau_u - C_y).
 *
 * y [m, rad] (n_qy), yd (n_vy), tau_u [N, N m] (n_u), ydd (n_ydd, which is n_vy).
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_forward_dynamics(struct sarrus_robot *robot,
                                            const double *y,
                                            size_t n_qy,
                                            const double *yd,
                                            size_t n_vy,
                                            const double *tau_u,
                                            size_t n_u,
                                            double *ydd,
                                            size_t n_ydd,
                                            uint32_t *warnings);

/**
 * The motion of all joints of the spanning tree that goes with an independent motion.
 *
 * y [m, rad] (n_qy), yd and ydd (n_vy); q (n_q), qd and qdd (n_v).
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_state(struct sarrus_robot *robot,
                                 const double *y,
                                 size_t n_qy,
                                 const double *yd,
                                 const double *ydd,
                                 size_t n_vy,
                                 double *q,
                                 size_t n_q,
                                 double *qd,
                                 double *qdd,
                                 size_t n_v,
                                 uint32_t *warnings);

/**
 * The actuators' motion: u, ud = G_u yd, udd = G_u ydd + g_u.
 *
 * y [m, rad] (n_qy), yd and ydd (n_vy); u, ud and udd (n_u).
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_to_actuators(struct sarrus_robot *robot,
                                        const double *y,
                                        size_t n_qy,
                                        const double *yd,
                                        const double *ydd,
                                        size_t n_vy,
                                        double *u,
                                        double *ud,
                                        double *udd,
                                        size_t n_u,
                                        uint32_t *warnings);

/**
 * The independent motion that encoders of the actuators show: the inverse of
 * sarrus_robot_to_actuators, from the pose where all coordinates are zero.
 *
 * u [m, rad], ud and udd (n_u); y (n_qy), yd and ydd (n_vy).
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_to_independent(struct sarrus_robot *robot,
                                          const double *u,
                                          const double *ud,
                                          const double *udd,
                                          size_t n_u,
                                          double *y,
                                          size_t n_qy,
                                          double *yd,
                                          double *ydd,
                                          size_t n_vy,
                                          uint32_t *warnings);

/**
 * Prepares sarrus_robot_inverse_dynamics, so that its first call does not allocate either.
 * `plan` may be NULL; else it gets a plan for sarrus_robot_ask, to be freed by sarrus_plan_free.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_prepare_inverse_dynamics(struct sarrus_robot *robot,
                                                    struct sarrus_plan **plan);

/**
 * Prepares sarrus_robot_forward_dynamics.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_prepare_forward_dynamics(struct sarrus_robot *robot,
                                                    struct sarrus_plan **plan);

/**
 * Prepares sarrus_robot_state.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_prepare_state(struct sarrus_robot *robot,
                                         struct sarrus_plan **plan);

/**
 * Prepares sarrus_robot_to_actuators.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_prepare_to_actuators(struct sarrus_robot *robot,
                                                struct sarrus_plan **plan);

/**
 * Prepares sarrus_robot_to_independent.
 */
SARRUS_MUST_USE
sarrus_status sarrus_robot_prepare_to_independent(struct sarrus_robot *robot,
                                                  struct sarrus_plan **plan);

/**
 * Connects to a running bridge, with the fingerprint of the model that commands are computed with:
 * sarrus_robot_fingerprint, or 0 where the bridge has none. Freed by sarrus_controller_free.
 */
SARRUS_MUST_USE
sarrus_status sarrus_controller_connect(const char *name,
                                        uint64_t fingerprint,
                                        struct sarrus_controller **controller);

/**
 * Sends a command, which begins with zeros; its sequence, stamp and fingerprint are filled in.
 * SARRUS_STATUS_NOT_SENT where it could not be sent. Never allocates.
 */
SARRUS_MUST_USE
sarrus_status sarrus_controller_send(struct sarrus_controller *controller,
                                     struct sarrus_actuator_command *command);

/**
 * The newest state of the actuators, once: SARRUS_STATUS_NOTHING_NEW until there is another. One
 * whose stamp is older than a few cycles means that the bridge is gone.
 */
SARRUS_MUST_USE
sarrus_status sarrus_controller_state(const struct sarrus_controller *controller,
                                      struct sarrus_actuator_state *state);

/**
 * Asks the bridge for a sarrus_operation. `stamp_ns` gets the time of asking [ns], after which
 * states may show it, and may be NULL. Stay until one does, and ask again: a bridge that does not
 * know of this program yet does not hear it.
 */
SARRUS_MUST_USE
sarrus_status sarrus_controller_operate(const struct sarrus_controller *controller,
                                        uint32_t operation,
                                        uint64_t *stamp_ns);

/**
 * Requests an operation of the mechanism that an actuator acts on, by its place in u.
 */
SARRUS_MUST_USE
sarrus_status sarrus_controller_operate_mechanism(const struct sarrus_controller *controller,
                                                  uint32_t operation,
                                                  size_t actuator,
                                                  uint64_t *stamp_ns);

/**
 * Frees a controller: its motors are damped after T1, and without power after T2; NULL does
 * nothing.
 */
void sarrus_controller_free(struct sarrus_controller *controller);

/**
 * Connects to a running bridge, to watch it. Freed by sarrus_observer_free.
 */
SARRUS_MUST_USE
sarrus_status sarrus_observer_connect(const char *name,
                                      struct sarrus_observer **observer);

/**
 * The newest state of the actuators, once: SARRUS_STATUS_NOTHING_NEW until there is another. One
 * whose stamp is older than a few cycles means that the bridge is gone.
 */
SARRUS_MUST_USE
sarrus_status sarrus_observer_state(const struct sarrus_observer *observer,
                                    struct sarrus_actuator_state *state);

/**
 * Asks the bridge for a sarrus_operation. `stamp_ns` gets the time of asking [ns], after which
 * states may show it, and may be NULL. Stay until one does, and ask again: a bridge that does not
 * know of this program yet does not hear it.
 */
SARRUS_MUST_USE
sarrus_status sarrus_observer_operate(const struct sarrus_observer *observer,
                                      uint32_t operation,
                                      uint64_t *stamp_ns);

/**
 * Requests an operation of the mechanism that an actuator acts on, by its place in u.
 */
SARRUS_MUST_USE
sarrus_status sarrus_observer_operate_mechanism(const struct sarrus_observer *observer,
                                                uint32_t operation,
                                                size_t actuator,
                                                uint64_t *stamp_ns);

/**
 * Frees an observer; NULL does
 * nothing.
 */
void sarrus_observer_free(struct sarrus_observer *observer);

/**
 * CLOCK_MONOTONIC, which all processes of a machine share and stamps are in [ns].
 */
uint64_t sarrus_now_ns(void);

/**
 * Name of a sarrus_mechanism_state; NULL for a number that is none. Lives for ever.
 */
const char *sarrus_mechanism_state_name(uint32_t state);

/**
 * Name of a sarrus_reason; NULL for a number that is none. Lives for ever.
 */
const char *sarrus_reason_name(uint32_t reason);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SARRUS_H */
