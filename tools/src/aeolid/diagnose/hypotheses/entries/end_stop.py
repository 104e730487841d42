"""Stops: a stiff spring that is touched only near the ends of the travel."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, natural, per, travel, with_spring
from aeolid.diagnose.structure.anatomy import Motion

_ENDS = (0.95, 0.85, 0.7, 0.5, 0.35)  # of the travel seen, where both stops are tried
_WITHIN = (0.6, 0.35, 0.1)  # the same where one stop is tried at a recorded position
_STIFF = 1e4  # times the natural stiffness: beyond that a sample cannot tell
_SAMPLED = 1.0  # of a model in discrete time: radians that what a stop catches turns in a sample, at most
_IDLE = 1.9  # halves of the travel seen from its middle, where a stop that nothing touches stands
_LOSSES = (0.0, 1.0)  # that fits start from, by the typical velocity
_MOST_LOSS = 20.0  # by the typical velocity: no rebound is left


_ELASTIC = "-{k}*(max({q} - {high}, 0) + min({q} - {low}, 0))"
_LOSSY = "-{k}*(max({q} - {high}, 0)*max(1 + {loss}*{v}, 0) + min({q} - {low}, 0)*max(1 - {loss}*{v}, 0))"


def _attach(site: Site) -> list[Attachment]:
    return [_on(site, motion, i) for i, motion in with_spring(site)]


def _on(site: Site, motion: Motion, number: int) -> Attachment:
    middle, half = travel(site, motion)
    unit, length = per(motion, 1), motion.position_unit
    stop, low, high, loss = (f"stop_{number + 1}_{what}" for what in ("stiffness", "low", "high", "loss"))
    ends = [(-share, share) for share in _ENDS] + [(-1.5, 0.85), (-0.85, 1.5)]  # both, only above, only below
    if motion.recorded is not None:  # no force drives it back: it may be anywhere beyond a stop
        ends += [pair for share in _WITHIN for pair in ((-1.5, share), (-share, 1.5))]
    idle = middle - _IDLE * half, middle + _IDLE * half
    slots = [
        Slot(stop, "stop_stiffness", unit, 0.0, 0.0, _stiffest(site, motion), 1e-3 * natural(motion)),
        Slot(low, "low_stop", length, middle - half, middle - 2 * half, middle, 0.1 * half, local=False, idle=idle[0]),
        Slot(
            high, "high_stop", length, middle + half, middle, middle + 2 * half, 0.1 * half, local=False, idle=idle[1]
        ),
    ]
    starts = [{}, *({stop: times * natural(motion)} for times in (1, 10))]
    lossy = motion.recorded is None and motion.velocity_size > 0  # where a speed is known
    if lossy:
        slow = 1 / motion.velocity_size
        slots.append(Slot(loss, "stop_loss", f"s/{length}", 0.0, 0.0, _MOST_LOSS * slow, 0.1 * slow, local=False))
        starts = [{**start, loss: share * slow} for start in starts for share in _LOSSES]
    return force_on(
        motion, number, "end_stop", tuple(slots),
        (_LOSSY if lossy else _ELASTIC).format(k=stop, low=low, high=high, loss=loss, q="{q}", v="{v}"),
        grid=tuple({low: middle + a * half, high: middle + b * half} for a, b in ends), starts=tuple(starts),
        equation=_equation(_LOSSY if lossy else _ELASTIC),
        statement=partial(_statement, motion.location, (length, unit), idle),
    )  # fmt: skip


def _statement(where: str, units: tuple[str, str], idle: tuple[float, float], v: Mapping[str, float]) -> str:
    low, high, stiff = v["low_stop"], v["high_stop"], f"({v['stop_stiffness']:.3g} {units[1]}); the model has none"
    ends = [f"{end:.3g} {units[0]}" for end, acts in ((low, low > idle[0]), (high, high < idle[1])) if acts]
    if len(ends) == 1:
        return f"a stop at {ends[0]} bounds the motion at {where} {stiff}"
    return f"stops at {' and '.join(ends) or 'its ends'} bound the motion at {where} {stiff}"


def _equation(force: str) -> str:
    """Return a force's equation as reports have it, in the catalogue's symbols."""
    symbols = {"k": "stop_stiffness", "low": "low_stop", "high": "high_stop", "loss": "stop_loss", "q": "q", "v": "v"}
    return "F = " + force.format(**symbols)


def _stiffest(site: Site, motion: Motion) -> float:
    """Return the largest stiffness: what a sample of a discrete model cannot follow throws the motion back beyond."""
    most = _STIFF * natural(motion)
    return min(most, (_SAMPLED / site.model.sample_time_s) ** 2) if site.model.sample_time_s else most


ENTRY = Entry(
    id="end_stop",
    family="nonlinear_stiffness",
    name="end stops",
    equation=_equation(_LOSSY),
    source="Shaw and Holmes 1983, J. Sound Vib. 90(1), piecewise linear oscillator; Hunt and Crossley 1975, J. Appl."
    " Mech. 42(2), what a contact takes of the motion",
    quantities=(
        Quantity("stop_stiffness", "N/m (1/s^2 without a mass)", 0.0, 1e12, 0.0, "stiffness of the stops"),
        Quantity("low_stop", "m", -1e6, 1e6, float("nan"), "where the lower stop is touched"),
        Quantity("high_stop", "m", -1e6, 1e6, float("nan"), "where the upper stop is touched"),
        Quantity(
            "stop_loss", "s/m", 0.0, 1e6, 0.0, "share of the force that speed into the stop adds, out of it takes"
        ),
    ),
    attaches_to="every position with an equation of motion, every oscillatory mode, every recorded one of a static law",
    signature="large strokes are cut short, small ones are as modelled",
    confused_with=(
        ("cubic_stiffness", "a cubic spring hardens from the middle on, a stop all at once"),
        ("clearance", "a clearance lacks force in the middle, a stop adds it at the ends"),
        ("input_saturation", "excite less: a stop is not reached, a saturated drive is as modelled"),
    ),
    attach=_attach,
    rank=170,
)
