/* bench.c: times one update of every filter, of the textbook RLS with Eigen in several forms and in plain C, over the
 * same samples.
 *
 * bench REPETITIONS [SIZES] prints a line a contestant and size: name, r, l, p, n, nanoseconds an update. The regressors
 * of a run are recorded first and replayed from a fresh start each time, so that the regressor's own work is outside and
 * a filter that feeds its residuals back meets what it fed. All contestants of a size take turns, one replay each, and
 * the median of each one's repetitions counts: a machine that others use slows all of them alike. Under callgrind the
 * replay is dumped as "name r l p n" instead. */
#define _POSIX_C_SOURCE 200112L
#include "family.h"
#include "rivals.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef BENCH_CALLGRIND
#include <valgrind/callgrind.h>
#endif

enum { WARM = 60, TIMED = 100, SAMPLES = WARM + TIMED, RIVALS = EIGEN_FORMS + 1, CONTESTANTS_MAX = 16 };

static const family_size_t SIZES[] = {{4, 4, 5, 4},  {4, 4, 15, 4}, {2, 3, 5, 0},  {2, 3, 10, 0},
                                      {2, 3, 20, 0}, {2, 3, 50, 0}, {2, 3, 100, 0}};
/* with the outputs' innovations in each block: the same n as the first two, the same p as the others */
static const family_size_t VARMAX_SIZES[] = {{3, 4, 4, 0},  {3, 4, 11, 3}, {2, 3, 5, 0},  {2, 3, 10, 0},
                                             {2, 3, 20, 0}, {2, 3, 50, 0}, {2, 3, 100, 0}};
enum { SIZE_COUNT = sizeof SIZES / sizeof SIZES[0] };

static const aeo_real_t LAMBDA = AEO_REAL(0.999), RHO = AEO_REAL(0.1);

static family_object_t object;
static aeo_real_t *memory, *z, *y, *window;
static size_t n, l;

static void fail(const char *what)
{
    fprintf(stderr, "%s\n", what);
    exit(1);
}

static aeo_real_t *allocate(size_t count)
{
    void *x = NULL; /* on a line of the cache, as Eigen puts its own */
    if (posix_memalign(&x, 64, count * sizeof(aeo_real_t)) != 0 || x == NULL) {
        fail("no memory");
        return NULL;
    }
    memset(x, 0, count * sizeof(aeo_real_t));
    return x;
}

static void start_filter(const family_filter_t *filter, family_size_t size)
{
    const family_settings_t settings = {LAMBDA, RHO, AEO_REAL(0.05)};
    if (filter->init(&object, size, settings, memory, filter->words(size)) != AEO_OK) {
        fail("a filter refuses its size");
    }
}

/* Run the filter over a plant and keep z and y of SAMPLES updates. */
static void record_samples(const family_filter_t *filter, family_size_t size)
{
    aeo_regressor_t regressor;
    family_plant_t plant;
    if (family_start_regressor(&regressor, filter, size, AEO_REAL(1e6), window, 4096) != AEO_OK) {
        fail("the regressor refuses a size");
    }
    start_filter(filter, size);
    family_plant_start(&plant, size, 7u);
    for (unsigned k = 0, kept = 0; kept < SAMPLES; k++) {
        family_plant_step(&plant);
        if (aeo_regressor_push(&regressor, plant.u, plant.y, UINT64_C(1000) * k) != AEO_OK) {
            continue;
        }
        memcpy(z + kept * n, aeo_regressor_z(&regressor), n * sizeof *z);
        memcpy(y + kept * l, aeo_regressor_y(&regressor), l * sizeof *y);
        if (filter->update(&object, z + kept * n, y + kept * l) != AEO_OK) {
            fail("a filter refuses a good sample");
        }
        if (filter->feedback != NULL && aeo_regressor_set_innovation(&regressor, filter->feedback(&object)) != AEO_OK) {
            fail("the regressor refuses a residual");
        }
        kept++;
    }
}

/* Contestants: the family, then Eigen in its forms, then plain C. */
static void start(unsigned contestant, family_size_t size)
{
    if (contestant < FAMILY_COUNT) {
        start_filter(&FAMILY[contestant], size);
    } else if (contestant < FAMILY_COUNT + EIGEN_FORMS) {
        eigen_start(n, l, LAMBDA, RHO);
    } else {
        memset(memory, 0, (n * n + n * l + n) * sizeof *memory);
        for (size_t i = 0; i < n; i++) {
            memory[i * n + i] = AEO_REAL(1) / RHO;
        }
    }
}

static void update(unsigned contestant, size_t k)
{
    if (contestant < FAMILY_COUNT) {
        (void)FAMILY[contestant].update(&object, z + k * n, y + k * l);
    } else if (contestant < FAMILY_COUNT + EIGEN_FORMS) {
        eigen_update(z + k * n, y + k * l, (int)(contestant - FAMILY_COUNT));
    } else {
        naive_update(memory, memory + n * n, memory + n * n + n * l, n, l, LAMBDA, z + k * n, y + k * l);
    }
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

/* Replay once; returns nanoseconds an update. */
static double replay(unsigned contestant, family_size_t size, const char *label)
{
    start(contestant, size);
    for (size_t k = 0; k < WARM; k++) {
        update(contestant, k);
    }
#ifdef BENCH_CALLGRIND
    CALLGRIND_ZERO_STATS;
#endif
    const double from = now();
    for (size_t k = WARM; k < SAMPLES; k++) {
        update(contestant, k);
    }
    const double took = now() - from;
#ifdef BENCH_CALLGRIND
    CALLGRIND_DUMP_STATS_AT(label);
#else
    (void)label;
#endif
    return took / TIMED;
}

/* The textbook in two languages must agree, or one of them is not the textbook. */
static void compare_rivals(const char *label)
{
    double most = 0.0;
    start(FAMILY_COUNT + EIGEN_FORMS, (family_size_t){0, 0, 0, 0});
    for (size_t k = 0; k < SAMPLES; k++) {
        update(FAMILY_COUNT + EIGEN_FORMS, k);
    }
    for (size_t i = 0; i < l; i++) {
        for (size_t j = 0; j < n; j++) {
            const double difference = (double)memory[n * n + i * n + j] - (double)eigen_theta()[j * l + i];
            most = difference > most ? difference : -difference > most ? -difference : most;
        }
    }
    if (!(most < 1e-2)) {
        fprintf(stderr, "%s: ", label);
        fail("the textbook RLS in C and with Eigen disagree");
    }
}

static const char *name_of(unsigned contestant)
{
    static const char *const RIVAL[RIVALS] = {"eigen",         "eigen_in_place", "eigen_lazy", "eigen_triangular",
                                              "eigen_columns", "naive"};
    return contestant < FAMILY_COUNT ? FAMILY[contestant].name : RIVAL[contestant - FAMILY_COUNT];
}

/* What differs from one contestant to the next: its size, its samples, its times. */
typedef struct {
    family_size_t size;
    aeo_real_t *z, *y;
    double *times;
    char label[80];
} lane_t;

static void enter_lane(const lane_t *lane, const family_filter_t *filter)
{
    z = lane->z;
    y = lane->y;
    n = family_regressors(filter, lane->size);
    l = lane->size.outputs;
}

static const family_filter_t *filter_of(unsigned contestant)
{
    return &FAMILY[contestant < FAMILY_COUNT ? contestant : 0];
}

static int compare_times(const void *a, const void *b)
{
    const double x = *(const double *)a, w = *(const double *)b;
    return (x > w) - (x < w);
}

static void run_size(size_t s, lane_t *lanes, unsigned contestants, unsigned repetitions)
{
    for (unsigned c = 0; c < contestants; c++) {
        const family_filter_t *filter = filter_of(c);
        lane_t *lane = &lanes[c];
        lane->size = (filter->feedback != NULL ? VARMAX_SIZES : SIZES)[s];
        enter_lane(lane, filter);
        snprintf(lane->label, sizeof lane->label, "%s %u %u %u %zu", name_of(c), (unsigned)lane->size.inputs,
                 (unsigned)l, (unsigned)lane->size.past, n);
        record_samples(filter, lane->size);
    }
    for (unsigned t = 0; t < repetitions; t++) {
        for (unsigned c = 0; c < contestants; c++) {
            enter_lane(&lanes[c], filter_of(c));
            lanes[c].times[t] = replay(c, lanes[c].size, lanes[c].label);
            if (t == 0 && c >= FAMILY_COUNT && c < FAMILY_COUNT + EIGEN_FORMS) {
                compare_rivals(lanes[c].label);
            }
        }
    }
    for (unsigned c = 0; c < contestants; c++) {
        qsort(lanes[c].times, repetitions, sizeof *lanes[c].times, compare_times);
        printf("%s %.1f\n", lanes[c].label, lanes[c].times[repetitions / 2]);
    }
}

int main(int count, char **arguments)
{
    const unsigned repetitions = count > 1 ? (unsigned)strtoul(arguments[1], NULL, 10) : 1u;
    const size_t sizes = count > 2 ? (size_t)strtoul(arguments[2], NULL, 10) : SIZE_COUNT;
    const size_t most = AEO_REGRESSOR_LENGTH_MAX;
    const unsigned contestants = FAMILY_COUNT + RIVALS;
    static lane_t lanes[CONTESTANTS_MAX];
    if (contestants > CONTESTANTS_MAX || repetitions == 0u) {
        fail("too many contestants, or no repetition");
    }
    memory = allocate(most * most + most * 16);
    window = allocate(4096);
    for (unsigned c = 0; c < contestants; c++) {
        lanes[c].z = allocate(SAMPLES * most);
        lanes[c].y = allocate(SAMPLES * FAMILY_CHANNELS_MAX);
        lanes[c].times = calloc(repetitions, sizeof *lanes[c].times);
        if (lanes[c].times == NULL) {
            fail("no memory");
        }
    }
    for (size_t s = 0; s < sizes && s < SIZE_COUNT; s++) {
        run_size(s, lanes, contestants, repetitions);
    }
    return 0;
}
