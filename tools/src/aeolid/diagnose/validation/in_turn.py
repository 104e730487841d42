"""Let the parts that were held out in turn decide between what the sealed part leaves open (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.reestimate import estimated_on_all
from aeolid.diagnose.candidates.slight import is_slight
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.selection.rivals import rivals_of
from aeolid.diagnose.stats.blocks import block_interval
from aeolid.diagnose.validation.proof import prove
from aeolid.diagnose.validation.rotation import Rotation, adds_in_turn, is_silent
from aeolid.diagnose.validation.sealed import Held, hold_against, hold_leader


def decided_in_turn(
    prepared: Prepared, unsealed: Prepared, held: Held, chain: Sequence[Candidate], candidates: Sequence[Candidate],
    turned: Rotation | None, seed: int,
) -> tuple[Held, Rotation | None]:  # fmt: skip
    """Return what is held: the form that most folds choose, or the largest set where they decide and bear it out.

    Or a linear model's constant in the place of a form that they do not choose; with the rotation as it judges that.
    """
    constant = constant_in_turn(prepared, unsealed, held, chain, candidates, turned, seed)
    if constant is not held and turned is not None:
        return constant, replace(turned, agrees=True)
    form = form_in_turn(prepared, unsealed, held, candidates, turned, seed)
    if form is not held:
        return form, turned
    return _with_more_in_turn(prepared, unsealed, held, chain, candidates, turned, seed), turned


def constant_in_turn(
    prepared: Prepared, unsealed: Prepared, held: Held, chain: Sequence[Candidate], candidates: Sequence[Candidate],
    turned: Rotation | None, seed: int,
) -> Held:  # fmt: skip
    """Return what is held; a constant that is off by no more than usual, where folds choose it instead of a form.

    Where the sealed part is silent the form stands for nothing else. The linear model of a disc drive's arm whose
    frequency was 0.36 % off was `unnamed`, for a curve of its coil's voltage; without four of five blocks the frequency
    was chosen, and no curve without any. Cost: one proof, where it is so.
    """
    if turned is None or held.single is None or held.proof is None or not chain or not held.single.unlisted:
        return held
    if not is_slight(chain[0]) or not is_silent(held.proof.interval):
        return held
    chosen = sum(f.choice is not None and f.choice.key == chain[0].key for f in turned.folds)
    if not turned.speaks or chosen < in_force().validation.agreeing_share * len(turned.folds):
        return held
    return hold_leader(prepared, unsealed, chain, candidates, seed)


def form_in_turn(
    prepared: Prepared, unsealed: Prepared, held: Held, candidates: Sequence[Candidate], turned: Rotation | None,
    seed: int,
) -> Held:  # fmt: skip
    """Return what is held; the form outside the catalogue that most folds choose takes the place of what has a name.

    Which of the two is ahead on one division of the data is chance then, and the name is not sure. A diode between two
    filters was a drive that saturates and a stop beside it, where four of five folds chose a bent input. A form that
    is as good as what has the name on all data is that by another name. Cost: one proof, where it is so.
    """
    if turned is None or held.single is None or held.single.unlisted or not turned.speaks:
        return held
    named = next((c for c in candidates if c.key == held.single.key), held.single)
    tied = in_force().selection.told_apart_nats
    forms = [f.choice for f in turned.folds if f.choice is not None and f.choice.unlisted]
    chosen = [c for c in forms if abs(c.score - named.score) > tied]
    if len(chosen) < in_force().validation.agreeing_share * len(turned.folds):
        return held
    form = max(chosen, key=lambda c: c.score)
    instead = hold_against(prepared, unsealed, [form], seed)
    borne_out = instead.proof is not None and instead.proof.interval[0] > in_force().evidence.proven_nats
    return instead if borne_out else held


def _with_more_in_turn(
    prepared: Prepared, unsealed: Prepared, held: Held, chain: Sequence[Candidate], candidates: Sequence[Candidate],
    turned: Rotation | None, seed: int,
) -> Held:  # fmt: skip
    """Return what is held with the largest set, where the folds bear it out and the sealed part does not refute it.

    Asked where the sealed part is silent: of all that was found, or of what is beside the first effect. Of a throttle
    plate's stop and dry friction that part bore out the stop, by 393 nats at a few impacts, beside which the friction's
    -3 (-99 to 71) said nothing; the other data had gained 84 and 34 by it. Where the impacts leave the folds silent,
    too, both are told if the answer would else be one of both.
    """
    if turned is None or not turned.proves or held.proof is None or held.completed is not None:
        return held
    if len(chain) < 2 or held.several is not None or held.sets[0].key != chain[0].key:  # a rival took its place
        return held
    larger = estimated_on_all(prepared, chain[-1])
    before = unsealed.predictor, unsealed.fit
    proof = prove(before, (larger.predictor, larger.fit), prepared.split.sealed, prepared.settle_s, seed)
    beside = block_interval(proof.difference - held.proof.difference, seed)
    silent = is_silent(held.proof.interval) or is_silent(beside)
    if not silent or proof.interval[1] <= 0:
        return held
    asked = _are_both(chain, candidates) or adds_in_turn(prepared, chain[0], chain[-1], seed)
    return Held((held.sets[0], larger), 1, None, proof) if asked else held


def _are_both(chain: Sequence[Candidate], candidates: Sequence[Candidate]) -> bool:
    """Tell whether a set is of two effects that alone are not told apart, and that together explain far more."""
    first, both = chain[0], chain[-1]
    if len(both.attachments) != 2 or both.score <= first.score + in_force().selection.beyond_doubt_nats:
        return False
    return any(c.key == both.attachments[-1].key for c in rivals_of(candidates, first))
