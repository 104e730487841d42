"""Hold the C text of a functional mock-up unit, FMI 2.0 for co-simulation; words between @ are put in by fmu_write."""

TEMPLATE = """\
/* Functional mock-up unit made by aeolid: FMI 2.0, co-simulation. The types are those of the standard's section 2.1. */
#include <stddef.h>
#include <stdlib.h>

#include "@name@.h"

#if defined _WIN32 || defined __CYGWIN__
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef char fmi2Char, fmi2Byte;
typedef const fmi2Char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef void (*fmi2Logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
typedef struct {
    fmi2Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment environment;
} fmi2CallbackFunctions;

enum { INPUTS = @R@, OUTPUTS = @L@, STATES = @N@, PARAMETERS = @P@ };
enum { FIRST_OUTPUT = INPUTS, FIRST_STATE = INPUTS + OUTPUTS, FIRST_START = FIRST_STATE + STATES };
enum { FIRST_PARAMETER = FIRST_START + STATES, VARIABLES = FIRST_PARAMETER + PARAMETERS };

typedef struct {
    @name@_simulation run;
    double u[@UPPER@_ROOM(@R@)];
    double start[@UPPER@_ROOM(@N@)]; /* what the states were last set to */
} unit_state;

static const double declared_inputs[@UPPER@_ROOM(@R@)] = @INPUTS@;

typedef struct {
    unit_state state;
    fmi2CallbackFunctions callbacks;
    char name[64];
} unit;

static fmi2Status told(const unit *c, const char *message) {
    if (c->callbacks.logger != NULL) {
        c->callbacks.logger(c->callbacks.environment, c->name, fmi2Error, "logStatusError", message);
    }
    return fmi2Error;
}

static void begin(unit *c) {
    memset(&c->state, 0, sizeof c->state);
    @name@_reset(&c->state.run);
    memcpy(c->state.u, declared_inputs, sizeof(double) * @R@);
    memcpy(c->state.start, c->state.run.x, sizeof(double) * @N@);
}

EXPORT const char *fmi2GetTypesPlatform(void) {
    return "default";
}

EXPORT const char *fmi2GetVersion(void) {
    return "2.0";
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    unit *c;
    (void)(resources);
    (void)(visible);
    (void)(logging);
    if (type != fmi2CoSimulation || guid == NULL || strcmp(guid, "@GUID@") != 0) {
        return NULL;
    }
    c = (unit *)calloc(1, sizeof *c);
    if (c == NULL) {
        return NULL;
    }
    if (callbacks != NULL) {
        c->callbacks = *callbacks;
    }
    strncpy(c->name, name != NULL ? name : "@name@", sizeof c->name - 1);
    begin(c);
    return c;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    free(c);
}

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)(c);
    (void)(on);
    (void)(n);
    (void)(categories);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean has_stop, fmi2Real stop) {
    (void)(has_tolerance);
    (void)(tolerance);
    (void)(has_stop);
    (void)(stop);
    ((unit *)c)->state.run.time_s = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    (void)(c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    (void)(c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    (void)(c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    begin((unit *)c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    const unit *c = (const unit *)component;
    double y[@UPPER@_ROOM(@L@)];
    @name@_outputs(&c->state.run, c->state.u, y);
    for (size_t k = 0; k < n; k++) {
        const int i = vr[k] < (fmi2ValueReference)VARIABLES ? (int)vr[k] : VARIABLES;
        if (i < FIRST_OUTPUT) {
            value[k] = c->state.u[i];
        } else if (i < FIRST_STATE) {
            value[k] = y[i - FIRST_OUTPUT];
        } else if (i < FIRST_START) {
            value[k] = c->state.run.x[i - FIRST_STATE];
        } else if (i < FIRST_PARAMETER) {
            value[k] = c->state.start[i - FIRST_START];
        } else if (i < VARIABLES) {
            value[k] = c->state.run.parameter[i - FIRST_PARAMETER];
        } else {
            return told(c, "a value reference that no variable has");
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t n,
                              const fmi2Real value[]) {
    unit *c = (unit *)component;
    for (size_t k = 0; k < n; k++) {
        const int i = vr[k] < (fmi2ValueReference)VARIABLES ? (int)vr[k] : VARIABLES;
        if ((i >= FIRST_OUTPUT && i < FIRST_START) || i == VARIABLES) {
            return told(c, "only inputs, starts and parameters can be set");
        }
        if (i < FIRST_OUTPUT) {
            c->state.u[i] = value[k];
        } else if (i < FIRST_PARAMETER) {
            c->state.start[i - FIRST_START] = value[k];
            c->state.run.x[i - FIRST_START] = value[k];
        } else {
            c->state.run.parameter[i - FIRST_PARAMETER] = value[k];
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component component, fmi2Real now, fmi2Real length, fmi2Boolean no_return) {
    unit *c = (unit *)component;
    (void)(now);
    (void)(no_return);
    const int failed = @name@_step(&c->state.run, c->state.u, length);
    if (failed == 0) {
        return fmi2OK;
    }
    if (failed == -2) {
        return told(c, "a parameter that is a dead time is outside its declared range");
    }
    return told(c, "a state has left the finite numbers, or the step is none of the model's (@STEP@ s)");
}

/* Kept states are whole copies. */
EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *kept) {
    if (*kept == NULL) {
        *kept = malloc(sizeof(unit_state));
    }
    if (*kept == NULL) {
        return fmi2Error;
    }
    memcpy(*kept, &((unit *)c)->state, sizeof(unit_state));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate kept) {
    memcpy(&((unit *)c)->state, kept, sizeof(unit_state));
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *kept) {
    (void)(c);
    free(*kept);
    *kept = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate kept, size_t *size) {
    (void)(c);
    (void)(kept);
    *size = sizeof(unit_state);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate kept, fmi2Byte bytes[], size_t size) {
    (void)(c);
    if (size < sizeof(unit_state)) {
        return fmi2Error;
    }
    memcpy(bytes, kept, sizeof(unit_state));
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *kept) {
    if (size != sizeof(unit_state) || fmi2GetFMUstate(c, kept) != fmi2OK) {
        return fmi2Error;
    }
    memcpy(*kept, bytes, sizeof(unit_state));
    return fmi2OK;
}

/* What a unit of reals that computes at once has no use for. */
#define NO_VALUES(kind) \\
    EXPORT fmi2Status fmi2Get##kind(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##kind value[]) { \\
        (void)(vr); \\
        (void)(value); \\
        return n == 0 ? fmi2OK : told((unit *)c, "all variables are reals"); \\
    } \\
    EXPORT fmi2Status fmi2Set##kind(fmi2Component c, const fmi2ValueReference vr[], size_t n, \\
                                    const fmi2##kind value[]) { \\
        (void)(vr); \\
        (void)(value); \\
        return n == 0 ? fmi2OK : told((unit *)c, "all variables are reals"); \\
    }

NO_VALUES(Integer)
NO_VALUES(Boolean)
NO_VALUES(String)

EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                               const fmi2ValueReference known[], size_t m, const fmi2Real dv[],
                                               fmi2Real result[]) {
    (void)(unknown);
    (void)(n);
    (void)(known);
    (void)(m);
    (void)(dv);
    (void)(result);
    return told((unit *)c, "no directional derivatives");
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                              const fmi2Integer order[], const fmi2Real value[]) {
    (void)(vr);
    (void)(n);
    (void)(order);
    (void)(value);
    return told((unit *)c, "inputs are held over a step");
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                               const fmi2Integer order[], fmi2Real value[]) {
    (void)(vr);
    (void)(n);
    (void)(order);
    (void)(value);
    return told((unit *)c, "no derivatives of outputs");
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) {
    return told((unit *)c, "no step is under way");
}

#define NO_STATUS(name, type) \\
    EXPORT fmi2Status fmi2Get##name(fmi2Component c, const int kind, type *value) { \\
        (void)(c); \\
        (void)(kind); \\
        (void)(value); \\
        return fmi2Discard; \\
    }

NO_STATUS(Status, fmi2Status)
NO_STATUS(RealStatus, fmi2Real)
NO_STATUS(IntegerStatus, fmi2Integer)
NO_STATUS(BooleanStatus, fmi2Boolean)
NO_STATUS(StringStatus, fmi2String)
"""
