"""Look for further effects beside the first one, and leave out again what they make needless (S5)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from aeolid.diagnose.baseline.frame import carry_fit, carry_point, put_back
from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.control import survives_control
from aeolid.diagnose.candidates.race import select_density
from aeolid.diagnose.candidates.refit import as_rows, refit, zones_of
from aeolid.diagnose.candidates.slight import is_worth_a_name_beside, slight_parts
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank, Row, score_bank
from aeolid.diagnose.selection.rivals import leading

_TRIED = 3  # effects that are fitted beside those found
_AGAIN = 2  # times a set is taken up from where a larger one led it to a better fit
KIN = f"{unlisted.ID} kin"  # how the key begins of what is kin to an effect and stands beside it without a name


def further_effects(
    prepared: Prepared, winner: Candidate, rivals: Sequence[Candidate], seed: int
) -> tuple[list[Candidate], Bank]:
    """Add one effect after the other, three at most; returns the sets, smallest first, and what the bank then says.

    A linear model's wrong constants are no effects in that count; they are as many again at most. rivals: all that was
    fitted alone. A set with an effect that a later one made needless goes.
    """
    most, chain = in_force().selection.most_effects, [winner]
    while True:
        larger, bank = one_more(prepared, chain[-1], rivals, seed)
        for _ in range(_AGAIN):
            better = None if larger is None else better_fitted(prepared, chain[-1], larger)
            if larger is None or better is None:
                break
            chain[-1] = better
            if adds(better, larger):
                break
            larger, bank = one_more(prepared, better, rivals, seed)
        if larger is not None:
            chain.append(larger)
        named = [] if larger is None else [a for a in larger.attachments if a.entry != "parameter_error"]
        full = larger is None or len(named) >= most or len(larger.attachments) >= 2 * most
        if full or prepared.deadline.skips("a further effect"):
            return _needed(prepared, chain), bank


def better_fitted(prepared: Prepared, smaller: Candidate, larger: Candidate) -> Candidate | None:
    """Return the smaller set fitted from where a larger one ended, where that is the better fit; None where it is not.

    A fit that stopped short makes an effect of whatever leads it on: beside a yaw brake's friction a stiffness that
    drifts, by a fifth of its own deviation, gained 74 nats, all of them the friction's. Not on a simulator's run,
    where each fit takes half a minute.
    """
    if prepared.surrogate is not None or prepared.deadline.skips(f"{smaller.key} once more"):
        return None
    again = _fitted_without(prepared, larger, larger.attachments[-1])
    tied = in_force().evidence.tied_nats
    if again is None or not again.plausible or again.fit.log_posterior < smaller.fit.log_posterior + tied:
        return None
    return replace(again.beyond(larger), survived=smaller.survived)


def _needed(prepared: Prepared, chain: list[Candidate]) -> list[Candidate]:
    """Leave out of the largest set what is needless there, and the sets that have it.

    Not of two effects on a simulator's run, where each fit takes half a minute.
    """
    full = chain[-1]
    if len(full.attachments) < (2 if prepared.surrogate is None else in_force().selection.most_effects):
        return chain
    if prepared.deadline.skips(f"whether each effect of {full.key} is needed"):
        return chain
    smaller = without_the_needless(prepared, full)
    if smaller is full:
        return chain
    left = {a.key for a in smaller.attachments}
    return [*(c for c in chain if {a.key for a in c.attachments} <= left), smaller]


def what_is_left(prepared: Prepared, winner: Candidate, seed: int) -> Bank:
    """Score what may stand beside the effects found, with these in the model."""
    named = [a for a in prepared.hypotheses if a.entry != unlisted.ID]
    return _scored(prepared, winner, [a for a in named if all(is_another(a, b) for b in winner.attachments)], seed)


def form_beside(prepared: Prepared, chosen: Candidate, seed: int, kin_only: bool = False) -> Candidate | None:
    """Return the set with a form outside the catalogue beside it, where fit and selection data both ask for one.

    It gets no name and changes none; without it the corrected model would go on being wrong where it need not be. Of
    two tanks that run over, the lower one's outlet follows no square root: told that, the free run is half as far off.
    As nothing is named, less is asked of it than of a further effect: half the threshold against chance, too. What is
    kin to an effect and acts at its place is a form of that: a circuit's cubic spring has a small quadratic part, a lag
    that is not of first order a dead time. kin_only: no other forms.
    """
    rules = in_force().selection
    forms = [] if kin_only else [a for a in prepared.hypotheses if a.entry == unlisted.ID]
    kin = [a for a in prepared.hypotheses if any(_completes(a, b) for b in chosen.attachments)]
    forms += [replace(a, entry=unlisted.ID, key=f"{KIN} {a.key}") for a in kin]
    bank = _scored(prepared, chosen, forms, seed)
    wanted = [r for r in bank.rows if r.testable and r.z > rules.half_limit_share * bank.limit(r)][:_TRIED]
    return grown(prepared, chosen, wanted, corrects)


def _completes(a: Attachment, b: Attachment) -> bool:
    """Tell whether an effect acts where another does and is another one of its family."""
    alike = entry(a.entry).family == entry(b.entry).family and a.location["entry"] == b.location["entry"]
    return alike and a.entry != b.entry and not (a.is_switch or a.always_fit)


def _scored(prepared: Prepared, winner: Candidate, rest: Sequence[Attachment], seed: int) -> Bank:
    stage, small = prepared.only(winner.attachments), winner.predictor.compiled.model
    predictor = stage.predictor.with_order(winner.predictor.var_order or 0)
    full = winner.predictor.at(winner.fit.point, winner.fit.free)
    world = replace(stage, predictor=predictor, fit=carry_fit(full, small, stage.extended))
    return score_bank(world, tuple(rest), seed)


def one_more(
    prepared: Prepared, winner: Candidate, rivals: Sequence[Candidate], seed: int
) -> tuple[Candidate | None, Bank]:
    """Look for one more effect with those found in the model; returns the larger set, and what the bank then says.

    The best of each family, sizes only: a sign or an exchange of channels is found before any physics is. A dead zone
    at half the threshold is tried, too: free values absorb most of its score (a car's throttle, 0.14 wide). So is what
    explained nearly as much alone, whatever it scores beside. And the best of a linear model's own constants, which
    comes before all physics where it is off by no more than is usual: nearly every model's are, and what is left of
    them has many imitators (beside a joint's friction two frequencies 1.5 % off were a mass on a spring).
    """
    bank = what_is_left(prepared, winner, seed)
    sizes = [r for r in bank.loud if not r.attachment.is_switch]
    best = {entry(r.attachment.entry).family: r for r in reversed(sizes)}
    rows = sorted(best.values(), key=lambda r: -r.z)[:_TRIED]
    rows += [r for r in bank.loud if r.attachment.entry == "parameter_error" and r not in rows][:1]
    zones = [r for r in zones_of(bank) if r not in rows and r.testable]
    rows += [r for r in zones if r.z > in_force().selection.half_limit_share * bank.limit(r)][:1]
    near = _nearly_as_good(prepared, winner, [c for c in rivals if all(c.key != r.attachment.key for r in rows)])
    larger = grown(prepared, winner, rows, adds, near, [r for r in sizes if r not in rows])
    return (larger if larger is not None and _stands_beside_a_form(prepared, winner, larger, seed) else None), bank


def _stands_beside_a_form(prepared: Prepared, winner: Candidate, larger: Candidate, seed: int) -> bool:
    """Tell whether a further effect still adds where the effects found may have another form than the catalogue's.

    A circuit's spring has a small quadratic part beside the cubic one that was named; without it in the model a mode of
    0.17 Hz, its damping at the end of its range, predicted the sealed data better. Forms outside the catalogue are not
    asked: one of them is what any further effect looks like (a dead zone a bent input). Not on a simulator's run.
    """
    if prepared.surrogate is not None or prepared.deadline.skips("whether a further effect only stands for a form"):
        return True
    form = form_beside(prepared, winner, seed, kin_only=True)
    if form is None:
        return True
    stage = prepared.only((*form.attachments, larger.attachments[-1]))
    point = carry_point(form.fit.point, form.predictor.compiled.model, stage.extended)
    start = replace(form.fit, point=point, free=stage.free, jumps=())
    both = refit(stage, start, [*as_rows(form), as_rows(larger)[-1]], select_density(prepared))
    return both is not None and both.plausible and adds(form, both)


def _nearly_as_good(prepared: Prepared, winner: Candidate, rivals: Sequence[Candidate]) -> list[Row]:
    """Return the other effect that alone explains most of the fit data, where it reaches half of what the first does.

    Two that are missing bend each other's values: the upper of two tanks that run over was given a brim at which all
    is spilt that either spills, and there the lower one scored 1.5. Not on a simulator's run, where a fit takes long.
    """
    rules = in_force().selection
    if prepared.surrogate is not None or len(winner.attachments) > 1:
        return []
    others = [
        c for c in rivals
        if c.plausible and c.complete and not c.unlisted and not c.attachments[0].is_switch
        and c.fit_gain > rules.nearly_share * winner.fit_gain and is_another(c.attachments[0], winner.attachments[0])
    ]  # fmt: skip
    return as_rows(max(others, key=lambda c: c.fit_gain)) if others else []


def grown(
    prepared: Prepared, winner: Candidate, rows: Sequence[Row], helps: Callable[[Candidate, Candidate], bool],
    near: Sequence[Row] = (), instead: Sequence[Row] = (),
) -> Candidate | None:  # fmt: skip
    """Fit each beside the set; returns the best larger set that helps, counted from the bare model.

    near: further rows, that start from the simulation error, too. instead: rows of which the best of a family is fitted
    where another of that family has values that cannot be (stiction that sticks by none of its friction, ahead of dry
    friction by 0.1: neither was added, and a drive that rings had a dead time's name without it).
    """
    found: list[Candidate] = []
    for row in (*rows, *near):
        larger = _with_row(prepared, winner, row, instead, simulated=row in near)
        if larger is None or not is_worth_a_name_beside(larger, larger.attachments[-1]):
            continue
        if helps(winner, larger):
            found.append(larger)
    while (best := leading([c for c in found if is_slight_beside(c)] or found)) is not None:
        if survives_control(prepared, best):  # by what it gains beyond the smaller set: that is at stake
            return best.beyond(winner)
        found.remove(best)
    return None


def _with_row(
    prepared: Prepared, winner: Candidate, row: Row, instead: Sequence[Row], simulated: bool
) -> Candidate | None:
    """Fit one more beside the set, from where that stands, or another of its family; None where no values can be."""
    small, family = winner.predictor.compiled.model, entry(row.attachment.entry).family
    kin = [r for r in instead if entry(r.attachment.entry).family == family]
    for tried in (row, *kin[:1]):
        if prepared.deadline.skips(f"{tried.attachment.key} beside {winner.key}"):
            return None
        prepared.deadline.doing(f"{tried.attachment.key} beside {winner.key}")
        both = prepared.only((*winner.attachments, tried.attachment))
        base = replace(winner.fit, point=carry_point(winner.fit.point, small, both.extended), free=both.free, jumps=())
        larger = refit(both, base, [*as_rows(winner), tried], select_density(prepared), simulated=simulated)
        if larger is not None and larger.plausible:
            return larger
    return None


def is_slight_beside(larger: Candidate) -> bool:
    """Tell whether what was added last is a constant of a linear model that is off by no more than is usual."""
    return larger.attachments[-1] in slight_parts(larger)


def without_the_needless(prepared: Prepared, full: Candidate) -> Candidate:
    """Leave out effects, the last one excepted, that the later ones made needless (backward elimination)."""
    evidence = in_force().evidence
    for left_out in full.attachments[:-1]:
        smaller = _fitted_without(prepared, full, left_out)
        if smaller is None or not smaller.plausible:
            continue
        lost = full.fit.log_posterior - smaller.fit.log_posterior, full.select_gain - smaller.select_gain
        if max(lost) < evidence.validation_nats:
            return smaller.beyond(full)
    return full


def _fitted_without(prepared: Prepared, full: Candidate, left_out: Attachment) -> Candidate | None:
    """Fit a set without one of its effects, from where it ended; gains count from the set's own fit."""
    kept = tuple(a for a in full.attachments if a is not left_out)
    stage = prepared.only(kept)
    carried = carry_point(full.fit.point, full.predictor.compiled.model, stage.extended)
    point = put_back(carried, stage.extended, left_out, kept)
    rows = [r for r in as_rows(full) if r.attachment.key != left_out.key]
    start = replace(full.fit, point=point, free=stage.free, jumps=())
    return refit(stage, start, rows, select_density(prepared))


def adds(fewer: Candidate, more: Candidate) -> bool:
    """Tell whether a further effect explains more: on the selection data, or where these are silent.

    A part in which the further effect never acts (a tank that does not run over) can neither show nor refute it; then
    the gain on the fit data must be beyond doubt, and the sealed data have the last word as always.
    """
    rules = in_force().selection
    evidence = in_force().evidence
    added = more.select_gain - fewer.select_gain
    difference = more.select_difference - fewer.select_difference
    spread = evidence.one_percent_z * float(np.sqrt(len(difference)) * np.std(difference))
    if added > max(evidence.validation_nats, spread, rules.further_share * fewer.select_gain):
        return True
    gained = more.fit.log_posterior - fewer.fit.log_posterior
    clear = gained > max(evidence.clear_nats, rules.further_share * fewer.fit_gain)
    if added > max(evidence.validation_nats, rules.further_share * fewer.select_gain) and clear:
        return True
    return abs(added) < spread and gained > max(rules.beyond_doubt_nats, rules.further_share * fewer.fit_gain)


def corrects(fewer: Candidate, more: Candidate) -> bool:
    """Tell whether what was added predicts better on the fit data, beyond its handicap, and on the selection data.

    more: counted from the smaller set, as refitted beside it.
    """
    gained = more.fit.log_posterior - fewer.fit.log_posterior - more.handicap
    return min(gained, more.select_gain - fewer.select_gain) > in_force().evidence.validation_nats


def is_another(a: Attachment, b: Attachment) -> bool:
    """Tell whether an effect may stand beside another: of another family, or the same effect at another place.

    A lag and a delay of one input are one drive of higher order. A force on a mode of a linear model and the same on
    a body that the mode moves are one force; frequency and damping of a mode are two constants.
    """
    if {a.entry, b.entry} == {"parameter_error"}:
        return a.key != b.key
    places = a.location["entry"], b.location["entry"]
    one_force = {p.split(":")[0] for p in places} == {"mode", "state"}
    same_elsewhere = a.entry == b.entry and places[0] != places[1] and not one_force
    return same_elsewhere or entry(a.entry).family != entry(b.entry).family
