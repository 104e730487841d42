/* Stands in for Simulink's header: the calls of a level 2 S-function that aeolid_sfun.c makes, as its documentation names
 * them. Each that has a result or an order keeps it for simulink.c to judge. */
#ifndef SIMSTRUC_H
#define SIMSTRUC_H

#include <stddef.h>
#include <stdint.h>

#ifndef S_FUNCTION_NAME
#error "S_FUNCTION_NAME is defined before simstruc.h is included"
#endif
#if S_FUNCTION_LEVEL != 2
#error "S_FUNCTION_LEVEL is 2"
#endif

typedef int32_t int_T;
typedef uint32_t uint_T;
typedef double real_T;
typedef double time_T;

enum { STAND_IN_PORTS = 4, STAND_IN_WIDTH = 64 };

typedef struct {
    int_T parameters, given, continuous, discrete, inputs, outputs, times;
    int_T in_width[STAND_IN_PORTS], out_width[STAND_IN_PORTS], contiguous[STAND_IN_PORTS], feedthrough[STAND_IN_PORTS];
    real_T in[STAND_IN_PORTS][STAND_IN_WIDTH], out[STAND_IN_PORTS][STAND_IN_WIDTH];
    time_T period, offset, now;
    uint_T options;
    const char *error;
} SimStruct;

#define SS_OPTION_EXCEPTION_FREE_CODE 1u

#define ssSetNumSFcnParams(S, n)                   ((void)((S)->parameters = (n)))
#define ssGetNumSFcnParams(S)                      ((S)->parameters)
#define ssGetSFcnParamsCount(S)                    ((S)->given)
#define ssSetNumContStates(S, n)                   ((void)((S)->continuous = (n)))
#define ssSetNumDiscStates(S, n)                   ((void)((S)->discrete = (n)))
#define ssSetNumInputPorts(S, n)                   ((S)->inputs = (n), (int_T)(n) <= (int_T)STAND_IN_PORTS)
#define ssSetNumOutputPorts(S, n)                  ((S)->outputs = (n), (int_T)(n) <= (int_T)STAND_IN_PORTS)
#define ssSetInputPortWidth(S, port, n)            ((void)((S)->in_width[port] = (n)))
#define ssSetOutputPortWidth(S, port, n)           ((void)((S)->out_width[port] = (n)))
#define ssSetInputPortRequiredContiguous(S, p, on) ((void)((S)->contiguous[p] = (on)))
#define ssSetInputPortDirectFeedThrough(S, p, on)  ((void)((S)->feedthrough[p] = (on)))
#define ssSetNumSampleTimes(S, n)                  ((void)((S)->times = (n)))
#define ssSetOptions(S, bits)                      ((void)((S)->options = (bits)))
#define ssSetSampleTime(S, i, t)                   ((void)((S)->period = (t)))
#define ssSetOffsetTime(S, i, t)                   ((void)((S)->offset = (t)))
#define ssSetErrorStatus(S, text)                  ((void)((S)->error = (text)))
#define ssGetOutputPortRealSignal(S, port)         ((S)->out[port])
#define ssGetInputPortSignal(S, port)              ((const void *)(S)->in[port])
#define ssGetT(S)                                  ((S)->now)

#endif
