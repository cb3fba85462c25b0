/* @NAME@_test: answers of sarrus, which @NAME@ must give to the bit; ends with 0 where it does.
   With an argument: states from stdin, as doubles of this machine, are answered on stdout: the
   code as a double, then the numbers. */
#include "@NAME@.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static const int codes[@COUNT@] = {@CODES@};

static const double inputs[@COUNT@][@IN@] = {
@INPUTS@};

static const uint64_t outputs[@COUNT@][@OUT@] = {
@OUTPUTS@};

static int filter(void)
{
    double in[@IN@], out[1 + @OUT@];
    while (fread(in, sizeof in, 1, stdin) == 1) {
        out[0] = @NAME@(in, out + 1);
        if (fwrite(out, sizeof out, 1, stdout) != 1)
            return 1;
    }
    return 0;
}

int main(int count, char **arguments)
{
    double out[@OUT@];
    int wrong = 0;
    (void)arguments;
    if (count > 1)
        return filter();
    for (int k = 0; k < @COUNT@; k++) {
        const int code = @NAME@(inputs[k], out);
        const int same = memcmp(out, outputs[k], @UPPER@_OUTPUTS * sizeof out[0]) == 0;
        if (code != codes[k] || (code != @UPPER@_NOT_ANSWERED && !same)) {
            printf("@NAME@: state %d: code %d, not %d, or other numbers\n", k, code, codes[k]);
            wrong = 1;
        }
    }
    if (!wrong) {
        /* a tenth of a second, or what a clock of this machine can tell */
        const clock_t start = clock();
        double calls = 0.0, seconds = 0.0;
        while (seconds < 0.1) {
            for (int k = 0; k < 4096; k++)
                wrong |= @NAME@(inputs[k % @COUNT@], out) > @UPPER@_NOT_ANSWERED;
            calls += 4096.0;
            seconds = (double)(clock() - start) / (double)CLOCKS_PER_SEC;
        }
        printf("@NAME@: %d states, the same bits; %.1f ns a call\n", @COUNT@,
               1e9 * seconds / calls);
    }
    return wrong;
}
