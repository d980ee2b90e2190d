/* Functions of FMI 2.0 that a library must have and the plant does not offer, as its model
 * description says. */
#include "fmi2.h"

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

FMI2_API fmi2Status fmi2GetDirectionalDerivative(fmi2Component instance,
                                                 const fmi2ValueReference *unknowns,
                                                 size_t unknown_count,
                                                 const fmi2ValueReference *knowns,
                                                 size_t known_count, const fmi2Real *seed,
                                                 fmi2Real *sensitivity)
{
    return fmi2Error;
}

FMI2_API fmi2Status fmi2SetRealInputDerivatives(fmi2Component instance,
                                                const fmi2ValueReference *references, size_t count,
                                                const fmi2Integer *orders, const fmi2Real *values)
{
    return fmi2Error;
}

FMI2_API fmi2Status fmi2GetRealOutputDerivatives(fmi2Component instance,
                                                 const fmi2ValueReference *references, size_t count,
                                                 const fmi2Integer *orders, fmi2Real *values)
{
    return fmi2Error;
}

/* No step is ever pending, so that there is no status to ask for. */
FMI2_API fmi2Status fmi2GetStatus(fmi2Component instance, const fmi2StatusKind kind,
                                  fmi2Status *value)
{
    return fmi2Discard;
}

FMI2_API fmi2Status fmi2GetRealStatus(fmi2Component instance, const fmi2StatusKind kind,
                                      fmi2Real *value)
{
    return fmi2Discard;
}

FMI2_API fmi2Status fmi2GetIntegerStatus(fmi2Component instance, const fmi2StatusKind kind,
                                         fmi2Integer *value)
{
    return fmi2Discard;
}

FMI2_API fmi2Status fmi2GetBooleanStatus(fmi2Component instance, const fmi2StatusKind kind,
                                         fmi2Boolean *value)
{
    return fmi2Discard;
}

FMI2_API fmi2Status fmi2GetStringStatus(fmi2Component instance, const fmi2StatusKind kind,
                                        fmi2String *value)
{
    return fmi2Discard;
}
