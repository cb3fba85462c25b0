
#if defined(SARRUS_DEVICE)
/* One number of one state of a batch. */
typedef double sarrus_rows;
typedef uint64_t sarrus_lanes;

#define SARRUS_NONE 0
#define sarrus_same(a) (a)
#define sarrus_root(x) sqrt(x)
#define sarrus_fma(a, b, c) fma((a), (b), (c))
#define sarrus_add_square(a, b) fma((a), (a), (b))
#define sarrus_absolute(x) fabs(x)
#define sarrus_choose_rows(first, a, b) sarrus_choose((first), (a), (b))
#define sarrus_xor_sign_rows(x, sign) sarrus_xor_sign((x), (sign))
#define sarrus_bits_rows(x) sarrus_bits(x)
#define sarrus_bits_of(mask) ((int)((mask) & 1))
#define sarrus_get(from, k, apart) ((from).number[(k) * (from).stride])
#define sarrus_put(to, k, apart, x) ((to).number[(k) * (to).stride] = (x))
#define sarrus_get_both(from, k, apart, a, b) \
    (*(a) = sarrus_get(from, k, apart), *(b) = sarrus_get(from, (k) + 1, apart))
#define sarrus_put_both(to, k, apart, a, b) \
    (sarrus_put(to, k, apart, a), sarrus_put(to, (k) + 1, apart, b))
#else
#pragma GCC diagnostic ignored "-Wpsabi" /* no vector leaves this file */

/* One number of several states: the same operations on each. */
typedef double sarrus_rows __attribute__((vector_size(8 * SARRUS_LANES)));
typedef uint64_t sarrus_lanes __attribute__((vector_size(8 * SARRUS_LANES)));

#define SARRUS_NONE {0}

#if defined(__AVX512F__) && !defined(SARRUS_PORTABLE)
#include <immintrin.h>
#define sarrus_same(a) ((sarrus_rows)_mm512_set1_pd(a))
#define sarrus_root(x) ((sarrus_rows)_mm512_sqrt_pd(x))
#define sarrus_fma(a, b, c) ((sarrus_rows)_mm512_fmadd_pd((a), (b), (c)))
#define sarrus_larger(a, b) ((sarrus_rows)_mm512_max_pd((a), (b)))
#define sarrus_smaller(a, b) ((sarrus_rows)_mm512_min_pd((a), (b)))
#define sarrus_fms(a, b, c) ((sarrus_rows)_mm512_fmsub_pd((a), (b), (c)))
#define sarrus_fnma(a, b, c) ((sarrus_rows)_mm512_fnmadd_pd((a), (b), (c)))
#define sarrus_fnms(a, b, c) ((sarrus_rows)_mm512_fnmsub_pd((a), (b), (c)))
#elif defined(__AVX2__) && defined(__FMA__) && !defined(SARRUS_PORTABLE)
#include <immintrin.h>
#define sarrus_same(a) ((sarrus_rows)_mm256_set1_pd(a))
#define sarrus_root(x) ((sarrus_rows)_mm256_sqrt_pd(x))
#define sarrus_fma(a, b, c) ((sarrus_rows)_mm256_fmadd_pd((a), (b), (c)))
#define sarrus_larger(a, b) ((sarrus_rows)_mm256_max_pd((a), (b)))
#define sarrus_smaller(a, b) ((sarrus_rows)_mm256_min_pd((a), (b)))
#define sarrus_fms(a, b, c) ((sarrus_rows)_mm256_fmsub_pd((a), (b), (c)))
#define sarrus_fnma(a, b, c) ((sarrus_rows)_mm256_fnmadd_pd((a), (b), (c)))
#define sarrus_fnms(a, b, c) ((sarrus_rows)_mm256_fnmsub_pd((a), (b), (c)))
#else
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
#define sarrus_bits_rows(x) ((sarrus_lanes)(x))

/* of this no bit is asked */
#if defined(__FMA__) && !defined(SARRUS_PORTABLE)
#define sarrus_add_square(a, b) sarrus_fma((a), (a), (b))
#else
#define sarrus_add_square(a, b) ((a) * (a) + (b))
#endif

SARRUS_INLINE sarrus_rows sarrus_xor_sign_rows(sarrus_rows x, sarrus_lanes sign)
{
    return (sarrus_rows)((sarrus_lanes)x ^ (sign & UINT64_C(0x8000000000000000)));
}

/* number k of each row, rows being so many numbers apart */
SARRUS_INLINE sarrus_rows sarrus_get(const double *from, int k, int apart)
{
    sarrus_rows x;
    for (int row = 0; row < SARRUS_LANES; row++)
        x[row] = from[k + row * apart];
    return x;
}

SARRUS_INLINE void sarrus_put(double *to, int k, int apart, sarrus_rows x)
{
    for (int row = 0; row < SARRUS_LANES; row++)
        to[k + row * apart] = x[row];
}

/* two numbers of each row that stand side by side */
#if SARRUS_LANES == 4 && defined(sarrus_same)
SARRUS_INLINE __m256d sarrus_halves(const double *first, const double *second)
{
    const __m256d x = _mm256_castpd128_pd256(_mm_loadu_pd(first));
    return _mm256_insertf128_pd(x, _mm_loadu_pd(second), 1);
}

SARRUS_INLINE void sarrus_get_both(const double *from, int k, int apart, sarrus_rows *a,
                                   sarrus_rows *b)
{
    from += k;
    const __m256d even = sarrus_halves(from, from + 2 * apart);
    const __m256d odd = sarrus_halves(from + apart, from + 3 * apart);
    *a = (sarrus_rows)_mm256_unpacklo_pd(even, odd);
    *b = (sarrus_rows)_mm256_unpackhi_pd(even, odd);
}

SARRUS_INLINE void sarrus_put_both(double *to, int k, int apart, sarrus_rows a, sarrus_rows b)
{
    const __m256d even = _mm256_unpacklo_pd(a, b), odd = _mm256_unpackhi_pd(a, b);
    to += k;
    _mm_storeu_pd(to, _mm256_castpd256_pd128(even));
    _mm_storeu_pd(to + apart, _mm256_castpd256_pd128(odd));
    _mm_storeu_pd(to + 2 * apart, _mm256_extractf128_pd(even, 1));
    _mm_storeu_pd(to + 3 * apart, _mm256_extractf128_pd(odd, 1));
}
#else
SARRUS_INLINE void sarrus_get_both(const double *from, int k, int apart, sarrus_rows *a,
                                   sarrus_rows *b)
{
    *a = sarrus_get(from, k, apart);
    *b = sarrus_get(from, k + 1, apart);
}

SARRUS_INLINE void sarrus_put_both(double *to, int k, int apart, sarrus_rows a, sarrus_rows b)
{
    sarrus_put(to, k, apart, a);
    sarrus_put(to, k + 1, apart, b);
}
#endif

/* one bit for each row */
SARRUS_INLINE int sarrus_bits_of(sarrus_lanes mask)
{
    int bits = 0;
    for (int k = 0; k < SARRUS_LANES; k++)
        bits |= (int)(mask[k] & 1) << k;
    return bits;
}
#endif

#ifndef sarrus_fms
#define sarrus_fms(a, b, c) sarrus_fma((a), (b), -(c))
#define sarrus_fnma(a, b, c) sarrus_fma(-(a), (b), (c))
#define sarrus_fnms(a, b, c) sarrus_fma(-(a), (b), -(c))
#endif

/* b where one is no number */
#ifndef sarrus_smaller
#define sarrus_larger(a, b) sarrus_choose_rows((a) > (b), (a), (b))
#define sarrus_smaller(a, b) sarrus_choose_rows((a) < (b), (a), (b))
#endif
