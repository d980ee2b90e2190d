/* Functions that a library of FMI 3.0 must have and no unit of this project offers, as its model
 * description says: an importer that calls one of them all the same gets an error. */
#include "fmi3.h"

FMI3_NO_VALUES(Float32)
FMI3_NO_VALUES(Int8)
FMI3_NO_VALUES(UInt8)
FMI3_NO_VALUES(Int16)
FMI3_NO_VALUES(UInt16)
FMI3_NO_VALUES(Int32)
FMI3_NO_VALUES(UInt32)
FMI3_NO_VALUES(Int64)
FMI3_NO_VALUES(UInt64)
FMI3_NO_VALUES(String)

/* Each is defined by one line: its name and its arguments behind the instance. */
#define ABSENT(name, ...)                                          \
    FMI3_API fmi3Status name(fmi3Instance instance, __VA_ARGS__)   \
    {                                                              \
        (void)instance;                                            \
        return fmi3Error;                                          \
    }
#define ABSENT_PLAIN(name)                           \
    FMI3_API fmi3Status name(fmi3Instance instance)  \
    {                                                \
        (void)instance;                              \
        return fmi3Error;                            \
    }
#define REFERENCES const fmi3ValueReference *references, size_t count

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

FMI3_API fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token,
                                                   fmi3String resources, fmi3Boolean visible,
                                                   fmi3Boolean logging,
                                                   fmi3InstanceEnvironment environment,
                                                   fmi3LogMessageCallback log)
{
    return NULL;
}

FMI3_API fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock)
{
    return NULL;
}

ABSENT(fmi3GetNumberOfVariableDependencies, fmi3ValueReference reference, size_t *count)
ABSENT(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t *dependent_elements,
       fmi3ValueReference *independents, size_t *independent_elements, fmi3DependencyKind *kinds,
       size_t count)
ABSENT(fmi3GetDirectionalDerivative, const fmi3ValueReference *unknowns, size_t unknown_count,
       const fmi3ValueReference *knowns, size_t known_count, const fmi3Float64 *seed,
       size_t seed_count, fmi3Float64 *sensitivity, size_t sensitivity_count)
ABSENT(fmi3GetAdjointDerivative, const fmi3ValueReference *unknowns, size_t unknown_count,
       const fmi3ValueReference *knowns, size_t known_count, const fmi3Float64 *seed,
       size_t seed_count, fmi3Float64 *sensitivity, size_t sensitivity_count)
ABSENT(fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32 *orders, fmi3Float64 *values,
       size_t value_count)
ABSENT_PLAIN(fmi3EnterConfigurationMode)
ABSENT_PLAIN(fmi3ExitConfigurationMode)
ABSENT(fmi3GetShiftDecimal, REFERENCES, fmi3Float64 *shifts)
ABSENT(fmi3GetShiftFraction, REFERENCES, fmi3UInt64 *counters, fmi3UInt64 *resolutions)
ABSENT(fmi3SetIntervalDecimal, REFERENCES, const fmi3Float64 *intervals)
ABSENT(fmi3SetIntervalFraction, REFERENCES, const fmi3UInt64 *counters,
       const fmi3UInt64 *resolutions)
ABSENT(fmi3SetShiftDecimal, REFERENCES, const fmi3Float64 *shifts)
ABSENT(fmi3SetShiftFraction, REFERENCES, const fmi3UInt64 *counters, const fmi3UInt64 *resolutions)
ABSENT_PLAIN(fmi3EnterContinuousTimeMode)
ABSENT(fmi3CompletedIntegratorStep, fmi3Boolean no_set_state, fmi3Boolean *enter_event_mode,
       fmi3Boolean *terminate)
ABSENT(fmi3SetTime, fmi3Float64 time)
ABSENT(fmi3SetContinuousStates, const fmi3Float64 *states, size_t count)
ABSENT(fmi3GetContinuousStateDerivatives, fmi3Float64 *derivatives, size_t count)
ABSENT(fmi3GetEventIndicators, fmi3Float64 *indicators, size_t count)
ABSENT(fmi3GetContinuousStates, fmi3Float64 *states, size_t count)
ABSENT(fmi3GetNominalsOfContinuousStates, fmi3Float64 *nominals, size_t count)
ABSENT(fmi3GetNumberOfEventIndicators, size_t *count)
ABSENT(fmi3GetNumberOfContinuousStates, size_t *count)
ABSENT(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)
