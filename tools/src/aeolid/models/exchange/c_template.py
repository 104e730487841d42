"""Hold the text of the observer's C header; words between @ are put in by c_observer."""

TEMPLATE = """\
/* Kalman observer made by aeolid from @SOURCE@. C99; no heap, no libraries but memcpy.
 *
 *   e_k = y_k - y_offset - C x_k - D (u_k - u_offset)       what the prediction missed
 *   x_k+1 = A x_k + B (u_k - u_offset) + K e_k              the state, one sample ahead
 *
 * Call @name@_step once a sample, every @SAMPLE_TIME@ s, with that sample's inputs and measurements. What is left of a
 * wrong first state is multiplied by @SLOWEST@ a sample in the end (largest eigenvalue of A - K C).
 *
@SIGNALS@
 *
 * @name@_prediction needs the inputs of the sample, not its measurements: called before them it is the one-step
 * prediction. A measurement that is not a finite number is left out: that channel corrects nothing in this sample. An
 * input that is not finite counts as its operating point. The state then stays finite and recovers.
 */
#ifndef @GUARD@
#define @GUARD@

#include <stdint.h>
#include <string.h>

enum { @UPPER@_STATES = @N@, @UPPER@_INPUTS = @R@, @UPPER@_OUTPUTS = @L@ };

typedef @REAL@ @name@_real;

/* x is the state; next and missed are room to work in, kept off the stack. */
typedef struct {
    @name@_real x[@N@];
    @name@_real next[@N@];
    @name@_real missed[@L@];
} @name@_observer;

@COEFFICIENTS@

/* Tell a finite number by its bits: comparisons with NaN are removed under -ffast-math. */
static inline int @name@_is_finite(@name@_real value) {
    @BITS@ bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & @EXPONENT@) != @EXPONENT@;
}

static inline void @name@_reset(@name@_observer *o) {
    memcpy(o->x, @name@_x_start, sizeof o->x);
}

/* An input as the deviation from its operating point. */
static inline @name@_real @name@_input(const @name@_real *u, int j) {
    return @name@_is_finite(u[j]) ? u[j] - @name@_u_offset[j] : @ZERO@;
}

/* Output i at this sample from the measurements before it: C x + D u, in the channel's unit. u may be NULL for a model
 * without inputs. */
static inline @name@_real @name@_prediction(const @name@_observer *o, const @name@_real *u, int i) {
    @name@_real sum = @name@_y_offset[i];
    for (int j = 0; j < @UPPER@_STATES; j++) {
        sum += @name@_C[i][j] * o->x[j];
    }
    for (int j = 0; j < @UPPER@_INPUTS; j++) {
        sum += @name@_D[i][j] * @name@_input(u, j);
    }
    return sum;
}

/* Take one sample; returns how many measurements were left out. */
static inline int @name@_step(@name@_observer *o, const @name@_real *u, const @name@_real *y) {
    int left_out = 0;
    for (int i = 0; i < @UPPER@_OUTPUTS; i++) {
        const int usable = @name@_is_finite(y[i]);
        o->missed[i] = usable ? y[i] - @name@_prediction(o, u, i) : @ZERO@;
        left_out += !usable;
    }
    for (int i = 0; i < @UPPER@_STATES; i++) {
        @name@_real sum = @ZERO@;
        for (int j = 0; j < @UPPER@_STATES; j++) {
            sum += @name@_A[i][j] * o->x[j];
        }
        for (int j = 0; j < @UPPER@_INPUTS; j++) {
            sum += @name@_B[i][j] * @name@_input(u, j);
        }
        for (int j = 0; j < @UPPER@_OUTPUTS; j++) {
            sum += @name@_K[i][j] * o->missed[j];
        }
        o->next[i] = sum;
    }
    memcpy(o->x, o->next, sizeof o->x);
    return left_out;
}

#endif
"""
