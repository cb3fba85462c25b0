/* @NAME@_kernel: a batch of states, one a thread. Number k of state i is in[k * count + i], or
   out[k * count + i], and codes[i] what @NAME@ returns; without an answer the numbers
   are NaN. The buffers are @UPPER@_INPUTS, @UPPER@_OUTPUTS and one times count. */
#include "@NAME@.c"

SARRUS_KERNEL void @NAME@_kernel(SARRUS_GLOBAL const double *in, SARRUS_GLOBAL double *out,
                                 SARRUS_GLOBAL int *codes, uint64_t count)
{
    const size_t at = SARRUS_STATE;
    if (at >= count)
        return;
    const sarrus_in from = {in + at, count};
    const sarrus_out to = {out + at, count};
    const int bits = @NAME@_rows(from, to);
    codes[at] = bits & 1 ? @UPPER@_NOT_ANSWERED : bits >> 1;
    if (bits & 1) {
        for (size_t k = 0; k < @UPPER@_OUTPUTS; k++)
            out[k * count + at] = (double)NAN;
    }
}
