/* The streamer against a port that records, refuses and counts: nothing lost but what is counted, nothing beyond the
 * share. */
#include "aeolid/status.h"
#include "aeolid/stream.h"
#include "spread.h"
#include "unity.h"

#include <string.h>

enum { INPUTS = 2, OUTPUTS = 3, CHANNELS = 5, N = 300, KEPT = 4096 };

typedef struct {
    aeo_can_frame_t frame[KEPT];
    unsigned kept;       /* frames taken */
    unsigned calls;      /* of send */
    unsigned refuse_at;  /* this call is refused; UINT_MAX: none */
    unsigned refuse_all; /* 1: every call is refused */
    int locked, lock_calls, lock_errors;
    uint32_t now_us;
} fake_t;

static fake_t fake;
static aeo_port_t port;
static aeo_stream_t stream;
static uint32_t memory[65536];
static aeo_real_t theta[65536], u[INPUTS], y[OUTPUTS];

static const aeo_stream_channel_t channels[CHANNELS] = {
    {"pitch", "deg", AEO_REAL(0), AEO_REAL(1)},
    {"generator_torque", "Nm", AEO_REAL(0), AEO_REAL(1000)},
    {"a name of exactly 32 characters!", "rad/s", AEO_REAL(1.25), AEO_REAL(0.02)},
    {NULL, NULL, AEO_REAL(0), AEO_REAL(1)},
    {"y3", "", AEO_REAL(-1), AEO_REAL(2)}};

static int send(void *context, const aeo_can_frame_t *frame)
{
    fake_t *self = (fake_t *)context;
    const unsigned call = self->calls++;
    self->lock_errors += port.lock != NULL && self->locked != 1;
    if (self->refuse_all || call == self->refuse_at || self->kept == KEPT) {
        return 0;
    }
    self->frame[self->kept++] = *frame;
    return 1;
}

static uint32_t read_clock(void *context)
{
    return ((fake_t *)context)->now_us;
}

static void lock(void *context)
{
    fake_t *self = (fake_t *)context;
    self->lock_errors += self->locked != 0;
    self->locked++;
    self->lock_calls++;
}

static void unlock(void *context)
{
    fake_t *self = (fake_t *)context;
    self->lock_errors += self->locked != 1;
    self->locked--;
}

static aeo_stream_config_t make_config(void)
{
    aeo_stream_config_t config;
    memset(&config, 0, sizeof config);
    config.address.base = AEO_FRAME_BASE_EXTENDED;
    config.address.node = 5;
    config.address.extended = 1;
    config.inputs = INPUTS;
    config.outputs = OUTPUTS;
    config.past = 20;
    config.parameters = N;
    config.sample_time_s = AEO_REAL(0.1);
    config.lambda = AEO_REAL(1);
    config.rho = AEO_REAL(1);
    config.channels = channels;
    config.sample_every = 1;
    config.health_every = 10;
    config.describe_every = 600;
    config.repair_percent = 25;
    config.burst = 16;
    config.bits_per_s = 0;
    return config;
}

static void start(const aeo_stream_config_t *config)
{
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_init(&stream, config, &port, memory, config->parameters));
}

void setUp(void)
{
    unsigned i;
    memset(&fake, 0, sizeof fake);
    fake.refuse_at = 0xFFFFFFFFu;
    port.context = &fake;
    port.send = send;
    port.time_us = NULL;
    port.lock = lock;
    port.unlock = unlock;
    for (i = 0; i < 65536u; i++) {
        theta[i] = AEO_REAL(0.001) * (aeo_real_t)i - AEO_REAL(3.0);
    }
}

void tearDown(void)
{
    TEST_ASSERT_EQUAL_INT(0, fake.locked);
    TEST_ASSERT_EQUAL_INT(0, fake.lock_errors);
}

static aeo_message_t message_at(unsigned i)
{
    static const aeo_address_t address = {AEO_FRAME_BASE_EXTENDED, 0, 1};
    aeo_message_t message;
    uint8_t node;
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_frame_unpack(&address, &fake.frame[i], &message, &node));
    TEST_ASSERT_EQUAL_UINT8(5, node);
    return message;
}

static void step_until_idle(void)
{
    unsigned steps = 0;
    while (aeo_stream_pending(&stream)) {
        TEST_ASSERT_TRUE(aeo_stream_step(&stream) >= 0);
        TEST_ASSERT_TRUE(++steps < 100000u);
    }
}

static void describe_first(void)
{
    step_until_idle();
    fake.kept = 0;
    fake.calls = 0;
}

/* ---- snapshots --------------------------------------------------------------------------------------------------- */

/* Check that the frames kept are one whole snapshot of `expected`, other kinds aside. */
static void assert_snapshot(const uint32_t *expected, uint32_t count, uint32_t index)
{
    static uint8_t seen[65536];
    uint32_t crc = UINT32_C(0xFFFFFFFF), i, parameters = 0, begins = 0, ends = 0, repairs = 0;
    memset(seen, 0, sizeof seen);
    for (i = 0; i < count; i++) {
        crc = aeo_frame_crc32(crc, expected[i]);
    }
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        if (m.kind == AEO_KIND_BEGIN) {
            begins++;
            TEST_ASSERT_EQUAL_UINT32(index, m.value[0]);
            TEST_ASSERT_EQUAL_UINT32(count - 1u, m.index);
        } else if (m.kind == AEO_KIND_PARAMETER) {
            parameters++;
            TEST_ASSERT_EQUAL_UINT8(0, seen[m.index]);
            seen[m.index] = 1;
            TEST_ASSERT_EQUAL_HEX32(expected[m.index], m.value[0]);
        } else if (m.kind == AEO_KIND_END) {
            ends++;
            TEST_ASSERT_EQUAL_HEX32(~crc, m.value[0]);
            TEST_ASSERT_EQUAL_UINT16(index & 0xFFFFu, m.index);
        } else if (m.kind == AEO_KIND_REPAIR) {
            TEST_ASSERT_EQUAL_UINT16(repairs, m.index);
            repairs++;
        }
    }
    TEST_ASSERT_EQUAL_UINT32(1, begins);
    TEST_ASSERT_EQUAL_UINT32(count, parameters);
    TEST_ASSERT_EQUAL_UINT32(3, ends);
    TEST_ASSERT_EQUAL_UINT32(stream.spread.repairs, repairs);
}

static void theta_arrives_bit_for_bit(void)
{
    static const uint32_t odd[] = {0x80000000u, 0x7F800000u, 0xFF800000u, 0x7FC00000u, 0x7F7FFFFFu, 0x00800000u};
    const aeo_stream_config_t config = make_config();
    static uint32_t expected[N];
    unsigned i;
    start(&config);
    describe_first();
    for (i = 0; i < 6u; i++) { /* -0, infinities, NaN, largest, smallest normal */
        float value;
        memcpy(&value, &odd[i], sizeof value);
        theta[i] = (aeo_real_t)value;
    }
    for (i = 0; i < N; i++) {
        expected[i] = aeo_float_bits(theta[i]);
    }
    TEST_ASSERT_EQUAL_HEX32_ARRAY(odd, expected, 6);
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 70000, theta));
    memset(theta, 0, sizeof theta); /* the filter goes on: the copy must not move */
    TEST_ASSERT_EQUAL_INT(AEO_E_BUSY, aeo_stream_snapshot(&stream, 70001, theta));
    TEST_ASSERT_EQUAL_UINT32(1, stream.counters.busy);
    step_until_idle();
    assert_snapshot(expected, N, 70000);
    TEST_ASSERT_EQUAL_UINT32(1, stream.counters.snapshots);
}

/* Every size has each parameter once, and a burst of 16 lost frames takes parameters that are N / 40 apart. */
static void order_is_a_spread_permutation(void)
{
    static const uint32_t sizes[] = {1,   2,   3,   5,   7,   16,   40,   255,   256,
                                     257, 300, 456, 512, 513, 1021, 4096, 65535, 65536};
    static uint8_t seen[65536];
    unsigned s;
    for (s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        aeo_spread_t spread;
        uint32_t q, j;
        aeo_spread_choose(&spread, sizes[s], 25);
        memset(seen, 0, sizeof seen);
        for (q = 0; q < sizes[s]; q++) {
            const uint32_t at = aeo_spread_index(&spread, q);
            TEST_ASSERT_TRUE(at < sizes[s]);
            TEST_ASSERT_EQUAL_UINT8(0, seen[at]);
            seen[at] = 1;
            for (j = 1; sizes[s] >= 16u && j < 16u && q + j < sizes[s]; j++) {
                const uint32_t other = aeo_spread_index(&spread, q + j);
                TEST_ASSERT_TRUE((at > other ? at - other : other - at) * 40u >= sizes[s]);
            }
        }
        TEST_ASSERT_TRUE(spread.groups * 256u >= sizes[s]);
        TEST_ASSERT_EQUAL_UINT32(sizes[s] / 4u + 8u * spread.groups, spread.repairs);
        aeo_spread_choose(&spread, sizes[s], 100);
        TEST_ASSERT_TRUE(spread.repairs <= 65535u); /* what its number can hold */
        aeo_spread_choose(&spread, sizes[s], 0);
        TEST_ASSERT_EQUAL_UINT32(0, spread.repairs);
    }
}

/* Any one lost parameter is the exclusive or of a repair frame and the other members of its set, at every size. */
static void repair_restores_a_lost_parameter(void)
{
    static const uint32_t sizes[] = {1, 2, 33, 256, 257, 600, 65536};
    unsigned s;
    for (s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        aeo_spread_t spread;
        uint32_t i, lost;
        aeo_spread_choose(&spread, sizes[s], 25);
        for (i = 0; i < sizes[s]; i++) {
            memory[i] = i * UINT32_C(2654435761) + 12345u;
        }
        for (lost = 0; lost < sizes[s]; lost += 1u + sizes[s] / 50u) { /* position of the lost one */
            const uint32_t group = lost % spread.groups, member = lost / spread.groups,
                           at = aeo_spread_index(&spread, lost);
            const uint32_t truth = memory[at];
            uint32_t repair = group;
            uint32_t with;
            while (((aeo_frame_repair_set((uint16_t)repair, member / 32u) >> (member % 32u)) & 1u) == 0u) {
                repair += spread.groups;
                TEST_ASSERT_TRUE(repair < 65536u);
            }
            with = aeo_spread_repair(&spread, memory, (uint16_t)repair);
            memory[at] = 0;
            TEST_ASSERT_EQUAL_HEX32(truth, with ^ aeo_spread_repair(&spread, memory, (uint16_t)repair));
            memory[at] = truth;
        }
    }
}

/* ---- refusals ---------------------------------------------------------------------------------------------------- */

/* A short run with everything in it: samples, a snapshot, health, the end. */
static void run_all(void)
{
    const uint32_t counters[2] = {11, 22};
    unsigned k;
    for (k = 0; k < 60u; k++) {
        u[0] = (aeo_real_t)k;
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        if (k == 20u) {
            TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, k, theta));
        }
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_health(&stream, 3, counters, 2));
        (void)aeo_stream_step(&stream);
    }
    aeo_stream_finish(&stream);
    step_until_idle();
}

static int is_sample(unsigned i)
{
    return message_at(i).kind == AEO_KIND_SAMPLE;
}

static int is_health(unsigned i)
{
    return message_at(i).kind == AEO_KIND_HEALTH;
}

/* Frames other than samples and health (whose counters must differ), in order. */
static unsigned lasting_frames(aeo_can_frame_t *into)
{
    unsigned i, count = 0;
    for (i = 0; i < fake.kept; i++) {
        if (!is_sample(i) && !is_health(i)) {
            memset(&into[count], 0, sizeof *into); /* what lies beyond the length is not part of a frame */
            into[count].id = fake.frame[i].id;
            into[count].flags = fake.frame[i].flags;
            into[count].length = fake.frame[i].length;
            memcpy(into[count].data, fake.frame[i].data, fake.frame[i].length);
            count++;
        }
    }
    return count;
}

/* For every k: refuse the k-th call. A sample is lost and counted; everything else comes all the same, in order. */
static void refusal_at_every_call(void)
{
    static aeo_can_frame_t reference[KEPT], found[KEPT];
    aeo_stream_config_t config = make_config();
    unsigned total, sent, lasting, k;
    config.parameters = 40;
    start(&config);
    run_all();
    total = fake.calls;
    sent = fake.kept;
    lasting = lasting_frames(reference);
    TEST_ASSERT_EQUAL_UINT(total, sent);
    for (k = 0; k < total; k++) {
        setUp();
        fake.refuse_at = k;
        start(&config);
        run_all();
        TEST_ASSERT_EQUAL_UINT32(1, stream.counters.refused + stream.counters.dropped);
        TEST_ASSERT_EQUAL_UINT32(fake.kept, stream.counters.sent);
        TEST_ASSERT_EQUAL_UINT32(sent - stream.counters.dropped, stream.counters.sent);
        TEST_ASSERT_EQUAL_UINT(lasting, lasting_frames(found));
        TEST_ASSERT_EQUAL_MEMORY(reference, found, lasting * sizeof *found);
        TEST_ASSERT_EQUAL_INT(0, fake.lock_errors);
    }
}

static void a_dead_bus_blocks_nothing(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k;
    start(&config);
    fake.refuse_all = 1;
    for (k = 0; k < 1000u; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_E_REFUSED, aeo_stream_sample(&stream, k, u, y, NULL));
        TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
    }
    TEST_ASSERT_EQUAL_UINT32(5000, stream.counters.dropped);
    TEST_ASSERT_EQUAL_UINT32(1000, stream.counters.refused);
    fake.refuse_all = 0; /* the bus is back: the description comes first, whole */
    TEST_ASSERT_EQUAL_INT(16, aeo_stream_step(&stream));
    TEST_ASSERT_EQUAL_INT(AEO_KIND_DESCRIPTION, message_at(0).kind);
    TEST_ASSERT_EQUAL_UINT8(AEO_ITEM_WIRE, message_at(0).tag);
    TEST_ASSERT_EQUAL_UINT16(AEO_WIRE_VERSION, message_at(0).index);
}

/* ---- pacing ------------------------------------------------------------------------------------------------------ */

/* Over any stretch of time the bits sent stay within the share, one burst and one sample aside. */
static void share_is_kept(uint32_t bits_per_s, uint32_t period_us, int with_clock)
{
    aeo_stream_config_t config = make_config();
    double budget = 0, spent = 0;
    unsigned k;
    config.bits_per_s = bits_per_s;
    config.sample_time_s = (aeo_real_t)(1e-6 * (double)period_us);
    fake.now_us = UINT32_C(0xFFFFF000); /* the clock wraps within the first samples */
    port.time_us = with_clock ? read_clock : NULL;
    start(&config);
    for (k = 0; k < 3000u; k++) {
        fake.kept = 0;
        fake.now_us += period_us;
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        (void)aeo_stream_snapshot(&stream, k, theta);
        (void)aeo_stream_step(&stream);
        budget += (double)bits_per_s * 1e-6 * (double)period_us;
        spent += (double)(fake.kept * AEO_FRAME_BITS_EXTENDED);
        TEST_ASSERT_TRUE(spent <= budget + (double)((16u + CHANNELS) * AEO_FRAME_BITS_EXTENDED));
    }
    TEST_ASSERT_TRUE(spent >= 0.97 * budget); /* and what is granted is used */
    TEST_ASSERT_EQUAL_UINT32(0, stream.counters.dropped);
}

static void share_of_the_bus_is_kept(void)
{
    share_is_kept(AEO_STREAM_SHARE(500000, 50), 100000, 0);
    share_is_kept(AEO_STREAM_SHARE(500000, 50), 100000, 1);
    share_is_kept(AEO_STREAM_SHARE(250000, 200), 20000, 1);
    share_is_kept(AEO_STREAM_SHARE(1000000, 1000), 1000, 1);
    share_is_kept(9000, 100000, 0);
}

/* A quiet hour earns one burst and no more: the bus does not meet an hour's worth of frames at once. */
static void silence_is_not_saved_up(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k;
    config.bits_per_s = 25000; /* a frame each 6.4 ms */
    port.time_us = read_clock;
    start(&config);
    while (stream.described == 0u) {
        fake.now_us += 100000u;
        (void)aeo_stream_step(&stream);
    }
    stream.config.health_every = 65535;
    stream.config.describe_every = 65535;
    stream.health_in = stream.describe_in = 65535;
    for (k = 0; k < 36000u; k++) {
        fake.now_us += 100000u;
        TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream));
    }
    TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_snapshot(&stream, 1, theta));
    fake.kept = 0;
    for (k = 0; k < 64u; k++) {
        fake.now_us += 1000u;
        (void)aeo_stream_step(&stream);
    }
    TEST_ASSERT_EQUAL_UINT(16u + 9u, fake.kept); /* the burst at the first step, 63 ms of credit after it */
}

/* Samples that come ten times faster than declared are dropped and counted, not sent on credit for ever. */
static void samples_too_fast_are_dropped(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k;
    config.bits_per_s = 25000;
    port.time_us = read_clock;
    start(&config);
    for (k = 0; k < 100000u; k++) {
        fake.kept = 0;
        fake.now_us += 3000u;
        (void)aeo_stream_sample(&stream, k, u, y, NULL);
        (void)aeo_stream_step(&stream);
    }
    TEST_ASSERT_TRUE((double)stream.counters.sent * 160.0 <= 25000.0 * 300.0 + 160.0 * (16 + 2 * 64 + 5));
    TEST_ASSERT_EQUAL_UINT32(500000u, stream.counters.dropped + stream.counters.sent);
}

static void every_kth_sample(void)
{
    aeo_stream_config_t config = make_config();
    unsigned k, i;
    config.sample_every = 4;
    start(&config);
    describe_first();
    for (k = 0; k < 21u; k++) {
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_sample(&stream, k, u, y, NULL));
    }
    TEST_ASSERT_EQUAL_UINT(6u * CHANNELS, fake.kept);
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        TEST_ASSERT_EQUAL_UINT16(4u * (i / CHANNELS), m.index);
        TEST_ASSERT_EQUAL_UINT8(i % CHANNELS, m.tag);
    }
}

/* ---- description, health, life ----------------------------------------------------------------------------------- */

static void description_is_repeated_and_hashed(void)
{
    aeo_stream_config_t config = make_config();
    uint32_t crc = UINT32_C(0xFFFFFFFF), hash, first, i;
    config.describe_every = 50;
    start(&config);
    step_until_idle();
    first = fake.kept;
    TEST_ASSERT_EQUAL_UINT32(7u + 2u * CHANNELS + (2u + 4u + 8u + 0u + 1u) + (1u + 1u + 2u + 0u + 0u), first);
    hash = message_at(0).value[0];
    for (i = 1; i < first; i++) {
        const aeo_message_t m = message_at(i);
        crc = aeo_frame_crc32(crc, (uint32_t)m.tag | ((uint32_t)m.index << 16));
        crc = aeo_frame_crc32(crc, m.value[0]);
    }
    TEST_ASSERT_EQUAL_HEX32(hash, ~crc);
    fake.kept = 0;
    for (i = 0; i < 60u; i++) {
        (void)aeo_stream_step(&stream);
    }
    for (i = 0, crc = 0; i < fake.kept; i++) {
        crc += message_at(i).kind == AEO_KIND_DESCRIPTION;
    }
    TEST_ASSERT_EQUAL_UINT32(first, crc);
}

static void health_tells_index_and_counters(void)
{
    const aeo_stream_config_t config = make_config();
    const uint32_t counters[AEO_STREAM_COUNTERS] = {100, 101, 102, 103, 104, 105, 106, 107};
    unsigned i, k, indices = 0;
    uint32_t told[16] = {0};
    start(&config);
    describe_first();
    for (k = 0; k < 300u; k++) {
        (void)aeo_stream_sample(&stream, 100000u + k, u, y, NULL);
        TEST_ASSERT_EQUAL_INT(AEO_OK, aeo_stream_health(&stream, 0xFFFFFFFFu, counters, AEO_STREAM_COUNTERS));
        (void)aeo_stream_step(&stream);
    }
    for (i = 0; i < fake.kept; i++) {
        if (is_health(i)) {
            const aeo_message_t m = message_at(i);
            TEST_ASSERT_EQUAL_HEX16(0x7FFFu, m.index); /* bit 15 belongs to the end of the stream */
            TEST_ASSERT_TRUE(m.tag < 16u);
            told[m.tag] = m.value[0];
            indices += m.tag == 0u;
        }
    }
    TEST_ASSERT_EQUAL_UINT32_ARRAY(counters, told + AEO_HEALTH_FILTER, AEO_STREAM_COUNTERS);
    TEST_ASSERT_TRUE(told[0] >= 100280u && told[0] < 100300u);
    TEST_ASSERT_EQUAL_UINT(15, indices); /* every second of 30 */
}

static void farewell_says_stopped(void)
{
    const aeo_stream_config_t config = make_config();
    unsigned i, farewells = 0;
    start(&config);
    run_all();
    for (i = 0; i < fake.kept; i++) {
        const aeo_message_t m = message_at(i);
        if (m.kind == AEO_KIND_HEALTH && (m.index & AEO_HEALTH_STOPPED) != 0u) {
            farewells++;
            TEST_ASSERT_EQUAL_UINT8(0, m.tag);
            TEST_ASSERT_EQUAL_UINT32(59, m.value[0]);
        } else {
            TEST_ASSERT_EQUAL_UINT(0, farewells); /* nothing after it */
        }
    }
    TEST_ASSERT_EQUAL_UINT(4, farewells);
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_pending(&stream));
    aeo_stream_finish(&stream);
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_step(&stream)); /* said once */
}

static void reset_is_fresh(void)
{
    static aeo_can_frame_t reference[KEPT];
    const aeo_stream_config_t config = make_config();
    unsigned count;
    start(&config);
    run_all();
    count = lasting_frames(reference);
    start(&config);
    (void)aeo_stream_snapshot(&stream, 5, theta);
    (void)aeo_stream_step(&stream);
    stream.number = 0; /* the one thing reset keeps on purpose: two snapshots must not share a number */
    aeo_stream_reset(&stream);
    fake.kept = 0;
    fake.calls = 0;
    run_all();
    {
        static aeo_can_frame_t found[KEPT];
        TEST_ASSERT_EQUAL_UINT(count, lasting_frames(found));
        TEST_ASSERT_EQUAL_MEMORY(reference, found, count * sizeof *found);
    }
}

/* ---- refused configurations -------------------------------------------------------------------------------------- */

static void refuse(const aeo_stream_config_t *config, int expected)
{
    aeo_stream_t before;
    memset(&stream, 0x5A, sizeof stream);
    before = stream;
    TEST_ASSERT_EQUAL_INT(expected, aeo_stream_init(&stream, config, &port, memory, 65536));
    TEST_ASSERT_EQUAL_MEMORY(&before, &stream, sizeof stream);
}

#define REFUSE_WITH(field, value)                                                                                      \
    do {                                                                                                               \
        aeo_stream_config_t bad = make_config();                                                                       \
        bad.field = (value);                                                                                           \
        refuse(&bad, AEO_E_ARG);                                                                                       \
    } while (0)

static aeo_real_t make_nan(void)
{
    const uint32_t bits = 0x7FC00000u;
    float value;
    memcpy(&value, &bits, sizeof value);
    return (aeo_real_t)value;
}

static void settings_out_of_range(void)
{
    REFUSE_WITH(outputs, 0);
    REFUSE_WITH(outputs, 63);
    REFUSE_WITH(channels, NULL);
    REFUSE_WITH(parameters, 0);
    REFUSE_WITH(parameters, 65537);
    REFUSE_WITH(sample_time_s, AEO_REAL(0));
    REFUSE_WITH(sample_time_s, AEO_REAL(1001));
    REFUSE_WITH(sample_time_s, make_nan());
    REFUSE_WITH(lambda, make_nan());
    REFUSE_WITH(rho, make_nan());
    REFUSE_WITH(health_every, 0);
    REFUSE_WITH(describe_every, 0);
    REFUSE_WITH(repair_percent, 101);
    REFUSE_WITH(burst, 0);
    REFUSE_WITH(bits_per_s, 159);
    REFUSE_WITH(address.node, 254);
    REFUSE_WITH(address.base, 1);
}

static void bad_channels_pointers_and_memory(void)
{
    aeo_stream_config_t config = make_config();
    aeo_stream_channel_t bad[CHANNELS];
    memcpy(bad, channels, sizeof bad);
    config.channels = bad;
    bad[2].scale = AEO_REAL(0);
    refuse(&config, AEO_E_ARG);
    bad[2].scale = make_nan();
    refuse(&config, AEO_E_ARG);
    bad[2].scale = AEO_REAL(1);
    bad[2].offset = make_nan();
    refuse(&config, AEO_E_ARG);
    config = make_config();
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(NULL, &config, &port, memory, N));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, NULL, &port, memory, N));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &config, NULL, memory, N));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_init(&stream, &config, &port, NULL, N));
    TEST_ASSERT_EQUAL_INT(AEO_E_MEMORY, aeo_stream_init(&stream, &config, &port, memory, N - 1u));
    config.bits_per_s = 8000; /* five frames of 160 bits in 0.1 s are the whole of it */
    refuse(&config, AEO_E_BUDGET);
    config.sample_every = 2;
    start(&config);
    port.unlock = NULL;
    config = make_config();
    refuse(&config, AEO_E_ARG);
    port.lock = NULL;
    start(&config);
    port.send = NULL;
    refuse(&config, AEO_E_ARG);
}

static void null_arguments_later(void)
{
    const aeo_stream_config_t config = make_config();
    start(&config);
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_sample(NULL, 0, u, y, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_sample(&stream, 0, NULL, y, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_sample(&stream, 0, u, NULL, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_innovation(NULL, 0, y));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_innovation(&stream, 0, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_snapshot(NULL, 0, theta));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_snapshot(&stream, 0, NULL));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_health(NULL, 0, NULL, 0));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_health(&stream, 0, NULL, 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_health(&stream, 0, memory, AEO_STREAM_COUNTERS + 1));
    TEST_ASSERT_EQUAL_INT(AEO_E_ARG, aeo_stream_step(NULL));
    TEST_ASSERT_EQUAL_INT(0, aeo_stream_pending(NULL));
    aeo_stream_finish(NULL);
    aeo_stream_reset(NULL);
    TEST_ASSERT_EQUAL_UINT(0, fake.calls);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(theta_arrives_bit_for_bit);
    RUN_TEST(order_is_a_spread_permutation);
    RUN_TEST(repair_restores_a_lost_parameter);
    RUN_TEST(refusal_at_every_call);
    RUN_TEST(a_dead_bus_blocks_nothing);
    RUN_TEST(share_of_the_bus_is_kept);
    RUN_TEST(silence_is_not_saved_up);
    RUN_TEST(samples_too_fast_are_dropped);
    RUN_TEST(every_kth_sample);
    RUN_TEST(description_is_repeated_and_hashed);
    RUN_TEST(health_tells_index_and_counters);
    RUN_TEST(farewell_says_stopped);
    RUN_TEST(reset_is_fresh);
    RUN_TEST(settings_out_of_range);
    RUN_TEST(bad_channels_pointers_and_memory);
    RUN_TEST(null_arguments_later);
    return UNITY_END();
}
