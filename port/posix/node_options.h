/* node_options.h: reads what the software node is told on its command line.
 *
 *   aeolid-node [--input NAME UNIT OFFSET SCALE ...] --output NAME UNIT OFFSET SCALE ... --sample-time S --past P
 *   [options]
 *
 *   --input, --output   one a channel, in the order of the samples; OFFSET and SCALE as in regressor.h. Without --input
 *                       the filter is an autoregression of the outputs. A sample with a channel outside OFFSET - 100
 *                       SCALE ... OFFSET + 100 SCALE is not filtered, and counted as "range" in the health line; OFFSET
 *                       0 with SCALE 1 has no such range
 *   --sample-time S     seconds between two samples
 *   --past P            past window
 *   --method NAME       rls, els, fast-rls or lattice, default rls
 *   --varmax            feed the residual back: blocks [u; y; e]; els does so anyway
 *   --forget L          forgetting factor, default 1; 0.999 for fast-rls, whose long runs need less than 1
 *   --varx-samples N    els: samples of its VARX start, default 10 n
 *   --regularize RHO    regularisation, default 0.1
 *   --feedthrough MASK  bit j: input j has a current-sample parameter, default 0
 *   --bus pty | tcp:PORT | can:INTERFACE   default tcp:0, any free port; an interface of Linux: socketcan.h
 *   --bit-rate B        of the bus the share is taken from, default 500000
 *   --share PERCENT     of the bit rate, default 5; 0: no limit
 *   --speed X | max     multiple of real time, default 1; max: as fast as the listeners read, losing nothing; on
 *                       can: as fast as the bit rate carries it
 *   --wait              start when a listener has opened its channel; not on can:, where nobody is seen
 *   --node-id N         default 1
 *   --base B            of the identifiers (frame.h), default 0x1CFF4000; below 0x800 they have 11 bits, nodes 0 ... 3
 *   --force-base        take a base that CANopen or J1939 use: none of their devices is on the bus
 *   --snapshot-every S  seconds between two snapshots, default 10
 *   --sample-every K    send every K-th sample, default 1; 0: none
 *   --innovations       send innovations too
 *   --repair PERCENT    repair frames per 100 parameters, default 25
 *   --seal, --no-seal   send a seal after each classic sample (stream.h), default --seal
 *   --fd                send CAN FD frames
 *   --fd-ratio N        data bit rate over nominal bit rate, default 1
 *   --dump FILE         write the last theta (l x n, binary32, little endian) after the last snapshot
 *
 *   P, N, MASK, B, K and the PERCENT of --repair are whole numbers.
 */
#ifndef AEOLID_POSIX_NODE_OPTIONS_H
#define AEOLID_POSIX_NODE_OPTIONS_H

#include <aeolid/regressor.h>
#include <aeolid/stream.h>

typedef struct {
    uint8_t inputs, outputs;
    aeo_channel_t channel[AEO_STREAM_CHANNELS_MAX]; /* inputs first */
    double sample_time_s;
    uint16_t past;
    int method; /* aeo_method_t */
    int varmax; /* 1: VARMAX regressors */
    float lambda, lambda_start, rho;
    uint32_t varx_samples;
    uint32_t feedthrough;
    const char *can;   /* CAN interface; null: none */
    int terminal;      /* 1: pty, 0: TCP */
    uint16_t tcp_port; /* 0: any */
    uint32_t bit_rate;
    uint32_t bits_per_s;
    double speed; /* 0: as fast as the listeners read */
    int wait;
    uint8_t node;
    uint32_t base;      /* below 2^11: identifiers of 11 bits */
    uint8_t force_base; /* 1: also one that others use */
    double snapshot_s;
    uint16_t sample_every;
    uint8_t innovations;
    uint8_t repair_percent;
    uint8_t seal, fd, fd_ratio;
    const char *dump; /* null: none */
} node_options_t;

/* Read the command line; returns 0 when done, else a sentence for the user is on standard error. */
int node_options_read(node_options_t *self, int argc, char **argv);

#endif
/* SPDX-License-Identifier: MIT */
