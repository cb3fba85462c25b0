/*
 * Nothing allocates after set-up: steady COUNT [SERVER]. Every call of the allocator by this
 * process is counted, and how much memory it has.
 */
#include <stdio.h>
#include <stdlib.h>

#include <sarrus.h>

extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *block, size_t size);
extern void *__libc_memalign(size_t alignment, size_t size);
extern void __libc_free(void *block);

static volatile unsigned long calls;

void *malloc(size_t size) {
    calls += 1;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
    calls += 1;
    return __libc_calloc(count, size);
}

void *realloc(void *block, size_t size) {
    calls += 1;
    return __libc_realloc(block, size);
}

void *aligned_alloc(size_t alignment, size_t size) {
    calls += 1;
    return __libc_memalign(alignment, size);
}

int posix_memalign(void **block, size_t alignment, size_t size) {
    calls += 1;
    *block = __libc_memalign(alignment, size);
    return *block == NULL;
}

void free(void *block) {
    calls += block != NULL;
    __libc_free(block);
}

/* Pages of this process, read without the allocator's help. */
static long pages(void) {
    static char buffer[256];
    long size = 0, resident = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file == NULL || fgets(buffer, sizeof buffer, file) == NULL ||
        sscanf(buffer, "%ld %ld", &size, &resident) != 2) {
        return -1;
    }
    fclose(file);
    return resident;
}

int main(int argc, char **argv) {
    const long count = argc > 1 ? atol(argv[1]) : 1000;
    sarrus_robot *robot = NULL;
    sarrus_plan *plan = NULL;
    const char *given[] = {"y", "yd"};
    sarrus_query query = {0};
    double y = 0.2, yd = 1.0, ydd = 0.0, tau_u = 0.0, input[2] = {0.2, 1.0}, output[2];
    query.request = SARRUS_REQUEST_INVERSE_DYNAMICS;
    query.given = given;
    query.n_given = 2;

    sarrus_status status = argc > 2 ? sarrus_robot_connect(argv[2], NULL, &robot)
                                    : sarrus_robot_bundled("lambda", NULL, &robot);
    if (status != SARRUS_STATUS_OK ||
        sarrus_robot_prepare(robot, &query, &plan) != SARRUS_STATUS_OK ||
        sarrus_robot_prepare_inverse_dynamics(robot, NULL) != SARRUS_STATUS_OK ||
        sarrus_plan_outputs(plan) != 2) {
        fprintf(stderr, "%s\n", sarrus_last_error());
        return 1;
    }
    const unsigned long set_up = calls;
    long pages_before = 0;
    unsigned long before = 0;
    for (long k = -100; k < count; ++k) {
        if (k == 0) {
            pages_before = pages();
            before = calls;
        }
        y = 0.2 + 1e-9 * (double)(k % 1000);
        if (sarrus_robot_inverse_dynamics(robot, &y, 1, &yd, &ydd, 1, &tau_u, 1, NULL) !=
                SARRUS_STATUS_OK ||
            sarrus_robot_ask(robot, plan, input, 2, output, 2, NULL) != SARRUS_STATUS_OK) {
            fprintf(stderr, "%s\n", sarrus_last_error());
            return 1;
        }
        /* failures do not allocate either: a wrong size, and no answer */
        if (sarrus_robot_ask(robot, plan, input, 1, output, 2, NULL) != SARRUS_STATUS_WRONG_SIZE ||
            sarrus_robot_ask(robot, NULL, input, 2, output, 2, NULL) !=
                SARRUS_STATUS_NULL_POINTER) {
            return 1;
        }
    }
    const unsigned long after = calls - before;
    printf("set-up %lu, after %lu, pages %ld\n", set_up, after, pages() - pages_before);
    sarrus_plan_free(plan);
    sarrus_robot_free(robot);
    return 0;
}
