/*
 * The child of a fork asks through the connection of its parent: fork SERVER. Every answer to it is
 * other_process, the parent goes on, and the child connects on its own.
 */
#include <math.h>
#include <sys/wait.h>
#include <unistd.h>

#include "check.h"

enum { ROWS = 64 };

static const double Y[ROWS] = {0.2}, ZERO = 0.0;

static sarrus_status ask(sarrus_robot *robot, double *force) {
    return sarrus_robot_inverse_dynamics(robot, Y, 1, &ZERO, &ZERO, 1, force, 1, NULL);
}

static sarrus_status ask_rows(sarrus_robot *robot, const sarrus_plan *plan, double *forces,
                              int32_t *statuses) {
    return sarrus_robot_batch(robot, plan, 1, ROWS, Y, ROWS, forces, ROWS, statuses, NULL);
}

static int child(sarrus_robot *robot, sarrus_plan *plan, const char *name, double expected) {
    double force, forces[ROWS];
    int32_t statuses[ROWS];
    for (int call = 0; call < 1000; call++) {
        CHECK(ask(robot, &force) == SARRUS_STATUS_OTHER_PROCESS && isnan(force));
        CHECK(ask_rows(robot, plan, forces, statuses) == SARRUS_STATUS_OTHER_PROCESS);
        CHECK(statuses[ROWS - 1] == SARRUS_STATUS_OTHER_PROCESS && isnan(forces[0]));
    }
    CHECK(sarrus_robot_prepare_state(robot, NULL) == SARRUS_STATUS_OTHER_PROCESS);
    CHECK(sarrus_robot_release(robot, plan) == SARRUS_STATUS_OK);
    sarrus_plan_free(plan);
    sarrus_robot_free(robot);
    CHECK(sarrus_robot_connect(name, NULL, &robot) == SARRUS_STATUS_OK);
    CHECK(ask(robot, &force) == SARRUS_STATUS_OK && force == expected);
    sarrus_robot_free(robot);
    return 0;
}

static int forks(const char *name, uint32_t transport) {
    sarrus_connect_options options = sarrus_connect_defaults();
    options.transport = transport;
    sarrus_robot *robot;
    CHECK(sarrus_robot_connect(name, &options, &robot) == SARRUS_STATUS_OK);
    const char *given[] = {"y"}, *want[] = {"tau_u"};
    sarrus_query query = {0};
    query.request = SARRUS_REQUEST_INVERSE_DYNAMICS;
    query.given = given, query.n_given = 1, query.want = want, query.n_want = 1;
    sarrus_plan *plan;
    CHECK(sarrus_robot_prepare(robot, &query, &plan) == SARRUS_STATUS_OK);
    double expected, force, forces[ROWS];
    int32_t statuses[ROWS];
    CHECK(ask(robot, &expected) == SARRUS_STATUS_OK);
    CHECK(ask_rows(robot, plan, forces, statuses) == SARRUS_STATUS_OK && forces[0] == expected);

    pid_t process = fork();
    CHECK(process >= 0);
    if (process == 0) {
        _exit(child(robot, plan, name, expected));
    }
    int status = 0;
    pid_t ended = 0;
    /* while the child asks, and after it has freed its copies of the handles */
    for (int after = 0; after < 100; after += ended == process) {
        CHECK(ask(robot, &force) == SARRUS_STATUS_OK && force == expected);
        CHECK(ask_rows(robot, plan, forces, statuses) == SARRUS_STATUS_OK);
        CHECK(forces[0] == expected);
        ended = ended == process ? process : waitpid(process, &status, WNOHANG);
    }
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    sarrus_plan_free(plan);
    sarrus_robot_free(robot);
    return 0;
}

int main(int argc, char **argv) {
    CHECK(argc == 2);
    return forks(argv[1], SARRUS_TRANSPORT_LANE) || forks(argv[1], SARRUS_TRANSPORT_SERVICE);
}
