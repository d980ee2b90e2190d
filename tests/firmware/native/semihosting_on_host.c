/* The emulator's files as a host's own, for programs of boards that run as a process; the command line
 * is the environment's COMMAND_LINE. */
#include "semihosting.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST_FILES 4

typedef struct {
    FILE *file[MOST_FILES];
    int32_t count;
} files_t;

static files_t *files(void)
{
    static files_t kept;
    return &kept;
}

void semihosting_command_line(char *text, uint32_t size)
{
    const char *line = getenv("COMMAND_LINE");
    (void)snprintf(text, size, "%s", (line != NULL) ? line : "");
}

int32_t semihosting_open(const char *path, semihosting_mode_t mode)
{
    files_t *kept = files();
    FILE *file = (kept->count < MOST_FILES) ? fopen(path, (mode == SEMIHOSTING_READ) ? "rb" : "wb")
                                            : NULL;
    if (file == NULL) {
        return -1;
    }
    kept->file[kept->count] = file;
    kept->count++;
    return kept->count - 1;
}

uint32_t semihosting_read(int32_t handle, void *data, uint32_t size)
{
    return (uint32_t)fread(data, 1u, size, files()->file[handle]);
}

uint32_t semihosting_write(int32_t handle, const void *data, uint32_t size)
{
    return size - (uint32_t)fwrite(data, 1u, size, files()->file[handle]);
}

void semihosting_exit(uint32_t status)
{
    exit((int)status); /* which closes the files */
}
