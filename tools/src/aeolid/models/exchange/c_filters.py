"""Hold what may lie between an input and the plant as C99: each filter's value at an instant, and its mean over a step.

They follow `aeolid.models.input_filters`: exact for an input that is held over the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from aeolid.errors import UsageError
from aeolid.models.equations import Equations, InputFilter
from aeolid.models.intersample import PREFIX

_MOST_KEPT = 100_000  # pieces of a delayed input's past


@dataclass(frozen=True)
class _Kind:
    """Say how many numbers a kind of filter remembers, and whether it remembers the past itself."""

    words: int
    delays: bool = False


_KINDS = {
    "actuator_lag": _Kind(1), "transport_delay": _Kind(0, delays=True), "actuator_second_order": _Kind(2),
    "rate_limit": _Kind(1), "input_saturation": _Kind(0), "deadband": _Kind(1), "dead_zone": _Kind(0),
    "backlash": _Kind(1), "input_quantisation": _Kind(0), "input_mid_rise": _Kind(0), "input_floor": _Kind(0),
    "input_truncation": _Kind(0), "input_scale": _Kind(0), "lead_lag": _Kind(1), "indicial": _Kind(2),
}  # fmt: skip


@dataclass(frozen=True)
class Filters:
    """Hold the filters of a model in C: words they remember, functions, and what was left out (notes)."""

    words: int
    delays: tuple[int, ...]
    used: frozenset[str]
    first: str
    settle: str
    now: str
    mean: str
    notes: tuple[str, ...]


def filters_of(model: Equations, piece_s: float, prefix: str) -> Filters:
    """Return the filters of a model as bodies of C functions, in the model's order.

    piece_s: the time that one mean spans, s; what a dead time keeps is counted in it. How a recording's inputs go on
    between its samples is left out, with a note: here they are held. Raises UsageError on an input that acts early.
    """
    names = [s.name for s in model.inputs]
    first, settle, now, mean, notes, delays, word = [], [], [], [], [], [], 0
    used: set[str] = set()
    for f in model.filters:
        if f.kind.startswith(PREFIX):
            notes.append(
                f"input {f.channel}: held over each step; how the recording's values go on between its samples"
                f" ({f.kind}) is no part of the plant"
            )
            continue
        kind, c, used = _KINDS[f.kind], names.index(f.channel), used | {f.kind}
        th = "".join(f", th[{model.index(p)}]" for p in f.parameters)
        memory = f"&s->f[{word}]"
        if kind.delays:
            delays.append(_kept(model, f, piece_s))
            memory = f"&s->past_{len(delays)}, s->room_{len(delays)}, {delays[-1]}"
            settle.append(f"    {prefix}_past_begin(&s->past_{len(delays)}, v[{c}]);")
        else:
            settle += [f"    s->f[{word + k}] = {f'v[{c}]' if k == 0 or kind.words < 2 else _second(f, c)};"
                       for k in range(kind.words)]  # fmt: skip
            if not kind.words:
                first.append(f"    v[{c}] = {prefix}_{f.kind}_now({memory}, v[{c}]{th});")
                settle.append(first[-1])
        now.append(f"    v[{c}] = {prefix}_{f.kind}_now({memory}, v[{c}]{th});")
        mean.append(f"    v[{c}] = {prefix}_{f.kind}({memory}, v[{c}]{th}, h);")
        word += kind.words
    begun, settled, present, means = ("\n".join(lines) for lines in (first, settle, now, mean))
    return Filters(word, tuple(delays), frozenset(used), begun, settled, present, means, tuple(notes))


def _second(f: InputFilter, channel: int) -> str:
    """Return what the second number begins with: a speed at rest, or a second lag that has settled."""
    return "0.0" if f.kind == "actuator_second_order" else f"v[{channel}]"


def _kept(model: Equations, f: InputFilter, piece_s: float) -> int:
    """Return how many pieces of its past a dead time keeps: of twice its value, any two of them longer than one."""
    delay = float(model.theta[model.index(f.parameters[0])])
    if not delay >= 0:
        raise UsageError(
            f"input {f.channel}: acts {-delay:g} s early; a simulation cannot know its inputs beforehand, shift"
            " the recording instead"
        )
    count = math.ceil(4 * delay / piece_s) + 16
    if count > _MOST_KEPT:
        raise UsageError(
            f"input {f.channel}: a dead time of {delay:g} s keeps more than {_MOST_KEPT // 4} steps; give a longer"
            " --sample-time"
        )
    return count


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
    zeta = zeta < 0.05 ? 0.05 : (zeta > 0.999 ? 0.999 : zeta);
    const double angle = h / inverse, root = sqrt(1.0 - zeta * zeta), decay = exp(-zeta * angle);
    const double c = cos(angle * root), s = sin(angle * root), d = w[0] - u, v = w[1];
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
