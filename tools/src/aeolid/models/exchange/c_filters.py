"""Hold what may lie between an input and the plant as C99: each filter's value at an instant, and its mean over a step.

They follow `aeolid.models.input_filters`: exact for an input that is held over the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from aeolid.errors import UsageError
from aeolid.models.equations import Equations, InputFilter
from aeolid.models.filter_chains import in_order
from aeolid.models.intersample import PREFIX

_MOST_KEPT = 100_000  # pieces of a delayed input's past
_MOST_SPARE = 4096  # pieces, 64 KiB, for dead times that a parameter may be given later
_SLACK = 16  # pieces beyond a dead time: the piece that begins, the one that ends, and some


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
    """Hold the filters of a model in C: words they remember, functions, and what was left out (notes).

    longest: parameters that are dead times, and up to what there is room for them, s.
    """

    words: int
    delays: tuple[int, ...]
    used: frozenset[str]
    first: str
    settle: str
    now: str
    mean: str
    notes: tuple[str, ...]
    longest: dict[str, float]


def filters_of(model: Equations, piece_s: float, prefix: str) -> Filters:
    """Return the filters of a model as bodies of C functions, in the order in which a free run passes them.

    piece_s: the time that one mean spans, s; what a dead time keeps is counted in it. How a recording's inputs go on
    between its samples is left out, with a note: here they are held. Raises UsageError on an input that acts early.
    """
    names = [s.name for s in model.inputs]
    first, settle, now, mean, notes, delays, word = [], [], [], [], [], [], 0
    used: set[str] = set()
    longest: dict[str, float] = {}
    for f in in_order(model.filters):
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
            longest[f.parameters[0]] = (delays[-1] - _SLACK // 2) / 2 * piece_s
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
    notes += _short_of(model, longest)
    return Filters(word, tuple(delays), frozenset(used), begun, settled, present, means, tuple(notes), longest)


def _short_of(model: Equations, longest: dict[str, float]) -> list[str]:
    """Say which parameters may not be given all of their range."""
    limits = {name: model.parameters[model.index(name)].maximum for name in longest}
    return [
        f"parameter {name}: a dead time of up to {longest[name]:.6g} s has room, of its range up to {limit:g} s"
        + ("" if model.sample_time_s else "; a longer --sample-time has more")
        for name, limit in limits.items()
        if math.isfinite(limit) and limit > longest[name]
    ]


def _second(f: InputFilter, channel: int) -> str:
    """Return what the second number begins with: a speed at rest, or a second lag that has settled."""
    return "0.0" if f.kind == "actuator_second_order" else f"v[{channel}]"


def _kept(model: Equations, f: InputFilter, piece_s: float) -> int:
    """Return how many pieces of its past a dead time keeps, any two of them longer than one.

    Of its greatest value where that is declared and not too much, else of twice the present one.
    """
    parameter = model.parameters[model.index(f.parameters[0])]
    delay = float(parameter.value)
    if not delay >= 0:
        raise UsageError(
            f"input {f.channel}: acts {-delay:g} s early; a simulation cannot know its inputs beforehand, shift"
            " the recording instead"
        )
    count = math.ceil(4 * delay / piece_s)
    if math.isfinite(parameter.maximum) and parameter.maximum >= delay:
        pieces = 2 * parameter.maximum / piece_s
        count = math.ceil(pieces) if pieces <= max(count, _MOST_SPARE) else max(count, _MOST_SPARE)
    count += _SLACK
    if count > _MOST_KEPT:
        raise UsageError(
            f"input {f.channel}: a dead time of {delay:g} s keeps more than {_MOST_KEPT // 4} steps; give a longer"
            " --sample-time"
        )
    return count
