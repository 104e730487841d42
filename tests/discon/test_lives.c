/* Beginnings and ends: unloading, second runs, moving arrays, several turbines in one process and in threads. */
#include "controller_records.h"
#include "simulator.h"

#include <dirent.h>
#include <dlfcn.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
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

/* ---- lives ------------------------------------------------------------------------------------------------------- */

static unsigned count_open_files(void)
{
    unsigned count = 0;
    DIR *list = opendir("/proc/self/fd");
    while (list != NULL && readdir(list) != NULL) {
        count++;
    }
    (void)closedir(list);
    return count;
}

static int is_loaded(const char *library)
{
    void *handle = dlopen(library, RTLD_LAZY | RTLD_NOLOAD);
    if (handle != NULL) {
        (void)dlclose(handle);
    }
    return handle != NULL;
}

static void test_the_last_call_unloads_and_a_second_run_starts_afresh(void)
{
    simulator_t wrapped;
    const unsigned files = count_open_files();
    TEST_ASSERT_TRUE(configure(controller, "bus = tcp:0\n"));
    for (int run = 0; run < 3; run++) {
        TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
        for (int again = 0; again < 2; again++) { /* in the library loaded once, too */
            TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, 0.0F));
            TEST_ASSERT_TRUE(is_loaded(controller));
            simulator_step(&wrapped);
            TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, 1.0F));
            TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, -1.0F));
            TEST_ASSERT_FALSE(is_loaded(controller));
            TEST_ASSERT_EQUAL_INT(3, (int)wrapped.swap[CALLS - 1]);
        }
        simulator_close(&wrapped);
        TEST_ASSERT_EQUAL_UINT(files, count_open_files());
    }
}

/* A simulator that unloads the wrapper in mid-run leaves nothing open. */
static void test_unloaded_without_a_last_call(void)
{
    const unsigned files = count_open_files();
    simulator_t wrapped;
    TEST_ASSERT_TRUE(configure(controller, "bus = pty\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, 1.0, 0));
    simulator_close(&wrapped);
    TEST_ASSERT_EQUAL_UINT(files, count_open_files());
    TEST_ASSERT_FALSE(is_loaded(controller));
}

/* A last call without a first goes to the controller, as it would without the wrapper. */
static void test_last_call_only(void)
{
    simulator_t wrapped;
    TEST_ASSERT_TRUE(configure(controller, "bus = none\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, -1.0F));
    TEST_ASSERT_EQUAL_INT(1, (int)wrapped.swap[CALLS - 1]);
    simulator_close(&wrapped);
}

/* A script that copies its array for every call. */
static void test_an_array_that_moves(void)
{
    simulator_t wrapped;
    float *arrays[2];
    TEST_ASSERT_TRUE(configure(controller, "bus = none\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    arrays[0] = wrapped.swap;
    arrays[1] = calloc(RECORDS, sizeof(float));
    for (int run = 0; run < 2; run++) {
        for (int k = 0; k < 20; k++) { /* the second run begins without an end of the first */
            memcpy(arrays[k % 2], arrays[1 - k % 2], RECORDS * sizeof(float));
            wrapped.swap = arrays[k % 2];
            TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, k == 0 ? 0.0F : 1.0F));
            TEST_ASSERT_EQUAL_INT(20 * run + k + 1, (int)wrapped.swap[CALLS - 1]);
            simulator_step(&wrapped);
        }
    }
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&wrapped, -1.0F));
    free(arrays[1]);
    simulator_close(&wrapped);
}

static long file_size(const char *path)
{
    struct stat facts;
    return stat(path, &facts) == 0 ? (long)facts.st_size : -1L;
}

/* ---- several turbines -------------------------------------------------------------------------------------------- */

static void test_two_turbines_in_one_process(void)
{
    simulator_t alone, first, second;
    TEST_ASSERT_TRUE(configure(controller, "bus = file:two.log\n"));
    TEST_ASSERT_TRUE(simulator_open(&alone, WRAPPER, RECORDS, "nan"));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&alone, 5.0, 0));
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&alone, -1.0F));
    TEST_ASSERT_TRUE(simulator_open(&first, WRAPPER, RECORDS, "nan"));
    TEST_ASSERT_TRUE(simulator_open(&second, WRAPPER, RECORDS, "nan"));
    (void)simulator_call(&first, 0.0F);
    for (int k = 0; k < 40; k++) { /* the second comes later and ends earlier */
        simulator_step(&first);
        (void)simulator_call(&first, 1.0F);
    }
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&second, 2.0, 1));
    while (first.time_s < 5.0) {
        simulator_step(&first);
        TEST_ASSERT_EQUAL_INT(0, simulator_call(&first, 1.0F));
    }
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&first, -1.0F));
    TEST_ASSERT_TRUE(same_answers(&alone, &first));
    TEST_ASSERT_EQUAL_INT(202, (int)second.swap[CALLS - 1]);
    TEST_ASSERT_EQUAL_INT(0, access(in_scratch("two-2.log"), R_OK));
    simulator_close(&alone);
    simulator_close(&first);
    simulator_close(&second);
}

/* A log is never replaced unasked: every run has a file of its own, and a number apart from the turbine's. */
static void test_each_run_has_a_log_of_its_own(void)
{
    static const char *const names[] = {"own.log", "own_2.log", "own_3.log"};
    simulator_t wrapped;
    TEST_ASSERT_TRUE(write_text(in_scratch("own.log"), "mine"));
    TEST_ASSERT_TRUE(configure(controller, "bus = file:own.log\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, 2.0, 0));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, 4.0, 1)); /* first calls without a last one between them too */
    simulator_close(&wrapped);
    TEST_ASSERT_EQUAL_INT(4, (int)file_size(in_scratch(names[0])));
    TEST_ASSERT_TRUE(file_size(in_scratch(names[1])) > 1000 && file_size(in_scratch(names[2])) > 1000);
    TEST_ASSERT_TRUE(configure(controller, "bus = file:own.log\noverwrite = yes\n"));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, WRAPPER, RECORDS, ""));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, 2.0, 1));
    simulator_close(&wrapped);
    TEST_ASSERT_TRUE(file_size(in_scratch(names[0])) > 1000);
    TEST_ASSERT_EQUAL_INT(-1, access(in_scratch("own_4.log"), F_OK));
}

static void test_with_two_turbines_a_moving_array_is_refused(void)
{
    simulator_t first, second;
    float *moved = calloc(RECORDS, sizeof *moved);
    float *kept;
    TEST_ASSERT_TRUE(configure(controller, "bus = none\n"));
    TEST_ASSERT_TRUE(simulator_open(&first, WRAPPER, RECORDS, ""));
    TEST_ASSERT_TRUE(simulator_open(&second, WRAPPER, RECORDS, ""));
    (void)simulator_call(&first, 0.0F);
    (void)simulator_call(&second, 0.0F);
    kept = first.swap;
    first.swap = moved;
    TEST_ASSERT_EQUAL_INT(-1, simulator_call(&first, 1.0F));
    TEST_ASSERT_NOT_NULL(strstr(first.message, "copy of the wrapper"));
    first.swap = kept;
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&first, 1.0F));
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&first, -1.0F));
    TEST_ASSERT_EQUAL_INT(0, simulator_call(&second, -1.0F));
    free(moved);
    simulator_close(&first);
    simulator_close(&second);
}

typedef struct {
    const char *library;
    simulator_t simulator;
    int fail;
} job_t;

static void *work(void *argument)
{
    job_t *job = argument;
    job->fail = 1;
    for (int run = 0; run < 3; run++) {
        if (!simulator_open(&job->simulator, job->library, RECORDS, "nan")) {
            return NULL;
        }
        job->fail = simulator_run(&job->simulator, 3.0, 1);
        if (run < 2) {
            simulator_close(&job->simulator);
        }
    }
    return NULL;
}

/* Four threads, two on one copy of the wrapper, two on copies of their own that find their own settings; all with one
 * controller file. Each sees what a turbine alone sees. */
static void test_turbines_in_threads(void)
{
    static job_t job[5];
    pthread_t thread[4];
    const char *second = in_scratch("wrapper_T2.so"), *third = in_scratch("wrapper_T3.so");
    TEST_ASSERT_TRUE(copy_file(WRAPPER, second) && copy_file(WRAPPER, third) && copy_file(WRAPPER, in_scratch("w.so")));
    TEST_ASSERT_TRUE(write_settings(in_scratch("wrapper_T2.cfg"), controller, "bus = none\n") &&
                     write_settings(in_scratch("wrapper_T3.cfg"), controller, "bus = none\n") &&
                     write_settings(in_scratch("w.cfg"), controller, "bus = none\n"));
    job[0].library = job[1].library = job[4].library = in_scratch("w.so");
    job[2].library = second;
    job[3].library = third;
    (void)work(&job[4]);
    for (unsigned i = 0; i < 4u; i++) {
        TEST_ASSERT_EQUAL_INT(0, pthread_create(&thread[i], NULL, work, &job[i]));
    }
    for (unsigned i = 0; i < 4u; i++) {
        TEST_ASSERT_EQUAL_INT(0, pthread_join(thread[i], NULL));
        TEST_ASSERT_EQUAL_INT(0, job[i].fail);
        TEST_ASSERT_TRUE(same_answers(&job[4].simulator, &job[i].simulator));
        simulator_close(&job[i].simulator);
    }
    simulator_close(&job[4].simulator);
}

/* The example, under the names its user gives: wrapper, settings and controller in one folder, nothing in the
 * environment. */
static void test_the_example_beside_the_wrapper(void)
{
    simulator_t wrapped;
    TEST_ASSERT_TRUE(copy_file(WRAPPER, in_scratch("libaeolid_discon.so")));
    TEST_ASSERT_TRUE(copy_file(EXAMPLE, in_scratch("libaeolid_discon.cfg")));
    TEST_ASSERT_TRUE(copy_file(controller, in_scratch("libdiscon.so")));
    TEST_ASSERT_TRUE(simulator_open(&wrapped, in_scratch("libaeolid_discon.so"), RECORDS, ""));
    TEST_ASSERT_EQUAL_INT(0, simulator_run(&wrapped, 2.0, 1));
    TEST_ASSERT_EQUAL_INT(202, (int)wrapped.swap[CALLS - 1]);
    simulator_close(&wrapped);
}

int main(void)
{
    UNITY_BEGIN();
    (void)snprintf(controller, sizeof controller, "%s", in_scratch("controller.so"));
    TEST_ASSERT_TRUE(copy_file(CONTROLLER, controller));
    RUN_TEST(test_the_last_call_unloads_and_a_second_run_starts_afresh);
    RUN_TEST(test_unloaded_without_a_last_call);
    RUN_TEST(test_last_call_only);
    RUN_TEST(test_an_array_that_moves);
    RUN_TEST(test_two_turbines_in_one_process);
    RUN_TEST(test_each_run_has_a_log_of_its_own);
    RUN_TEST(test_with_two_turbines_a_moving_array_is_refused);
    RUN_TEST(test_turbines_in_threads);
    RUN_TEST(test_the_example_beside_the_wrapper);
    return UNITY_END();
}
/* SPDX-License-Identifier: MIT */
