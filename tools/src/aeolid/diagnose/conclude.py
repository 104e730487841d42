"""Take a case to its verdict, whatever happens on the way: every recording that can be read ends in a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.diagnose.baseline.channel_faults import Fault, channel_faults, with_faults
from aeolid.diagnose.baseline.late_output import late_output
from aeolid.diagnose.baseline.simulated import check_run, is_simple
from aeolid.diagnose.conclusion.export import evidence as evidence_of
from aeolid.diagnose.conclusion.export import write_all, write_ended, write_found
from aeolid.diagnose.conclusion.static_law import static_law, with_static_law
from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.bridging import bridged_case
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.forensics import SWAPPED, Finding, examine
from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.data.masking import masked_case
from aeolid.diagnose.deadline import Deadline, unlimited
from aeolid.diagnose.pipeline import Progress, study
from aeolid.diagnose.run_prior.conclude import conclude_run
from aeolid.errors import NotIdentifiable


def conclude(
    case: Case, folder: Path, *, sham: int, seed: int, progress: Progress, deadline: Deadline | None = None
) -> tuple[dict[str, Any], Any]:
    """Diagnose a case and write what it leaves behind; returns diagnosis.json's content and the evidence.

    deadline: when the best answer so far is written, never by default.

    What a channel did not measure is left out. A fault of the recording that cannot be left out ends it before anything
    is fitted (`data_fault`); data that cannot carry an answer end it where that shows (`not_testable`), with the reason
    as the statement. Channels with another sign, unit, name or clock are put right first; the answer then is about the
    recording put right, and says so.
    """
    findings = examine(case.records, case.baseline)
    wrong: tuple[Fault, ...] = ()
    if all(f.severity != "fault" or f.left_out or f.check == SWAPPED for f in findings):
        wrong, case = _put_right(case)
        findings = examine(case.records, case.baseline) if wrong else findings
    case, left = masked_case(case)
    case, over = bridged_case(case)
    findings += (*left, *over)
    faults = [f for f in findings if f.severity == "fault" and not f.left_out]
    if faults:
        text = "; ".join(f"{f.channel}: {f.finding}" for f in faults)
        location = {"entry": f"channel:{faults[0].channel}", "finding": faults[0].finding}
        evidence = {"title": case.title, "forensics": [f.to_json() for f in faults]}
        return ended("data_fault", case.title, text, folder, location, evidence, wrong)
    late = deadline or unlimited()
    if (found := _against_run(case, folder, findings, progress, late)) is not None:
        return found
    try:
        result = study(case, sham=sham, seed=seed, progress=progress, deadline=deadline, findings=findings)
    except NotIdentifiable as error:
        return ended("not_testable", case.title, str(error), folder, faults=wrong)
    except np.linalg.LinAlgError as error:
        reason = f"{case.baseline_file}: what is to be fitted cannot be solved for ({error}); check units and scales"
        return ended("not_testable", case.title, reason, folder, faults=wrong)
    diagnosis = diagnose(result)
    law = static_law(case, seed) if diagnosis["verdict"] in ("no_mismatch", "immaterial") else None
    if law is not None:
        diagnosis = with_faults(with_static_law(diagnosis, law), wrong)
        return diagnosis, write_found(diagnosis, evidence_of(result), law.model, None, late, folder)
    diagnosis = with_faults(diagnosis, wrong)
    return diagnosis, write_all(result, diagnosis, folder)


def _put_right(case: Case) -> tuple[tuple[Fault, ...], Case]:
    """Return what is wrong with the channels' wiring and clocks, and the case with that put right."""
    wrong, case = channel_faults(case)
    late, case = late_output(case)
    return (wrong if late is None else (*wrong, late)), case


def _against_run(
    case: Case, folder: Path, findings: Sequence[Finding], progress: Progress, late: Deadline
) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Hold a simulator's run against the recordings where a model of few states would not hold it.

    None for other baselines, for runs that few states describe, and where windows of both sides do not fit: there the
    surrogate of few states is what can be had.
    """
    if not case.runs or case.same_inputs:
        return None
    several = len(case.runs) > 1  # which a surrogate of few states, made of one run, cannot serve
    try:
        for run in case.runs:
            check_run(run, case.records)
        if not is_turbine(case.context) and not several and is_simple(case.runs[0]):
            return None
        return conclude_run(case, folder, findings, progress, late)
    except (NotIdentifiable, np.linalg.LinAlgError) as error:
        return ended("not_testable", case.title, str(error), folder) if several else None


def ended(
    verdict: str, title: str, reason: str, folder: Path,
    location: dict[str, Any] | None = None, evidence: dict[str, Any] | None = None,
    faults: Sequence[Fault] = (),
) -> tuple[dict[str, Any], dict[str, Any]]:  # fmt: skip
    """Write a diagnosis that ended before any effect could be tested; nothing is excluded by it."""
    diagnosis = {
        "schema": 1, "title": title, "verdict": verdict, "statement": reason, "effects": [], "location": location,
        "sealed": {"data": "none was used", "log_likelihood_gain": 0.0, "interval": [0.0, 0.0], "nrmse_before": {},
                   "nrmse_after": {}, "recovered_fraction": 0.0},
        "rotation": None, "data_notes": [],
        "false_alarm": {"sham_runs": 0, "false_names": 0, "threshold": None},
        "not_excluded": [], "next_experiment": None,
    }  # fmt: skip
    diagnosis = with_faults(diagnosis, faults)
    return diagnosis, write_ended(diagnosis, evidence or {"title": title}, folder)
