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
        const double h = length / @UPPER@_PARTS;
        double v[@UPPER@_ROOM(@R@)] = {0.0}, k1[@UPPER@_ROOM(@N@)], k2[@UPPER@_ROOM(@N@)], k3[@UPPER@_ROOM(@N@)];
        double k4[@UPPER@_ROOM(@N@)], middle[@UPPER@_ROOM(@N@ + @M@)];
        @name@_mean(s, u, h, v);
        memcpy(middle, s->x, sizeof s->x);
        @name@_flow(s->x, v, s->parameter, k1);
        for (int i = 0; i < @N@; i++) {
            middle[i] = s->x[i] + 0.5 * h * k1[i];
        }
        @name@_flow(middle, v, s->parameter, k2);
        for (int i = 0; i < @N@; i++) {
            middle[i] = s->x[i] + 0.5 * h * k2[i];
        }
        @name@_flow(middle, v, s->parameter, k3);
        for (int i = 0; i < @N@; i++) {
            middle[i] = s->x[i] + h * k3[i];
        }
        @name@_flow(middle, v, s->parameter, k4);
        for (int i = 0; i < @N@; i++) {
            s->x[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
        s->time_s += h;
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
 * @name@_step returns 0, or -1 where a state has left the finite numbers or the length is none that the model can take.
 * Parameters (s.parameter) and states (s.x) may be changed before a step.
 *
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
    @UPPER@_PARTS = @COUNT@
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

static void @name@_reset(@name@_simulation *s) {
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

static void @name@_sample(@name@_simulation *s, const double *u, double length) {
    double now[@UPPER@_ROOM(@R@)] = {0.0};
    @name@_now(s, u, now);
    @name@_renew(s->x, now, s->parameter, length);
@ADVANCE@}

static inline int @name@_step(@name@_simulation *s, const double *u, double length_s) {
    const double samples = length_s / @UPPER@_STEP_S;
    if (!(samples >= 0.0 && samples < 1e9)) {
        return -1;
    }
@WHOLE@    if (!s->begun) {
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
