
/* One number of several states: the same operations on each. */
typedef double sarrus_rows __attribute__((vector_size(8 * SARRUS_LANES)));
typedef uint64_t sarrus_lanes __attribute__((vector_size(8 * SARRUS_LANES)));

#if defined(__AVX512F__) && !defined(SARRUS_PORTABLE)
#include <immintrin.h>
#define sarrus_same(a) ((sarrus_rows)_mm512_set1_pd(a))
#define sarrus_root(x) ((sarrus_rows)_mm512_sqrt_pd(x))
#define sarrus_fma(a, b, c) ((sarrus_rows)_mm512_fmadd_pd((a), (b), (c)))
#define sarrus_fms(a, b, c) ((sarrus_rows)_mm512_fmsub_pd((a), (b), (c)))
#define sarrus_fnma(a, b, c) ((sarrus_rows)_mm512_fnmadd_pd((a), (b), (c)))
#define sarrus_fnms(a, b, c) ((sarrus_rows)_mm512_fnmsub_pd((a), (b), (c)))
#elif defined(__AVX2__) && defined(__FMA__) && !defined(SARRUS_PORTABLE)
#include <immintrin.h>
#define sarrus_same(a) ((sarrus_rows)_mm256_set1_pd(a))
#define sarrus_root(x) ((sarrus_rows)_mm256_sqrt_pd(x))
#define sarrus_fma(a, b, c) ((sarrus_rows)_mm256_fmadd_pd((a), (b), (c)))
#define sarrus_fms(a, b, c) ((sarrus_rows)_mm256_fmsub_pd((a), (b), (c)))
#define sarrus_fnma(a, b, c) ((sarrus_rows)_mm256_fnmadd_pd((a), (b), (c)))
#define sarrus_fnms(a, b, c) ((sarrus_rows)_mm256_fnmsub_pd((a), (b), (c)))
#else
#define sarrus_fms(a, b, c) sarrus_fma((a), (b), -(c))
#define sarrus_fnma(a, b, c) sarrus_fma(-(a), (b), (c))
#define sarrus_fnms(a, b, c) sarrus_fma(-(a), (b), -(c))

SARRUS_INLINE sarrus_rows sarrus_same(double a)
{
    sarrus_rows x;
    for (int k = 0; k < SARRUS_LANES; k++)
        x[k] = a;
    return x;
}

SARRUS_INLINE sarrus_rows sarrus_root(sarrus_rows x)
{
    for (int k = 0; k < SARRUS_LANES; k++)
        x[k] = sqrt(x[k]);
    return x;
}

SARRUS_INLINE sarrus_rows sarrus_fma(sarrus_rows a, sarrus_rows b, sarrus_rows c)
{
    for (int k = 0; k < SARRUS_LANES; k++)
        c[k] = fma(a[k], b[k], c[k]);
    return c;
}
#endif

SARRUS_INLINE sarrus_rows sarrus_absolute(sarrus_rows x)
{
    return (sarrus_rows)((sarrus_lanes)x & UINT64_C(0x7fffffffffffffff));
}

SARRUS_INLINE sarrus_rows sarrus_chosen(sarrus_lanes first, sarrus_rows a, sarrus_rows b)
{
    return (sarrus_rows)(((sarrus_lanes)a & first) | ((sarrus_lanes)b & ~first));
}

#define sarrus_choose_rows(first, a, b) sarrus_chosen((sarrus_lanes)(first), (a), (b))

SARRUS_INLINE sarrus_rows sarrus_xor_sign_rows(sarrus_rows x, sarrus_lanes sign)
{
    return (sarrus_rows)((sarrus_lanes)x ^ (sign & UINT64_C(0x8000000000000000)));
}

/* a number of each row, so many numbers apart */
SARRUS_INLINE sarrus_rows sarrus_get(const double *from, int apart)
{
    sarrus_rows x;
    for (int k = 0; k < SARRUS_LANES; k++)
        x[k] = from[k * apart];
    return x;
}

SARRUS_INLINE void sarrus_put(double *to, int apart, sarrus_rows x)
{
    for (int k = 0; k < SARRUS_LANES; k++)
        to[k * apart] = x[k];
}

/* one bit for each row */
SARRUS_INLINE int sarrus_bits_of(sarrus_lanes mask)
{
    int bits = 0;
    for (int k = 0; k < SARRUS_LANES; k++)
        bits |= (int)(mask[k] & 1) << k;
    return bits;
}
