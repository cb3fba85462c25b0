/* Sine, cosine and arc tangent: the operations of sarrus, one by one. */

static inline uint64_t sarrus_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline double sarrus_number(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static inline double sarrus_xor_sign(double x, uint64_t sign)
{
    return sarrus_number(sarrus_bits(x) ^ (sign & UINT64_C(0x8000000000000000)));
}

/* x, or no number where every bit of the mask is set */
static inline double sarrus_masked(double x, uint64_t mask)
{
    return sarrus_number(sarrus_bits(x) | mask);
}

/* every bit where the condition holds, else none */
static inline uint64_t sarrus_mask(int holds)
{
    return UINT64_C(0) - (uint64_t)holds;
}
