"""Hold the C text of what may lie between an input and the plant; words between @ are put in by c_simulation."""

PAST = """\
/* What an input was, as `room` pieces: their lengths in s, then their values; beyond the oldest it is as before. */
typedef struct {
    int newest;
    int count;
    double before;
} @name@_past;

static void @name@_past_begin(@name@_past *p, double value) {
    p->newest = 0;
    p->count = 0;
    p->before = value;
}

/* Pieces that together are no longer than the model's become one of their mean, so that short steps fill no room. */
static void @name@_past_add(@name@_past *p, double *pieces, int room, double value, double length) {
    double *lengths = pieces, *values = pieces + room;
    if (p->count > 0 && values[p->newest] == value) {
        lengths[p->newest] += length;
        return;
    }
    if (p->count > 0 && lengths[p->newest] + length <= @PIECE@ * (1.0 + 1e-9)) {
        const double both = lengths[p->newest] + length;
        values[p->newest] += (value - values[p->newest]) * length / both;
        lengths[p->newest] = both;
        return;
    }
    p->newest = (p->newest + 1) % room;
    if (p->count == room) {
        p->before = values[p->newest];
    } else {
        p->count++;
    }
    lengths[p->newest] = length;
    values[p->newest] = value;
}

/* The integral of the input over ages young to old, in s before now. */
static double @name@_past_integral(const @name@_past *p, const double *pieces, int room, double young, double old) {
    double sum = 0.0, age = 0.0;
    for (int k = 0; k < p->count && age < old; k++) {
        const int i = (p->newest - k + room) % room;
        const double end = age + pieces[i], from = age > young ? age : young, to = end < old ? end : old;
        if (to > from) {
            sum += (to - from) * pieces[room + i];
        }
        age = end;
    }
    if (old > age) {
        sum += (old - (age > young ? age : young)) * p->before;
    }
    return sum;
}
"""


def _at_once(kind: str, value: str, result: str) -> str:
    """Return the functions of a kind that remembers nothing, has one value and acts on u at once."""
    return f"""\
static double @name@_{kind}_now(const double *none, double u, double {value}, double share) {{
    (void)(none);
    return {result};
}}

static double @name@_{kind}(double *none, double u, double {value}, double share, double h) {{
    (void)(h);
    return @name@_{kind}_now(none, u, {value}, share);
}}
"""


def _levels(kind: str, level: str) -> str:
    """Return the functions of a drive that takes levels `spacing` apart."""
    return _at_once(kind, "spacing", f"u + share * ((spacing > 0.0 ? {level} * spacing : u) - u)")


FUNCTIONS = {
    "actuator_lag": """\
static double @name@_actuator_lag(double *w, double u, double tau, double h) {
    if (tau <= 1e-9 * h) {
        *w = u;
        return u;
    }
    const double gap = *w - u, mean = u - gap * expm1(-h / tau) * tau / h;
    *w = u + gap * exp(-h / tau);
    return mean;
}

static double @name@_actuator_lag_now(const double *w, double u, double tau) {
    return tau > 0.0 ? *w : u;
}
""",
    "transport_delay": """\
static double @name@_transport_delay(@name@_past *p, double *pieces, int room, double u, double delay, double h) {
    @name@_past_add(p, pieces, room, u, h);
    return delay > 0.0 ? @name@_past_integral(p, pieces, room, delay, delay + h) / h : u;
}

static double @name@_transport_delay_now(const @name@_past *p, const double *pieces, int room, double u,
                                         double delay) {
    double age = 0.0;
    if (!(delay > 0.0)) {
        return u;
    }
    for (int k = 0; k < p->count; k++) {
        const int i = (p->newest - k + room) % room;
        age += pieces[i];
        if (age >= delay * (1.0 - 1e-9)) {
            return pieces[room + i];
        }
    }
    return p->before;
}
""",
    "actuator_second_order": """\
/* w[0] is the position, w[1] its speed over the natural frequency; inverse is 1/omega in s. */
static double @name@_actuator_second_order(double *w, double u, double inverse, double zeta, double h) {
    if (inverse <= 1e-9 * h) {
        w[0] = u;
        w[1] = 0.0;
        return u;
    }
    zeta = zeta > 0.0 ? zeta : 0.0;
    const double angle = h / inverse, root = fmax(sqrt(fabs(1.0 - zeta * zeta)), 1e-5);
    const double d = w[0] - u, v = w[1];
    double decay = 1.0, c, s;
    if (zeta < 1.0) {
        decay = exp(-zeta * angle);
        c = cos(angle * root);
        s = sin(angle * root);
    } else { /* two lags: the products with the decay, none of which overflows */
        const double slow = exp(-(zeta - root) * angle), fast = exp(-(zeta + root) * angle);
        c = 0.5 * (slow + fast);
        s = 0.5 * (slow - fast);
    }
    const double d_next = decay * (d * (c + zeta / root * s) + v / root * s);
    const double v_next = decay * (v * (c - zeta / root * s) - d / root * s);
    w[0] = u + d_next;
    w[1] = v_next;
    return u - ((v_next - v) + 2.0 * zeta * (d_next - d)) / angle;
}

static double @name@_actuator_second_order_now(const double *w, double u, double inverse, double zeta) {
    (void)(zeta);
    return inverse > 0.0 ? w[0] : u;
}
""",
    "rate_limit": """\
static double @name@_rate_limit(double *x, double u, double rate, double share, double h) {
    const double gap = u - *x, most = rate * h;
    double mean;
    if (fabs(gap) <= most) {
        mean = most > 0.0 ? u - 0.5 * gap * fabs(gap) / most : u;
        *x = u;
    } else {
        const double move = gap > 0.0 ? most : -most;
        mean = *x + 0.5 * move;
        *x += move;
    }
    return u + share * (mean - u);
}

static double @name@_rate_limit_now(const double *x, double u, double rate, double share) {
    (void)(rate);
    return u + share * (*x - u);
}
""",
    "input_saturation": """\
static double @name@_input_saturation_now(const double *none, double u, double low, double high, double share) {
    (void)(none);
    const double raised = low > u ? low : u;
    return u + share * ((high < raised ? high : raised) - u);
}

static double @name@_input_saturation(double *none, double u, double low, double high, double share, double h) {
    (void)(h);
    return @name@_input_saturation_now(none, u, low, high, share);
}
""",
    "deadband": """\
static double @name@_deadband_now(const double *x, double u, double width, double share) {
    return u + share * ((fabs(u - *x) > width ? u : *x) - u);
}

static double @name@_deadband(double *x, double u, double width, double share, double h) {
    (void)(h);
    *x = fabs(u - *x) > width ? u : *x;
    return u + share * (*x - u);
}
""",
    "dead_zone": """\
static double @name@_dead_zone_now(const double *none, double u, double width, double share) {
    (void)(none);
    const double left = fabs(u) > width ? fabs(u) - width : 0.0;
    return u + share * ((u < 0.0 ? -left : left) - u);
}

static double @name@_dead_zone(double *none, double u, double width, double share, double h) {
    (void)(h);
    return @name@_dead_zone_now(none, u, width, share);
}
""",
    "backlash": """\
static double @name@_backlash_now(const double *x, double u, double width, double share) {
    const double low = u - 0.5 * width, high = u + 0.5 * width, raised = low > *x ? low : *x;
    return u + share * ((high < raised ? high : raised) - u);
}

static double @name@_backlash(double *x, double u, double width, double share, double h) {
    (void)(h);
    const double low = u - 0.5 * width, high = u + 0.5 * width, raised = low > *x ? low : *x;
    *x = high < raised ? high : raised;
    return u + share * (*x - u);
}
""",
    "input_quantisation": _levels("input_quantisation", "floor(u / spacing + 0.5)"),
    "input_mid_rise": _levels("input_mid_rise", "(floor(u / spacing) + 0.5)"),
    "input_floor": _levels("input_floor", "floor(u / spacing)"),
    "input_truncation": _levels("input_truncation", "(u < 0.0 ? ceil(u / spacing) : floor(u / spacing))"),
    "input_scale": _at_once("input_scale", "factor", "u * (1.0 + share * (factor - 1.0))"),
    "lead_lag": """\
static double @name@_lead_lag(double *w, double u, double tau, double gain, double h) {
    return u + gain * (u - @name@_actuator_lag(w, u, tau, h));
}

static double @name@_lead_lag_now(const double *w, double u, double tau, double gain) {
    return u + gain * (u - @name@_actuator_lag_now(w, u, tau));
}
""",
    "indicial": """\
static double @name@_indicial(double *w, double u, double tau, double gain, double h) {
    const double fast = @name@_actuator_lag(&w[0], u, tau * (0.0455 / 0.3), h);
    return u + gain * (u - 0.67 * fast - 0.33 * @name@_actuator_lag(&w[1], u, tau, h));
}

static double @name@_indicial_now(const double *w, double u, double tau, double gain) {
    const double fast = @name@_actuator_lag_now(&w[0], u, tau * (0.0455 / 0.3));
    return u + gain * (u - 0.67 * fast - 0.33 * @name@_actuator_lag_now(&w[1], u, tau));
}
""",
}
