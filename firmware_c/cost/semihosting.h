/* Arm semihosting: files of the host that runs the emulator or debugger. */
#ifndef SEMIHOSTING_H
#define SEMIHOSTING_H

#include <stdint.h>

typedef enum { SEMIHOSTING_READ = 1, SEMIHOSTING_WRITE = 5 } semihosting_mode_t;

/* The command line that the host has given, with its first word. */
void semihosting_command_line(char *text, uint32_t size);

/* Handle of a file, negative when it cannot be opened. */
int32_t semihosting_open(const char *path, semihosting_mode_t mode);

/* Bytes that were read. */
uint32_t semihosting_read(int32_t handle, void *data, uint32_t size);

/* Bytes that were not written. */
uint32_t semihosting_write(int32_t handle, const void *data, uint32_t size);

/* Ends the emulator with this status. */
void semihosting_exit(uint32_t status);

#endif
