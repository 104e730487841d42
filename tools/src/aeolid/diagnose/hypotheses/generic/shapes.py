"""Forms that no entry has: curves, products, creep, bands, swings, ripples. Asked where no entry explains."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.hypotheses.generic.places import Follows, Place, said
from aeolid.diagnose.hypotheses.parts.base import Attachment, Slot
from aeolid.diagnose.rules import in_force
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, State

Array = NDArray[np.float64]
_BELOW = (0.15, 0.5, 0.85)  # shares of a signal's samples below the knots of a curve
_TIMES = 5  # time constants that are scanned
_BANDS, _WIDTH = 40, 0.07  # frequencies that are scanned for a band, and its damping then: each reaches the next
_BROADER = 3.0  # times the damping of what rings: how broad a band may turn out, which is then no narrow one
_WIDE = 100.0  # times the natural size of a coefficient: the end of its range


def shapes(found: Sequence[Place], step: float, span: float) -> list[Attachment]:
    """Offer a curve over every signal of every place, the product of every input with it, and what creeps after it.

    And a force in a narrow band. step, span: sample time and length of the fit part in s. A straight line is the
    baseline's own affair: where a coefficient is wrong, no form is missing.
    """
    curves = [c for p in found for f in p.follows if (c := _curve(p, f)) is not None]
    creeps = [_creep(p, p.follows[0], step, span) for p in found if not p.is_input]
    bands = [_band(p, step, span) for p in found if not p.is_input or all(q.is_input for q in found)]
    return [*curves, *_products(found), *creeps, *bands]


def _slot(name: str, label: str, size: float) -> Slot:
    return Slot(name, label, "", 0.0, -_WIDE * size, _WIDE * size, 1e-3 * size)


def _curve(place: Place, over: Follows) -> Attachment | None:
    """Return a curve broken straight at three knots; None over a signal with few values."""
    known = over.values[np.isfinite(over.values)]
    knots: list[float] = np.quantile(known, _BELOW).tolist() if len(known) else []
    if not knots or not min(np.diff(knots)) > in_force().hypotheses.curve_knots_apart * float(np.ptp(known)):
        return None
    tag = f"curve_{place.tag}_{over.tag}"
    slots = tuple(_slot(f"{tag}_{k + 1}", f"bend_{k + 1}", place.size / over.spread) for k in range(len(knots)))
    term = " + ".join(f"{s.name}*max({over.text} - {c!r}, 0)" for s, c in zip(slots, knots, strict=True))
    return place.attach(
        f"curve of {over.words}", tag, slots, term,
        equation=f"{place.label}: ... + sum of bend_k*max({over.words} - knot_k, 0)",
        statement=partial(_says_curve, place, over, tuple(k + over.offset for k in knots)),
    )  # fmt: skip


def _says_curve(place: Place, over: Follows, knots: Sequence[float], values: Mapping[str, float]) -> str:
    most = max(range(len(knots)), key=lambda k: abs(values[f"bend_{k + 1}"]))
    bent = said(f"{knots[most]:.4g}", over.unit)
    return f"{place.words} that follows {over.words} along a curve, bent most at {bent}"


def _products(found: Sequence[Place]) -> Iterator[Attachment]:
    """Yield every input times a place's own signals, and inputs whose gain follows a signal of the model."""
    driven = [p for p in found if p.is_input]
    signals = [f for p in found if not p.is_input for f in p.follows]
    for place in found:
        if not place.is_input:
            yield from (_product(place, p.follows[0], s) for p in driven for s in place.follows)
        else:  # of a linear model the outputs' signals alone: its modes are worked out from what acts
            own, *shown = place.follows
            yield from (_product(place, own, s) for s in shown or signals)


def _product(place: Place, u: Follows, s: Follows) -> Attachment:
    tag = f"product_{place.tag}_{u.tag}_{s.tag}"
    slot = _slot(tag, "factor", place.size / max(u.spread * s.spread, 1e-60))
    term = f"{tag}*({u.text} - {u.mean!r})*({s.text} - {s.mean!r})"
    return place.attach(
        f"product of {u.words} and {s.words}", tag, (slot,), term,
        equation=f"{place.label}: ... + factor*({u.words} - mean)*({s.words} - mean)",
        statement=lambda _: f"{place.words} that follows {u.words} times {s.words}",
    )  # fmt: skip


def _creep(place: Place, over: Follows, step: float, span: float) -> Attachment:
    """Return what follows a signal less what it was: a spring behind a dashpot, a hidden store of heat."""
    tag, least, most = f"creep_{place.tag}_{over.tag}", 2 * step, span / 3
    size, held = place.size / over.spread, f"creep_{place.tag}_{over.tag}_held"
    factor = _slot(f"{tag}_factor", "factor", size)
    times = np.geomspace(4 * step, span / 10, _TIMES).tolist()
    tau = Slot(f"{tag}_tau", "tau_s", "s", times[_TIMES // 2], least, most, times[_TIMES // 2], local=False)
    left = f"(({over.text} - {over.mean!r}) - {held})"

    def remember(model: Equations) -> Equations:
        rate = f"{left}/{tau.name}"
        if model.sample_time_s:
            rate = f"{held} + (1 - exp(-{model.sample_time_s!r}/{tau.name}))*{left}"
        return replace(model, states=(*model.states, State(held, over.unit, ex.parse(rate, tag), 0.0)))

    return place.attach(
        f"creep of {over.words}", tag, (factor, tau), f"{factor.name}*{left}", states=remember, start_states=(held,),
        grid=tuple({tau.name: t} for t in times),
        equation=f"{place.label}: ... + factor*({over.words} - z), z' = ({over.words} - z)/tau_s",
        statement=lambda v: f"{place.words} that follows changes of {over.words} and relaxes within {v['tau_s']:.3g} s",
    )  # fmt: skip


def _band(place: Place, step: float, span: float) -> Attachment:
    """Return a force that nobody recorded and that keeps to a narrow band: eddies, a pump, a passing blade.

    A pair of states turns at w and is kicked by noise: p' = -d p + w q, q' = -w p - d q + noise, d = damping*w. A band
    that fits best beyond what rings is broad: the colour of the noise (a drift of a sensor was said to be a force
    around 0.08 Hz, 16 s at a damping of 0.1).
    """
    tag, low, high = f"band_{place.tag}", 4 / span, 0.4 / step
    narrow = in_force().hypotheses.narrow_damping
    p, q = f"{tag}_p", f"{tag}_q"
    hz = Slot(f"{tag}_hz", "frequency_hz", "Hz", low, low, high, 0.1 * low, local=False)
    width = Slot(f"{tag}_damping", "damping", "1", _WIDTH, 0.0, _BROADER * narrow, 0.01, local=False)

    def turn(model: Equations) -> Equations:
        w, h = f"({2 * np.pi!r}*{hz.name})", model.sample_time_s
        if h:
            fade, angle = f"exp(-{width.name}*{w}*{h!r})", f"({w}*{h!r})"
            forms = [f"{fade}*(cos({angle})*{p} + sin({angle})*{q})", f"{fade}*(cos({angle})*{q} - sin({angle})*{p})"]
        else:
            forms = [f"{w}*{q} - {width.name}*{w}*{p}", f"-{w}*{p} - {width.name}*{w}*{q}"]
        pair = tuple(State(n, "", ex.parse(f, tag), 0.0, True) for n, f in zip((p, q), forms, strict=True))
        return replace(model, states=(*model.states, *pair))

    return place.attach(
        "band", tag, (hz, width), f"{place.size!r}*{p}", states=turn, gain_states=(p, q), noise_driven=True,
        grid=tuple({hz.name: float(f), width.name: _WIDTH} for f in np.geomspace(1.5 * low, high / 1.1, _BANDS)),
        equation=f"{place.label}: ... + p, p' = w*q - damping*w*p, q' = -w*p - damping*w*q + noise",
        statement=lambda v: f"{place.words} in a narrow band around {v['frequency_hz']:.3g} Hz, which nobody recorded",
        credible=lambda v: f"of damping {v['damping']:.2g}, no narrow band" if v.get("damping", 0.0) >= narrow else "",
    )  # fmt: skip


def swing(place: Place, over: Follows | None, time: str, middle: float, omega: float, span: float) -> Attachment:
    """Offer something that swings with time at a frequency near `omega` (rad/s), in proportion to a signal or alone.

    time: what the model calls it; middle, span: of the fit part, in s. The frequency is free within two of its bins.
    """
    tag = f"swing_{place.tag}{'' if over is None else '_' + over.tag}_{round(omega * span)}"
    f, reach = omega / (2 * np.pi), min(2.0 / span, 0.25 * omega / np.pi)
    rate = Slot(f"{tag}_hz", "frequency_hz", "Hz", f, f - reach, f + reach, 0.1 * reach, local=False)
    size = place.size / (1.0 if over is None else max(over.spread, 1e-60))
    what = "" if over is None else f" times {over.words}"
    return _wave(
        place, f"swing{'' if over is None else ' of ' + over.words} near {f:.4g} Hz", tag, size, rate,
        f"{2 * np.pi!r}*{rate.name}*({time} - {middle!r})", "" if over is None else f"*({over.text} - {over.mean!r})",
        equation=f"{place.label}: ... + (cosine*cos(2*pi*f*t) + sine*sin(2*pi*f*t)){what}",
        statement=lambda v: f"{place.words} that swings at {v['frequency_hz']:.4g} Hz{what}",
    )  # fmt: skip


def ripple(place: Place, over: Follows, number: float, span: float) -> Attachment:
    """Offer something that repeats along a signal: teeth, poles, slots; number: rad a unit of it, over its span."""
    tag = f"ripple_{place.tag}_{over.tag}_{round(number * span)}"
    reach = min(4 * np.pi / span, 0.5 * number)
    low, period, high = (2 * np.pi / k for k in (number + reach, number, number - reach))
    rate = Slot(f"{tag}_period", "period", over.unit, period, low, high, 0.1 * (high - low), local=False)
    return _wave(
        place, f"ripple over {over.words}, {round(number * span / 2 / np.pi)} times", tag, place.size, rate,
        f"{2 * np.pi!r}*({over.text} - {over.mean!r})/{rate.name}", "",
        equation=f"{place.label}: ... + cosine*cos(2*pi*{over.words}/period) + sine*sin(2*pi*{over.words}/period)",
        statement=partial(_says_ripple, place, over),
    )  # fmt: skip


def _says_ripple(place: Place, over: Follows, values: Mapping[str, float]) -> str:
    every = said(f"{values['period']:.4g}", over.unit)
    return f"{place.words} that repeats every {every} of {over.words}"


def _wave(
    place: Place, kind: str, tag: str, size: float, rate: Slot, phase: str, factor: str, *, equation: str,
    statement: Callable[[Mapping[str, float]], str],
) -> Attachment:  # fmt: skip
    """Return a cosine and a sine of a phase in which `rate` is free, near where a line was found."""
    cosine, sine = _slot(f"{tag}_cos", "cosine", size), _slot(f"{tag}_sin", "sine", size)
    return place.attach(
        kind, tag, (cosine, sine, rate), f"({cosine.name}*cos({phase}) + {sine.name}*sin({phase})){factor}",
        equation=equation, statement=statement, grid=({rate.name: rate.null},), essential=(cosine.name, sine.name),
    )  # fmt: skip
