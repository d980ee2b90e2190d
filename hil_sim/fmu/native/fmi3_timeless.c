/* What a unit of FMI 3.0 without clocks and binary values answers to questions about them. */
#include "fmi3.h"

FMI3_API fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference *references,
                                  size_t count, size_t *sizes, fmi3Binary *values,
                                  size_t value_count)
{
    (void)instance, (void)references, (void)sizes, (void)values, (void)value_count;
    return (count == 0u) ? fmi3OK : fmi3Error;
}

FMI3_API fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference *references,
                                  size_t count, const size_t *sizes, const fmi3Binary *values,
                                  size_t value_count)
{
    (void)instance, (void)references, (void)sizes, (void)values, (void)value_count;
    return (count == 0u) ? fmi3OK : fmi3Error;
}

FMI3_API fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference *references,
                                 size_t count, fmi3Clock *values)
{
    (void)instance, (void)references, (void)values;
    return (count == 0u) ? fmi3OK : fmi3Error;
}

FMI3_API fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference *references,
                                 size_t count, const fmi3Clock *values)
{
    (void)instance, (void)references, (void)values;
    return (count == 0u) ? fmi3OK : fmi3Error;
}

FMI3_API fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance,
                                           const fmi3ValueReference *references, size_t count,
                                           fmi3Float64 *intervals,
                                           fmi3IntervalQualifier *qualifiers)
{
    (void)instance, (void)references, (void)intervals, (void)qualifiers;
    return (count == 0u) ? fmi3OK : fmi3Error;
}

FMI3_API fmi3Status fmi3GetIntervalFraction(fmi3Instance instance,
                                            const fmi3ValueReference *references, size_t count,
                                            fmi3UInt64 *counters, fmi3UInt64 *resolutions,
                                            fmi3IntervalQualifier *qualifiers)
{
    (void)instance, (void)references, (void)counters, (void)resolutions, (void)qualifiers;
    return (count == 0u) ? fmi3OK : fmi3Error;
}

FMI3_API fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    (void)instance;
    return fmi3Error;
}

FMI3_API fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *needs_update,
                                             fmi3Boolean *terminates,
                                             fmi3Boolean *nominals_changed,
                                             fmi3Boolean *states_changed,
                                             fmi3Boolean *has_next_event,
                                             fmi3Float64 *next_event_s)
{
    (void)instance, (void)needs_update, (void)terminates, (void)nominals_changed;
    (void)states_changed, (void)has_next_event, (void)next_event_s;
    return fmi3Error;
}
