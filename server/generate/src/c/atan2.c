
SARRUS_INLINE REAL NAME(REAL y, REAL x)
{
    const REAL largest = SAME(1.7976931348623157e308);
    const REAL half_pi0 = SAME(1.5707963267948966), half_pi1 = SAME(6.123233995736766e-17);
    const REAL ay = ABSOLUTE(y), ax = ABSOLUTE(x);
    const MASK steep = (MASK)(ax < ay);
    const REAL shorter = CHOOSE(steep, ax, ay), longer = CHOOSE(steep, ay, ax);
    const MASK edge = (MASK)((largest < longer) | (longer < 4.9406564584124654e-324));
    const REAL at_edge = CHOOSE(largest < shorter, SAME(1.0), shorter * 0.0);
    const REAL b = CHOOSE(edge, at_edge, shorter), a = CHOOSE(edge, SAME(1.0), longer);
    const REAL t0 = b / a;
    const REAL z = t0 * t0;
    const REAL dt0 = (FMA(-t0, a, b) / a) * FMA(z, SAME(-0.5), SAME(0.957));
    const REAL flat = CHOOSE(steep, SAME(0.0), SAME(1.0));
    const REAL side = XOR_SIGN(flat, BITS_OF(x));
    const BITS turn = BITS_OF(XOR_SIGN(flat - 0.5, BITS_OF(x)));
    const REAL t = XOR_SIGN(t0, turn), dt = XOR_SIGN(dt0, turn);
    const REAL z2 = z * z;
    const REAL z4 = z2 * z2;
    const REAL z8 = z4 * z4;
    const REAL four0 =
        FMA(FMA(SAME(0.11111111007338594), z, SAME(-0.1428571428258798)), z2,
            FMA(SAME(0.19999999999951748), z, SAME(-0.3333333333333307)));
    const REAL four4 =
        FMA(FMA(SAME(0.05880529771477943), z, SAME(-0.06666404417138774)), z2,
            FMA(SAME(0.07692279888162858), z, SAME(-0.09090907007735875)));
    const REAL four8 =
        FMA(FMA(SAME(0.03664313690283263), z, SAME(-0.04219242335356976)), z2,
            FMA(SAME(0.04722347851942683), z, SAME(-0.05253526622905692)));
    const REAL four12 =
        FMA(FMA(SAME(0.007197862857381006), z, SAME(-0.013902545824928843)), z2,
            FMA(SAME(0.021987041303159906), z, SAME(-0.029905714468253217)));
    const REAL four16 =
        FMA(FMA(SAME(1.3229893501518314e-5), z, SAME(-0.00015221011472297077)), z2,
            FMA(SAME(0.0008315550737838101), z, SAME(-0.0028855974234600888)));
    const REAL p =
        FMA(FMA(four16, z8, FMA(four12, z4, four8)), z8, FMA(four4, z4, four0));
    const REAL base = FMA(-side, half_pi0, half_pi0);
    const REAL s = base + t;
    const REAL e = ((base - s) + t) + dt + FMA(-side, half_pi1, half_pi1);
    return XOR_SIGN(FMA(z * t, p, e) + s, BITS_OF(y));
}
