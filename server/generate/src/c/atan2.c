
SARRUS_INLINE double sarrus_atan2(double y, double x)
{
    const double largest = 1.7976931348623157e308;
    const double half_pi0 = 1.5707963267948966, half_pi1 = 6.123233995736766e-17;
    const double ay = fabs(y), ax = fabs(x);
    const int steep = ax < ay;
    const double shorter = steep ? ax : ay, longer = steep ? ay : ax;
    const int edge = (largest < longer) | (longer < 4.9406564584124654e-324);
    const double at_edge = largest < shorter ? 1.0 : shorter * 0.0;
    const double b = edge ? at_edge : shorter, a = edge ? 1.0 : longer;
    const double t0 = b / a;
    const double z = t0 * t0;
    const double dt0 = (fma(-t0, a, b) / a) * fma(z, -0.5, 0.957);
    const double flat = steep ? 0.0 : 1.0;
    const double side = sarrus_xor_sign(flat, sarrus_bits(x));
    const uint64_t turn = sarrus_bits(sarrus_xor_sign(flat - 0.5, sarrus_bits(x)));
    const double t = sarrus_xor_sign(t0, turn), dt = sarrus_xor_sign(dt0, turn);
    const double z2 = z * z;
    const double z4 = z2 * z2;
    const double z8 = z4 * z4;
    const double four0 = fma(fma(0.11111111007338594, z, -0.1428571428258798), z2,
                             fma(0.19999999999951748, z, -0.3333333333333307));
    const double four4 = fma(fma(0.05880529771477943, z, -0.06666404417138774), z2,
                             fma(0.07692279888162858, z, -0.09090907007735875));
    const double four8 = fma(fma(0.03664313690283263, z, -0.04219242335356976), z2,
                             fma(0.04722347851942683, z, -0.05253526622905692));
    const double four12 = fma(fma(0.007197862857381006, z, -0.013902545824928843), z2,
                              fma(0.021987041303159906, z, -0.029905714468253217));
    const double four16 = fma(fma(1.3229893501518314e-5, z, -0.00015221011472297077), z2,
                              fma(0.0008315550737838101, z, -0.0028855974234600888));
    const double p =
        fma(fma(four16, z8, fma(four12, z4, four8)), z8, fma(four4, z4, four0));
    const double base = fma(-side, half_pi0, half_pi0);
    const double s = base + t;
    const double e = ((base - s) + t) + dt + fma(-side, half_pi1, half_pi1);
    return sarrus_xor_sign(fma(z * t, p, e) + s, sarrus_bits(y));
}
