"""Hold what was found against the sealed data (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.reestimate import estimated_on_all
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.rivals import rivals_of
from aeolid.diagnose.selection.several import KIN, form_beside, without_the_needless
from aeolid.diagnose.stats.blocks import block_interval
from aeolid.diagnose.structure.nuisance import is_nuisance
from aeolid.diagnose.validation.proof import Proof, prove

_RIVALS = 3  # that the sealed data are asked about, where they do not bear out what leads


@dataclass(frozen=True, eq=False)
class Held:
    """Hold what the sealed data left of the chosen effects, estimated on all other data.

    sets: all of them; kept: which is the largest that stands; completed: that one, and beside it a form outside the
    catalogue; proof: of the largest of all these. displaced_by: key of an effect's kin that leaves nothing of it.
    """

    sets: tuple[Candidate, ...] = ()
    kept: int = 0
    completed: Candidate | None = None
    proof: Proof | None = None
    displaced_by: str = ""

    @property
    def single(self) -> Candidate | None:
        """Return the effect that stands alone, or that the others came to."""
        if not self.sets:
            return None
        best = self.sets[self.kept]
        return best if len(best.attachments) == 1 else self.sets[0]

    @property
    def several(self) -> Candidate | None:
        """Return the largest set that stands, if it is of several effects."""
        return self.sets[self.kept] if self.sets and len(self.sets[self.kept].attachments) > 1 else None

    @property
    def is_largest(self) -> bool:
        """Tell whether the last set that was asked about stands."""
        return self.kept == len(self.sets) - 1


def hold_against(prepared: Prepared, whole: Prepared, chain: Sequence[Candidate], seed: int) -> Held:
    """Hold the chosen effects against the sealed data; more effects must beat fewer there too, or they go.

    whole: the stage of the baseline that fit and selection data give together. Every set is estimated on these. Beside
    what is proven one effect follows another: where a step is not borne out, no larger set is asked about (a pendulum's
    dry friction, 69 nats, stood beside a one-sided spring that lost 106 and a hysteresis that gained 192).
    """
    evidence = in_force().evidence
    before, sets = (whole.predictor, whole.fit), [estimated_on_all(prepared, c) for c in chain]
    kept, proof = 0, None
    for place, chosen in enumerate(sets):
        own = prove(before, (chosen.predictor, chosen.fit), prepared.split.sealed, prepared.settle_s, seed)
        if proof is None or _is_borne_out(own, proof, seed):
            kept, proof = place, own
        elif proof.interval[0] > evidence.proven_nats:
            break
    if proof is None:
        return Held()
    larger = _with_form(prepared, chain[kept], proof, seed)
    if larger is None:
        return Held(tuple(sets), kept, None, proof)
    if without_the_needless(prepared, larger) is not larger:
        form = larger.attachments[-1].key
        return Held(tuple(sets), kept, None, proof, form.removeprefix(f"{KIN} ") if form.startswith(KIN) else "")
    larger = estimated_on_all(prepared, larger)
    both = prove(before, (larger.predictor, larger.fit), prepared.split.sealed, prepared.settle_s, seed)
    borne_out = block_interval(both.difference - proof.difference, seed)[0] > 0
    return Held(tuple(sets), kept, larger, both) if borne_out else Held(tuple(sets), kept, None, proof)


def hold_leader(
    prepared: Prepared, whole: Prepared, chain: Sequence[Candidate], candidates: Sequence[Candidate], seed: int
) -> Held:
    """Hold the chosen effects against the sealed data; a set that these do not bear out falls back on its first effect.

    Where the sealed part is silent the folds choose one effect, and are asked about further ones apart. Where it does
    not bear the leader out either, a rival that fit and selection data do not tell from it takes its place, if the
    sealed data bear that one out and prefer it: which of them it is was left to them (a ball on a beam, its drive of
    second order: a dead time led by 5 nats of 238, lost 22 on the sealed part, and the drive gained 20). The best of
    three, so that its interval must be above what three are worth. An effect of which its kin leaves nothing gives way
    to that one.
    """
    least = in_force().evidence.proven_nats
    held = _in_its_place(prepared, whole, hold_against(prepared, whole, chain, seed), candidates, seed)
    if held.several is not None and held.proof is not None and held.proof.interval[0] <= least:
        held = hold_against(prepared, whole, chain[:1], seed)
    if held.proof is None or held.proof.interval[0] > least or prepared.surrogate is not None or chain[0].unlisted:
        return held
    lead, best = held.proof, held
    for rival in sorted(rivals_of(candidates, chain[0]), key=lambda c: -c.score)[:_RIVALS]:
        if prepared.deadline.skips("rivals of what the sealed part does not bear out"):
            break
        other = hold_against(prepared, whole, [rival], seed)
        if other.proof is None or other.proof.worse or other.proof.interval[0] <= least + np.log(_RIVALS):
            continue
        preferred = block_interval(other.proof.difference - lead.difference, seed)[0] > 0
        if preferred and (best.proof is lead or best.proof is None or other.proof.gain > best.proof.gain):
            best = other
    return best


def _is_borne_out(larger: Proof, smaller: Proof, seed: int) -> bool:
    """Tell whether a further effect predicts the sealed data better, by the share that it had to add where chosen."""
    added = larger.difference - smaller.difference
    return block_interval(added, seed)[0] > 0 and float(added.sum()) > in_force().selection.further_share * smaller.gain


def _with_form(prepared: Prepared, found: Candidate, proof: Proof, seed: int) -> Candidate | None:
    """Put a form without a name beside proven effects, as fitted to the fit data; None where these ask for none.

    None beside a form, a wrong value, a fault of the recording: a claim that the structure is right. On a simulator's
    run there are none.
    """
    if proof.interval[0] <= in_force().evidence.proven_nats or found.unlisted or prepared.surrogate is not None:
        return None
    if any(entry(a.entry).family in ("parameter", "sensor_nonlinearity") for a in found.attachments):
        return None
    return form_beside(prepared, found, seed)


def _in_its_place(prepared: Prepared, whole: Prepared, held: Held, candidates: Sequence[Candidate], seed: int) -> Held:
    """Return the kin that leaves nothing of the effect found, where the sealed data bear it out and prefer it.

    A spring that hardens was two stops with a gap of nearly nothing between them and the rest, 149 nats and 24 on the
    selection data, where the cubic spring, 228 nats, was silent: beside it the stops had no stiffness.
    """
    kin = next((c for c in candidates if c.key == held.displaced_by and c.plausible), None)
    if kin is None or held.proof is None or prepared.deadline.skips("the kin of what it leaves nothing of"):
        return held
    other = hold_against(prepared, whole, [kin], seed)
    if other.proof is None or other.proof.interval[0] <= in_force().evidence.proven_nats:
        return held
    return other if block_interval(other.proof.difference - held.proof.difference, seed)[0] > 0 else held


def declared_against(prepared: Prepared, seed: int) -> Proof | None:
    """Compare the declared parameter values with the re-fitted ones on sealed data (noise model fitted for both).

    prepared: the bare stage.
    """
    physical = [i for i in prepared.free.theta if not is_nuisance(prepared.extended.parameters[i].name)]
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
