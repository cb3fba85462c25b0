#if defined(SARRUS_DEVICE)
#define SARRUS_INLINE static inline SARRUS_DEVICE
#define SARRUS_APART static SARRUS_DEVICE
#define SARRUS_FUNCTION static SARRUS_DEVICE

/* numbers of one state, which stand apart by the count of states */
typedef struct {
    SARRUS_GLOBAL const double *number;
    size_t stride;
} sarrus_in;
typedef struct {
    SARRUS_GLOBAL double *number;
    size_t stride;
} sarrus_out;
#elif defined(__GNUC__)
#define SARRUS_INLINE static inline __attribute__((unused))
#define SARRUS_APART static __attribute__((noinline))
#define SARRUS_FUNCTION
#else
#define SARRUS_INLINE static inline
#define SARRUS_APART static
#define SARRUS_FUNCTION
#endif
#if !defined(SARRUS_DEVICE)
typedef const double *sarrus_in;
typedef double *sarrus_out;
#endif

/* Sine, cosine and arc tangent: the operations of sarrus, one by one. */

#if defined(__OPENCL_VERSION__)
#define sarrus_bits(x) as_ulong(x)
#define sarrus_number(bits) as_double(bits)
#else
SARRUS_INLINE uint64_t sarrus_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

SARRUS_INLINE double sarrus_number(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}
#endif

SARRUS_INLINE double sarrus_xor_sign(double x, uint64_t sign)
{
    return sarrus_number(sarrus_bits(x) ^ (sign & UINT64_C(0x8000000000000000)));
}

/* every bit where the condition holds, else none */
SARRUS_INLINE uint64_t sarrus_mask(int holds)
{
    return UINT64_C(0) - (uint64_t)holds;
}

#define sarrus_choose(first, a, b) ((first) ? (a) : (b))

SARRUS_INLINE double sarrus_larger(double a, double b)
{
    return a > b ? a : b;
}
