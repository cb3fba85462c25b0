#if defined(__GNUC__)
#define SARRUS_INLINE static inline __attribute__((unused))
#define SARRUS_APART __attribute__((noinline))
#else
#define SARRUS_INLINE static inline
#define SARRUS_APART
#endif

/* Sine, cosine and arc tangent: the operations of sarrus, one by one. */

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
