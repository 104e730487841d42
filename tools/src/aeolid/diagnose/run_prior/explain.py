"""Decide what explains a pair: one operator after another while each brings the run back, else a mode the run lacks.

All numbers that decide stand here. A pair is detected by what is lost when the run counts fully, and beside that by an
effect that is worth enough for itself: what is lost counts every law that moved, an effect's gain its own alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values, all_hypotheses
from aeolid.diagnose.run_prior.modal import Absent, Modal, compare_modes
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Pair
from aeolid.diagnose.run_prior.resonances import resonances
from aeolid.diagnose.run_prior.search import Scored, Search
from aeolid.diagnose.run_prior.standing import Standing

Array = NDArray[np.float64]
LEAST_LOST, EACH_LOST = 30.0, 10.0  # nats lost from which something separates the sides: in all, and an output
UNSTEADY = 1.5  # times what halves of one side lose under each other, below which nothing separates the sides either
DETECTED = 60.0  # nats by which the evidence must fall for an effect to be excluded
NAMED = 30.0  # nats that an effect must gain on the data of the fit …
HELD = 0.1  # … with the run's weight back at least here: what remains is then no more than nulls show …
SHARE = 0.5  # … or with so much of what was lost explained: what acts between samples leaves a rest in short blocks
MOVED_SHARE = 0.25  # … or with this of it by a mode that moved: what else it does to the outputs is not told by poles
LEAST_SHARE = 0.1  # of what was lost: less leaves the pair as different as before, whatever the run's weight does
FURTHER = 0.05  # of the first effect's gain that a further one must have
_RIVAL = 0.97  # of the best gain from which another kind is not told from it …
_RIVAL_NATS = 8.0  # … or this near in nats
RICHER = 10.0  # nats that a form must gain over a simpler one that it holds
AERODYNAMIC = ("dynamic_inflow", "unsteady_aero")  # effects of a machine with blades
_GROWN = 1.2  # by which a missing mode that has a name must make the errors of its output grow
_AERODYNAMIC_FORMS = (*AERODYNAMIC, "parameter_error")  # what stands for aerodynamics that levels tell better
SIMPLER = {  # forms that another one holds as a special case
    "actuator_second_order": ("actuator_lag", "transport_delay"),
    "unsteady_aero": ("actuator_lag", "parameter_error"),
    "dynamic_inflow": ("parameter_error",),
}


@dataclass(frozen=True, eq=False)
class Found:
    """Hold one effect: a hypothesis, a mode that the runs lack or what levels tell; rivals are not told from it."""

    scored: Scored | None
    mode: Absent | None
    rivals: tuple[Scored, ...] = ()
    edge: bool = False  # the mode is a pair of a blade's edgewise whirl
    standing: Standing | None = None
    seen_in: Pair | None = None  # outputs in which it was found, where these are not all


@dataclass(frozen=True, eq=False)
class Explanation:
    """Hold the outcome of a search.

    lost: nats that the recordings lose when the run counts fully; limit: what they may lose and nothing separate the
    sides; weight: the run's best weight without an effect;
    moved: by output, how much one-step errors grow when the run counts fully; found: effects, first one first; table:
    what every refined hypothesis gained, by step; modal: the modes of both sides.
    """

    lost: float
    weight: float
    moved: Mapping[str, float]
    found: tuple[Found, ...]
    table: tuple[Scored, ...]
    modal: Modal
    change: Change = NOTHING
    screened: tuple[Scored, ...] = ()
    evaluations: int = 0
    after: float = np.nan  # the run's weight with all effects
    tried: Mapping[str, tuple[Hypothesis, tuple[tuple[Values, float], ...]]] = field(default_factory=dict)
    limit: float = LEAST_LOST

    @property
    def is_apart(self) -> bool:
        """Tell whether run and recordings differ by more than their noise, whatever explains it."""
        return self.lost > self.limit or any(f.standing is not None for f in self.found)


def explain(
    pair: Pair, context: Mapping[str, Any], units: Mapping[str, str], deadline: Deadline,
    tick: Callable[[str], None] = lambda _: None,
) -> Explanation:  # fmt: skip
    """Find what separates runs and recordings of a pair, at most two effects. Cost: some 200 evaluations."""
    turbine = context.get("blades") is not None
    hypotheses = [h for h in all_hypotheses(pair, dict(units)) if turbine or h.entry not in AERODYNAMIC]
    first = Search(pair)
    lost, moved = first.lost, _moved(first)
    limit = limit_of(pair, first.unsteady())
    modal = compare_modes(pair, context) if lost > limit else Modal((), (), ())
    hypotheses += resonances(pair, modal, units, moved, context)
    screened = first.screen(hypotheses, tick)
    table = first.refine(screened, tick)
    best = chosen(first, table, lost)
    x = Explanation(
        lost, first.base.weight, moved, (), tuple(table), modal, NOTHING, tuple(screened), first.evaluations,
        tried=first.tried, limit=limit,
    )  # fmt: skip
    if best is None:
        return replace(x, found=_from_modes(modal, moved, context, pair) if lost > limit else ())
    x = replace(x, found=(Found(best, None, rivals_of(best, table)),), change=best.change, after=best.weight)
    return x if deadline.passed else _with_further(pair, x, best, hypotheses, tick)


def _with_further(
    pair: Pair, x: Explanation, best: Scored, hypotheses: Sequence[Hypothesis], tick: Callable[[str], None]
) -> Explanation:
    """Return an explanation with a second effect at another place, where one gains enough behind the first."""
    second = Search(pair, best.change)
    own = [h for h in hypotheses if h.place != best.hypothesis.place]
    more = second.refine(second.screen(own, tick), tick) if second.lost > x.limit else []
    further = chosen(second, more, second.lost)
    x = replace(x, evaluations=x.evaluations + second.evaluations)
    if further is None or further.nats <= max(NAMED, FURTHER * best.nats):
        return x
    return replace(
        x, found=(*x.found, Found(further, None, rivals_of(further, more))), change=further.change.after(best.change),
        after=further.weight, table=(*x.table, *more),
    )  # fmt: skip


def limit_of(pair: Pair, unsteady: float) -> float:
    """Return the nats that may be lost and nothing separate the sides, from what their halves lose."""
    return max(LEAST_LOST, EACH_LOST * len(pair.shown), UNSTEADY * unsteady)


def with_standing(x: Explanation, standing: Sequence[Standing]) -> Explanation:
    """Return an explanation with what levels tell: beside an actuator or sensor, in place of an aerodynamic factor.

    A mode that the runs lack moves cyclic levels, too, so that it stays alone unless the level of power moved.
    """
    if not standing:
        return x
    kept = tuple(f for f in x.found if f.scored is None or f.scored.hypothesis.entry not in _AERODYNAMIC_FORMS)
    told = tuple(Found(None, None, standing=s) for s in standing if not kept or s.place.get("air_density"))
    if not told:
        return x
    change = x.change if len(kept) == len(x.found) else NOTHING
    for f in kept:
        if f.scored is not None and change is NOTHING:
            change = f.scored.change
    return replace(x, found=kept + told, change=change)


def _moved(search: Search) -> dict[str, float]:
    grown = np.diag(search.covariance_at(1.0)) / np.diag(search.base.covariance)
    return {n: float(v) for n, v in zip(search.pair.shown, grown, strict=True)}


def chosen(search: Search, table: Sequence[Scored], lost: float) -> Scored | None:
    """Return the hypothesis that explains best: enough nats, the run's weight back, no simpler form as good."""
    least = max(HELD, search.base.weight)
    table = [s for s in table if s.nats > max(NAMED, LEAST_SHARE * lost)]
    fit = [s for s in table if s.weight >= least or s.nats > (MOVED_SHARE if s.hypothesis.of else SHARE) * lost]
    if not fit:
        return None
    return max(fit, key=lambda s: s.nats - RICHER * (len(s.values) - 1))


def rivals_of(best: Scored, table: Sequence[Scored]) -> tuple[Scored, ...]:
    """Return other kinds, or other places, that gain nearly as much; forms that only hold the best one are none."""
    near = min(_RIVAL * best.nats, best.nats - _RIVAL_NATS)
    return tuple(s for s in table if s is not best and s.nats > near and not _holds(s.hypothesis, best.hypothesis))


def _holds(form: Hypothesis, other: Hypothesis) -> bool:
    """Tell whether a form has another one, at the same place, as a special case."""
    return form.place == other.place and other.entry in SIMPLER.get(form.entry, ())


def _from_modes(modal: Modal, moved: Mapping[str, float], context: Mapping[str, Any], pair: Pair) -> tuple[Found, ...]:
    """Return the mode that the runs lack: a pair of edgewise whirl modes as one, else the sharpest where it moved."""
    turn = context.get("rated_speed_rad_s")
    if turn:
        apart = 2 * float(turn) / (2 * np.pi)
        for a in modal.absent:
            for b in modal.absent:
                if abs(b.frequency_hz - a.frequency_hz - apart) < 0.06 * apart and a.output == b.output:
                    middle = Absent(
                        (a.frequency_hz + b.frequency_hz) / 2, float(np.hypot(a.frequency_std_hz, b.frequency_std_hz)),
                        (a.damping + b.damping) / 2, float(np.hypot(a.damping_std, b.damping_std)), a.output,
                    )  # fmt: skip
                    return (Found(None, middle, edge=True),)
    most = max(moved.values())
    named = [a for a in modal.absent if a.kind and moved.get(a.output, 0.0) > _GROWN]
    shown = [a for a in modal.absent if moved.get(a.output, 0.0) > 0.5 * most] if most > 1.5 else []
    if named:
        return (Found(None, max(named, key=lambda a: moved[a.output])),)
    return (Found(None, shown[0]),) if shown else ()
