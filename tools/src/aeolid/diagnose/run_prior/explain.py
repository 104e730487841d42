"""Decide what explains a pair: one operator after another while each brings the run back, else a mode the run lacks.

All numbers that decide stand in `rules`. A pair is detected by what is lost when the run counts fully, and beside that
by an effect that is worth enough for itself: what is lost counts every law that moved, an effect's gain its own alone.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.hypotheses.parts.lateness import LATE, lateness
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values, all_hypotheses
from aeolid.diagnose.run_prior.modal import Absent, Modal, compare_modes
from aeolid.diagnose.run_prior.offsets import ANGLE
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Pair
from aeolid.diagnose.run_prior.resonances import resonances
from aeolid.diagnose.run_prior.search import FIT, Scored, Search
from aeolid.diagnose.run_prior.siblings import of_blades
from aeolid.diagnose.run_prior.standing import Standing
from aeolid.diagnose.run_prior.standing_out import Local, local_of, lone_mode, once_of
from aeolid.diagnose.run_prior.wiring import faults_of

Array = NDArray[np.float64]
AERODYNAMIC = ("dynamic_inflow", "unsteady_aero")  # effects of a machine with blades
_AERODYNAMIC_FORMS = (*AERODYNAMIC, "parameter_error")  # what stands for aerodynamics that levels tell better
_PASSING = ("tower_shadow", "rotational_sampling")  # loads each time a blade passes
_MOVED = ("", "drivetrain_torsion")  # kinds of modes that blades which bend move
_SHADOW = "loads come each time a blade passes the tower (tower shadow), more than in the simulation"
SIMPLER = {  # forms that another one holds as a special case
    "actuator_second_order": ("actuator_lag", "transport_delay"),
    "unsteady_aero": ("actuator_lag", "parameter_error"),
    "dynamic_inflow": ("parameter_error",),
    "tower_shadow": ("rotational_sampling",),
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
    rise: Local | None = None  # how the mode stands out beside its own frequency


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
    once: Mapping[str, float] = field(default_factory=dict)  # by output, growth of the log power once a revolution
    limit: float = field(default_factory=lambda: in_force().run_prior.lost_nats)

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
    if lost > limit:
        hypotheses += faults_of(pair, units)
    screened = first.screen(hypotheses, tick)
    table = first.refine(screened, tick)
    best = chosen(first, table, lost)
    x = Explanation(
        lost, first.base.weight, moved, (), tuple(table), modal, NOTHING, tuple(screened), first.evaluations,
        tried=first.tried, limit=limit, once=once_of(pair, context),
    )  # fmt: skip
    rigid = lone_mode(pair, modal, context, FIT, in_force().run_prior.rigid_log) if lost > limit else None
    if rigid is not None and not (best is not None and best.hypothesis.fault and _settles(pair, best, modal, context)):
        return replace(x, found=(Found(None, rigid),))
    if best is None or best.hypothesis.of or _explains_little(best, lost):
        lone = _from_modes(modal, moved, context, pair, best is not None) if lost > limit else ()
        if lone or best is None:
            return replace(x, found=lone)
    best, rivals = of_blades(pair, best, rivals_of(best, table), table)
    x = replace(x, found=(Found(best, None, rivals),), change=best.change, after=best.weight)
    return x if deadline.passed else _with_further(pair, x, best, hypotheses, tick)


def _explains_little(best: Scored, lost: float) -> bool:
    """Tell whether an effect leaves the most of what separates the sides, so that a mode may be what is missing.

    A floating turbine without its tower's bending was a factor of the speed's sensor, 116 of 1,042 nats.
    """
    return not best.hypothesis.fault and best.nats < in_force().run_prior.explained_share * lost


def _settles(pair: Pair, fault: Scored, modal: Modal, context: Mapping[str, Any]) -> bool:
    """Tell whether behind a fault of channels no output of the runs is as rigid as it was before."""
    return lone_mode(pair.rewired(fault.change), modal, context, FIT, in_force().run_prior.rigid_log) is None


def _with_further(
    pair: Pair, x: Explanation, best: Scored, hypotheses: Sequence[Hypothesis], tick: Callable[[str], None]
) -> Explanation:
    """Return an explanation with a second effect at another place, where one gains enough behind the first."""
    rules = in_force().run_prior
    second = Search(pair, best.change)
    own = [h for h in hypotheses if h.place != best.hypothesis.place]
    more = second.refine(second.screen(own, tick), tick) if second.lost > x.limit else []
    further = chosen(second, more, second.lost)
    x = replace(x, evaluations=x.evaluations + second.evaluations)
    if further is None or further.nats <= max(rules.named_nats, rules.further_share * best.nats):
        return x
    if further.weight <= second.base.weight and further.nats <= rules.explained_share * second.lost:
        return x  # what the first effect leaves over is as large as before
    return replace(
        x, found=(*x.found, Found(further, None, rivals_of(further, more))), change=further.change.after(best.change),
        after=further.weight, table=(*x.table, *more),
    )  # fmt: skip


def limit_of(pair: Pair, unsteady: float) -> float:
    """Return the nats that may be lost and nothing separate the sides, from what their halves lose."""
    rules = in_force().run_prior
    return max(rules.lost_nats, rules.lost_nats_an_output * len(pair.shown), rules.unsteady_ratio * unsteady)


def with_standing(x: Explanation, standing: Sequence[Standing], habit_s: float = 0.0) -> Explanation:
    """Return an explanation with what levels tell: beside an actuator or sensor, in place of an aerodynamic factor.

    A mode that the runs lack moves cyclic levels, too, so that it stays alone unless the level of power moved; but
    where a rotor answers as behind other blades or another flow, a mode beside it is a part of that: blades that bend
    move the drive train's and the tower's modes, while neither of these makes a rotor answer late. Where channels are
    at fault levels and answers are, too. A lateness of up to habit_s, which loggers have, is what late lift looks like
    to a delay, so that the answers tell more. Wind that is uneven over the disc loads the tower each time a blade
    passes; a tower's shadow moves no mean tilt or yaw moment, so that it is a rival at most where these have moved.
    """
    if not standing or any(f.scored is not None and f.scored.hypothesis.fault for f in x.found):
        return x
    if any(s.answers for s in standing):
        x = _without(x, [f for f in x.found if (f.mode is not None and not f.edge) or _is_habit(f, habit_s)])
    kept = tuple(f for f in x.found if f.scored is None or f.scored.hypothesis.entry not in _AERODYNAMIC_FORMS)
    if any(s.cyclic for s in standing):
        passing = [f.scored for f in kept if f.scored is not None and f.scored.hypothesis.entry in _PASSING]
        kept = tuple(f for f in kept if f.scored not in passing)
        standing = [s.rivalled("tower_shadow", _SHADOW) if passing and x.lost > x.limit else s for s in standing]
    told = tuple(Found(None, None, standing=s) for s in standing if not kept or s.beside)
    if not told:
        return x
    change = x.change if len(kept) == len(x.found) else NOTHING
    for f in kept:
        if f.scored is not None and change is NOTHING:
            change = f.scored.change
    return replace(x, found=kept + told, change=change)


def _is_habit(found: Found, habit_s: float) -> bool:
    """Tell whether an effect is a lateness of no more than loggers have."""
    s = found.scored
    if s is None or s.hypothesis.entry not in LATE:
        return False
    return lateness(dict(zip(s.hypothesis.names, s.values, strict=True))) <= habit_s


def _without(x: Explanation, dropped: Sequence[Found]) -> Explanation:
    """Return an explanation without some of its effects and what they do to the data."""
    kept = tuple(f for f in x.found if f not in dropped)
    change = x.change
    if any(f.scored is not None for f in dropped):
        change = NOTHING
        for f in kept:
            change = change if f.scored is None else f.scored.change.after(change)
    return replace(x, found=kept, change=change)


def with_late_blades(x: Explanation, told: Standing) -> Explanation:
    """Return what the rotor's answers tell where nothing was found, or nothing but lift, which comes less late."""
    if any(f.scored is None or f.scored.hypothesis.entry not in AERODYNAMIC for f in x.found):
        return x
    return replace(_without(x, list(x.found)), found=(Found(None, None, standing=told),))


def without_blades_mode(pair: Pair, x: Explanation, late: bool) -> Explanation:
    """Return an explanation without modes that a rotor moves which answers its pitch angle otherwise: none is missing.

    They are of unknown kind in the blades' moments; and these or a drive train's in any output beside aerodynamics of
    the angle that are told, or where the rotor answers late and no drive of the angle is told.
    """
    turning = pair.shown[len(pair.shown) - 3 * len(pair.blades) :]
    told = {f.scored.hypothesis.entry for f in x.found if f.scored is not None and _is_of_angle(f.scored.hypothesis)}
    rotor = bool(told & set(AERODYNAMIC)) or (late and not told)
    modes = [f for f in x.found if f.mode is not None and not f.edge]
    moved = [f for f in modes if f.mode is not None and f.mode.kind in _MOVED]
    return _without(x, [f for f in moved if f.mode and (rotor or (not f.mode.kind and f.mode.output in turning))])


def _is_of_angle(h: Hypothesis) -> bool:
    return h.place.startswith("input:") and re.search(ANGLE, h.place.lower()) is not None


def angle_acts(pair: Pair, x: Explanation, factor: float) -> float:
    """Return the nats that are gained when the pitch angle acts by a factor, beside what drives and sensors do.

    Cost: one search's moments and one evaluation.
    """
    drives = [f.scored for f in x.found if f.scored is not None and f.scored.hypothesis.entry not in _AERODYNAMIC_FORMS]
    behind = NOTHING
    for s in drives:
        behind = s.change.after(behind)
    angle = next(
        (h for h in all_hypotheses(pair, {}) if h.entry == "parameter_error" and re.search(ANGLE, h.place.lower())),
        None,
    )
    return 0.0 if angle is None else Search(pair, behind).gain(angle, (factor,))[0]


def _moved(search: Search) -> dict[str, float]:
    grown = np.diag(search.covariance_at(1.0)) / np.diag(search.base.covariance)
    return {n: float(v) for n, v in zip(search.pair.shown, grown, strict=True)}


def chosen(search: Search, table: Sequence[Scored], lost: float) -> Scored | None:
    """Return the hypothesis that explains best: enough nats, the run's weight back, no simpler form as good.

    Loads that turn with the rotor are regressors of the recordings: they gain where these have lines, whatever the runs
    lack, so that they must bring the run back.
    """
    rules = in_force().run_prior
    table = [s for s in table if s.nats > max(rules.named_nats * s.hypothesis.parts, rules.least_share * lost)]
    share, of_moved = rules.explained_share, rules.moved_mode_share
    fit = [
        s for s in table
        if _brings_back(s.weight, search.base.weight)
        or (s.nats > (of_moved if s.hypothesis.of else share) * lost and s.change.extra is None)
    ]  # fmt: skip
    if not fit and table and table[0].hypothesis.wired and table[0].nats > rules.fault_share * lost:
        return table[0]  # behind swapped channels nothing else of a machine can bring the run back
    if not fit:
        return None
    return max(fit, key=lambda s: s.nats - rules.richer_nats * (len(s.values) - 1))


def _brings_back(weight: float, before: float) -> bool:
    """Tell whether the run counts more than before, or fully: an effect that leaves it as it was explains little."""
    return weight >= in_force().run_prior.held_weight and (weight > before or weight >= 1.0)


def rivals_of(best: Scored, table: Sequence[Scored]) -> tuple[Scored, ...]:
    """Return other kinds, or other places, that gain nearly as much; forms that only hold the best one are none."""
    rules = in_force().run_prior
    near = min(rules.rival_share * best.nats, best.nats - rules.rival_nats)
    return tuple(s for s in table if s is not best and s.nats > near and not _holds(s.hypothesis, best.hypothesis))


def _holds(form: Hypothesis, other: Hypothesis) -> bool:
    """Tell whether a form has another one, at the same place, as a special case."""
    return form.place == other.place and other.entry in SIMPLER.get(form.entry, ())


def _from_modes(
    modal: Modal, moved: Mapping[str, float], context: Mapping[str, Any], pair: Pair, plain: bool
) -> tuple[Found, ...]:  # fmt: skip
    """Return the mode that the runs lack: one that stands out of their spectra, then the sharpest where errors grow.

    Then the sharpest whose own frequency stands out of what is beside it, however little errors one row ahead grow.

    A pair of edgewise whirl modes is one, but where the output that shows it lacks its own mode in the runs: a tower
    that does not sway shows no blade. plain: only what stands out, where a mode that moved explains the pair.
    """
    rules = in_force().run_modes
    lone = lone_mode(pair, modal, context, FIT)
    if plain:
        return () if lone is None else (Found(None, lone),)
    turn = context.get("rated_speed_rad_s")
    if turn:
        apart = 2 * float(turn) / (2 * np.pi)
        for a in modal.absent:
            for b in modal.absent:
                pair_of = abs(b.frequency_hz - a.frequency_hz - apart) < rules.whirl_distance * apart
                if pair_of and a.output == b.output and (lone is None or lone.output != a.output):
                    middle = Absent(
                        (a.frequency_hz + b.frequency_hz) / 2, float(np.hypot(a.frequency_std_hz, b.frequency_std_hz)),
                        (a.damping + b.damping) / 2, float(np.hypot(a.damping_std, b.damping_std)), a.output,
                    )  # fmt: skip
                    return (Found(None, middle, edge=True),)
    if lone is not None:
        return (Found(None, lone),)
    most = max(moved.values())
    least = rules.shown_growth_share * most  # a mode of one output is not what moved another one more
    named = [a for a in modal.absent if a.kind and moved.get(a.output, 0.0) > max(rules.named_growth, least)]
    shown = [a for a in modal.absent if moved.get(a.output, 0.0) > least] if most > rules.shown_growth else []
    hz = float(turn) / (2 * np.pi) if turn else None
    grown = max(named, key=lambda a: moved[a.output]) if named else shown[0] if shown else None
    if grown is not None:
        return (Found(None, grown, rise=local_of(pair, grown, hz, FIT)),)
    local = ((a, local_of(pair, a, hz, FIT)) for a in modal.absent)
    return next(((Found(None, a, rise=rise),) for a, rise in local if rise is not None), ())
