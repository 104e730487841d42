"""Hold what was found against the sealed data (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.diagnose.candidate import Candidate
from aeolid.diagnose.catalogue import entry
from aeolid.diagnose.prepare import NUISANCE, Prepared
from aeolid.diagnose.proof import PROVEN, Proof, block_interval, prove
from aeolid.diagnose.several import form_beside


def hold_against(
    prepared: Prepared, chain: Sequence[Candidate], seed: int
) -> tuple[Candidate | None, Candidate | None, Proof | None]:
    """Hold the chosen effects against the sealed data; more effects must beat fewer there too, or they go.

    Returns the set of several effects, what completes the effects, and the proof of the largest that stands.
    """
    bare = prepared.only(())
    best: Candidate | None = None
    kept: Proof | None = None
    for chosen in chain:
        pair = (bare.predictor, bare.fit), (chosen.predictor, chosen.fit)
        proof = prove(*pair, prepared.split.sealed, prepared.settle_s, seed)
        if kept is None or block_interval(proof.difference - kept.difference, seed)[0] > 0:
            best, kept = chosen, proof
    completed, kept = _completed(prepared, best, kept, seed)
    return (best if best is not None and len(best.attachments) > 1 else None), completed, kept


def _completed(
    prepared: Prepared, found: Candidate | None, proof: Proof | None, seed: int
) -> tuple[Candidate | None, Proof | None]:
    """Put a form without a name beside proven effects, where the sealed data ask for that too; with the whole's proof.

    None beside a form, a wrong value, a fault of the recording: a claim that the structure is right. On a simulator's
    run there are none.
    """
    if (
        found is None
        or proof is None
        or proof.interval[0] <= PROVEN
        or found.unlisted
        or prepared.surrogate is not None
    ):
        return None, proof
    if any(entry(a.entry).family in ("parameter", "sensor_nonlinearity") for a in found.attachments):
        return None, proof
    larger = form_beside(prepared, found, seed)
    if larger is None:
        return None, proof
    bare = prepared.only(())
    whole = prove(
        (bare.predictor, bare.fit), (larger.predictor, larger.fit), prepared.split.sealed, prepared.settle_s, seed
    )
    if block_interval(whole.difference - proof.difference, seed)[0] <= 0:
        return None, proof
    return larger, whole


def declared_against(prepared: Prepared, seed: int) -> Proof | None:
    """Compare the declared parameter values with the re-fitted ones on sealed data (noise model fitted for both)."""
    prepared = prepared.only(())
    physical = [i for i in prepared.free.theta if not prepared.extended.parameters[i].name.startswith(NUISANCE)]
    if not physical:
        return None
    held = replace(prepared.free, theta=tuple(i for i in prepared.free.theta if i not in physical))
    theta = prepared.fit.point.theta.copy()
    theta[physical] = prepared.extended.theta[physical]
    fit = prepared.predictor.fit(replace(prepared.fit.point, theta=theta), held)
    if fit is None:
        return None
    pair = (prepared.predictor, fit), (prepared.predictor, prepared.fit)
    return prove(*pair, prepared.split.sealed, prepared.settle_s, seed)
