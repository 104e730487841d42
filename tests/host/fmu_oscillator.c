/* A functional mock-up unit for tests (FMI 2.0): a mass on a spring, driven by a held force.
 *
 *   q'' = (g u - c q' - k q) / m; in co-simulation integrated in 50 sub-steps of the semi-implicit Euler rule a step.
 *
 * As model exchange it tells an event whenever q changes its sign, which changes nothing.
 */
#include "fmi2Functions.h"

#include <stdlib.h>

enum { REFERENCE_DRIVE, REFERENCE_POSITION, REFERENCE_SPEED, REFERENCES };

#define SUB_STEPS 50

typedef struct {
    double value[REFERENCES];
} oscillator_t;

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}
const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name, (void)type, (void)guid, (void)resources, (void)functions, (void)visible, (void)logging;
    return calloc(1, sizeof(oscillator_t));
}

void fmi2FreeInstance(fmi2Component unit)
{
    free(unit);
}

fmi2Status fmi2SetupExperiment(fmi2Component unit, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop)
{
    (void)unit, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component unit)
{
    return (void)unit, fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component unit)
{
    return (void)unit, fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component unit)
{
    return (void)unit, fmi2OK;
}
fmi2Status fmi2Reset(fmi2Component unit)
{
    return (void)unit, fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component unit, const fmi2ValueReference reference[], size_t count, fmi2Real value[])
{
    for (size_t i = 0; i < count; i++) {
        value[i] = ((oscillator_t *)unit)->value[reference[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component unit, const fmi2ValueReference reference[], size_t count, const fmi2Real value[])
{
    for (size_t i = 0; i < count; i++) {
        ((oscillator_t *)unit)->value[reference[i]] = value[i];
    }
    return fmi2OK;
}

static double acceleration(const double *x)
{
    return (4.0 * x[REFERENCE_DRIVE] - 1.5 * x[REFERENCE_SPEED] - 80.0 * x[REFERENCE_POSITION]) / 2.0;
}

fmi2Status fmi2DoStep(fmi2Component unit, fmi2Real now, fmi2Real step, fmi2Boolean no_set_before)
{
    double *x = ((oscillator_t *)unit)->value;
    const double h = step / SUB_STEPS;
    (void)now, (void)no_set_before;
    for (int i = 0; i < SUB_STEPS; i++) {
        x[REFERENCE_SPEED] += h * acceleration(x);
        x[REFERENCE_POSITION] += h * x[REFERENCE_SPEED];
    }
    return fmi2OK;
}

/* Model exchange: the states are position and speed. */
fmi2Status fmi2EnterEventMode(fmi2Component unit)
{
    return (void)unit, fmi2OK;
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component unit)
{
    return (void)unit, fmi2OK;
}
fmi2Status fmi2SetTime(fmi2Component unit, fmi2Real time)
{
    return (void)unit, (void)time, fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component unit, fmi2EventInfo *found)
{
    (void)unit;
    *found = (fmi2EventInfo){.newDiscreteStatesNeeded = fmi2False};
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component unit, fmi2Boolean no_set_before, fmi2Boolean *event,
                                       fmi2Boolean *terminate)
{
    (void)unit, (void)no_set_before;
    *event = *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component unit, const fmi2Real state[], size_t count)
{
    return fmi2SetReal(unit, (const fmi2ValueReference[]){REFERENCE_POSITION, REFERENCE_SPEED}, count, state);
}

fmi2Status fmi2GetContinuousStates(fmi2Component unit, fmi2Real state[], size_t count)
{
    return fmi2GetReal(unit, (const fmi2ValueReference[]){REFERENCE_POSITION, REFERENCE_SPEED}, count, state);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component unit, fmi2Real nominal[], size_t count)
{
    (void)unit;
    for (size_t i = 0; i < count; i++) {
        nominal[i] = 1.0;
    }
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component unit, fmi2Real derivative[], size_t count)
{
    const double *x = ((oscillator_t *)unit)->value;
    (void)count;
    derivative[0] = x[REFERENCE_SPEED];
    derivative[1] = acceleration(x);
    return fmi2OK;
}

fmi2Status fmi2GetEventIndicators(fmi2Component unit, fmi2Real indicator[], size_t count)
{
    (void)count;
    indicator[0] = ((oscillator_t *)unit)->value[REFERENCE_POSITION];
    return fmi2OK;
}

/* What the standard demands of every unit and this one has no use for. */
#define REFUSE(name, ...)                                                                                              \
    fmi2Status name(__VA_ARGS__)                                                                                       \
    {                                                                                                                  \
        return fmi2Error;                                                                                              \
    }
#pragma GCC diagnostic ignored "-Wunused-parameter"
REFUSE(fmi2SetDebugLogging, fmi2Component unit, fmi2Boolean on, size_t count, const fmi2String categories[])
REFUSE(fmi2GetInteger, fmi2Component unit, const fmi2ValueReference r[], size_t n, fmi2Integer v[])
REFUSE(fmi2GetBoolean, fmi2Component unit, const fmi2ValueReference r[], size_t n, fmi2Boolean v[])
REFUSE(fmi2GetString, fmi2Component unit, const fmi2ValueReference r[], size_t n, fmi2String v[])
REFUSE(fmi2SetInteger, fmi2Component unit, const fmi2ValueReference r[], size_t n, const fmi2Integer v[])
REFUSE(fmi2SetBoolean, fmi2Component unit, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[])
REFUSE(fmi2SetString, fmi2Component unit, const fmi2ValueReference r[], size_t n, const fmi2String v[])
REFUSE(fmi2GetFMUstate, fmi2Component unit, fmi2FMUstate *state)
REFUSE(fmi2SetFMUstate, fmi2Component unit, fmi2FMUstate state)
REFUSE(fmi2FreeFMUstate, fmi2Component unit, fmi2FMUstate *state)
REFUSE(fmi2SerializedFMUstateSize, fmi2Component unit, fmi2FMUstate state, size_t *size)
REFUSE(fmi2SerializeFMUstate, fmi2Component unit, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
REFUSE(fmi2DeSerializeFMUstate, fmi2Component unit, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
REFUSE(fmi2GetDirectionalDerivative, fmi2Component unit, const fmi2ValueReference a[], size_t na,
       const fmi2ValueReference b[], size_t nb, const fmi2Real db[], fmi2Real da[])
REFUSE(fmi2SetRealInputDerivatives, fmi2Component unit, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
       const fmi2Real v[])
REFUSE(fmi2GetRealOutputDerivatives, fmi2Component unit, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
       fmi2Real v[])
REFUSE(fmi2CancelStep, fmi2Component unit)
REFUSE(fmi2GetStatus, fmi2Component unit, const fmi2StatusKind kind, fmi2Status *value)
REFUSE(fmi2GetRealStatus, fmi2Component unit, const fmi2StatusKind kind, fmi2Real *value)
REFUSE(fmi2GetIntegerStatus, fmi2Component unit, const fmi2StatusKind kind, fmi2Integer *value)
REFUSE(fmi2GetBooleanStatus, fmi2Component unit, const fmi2StatusKind kind, fmi2Boolean *value)
REFUSE(fmi2GetStringStatus, fmi2Component unit, const fmi2StatusKind kind, fmi2String *value)
