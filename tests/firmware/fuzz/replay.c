/* Gives files to a fuzz target, in the place of libFuzzer where no clang is.
 * Usage: TARGET FILE...
 */
#include "input.h"

#define LONGEST 65536u

int main(int argc, char **argv)
{
    static uint8_t bytes[LONGEST];
    for (int i = 1; i < argc; i++) {
        FILE *file = fopen(argv[i], "rb");
        if (file == NULL) {
            fprintf(stderr, "%s: cannot be read; give a file\n", argv[i]);
            return 2;
        }
        const size_t length = fread(bytes, 1u, sizeof bytes, file);
        (void)fclose(file);
        uint8_t *exact = malloc(length + 1u);
        memcpy(exact, bytes, length);
        (void)LLVMFuzzerTestOneInput(exact, length);
        free(exact);
    }
    return 0;
}
