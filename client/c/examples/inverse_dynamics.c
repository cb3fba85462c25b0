/*
 * Actuator forces for a motion: inverse_dynamics [ROBOT | --connect NAME].
 *
 * ROBOT is a bundled one, "lambda" without. Prints a line for each actuator.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <sarrus.h>

static int fail(const char *what, sarrus_status status) {
    fprintf(stderr, "%s: %s: %s\n", what, sarrus_status_name(status), sarrus_last_error());
    return EXIT_FAILURE;
}

int main(int argc, char **argv) {
    if (sarrus_abi_version() != SARRUS_ABI_VERSION) {
        fprintf(stderr, "libsarrus is of another version than sarrus.h\n");
        return EXIT_FAILURE;
    }

    sarrus_robot *robot = NULL;
    sarrus_status status = argc > 2 && strcmp(argv[1], "--connect") == 0
                               ? sarrus_robot_connect(argv[2], NULL, &robot)
                               : sarrus_robot_bundled(argc > 1 ? argv[1] : "lambda", NULL, &robot);
    if (status != SARRUS_STATUS_OK) {
        return fail("robot", status);
    }
    sarrus_sizes n;
    status = sarrus_robot_sizes(robot, &n);
    if (status != SARRUS_STATUS_OK) {
        return fail("sizes", status);
    }

    /* one array for all numbers; one more than needed, since calloc(0) may give NULL */
    double *numbers = calloc(n.n_qy + 2 * n.n_vy + n.n_u + 1, sizeof *numbers);
    if (numbers == NULL) {
        return EXIT_FAILURE;
    }
    double *y = numbers, *yd = y + n.n_qy, *ydd = yd + n.n_vy, *tau_u = ydd + n.n_vy;
    for (size_t k = 0; k < n.n_vy; ++k) {
        y[k] = 0.01 * (double)(k + 1);
        yd[k] = 0.1 * (double)(k + 1);
        ydd[k] = -0.2 * (double)(k + 1);
    }

    /* nothing allocates after the plan is prepared */
    status = sarrus_robot_prepare_inverse_dynamics(robot, NULL);
    if (status != SARRUS_STATUS_OK) {
        return fail("prepare", status);
    }
    uint32_t warnings = 0;
    status = sarrus_robot_inverse_dynamics(robot, y, n.n_qy, yd, ydd, n.n_vy, tau_u, n.n_u,
                                           &warnings);
    if (status != SARRUS_STATUS_OK) {
        return fail("inverse dynamics", status);
    }
    for (size_t k = 0; k < n.n_u; ++k) {
        const char *name = sarrus_robot_name_at(robot, SARRUS_ORDER_ACTIVE, k);
        printf("%s: %.17g\n", name, tau_u[k]);
    }
    if (warnings != 0) {
        fprintf(stderr, "warning: %s\n", sarrus_warning_name(warnings));
    }

    free(numbers);
    sarrus_robot_free(robot);
    return EXIT_SUCCESS;
}
