"""Run a diagnosis from a case directory to a verdict (S0 to S8)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.beyond import form_beyond
from aeolid.diagnose.candidate import Candidate
from aeolid.diagnose.case import Case
from aeolid.diagnose.catalogue import unlisted
from aeolid.diagnose.colour import survives_colour
from aeolid.diagnose.control import survives_control
from aeolid.diagnose.detect import Ceiling, band_power, ceiling
from aeolid.diagnose.exchange import Alternative, exchanged
from aeolid.diagnose.explore import fit_quietly
from aeolid.diagnose.forensics import Finding, examine
from aeolid.diagnose.frame import carry_point
from aeolid.diagnose.point import Point
from aeolid.diagnose.predictor import Predictor
from aeolid.diagnose.prepare import Prepared, prepare
from aeolid.diagnose.proof import PROVEN, Proof, imitate
from aeolid.diagnose.race import fit_finalists, fit_rows, fit_whispering, is_accepted, select_density
from aeolid.diagnose.reestimate import baseline_of_all
from aeolid.diagnose.refit import ALIKE, finalists, renewed
from aeolid.diagnose.rivals import are_kin, leading, outdone_by
from aeolid.diagnose.scores import Bank, Row, overlap, score_bank
from aeolid.diagnose.sealed import Held, declared_against, hold_against
from aeolid.diagnose.several import further_effects, what_is_left
from aeolid.diagnose.switches import paying

Array = NDArray[np.float64]
_SHORT = 1.0  # nats by which a fit of the baseline may be short of the best that is known
_TRIFLE = 0.1  # share of the leader's gain below which a better baseline is not taken up
_AGAIN = 2  # times a better fit of the baseline is taken up
_LEADERS, _KIN = 3, 4  # best fits whose kin are fitted too, and the most of these

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Study:
    """Hold everything the verdict is drawn from.

    prepared: the stage of the fit data; unsealed: the bare one of all data but the sealed.
    """

    case: Case
    seed: int
    findings: tuple[Finding, ...]
    prepared: Prepared
    unsealed: Prepared
    bank: Bank
    candidates: tuple[Candidate, ...]
    winner: Candidate | None
    second: Candidate | None
    alternatives: tuple[Alternative, ...]
    proof: Proof | None
    declared_proof: Proof | None
    ceiling: Ceiling
    bands: list[dict[str, object]]
    after_bank: Bank | None
    sham: tuple[int, int, tuple[float, ...]]
    completed: Candidate | None = None  # what was found, and beside it a form outside the catalogue
    timing_s: dict[str, float] = field(default_factory=dict)

    @property
    def whole(self) -> Candidate | None:
        """Return the largest set that the sealed data bear out: what the proof and the corrected model are of."""
        return self.completed or self.second or self.winner


def study(case: Case, *, sham: int, seed: int, progress: Progress) -> Study:
    """Do all steps in order; `progress(text, share done)` is called between them. Same input and seed, same answer."""
    timing: dict[str, float] = {}

    def step(name: str, share: float) -> Callable[[], None]:
        progress(name, share)
        begun = time.perf_counter()
        return lambda: timing.__setitem__(name, round(time.perf_counter() - begun, 3))

    done = step("forensics", 0.0)
    findings = examine(case.records, case.baseline)
    done()
    done = step("baseline predictor", 0.02)
    prepared = prepare(case)
    done()
    done = step("score bank", 0.2)
    bank = score_bank(prepared, prepared.hypotheses, seed)
    done()
    done = step("full fits", 0.3)
    prepared, bank, candidates = fit_thoroughly(prepared, bank, seed)
    winner, candidates = first_effect(prepared, candidates)
    done()
    done = step("second effect", 0.5)
    top = ceiling(prepared.only(()), prepared.split.sealed)
    chain, others, after_bank = _all_effects(prepared, winner, candidates, top, seed)
    done()
    done = step("sealed proof", 0.6)
    unsealed = baseline_of_all(prepared)
    held, forms = _proven(prepared, unsealed, candidates, chain, seed)
    declared, heard = _accused(prepared, unsealed, bank, candidates, seed)
    bands = band_power(prepared.predictor, prepared.fit, seed)
    done()
    done = step("sham runs", 0.7)
    hits, largest = _sham(prepared, bank, sham, seed, lambda k: progress("sham runs", 0.7 + 0.3 * k / max(sham, 1)))
    done()
    progress("done", 1.0)
    own = {c.key: c for c in [held.single] if c is not None}
    return Study(
        case, seed, findings, prepared, unsealed, bank, tuple(own.get(c.key, c) for c in (*candidates, *forms, *heard)),
        held.single, held.several, others if held.several is not None and held.is_largest else (), held.proof,
        declared, top, bands, after_bank, (sham, hits, tuple(largest)), held.completed, timing,
    )  # fmt: skip


def _proven(
    prepared: Prepared, unsealed: Prepared, candidates: Sequence[Candidate], chain: Sequence[Candidate], seed: int
) -> tuple[Held, list[Candidate]]:
    """Hold the sets against the sealed data, or the form that takes their place; returns also all forms fitted."""
    held = hold_against(prepared, unsealed, chain, seed)
    form, forms = form_beyond(prepared, candidates, chain[held.kept : held.kept + 1], held.proof, seed)
    return (held if form is None else hold_against(prepared, unsealed, [form], seed)), forms


def _accused(
    prepared: Prepared, unsealed: Prepared, bank: Bank, candidates: Sequence[Candidate], seed: int
) -> tuple[Proof | None, list[Candidate]]:
    """Hold the declared values against the sealed data; where these accuse them, fit also what only whispers."""
    declared = declared_against(unsealed, seed)
    if declared is None or declared.interval[0] <= PROVEN:
        return declared, []
    return declared, fit_whispering(prepared, bank, candidates)


def _all_effects(
    prepared: Prepared, winner: Candidate | None, candidates: Sequence[Candidate], top: Ceiling, seed: int
) -> tuple[list[Candidate], tuple[Alternative, ...], Bank | None]:
    """Look for effects beside the winner; a form outside the catalogue that explains far more takes their place.

    Returns the sets, smallest first, what the data do not tell from the largest, what the bank then says.
    """
    chain, after_bank = _further(prepared, winner, top, seed)
    chain, others = _exchanged(prepared, chain, candidates)
    form = _better_form(prepared, candidates, chain)
    return (chain if form is None else [form]), others, after_bank


def _further(
    prepared: Prepared, winner: Candidate | None, top: Ceiling, seed: int
) -> tuple[list[Candidate], Bank | None]:
    """Look for effects beside the first one; returns the sets, smallest first, and what the bank then says.

    On a simulator's run, where each fit takes half a minute, none are fitted where the first one already explains more
    of the selection data than a model-free correction does.
    """
    if winner is None:
        return [], None
    if winner.unlisted:
        return [winner], None
    if prepared.surrogate is not None and winner.select_gain > float(top.select.sum()):
        return [winner], what_is_left(prepared, winner, seed)
    return further_effects(prepared, winner, seed)


def _exchanged(
    prepared: Prepared, chain: list[Candidate], candidates: Sequence[Candidate]
) -> tuple[list[Candidate], tuple[Alternative, ...]]:
    """Let each effect of the largest set give way to a better one; returns also what the data do not tell from it."""
    if not chain:
        return [], ()
    best, alternatives = exchanged(prepared, chain[-1], candidates)
    return [*chain[:-1], best], alternatives


def _better_form(prepared: Prepared, candidates: Sequence[Candidate], chain: Sequence[Candidate]) -> Candidate | None:
    """Return the form outside the catalogue that explains far more than all effects found together, if one does."""
    form = outdone_by(candidates, chain[-1]) if chain else None
    if form is None or not form.unlisted or not is_accepted(form):
        return None
    return form if form.survived or survives_control(prepared, form) else None


def fit_thoroughly(prepared: Prepared, bank: Bank, seed: int) -> tuple[Prepared, Bank, list[Candidate]]:
    """Fit the finalists; where one leads the baseline without its effect to a better fit, go on from there.

    What is fitted is fitted once more from the better baseline and keeps the better of both; what the bank then brings
    up anew is fitted too.
    """
    fitted: dict[str, Candidate] = {}
    for _ in range(_AGAIN + 1):
        rows = {r.attachment.key: r for r in [*finalists(bank), *paying(prepared, bank)]}
        fresh = [r for key, r in rows.items() if key not in fitted]
        fitted |= {c.key: c for c in fit_rows(prepared, fresh)}
        fitted |= {c.key: c for c in fit_rows(prepared, kin(bank, list(fitted.values())))}
        better = better_baseline(prepared, list(fitted.values()))
        if better is None or _is_trifling(better.fit.log_posterior - prepared.fit.log_posterior, list(fitted.values())):
            break
        density = select_density(better)
        change, prepared = select_density(prepared) - density, better
        fitted = {k: renewed(prepared, against(c, prepared, change), density) for k, c in fitted.items()}
        bank = score_bank(prepared, prepared.hypotheses, seed)
    return prepared, bank, sorted(fitted.values(), key=lambda c: -c.score)


def kin(bank: Bank, fitted: list[Candidate]) -> list[Row]:
    """Return hypotheses over the threshold that are kin to what fits best, but were not fitted yet.

    Kin share family and place, or their scores cannot be told apart. A lag of a sensor that leads may be the beginning
    of a second-order one (805 nats for 148), and that the bending of a blade: one model by two names. One at the end of
    its range, too: a second-order filter damped by all it may be is a lag. Where none of the best is accepted, the
    first of them may stand for the same effect elsewhere, which half the threshold then brings up: of two tanks that
    run over, the second that the first one had not been told.
    """
    known = {c.key for c in fitted}
    led = sorted((c for c in fitted if (c.plausible or c.at_end) and c.fit_gain > 0), key=lambda c: -c.score)
    leaders, allowed = led[:_LEADERS], [c for c in led if c.plausible]
    own, fresh = {r.attachment.key: r for r in bank.rows}, [r for r in bank.rows if r.attachment.key not in known]
    found = [
        row for row in fresh
        if row.z > bank.limit(row)
        and any(are_kin(row.attachment, c.attachments[0]) or _alike(row, own.get(c.key)) for c in leaders)
    ]  # fmt: skip
    if allowed and not any(is_accepted(c) for c in allowed[:_LEADERS]):
        first = allowed[0].attachments[0].entry
        found += [r for r in fresh if r not in found and r.attachment.entry == first and r.z > 0.5 * bank.limit(r)]
    return found[:_KIN]


def _alike(row: Row, other: Row | None) -> bool:
    return other is not None and overlap(row, other) > ALIKE


def _is_trifling(shortfall: float, fitted: list[Candidate]) -> bool:
    """Tell whether a baseline this much better changes nothing: an effect that survived the control dwarfs it."""
    return shortfall < _TRIFLE * max((c.fit_gain for c in fitted if c.survived), default=0.0)


def against(candidate: Candidate, prepared: Prepared, change: Array) -> Candidate:
    """Return a candidate measured against another fit of the baseline; change: old less new density of each sample."""
    difference = candidate.select_difference + change
    gain = candidate.fit.log_posterior - prepared.fit.log_posterior
    return replace(candidate, fit_gain=gain, select_gain=float(difference.sum()), select_difference=difference)


def better_baseline(prepared: Prepared, candidates: list[Candidate]) -> Prepared | None:
    """Return the stage with a better fit of the baseline, found where a candidate ended; None where there is none.

    A fit that stopped short would make a finding of what any further step gains (110 nats on a recording that lacks
    nothing).
    """
    bare = prepared.only(())
    points = [
        _without_effects(carry_point(c.fit.point, c.predictor.compiled.model, bare.extended), bare) for c in candidates
    ]
    starts = sorted(points, key=bare.predictor.objective)[:1]
    if not starts or bare.predictor.objective(starts[0]) > bare.predictor.objective(bare.fit.point) - _SHORT:
        return None
    predictor = bare.predictor.with_order(bare.predictor.choose_var_order(starts[0]))
    fit = fit_quietly(predictor, starts[0], bare.free)
    if fit is None or fit.log_posterior < bare.fit.log_posterior + _SHORT:
        return None
    return replace(bare, predictor=predictor, fit=fit)


def _without_effects(point: Point, bare: Prepared) -> Point:
    """Return the point with every parameter that the baseline holds at its declared value: an effect may move some."""
    theta = bare.fit.point.theta.copy()
    free = list(bare.free.theta)
    theta[free] = point.theta[free]
    return replace(point, theta=theta)


def first_effect(prepared: Prepared, candidates: list[Candidate]) -> tuple[Candidate | None, list[Candidate]]:
    """Return the leading accepted candidate that is a finding, and all with those that are none marked so."""
    while (winner := leading([c for c in candidates if is_accepted(c)])) is not None:
        if not (winner.survived or survives_control(prepared, winner)):
            reason = f"{winner.key} gains as much on the simulation itself"
        elif not survives_colour(prepared, winner, candidates):
            reason = f"{winner.key} gains nothing beside noise in a band that the model lacks"
        else:
            break
        refused = replace(winner, plausible=False, reason=reason)
        candidates = [refused if c is winner else c for c in candidates]
    return winner, candidates


def _sham(
    prepared: Prepared, bank: Bank, count: int, seed: int, tick: Callable[[int], None]
) -> tuple[int, list[float]]:
    """Run fit, bank, finalists and acceptance on imitations of the baseline; count what would have been named.

    The threshold is that of the recording, from its own bootstrap: an imitation has the same inputs, length and noise.
    Full fits follow only where the bank speaks.
    """
    tested = [a for a in prepared.hypotheses if not a.always_fit and a.entry != unlisted.ID]
    hits, largest = 0, []
    prepared = prepared.only(())
    _, select, select_point = prepared.predictor.score_elsewhere(prepared.fit, prepared.split.select)
    for k in range(count):
        rng = np.random.default_rng((seed, k))
        fit_part = imitate(prepared.predictor, prepared.fit, prepared.split.fit, prepared.fit.point, rng)
        select_part = imitate(select, prepared.fit, prepared.split.select, select_point, rng)
        tick(k + 1)
        predictor: Predictor = prepared.predictor.on(fit_part).informed(
            prepared.predictor.scales.prior.redrawn(prepared.fit.point.theta, rng)
        )
        start: Point = prepared.fit.point
        fit = predictor.fit(start, prepared.free, iterations=8)
        if fit is None:
            continue
        split = replace(prepared.split, fit=tuple(fit_part), select=tuple(select_part))
        world = replace(prepared, predictor=predictor, fit=fit, split=split)
        own = score_bank(world, tested, seed + k, known=bank)
        top = own.rows[0].z if own.rows else -np.inf
        largest.append(float(top) if np.isfinite(top) else 0.0)
        if own.loud and first_effect(world, fit_finalists(world, own, most=2))[0] is not None:
            hits += 1
    return hits, largest
