/* aeolid_block.h: an estimator as two plain functions of doubles, for a C Caller block, an S-function or a PLC's C interface.
 *
 * In Simulink: Model Settings, Simulation Target, Code Information: include headers "aeolid_block.h"; include directories and source files:
 * this folder, aeolid.h and aeolid.c of tools/amalgamate.py. Initialise function: aeolid_block_start(); then a C Caller block
 * calls aeolid_block_step at the sample time BLOCK_PERIOD_US. One instance a model: the state is static.
 * aeolid_sfun.c beside it is the same as an S-function, for models that have no C Caller.
 */
#ifndef AEOLID_BLOCK_H
#define AEOLID_BLOCK_H

#ifdef __cplusplus
extern "C" {
#endif

enum { BLOCK_INPUTS = 1, BLOCK_OUTPUTS = 1, BLOCK_PAST = 4, BLOCK_PARAMETERS = 8, BLOCK_PERIOD_US = 100000 };

/* Start afresh; 0, or the negative code of status.h. */
int aeolid_block_start(void);

/* Take one sample, sent at time_s: u (inputs), y (outputs). Written: innovation (outputs, in the channel's unit; 0 where there
 * is none) and markov (parameters, in the channels' units, oldest block first). Returns the code of aeo_estimator_take. */
int aeolid_block_step(const double u[BLOCK_INPUTS], const double y[BLOCK_OUTPUTS], double time_s,
                      double innovation[BLOCK_OUTPUTS], double markov[BLOCK_PARAMETERS]);

#ifdef __cplusplus
}
#endif
#endif
/* SPDX-License-Identifier: MIT */
