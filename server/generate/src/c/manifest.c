
#ifdef @DEFINITION@
#ifndef __VERSION__
#define __VERSION__ "unknown"
#endif
#define SARRUS_QUOTED(x) #x
#define SARRUS_TEXT(x) SARRUS_QUOTED(x)
/* what sarrus reads in a shared object before it loads it */
extern const char @SYMBOL@[];
const char @SYMBOL@[] =
@LINES@#ifdef SARRUS_LANES
    "rows " SARRUS_TEXT(SARRUS_LANES) "\n"
#else
    "rows 0\n"
#endif
@GENERATOR@    "processor "
@INSTRUCTIONS@    "\ncompiler " __VERSION__ "\n";
#endif
