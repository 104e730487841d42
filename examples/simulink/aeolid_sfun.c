/* aeolid_sfun.c: the estimator of aeolid_block.h as a level 2 C MEX S-function.
 *
 * In MATLAB, in this folder, with the two files of tools/amalgamate.py beside it:
 *   mex -DAEOLID_TWO_FILES aeolid_sfun.c aeolid_block.c aeolid.c
 * and in the model an S-Function block with the name aeolid_sfun and no parameters. Ports: in 1 u, in 2 y; out 1 the
 * innovation, out 2 the parameters, out 3 the code of the sample (0 taken, 1 the past window fills, negative: refused).
 * It runs at the sample time BLOCK_PERIOD_US. One block a model: the state of aeolid_block.c is static, and a second block
 * ends the simulation with a sentence. Samples are taken in mdlUpdate, once a major step; outputs are those of the sample
 * before, so that there is no direct feedthrough and no algebraic loop.
 */
#define S_FUNCTION_NAME  aeolid_sfun
#define S_FUNCTION_LEVEL 2

#include "simstruc.h"

#include "aeolid_block.h"

enum { IN_U, IN_Y, INPUT_PORTS };
enum { OUT_INNOVATION, OUT_MARKOV, OUT_CODE, OUTPUT_PORTS };

static double innovation[BLOCK_OUTPUTS], markov[BLOCK_PARAMETERS], code;
static int blocks;

static void mdlInitializeSizes(SimStruct *S)
{
    static const int_T in[INPUT_PORTS] = {BLOCK_INPUTS, BLOCK_OUTPUTS};
    static const int_T out[OUTPUT_PORTS] = {BLOCK_OUTPUTS, BLOCK_PARAMETERS, 1};
    ssSetNumSFcnParams(S, 0);
    if (ssGetNumSFcnParams(S) != ssGetSFcnParamsCount(S)) {
        return; /* Simulink tells the user */
    }
    ssSetNumContStates(S, 0);
    ssSetNumDiscStates(S, 0);
    if (!ssSetNumInputPorts(S, INPUT_PORTS) || !ssSetNumOutputPorts(S, OUTPUT_PORTS)) {
        return;
    }
    for (int_T i = 0; i < INPUT_PORTS; i++) {
        ssSetInputPortWidth(S, i, in[i]);
        ssSetInputPortRequiredContiguous(S, i, 1);
        ssSetInputPortDirectFeedThrough(S, i, 0);
    }
    for (int_T i = 0; i < OUTPUT_PORTS; i++) {
        ssSetOutputPortWidth(S, i, out[i]);
    }
    ssSetNumSampleTimes(S, 1);
    ssSetOptions(S, SS_OPTION_EXCEPTION_FREE_CODE);
}

static void mdlInitializeSampleTimes(SimStruct *S)
{
    ssSetSampleTime(S, 0, BLOCK_PERIOD_US * 1e-6);
    ssSetOffsetTime(S, 0, 0.0);
}

#define MDL_START
static void mdlStart(SimStruct *S)
{
    if (blocks++ > 0) {
        ssSetErrorStatus(S, "aeolid_sfun: one block a model, for aeolid_block.c holds one estimator");
        return;
    }
    for (int i = 0; i < BLOCK_OUTPUTS; i++) {
        innovation[i] = 0.0;
    }
    for (int i = 0; i < BLOCK_PARAMETERS; i++) {
        markov[i] = 0.0;
    }
    code = 1.0;
    if (aeolid_block_start() != 0) {
        ssSetErrorStatus(S, "aeolid_sfun: a setting of aeolid_block.c is out of its range");
    }
}

static void mdlOutputs(SimStruct *S, int_T tid)
{
    real_T *e = ssGetOutputPortRealSignal(S, OUT_INNOVATION), *theta = ssGetOutputPortRealSignal(S, OUT_MARKOV);
    (void)tid;
    for (int i = 0; i < BLOCK_OUTPUTS; i++) {
        e[i] = innovation[i];
    }
    for (int i = 0; i < BLOCK_PARAMETERS; i++) {
        theta[i] = markov[i];
    }
    ssGetOutputPortRealSignal(S, OUT_CODE)[0] = code;
}

#define MDL_UPDATE
static void mdlUpdate(SimStruct *S, int_T tid)
{
    const real_T *u = (const real_T *)ssGetInputPortSignal(S, IN_U);
    const real_T *y = (const real_T *)ssGetInputPortSignal(S, IN_Y);
    (void)tid;
    code = aeolid_block_step(u, y, ssGetT(S), innovation, markov);
}

static void mdlTerminate(SimStruct *S)
{
    (void)S;
    blocks = blocks > 0 ? blocks - 1 : 0;
}

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
/* SPDX-License-Identifier: MIT */
