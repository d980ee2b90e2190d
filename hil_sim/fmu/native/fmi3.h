/* The interface of FMI 3.0 for co-simulation, declared for the units of this project.
 *
 * Where the headers of the standard are at hand, UNIT_STANDARD_HEADERS takes those instead, so that
 * a compiler can hold these declarations to them.
 */
#ifndef FMI3_H
#define FMI3_H

#ifdef UNIT_STANDARD_HEADERS
#include "fmi3Functions.h"
#define FMI3_API FMI3_Export
#else

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define FMI3_API __declspec(dllexport)
#elif defined(__GNUC__)
#define FMI3_API __attribute__((visibility("default")))
#else
#define FMI3_API
#endif

typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;
typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
    fmi3Independent,
    fmi3Constant,
    fmi3Fixed,
    fmi3Tunable,
    fmi3Discrete,
    fmi3Dependent
} fmi3DependencyKind;
typedef enum {
    fmi3IntervalNotYetKnown,
    fmi3IntervalUnchanged,
    fmi3IntervalChanged
} fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment environment, fmi3Status status,
                                       fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment environment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment environment,
                                               fmi3Float64 time, fmi3Boolean set_requested,
                                               fmi3Boolean get_allowed, fmi3Boolean step_finished,
                                               fmi3Boolean can_return_early,
                                               fmi3Boolean *early_return_requested,
                                               fmi3Float64 *early_return_time);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);

#endif

/* Definitions of values of a type that a unit does not have: none are asked for, or it is wrong. */
#define FMI3_NO_VALUES(type)                                                                       \
    FMI3_API fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference *references, \
                                      size_t count, fmi3##type *values, size_t value_count)        \
    {                                                                                              \
        (void)instance, (void)references, (void)values, (void)value_count;                         \
        return (count == 0u) ? fmi3OK : fmi3Error;                                                 \
    }                                                                                              \
    FMI3_API fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference *references, \
                                      size_t count, const fmi3##type *values, size_t value_count)  \
    {                                                                                              \
        (void)instance, (void)references, (void)values, (void)value_count;                         \
        return (count == 0u) ? fmi3OK : fmi3Error;                                                 \
    }

#endif
