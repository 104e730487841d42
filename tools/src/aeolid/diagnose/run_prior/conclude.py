"""Diagnose a simulator's run against recordings and write what a diagnosis leaves behind."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.diagnose.conclusion.export import write_found
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import Finding
from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.data.rotor_frame import blade_sets
from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.hypotheses.parts.lateness import LATE, lateness
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.rules.declaring import quoted
from aeolid.diagnose.run_prior.answering import is_late_rotor, is_other_rotor, left_late, told_apart
from aeolid.diagnose.run_prior.beside import with_beside
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.corrected import corrected_model
from aeolid.diagnose.run_prior.displaced import displaced_of
from aeolid.diagnose.run_prior.explain import (
    Explanation,
    Found,
    angle_acts,
    explain,
    with_late_blades,
    with_standing,
    without_blades_mode,
)  # fmt: skip
from aeolid.diagnose.run_prior.floors import noise_findings
from aeolid.diagnose.run_prior.gauges import gauge_of
from aeolid.diagnose.run_prior.least import not_excluded
from aeolid.diagnose.run_prior.naming import Name, Told, effect_of, names_of, statement, without_mean_offset
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Pair
from aeolid.diagnose.run_prior.proof import RunProof, prove
from aeolid.diagnose.run_prior.replicated import with_replicated
from aeolid.diagnose.run_prior.responses import Answering, answering_of
from aeolid.diagnose.run_prior.search import FIT, Search
from aeolid.diagnose.run_prior.shown import answers_of, series_of, sides_of
from aeolid.diagnose.run_prior.standing import answered, standing_of
from aeolid.diagnose.run_prior.values import shown_values, values_of
from aeolid.diagnose.validation.divergent import diverging
from aeolid.errors import NotIdentifiable
from aeolid.record import Record

Progress = Callable[[str, float], None]
_NO_SHAM = (
    "No null simulations are made of a simulator's run: the limits beyond which an effect is named were measured on"
    " pairs of runs in which nothing was changed."
)
_FAULTS = ("data_time_offset", "sensor_sign")  # of what was found, what is the recording's fault and not the model's


@dataclass(frozen=True, eq=False)
class RunStudy:
    """Hold a pair, what explains it, how sure that is, the values told of each effect, and how both sides answer."""

    pair: Pair
    explanation: Explanation
    proof: RunProof
    told: tuple[Told, ...]
    names: tuple[tuple[Name, ...], ...]
    answering: Answering | None = None

    @property
    def is_borne_out(self) -> bool:
        """Tell whether the sealed part bears the effects out."""
        return self.proof.interval[0] > in_force().evidence.proven_nats


def study_run(
    records: Sequence[Record], runs: Sequence[Record], context: Mapping[str, Any], progress: Progress,
    deadline: Deadline,
) -> RunStudy:  # fmt: skip
    """Find, prove and name what separates runs from recordings. Raises NotIdentifiable where windows do not fit.

    Cost: 5 to 30 s for 600 s of 2 to 8 outputs on one core, some 300 MB at the most.
    """
    progress("windows of both sides", 0.02)
    pair = pair_of(records, runs, context)
    gauge = gauge_of(pair, context, FIT) if is_turbine(context) else None
    if gauge is not None:
        records = [gauge.corrected(r) for r in records]
        pair = pair_of(records, runs, context)
    units = {c.name: c.unit for c in records[0].channels}
    count = [0.05]

    def tick(what: str) -> None:
        count[0] = min(count[0] + 0.012, 0.8)
        deadline.doing(what)
        progress("hypotheses", count[0])

    deadline.enter("full fits")
    found = explain(pair, context, units, deadline, tick)
    if not deadline.passed:
        found = with_replicated(pair, with_beside(pair, found, context, units, tick), units, tick)
    answering = answering_of(pair, records, runs, context, FIT) if is_turbine(context) else None
    stronger = partial(angle_acts, pair, found)
    elsewhere = partial(displaced_of, pair, found.modal, context, FIT)
    standing = standing_of(pair, records, runs, context, found.moved, found.is_apart, answering, stronger, elsewhere)
    habit_s = in_force().run_prior.habit_samples * pair.step
    found = without_mean_offset(with_standing(found, standing, habit_s), context)
    found = _with_rotor(pair, found, answering)
    if gauge is not None:
        found = replace(found, found=(*found.found, Found(None, None, standing=gauge.standing(units[gauge.channel]))))
    progress("sealed part", 0.82)
    deadline.enter("sealed proof")
    ridge = Search(pair).ridge
    proof = prove(pair, found, ridge)
    progress("values", 0.88)
    told = []
    for effect in found.found:
        others = _others(found, effect)
        own = effect.seen_in
        values = values_of(*((pair, ridge) if own is None else (own, Search(own).ridge)), effect, others)
        told.append(shown_values(effect, *values))
    names = tuple(tuple(names_of(f, t, found, context)) for f, t in zip(found.found, told, strict=True))
    return RunStudy(pair, found, proof, tuple(told), names, answering)


def _with_rotor(pair: Pair, found: Explanation, answering: Answering | None) -> Explanation:
    """Return an explanation without modes that a rotor's answers stand for, or with the blades that these tell."""
    if is_other_rotor(pair, answering):
        found = without_blades_mode(pair, found, is_late_rotor(pair, answering))
    bent = left_late(pair, answering) if found.is_apart else None
    return found if bent is None else with_late_blades(found, answered(bent))


def _others(found: Explanation, effect: Found) -> Change:
    others = NOTHING
    for f in found.found:
        if f is not effect and f.scored is not None:
            others = f.scored.change.after(others)
    return others


def diagnosis_of(study: RunStudy, title: str, units: Mapping[str, str]) -> dict[str, Any]:
    """Return diagnosis.json of a pair: what `verdict.diagnose` returns of other baselines."""
    x, proof = study.explanation, study.proof
    verdict, effects = _decided(study, units)
    return {
        "schema": 1, "title": title, "verdict": verdict, "statement": _sentence(verdict, study, units),
        "effects": effects, "beside": None,
        "location": effects[0]["location"] if effects else _where(verdict, x),
        "sealed": {
            "data": _sealed_text(study.pair), "log_likelihood_gain": proof.gain if effects else 0.0,
            "interval": list(proof.interval) if effects else [0.0, 0.0],
            "nrmse_before": proof.before if effects else {}, "nrmse_after": proof.after if effects else {},
            "horizon_s": study.pair.block_s,
            "recovered_fraction": min(max(proof.gain / max(proof.ceiling, 1e-9), 0.0), 1.0) if effects else 0.0,
            "ceiling_gain": proof.ceiling,
        },
        "false_alarm": {"sham_runs": 0, "false_names": 0, "threshold": quoted(x.limit), "text": _NO_SHAM},
        "not_excluded": not_excluded(x, {e["id"] for e in effects}), "next_experiment": None,
        "run": {
            "nats_lost": x.lost, "weight": x.weight, "weight_after": _finite(x.after), "errors_grow": dict(x.moved),
        },
    }  # fmt: skip


def _decided(study: RunStudy, units: Mapping[str, str]) -> tuple[str, list[dict[str, Any]]]:
    x = study.explanation
    if not x.found or not study.is_borne_out:
        return ("unnamed" if x.is_apart else "no_mismatch"), []
    if is_habit(study.names, study.pair.step):
        return "immaterial", []
    effects: list[dict[str, Any]] = []
    open_ = False
    for names in study.names:
        open_ = open_ or len(names) > 1
        for k, name in enumerate(names):
            rivals = [n for n in names if n is not name] if k == 0 else []
            effects.append(effect_of(name, units, rivals, study.pair.passing))
    if open_:
        return "ambiguous", effects
    if all(names[0].fault or names[0].entry in _FAULTS for names in study.names):
        return "data_fault", effects
    if len(effects) > 1:
        return "multiple", effects
    kind = effects[0]["id"]
    return ("parameter" if kind == "parameter_error" else "named"), effects


def is_habit(names: Sequence[Sequence[Name]], step: float) -> bool:
    """Tell whether all that was found is late by no more than rows of `step` s are as loggers take them.

    A held command acts half a row after its stamp, a filter against aliases takes another half, clocks differ. Of one
    sensor alone it is less: its converter's turn.
    """
    told = [name for group in names for name in group]
    most = dict.fromkeys(LATE, in_force().run_prior.habit_samples)
    most["sensor_lag"] = in_force().hypotheses.habit_rows
    late = [name.entry in most and _lateness(name) <= most[name.entry] * step for name in told]
    return all(late) and any(name.entry in LATE for name in told)


def _lateness(name: Name) -> float:
    return lateness({k: v for k, (v, _) in name.told.items()})


def _sentence(verdict: str, study: RunStudy, units: Mapping[str, str]) -> str:
    x = study.explanation
    if verdict == "immaterial":
        return (
            f"Nothing but the instants of the rows separates the recording from the simulation:"
            f" {statement(study.names[0][0], units)}, as held commands, filters and clocks of loggers have it with"
            f" {study.pair.step:.3g} s a row"
        )
    if verdict == "no_mismatch":
        return (
            f"Nothing separates the recording from the simulation: trusting the run fully costs {max(x.lost, 0.0):.0f}"
            f" nats, where runs of one machine cost up to {quoted(x.limit):.0f}"
        )
    if verdict == "unnamed":
        most = max(x.moved, key=lambda n: x.moved[n])
        return (
            f"The recording and the simulation differ ({x.lost:.0f} nats), most in {most}, whose prediction errors are"
            f" {np.sqrt(x.moved[most]):.2g} times as large as they need be; no entry of the catalogue that was tried"
            f" explains it{'; ' + apart if (apart := told_apart(study.pair, study.answering)) else ''}"
        )
    blades = study.pair.passing
    groups = [" — or: ".join(statement(n, units, blades) for n in names) for names in study.names]
    return "; and ".join(groups)


def _where(verdict: str, x: Explanation) -> dict[str, Any] | None:
    rules = in_force().run_prior
    if verdict != "unnamed":
        return None
    most = max(x.moved.values())
    outputs = [n for n, v in sorted(x.moved.items(), key=lambda m: -m[1]) if v - 1 > rules.worse_share * (most - 1)]
    return {"entry": f"output:{outputs[0]}", "outputs": outputs, "inputs": [], "frequency_hz": None,
            "azimuth_order": None, "region": None, "time_s": None}  # fmt: skip


def _sealed_text(pair: Pair) -> str:
    parts = []
    for s in pair.recordings:
        first, last = (s.start_s + share * len(s) * s.step for share in (FIT, 1.0))
        parts.append(f"{Path(s.source).name} from {first:.6g} s to {last:.6g} s")
    return "; ".join(parts)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def conclude_run(
    case: Case, folder: Path, findings: Sequence[Finding], progress: Progress, deadline: Deadline
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Diagnose a case of one or several runs of a simulator and write its files; returns diagnosis and evidence."""
    begun = time.perf_counter()
    study = study_run(case.records, case.runs, case.context, progress, deadline)
    units = {c.name: c.unit for c in case.records[0].channels}
    diagnosis = diagnosis_of(study, case.title, units)
    progress("corrected model", 0.94)
    deadline.enter("writing")
    sets = blade_sets(case.records[0], case.context)
    claimed = study.told if diagnosis["effects"] else ()
    explanation = study.explanation if diagnosis["effects"] else _without(study.explanation)
    model, wild, lacking = None, None, ""
    try:
        model = corrected_model(study.pair, explanation, claimed, case.records, case.runs, sets)
        wild = diverging(model, case.records)
    except NotIdentifiable as error:  # what was found stands without it
        lacking = f"no corrected model was written: {error}"
    evidence = evidence_of(study, case.title, (*findings, *noise_findings(study.pair, units)), units)
    evidence["timing_s"] = {"in all": round(time.perf_counter() - begun, 3)}
    return diagnosis, write_found(diagnosis, evidence, model, wild, deadline, folder, lacking)


def _stands(nats: float, needed: float) -> dict[str, Any]:
    """Return whether a hypothesis gains enough for a name, and else why it is not accepted."""
    enough = bool(nats > needed)
    return {"plausible": enough} | (
        {} if enough else {"reason": f"gains {max(nats, 0.0):.3g} nats; a name needs more than {needed:.3g}"}
    )


def _without(x: Explanation) -> Explanation:
    return replace(x, found=(), change=NOTHING)


def evidence_of(study: RunStudy, title: str, findings: Sequence[Finding], units: Mapping[str, str]) -> dict[str, Any]:
    """Return what the report's appendix shows."""
    rules = in_force().run_prior
    x = study.explanation
    rows = sorted({s.hypothesis.key: s for s in (*x.screened, *x.table)}.values(), key=lambda s: -s.nats)
    return {
        "title": title,
        "forensics": [f.to_json() for f in findings],
        "candidates": [
            {"key": s.hypothesis.key, "parts": [[s.hypothesis.entry, s.hypothesis.place]],
             "values": dict(zip(s.hypothesis.names, s.values, strict=True)), "nats": quoted(s.nats),
             "nats_before_control": s.raw, "weight_of_run": s.weight}
            | _stands(s.nats, rules.named_nats)
            for s in rows
        ],
        "evaluations": x.evaluations,
        "series": series_of(study.pair, study.proof.series, units) if study.names and study.is_borne_out else {},
    } | sides_of(study.pair, x.modal, units) | answers_of(study.pair, study.answering)  # fmt: skip
