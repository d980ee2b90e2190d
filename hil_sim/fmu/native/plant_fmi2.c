/* FMI 2.0 of the plant: co-simulation with a step of any length. */
#include <stdlib.h>
#include <string.h>

#include "fmi2.h"
#include "plant_token.h"
#include "plant_unit.h"

#define CATEGORY_ERROR "logStatusError"
#define NAME_BYTES 128

typedef struct {
    plant_unit_t unit;
    const fmi2CallbackFunctions *callbacks;
    char name[NAME_BYTES];
} instance_t;

static fmi2Status fail(const instance_t *plant, const char *message)
{
    if ((plant->callbacks != NULL) && (plant->callbacks->logger != NULL)) {
        plant->callbacks->logger(plant->callbacks->componentEnvironment, plant->name, fmi2Error,
                                 CATEGORY_ERROR, "%s", message);
    }
    return fmi2Error;
}

FMI2_API const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

FMI2_API const char *fmi2GetVersion(void)
{
    return "2.0";
}

FMI2_API fmi2Status fmi2SetDebugLogging(fmi2Component instance, fmi2Boolean logging, size_t count,
                                        const fmi2String *categories)
{
    (void)instance, (void)logging, (void)count, (void)categories; /* errors are always told */
    return fmi2OK;
}

FMI2_API fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token,
                                       fmi2String resources,
                                       const fmi2CallbackFunctions *callbacks,
                                       fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible, (void)logging;
    instance_t *plant = calloc(1u, sizeof *plant);
    if (plant == NULL) {
        return NULL;
    }
    plant->callbacks = callbacks;
    strncpy(plant->name, (name != NULL) ? name : "", NAME_BYTES - 1u);
    if (type != fmi2CoSimulation) {
        (void)fail(plant, "the plant is for co-simulation alone");
    } else if ((token == NULL) || (strcmp(token, PLANT_TOKEN) != 0)) {
        (void)fail(plant, "the GUID is not that of this unit; take library and "
                          "modelDescription.xml from one export");
    } else {
        plant_unit_start(&plant->unit, 0.0);
        return plant;
    }
    free(plant);
    return NULL;
}

FMI2_API void fmi2FreeInstance(fmi2Component instance)
{
    free(instance);
}

FMI2_API fmi2Status fmi2SetupExperiment(fmi2Component instance, fmi2Boolean has_tolerance,
                                        fmi2Real tolerance, fmi2Real start_s, fmi2Boolean has_stop,
                                        fmi2Real stop_s)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop_s;
    instance_t *plant = instance;
    plant->unit.now_s = start_s;
    return fmi2OK;
}

FMI2_API fmi2Status fmi2EnterInitializationMode(fmi2Component instance)
{
    (void)instance;
    return fmi2OK;
}

FMI2_API fmi2Status fmi2ExitInitializationMode(fmi2Component instance)
{
    instance_t *plant = instance;
    plant_unit_run(&plant->unit);
    return fmi2OK;
}

FMI2_API fmi2Status fmi2Terminate(fmi2Component instance)
{
    (void)instance;
    return fmi2OK;
}

FMI2_API fmi2Status fmi2Reset(fmi2Component instance)
{
    instance_t *plant = instance;
    plant_unit_start(&plant->unit, 0.0);
    return fmi2OK;
}

FMI2_API fmi2Status fmi2GetReal(fmi2Component instance, const fmi2ValueReference *references,
                                size_t count, fmi2Real *values)
{
    instance_t *plant = instance;
    for (size_t i = 0u; i < count; i++) {
        if (!plant_unit_get(&plant->unit, references[i], &values[i])) {
            return fail(plant, "fmi2GetReal: no such variable");
        }
    }
    return fmi2OK;
}

FMI2_API fmi2Status fmi2SetReal(fmi2Component instance, const fmi2ValueReference *references,
                                size_t count, const fmi2Real *values)
{
    instance_t *plant = instance;
    for (size_t i = 0u; i < count; i++) {
        if (!plant_unit_set(&plant->unit, references[i], values[i])) {
            return fail(plant, "fmi2SetReal: " PLANT_SET_REFUSED);
        }
    }
    return fmi2OK;
}

/* Definitions of values of a type that the plant does not have. */
#define NO_VALUES(type)                                                                         \
    FMI2_API fmi2Status fmi2Get##type(fmi2Component instance,                                   \
                                      const fmi2ValueReference *references, size_t count,       \
                                      fmi2##type *values)                                       \
    {                                                                                           \
        (void)instance, (void)references, (void)values;                                         \
        return (count == 0u) ? fmi2OK : fmi2Error;                                              \
    }                                                                                           \
    FMI2_API fmi2Status fmi2Set##type(fmi2Component instance,                                   \
                                      const fmi2ValueReference *references, size_t count,       \
                                      const fmi2##type *values)                                 \
    {                                                                                           \
        (void)instance, (void)references, (void)values;                                         \
        return (count == 0u) ? fmi2OK : fmi2Error;                                              \
    }
NO_VALUES(Integer)
NO_VALUES(Boolean)
NO_VALUES(String)

FMI2_API fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real now_s, fmi2Real step_s,
                               fmi2Boolean no_set_state)
{
    (void)no_set_state;
    instance_t *plant = instance;
    plant->unit.now_s = now_s;
    return plant_unit_advance(&plant->unit, step_s) ? fmi2OK
                                                    : fail(plant, "fmi2DoStep: " PLANT_STEP_REFUSED);
}

FMI2_API fmi2Status fmi2CancelStep(fmi2Component instance)
{
    return fail(instance, "fmi2CancelStep: a step ends before its call does");
}

FMI2_API fmi2Status fmi2GetFMUstate(fmi2Component instance, fmi2FMUstate *state)
{
    instance_t *plant = instance;
    plant_unit_t *copy = (*state != NULL) ? *state : malloc(sizeof *copy);
    if (copy == NULL) {
        return fail(plant, "fmi2GetFMUstate: no memory");
    }
    *copy = plant->unit;
    *state = copy;
    return fmi2OK;
}

FMI2_API fmi2Status fmi2SetFMUstate(fmi2Component instance, fmi2FMUstate state)
{
    instance_t *plant = instance;
    plant->unit = *(const plant_unit_t *)state;
    return fmi2OK;
}

FMI2_API fmi2Status fmi2FreeFMUstate(fmi2Component instance, fmi2FMUstate *state)
{
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

FMI2_API fmi2Status fmi2SerializedFMUstateSize(fmi2Component instance, fmi2FMUstate state,
                                               size_t *size)
{
    (void)instance, (void)state;
    *size = sizeof(plant_unit_t);
    return fmi2OK;
}

FMI2_API fmi2Status fmi2SerializeFMUstate(fmi2Component instance, fmi2FMUstate state,
                                          fmi2Byte *bytes, size_t size)
{
    if (size != sizeof(plant_unit_t)) {
        return fail(instance, "fmi2SerializeFMUstate: not the size of a state");
    }
    memcpy(bytes, state, size);
    return fmi2OK;
}

FMI2_API fmi2Status fmi2DeSerializeFMUstate(fmi2Component instance, const fmi2Byte *bytes,
                                            size_t size, fmi2FMUstate *state)
{
    if (size != sizeof(plant_unit_t)) {
        return fail(instance, "fmi2DeSerializeFMUstate: not the size of a state");
    }
    plant_unit_t *copy = malloc(sizeof *copy);
    if (copy == NULL) {
        return fail(instance, "fmi2DeSerializeFMUstate: no memory");
    }
    memcpy(copy, bytes, size);
    *state = copy;
    return fmi2OK;
}
