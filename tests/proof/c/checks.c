/* Mistakes of programs in C, and the errors that they get: checks [SERVER]. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include <sarrus.h>

#include "check.h"

#define IS(call, name) CHECK(strcmp(sarrus_status_name(call), name) == 0)

static int says(const char *part) { return strstr(sarrus_last_error(), part) != NULL; }

/* NULL in place of any argument is an error and no crash. */
static int nothing(void) {
    double x[1] = {0.0};
    sarrus_robot *robot = NULL;
    sarrus_controller *controller = NULL;
    IS(sarrus_robot_bundled(NULL, NULL, &robot), "null_pointer");
    IS(sarrus_robot_bundled("lambda", NULL, NULL), "null_pointer");
    IS(sarrus_robot_load(NULL, NULL, NULL, &robot), "null_pointer");
    IS(sarrus_robot_load_text(NULL, 5, NULL, 0, NULL, &robot), "null_pointer");
    IS(sarrus_robot_connect(NULL, NULL, &robot), "null_pointer");
    CHECK(robot == NULL);
    IS(sarrus_robot_sizes(NULL, NULL), "null_pointer");
    IS(sarrus_robot_limits(NULL, 0, NULL), "null_pointer");
    IS(sarrus_robot_prepare(NULL, NULL, NULL), "null_pointer");
    IS(sarrus_robot_ask(NULL, NULL, NULL, 0, NULL, 0, NULL), "null_pointer");
    IS(sarrus_robot_release(NULL, NULL), "null_pointer");
    IS(sarrus_plan_given(NULL, NULL, NULL), "null_pointer");
    IS(sarrus_plan_want(NULL, NULL, NULL), "null_pointer");
    IS(sarrus_robot_set_options(NULL, 0), "null_pointer");
    IS(sarrus_robot_inverse_dynamics(NULL, x, 1, x, x, 1, NULL, 0, NULL), "null_pointer");
    IS(sarrus_robot_prepare_state(NULL, NULL), "null_pointer");
    IS(sarrus_controller_connect(NULL, 0, &controller), "null_pointer");
    IS(sarrus_controller_send(NULL, NULL), "null_pointer");
    IS(sarrus_controller_state(NULL, NULL), "null_pointer");
    IS(sarrus_controller_operate(NULL, 1, NULL), "null_pointer");
    IS(sarrus_controller_operate_mechanism(NULL, 1, 0, NULL), "null_pointer");
    IS(sarrus_observer_connect(NULL, NULL), "null_pointer");
    IS(sarrus_observer_state(NULL, NULL), "null_pointer");
    IS(sarrus_observer_operate(NULL, 1, NULL), "null_pointer");
    CHECK(sarrus_robot_name(NULL) == NULL && sarrus_robot_fingerprint(NULL) == 0);
    CHECK(sarrus_robot_name_count(NULL, 0) == 0 && sarrus_robot_name_at(NULL, 0, 0) == NULL);
    CHECK(!sarrus_robot_times(NULL, NULL) && sarrus_robot_late(NULL) == 0);
    CHECK(sarrus_plan_inputs(NULL) == 0 && sarrus_plan_outputs(NULL) == 0);
    sarrus_robot_free(NULL);
    sarrus_plan_free(NULL);
    sarrus_controller_free(NULL);
    sarrus_observer_free(NULL);
    return 0;
}

/* Robots that cannot be loaded or found. */
static int absent(void) {
    sarrus_robot *robot = NULL;
    sarrus_controller *controller = NULL;
    const char fault[] = "<robot name='x'><link/></robot>";
    const char *locks[] = {"=1"};
    sarrus_load_options options = sarrus_load_defaults();
    sarrus_connect_options connecting = sarrus_connect_defaults();
    IS(sarrus_robot_bundled("lamda", NULL, &robot), "load_failed");
    CHECK(says("did you mean `lambda`"));
    IS(sarrus_robot_load_text(fault, strlen(fault), NULL, 0, NULL, &robot), "load_failed");
    IS(sarrus_robot_load("/nowhere.urdf", NULL, NULL, &robot), "load_failed");
    IS(sarrus_robot_bundled("\xff", NULL, &robot), "bad_text");
    options.lock = locks;
    options.n_lock = 1;
    IS(sarrus_robot_bundled("lambda", &options, &robot), "bad_text");
    IS(sarrus_robot_connect("nobody", NULL, &robot), "connect_failed");
    connecting.transport = 7;
    IS(sarrus_robot_connect("nobody", &connecting, &robot), "unknown_number");
    IS(sarrus_controller_connect("nobody", 0, &controller), "connect_failed");
    CHECK(robot == NULL && controller == NULL);
    return 0;
}

/* Names, sizes, and arrays that do not fit. */
static int arrays(void) {
    sarrus_robot *robot = NULL;
    sarrus_sizes n;
    sarrus_limits limits;
    double y = 0.2, yd = 1.0, ydd = 0.0, tau_u = 0.0, bytes[2] = {0.0, 0.0};
    uint32_t warnings = 77;
    IS(sarrus_robot_bundled("lambda", NULL, &robot), "ok");
    CHECK(strcmp(sarrus_robot_name(robot), "lambda") == 0 || sarrus_robot_name(robot)[0] != 0);
    IS(sarrus_robot_sizes(robot, &n), "ok");
    CHECK(n.n_qy == 1 && n.n_vy == 1 && n.n_u == 1);
    CHECK(sarrus_robot_name_count(robot, SARRUS_ORDER_ACTIVE) == 1);
    CHECK(sarrus_robot_name_at(robot, SARRUS_ORDER_ACTIVE, 0) != NULL);
    CHECK(sarrus_robot_name_at(robot, SARRUS_ORDER_ACTIVE, 1) == NULL);
    CHECK(sarrus_robot_name_count(robot, 99) == 0);
    IS(sarrus_robot_limits(robot, 0, &limits), "ok");
    CHECK(limits.lower < limits.upper);
    IS(sarrus_robot_limits(robot, 99, &limits), "unknown_number");
    CHECK(says("no tree coordinate 99; this robot has 3"));
    IS(sarrus_robot_set_options(robot, 1u << 9), "unknown_number");

    IS(sarrus_robot_inverse_dynamics(robot, &y, 1, &yd, &ydd, 1, &tau_u, 1, &warnings), "ok");
    CHECK(warnings == 0 && isfinite(tau_u));
    IS(sarrus_robot_inverse_dynamics(robot, &y, 0, &yd, &ydd, 1, &tau_u, 1, NULL), "wrong_size");
    CHECK(isnan(tau_u) && says("`y`"));
    IS(sarrus_robot_inverse_dynamics(robot, NULL, 1, &yd, &ydd, 1, &tau_u, 1, NULL),
       "null_pointer");
    IS(sarrus_robot_inverse_dynamics(robot, &y, (size_t)-1, &yd, &ydd, 1, &tau_u, 1, NULL),
       "wrong_size");
    IS(sarrus_robot_inverse_dynamics(robot, &y, 1, &yd, &ydd, 1, &yd, 1, NULL),
       "overlapping_arrays");
    const double *odd = (const double *)(const void *)((const char *)bytes + 1);
    IS(sarrus_robot_inverse_dynamics(robot, odd, 1, &yd, &ydd, 1, &tau_u, 1, NULL),
       "unaligned_pointer");
    y = NAN;
    IS(sarrus_robot_inverse_dynamics(robot, &y, 1, &yd, &ydd, 1, &tau_u, 1, NULL),
       "non_finite_input");
    CHECK(isnan(tau_u));
    sarrus_robot_free(robot);
    return 0;
}

/* Plans belong to their robot, and end. */
static int plans(void) {
    sarrus_robot *robot = NULL, *other = NULL;
    sarrus_plan *plan = NULL, *direct = NULL;
    sarrus_slot slot;
    const char *given[] = {"yd", "y"}, *want[] = {"C_y", "M_y"}, *wrong[] = {"z", "tau"};
    double input[2] = {0.2, 1.0}, output[2] = {0.0, 0.0};
    sarrus_query query = {0};
    IS(sarrus_robot_bundled("lambda", NULL, &robot), "ok");
    IS(sarrus_robot_bundled("lambda", NULL, &other), "ok");
    IS(sarrus_robot_prepare(robot, &query, &plan), "unknown_number");
    query.request = SARRUS_REQUEST_INVERSE_DYNAMICS;
    query.given = given;
    query.n_given = 2;
    query.want = wrong;
    query.n_want = 2;
    IS(sarrus_robot_prepare(robot, &query, &plan), "unknown_name");
    CHECK(says("`z`") && says("`tau`") && plan == NULL);
    query.want = want;
    query.joints = wrong;
    query.n_joints = 1;
    IS(sarrus_robot_prepare(robot, &query, &plan), "unknown_name");
    CHECK(!says("::") && plan == NULL);
    query.n_joints = 0;
    query.want = NULL;
    IS(sarrus_robot_prepare(robot, &query, &plan), "null_pointer");
    query.want = want;
    query.reserved[4] = 1;
    IS(sarrus_robot_prepare(robot, &query, &plan), "unknown_number");
    query.reserved[4] = 0;
    query.n_directions = 65;
    IS(sarrus_robot_prepare(robot, &query, &plan), "bad_query");
    query.n_directions = 0;
    query.axes = 3;
    IS(sarrus_robot_prepare(robot, &query, &plan), "unknown_number");
    query.axes = SARRUS_AXES_LOCAL;
    query.relative_to = "Elbow";
    IS(sarrus_robot_prepare(robot, &query, &plan), "unknown_name");
    CHECK(says("`Elbow`"));
    query.relative_to = NULL;
    query.axes = SARRUS_AXES_MIXED;
    /* a task of a link, whose target has eleven numbers */
    const char *links[] = {"Elbow_Link"};
    const uint8_t parts[] = {SARRUS_TASK_PART_POSITION | SARRUS_TASK_PART_ORIENTATION};
    sarrus_query reach = {0};
    reach.request = SARRUS_REQUEST_INVERSE_KINEMATICS;
    reach.frames = links;
    reach.n_frames = 1;
    IS(sarrus_robot_prepare(robot, &reach, &plan), "bad_query");
    reach.tasks = parts;
    IS(sarrus_robot_prepare(robot, &reach, &plan), "ok");
    CHECK(sarrus_plan_inputs(plan) == 11);
    sarrus_plan_free(plan);
    query.options = SARRUS_QUERY_OPTION_TIMES;
    IS(sarrus_robot_prepare(robot, &query, &plan), "ok");
    CHECK(sarrus_plan_inputs(plan) == 2 && sarrus_plan_outputs(plan) == 2);
    IS(sarrus_plan_given(plan, "yd", &slot), "ok");
    CHECK(slot.offset == 1 && slot.rows == 1 && slot.columns == 1);
    IS(sarrus_plan_want(plan, "M_y", &slot), "ok");
    IS(sarrus_plan_want(plan, "tau_u", &slot), "unknown_name");
    CHECK(says("`tau_u` is no field of this plan"));
    IS(sarrus_plan_given(plan, "nothing", &slot), "unknown_name");
    IS(sarrus_robot_ask(robot, plan, input, 2, output, 2, NULL), "ok");
    CHECK(output[slot.offset] > 0.0);
    sarrus_times times;
    CHECK(sarrus_robot_times(robot, &times) && times.age_ns == 0);
    IS(sarrus_robot_ask(robot, plan, input, 2, output, 1, NULL), "wrong_size");
    CHECK(isnan(output[0]) && !isnan(output[1]));
    IS(sarrus_robot_ask(robot, plan, input, 2, input, 2, NULL), "overlapping_arrays");
    IS(sarrus_robot_ask(robot, NULL, input, 2, output, 2, NULL), "null_pointer");
    /* rows: the bits of single states, and a status for each */
    double rows[1200], answers[1200];
    int32_t statuses[600];
    uint32_t warnings[600], warning;
    for (int k = 0; k < 1200; ++k) {
        rows[k] = k == 84 ? NAN : 1e-3 * k;
    }
    for (size_t threads = 0; threads < 4; ++threads) {
        IS(sarrus_robot_batch(robot, plan, threads, 600, rows, 1200, answers, 1200, statuses,
                              warnings),
           "non_finite_input");
        for (int k = 0; k < 600; ++k) {
            int32_t status = (int32_t)sarrus_robot_ask(robot, plan, rows + 2 * k, 2, output, 2,
                                                       &warning);
            CHECK(statuses[k] == status && (status == 0) == (k != 42) && warnings[k] == warning);
            CHECK(memcmp(answers + 2 * k, output, sizeof output) == 0);
        }
    }
    IS(sarrus_robot_batch(robot, plan, 1, 42, rows, 84, answers, 84, NULL, NULL), "ok");
    IS(sarrus_robot_batch(robot, plan, 1, 0, NULL, 0, NULL, 0, NULL, NULL), "ok");
    IS(sarrus_robot_batch(robot, plan, 1, 42, rows, 84, answers, 83, statuses, NULL), "wrong_size");
    CHECK(isnan(answers[82]) && !isnan(answers[83]) && statuses[41] == SARRUS_STATUS_WRONG_SIZE);
    IS(sarrus_robot_batch(robot, plan, 1, (size_t)-1, rows, 84, answers, 84, NULL, NULL),
       "wrong_size");
    IS(sarrus_robot_batch(robot, plan, 1, 42, rows, 84, rows, 84, NULL, NULL),
       "overlapping_arrays");
    IS(sarrus_robot_batch(robot, plan, 1, 42, rows, 84, answers, 84, (int32_t *)answers, NULL),
       "overlapping_arrays");
    IS(sarrus_robot_batch(robot, plan, 1, 42, rows, 84, answers, 84, statuses,
                          (uint32_t *)statuses),
       "overlapping_arrays");
    IS(sarrus_robot_batch(robot, plan, 1, 42, rows, 84, answers, 84,
                          (int32_t *)(void *)((char *)statuses + 1), NULL),
       "unaligned_pointer");
    IS(sarrus_robot_batch(other, plan, 1, 1, rows, 2, answers, 2, statuses, NULL), "unknown_plan");
    CHECK(isnan(answers[0]) && statuses[0] == SARRUS_STATUS_UNKNOWN_PLAN);
    IS(sarrus_robot_batch(NULL, plan, 1, 1, rows, 2, answers, 2, NULL, NULL), "null_pointer");
    IS(sarrus_robot_ask(other, plan, input, 2, output, 2, NULL), "unknown_plan");
    IS(sarrus_robot_release(other, plan), "unknown_plan");
    IS(sarrus_robot_release(robot, plan), "ok");
    IS(sarrus_robot_ask(robot, plan, input, 2, output, 2, NULL), "released_plan");
    IS(sarrus_robot_release(robot, plan), "released_plan");
    IS(sarrus_robot_prepare_to_actuators(robot, &direct), "ok");
    CHECK(sarrus_plan_inputs(direct) == 3 && sarrus_plan_outputs(direct) == 3);
    sarrus_plan_free(direct);
    sarrus_robot_free(other);
    sarrus_robot_free(robot);
    /* a plan's handle may outlive its robot */
    CHECK(sarrus_plan_inputs(plan) == 2);
    sarrus_plan_free(plan);
    return 0;
}

/* A server that dies between two calls: a line on stdout asks for it, one on stdin confirms it. */
static int dead_server(const char *name) {
    sarrus_robot *robot = NULL;
    double y = 0.2, yd = 1.0, ydd = 0.0, tau_u = 0.0;
    sarrus_connect_options options = sarrus_connect_defaults();
    options.timeout_ns = 5000000000;
    IS(sarrus_robot_connect(name, &options, &robot), "ok");
    IS(sarrus_robot_inverse_dynamics(robot, &y, 1, &yd, &ydd, 1, &tau_u, 1, NULL), "ok");
    CHECK(isfinite(tau_u));
    const char *given[] = {"y"}, *want[] = {"tau_u"};
    sarrus_plan *plan = NULL;
    sarrus_query query = {0};
    query.request = SARRUS_REQUEST_INVERSE_DYNAMICS;
    query.given = given;
    query.n_given = 1;
    query.want = want;
    query.n_want = 1;
    IS(sarrus_robot_prepare(robot, &query, &plan), "ok");
    printf("kill\n");
    fflush(stdout);
    CHECK(getchar() == '\n');
    IS(sarrus_robot_inverse_dynamics(robot, &y, 1, &yd, &ydd, 1, &tau_u, 1, NULL), "server_gone");
    CHECK(isnan(tau_u) && says(name));
    /* rows without an answer have the reason as their status */
    double rows[2] = {0.1, 0.2}, forces[2] = {0.0, 0.0};
    int32_t statuses[2] = {0, 0};
    IS(sarrus_robot_batch(robot, plan, 1, 2, rows, 2, forces, 2, statuses, NULL), "server_gone");
    CHECK(isnan(forces[1]) && statuses[0] == SARRUS_STATUS_SERVER_GONE);
    CHECK(statuses[1] == SARRUS_STATUS_SERVER_GONE);
    sarrus_plan_free(plan);
    sarrus_robot_free(robot);
    return 0;
}

/* steps of an observer, on a pendulum that is held with 2 N m too little */
static int observer(void) {
    sarrus_robot *robot = NULL;
    sarrus_plan *plan = NULL;
    IS(sarrus_robot_bundled("lambda", NULL, &robot), "ok");
    const char *given[] = {"y", "yd", "tau_y", "dt", "gain", "observer"};
    sarrus_query query = {0};
    query.request = SARRUS_REQUEST_OBSERVE;
    query.given = given;
    query.n_given = 6;
    IS(sarrus_robot_prepare(robot, &query, &plan), "ok");
    CHECK(sarrus_plan_inputs(plan) == 8 && sarrus_plan_outputs(plan) == 4);
    /* y, yd, tau_y, dt, gain, observer in; observer, tau_external out */
    double input[8] = {0.0}, output[4];
    for (int k = 0; k < 21; k++) {
        IS(sarrus_robot_ask(robot, plan, input, 8, output, 4, NULL), "ok");
        input[3] = 0.1;
        input[4] = 20.0;
        memcpy(input + 5, output, 3 * sizeof(double));
    }
    /* at rest the rate of the momentum is what the external force balances */
    CHECK(fabs(output[2]) > 0.1 && fabs(output[3] + output[2]) < 1e-12);
    sarrus_plan_free(plan);
    sarrus_robot_free(robot);
    return 0;
}

int main(int argc, char **argv) {
    CHECK(sarrus_abi_version() == SARRUS_ABI_VERSION && sarrus_version()[0] != 0);
    CHECK(sarrus_last_error()[0] == 0);
    IS(-1, "unknown");
    CHECK(strcmp(sarrus_warning_name(6), "ill_conditioned") == 0 && !sarrus_warning_name(0));
    CHECK(strcmp(sarrus_reason_name(15), "other_mechanism") == 0 && !sarrus_reason_name(99));
    CHECK(strcmp(sarrus_mechanism_state_name(2), "enabled") == 0);
    if (argc > 1) {
        return dead_server(argv[1]);
    }
    return nothing() || absent() || arrays() || plans() || observer();
}
