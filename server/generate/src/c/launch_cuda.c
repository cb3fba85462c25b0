#include "@NAME@.cu"

#include <stdio.h>
#include <stdlib.h>

static void must(cudaError_t error)
{
    if (error == cudaSuccess)
        return;
    fprintf(stderr, "CUDA: %s\n", cudaGetErrorString(error));
    exit(1);
}

/* the seconds of a second launch, which is warm; negative where there is no device */
static double launched(const double *in, double *out, int *codes, size_t count)
{
    const size_t of_in = @IN@ * sizeof *in * count, of_out = @OUT@ * sizeof *out * count;
    const unsigned blocks = (unsigned)((count + 127) / 128);
    double *from, *to;
    int *state_codes, devices = 0;
    float milliseconds;
    cudaEvent_t start, end;
    if (cudaGetDeviceCount(&devices) != cudaSuccess || devices == 0) {
        fprintf(stderr, "no CUDA device\n");
        return -1.0;
    }
    must(cudaMalloc(&from, of_in));
    must(cudaMalloc(&to, of_out));
    must(cudaMalloc(&state_codes, sizeof *codes * count));
    must(cudaEventCreate(&start));
    must(cudaEventCreate(&end));
    must(cudaMemcpy(from, in, of_in, cudaMemcpyHostToDevice));
    @NAME@_kernel<<<blocks, 128>>>(from, to, state_codes, count);
    must(cudaEventRecord(start));
    @NAME@_kernel<<<blocks, 128>>>(from, to, state_codes, count);
    must(cudaEventRecord(end));
    must(cudaGetLastError());
    must(cudaMemcpy(out, to, of_out, cudaMemcpyDeviceToHost));
    must(cudaMemcpy(codes, state_codes, sizeof *codes * count, cudaMemcpyDeviceToHost));
    must(cudaEventElapsedTime(&milliseconds, start, end));
    must(cudaFree(from));
    must(cudaFree(to));
    must(cudaFree(state_codes));
    return 1e-3 * milliseconds;
}

