/* @NAME@_launch: answers of sarrus, which @NAME@_kernel must give to the bit on a device; ends
   with 0 where it does, with 1 where it does not, with 2 where there is no device. With an
   argument: states from stdin are answered on stdout, as by @NAME@_test. It runs in the folder of
   its sources. CUDA: nvcc -fmad=false; OpenCL: cc -std=c11, with -lOpenCL at the end. */
@DEVICE@
#include <stdint.h>
#include <string.h>

enum { STATES = 1 << 14 };

static const int expected[@COUNT@] = {@CODES@};

static const double inputs[@COUNT@][@IN@] = {
@INPUTS@};

static const uint64_t outputs[@COUNT@][@OUT@] = {
@OUTPUTS@};

static double in[@IN@ * STATES], out[@OUT@ * STATES];
static int codes[STATES];

static int filter(void)
{
    static double rows[STATES][@IN@];
    double row[1 + @OUT@];
    size_t count;
    while ((count = fread(rows, sizeof rows[0], STATES, stdin)) > 0) {
        for (size_t i = 0; i < count; i++) {
            for (size_t k = 0; k < @UPPER@_INPUTS; k++)
                in[k * count + i] = rows[i][k];
        }
        if (launched(in, out, codes, count) < 0.0)
            return 2;
        for (size_t i = 0; i < count; i++) {
            row[0] = codes[i];
            for (size_t k = 0; k < @UPPER@_OUTPUTS; k++)
                row[1 + k] = out[k * count + i];
            if (fwrite(row, sizeof row, 1, stdout) != 1)
                return 1;
        }
    }
    return 0;
}

int main(int count, char **arguments)
{
    int wrong = 0, left = 0;
    (void)arguments;
    if (count > 1)
        return filter();
    for (int i = 0; i < STATES; i++) {
        for (int k = 0; k < @UPPER@_INPUTS; k++)
            in[k * STATES + i] = inputs[i % @COUNT@][k];
    }
    const double seconds = launched(in, out, codes, STATES);
    if (seconds < 0.0)
        return 2;
    for (int i = 0; i < STATES && !wrong; i++) {
        const int state = i % @COUNT@;
        int same = codes[i] == expected[state];
        for (int k = 0; k < @UPPER@_OUTPUTS; k++)
            same &= memcmp(&out[k * STATES + i], &outputs[state][k], sizeof out[0]) == 0;
        /* what is looked at together leaves a state early */
        if (codes[i] == @UPPER@_NOT_ANSWERED)
            left += expected[state] != @UPPER@_NOT_ANSWERED;
        else
            wrong = !same;
        if (wrong)
            printf("@NAME@_kernel: state %d: code %d, not %d, or other numbers\n", state, codes[i],
                   expected[state]);
    }
    if (!wrong)
        printf("@NAME@_kernel: %d states, %d left, the same bits; %.1f ns a state\n", STATES, left,
               1e9 * seconds / STATES);
    return wrong;
}
