/* A condition that must hold; otherwise the program prints its place and exits. */
#include <stdio.h>

#include <sarrus.h>

#define CHECK(condition)                                                                          \
    do {                                                                                          \
        if (!(condition)) {                                                                       \
            fprintf(stderr, "%s:%d: not %s (%s)\n", __FILE__, __LINE__, #condition,               \
                    sarrus_last_error());                                                         \
            return 1;                                                                             \
        }                                                                                         \
    } while (0)
