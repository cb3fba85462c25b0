/* @NAME@_test: answers of sarrus, which @NAME@ must give to the bit; ends with 0 where it does.
   With an argument: states from stdin, as doubles of this machine, are answered on stdout: the
   code as a double, then the numbers; those of "rows" by @NAME@_rows. */
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

#if defined(SARRUS_ROWS) && defined(__GNUC__)
/* the code of a row in what @NAME@_rows returned */
static int code_of(int bits, int row)
{
    if (bits >> row & 1)
        return @UPPER@_NOT_ANSWERED;
    return bits >> (row + @UPPER@_ROWS) & 1;
}

static int filter_rows(void)
{
    static double in[@UPPER@_ROWS][@IN@], out[@UPPER@_ROWS][@OUT@];
    size_t count;
    while ((count = fread(in, sizeof in[0], @UPPER@_ROWS, stdin)) > 0) {
        const int bits = @NAME@_rows(in[0], out[0]);
        for (int row = 0; row < (int)count; row++) {
            const double code = code_of(bits, row);
            if (fwrite(&code, sizeof code, 1, stdout) != 1 ||
                fwrite(out[row], sizeof out[row], 1, stdout) != 1)
                return 1;
        }
    }
    return 0;
}

static int test_rows(void)
{
    static double in[@UPPER@_ROWS][@IN@], out[@UPPER@_ROWS][@OUT@];
    int wrong = 0, left = 0;
    for (int k = 0; k < @COUNT@; k++) {
        for (int row = 0; row < @UPPER@_ROWS; row++)
            memcpy(in[row], inputs[(k + row) % @COUNT@], sizeof in[row]);
        const int bits = @NAME@_rows(in[0], out[0]);
        for (int row = 0; row < @UPPER@_ROWS; row++) {
            const int state = (k + row) % @COUNT@, code = code_of(bits, row);
            const int same =
                memcmp(out[row], outputs[state], @UPPER@_OUTPUTS * sizeof out[0][0]) == 0;
            /* what is looked at together leaves a row early */
            if (code == @UPPER@_NOT_ANSWERED) {
                left += codes[state] != @UPPER@_NOT_ANSWERED;
            } else if (code != codes[state] || !same) {
                printf("@NAME@_rows: state %d in row %d: code %d, not %d, or other numbers\n",
                       state, row, code, codes[state]);
                wrong = 1;
            }
        }
    }
    if (!wrong) {
        const clock_t start = clock();
        double calls = 0.0, seconds = 0.0;
        while (seconds < 0.1) {
            for (int k = 0; k < 1024; k++)
                wrong |= @NAME@_rows(in[0], out[0]) < 0;
            calls += 1024.0;
            seconds = (double)(clock() - start) / (double)CLOCKS_PER_SEC;
        }
        printf("@NAME@_rows: %d abreast, the same bits; %.1f ns a state\n", @UPPER@_ROWS,
               1e9 * seconds / calls / @UPPER@_ROWS);
        if (left > 0)
            printf("@NAME@_rows: left %d of %d rows that alone are answered\n", left,
                   @COUNT@ * @UPPER@_ROWS);
    }
    return wrong;
}
#else
static int filter_rows(void)
{
    return 2;
}

static int test_rows(void)
{
    return 0;
}
#endif

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
    if (count > 1)
        return strcmp(arguments[1], "rows") == 0 ? filter_rows() : filter();
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
    return wrong | test_rows();
}
