/*
 * Lets user-mode Linux run on processors with a larger extended state than it supports (AMX). Linux
 * accepts only a complete state, so the missing end is copied from the state of the process.
 * Preloaded into linux.uml by the test of SocketCAN.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

#ifndef NT_X86_XSTATE
#define NT_X86_XSTATE 0x202
#endif

typedef long (*ptrace_t)(int, pid_t, void *, void *);

long ptrace(enum __ptrace_request request, ...)
{
    static char whole[1 << 16];
    static ptrace_t next;
    va_list list;
    va_start(list, request);
    pid_t pid = va_arg(list, pid_t);
    void *address = va_arg(list, void *);
    void *data = va_arg(list, void *);
    va_end(list);
    if (next == NULL)
        next = (ptrace_t)dlsym(RTLD_NEXT, "ptrace");
    if (request == PTRACE_SETREGSET && (long)address == NT_X86_XSTATE) {
        struct iovec *given = data;
        struct iovec completed = {whole, sizeof whole};
        if (next(PTRACE_GETREGSET, pid, address, &completed) == 0 && given->iov_len < completed.iov_len) {
            memcpy(whole, given->iov_base, given->iov_len);
            return next(request, pid, address, &completed);
        }
    }
    return next((int)request, pid, address, data);
}
