
/* what the function returns */
#define @UPPER@_OK 0
/* some coordinate, velocity or force is outside of its limits; the numbers are right */
#define @UPPER@_LIMITS_EXCEEDED 1
/* ask the generic kernel: the numbers are none */
#define @UPPER@_NOT_ANSWERED 2

#ifdef __cplusplus
extern "C" {
#endif

/* in[@UPPER@_INPUTS], out[@UPPER@_OUTPUTS]; no memory, no state, one branch at
   the end: without an answer out is NaN */
int @NAME@(const double *in, double *out);

/* with SARRUS_ROWS defined, and compilers that have vectors: so many states at once,
   in[@UPPER@_ROWS][@UPPER@_INPUTS], out[@UPPER@_ROWS][@UPPER@_OUTPUTS]; returns bit k where row k has no
   answer and its numbers are none, bit k + @UPPER@_ROWS where it is outside of its limits.
   The symbol has the number: what was compiled for another one is not linked. On devices a kernel has one state. */
#if defined(__OPENCL_VERSION__) || defined(__CUDACC__) || defined(__HIPCC__)
#define @UPPER@_ROWS 1
#elif defined(SARRUS_ROWS) && defined(__GNUC__)
#if defined(__AVX512F__)
#define @UPPER@_ROWS 8
#define @NAME@_rows @NAME@_rows8
#else
#define @UPPER@_ROWS 4
#define @NAME@_rows @NAME@_rows4
#endif
int @NAME@_rows(const double *in, double *out);
#endif

#ifdef __cplusplus
}
#endif

#endif
