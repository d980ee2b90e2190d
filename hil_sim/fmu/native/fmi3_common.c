/* What every unit of FMI 3.0 here does alike. An instance is one piece of memory. */
#include <stdlib.h>

#include "fmi3.h"

FMI3_API const char *fmi3GetVersion(void)
{
    return "3.0";
}

/* Errors are always told, and nothing else is. */
FMI3_API fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean logging, size_t count,
                                        const fmi3String *categories)
{
    (void)instance, (void)logging, (void)count, (void)categories;
    return fmi3OK;
}

FMI3_API void fmi3FreeInstance(fmi3Instance instance)
{
    free(instance);
}

FMI3_API fmi3Status fmi3Terminate(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

FMI3_API fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}
