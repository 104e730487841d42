/* What passes through the wrapper is what would have passed without it; what fails in it says so. */
#include "controller_records.h"
#include "simulator.h"

#include <arpa/inet.h>
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fenv.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "unity.h"

static char controller[256]; /* a copy of the library for this process alone */

void setUp(void)
{
    (void)unsetenv("AEOLID_DISCON");
}

void tearDown(void)
{
    DIR *list = opendir(scratch()); /* private copies must not stay behind */
    const struct dirent *entry;
    TEST_ASSERT_NOT_NULL(list);
    while ((entry = readdir(list)) != NULL) {
        TEST_ASSERT_NULL_MESSAGE(strstr(entry->d_name, ".aeolid-"), entry->d_name);
    }
    (void)closedir(list);
}

static int call_both(simulator_t *plain, simulator_t *wrapped, float status)
{
    (void)simulator_call(plain, status);
    (void)simulator_call(wrapped, status);
    TEST_ASSERT_TRUE(same_answers(plain, wrapped));
    return plain->fail;
}

/* Fill what the simulator does not with odd patterns. */
static void spoil(simulator_t *self)
{
    for (unsigned i = 90; i < ODD; i++) {
        const uint32_t bits = UINT32_C(0x7F800000) + i * UINT32_C(0x01000193);
        memcpy(self->swap + i, &bits, sizeof bits);
    }
    memset(self->message, 'x', sizeof self->message);
    memset(self->out + 4, 'y', sizeof self->out - 4u);
}

/* ---- forwarding -------------------------------------------------------------------------------------------------- */

/* Run with and without the wrapper, both with the same library file, comparing everything after every call. */
static void run_both(const char *infile, const char *more)
{
    static const float extra[] = {1.0F, -8.0F, 2.0F, 1.0F, -5.0F};
    simulator_t plain, wrapped;
    int fail;
    TEST_ASSERT_TRUE(configure(controller, more));
    TEST_ASSERT_TRUE(simulator_open(&plain, controller, RECORDS, infile));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, infile));
    spoil(&plain);
    spoil(&wrapped);
    fail = call_both(&plain, &wrapped, 0.0F);
    for (unsigned k = 0; k < 2000u && fail >= 0; k++) {
        simulator_step(&plain);
        simulator_step(&wrapped);
        if (k % 7u == 3u) { /* repeated and repaired steps, other statuses */
            plain.time_s = wrapped.time_s -= k % 2u == 0u ? plain.step_s : 0.0;
        }
        fail = call_both(&plain, &wrapped, k % 97u == 0u ? extra[k / 97u % 5u] : 1.0F);
    }
    (void)call_both(&plain, &wrapped, -1.0F);
    TEST_ASSERT_TRUE(plain.swap[CALLS - 1] > 1.0F);
    simulator_close(&wrapped);
    simulator_close(&plain);
}

static void test_everything_passes_bit_for_bit(void)
{
    run_both("DISCON.IN", "bus = none\n");
    run_both("DISCON.IN", "bus = tcp:0\n");
    run_both("a file of another name nan",
             "bus = file:a.log\nmethod = lattice\nscheduling = record:151 name odd unit x\n"
             "records = 168\n");
    run_both("quiet nan status", "bus = file:a.log\n");
}

static void test_a_controller_that_fails_or_warns_does_so_as_without(void)
{
    run_both("warn 5", "bus = none\n");
    run_both("fail 1", "bus = none\n");
    run_both("fail 37", "bus = file:a.log\n");
}

static void test_excitation_switched_off_changes_nothing(void)
{
    run_both("nan", "bus = none\n[pitch excitation]\nsignal = off\n[torque excitation]\nsignal = off\n");
    run_both("nan",
             "bus = none\n[pitch excitation]\nsignal = prbs\namplitude = 0.01\nrate = 1\nstart = 1000\nstop = 1001\n"
             "minimum = 0\nmaximum = 1\n");
}

static void test_other_symbol(void)
{
    simulator_t wrapped;
    TEST_ASSERT_TRUE(configure(CONTROLLER_OTHER, "bus = none\nsymbol = Regler\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, 1.0, 1));
    TEST_ASSERT_EQUAL_INT(102, (int)wrapped.swap[CALLS - 1]);
    simulator_close(&wrapped);
}

/* An array of exactly 64 records, before a page that must not be touched. */
static void test_array_of_64_records_is_enough(void)
{
    simulator_t wrapped;
    TEST_ASSERT_TRUE(configure(CONTROLLER_BRIEF,
                               "bus = none\nrecords = 64\n[torque excitation]\nsignal = prbs\namplitude = 9\nrate = 9\n"
                               "start = 0\nstop = 9\nminimum = 0\nmaximum = 1e5\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, 64, ""));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, 2.0, 1));
    simulator_close(&wrapped);
}

static void test_arithmetic_and_errno_of_the_simulator_stay(void)
{
    simulator_t wrapped;
    fenv_t before;
    TEST_ASSERT_TRUE(
        configure(controller, "bus = file:a.log\nscheduling = record:99 name odd unit x\nrecords = 168\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, "trap"));
    (void)fegetenv(&before);
    for (unsigned k = 0; k < 300u; k++) {
        const uint32_t signalling = UINT32_C(0x7F800001);
        int fail, error, rounding, flags;
        memcpy(wrapped.swap + 98, &signalling, sizeof signalling);
        (void)fesetround(FE_UPWARD);
        (void)feclearexcept(FE_ALL_EXCEPT);
        simulator_step(&wrapped);
        (void)simulator_call(&wrapped, k == 0u ? 0.0F : 1.0F); /* the plant raises what it likes: call again, clean */
        memcpy(wrapped.swap + 52, &signalling, sizeof signalling);
        (void)feclearexcept(FE_ALL_EXCEPT);
        (void)feraiseexcept(FE_DIVBYZERO);
        (void)feenableexcept(FE_INVALID);
        errno = 77;
        wrapped.fail = 0;
        wrapped.call(wrapped.swap, &wrapped.fail, wrapped.in, wrapped.out, wrapped.message);
        fail = wrapped.fail;
        error = errno;
        rounding = fegetround();
        flags = fetestexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
        (void)fesetenv(&before);
        TEST_ASSERT_EQUAL_INT(77, error);
        TEST_ASSERT_EQUAL_INT(FE_UPWARD, rounding);
        TEST_ASSERT_EQUAL_INT(FE_DIVBYZERO, flags);
        TEST_ASSERT_EQUAL_INT(0, fail); /* the controller saw that very environment, too */
    }
    (void)simulator_call(&wrapped, -1.0F);
    simulator_close(&wrapped);
}

/* What is filtered and streamed does not depend on the simulator's rounding and flushing: the log has the same bytes.
 * */
static void test_the_stream_does_not_see_the_simulators_arithmetic(void)
{
    static char log[2][1 << 20];
    size_t length[2];
    for (int odd = 0; odd < 2; odd++) {
        simulator_t wrapped;
        char line[256];
        FILE *file;
        TEST_ASSERT_TRUE(
            configure(CONTROLLER_BRIEF, "bus = file:same.log\noverwrite = yes\nshare = 50\nsnapshot_every = 2\n"));
        TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
        (void)simulator_call(&wrapped, 0.0F);
        while (wrapped.time_s < 20.0) {
            simulator_step(&wrapped);
            wrapped.swap[1] = (float)wrapped.time_s;
            wrapped.swap[19] = (float)wrapped.speed;
            wrapped.swap[52] = (float)wrapped.tower[1];
            (void)fesetround(odd ? FE_UPWARD : FE_TONEAREST);
            wrapped.call(wrapped.swap, &wrapped.fail, wrapped.in, wrapped.out, wrapped.message);
            (void)fesetround(FE_TONEAREST);
            wrapped.swap[0] = 1.0F;
        }
        (void)simulator_call(&wrapped, -1.0F);
        simulator_close(&wrapped);
        file = fopen(in_scratch("same.log"), "rb");
        TEST_ASSERT_NOT_NULL(file);
        length[odd] = 0;
        while (fgets(line, sizeof line, file) != NULL) { /* from the interface on: stamps are dates */
            const char *frame = strstr(line, "can0");
            TEST_ASSERT_TRUE(frame != NULL && length[odd] + sizeof line < sizeof log[odd]);
            length[odd] += (size_t)snprintf(log[odd] + length[odd], sizeof line, "%s", frame);
        }
        (void)fclose(file);
    }
    TEST_ASSERT_TRUE(length[0] > 30000u && length[0] < sizeof log[0]);
    TEST_ASSERT_TRUE(length[0] == length[1] && memcmp(log[0], log[1], length[0]) == 0);
}

static void test_errno_of_the_first_call_stays(void)
{
    simulator_t wrapped;
    TEST_ASSERT_TRUE(configure(controller, "bus = can:nosuch0\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, "quiet"));
    errno = 77;
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, 0.0F));
    TEST_ASSERT_EQUAL_INT(77, errno);
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, -1.0F));
    simulator_close(&wrapped);
}

/* With excitation on, the controller, which goes on from its own last demand, sees bit for bit what it would see
 * without, as long as the measurements are the same: nothing that was added comes back to it. */
static void test_the_controller_never_sees_what_was_added(void)
{
    simulator_t plain, wrapped;
    unsigned excited = 0;
    TEST_ASSERT_TRUE(configure(controller, "bus = none\n[pitch excitation]\nsignal = prbs\namplitude = 0.01\nrate = 1\n"
                                           "start = 1\nstop = 8\nminimum = 0\nmaximum = 1\n[torque excitation]\n"
                                           "signal = multisine\nlow = 0.5\nhigh = 3\namplitude = 900\nrate = 1e5\n"
                                           "start = 1\nstop = 8\nminimum = 0\nmaximum = 1e6\n"));
    TEST_ASSERT_TRUE(simulator_open(&plain, controller, RECORDS, "nan"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, "nan"));
    plain.swap[44] = wrapped.swap[44] = 0.2F;
    for (unsigned k = 0; k < 1000u; k++) {
        plain.swap[0] = wrapped.swap[0] = k == 0u ? 0.0F : k == 999u ? -1.0F : 1.0F;
        plain.swap[1] = wrapped.swap[1] = 0.01F * (float)k;
        plain.swap[2] = wrapped.swap[2] = 0.01F;
        plain.swap[19] = wrapped.swap[19] = 122.0F + 0.01F * (float)(k % 50u);
        plain.swap[48] = wrapped.swap[48] = SIMULATOR_MESSAGE;
        plain.call(plain.swap, &plain.fail, plain.in, plain.out, plain.message);
        wrapped.call(wrapped.swap, &wrapped.fail, wrapped.in, wrapped.out, wrapped.message);
        TEST_ASSERT_EQUAL_MEMORY(plain.swap + TOLD - 1, wrapped.swap + TOLD - 1, 8u * sizeof *plain.swap);
        excited += memcmp(plain.swap + 44, wrapped.swap + 44, sizeof *plain.swap) != 0 &&
                   memcmp(plain.swap + 46, wrapped.swap + 46, sizeof *plain.swap) != 0;
    }
    TEST_ASSERT_TRUE(excited > 600u);
    simulator_close(&wrapped);
    simulator_close(&plain);
}

/* ---- what cannot be had ------------------------------------------------------------------------------------------ */

/* One call with the settings there are: -1, a message that names `word`, nothing written beyond `room`. */
static void assert_refused(const char *word, unsigned room)
{
    simulator_t wrapped;
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    memset(wrapped.message, '~', sizeof wrapped.message);
    for (int k = 0; k < 3; k++) {
        wrapped.swap[0] = k == 0 ? 0.0F : k == 1 ? 1.0F : -1.0F;
        wrapped.swap[2] = 0.01F;
        wrapped.swap[48] = (float)room;
        wrapped.fail = 0;
        wrapped.call(wrapped.swap, &wrapped.fail, wrapped.in, wrapped.out, wrapped.message);
        TEST_ASSERT_EQUAL_INT(-1, wrapped.fail);
    }
    for (unsigned i = room; i < sizeof wrapped.message; i++) {
        TEST_ASSERT_EQUAL_CHAR('~', wrapped.message[i]);
    }
    if (room > 0u) {
        TEST_ASSERT_NOT_NULL(memchr(wrapped.message, '\0', room));
        TEST_ASSERT_NOT_NULL_MESSAGE(room < 100u ? wrapped.message : strstr(wrapped.message, word), wrapped.message);
    }
    simulator_close(&wrapped);
}

static void assert_refused_in_every_room(const char *word)
{
    static const unsigned rooms[] = {SIMULATOR_MESSAGE, 1, 2, 40};
    for (unsigned i = 0; i < sizeof rooms / sizeof *rooms; i++) {
        assert_refused(word, rooms[i]);
    }
}

static void test_missing_and_wrong_libraries(void)
{
    TEST_ASSERT_TRUE(configure("/nowhere/libdiscon.so", "bus = none\n"));
    assert_refused_in_every_room("/nowhere/libdiscon.so");
    TEST_ASSERT_TRUE(write_text(in_scratch("text.so"), "this is no library"));
    TEST_ASSERT_TRUE(configure("text.so", "bus = none\n"));
    assert_refused_in_every_room("text.so");
    TEST_ASSERT_TRUE(configure("/tmp", "bus = none\n"));
    assert_refused_in_every_room("not a file");
    (void)mkfifo(in_scratch("pipe.so"), 0600);
    TEST_ASSERT_TRUE(configure("pipe.so", "bus = none\n"));
    assert_refused("not a file", 301);
    TEST_ASSERT_TRUE(configure(controller, "bus = none\nsymbol = Nothing\n"));
    assert_refused_in_every_room("no procedure Nothing");
    TEST_ASSERT_TRUE(configure(WRAPPER, "bus = none\n"));
    assert_refused_in_every_room("the wrapper itself");
    assert_refused("", 0); /* no room for a message: standard error has it */
}

static void test_settings_that_cannot_be_read(void)
{
    (void)setenv("AEOLID_DISCON", "/nowhere/x.cfg", 1);
    assert_refused_in_every_room("/nowhere/x.cfg");
    (void)setenv("AEOLID_DISCON", "/tmp", 1);
    assert_refused_in_every_room("AEOLID_DISCON");
    (void)mkfifo(in_scratch("pipe.cfg"), 0600);
    (void)setenv("AEOLID_DISCON", in_scratch("pipe.cfg"), 1);
    assert_refused_in_every_room("AEOLID_DISCON");
    TEST_ASSERT_TRUE(configure(controller, "bus = none\nsurprise = 1\n"));
    assert_refused_in_every_room("line 8: surprise");
}

/* A length that is none must not be believed. */
static void test_odd_message_lengths(void)
{
    static const float odd[] = {0.0F, -5.0F, 1e30F, -1e30F};
    simulator_t wrapped;
    (void)setenv("AEOLID_DISCON", "/nowhere/x.cfg", 1);
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    for (unsigned i = 0; i < 5u; i++) {
        const uint32_t not_a_number = UINT32_C(0x7FC00000);
        if (i < 4u) {
            wrapped.swap[48] = odd[i];
        } else {
            memcpy(wrapped.swap + 48, &not_a_number, sizeof not_a_number);
        }
        wrapped.call(wrapped.swap, &wrapped.fail, wrapped.in, wrapped.out, NULL);
        TEST_ASSERT_EQUAL_INT(-1, wrapped.fail);
        wrapped.call(wrapped.swap, &wrapped.fail, wrapped.in, wrapped.out, wrapped.message);
        TEST_ASSERT_EQUAL_CHAR('\0', wrapped.message[0]);
    }
    wrapped.call(NULL, &wrapped.fail, wrapped.in, wrapped.out, wrapped.message);
    wrapped.call(NULL, NULL, NULL, NULL, NULL);
    simulator_close(&wrapped);
}

/* What fails in the wrapper alone never stops the turbine. */
static void assert_goes_on(const char *more, const char *word)
{
    simulator_t wrapped;
    TEST_ASSERT_TRUE(configure(controller, more));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, "quiet"));
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, 0.0F));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(wrapped.message, word), wrapped.message);
    memset(wrapped.message, 0, sizeof wrapped.message);
    for (int k = 0; k < 50; k++) {
        simulator_step(&wrapped);
        TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, 1.0F));
        TEST_ASSERT_EQUAL_CHAR('\0', wrapped.message[0]);
    }
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, -1.0F));
    TEST_ASSERT_EQUAL_INT(52, (int)wrapped.swap[CALLS - 1]);
    simulator_close(&wrapped);
}

static void test_own_failures_do_not_stop_the_turbine(void)
{
    char taken[64];
    struct sockaddr_in address;
    socklen_t length = sizeof address;
    int server;
    assert_goes_on("bus = file:/nowhere/a.log\n", "/nowhere/a.log");
    assert_goes_on("bus = file:.\n", "bus");
    assert_goes_on("bus = can:nosuch0\n", "nosuch0");
    assert_goes_on("bus = none\nshare = 0.001\n", "share");
    assert_goes_on("bus = none\npast = 342\n", "filter: past = 342: ");
    assert_goes_on("bus = none\npast = 30\nmethod = lattice\nforget = 0.5\n", "filter: forget = 0.5: ");
    assert_goes_on("bus = none\n[pitch excitation]\nsignal = prbs\nform = tilt\namplitude = 0.01\nrate = 1\nstart = 0\n"
                   "stop = 1\nminimum = 0\nmaximum = 1\n",
                   "record 28");
    server = socket(AF_INET, SOCK_STREAM, 0); /* a port that somebody has already */
    memset(&address, 0, sizeof address);
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    TEST_ASSERT_EQUAL_INT(0, bind(server, (struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL_INT(0, listen(server, 1));
    TEST_ASSERT_EQUAL_INT(0, getsockname(server, (struct sockaddr *)&address, &length));
    (void)snprintf(taken, sizeof taken, "bus = tcp:%u\n", (unsigned)ntohs(address.sin_port));
    assert_goes_on(taken, "in use");
    (void)close(server);
}

static void test_a_disk_that_is_full_costs_frames_only(void)
{
    struct rlimit before, small = {20000, 0};
    simulator_t wrapped;
    TEST_ASSERT_EQUAL_INT(0, getrlimit(RLIMIT_FSIZE, &before));
    small.rlim_max = before.rlim_max;
    TEST_ASSERT_TRUE(configure(controller, "bus = file:full.log\nshare = 50\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_FSIZE, &small)); /* beyond it the system would end this process */
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, 30.0, 1));
    TEST_ASSERT_EQUAL_INT(0, setrlimit(RLIMIT_FSIZE, &before));
    simulator_close(&wrapped);
}

int main(void)
{
    UNITY_BEGIN();
    (void)snprintf(controller, sizeof controller, "%s", in_scratch("controller.so"));
    TEST_ASSERT_TRUE(copy_file(CONTROLLER, controller));
    RUN_TEST(test_everything_passes_bit_for_bit);
    RUN_TEST(test_a_controller_that_fails_or_warns_does_so_as_without);
    RUN_TEST(test_excitation_switched_off_changes_nothing);
    RUN_TEST(test_other_symbol);
    RUN_TEST(test_array_of_64_records_is_enough);
    RUN_TEST(test_arithmetic_and_errno_of_the_simulator_stay);
    RUN_TEST(test_the_stream_does_not_see_the_simulators_arithmetic);
    RUN_TEST(test_errno_of_the_first_call_stays);
    RUN_TEST(test_the_controller_never_sees_what_was_added);
    RUN_TEST(test_missing_and_wrong_libraries);
    RUN_TEST(test_settings_that_cannot_be_read);
    RUN_TEST(test_odd_message_lengths);
    RUN_TEST(test_own_failures_do_not_stop_the_turbine);
    RUN_TEST(test_a_disk_that_is_full_costs_frames_only);
    return UNITY_END();
}
/* SPDX-License-Identifier: MIT */
