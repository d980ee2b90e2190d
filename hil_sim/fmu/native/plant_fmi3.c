/* FMI 3.0 of the plant: co-simulation with a step of any length. */
#include <stdlib.h>
#include <string.h>

#include "fmi3.h"
#include "plant_token.h"
#include "plant_unit.h"

#define CATEGORY_ERROR "logStatusError"

typedef struct {
    plant_unit_t unit;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} instance_t;

static fmi3Status fail(const instance_t *plant, const char *message)
{
    if (plant->log != NULL) {
        plant->log(plant->environment, fmi3Error, CATEGORY_ERROR, message);
    }
    return fmi3Error;
}

FMI3_API fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference *intermediate, size_t intermediate_count,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)event_mode;
    (void)early_return, (void)intermediate, (void)intermediate_count, (void)update;
    instance_t *plant = calloc(1u, sizeof *plant);
    if (plant == NULL) {
        return NULL;
    }
    plant->environment = environment;
    plant->log = log;
    if ((token == NULL) || (strcmp(token, PLANT_TOKEN) != 0)) {
        (void)fail(plant, "the instantiation token is not that of this unit; take library and "
                          "modelDescription.xml from one export");
        free(plant);
        return NULL;
    }
    plant_unit_start(&plant->unit, 0.0);
    return plant;
}

FMI3_API fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance,
                                                fmi3Float64 tolerance, fmi3Float64 start_s,
                                                fmi3Boolean has_stop, fmi3Float64 stop_s)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop_s;
    instance_t *plant = instance;
    plant->unit.now_s = start_s;
    return fmi3OK;
}

FMI3_API fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    instance_t *plant = instance;
    plant_unit_run(&plant->unit);
    return fmi3OK;
}

FMI3_API fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    return fail(instance, "the plant has no event mode");
}

FMI3_API fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    return fail(instance, "the plant has no event mode");
}

FMI3_API fmi3Status fmi3Reset(fmi3Instance instance)
{
    instance_t *plant = instance;
    plant_unit_start(&plant->unit, 0.0);
    return fmi3OK;
}

FMI3_API fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference *references,
                                   size_t count, fmi3Float64 *values, size_t value_count)
{
    instance_t *plant = instance;
    for (size_t i = 0u; i < count; i++) {
        if ((value_count != count) || !plant_unit_get(&plant->unit, references[i], &values[i])) {
            return fail(plant, "fmi3GetFloat64: no such variable");
        }
    }
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference *references,
                                   size_t count, const fmi3Float64 *values, size_t value_count)
{
    instance_t *plant = instance;
    for (size_t i = 0u; i < count; i++) {
        if ((value_count != count) || !plant_unit_set(&plant->unit, references[i], values[i])) {
            return fail(plant, "fmi3SetFloat64: " PLANT_SET_REFUSED);
        }
    }
    return fmi3OK;
}

FMI3_NO_VALUES(Boolean)

FMI3_API fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 now_s, fmi3Float64 step_s,
                               fmi3Boolean no_set_state, fmi3Boolean *needs_event,
                               fmi3Boolean *terminates, fmi3Boolean *is_early,
                               fmi3Float64 *reached_s)
{
    (void)no_set_state;
    instance_t *plant = instance;
    *needs_event = false;
    *terminates = false;
    *is_early = false;
    *reached_s = now_s;
    plant->unit.now_s = now_s;
    if (!plant_unit_advance(&plant->unit, step_s)) {
        return fail(plant, "fmi3DoStep: " PLANT_STEP_REFUSED);
    }
    *reached_s = plant->unit.now_s;
    return fmi3OK;
}

FMI3_API fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    instance_t *plant = instance;
    plant_unit_t *copy = (*state != NULL) ? *state : malloc(sizeof *copy);
    if (copy == NULL) {
        return fail(plant, "fmi3GetFMUState: no memory");
    }
    *copy = plant->unit;
    *state = copy;
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    instance_t *plant = instance;
    plant->unit = *(const plant_unit_t *)state;
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state,
                                               size_t *size)
{
    (void)instance, (void)state;
    *size = sizeof(plant_unit_t);
    return fmi3OK;
}

FMI3_API fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state,
                                          fmi3Byte *bytes, size_t size)
{
    if (size != sizeof(plant_unit_t)) {
        return fail(instance, "fmi3SerializeFMUState: not the size of a state");
    }
    memcpy(bytes, state, size);
    return fmi3OK;
}

FMI3_API fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte *bytes,
                                            size_t size, fmi3FMUState *state)
{
    if (size != sizeof(plant_unit_t)) {
        return fail(instance, "fmi3DeserializeFMUState: not the size of a state");
    }
    plant_unit_t *copy = malloc(sizeof *copy);
    if (copy == NULL) {
        return fail(instance, "fmi3DeserializeFMUState: no memory");
    }
    memcpy(copy, bytes, size);
    *state = copy;
    return fmi3OK;
}
