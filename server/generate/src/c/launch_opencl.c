#define CL_TARGET_OPENCL_VERSION 120
#include "@NAME@.h"

#include <CL/cl.h>
#include <stdio.h>
#include <stdlib.h>

static void must(cl_int error)
{
    if (error == CL_SUCCESS)
        return;
    fprintf(stderr, "OpenCL: error %d\n", error);
    exit(1);
}

/* whether there is a device that has doubles */
static int found(cl_device_id *device)
{
    cl_platform_id platforms[8];
    cl_device_id devices[8];
    cl_uint platform_count = 0;
    clGetPlatformIDs(8, platforms, &platform_count);
    for (cl_uint k = 0; k < platform_count && k < 8; k++) {
        cl_uint count = 0;
        clGetDeviceIDs(platforms[k], CL_DEVICE_TYPE_ALL, 8, devices, &count);
        for (cl_uint l = 0; l < count && l < 8; l++) {
            cl_device_fp_config doubles = 0;
            *device = devices[l];
            clGetDeviceInfo(*device, CL_DEVICE_DOUBLE_FP_CONFIG, sizeof doubles, &doubles, NULL);
            if (doubles != 0)
                return 1;
        }
    }
    fprintf(stderr, "no OpenCL device with doubles\n");
    return 0;
}

/* the seconds of a second launch, which is warm; negative where there is no device */
static double launched(const double *in, double *out, int *codes, size_t count)
{
    static char log[1 << 12];
    const char *text = "#include \"@NAME@.cl\"\n";
    const size_t of_in = @IN@ * sizeof *in * count, of_out = @OUT@ * sizeof *out * count;
    const size_t of_codes = sizeof *codes * count;
    const cl_ulong states = count;
    const size_t group = 64, all = (count + group - 1) / group * group;
    cl_ulong start, end;
    cl_device_id device;
    cl_event event;
    cl_int e[8];
    if (!found(&device))
        return -1.0;
    cl_context context = clCreateContext(NULL, 1, &device, NULL, NULL, &e[0]);
    cl_command_queue queue =
        clCreateCommandQueue(context, device, CL_QUEUE_PROFILING_ENABLE, &e[1]);
    cl_program program = clCreateProgramWithSource(context, 1, &text, NULL, &e[2]);
    cl_mem from = clCreateBuffer(context, CL_MEM_READ_ONLY, of_in, NULL, &e[3]);
    cl_mem to = clCreateBuffer(context, CL_MEM_READ_WRITE, of_out, NULL, &e[4]);
    cl_mem state_codes = clCreateBuffer(context, CL_MEM_READ_WRITE, of_codes, NULL, &e[5]);
    e[6] = clBuildProgram(program, 1, &device, "-I .", NULL, NULL);
    if (e[6] != CL_SUCCESS) {
        clGetProgramBuildInfo(program, device, CL_PROGRAM_BUILD_LOG, sizeof log, log, NULL);
        fprintf(stderr, "%s\n", log);
    }
    cl_kernel kernel = clCreateKernel(program, "@NAME@_kernel", &e[7]);
    for (int k = 0; k < 8; k++)
        must(e[k]);
    must(clSetKernelArg(kernel, 0, sizeof from, &from));
    must(clSetKernelArg(kernel, 1, sizeof to, &to));
    must(clSetKernelArg(kernel, 2, sizeof state_codes, &state_codes));
    must(clSetKernelArg(kernel, 3, sizeof states, &states));
    must(clEnqueueWriteBuffer(queue, from, CL_TRUE, 0, of_in, in, 0, NULL, NULL));
    for (int k = 0; k < 2; k++)
        must(clEnqueueNDRangeKernel(queue, kernel, 1, NULL, &all, &group, 0, NULL, &event));
    must(clEnqueueReadBuffer(queue, to, CL_TRUE, 0, of_out, out, 0, NULL, NULL));
    must(clEnqueueReadBuffer(queue, state_codes, CL_TRUE, 0, of_codes, codes, 0, NULL, NULL));
    must(clGetEventProfilingInfo(event, CL_PROFILING_COMMAND_START, sizeof start, &start, NULL));
    must(clGetEventProfilingInfo(event, CL_PROFILING_COMMAND_END, sizeof end, &end, NULL));
    must(clReleaseMemObject(from));
    must(clReleaseMemObject(to));
    must(clReleaseMemObject(state_codes));
    must(clReleaseProgram(program));
    must(clReleaseContext(context));
    return 1e-9 * (double)(end - start);
}

