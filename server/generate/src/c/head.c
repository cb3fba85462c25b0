/* @NAME@: straight-line code, see @NAME@.h. Compile with
   @FLAGS@
   (or another baseline). Without -fno-tree-slp-vectorize gcc fuses multiplications and additions in
   vectors that it makes of statements, whatever -ffp-contract says. Rounding is to nearest, as
   programs start: in another mode of the processor numbers are wrong, and nothing says so. */
#include "@NAME@.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

