
SARRUS_INLINE void sarrus_sin_cos(double x, double *sine, double *cosine)
{
    const double integer = 6755399441055744.0;
    const double half_pi0 = 1.5707963267948966, half_pi1 = 6.123233995736766e-17;
    const double half_pi2 = -1.4973849048591698e-33;
    const double b = fabs(x);
    const double a = b < 35184372088832.0 ? b : (double)NAN;
    const double t = fma(a, 0.6366197723675814, integer);
    const double n = t - integer;
    const double r1 = fma(-n, half_pi0, a);
    const double p = n * half_pi1;
    const double r = r1 - p;
    const double dr = ((r1 - r) - p) - fma(n, half_pi2, fma(n, half_pi1, -p));
    const double z = r * r;
    const double z2 = z * z;
    const double of_sine =
        fma(fma(fma(1.589346260505195e-10, z, -2.5050701023123465e-8), z2,
                fma(2.7557313329894517e-6, z, -0.000198412698287716)), z2,
            fma(0.008333333333321128, z, -0.16666666666666627));
    const double of_cosine =
        fma(fma(fma(-1.1357264527674212e-11, z, 2.0875676842343087e-9), z2,
                fma(-2.755731400737406e-7, z, 2.4801587288274786e-5)), z2,
            fma(-0.0013888888888872167, z, 0.04166666666666659));
    const double h = r * -0.5;
    const double w = fma(h, r, 1.0);
    const double e = fma(h, r, 1.0 - w);
    const double s = fma(z * r, of_sine, dr * w) + r;
    const double c = fma(z2, of_cosine, fma(-r, dr, e)) + w;
    const double m = fma(n, 0.5, -0.25);
    const int odd = ((m + integer) - integer) < m;
    const uint64_t ones = sarrus_bits(t) << 63, twos = sarrus_bits(t) << 62;
    *sine = sarrus_xor_sign(sarrus_xor_sign(odd ? c : s, twos), sarrus_bits(x));
    *cosine = sarrus_xor_sign(sarrus_xor_sign(odd ? s : c, twos), ones);
}
