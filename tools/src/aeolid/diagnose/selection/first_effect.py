"""Find the first effect: the baseline's fit, the score bank, full fits, the leader of those that is a finding."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates.candidate import Candidate, at_bound
from aeolid.diagnose.candidates.control import survives_control
from aeolid.diagnose.candidates.race import fit_rows, hopeless, is_accepted, select_density
from aeolid.diagnose.candidates.refit import finalists, renewed
from aeolid.diagnose.candidates.settle_sampling import settle, settle_beside
from aeolid.diagnose.candidates.simulated_share import by_simulation
from aeolid.diagnose.candidates.switches import paying
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.intersample import Sampling
from aeolid.diagnose.data.resample import finer
from aeolid.diagnose.deadline import Deadline, unlimited
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.hypotheses.parts.modes import highest_hz
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank, Row, overlap, score_bank
from aeolid.diagnose.selection.better_baseline import against, better_baseline, taken_up
from aeolid.diagnose.selection.close_readings import read_with
from aeolid.diagnose.selection.colour import survives_colour, survives_richer_noise
from aeolid.diagnose.selection.hidden_modes import hides_a_mode, is_beyond
from aeolid.diagnose.selection.lasting import does_not_last, explains_more
from aeolid.diagnose.selection.rivals import are_kin, leading
from aeolid.errors import NotIdentifiable

Array = NDArray[np.float64]
_AGAIN = 2  # times a better fit of the baseline is taken up
_LEADERS, _KIN = 3, 4  # best fits whose kin are fitted too, and the most of these
_FITTING = 1  # more of them, which gain more than the last of these on the fit data

Step = Callable[[str, float], Callable[[], None]]


@dataclass(frozen=True, eq=False)
class First:
    """Hold the stage, what the bank says, all that was fitted, and what leads of it; None where nothing is found."""

    prepared: Prepared
    bank: Bank
    candidates: Sequence[Candidate]
    winner: Candidate | None


def find_first(case: Case, seed: int, step: Step, deadline: Deadline | None = None) -> First:
    """Look for one effect; where what was found, if anything, does not last, with the data divided otherwise, too.

    step(name, share done) marks the beginning of a step and returns what ends it.
    """
    deadline = deadline or unlimited()
    found = _find(case, seed, step, deadline)
    if not does_not_last(found.prepared, found.winner, seed):
        return found
    try:
        again = _find(replace(case, around=True), seed, step, deadline)
    except NotIdentifiable:
        return found
    if again.prepared.deadline.passed:
        return found
    if again.winner is None:
        return _without_what_fit_data_lack(found)
    if found.winner is None or explains_more(found.prepared, found.winner, again.prepared, again.winner):
        return again
    return found


def _without_what_fit_data_lack(found: First) -> First:
    """Refuse an effect that only selection data show which are foretold badly with it, too.

    Where the model fails on these altogether, any limit of what a sensor shows explains a part of it: a hoist that took
    up a load behind the fit data was a sensor at the end of its range, by 10.5 nats there and none before.
    """
    winner = found.winner
    if winner is None or winner.fit_gain - winner.handicap > in_force().evidence.validation_nats:
        return found
    reason = f"{winner.key} explains nothing of the fit data, and too little of the selection data"
    refused = replace(winner, plausible=False, reason=reason)
    return replace(found, winner=None, candidates=[refused if c is winner else c for c in found.candidates])


def _find(case: Case, seed: int, step: Step, deadline: Deadline) -> First:
    """Look for one effect; at a finer rate again where a mode lies beyond what the rows of the first look show."""
    found = _look(case, seed, step, 0.02, None, deadline)
    while found.prepared.decimation > 1 and _is_cut_off(found):
        if deadline.skips("all of it at a finer rate, where a mode lies beyond the rows of the first look"):
            break
        again = _look(case, seed, step, 0.35, finer(found.prepared.decimation), deadline)
        if deadline.skips("the end of a look at a finer rate, which is therefore not used"):
            break
        found = again
    return _beside(case, seed, step, _faster(case, seed, step, found, deadline), deadline)


def _faster(case: Case, seed: int, step: Step, found: First, deadline: Deadline) -> First:
    """Look at a finer rate where a mode speaks there that the rows hide; kept where such a mode leads there."""
    coarse, asked = found.prepared, "modes between the rows of the first look"
    if coarse.decimation == 1 or coarse.surrogate is not None or deadline.skips(asked):
        return found
    spacing = finer(coarse.decimation)
    if not hides_a_mode(case, coarse, spacing, seed):
        return found
    again = _look(case, seed, step, 0.35, spacing, deadline)
    return found if deadline.skips(asked) or not is_beyond(again.winner, coarse) else again


def _beside(case: Case, seed: int, step: Step, found: First, deadline: Deadline) -> First:
    """Look again where the effect found shows that the inputs are to be read otherwise, and keep what is likelier.

    What the effect found was far ahead of is not fitted again: of eleven recordings with three outputs every fit took
    10 to 30 s, and a second look at twenty of them went beyond 900 s.
    """
    if found.winner is None or not (pairs := settle_beside(case, found.prepared, found.candidates)):
        return found
    best, leader = read_with(case, found.prepared, pairs, found.winner, deadline)
    sampling = best.sampling
    if sampling is None:
        return found
    behind = frozenset(c.key for c in found.candidates if hopeless(c.fit_gain, found.winner))
    again = _look(case, seed, step, 0.35, found.prepared.decimation, deadline, replace(sampling, free=False), behind)
    again = _led_on(again, leader)
    short = max(-sampling.gain, 0.0)  # nats that a plainer reading was allowed to be less likely
    if again.winner is None or again.winner.fit.log_posterior < found.winner.fit.log_posterior - short:
        return found
    lost = float(
        _select_density(found.winner, found.prepared).sum() - _select_density(again.winner, again.prepared).sum()
    )
    return found if lost > short + in_force().evidence.two_deviations_nats else again


def _led_on(again: First, leader: Candidate) -> First:
    """Return a second look in which what led the first one starts from where it ended there, too.

    Its own start may end in another optimum, for which the whole look was dropped (a fuel valve's lag, 49 nats: told as
    0.603 for 0.55 s, with the load read otherwise than it moved).
    """
    other = taken_up(again.prepared, leader)
    same = next((c for c in again.candidates if c.key == leader.key), None)
    if other is None or (same is not None and same.score >= other.score):
        return again
    candidates = sorted([other, *(c for c in again.candidates if c is not same)], key=lambda c: -c.score)
    winner, candidates = first_effect(again.prepared, candidates)
    return replace(again, candidates=candidates, winner=winner)


def _select_density(candidate: Candidate, prepared: Prepared) -> Array:
    """Return the log-density of each sample of the selection data with an effect."""
    density: Array = select_density(prepared) + candidate.select_difference
    return density


def settled_stage(case: Case, most: int | None = None, deadline: Deadline | None = None) -> Prepared:
    """Return the stage, its inputs read as the likelihood of the baseline has it.

    A habit of the logger is one in the selection data, too. A damper's hysteresis, whose force leads the motion, made
    rows 0.72 samples late, 1,352 nats on the fit data, 777 worse on the selection data, and behind that it was gone.
    """
    deadline = deadline or unlimited()
    prepared = prepare(case, most, deadline)
    sampling = None if deadline.skips("how inputs go on between samples") else settle(case, prepared)
    if sampling is None:
        return prepared
    again = prepare(case, most, deadline, sampling)
    if again.fit.log_posterior <= prepared.fit.log_posterior:
        return prepared
    lost = float(select_density(prepared).sum() - select_density(again).sum())
    return prepared if lost > in_force().evidence.two_deviations_nats else again


def _look(
    case: Case, seed: int, step: Step, share: float, most: int | None, deadline: Deadline,
    sampling: Sampling | None = None, behind: frozenset[str] = frozenset(),
) -> First:  # fmt: skip
    done = step("baseline predictor", share)
    prepared = settled_stage(case, most, deadline) if sampling is None else prepare(case, most, deadline, sampling)
    if deadline.reached and most is None:
        raise NotIdentifiable(
            f"the time limit of {deadline.limit_s:g} s ended before the baseline was fitted; give more (--time-limit)"
        )
    done()
    done = step("score bank", max(share, 0.2))
    bank = score_bank(prepared, prepared.hypotheses, seed)
    done()
    done = step("full fits", max(share, 0.3))
    prepared, bank, candidates = fit_thoroughly(prepared, bank, seed, behind)
    winner, candidates = first_effect(prepared, candidates)
    done()
    return First(prepared, bank, candidates, winner)


def _is_cut_off(found: First) -> bool:
    """Tell whether a mode that explains more than what leads ran to the highest frequency that the rows show.

    A motor that is slow alone has rows ten samples apart, and the twist of its shaft, 2.3 Hz, lay beyond: `unnamed`,
    for 325 nats on the selection data at the recording's own rate.
    """
    highest, led = highest_hz(found.prepared.site), 0.0 if found.winner is None else found.winner.score
    return any(c.score > led and _ends_at(c, highest) for c in found.candidates)


def _ends_at(candidate: Candidate, highest: float) -> bool:
    model, theta = candidate.predictor.compiled.model, candidate.fit.point.theta
    slots = [s for a in candidate.attachments for s in a.slots if s.unit == "Hz" and s.high == highest]
    return any(at_bound(float(theta[model.index(s.name)]), s) for s in slots)


def fit_thoroughly(
    prepared: Prepared, bank: Bank, seed: int, behind: frozenset[str] = frozenset()
) -> tuple[Prepared, Bank, list[Candidate]]:
    """Fit the finalists; where one leads the baseline without its effect to a better fit, go on from there.

    behind: keys of what need not be fitted.

    What is fitted is fitted once more from the better baseline and keeps the better of both; what the bank then brings
    up anew is fitted too.
    """
    fitted: dict[str, Candidate] = {}
    simulated = by_simulation(prepared, seed) if bank.loud else []
    for _ in range(_AGAIN + 1):
        rows = {r.attachment.key: r for r in [*finalists(bank), *paying(prepared, bank), *simulated]}
        fresh = [r for key, r in rows.items() if key not in fitted and key not in behind]
        fitted |= {c.key: c for c in fit_rows(prepared, fresh)}
        more = [r for r in kin(bank, list(fitted.values())) if r.attachment.key not in behind]
        fitted |= {c.key: c for c in fit_rows(prepared, more)}
        if prepared.deadline.skips("the fits once more from a better baseline"):
            break
        better = better_baseline(prepared, list(fitted.values()))
        if better is None:
            break
        density = select_density(better)
        change, prepared = select_density(prepared) - density, better
        fitted = {k: renewed(prepared, against(c, prepared, change), density) for k, c in fitted.items()}
        bank = score_bank(prepared, prepared.hypotheses, seed)
    return prepared, bank, sorted(fitted.values(), key=lambda c: -c.score)


def kin(bank: Bank, fitted: list[Candidate]) -> list[Row]:
    """Return hypotheses over the threshold that are kin to what fits best, but were not fitted yet.

    Kin share family and place, or, behind these, their scores cannot be told apart. A lag of a sensor that leads may be
    the beginning of a second-order one (805 nats for 148), and that the bending of a blade: one model by two names. One
    at the end of its range, too: a second-order filter damped by all it may be is a lag. Where none of the best is
    accepted, the first of them may stand for the same effect elsewhere, which half the threshold then brings up: of two
    tanks that run over, the second that the first one had not been told. Of one whose own value is none (sticking
    with no force in excess, 130 nats), the plainer one is meant, which was not fitted, and a mode led. One that fits
    well and fails the selection data may be the wrong member of the right family: a sensor's lag, 797 and −263 nats,
    where a filter of second order has 1,200 and 445, and a drive or a mode of 1,025 and 210 was named. What has fewer
    values and, as the catalogue says, is taken for an accepted effect at its place is kin whatever its score: of a
    spring that the fitted baseline never lets go of, play has none, and stops beside a spring five times too soft were
    named for it. The same of what ran to an end of its range, with no more values: a slider that slips at once is dry
    friction (131 nats, not credible, and friction, of which the score said little, had not been fitted). And of what
    fits best, whatever is said against it: blades set unevenly moved the tower sideways twice as far as they can (312
    nats), and a heavy blade, of the same family, had not been fitted. Where a form outside the catalogue leads, what
    speaks at its place is kin: of a drive that saturates half of the time the bent input had 197 nats, and the range,
    second of its family by the score, had not been fitted.
    """
    known = {c.key for c in fitted}
    best = max(fitted, key=lambda c: c.score, default=None)  # whatever is said against it
    meant = [c for c in fitted if c.plausible or c.at_end or c.is_plainer or (c is best and not c.undriven)]
    led = sorted((c for c in meant if c.fit_gain > 0), key=lambda c: -c.score)
    leaders, others = led[:_LEADERS], led[_LEADERS:]
    leaders += [c for c in others if c.fit_gain > leaders[-1].fit_gain][:_FITTING]
    allowed = [c for c in led if c.plausible]
    plainer = {pair: _values(c.attachments[0]) + 1 for c in leaders if c.at_end for pair in _taken_for(c)}
    accepted = [c for c in allowed[:_LEADERS] if is_accepted(c)]
    plainer |= {pair: _values(c.attachments[0]) for c in accepted for pair in _taken_for(c)}
    own, fresh = {r.attachment.key: r for r in bank.rows}, [r for r in bank.rows if r.attachment.key not in known]
    speaking = [row for row in fresh if row.z > bank.limit(row)]
    family = [r for r in speaking if any(are_kin(r.attachment, c.attachments[0]) for c in leaders)]
    family += [r for r in speaking if r not in family and any(_stands_for(c, r) for c in leaders)]
    alike = [r for r in speaking if any(_alike(r, own.get(c.key)) for c in leaders)]
    found = [*family, *(r for r in alike if r not in family)]
    found += [r for r in fresh if r not in found and _values(r.attachment) < plainer.get(_identity(r.attachment), 0)]
    if allowed and not any(is_accepted(c) for c in allowed[:_LEADERS]):
        first = allowed[0].attachments[0].entry
        same = [r for r in fresh if r not in found and r.attachment.entry == first]
        found += [r for r in same if r.z > in_force().selection.half_limit_share * bank.limit(r)]
    return found[:_KIN]


def _stands_for(leader: Candidate, row: Row) -> bool:
    """Tell whether a form outside the catalogue leads at the place of a row: what has a name there may be meant."""
    return leader.unlisted and leader.attachments[0].location["entry"] == row.attachment.location["entry"]


def _taken_for(candidate: Candidate) -> set[tuple[str, str]]:
    """Return what the catalogue says is confused with an effect, at its place."""
    first = candidate.attachments[0]
    return {(other, first.location["entry"]) for other, _ in entry(first.entry).confused_with}


def _values(attachment: Attachment) -> int:
    """Return how many values an effect has."""
    return sum(s.name not in attachment.fixed for s in attachment.slots)


def _identity(attachment: Attachment) -> tuple[str, str]:
    return attachment.entry, attachment.location["entry"]


def _alike(row: Row, other: Row | None) -> bool:
    return other is not None and overlap(row, other) > in_force().candidates.alike_cos2


def first_effect(prepared: Prepared, candidates: list[Candidate]) -> tuple[Candidate | None, list[Candidate]]:
    """Return the leading accepted candidate that is a finding, and all with those that are none marked so."""
    while (winner := leading([c for c in candidates if is_accepted(c)])) is not None:
        if not (winner.survived or survives_control(prepared, winner)):
            reason = f"{winner.key} gains as much on the simulation itself"
        elif not survives_colour(prepared, winner, candidates):
            reason = f"{winner.key} gains nothing beside noise in a band that the model lacks"
        elif not survives_richer_noise(prepared, winner):
            reason = f"{winner.key} gains nothing beside noise of a higher order"
        else:
            break
        refused = replace(winner, plausible=False, reason=reason)
        candidates = [refused if c is winner else c for c in candidates]
    return winner, candidates
