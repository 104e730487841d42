"""Say how sure a lateness is beside the way a recording was taken, which may be late by as much as a row (S6)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.data.intersample import Sampling, traits_of
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.hypotheses.parts.lateness import lateness
from aeolid.models.intersample import FILTER, OFFSET

_UNREAD = 1 / math.sqrt(3)  # rows: deviation from none of what lies evenly between a row early and a row late


def beside_unsure_reading(prepared: Prepared, candidate: Candidate) -> Candidate:
    """Return a candidate whose delays and lags have deviations that hold what the way of taking rows leaves open.

    Loggers stamp a row where its interval begins or ends, and filter what they sample: together up to a row (a heater
    behind such a chain: 11.9 +- 0.14 s for a dead time of 8.4 s, in rows of 5 s). What is read off the recording is
    known already, and so is it where another input, or another output, does not come late.
    """
    if not prepared.sampling.is_plain:
        return candidate
    row_s, late = prepared.records[0].sample_time_s, _read_late(prepared)
    values = {
        a.key: _wider(candidate.values[a.key], row_s)
        if _may_be_the_reading(a, prepared.sampling, len(prepared.declared.outputs), late)
        else candidate.values[a.key]
        for a in candidate.attachments
    }
    return replace(candidate, values=values)


def is_within_reading(prepared: Prepared, candidate: Candidate) -> bool:
    """Tell whether a candidate is nothing but a lateness of no more than the reading's own deviation.

    Not of twice that: a car's throttle acts 0.7 to 0.8 rows late, and nothing in its recording tells that from rows.
    Where inputs were read early, the lateness takes back what was read too early, and both together decide: a
    second-order drive at 0.4 of the rate was the logger's own filter, beside inputs that the fit had a row early.
    """
    if any(entry(a.entry).family not in ("input_lag", "sensor_dynamics") for a in candidate.attachments):
        return False
    most, outputs = _UNREAD * prepared.records[0].sample_time_s, len(prepared.declared.outputs)
    late = _read_late(prepared)
    if not all(_may_be_the_reading(a, prepared.sampling, outputs, late) for a in candidate.attachments):
        return False
    told = [lateness({n: v for n, (v, _) in candidate.values[a.key].items()}) for a in candidate.attachments]
    return all(own < most for own in told) and _read_late_s(prepared, candidate) + sum(told) < most


def _read_late_s(prepared: Prepared, candidate: Candidate) -> float:
    """Return by how much outputs show their inputs late in all beside a candidate, as its own fit reads them, in s."""
    if prepared.sampling.is_plain:
        return 0.0
    model, theta = candidate.predictor.compiled.model, candidate.fit.point.theta
    return float(sum(theta[model.index(p.name)] for p in model.parameters if p.name in (OFFSET, FILTER)))


def _read_late(prepared: Prepared) -> set[str]:
    """Return the measured disturbances that go on between their rows but are read as held: half a row late by that.

    Beside outputs that an anti-alias filter shows half a row late they look right, and a command alone late (a crane's
    drive beside its wind, 0.106 s in rows of 0.2 s, was a dead time).
    """
    measured = {c.name for c in prepared.records[0].channels if c.role == "disturbance"}
    held = [n for n, hold in prepared.sampling.holds if hold == "zoh" and n in measured]
    return {t.name for t in traits_of(prepared.records, held) if t.hold is None}


def _may_be_the_reading(attachment: Attachment, sampling: Sampling, outputs: int, late: set[str]) -> bool:
    """Tell whether an effect makes all that is compared late alike: all inputs, or the only output.

    late: inputs that are read late already.
    """
    family = entry(attachment.entry).family
    if family == "input_lag":
        return {n for n, _ in sampling.holds} - late <= set(attachment.location["inputs"])
    return family == "sensor_dynamics" and outputs == 1


def _wider(told: Mapping[str, tuple[float, float]], row_s: float) -> dict[str, tuple[float, float]]:
    """Return values with the reading's lateness in the deviation of what says how late an effect is."""
    late_s = lateness({label: value for label, (value, _) in told.items()})
    more = dict.fromkeys(("tau_s", "delay_s", "offset_s"), _UNREAD * row_s)
    if math.isfinite(late_s) and late_s > 0 and "omega_rad_s" in told:
        more["omega_rad_s"] = told["omega_rad_s"][0] / late_s * _UNREAD * row_s
    return {label: (value, math.hypot(std, more.get(label, 0.0))) for label, (value, std) in told.items()}
