/* fake_bus.h: a streamer on a port that records, refuses and counts; what the tests of stream.h share. */
#ifndef FAKE_BUS_H
#define FAKE_BUS_H

#include "aeolid/status.h"
#include "aeolid/stream.h"

enum { INPUTS = 2, OUTPUTS = 3, CHANNELS = 5, N = 300, KEPT = 4096, PARAMETERS_MAX = 65536 };

typedef struct {
    aeo_can_frame_t frame[KEPT];
    unsigned kept;       /* frames taken */
    unsigned calls;      /* of send */
    unsigned refuse_at;  /* this call is refused; UINT_MAX: none */
    unsigned refuse_all; /* 1: every call is refused */
    int locked, lock_calls, lock_errors;
    uint32_t now_us;
} fake_bus_t;

extern fake_bus_t fake;
extern aeo_port_t port;
extern aeo_stream_t stream;
extern uint32_t words[PARAMETERS_MAX];
extern aeo_real_t theta[PARAMETERS_MAX], u[INPUTS], y[OUTPUTS];
extern const aeo_channel_t channels[CHANNELS];

/* For setUp and tearDown: an empty bus with a lock and no clock; no lock held and none taken twice. */
void set_up_bus(void);
void tear_down_bus(void);

/* A clock for port.time_us: fake.now_us. */
uint32_t read_clock(void *context);

aeo_stream_config_t make_config(void);
void start_stream(const aeo_stream_config_t *config);

/* The message in frame i of those taken; fails the test when it is none or of another node. */
aeo_message_t message_at(unsigned i);
int is_sample(unsigned i);
int is_health(unsigned i);

/* Bits that the frames taken are long at most, in nominal bits, for 29 bit identifiers. */
unsigned long bits_taken(void);

void step_until_idle(void);

/* Send the description, then forget it. */
void describe_first(void);

/* A short run with everything in it: samples, a snapshot, health, the end. */
void run_all(void);

/* Copy the frames other than samples and health (whose counters must differ), in order; returns their number. */
unsigned lasting_frames(aeo_can_frame_t *into);

#endif
