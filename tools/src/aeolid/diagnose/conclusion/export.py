"""Write what a diagnosis leaves behind: JSON, corrected model, sealed series, evidence for the report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from aeolid import output
from aeolid.diagnose.conclusion.correction import Correction, correct
from aeolid.diagnose.conclusion.verdict import shown_proof
from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.localise.turn import turning_errors
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.rules import differing, in_force
from aeolid.diagnose.stats.numbers import finite, json_text
from aeolid.diagnose.validation.divergent import Diverging
from aeolid.formats.headings import heading_line
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.models.equations_file import to_toml


def write_all(study: Study, diagnosis: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Write diagnosis.json, model/model.toml, sealed_before_after.csv, evidence.json; returns the evidence."""
    correction = correct(study)
    wild, free = correction.diverging, correction.free_run
    if diagnosis["verdict"] == "no_mismatch" and free is not None:
        off = free.astray(study.unsealed.predictor.scales.spread)
        diagnosis["statement"] = f"{off}." if off else diagnosis["statement"]
    diagnosis["model"] = {"file": "model/model.toml", "divergence": None if wild is None else wild.to_json()}
    diagnosis |= _own_rules()
    late = study.deadline
    diagnosis["time_limit"] = late.to_json()
    diagnosis["warnings"] = ([late.text()] if late.reached else []) + ([] if wild is None else [wild.text()])
    output.make_folder(folder)
    output.write_json(folder / "diagnosis.json", diagnosis)
    output.make_folder(folder / "model")
    output.write_text(folder / "model" / "model.toml", _headed(correction))
    facts = evidence(study)
    if free is not None:
        facts["free_run"] = free.to_json()
    write_series(facts.get("series", {}), folder / "sealed_before_after.csv")
    output.write_text(folder / "evidence.json", json_text(facts))
    return facts


def _own_rules() -> dict[str, Any]:
    """Return the decision rules in force as a fact of the diagnosis, where they are not the defaults."""
    own = differing(in_force())
    return {"rules": own} if own else {}


def _headed(correction: Correction) -> str:
    """Return the text of model.toml; what forbids its use stands first."""
    wild = correction.diverging
    head = "" if wild is None else "".join(f"# {line}\n" for line in wrap(f"WARNING: {wild.text()}", 100))
    return head + to_toml(correction.model)


def write_found(
    diagnosis: dict[str, Any], evidence: dict[str, Any], model: Equations | None, wild: Diverging | None,
    late: Deadline, folder: Path, lacking: str = "",
) -> dict[str, Any]:  # fmt: skip
    """Write the files of a diagnosis that was made without a study of fits; returns the evidence.

    lacking: why there is no corrected model, where there is none.
    """
    diagnosis |= _own_rules()
    if model is not None:
        diagnosis["model"] = {"file": "model/model.toml", "divergence": None if wild is None else wild.to_json()}
    diagnosis["time_limit"] = late.to_json()
    told = [late.text() if late.reached else "", "" if wild is None else wild.text(), lacking]
    diagnosis["warnings"] = [text for text in told if text]
    output.make_folder(folder)
    output.write_json(folder / "diagnosis.json", diagnosis)
    if model is not None:
        called = model if wild is None else replace(model, name=f"{model.name}, DIVERGES")
        output.make_folder(folder / "model")
        output.write_text(folder / "model" / "model.toml", _headed(Correction(called, None, wild)))
    write_series(evidence.get("series", {}), folder / "sealed_before_after.csv")
    output.write_text(folder / "evidence.json", json_text(evidence))
    return evidence


def write_ended(diagnosis: dict[str, Any], evidence: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Write diagnosis.json, an empty sealed_before_after.csv and evidence.json; returns the evidence."""
    diagnosis |= _own_rules()
    output.make_folder(folder)
    output.write_json(folder / "diagnosis.json", diagnosis)
    write_series({}, folder / "sealed_before_after.csv")
    output.write_text(folder / "evidence.json", json_text(evidence))
    return evidence


def write_series(series: dict[str, Any], path: Path) -> None:
    """Write measured, before and after of every output over the sealed data; an empty series gives a heading only.

    Last comes the number of the sealed stretch, from 1: the times of several may be the same.
    """
    names = list(series)
    heads = ["time_s", *(f"{n}_{kind}" for n in names for kind in ("measured", "before", "after")), "stretch"]
    lines = [heading_line(heads)]
    if names:
        first = series[names[0]]
        columns = [series[n][k] for n in names for k in ("measured", "before", "after")]
        columns = [first["time_s"], *columns, first["stretch"]]
        lines += [",".join("" if v is None else f"{v:.9g}" for v in row) + "\n" for row in zip(*columns, strict=True)]
    output.write_text(path, "".join(lines))


def evidence(study: Study) -> dict[str, Any]:
    """Return what the report's appendix shows, all keys plain JSON."""
    proof = shown_proof(study) or study.proof or study.declared_proof  # without a claim: what was tried
    prepared = study.prepared
    parameters, baseline = [], study.unsealed
    for k, i in enumerate(baseline.free.theta):
        p = baseline.extended.parameters[i]
        std, fitted = float(baseline.fit.std[k]), float(baseline.fit.point.theta[i])
        spread = np.hypot(std, p.prior_std or 0.0)
        parameters.append(
            {"name": p.name, "unit": p.unit, "prior": p.value, "fitted": fitted,
             "std": finite(std),
             "pull": float((fitted - p.value) / spread) if np.isfinite(spread) and spread > 0 else None}
        )  # fmt: skip
    facts: dict[str, Any] = {
        "title": study.case.title,
        "bank": study.bank.to_json(),
        "confusion": study.bank.confusion(),
        "forensics": [f.to_json() for f in study.findings],
        "split": list(prepared.split.rows),
        "parameters": parameters,
        "candidates": [
            {k: getattr(c, k) for k in ("key", "score", "fit_gain", "select_gain", "plausible", "reason")}
            | {"parts": [[a.entry, a.location["entry"]] for a in c.attachments]}
            for c in study.candidates
        ],
        "bands": study.bands,
        "cells": study.cells,
        "equations": study.equations,
        "depends_on": [{"what": g, "share": s} for g, s in study.ceiling.groups],
        "sham_largest_z": list(study.sham[2]),
        "decimation": prepared.decimation,
        "timing_s": study.timing_s,
        "model_equations": [f"{s.name}: {ex.to_text(s.derivative)}" for s in prepared.declared.states][:12],
    }
    if proof is not None:
        facts |= {"series": proof.series, "spectra": proof.spectra, "horizon": proof.profile}
        names = [s.name for s in prepared.extended.inputs]
        facts["turning_errors"] = turning_errors(
            prepared.split.sealed, names, study.case.records[0].channels, proof.series
        )
    return facts
