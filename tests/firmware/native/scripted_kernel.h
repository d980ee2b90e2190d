/* The operating system below the Linux port, as the test's: sockets, signals and time. */
#ifndef SCRIPTED_KERNEL_H
#define SCRIPTED_KERNEL_H

/* What a call returns; below 0 it fails with that errno. `data` is a struct can_frame, an interface's
 * name or a signal's handler. */
typedef int (*scripted_call_t)(const char *name, int number, void *data);

void scripted_kernel_set(scripted_call_t call);

#endif
