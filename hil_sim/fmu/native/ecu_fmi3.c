/* FMI 3.0 of the ECU: co-simulation with event mode, and one CAN network (FMI-LS-BUS 1.0.0).
 *
 * Frames come in with Rx_Clock and are taken by fmi3UpdateDiscreteStates. Tx_Clock counts down: to 0
 * when an answer waits, else to the next control period by the firmware's own clock.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ecu_token.h"
#include "ecu_unit.h"
#include "ecu_variables.h"
#include "fmi3.h"

#define CATEGORY_ERROR "logStatusError"
#define NS_PER_S 1000000000u

typedef struct {
    ecu_unit_t unit;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    double start_s;
    bool has_event_mode;
    bool relies_on_notifications;
    bool is_receiving;
    bool is_sending;
    bool is_interval_told;
    uint32_t received;
    uint8_t operations[ECU_RX_BYTES];
} instance_t;

static fmi3Status fail(const instance_t *ecu, const char *message)
{
    if (ecu->log != NULL) {
        ecu->log(ecu->environment, fmi3Error, CATEGORY_ERROR, message);
    }
    return fmi3Error;
}

static void start(instance_t *ecu, double now_s)
{
    ecu->start_s = now_s;
    ecu->is_receiving = false;
    ecu->is_sending = false;
    ecu->is_interval_told = false;
    ecu->received = 0u;
    ecu_unit_start(&ecu->unit, now_s);
}

FMI3_API fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference *intermediate, size_t intermediate_count,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)visible, (void)logging, (void)early_return, (void)intermediate;
    (void)intermediate_count, (void)update;
    char message[ECU_UNIT_MESSAGE_BYTES];
    instance_t *ecu = calloc(1u, sizeof *ecu);
    if (ecu == NULL) {
        return NULL;
    }
    ecu->environment = environment;
    ecu->log = log;
    ecu->has_event_mode = event_mode;
    if ((token == NULL) || (strcmp(token, ECU_TOKEN) != 0)) {
        (void)fail(ecu, "the instantiation token is not that of this unit; take library and "
                        "modelDescription.xml from one export");
    } else if (!ecu_unit_load(&ecu->unit, (resources != NULL) ? resources : "", message)) {
        (void)fail(ecu, message);
    } else {
        start(ecu, 0.0);
        return ecu;
    }
    free(ecu);
    return NULL;
}

FMI3_API fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance,
                                                fmi3Float64 tolerance, fmi3Float64 start_s,
                                                fmi3Boolean has_stop, fmi3Float64 stop_s)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop_s;
    start(instance, start_s);
    return fmi3OK;
}

FMI3_API fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

FMI3_API fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    instance_t *ecu = instance;
    return ecu->has_event_mode ? fmi3OK
                               : fail(ecu, "event mode was not asked for at instantiation");
}

FMI3_API fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return fmi3EnterEventMode(instance);
}

FMI3_API fmi3Status fmi3Reset(fmi3Instance instance)
{
    instance_t *ecu = instance;
    ecu->relies_on_notifications = false;
    start(ecu, 0.0);
    return fmi3OK;
}

FMI3_API fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference *references,
                                   size_t count, fmi3Float64 *values, size_t value_count)
{
    instance_t *ecu = instance;
    for (size_t i = 0u; i < count; i++) {
        if ((references[i] != ECU_TIME) || (value_count != count)) {
            return fail(ecu, "fmi3GetFloat64: time is the only such variable");
        }
        values[i] = ecu->unit.now_s;
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference *references,
                                   size_t count, const fmi3Float64 *values, size_t value_count)
{
    (void)references, (void)values, (void)value_count;
    return (count == 0u) ? fmi3OK : fail(instance, "fmi3SetFloat64: nothing can be set");
}

FMI3_API fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference *references,
                                   size_t count, fmi3Boolean *values, size_t value_count)
{
    instance_t *ecu = instance;
    for (size_t i = 0u; i < count; i++) {
        if ((references[i] != ECU_NOTIFICATIONS) || (value_count != count)) {
            return fail(ecu, "fmi3GetBoolean: " ECU_NOTIFICATIONS_NAME " is the only one");
        }
        values[i] = ecu->relies_on_notifications;
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference *references,
                                   size_t count, const fmi3Boolean *values, size_t value_count)
{
    instance_t *ecu = instance;
    for (size_t i = 0u; i < count; i++) {
        if ((references[i] != ECU_NOTIFICATIONS) || (value_count != count)) {
            return fail(ecu, "fmi3SetBoolean: " ECU_NOTIFICATIONS_NAME " is the only one");
        }
        ecu->relies_on_notifications = values[i];
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference *references,
                                  size_t count, size_t *sizes, fmi3Binary *values,
                                  size_t value_count)
{
    instance_t *ecu = instance;
    for (size_t i = 0u; i < count; i++) {
        if ((references[i] != ECU_TX_DATA) || (value_count != count)) {
            return fail(ecu, "fmi3GetBinary: " ECU_TX_DATA_NAME " is the only one to read");
        }
        sizes[i] = ecu->is_sending ? ecu->unit.node.outgoing.length : 0u;
        values[i] = ecu->unit.node.outgoing.bytes;
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference *references,
                                  size_t count, const size_t *sizes, const fmi3Binary *values,
                                  size_t value_count)
{
    instance_t *ecu = instance;
    for (size_t i = 0u; i < count; i++) {
        if ((references[i] != ECU_RX_DATA) || (value_count != count)) {
            return fail(ecu, "fmi3SetBinary: " ECU_RX_DATA_NAME " is the only one to set");
        }
        if (sizes[i] > sizeof ecu->operations) {
            return fail(ecu, ECU_RX_DATA_NAME " is larger than its maxSize");
        }
        if ((sizes[i] > 0u) && !ecu->is_receiving) {
            return fail(ecu, ECU_RX_DATA_NAME " is set while its clock is not active");
        }
        ecu->received = (uint32_t)sizes[i];
        memcpy(ecu->operations, values[i], sizes[i]);
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference *references,
                                 size_t count, fmi3Clock *values)
{
    instance_t *ecu = instance;
    for (size_t i = 0u; i < count; i++) {
        if ((references[i] != ECU_RX_CLOCK) && (references[i] != ECU_TX_CLOCK)) {
            return fail(ecu, "fmi3GetClock: no such clock");
        }
        values[i] = (references[i] == ECU_RX_CLOCK) ? ecu->is_receiving : ecu->is_sending;
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference *references,
                                 size_t count, const fmi3Clock *values)
{
    instance_t *ecu = instance;
    for (size_t i = 0u; i < count; i++) {
        if (references[i] == ECU_RX_CLOCK) {
            ecu->is_receiving = values[i];
        } else if (references[i] == ECU_TX_CLOCK) {
            ecu->is_sending = values[i];
            if (values[i]) {
                ecu_unit_follow_clock(&ecu->unit);
            }
        } else {
            return fail(ecu, "fmi3SetClock: no such clock");
        }
    }
    return fmi3OK;
}

/* What the importer has been told once has not changed until the next event. */
static fmi3IntervalQualifier interval(instance_t *ecu, double *interval_s)
{
    if (!ecu_unit_interval(&ecu->unit, interval_s)) {
        return fmi3IntervalNotYetKnown;
    }
    const bool is_told = ecu->is_interval_told;
    ecu->is_interval_told = true;
    return is_told ? fmi3IntervalUnchanged : fmi3IntervalChanged;
}

FMI3_API fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance,
                                           const fmi3ValueReference *references, size_t count,
                                           fmi3Float64 *intervals,
                                           fmi3IntervalQualifier *qualifiers)
{
    instance_t *ecu = instance;
    for (size_t i = 0u; i < count; i++) {
        if (references[i] != ECU_TX_CLOCK) {
            return fail(ecu, "fmi3GetIntervalDecimal: only " ECU_TX_CLOCK_NAME " counts down");
        }
        intervals[i] = 0.0;
        qualifiers[i] = interval(ecu, &intervals[i]);
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3GetIntervalFraction(fmi3Instance instance,
                                            const fmi3ValueReference *references, size_t count,
                                            fmi3UInt64 *counters, fmi3UInt64 *resolutions,
                                            fmi3IntervalQualifier *qualifiers)
{
    for (size_t i = 0u; i < count; i++) {
        double interval_s;
        if (fmi3GetIntervalDecimal(instance, &references[i], 1u, &interval_s, &qualifiers[i]) !=
            fmi3OK) {
            return fmi3Error;
        }
        counters[i] = (uint64_t)(interval_s * NS_PER_S + 0.5);
        resolutions[i] = NS_PER_S;
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

FMI3_API fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *needs_update,
                                             fmi3Boolean *terminates,
                                             fmi3Boolean *nominals_changed,
                                             fmi3Boolean *states_changed,
                                             fmi3Boolean *has_next_event,
                                             fmi3Float64 *next_event_s)
{
    instance_t *ecu = instance;
    if (ecu->is_sending) { /* has been read */
        ecu->unit.node.outgoing.length = 0u;
    }
    if (ecu->is_receiving) {
        ecu_unit_receive(&ecu->unit, ecu->operations, ecu->received);
    }
    ecu->is_sending = false;
    ecu->is_receiving = false;
    ecu->received = 0u;
    ecu->is_interval_told = false;
    *needs_update = false;
    *terminates = false;
    *nominals_changed = false;
    *states_changed = false;
    *has_next_event = false;
    *next_event_s = 0.0;
    return fmi3OK;
}

/* Without event mode nothing can be received or sent, and the firmware waits. */
FMI3_API fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 now_s, fmi3Float64 step_s,
                               fmi3Boolean no_set_state, fmi3Boolean *needs_event,
                               fmi3Boolean *terminates, fmi3Boolean *is_early,
                               fmi3Float64 *reached_s)
{
    (void)no_set_state;
    instance_t *ecu = instance;
    double interval_s;
    ecu->unit.now_s = now_s + step_s;
    *needs_event = ecu->has_event_mode && ecu_unit_interval(&ecu->unit, &interval_s) &&
                   (interval_s <= 0.0);
    *terminates = false;
    *is_early = false;
    *reached_s = ecu->unit.now_s;
    return fmi3OK;
}

FMI3_API fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    instance_t *copy = (*state != NULL) ? *state : malloc(sizeof *copy);
    if (copy == NULL) {
        return fail(instance, "fmi3GetFMUState: no memory");
    }
    memcpy(copy, instance, sizeof *copy);
    *state = copy;
    return fmi3OK;
}

/* A state belongs to the instance that it was taken of: it refers to the calibration there. */
FMI3_API fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    memcpy(instance, state, sizeof(instance_t));
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state,
                                               size_t *size)
{
    (void)state, (void)size;
    return fail(instance, "a state of this unit cannot be written down");
}

FMI3_API fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state,
                                          fmi3Byte *bytes, size_t size)
{
    (void)bytes;
    return fmi3SerializedFMUStateSize(instance, state, &size);
}

FMI3_API fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte *bytes,
                                            size_t size, fmi3FMUState *state)
{
    (void)bytes;
    return fmi3SerializedFMUStateSize(instance, *state, &size);
}
