/* ptrace for user-mode Linux 6.1 on processors whose state is larger than it knows (AMX).
 *
 * It reads the first bytes of the extended state of its processes and writes these back; the kernel
 * of this machine takes the whole state only. So what is missing is completed by what the process
 * has. To be loaded before the C library (LD_PRELOAD).
 */
#define _GNU_SOURCE
#include <elf.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

#define LARGEST_STATE 65536

static long set_state(pid_t process, const struct iovec *part)
{
    static uint8_t state[LARGEST_STATE];
    struct iovec whole = { state, sizeof state };
    const long status =
        syscall(SYS_ptrace, PTRACE_GETREGSET, process, NT_X86_XSTATE, &whole);
    if ((status != 0) || (part->iov_len >= whole.iov_len)) {
        return syscall(SYS_ptrace, PTRACE_SETREGSET, process, NT_X86_XSTATE, part);
    }
    (void)memcpy(state, part->iov_base, part->iov_len);
    return syscall(SYS_ptrace, PTRACE_SETREGSET, process, NT_X86_XSTATE, &whole);
}

long ptrace(enum __ptrace_request request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    const pid_t process = va_arg(arguments, pid_t);
    void *const address = va_arg(arguments, void *);
    void *const data = va_arg(arguments, void *);
    va_end(arguments);
    if ((request == PTRACE_SETREGSET) && ((uintptr_t)address == NT_X86_XSTATE)) {
        return set_state(process, data);
    }
    if ((request == PTRACE_PEEKTEXT) || (request == PTRACE_PEEKDATA) ||
        (request == PTRACE_PEEKUSER)) {
        /* The C library returns what the system call writes. */
        long word;
        const long status = syscall(SYS_ptrace, request, process, address, &word);
        return (status < 0) ? status : word;
    }
    return syscall(SYS_ptrace, request, process, address, data);
}
