"""Run a diagnosis from a case directory to a verdict (S0 to S8)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.baseline.recorded_wind import wind_findings
from aeolid.diagnose.baseline.ridges import ridge_findings
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.control import survives_control
from aeolid.diagnose.candidates.moved import Moved
from aeolid.diagnose.candidates.race import fit_finalists, fit_whispering, is_accepted
from aeolid.diagnose.candidates.reestimate import baseline_of_all, estimated_on_all
from aeolid.diagnose.candidates.simulated_share import is_static
from aeolid.diagnose.candidates.slight import is_slight
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import Finding, examine
from aeolid.diagnose.data.intersample import sampling_findings
from aeolid.diagnose.deadline import Deadline, unlimited
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.localise.deficiency import deficient
from aeolid.diagnose.localise.detect import Ceiling, band_power, ceiling
from aeolid.diagnose.localise.expected import evidence_in_loop
from aeolid.diagnose.localise.locate import evidence_cells
from aeolid.diagnose.localise.paths import evidence_paths
from aeolid.diagnose.predictor.point import Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank, score_bank
from aeolid.diagnose.selection.beside_constants import settled_beside_constants
from aeolid.diagnose.selection.beside_rivals import further_beside_any
from aeolid.diagnose.selection.exchange import Alternative, exchanged
from aeolid.diagnose.selection.first_effect import find_first, first_effect
from aeolid.diagnose.selection.lasting import worsening
from aeolid.diagnose.selection.rivals import outdone_by
from aeolid.diagnose.selection.several import what_is_left
from aeolid.diagnose.validation.adequate import is_adequate_alone
from aeolid.diagnose.validation.beyond import form_beyond
from aeolid.diagnose.validation.in_turn import decided_in_turn
from aeolid.diagnose.validation.proof import Proof, imitate, is_material, prove, seen_before
from aeolid.diagnose.validation.rotation import Rotation, is_silent, rotate
from aeolid.diagnose.validation.sealed import Held, declared_against, hold_against, hold_leader
from aeolid.diagnose.validation.told_deviations import with_told_deviations
from aeolid.diagnose.validation.unsure_constants import declared_beside_constants

Array = NDArray[np.float64]

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Alone:
    """Hold what may be all there is beside an effect that was chosen, and its own proof."""

    candidate: Candidate
    proof: Proof


@dataclass(frozen=True, eq=False)
class Study:
    """Hold everything the verdict is drawn from.

    prepared: the stage of the fit data; unsealed: the bare one of all data but the sealed; declared_values: what the
    latter fits, with deviations that hold what constants leave open, the surest move first.
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
    declared_values: tuple[Moved, ...]
    ceiling: Ceiling
    bands: list[dict[str, object]]
    cells: dict[str, list[dict[str, Any]]]
    equations: list[dict[str, Any]]
    after_bank: Bank | None
    sham: tuple[int, int, tuple[float, ...]]
    rotation: Rotation | None = None  # each part of all data held out once
    completed: Candidate | None = None  # what was found, and beside it a form outside the catalogue
    shows_elsewhere: bool = False  # what sealed data prove, and hardly show, is visible in the data of the fit
    foretold_worse: float = 0.0  # nats a sample that the bare model loses, at least, on all data but those of the fit
    adequate: bool = False  # the bare model errs on all data, at any time ahead, by no more than a model's constants do
    constants: Alone | None = None  # a linear model's constant that alone explains much of what is named
    timing_s: dict[str, float] = field(default_factory=dict)
    deadline: Deadline = field(default_factory=unlimited)

    @property
    def whole(self) -> Candidate | None:
        """Return the largest set that the sealed data bear out: what the proof and the corrected model are of."""
        return self.completed or self.second or self.winner


def study(
    case: Case, *, sham: int, seed: int, progress: Progress, deadline: Deadline | None = None,
    findings: tuple[Finding, ...] | None = None,
) -> Study:  # fmt: skip
    """Do all steps in order; `progress(text, share done)` is called between them. Same input and seed, same answer.

    deadline: when what was found so far is proven and returned, never by default; it says what was not tried. findings:
    what the recordings showed before samples were left out of them; they are examined here by default.
    """
    timing: dict[str, float] = {}
    deadline = deadline or unlimited()

    def step(name: str, share: float) -> Callable[[], None]:
        progress(name, share)
        deadline.enter(name)
        begun = time.perf_counter()
        return lambda: timing.__setitem__(name, round(timing.get(name, 0.0) + time.perf_counter() - begun, 3))

    done = step("forensics", 0.0)
    findings = examine(case.records, case.baseline) if findings is None else findings
    done()
    first = find_first(case, seed, step, deadline)
    prepared, bank, winner, candidates = first.prepared, first.bank, first.winner, first.candidates
    findings += _of_the_stage(case, prepared)
    done = step("second effect", 0.5)
    top = ceiling(prepared.only(()), prepared.split.sealed)
    chain, others, after_bank = _all_effects(prepared, winner, candidates, top, seed)
    done()
    done = step("sealed proof", 0.6)
    unsealed = baseline_of_all(prepared)
    held, forms = _proven(prepared, unsealed, candidates, chain, seed)
    declared, heard = _accused(prepared, unsealed, bank, candidates, seed)
    turned = None if held.single is None else rotate(prepared, bank, candidates, held.single, seed)
    held, turned = decided_in_turn(prepared, unsealed, held, chain, candidates, turned, seed)
    done()
    done = step("evidence", 0.68)
    bands, cells, equations = _evidence(prepared, case, seed)
    done()
    done = step("sham runs", 0.7)
    runs = _sham(prepared, bank, sham, seed, lambda k: progress("sham runs", 0.7 + 0.3 * k / max(sham, 1)))
    done()
    step("writing", 1.0)
    held, listed, others = with_told_deviations(prepared, held, (*candidates, *forms, *heard), others)
    return Study(
        case, seed, findings, prepared, unsealed, bank, listed, held.single, held.several, others, held.proof,
        declared, declared_beside_constants(unsealed), top, bands, cells, equations, after_bank, runs, turned,
        held.completed, *_what_shows(prepared, unsealed, held, turned, candidates, seed), timing, deadline,
    )  # fmt: skip


def _what_shows(
    prepared: Prepared, unsealed: Prepared, held: Held, turned: Rotation | None, candidates: Sequence[Candidate],
    seed: int,
) -> tuple[bool, float, bool, Alone | None]:  # fmt: skip
    """Return how what was found, and what is missing, shows in predictions; in the order of the study's fields."""
    return (
        _shows_elsewhere(prepared, unsealed, held, turned, seed),
        worsening(prepared, unsealed, seed),
        is_adequate_alone(prepared, unsealed, seed),
        _constants_alone(prepared, unsealed, held, candidates, seed),
    )


def _of_the_stage(case: Case, prepared: Prepared) -> tuple[Finding, ...]:
    """Return what a stage knows of wind, of how inputs go on between their samples, of values that were held."""
    read = sampling_findings(prepared.records, prepared.sampling, prepared.records[0].sample_time_s)
    held = ridge_findings(case.baseline, prepared.declared)
    return (*wind_findings(case.records, prepared.declared), *read, *held)


def _evidence(
    prepared: Prepared, case: Case, seed: int
) -> tuple[list[dict[str, object]], dict[str, list[dict[str, Any]]], list[dict[str, Any]]]:
    """Return where the misfit lies by frequency, by time and place, and by equation; nothing once time is over."""
    cells: dict[str, list[dict[str, Any]]] = {}
    if not prepared.deadline.skips("where in time and place the misfit lies"):
        cells = evidence_cells(prepared, case, seed) | {"path": evidence_paths(prepared)}
        cells |= evidence_in_loop(prepared, seed)
    told = [] if prepared.deadline.skips("which equations are short of something") else deficient(prepared, seed)
    return band_power(prepared.predictor, prepared.fit, seed), cells, told


def _proven(
    prepared: Prepared, unsealed: Prepared, candidates: Sequence[Candidate], chain: Sequence[Candidate], seed: int
) -> tuple[Held, list[Candidate]]:
    """Hold the sets against the sealed data, or the form that takes their place; returns also all forms fitted."""
    held = hold_leader(prepared, unsealed, chain, candidates, seed)
    if prepared.deadline.skips("forms outside the catalogue"):
        return held, []
    keys = {c.key for c in held.sets[held.kept : held.kept + 1]}
    named = [c for c in (*chain, *candidates) if c.key in keys][:1]  # as chosen: a rival may have taken the lead
    form, forms = form_beyond(prepared, candidates, named, held.proof, seed)
    return (held if form is None else hold_against(prepared, unsealed, [form], seed)), forms


def _shows_elsewhere(
    prepared: Prepared, unsealed: Prepared, held: Held, turned: Rotation | None, seed: int
) -> bool:  # fmt: skip
    """Tell whether the data of fit and selection show what the sealed ones, or all in turn, prove but hardly show.

    A sensor's range may be reached a hundred times in the one part and twice in the other (174 nats sealed; one row
    ahead 0.113 of the spread became 0.012 elsewhere, 0.0172 became 0.0169 there).
    """
    evidence = in_force().evidence
    static = is_static(prepared)
    if held.proof is None or is_material(held.proof, static):
        return False
    silent = turned is not None and turned.proves and is_silent(held.proof.interval)
    if held.proof.interval[0] <= evidence.proven_nats and not silent:
        return False
    found = held.completed or held.sets[held.kept]
    before, after = (unsealed.predictor, unsealed.fit), (found.predictor, found.fit)
    parts = seen_before((*prepared.split.fit, *prepared.split.select), prepared.settle_s)
    return is_material(prove(before, after, parts, prepared.settle_s, seed), static)


def _constants_alone(
    prepared: Prepared, unsealed: Prepared, held: Held, candidates: Sequence[Candidate], seed: int
) -> Alone | None:
    """Return the linear model's constant, off by no more than usual, that alone explains much of what was chosen.

    What is chosen beside such a constant, or in its place, must show beyond it: a loop of 535 nats was 29 ahead of a
    frequency 1.3 % off, and foretold no output better than that.
    """
    found = held.single
    if (
        found is None
        or held.proof is None
        or is_slight(found)
        or prepared.linear is None
        or prepared.surrogate is not None
    ):
        return None
    share = in_force().selection.nearly_share
    slight = [c for c in candidates if c.plausible and c.complete and is_slight(c) and c.score > share * found.score]
    if not slight:
        return None
    best = estimated_on_all(prepared, max(slight, key=lambda c: c.score))
    before, after = (unsealed.predictor, unsealed.fit), (best.predictor, best.fit)
    return Alone(best, prove(before, after, prepared.split.sealed, prepared.settle_s, seed))


def _accused(
    prepared: Prepared, unsealed: Prepared, bank: Bank, candidates: Sequence[Candidate], seed: int
) -> tuple[Proof | None, list[Candidate]]:
    """Hold the declared values against the sealed data; where these accuse them, fit also what only whispers."""
    evidence = in_force().evidence
    declared = declared_against(unsealed, seed)
    if (
        declared is None
        or declared.interval[0] <= evidence.proven_nats
        or prepared.deadline.skips("effects under the threshold")
    ):
        return declared, []
    return declared, fit_whispering(prepared, bank, candidates)


def _all_effects(
    prepared: Prepared, winner: Candidate | None, candidates: Sequence[Candidate], top: Ceiling, seed: int
) -> tuple[list[Candidate], tuple[Alternative, ...], Bank | None]:
    """Return the sets, smallest first, what the data do not tell from the largest, and what the bank then says.

    A form outside the catalogue that explains far more takes their place.
    """
    chain, after_bank = _further(prepared, winner, candidates, top, seed)
    chain, beside = settled_beside_constants(prepared, chain, candidates, seed)
    chain, others = _exchanged(prepared, chain, candidates)
    own, known = {a.key for c in chain[-1:] for a in c.attachments}, {a.attachment.key for a in others}
    others += tuple(a for a in beside if a.replaces in own and a.attachment.key not in known)
    form = _better_form(prepared, candidates, chain)
    return (chain if form is None else [form]), others, after_bank


def _further(
    prepared: Prepared, winner: Candidate | None, candidates: Sequence[Candidate], top: Ceiling, seed: int
) -> tuple[list[Candidate], Bank | None]:
    """Look for effects beside the first one; returns the sets, smallest first, and what the bank then says.

    On a simulator's run none are fitted where the first one explains more than a model-free correction does.
    """
    if winner is None:
        return [], None
    if winner.unlisted or prepared.deadline.skips("effects beside the first one"):
        return [winner], None
    if prepared.surrogate is not None and winner.select_gain > float(top.select.sum()):
        return [winner], what_is_left(prepared, winner, seed)
    return further_beside_any(prepared, winner, candidates, seed)


def _exchanged(
    prepared: Prepared, chain: list[Candidate], candidates: Sequence[Candidate]
) -> tuple[list[Candidate], tuple[Alternative, ...]]:
    """Let each effect of the largest set give way to a better one; returns also what the data do not tell from it."""
    if not chain or prepared.deadline.skips("others in the place of each effect"):
        return chain, ()
    best, alternatives = exchanged(prepared, chain[-1], candidates)
    return [*chain[:-1], best], alternatives


def _better_form(prepared: Prepared, candidates: Sequence[Candidate], chain: Sequence[Candidate]) -> Candidate | None:
    """Return the form outside the catalogue that explains far more than all effects found together, if one does."""
    form = outdone_by(candidates, chain[-1]) if chain else None
    if form is None or not form.unlisted or not is_accepted(form):
        return None
    return form if form.survived or survives_control(prepared, form) else None


def _sham(
    prepared: Prepared, bank: Bank, count: int, seed: int, tick: Callable[[int], None]
) -> tuple[int, int, tuple[float, ...]]:
    """Run fit, bank, finalists and acceptance on imitations of the baseline; count what would have been named.

    The threshold is that of the recording, from its own bootstrap: an imitation has the same inputs, length and noise.
    Full fits follow only where the bank speaks. Returns how many were run, how many named something, and the largest z
    of each; fewer than `count` where the time ends.
    """
    tested = [a for a in prepared.hypotheses if not a.always_fit and a.entry != unlisted.ID]
    hits, largest, run = 0, [], 0
    prepared = prepared.only(())
    _, select, select_point = prepared.predictor.score_elsewhere(prepared.fit, prepared.split.select)
    for k in range(count):
        if prepared.deadline.skips("sham runs"):
            break
        run = k + 1
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
    return run, hits, tuple(largest)
