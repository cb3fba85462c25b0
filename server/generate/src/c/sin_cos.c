
SARRUS_INLINE void NAME(REAL x, REAL *sine, REAL *cosine)
{
    const REAL integer = SAME(6755399441055744.0);
    const REAL half_pi0 = SAME(1.5707963267948966), half_pi1 = SAME(6.123233995736766e-17);
    const REAL half_pi2 = SAME(-1.4973849048591698e-33);
    const REAL b = ABSOLUTE(x);
    const REAL a = CHOOSE(b < 35184372088832.0, b, SAME((double)NAN));
    const REAL t = FMA(a, SAME(0.6366197723675814), integer);
    const REAL n = t - integer;
    const REAL r1 = FMA(-n, half_pi0, a);
    const REAL p = n * half_pi1;
    const REAL r = r1 - p;
    const REAL dr = ((r1 - r) - p) - FMA(n, half_pi2, FMA(n, half_pi1, -p));
    const REAL z = r * r;
    const REAL z2 = z * z;
    const REAL of_sine =
        FMA(FMA(FMA(SAME(1.589346260505195e-10), z, SAME(-2.5050701023123465e-8)), z2,
                FMA(SAME(2.7557313329894517e-6), z, SAME(-0.000198412698287716))), z2,
            FMA(SAME(0.008333333333321128), z, SAME(-0.16666666666666627)));
    const REAL of_cosine =
        FMA(FMA(FMA(SAME(-1.1357264527674212e-11), z, SAME(2.0875676842343087e-9)), z2,
                FMA(SAME(-2.755731400737406e-7), z, SAME(2.4801587288274786e-5))), z2,
            FMA(SAME(-0.0013888888888872167), z, SAME(0.04166666666666659)));
    const REAL h = r * -0.5;
    const REAL w = FMA(h, r, SAME(1.0));
    const REAL e = FMA(h, r, 1.0 - w);
    const REAL s = FMA(z * r, of_sine, dr * w) + r;
    const REAL c = FMA(z2, of_cosine, FMA(-r, dr, e)) + w;
    const REAL m = FMA(n, SAME(0.5), SAME(-0.25));
    const MASK odd = (MASK)(((m + integer) - integer) < m);
    const BITS ones = BITS_OF(t) << 63, twos = BITS_OF(t) << 62;
    *sine = XOR_SIGN(XOR_SIGN(CHOOSE(odd, c, s), twos), BITS_OF(x));
    *cosine = XOR_SIGN(XOR_SIGN(CHOOSE(odd, s, c), twos), ones);
}
