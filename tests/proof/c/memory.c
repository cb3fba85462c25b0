/* A batch without the memory that it needs is a status. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include <sarrus.h>

#include "check.h"

enum { ROWS = 4000000 };

/* Limits the memory to its present size and this many bytes more; returns 0 on success. */
static int leave(size_t bytes) {
    unsigned long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file == NULL || fscanf(file, "%lu", &pages) != 1 || fclose(file) != 0) {
        return 1;
    }
    struct rlimit limit;
    getrlimit(RLIMIT_AS, &limit);
    limit.rlim_cur = pages * (unsigned long)sysconf(_SC_PAGESIZE) + bytes;
    return setrlimit(RLIMIT_AS, &limit);
}

int main(void) {
    sarrus_robot *robot = NULL;
    sarrus_plan *plan = NULL;
    const char *given[] = {"y"}, *want[] = {"tau_u"};
    double *y = calloc(ROWS, sizeof *y), *tau_u = calloc(ROWS, sizeof *tau_u);
    int32_t *statuses = calloc(ROWS, sizeof *statuses);
    CHECK(y != NULL && tau_u != NULL && statuses != NULL);
    sarrus_query query = {0};
    query.request = SARRUS_REQUEST_INVERSE_DYNAMICS;
    query.given = given;
    query.n_given = 1;
    query.want = want;
    query.n_want = 1;
    CHECK(sarrus_robot_bundled("lambda", NULL, &robot) == SARRUS_STATUS_OK);
    CHECK(sarrus_robot_prepare(robot, &query, &plan) == SARRUS_STATUS_OK);
    CHECK(sarrus_robot_batch(robot, plan, 1, 8, y, 8, tau_u, 8, statuses, NULL) == 0);
    CHECK(leave(1 << 20) == 0);
    sarrus_status status =
        sarrus_robot_batch(robot, plan, 1, ROWS, y, ROWS, tau_u, ROWS, statuses, NULL);
    CHECK(status == SARRUS_STATUS_NO_MEMORY && strstr(sarrus_last_error(), "memory") != NULL);
    CHECK(strcmp(sarrus_status_name(status), "no_memory") == 0);
    CHECK(isnan(tau_u[0]) && isnan(tau_u[ROWS - 1]));
    CHECK(statuses[0] == status && statuses[ROWS - 1] == status);
    /* the robot still works */
    CHECK(sarrus_robot_batch(robot, plan, 1, 8, y, 8, tau_u, 8, statuses, NULL) == 0);
    CHECK(isfinite(tau_u[7]) && statuses[7] == 0);
    sarrus_plan_free(plan);
    sarrus_robot_free(robot);
    free(y);
    free(tau_u);
    free(statuses);
    return 0;
}
