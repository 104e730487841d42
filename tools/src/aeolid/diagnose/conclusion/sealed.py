"""Say what the sealed data show: gain, interval, errors before and after, the part of what could be gained (S8)."""

from __future__ import annotations

from typing import Any

from aeolid.diagnose.candidates.simulated_share import is_static
from aeolid.diagnose.pipeline import Study
from aeolid.diagnose.stats.numbers import finite
from aeolid.diagnose.validation.proof import Proof


def recovered_fraction(study: Study, proof: Proof) -> float:
    """Return gain of the named effect over the largest gain anything achieved on the sealed data.

    Of a law without states it is at least the share of the squared simulation error that is gone, in the output where
    that is least: one-step errors are then what noise and a few rows say, and a correction by these shows no
    physics (of a damper's force a hysteresis took 86 % of the squared error, 10 % of the nats).
    """
    best = max(float(study.ceiling.sealed.sum()), proof.gain, 1e-9)
    share = proof.gain / best
    if is_static(study.prepared):
        before, after = proof.nrmse_before, proof.nrmse_after
        share = max(share, min(1 - (after[k] / max(before[k], 1e-300)) ** 2 for k in before))
    return float(max(0.0, min(1.0, share)))


def sealed_part(study: Study, proof: Proof | None) -> dict[str, Any]:
    """Return `sealed` of diagnosis.json; zeros where nothing is claimed."""
    split = study.prepared.split
    if proof is None:
        return {
            "data": split.sealed_text, "log_likelihood_gain": 0.0, "interval": [0.0, 0.0], "nrmse_before": {},
            "nrmse_after": {}, "recovered_fraction": 0.0, "ceiling_gain": finite(float(study.ceiling.sealed.sum())),
        }  # fmt: skip
    return {
        "data": split.sealed_text,
        "log_likelihood_gain": proof.gain,
        "interval": list(proof.interval),
        "nrmse_before": proof.nrmse_before,
        "nrmse_after": proof.nrmse_after,
        "horizon_s": proof.horizon_s,
        "recovered_fraction": recovered_fraction(study, proof),
        "ceiling_gain": finite(float(study.ceiling.sealed.sum())),
    }
