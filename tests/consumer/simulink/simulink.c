/* Stands in for Simulink's simulink.c, which an S-function includes at its end: calls the methods in Simulink's order on
 * y_k = 0.5 u_{k-1} - 0.25 y_{k-1}; the parameters must foretell the next sample, and a second block must be refused. */
#include <stdio.h>
#include <string.h>

static int initialise(SimStruct *S)
{
    memset(S, 0, sizeof *S);
    mdlInitializeSizes(S);
    mdlInitializeSampleTimes(S);
    mdlStart(S);
    return S->error == NULL;
}

static int sizes_are_those_of_the_block(const SimStruct *S)
{
    return S->inputs == 2 && S->outputs == 3 && S->in_width[0] == BLOCK_INPUTS && S->in_width[1] == BLOCK_OUTPUTS &&
           S->out_width[0] == BLOCK_OUTPUTS && S->out_width[1] == BLOCK_PARAMETERS && S->out_width[2] == 1 &&
           S->contiguous[0] && S->contiguous[1] && !S->feedthrough[0] && !S->feedthrough[1] && S->times == 1 &&
           S->period > 0.0999 && S->period < 0.1001 && S->continuous == 0 && S->discrete == 0;
}

static double simulate(SimStruct *S)
{
    double u = 0, y = 0, window[BLOCK_PARAMETERS] = {0}, foretold = 0;
    for (unsigned k = 0; k < 2000; k++) {
        y = 0.5 * u - 0.25 * y;
        u = (double)(k * k * k % 31u) / 15.0 - 1.0;
        S->in[0][0] = u;
        S->in[1][0] = y;
        S->now = 0.1 * k;
        mdlOutputs(S, 0);
        mdlUpdate(S, 0);
        memmove(window, window + 2, sizeof window - 2 * sizeof *window); /* oldest block first, u before y */
        window[BLOCK_PARAMETERS - 2] = u;
        window[BLOCK_PARAMETERS - 1] = y;
    }
    mdlOutputs(S, 0);
    for (int j = 0; j < BLOCK_PARAMETERS; j++) {
        foretold += S->out[1][j] * window[j];
    }
    return foretold - (0.5 * u - 0.25 * y);
}

int main(void)
{
    static SimStruct first, second;
    if (!initialise(&first) || !sizes_are_those_of_the_block(&first)) {
        return 1;
    }
    if (initialise(&second) || second.error == NULL) {
        return 2;
    }
    mdlTerminate(&second);
    for (int run = 0; run < 2; run++) { /* a model that is started again begins anew */
        const double error = simulate(&first);
        if (error * error > 1e-6 || first.out[0][0] * first.out[0][0] > 1e-6 || first.out[2][0] < 0) {
            return 3;
        }
        mdlTerminate(&first);
        if (!initialise(&first)) {
            return 4;
        }
        mdlOutputs(&first, 0);
        if (first.out[1][0] * first.out[1][0] > 0) {
            return 5;
        }
    }
    printf("S-function: foretold within 0.001\n");
    return 0;
}
