
/* Two numbers at once: the same operations on both. */
#if defined(__x86_64__) && defined(__FMA__) && !defined(SARRUS_PORTABLE)
#include <immintrin.h>
typedef __m128d sarrus_pair;
#define sarrus_both2(a, b) _mm_set_pd((b), (a))
#define sarrus_same2(a) _mm_set1_pd(a)
#define sarrus_first2(p) _mm_cvtsd_f64(p)
#define sarrus_second2(p) _mm_cvtsd_f64(_mm_unpackhi_pd((p), (p)))
#define sarrus_swapped2(p) _mm_shuffle_pd((p), (p), 1)
#define sarrus_load2(x) _mm_loadu_pd(x)
#define sarrus_store2(x, p) _mm_storeu_pd((x), (p))
#define sarrus_signed2(p, a, b) _mm_xor_pd((p), _mm_set_pd((b), (a)))
#define sarrus_minus2(p) _mm_xor_pd((p), _mm_set1_pd(-0.0))
#define sarrus_absolute2(p) _mm_andnot_pd(_mm_set1_pd(-0.0), (p))
#define sarrus_add2(p, q) _mm_add_pd((p), (q))
#define sarrus_subtract2(p, q) _mm_sub_pd((p), (q))
#define sarrus_multiply2(p, q) _mm_mul_pd((p), (q))
#define sarrus_divide2(p, q) _mm_div_pd((p), (q))
#define sarrus_root2(p) _mm_sqrt_pd(p)
#define sarrus_fma2(p, q, r) _mm_fmadd_pd((p), (q), (r))
#define sarrus_fms2(p, q, r) _mm_fmsub_pd((p), (q), (r))
#define sarrus_fnma2(p, q, r) _mm_fnmadd_pd((p), (q), (r))
#define sarrus_fnms2(p, q, r) _mm_fnmsub_pd((p), (q), (r))
#elif defined(__GNUC__) && !defined(SARRUS_SINGLE)
typedef double sarrus_pair __attribute__((vector_size(16)));
#define sarrus_first2(p) ((p)[0])
#define sarrus_second2(p) ((p)[1])
#define sarrus_add2(p, q) ((p) + (q))
#define sarrus_subtract2(p, q) ((p) - (q))
#define sarrus_multiply2(p, q) ((p) * (q))
#define sarrus_divide2(p, q) ((p) / (q))
#define sarrus_minus2(p) (-(p))
#else
typedef struct {
    double first, second;
} sarrus_pair;

#define sarrus_first2(p) ((p).first)
#define sarrus_second2(p) ((p).second)
#endif

#if !defined(sarrus_both2)
SARRUS_INLINE sarrus_pair sarrus_both2(double a, double b)
{
    const sarrus_pair p = {a, b};
    return p;
}

#define sarrus_same2(a) sarrus_both2((a), (a))
#define sarrus_swapped2(p) sarrus_both2(sarrus_second2(p), sarrus_first2(p))
#define sarrus_load2(x) sarrus_both2((x)[0], (x)[1])
#define sarrus_store2(x, p) sarrus_put2((x), (p))
#define sarrus_absolute2(p) sarrus_both2(fabs(sarrus_first2(p)), fabs(sarrus_second2(p)))
#define sarrus_root2(p) sarrus_both2(sqrt(sarrus_first2(p)), sqrt(sarrus_second2(p)))
#define sarrus_fms2(p, q, r) sarrus_fma2((p), (q), sarrus_minus2(r))
#define sarrus_fnma2(p, q, r) sarrus_fma2(sarrus_minus2(p), (q), (r))
#define sarrus_fnms2(p, q, r) sarrus_fma2(sarrus_minus2(p), (q), sarrus_minus2(r))

SARRUS_INLINE void sarrus_put2(double *x, sarrus_pair p)
{
    x[0] = sarrus_first2(p);
    x[1] = sarrus_second2(p);
}

SARRUS_INLINE sarrus_pair sarrus_signed2(sarrus_pair p, double a, double b)
{
    return sarrus_both2(sarrus_xor_sign(sarrus_first2(p), sarrus_bits(a)),
                        sarrus_xor_sign(sarrus_second2(p), sarrus_bits(b)));
}

SARRUS_INLINE sarrus_pair sarrus_fma2(sarrus_pair p, sarrus_pair q, sarrus_pair r)
{
    return sarrus_both2(fma(sarrus_first2(p), sarrus_first2(q), sarrus_first2(r)),
                        fma(sarrus_second2(p), sarrus_second2(q), sarrus_second2(r)));
}
#endif

#if !defined(sarrus_add2)
SARRUS_INLINE sarrus_pair sarrus_add2(sarrus_pair p, sarrus_pair q)
{
    return sarrus_both2(p.first + q.first, p.second + q.second);
}

SARRUS_INLINE sarrus_pair sarrus_subtract2(sarrus_pair p, sarrus_pair q)
{
    return sarrus_both2(p.first - q.first, p.second - q.second);
}

SARRUS_INLINE sarrus_pair sarrus_multiply2(sarrus_pair p, sarrus_pair q)
{
    return sarrus_both2(p.first * q.first, p.second * q.second);
}

SARRUS_INLINE sarrus_pair sarrus_divide2(sarrus_pair p, sarrus_pair q)
{
    return sarrus_both2(p.first / q.first, p.second / q.second);
}

SARRUS_INLINE sarrus_pair sarrus_minus2(sarrus_pair p)
{
    return sarrus_both2(-p.first, -p.second);
}
#endif
