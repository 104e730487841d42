"""Hold the text of the simulation's C header; words between @ are put in by c_simulation."""

HELPERS = """\
static inline int @name@_is_nan(double value) {
    return value != value;
}

static inline double @name@_sign(double value) {
    return value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : value);
}

static inline double @name@_min(double first, double other) {
    return other < first ? other : first;
}

static inline double @name@_max(double first, double other) {
    return other > first ? other : first;
}
"""

RUNGE_KUTTA = """\
    for (int part = 0; part < @UPPER@_PARTS; part++) {
        double v[@UPPER@_ROOM(@R@)] = {0.0};
        @name@_mean(s, u, length / @UPPER@_PARTS, v);
        @name@_carry(s, v, length / @UPPER@_PARTS);
    }
"""

STRIDE = """\
/* The greatest distance between two rows of rates, each state's by its size; a state of no size does not move. */
static double @name@_apart(const double *a, const double *b, const double *size) {
    double most = 0.0;
    for (int i = 0; i < @N@; i++) {
        const double gap = size[i] > 0.0 ? fabs(a[i] - b[i]) / size[i] : 0.0;
        if (!(gap <= most)) {
            most = @name@_is_nan(gap) ? INFINITY : gap;
        }
    }
    return most;
}

/* The inputs at an instant: what is held, and the time. */
static void @name@_at(double *v, double time_s) {
@MOVES@}

/* The slope after a time of h, as if it had been `slope` up to there. */
static void @name@_ahead(const double *x, const double *v, const double *th, double h, const double *slope,
                         double *found) {
    double there[@UPPER@_ROOM(@N@ + @M@)];
    memcpy(there, x, sizeof there);
    for (int i = 0; i < @N@; i++) {
        there[i] = x[i] + h * slope[i];
    }
    @name@_flow(there, v, th, found);
}

/* h times the fastest rate J that two slopes at h show, of which b is the one that a leads to.
 *
 * Slopes of states that are h (b - a) apart differ by J h (b - a). Two more, each led to by the last, tell by how much
 * that grows in two turns, as powers of J do: one state's slope alone (dq/dt = v) is no rate.
 */
static double @name@_growth(const double *x, const double *v, const double *th, double h, const double *a,
                            const double *b, const double *size) {
    double third[@UPPER@_ROOM(@N@)], fourth[@UPPER@_ROOM(@N@)];
    @name@_ahead(x, v, th, h, b, third);
    @name@_ahead(x, v, th, h, third, fourth);
    return sqrt(@name@_apart(fourth, third, size) / @name@_apart(b, a, size));
}

/* One classical Runge-Kutta step of h from x to next, inputs held. Returns h times the fastest rate in it where that
 * seems to exceed `limit`, and at most FASTEST.
 *
 * It does where the second and third slope, halfway, differ much beside the first two, or those of both ends; a state's
 * slopes are compared by its size. What no digit of a state shows is rounding.
 */
static double @name@_stride(const double *x, double *v, const double *th, double time_s, double h, double limit,
                            double *next) {
    double k1[@UPPER@_ROOM(@N@)], k2[@UPPER@_ROOM(@N@)], k3[@UPPER@_ROOM(@N@)], k4[@UPPER@_ROOM(@N@)];
    double size[@UPPER@_ROOM(@N@)], rate = 0.0;
    int finite = 1, began = 1;
    @name@_at(v, time_s);
    @name@_flow(x, v, th, k1);
    @name@_at(v, time_s + 0.5 * h);
    @name@_ahead(x, v, th, 0.5 * h, k1, k2);
    @name@_ahead(x, v, th, 0.5 * h, k2, k3);
    @name@_at(v, time_s + h);
    @name@_ahead(x, v, th, h, k3, k4);
    for (int i = 0; i < @N@; i++) {
        next[i] = x[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        size[i] = fabs(x[i]) + h * (fabs(k1[i]) + fabs(k2[i]));
        finite = finite && fabs(next[i]) < 1e300;
        began = began && fabs(x[i]) < 1e300 && fabs(k1[i]) < 1e300;
    }
    if (!began || !finite) {
        return began ? @UPPER@_FASTEST : 0.0; /* shorter steps help where it is not lost from the beginning */
    }
    const double first = @name@_apart(k2, k1, size), second = @name@_apart(k3, k2, size);
    const double last = @name@_apart(k4, k3, size);
    if (h * last > 1e-12 && last > 2.0 * first) {
        rate = 2.0 * @name@_growth(x, v, th, h, k3, k4, size);
    }
    if (h * second > 1e-12 && second > 0.5 * limit * first) {
        @name@_at(v, time_s + 0.5 * h);
        rate = @name@_max(rate, 2.0 * @name@_growth(x, v, th, 0.5 * h, k2, k3, size));
    }
    return rate < @UPPER@_FASTEST ? rate : @UPPER@_FASTEST;
}

/* Carry the states on by h, in one step; where a rate exceeds 1/h, from there on in halves, quarters ... of it that are
 * at most about half of the rate's inverse, down to 1/4096. A jump is as fast in any step: after three it is passed.
 */
static void @name@_carry(@name@_simulation *s, double *v, double h) {
    const double start = s->time_s;
    double next[@UPPER@_ROOM(@N@)];
    int done = 0, span = @UPPER@_FINEST, least = 1, tries = 0; /* the first three in parts of h / FINEST */
    while (done < @UPPER@_FINEST) {
        const double part = h * ((double)span / @UPPER@_FINEST), from = h * ((double)done / @UPPER@_FINEST);
        const double limit = span < @UPPER@_FINEST ? 0.7 : 1.0;
        double rate = @name@_stride(s->x, v, s->parameter, start + from, part, limit, next);
        if (rate > limit && span > least && tries < 3) {
            for (tries++; rate > 0.5 && span > least; rate *= 0.5) {
                span /= 2;
            }
            continue;
        }
        memcpy(s->x, next, sizeof(double) * @N@);
        done += span;
        least = tries < 3 ? least : span;
        tries = 0;
    }
    s->time_s += h;
}
"""

FAST = """\
 *
 * States move by classical Runge-Kutta steps of @PIECE@ s. A step whose slopes show a rate above its inverse (a time
 * constant below its length) is done again in 2 to 4096 shorter ones, of at most half of that time constant, and takes
 * as many times as long (a jump in the equations, as sign(x) has, counts as fast for three halvings of that kind).
 * What is faster than 4096 of them is not integrated: it ends in -1, or errs.
"""

RESTING = """\
    for (int part = 0; part < @UPPER@_PARTS; part++) {
        double v[@UPPER@_ROOM(@R@)] = {0.0};
        @name@_mean(s, u, length / @UPPER@_PARTS, v);
        s->time_s += length / @UPPER@_PARTS;
    }
"""

DISCRETE = """\
    double v[@UPPER@_ROOM(@R@)] = {0.0}, next[@UPPER@_ROOM(@N@)];
    @name@_mean(s, u, length, v);
    @name@_flow(s->x, v, s->parameter, next);
    memcpy(s->x, next, sizeof(double) * @N@);
    s->time_s += length;
"""

DISCRETE_RAMPS = """\
    /* The inputs change within a sample: their mean, and the ramp about it with the same first moment. */
    static const double ramped[@N@][@R@] = @RAMPED@, weights[4] = {-1.125, -0.375, 0.375, 1.125};
    double v[@R@] = {0.0}, ramp[@R@] = {0.0}, piece[@R@], next[@N@];
    for (int part = 0; part < 4; part++) {
        @name@_mean(s, u, 0.25 * length, piece);
        for (int j = 0; j < @R@; j++) {
            v[j] += 0.25 * piece[j];
            ramp[j] += weights[part] * piece[j];
        }
    }
    @name@_flow(s->x, v, s->parameter, next);
    for (int i = 0; i < @N@; i++) {
        s->x[i] = next[i];
        for (int j = 0; j < @R@; j++) {
            s->x[i] += ramped[i][j] * ramp[j];
        }
    }
    s->time_s += length;
"""

TEMPLATE = """\
/* Simulation made by aeolid from @SOURCE@. C99; no heap; needs the mathematical library and memcpy.
 *
 *   @name@_reset(&s);                    parameters and states as in the model, time 0
 *   for each sample:
 *       @name@_outputs(&s, u, y);        what the outputs are with these inputs
 *       @name@_step(&s, u, @STEP@);      carry on, inputs held; a longer step is cut into such of @STEP@ s
 *
 * @name@_step returns 0; -1 where a state has left the finite numbers (1e300) or the length is none that the model can
 * take; -2, and nothing has moved, where a parameter that is a dead time is outside the range given below.
 * Parameters (s.parameter) and states (s.x) may be changed before a step.
@FAST@ *
@SIGNALS@
 */
#ifndef @GUARD@
#define @GUARD@

#include <math.h>
#include <string.h>

enum {
    @UPPER@_STATES = @N@,
    @UPPER@_MEMORIES = @M@,
    @UPPER@_INPUTS = @R@,
    @UPPER@_OUTPUTS = @L@,
    @UPPER@_PARAMETERS = @P@,
    @UPPER@_PARTS = @COUNT@,
    @UPPER@_FINEST = 4096,
    @UPPER@_FASTEST = 8
};
#define @UPPER@_STEP_S @STEP@
#define @UPPER@_ROOM(count) ((count) > 0 ? (count) : 1)

@HELPERS@
@FILTERS@
/* x: the states, behind them the memories; f: what the inputs' filters remember; begun: whether an input was seen. */
typedef struct {
    double x[@UPPER@_ROOM(@N@ + @M@)];
    double parameter[@UPPER@_ROOM(@P@)];
    double f[@UPPER@_ROOM(@F@)];
    double time_s;
    int begun;@ROOMS@
} @name@_simulation;

static const double @name@_start[@UPPER@_ROOM(@N@)] = @START@;
static const double @name@_parameters[@UPPER@_ROOM(@P@)] = @VALUES@;

@FUNCTIONS@

static inline void @name@_reset(@name@_simulation *s) {
    memset(s, 0, sizeof *s);
    memcpy(s->x, @name@_start, sizeof(double) * @N@);
    for (int i = @N@; i < @N@ + @M@; i++) {
        s->x[i] = NAN;
    }
    memcpy(s->parameter, @name@_parameters, sizeof(double) * @P@);
}

/* The inputs as they act now, before anything has moved. */
static void @name@_now(const @name@_simulation *s, const double *u, double *v) {
    const double *th = s->parameter;
    (void)(th);
    memcpy(v, u, sizeof(double) * @R@);
@TIME@@NOW@
}

/* The inputs as they act at the beginning: as if the first ones had always been there. */
static void @name@_first(const @name@_simulation *s, const double *u, double *v) {
    const double *th = s->parameter;
    (void)(th);
    memcpy(v, u, sizeof(double) * @R@);
@TIME@@FIRST@
}

/* Let the inputs' filters begin there. */
static void @name@_settle(@name@_simulation *s, const double *u) {
    const double *th = s->parameter;
    double v[@UPPER@_ROOM(@R@)] = {0.0};
    (void)(th);
    memcpy(v, u, sizeof(double) * @R@);
@TIME@@SETTLE@
    s->begun = 1;
}

/* The means of the inputs as they act over the next h seconds; their filters go on by so much. */
static void @name@_mean(@name@_simulation *s, const double *u, double h, double *v) {
    const double *th = s->parameter;
    (void)(th);
    (void)(h);
    memcpy(v, u, sizeof(double) * @R@);
@TIME@@MEAN@
}

/* Outputs in the model's units; the simulation stays where it is. */
static inline void @name@_outputs(const @name@_simulation *s, const double *u, double *y) {
    double v[@UPPER@_ROOM(@R@)] = {0.0}, x[@UPPER@_ROOM(@N@ + @M@)];
    if (s->begun) {
        @name@_now(s, u, v);
    } else {
        @name@_first(s, u, v);
    }
    memcpy(x, s->x, sizeof x);
    @name@_renew(x, v, s->parameter, @UPPER@_STEP_S);
    @name@_read(x, v, s->parameter, y);
}

@STRIDE@static void @name@_sample(@name@_simulation *s, const double *u, double length) {
    double now[@UPPER@_ROOM(@R@)] = {0.0};
    @name@_now(s, u, now);
    @name@_renew(s->x, now, s->parameter, length);
@ADVANCE@}

static inline int @name@_step(@name@_simulation *s, const double *u, double length_s) {
    const double samples = length_s / @UPPER@_STEP_S;
    if (!(samples >= 0.0 && samples < 1e9)) {
        return -1;
    }
@WHOLE@@LIMITS@    if (!s->begun) {
        @name@_settle(s, u);
    }
    const long count = (long)ceil(samples - 1e-6);
    for (long k = 0; k < count; k++) {
        @name@_sample(s, u, length_s / (double)count);
    }
    for (int i = 0; i < @N@; i++) {
        if (!(fabs(s->x[i]) < 1e300)) {
            return -1;
        }
    }
    return 0;
}

#endif
"""

WHOLE = """\
    if (fabs(samples - floor(samples + 0.5)) > 1e-6) {
        return -1; /* a discrete-time model has no states between its samples */
    }
"""
