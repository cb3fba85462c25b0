/*
 * Times of a call: calls [SERVER], through a lane or in this process. For each line on stdin,
 * COUNT, it asks so often and prints how long one call took on average [ns]; the first line that it
 * prints is the answer.
 */
#include <stdio.h>
#include <time.h>

#include <sarrus.h>

static double now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

int main(int argc, char **argv) {
    sarrus_robot *robot = NULL;
    sarrus_plan *plan = NULL;
    const char *given[] = {"y", "yd", "ydd"}, *want[] = {"tau_u"};
    const double input[] = {0.2, 1.0, 0.0};
    double tau_u[1];
    long count;
    sarrus_query query = {0};
    query.request = SARRUS_REQUEST_INVERSE_DYNAMICS;
    query.given = given;
    query.n_given = 3;
    query.want = want;
    query.n_want = 1;
    sarrus_status status = argc > 1 ? sarrus_robot_connect(argv[1], NULL, &robot)
                                    : sarrus_robot_bundled("lambda", NULL, &robot);
    if (status != SARRUS_STATUS_OK ||
        sarrus_robot_prepare(robot, &query, &plan) != SARRUS_STATUS_OK ||
        sarrus_robot_ask(robot, plan, input, 3, tau_u, 1, NULL) != SARRUS_STATUS_OK) {
        fprintf(stderr, "%s\n", sarrus_last_error());
        return 1;
    }
    printf("%.17g\n", tau_u[0]);
    fflush(stdout);
    while (scanf("%ld", &count) == 1) {
        const double start = now_ns();
        for (long k = 0; k < count; ++k) {
            if (sarrus_robot_ask(robot, plan, input, 3, tau_u, 1, NULL) != SARRUS_STATUS_OK) {
                return 1;
            }
        }
        printf("%.1f\n", (now_ns() - start) / (double)count);
        fflush(stdout);
    }
    sarrus_plan_free(plan);
    sarrus_robot_free(robot);
    return 0;
}
