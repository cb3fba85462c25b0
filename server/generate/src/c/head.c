/* @NAME@: straight-line code, see @NAME@.h. Compile with
   @FLAGS@
   (or another baseline). Without -fno-tree-slp-vectorize gcc fuses multiplications and additions in
   vectors that it makes of statements, whatever -ffp-contract says. Rounding is to nearest, as
   programs start: in another mode of the processor numbers are wrong, and nothing says so.
   Compilers of CUDA (-fmad=false), HIP (-ffp-contract=off) and OpenCL C make @NAME@_rows of
   it, for one state of a batch, and the functions of devices. */
#include "@NAME@.h"

#if defined(__OPENCL_VERSION__)
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#pragma OPENCL FP_CONTRACT OFF
#define uint64_t ulong
#define UINT64_C(bits) bits##UL
#define SARRUS_DEVICE
#define SARRUS_GLOBAL __global
#define SARRUS_KERNEL __kernel
#define SARRUS_STATE get_global_id(0)
#else
#if defined(__HIPCC__)
#include <hip/hip_runtime.h>
#endif
#include <math.h>
#include <stdint.h>
#include <string.h>
#if defined(__CUDACC__) || defined(__HIPCC__)
#define SARRUS_DEVICE __device__
#define SARRUS_GLOBAL
#define SARRUS_KERNEL extern "C" __global__
#define SARRUS_STATE ((size_t)blockIdx.x * blockDim.x + threadIdx.x)
#endif
#endif

