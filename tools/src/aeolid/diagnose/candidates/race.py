"""Fit hypotheses fully in the order of their promise, and only those that may still win (S5)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.control import survives_control
from aeolid.diagnose.candidates.refit import MAX_FINALISTS, Begun, begin, finalists, finish, left_behind
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.predictor.evaluation import RUN_AWAY
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank, Row

Array = NDArray[np.float64]


def fit_finalists(prepared: Prepared, bank: Bank, most: int | None = None) -> list[Candidate]:
    """Fit the finalists of a bank fully, best score first."""
    return sorted(fit_rows(prepared, finalists(bank)[:most]), key=lambda c: -c.score)


def fit_rows(prepared: Prepared, rows: Sequence[Row]) -> list[Candidate]:
    """Fit hypotheses, each in a model of its own; those whose every start diverges are left out.

    With a simulator's run as the baseline, where one fit takes seconds, a hypothesis that a brief fit leaves far behind
    an accepted one, or far below the bare baseline, is not fitted to the end: it is neither the answer nor a rival that
    data cannot tell apart. Not so with other baselines: gains chosen anew for a wrong sign or unit look worse at first
    than all else.
    """
    base_select = select_density(prepared) if rows else np.zeros(0)
    stages = [prepared.only([r.attachment]) for r in rows]
    begun = [b for b in (_begun(s, r) for s, r in zip(stages, rows, strict=True)) if b is not None]
    begun = [_simulated_too(b, rows, max(o.gain for o in begun)) for b in begun]
    begun.sort(key=lambda b: -b.gain)
    found: list[Candidate] = []
    leader: Candidate | None = None
    for place, b in enumerate(begun):
        reason = hopeless(b.gain, leader) if prepared.surrogate is not None else ""
        prepared.deadline.doing(" + ".join(a.key for a in b.attachments))
        candidate = left_behind(b, reason, base_select) if reason else finish(b, base_select)
        if candidate is None:
            continue
        ahead = leader is None or candidate.fit_gain > leader.fit_gain
        settles = any(hopeless(o.gain, candidate) and not hopeless(o.gain, leader) for o in begun[place + 1 :])
        if prepared.surrogate is not None and ahead and settles and is_accepted(candidate):
            candidate = replace(candidate, survived=survives_control(prepared, candidate))
            leader = candidate if candidate.survived else leader
        found.append(candidate)
    return found


def _begun(stage: Prepared, row: Row) -> Begun | None:
    """Fit a hypothesis briefly; None where every start diverges, or where the time for it is over."""
    if stage.deadline.skips(row.attachment.key):
        return None
    stage.deadline.doing(row.attachment.key)
    return begin(stage, stage.fit, [row])


def _simulated_too(begun: Begun, rows: Sequence[Row], best: float) -> Begun:
    """Return an effect with many optima begun from where the simulation leads, too, if it may come to lead.

    The play of a gear, 204 nats one step ahead from the best of 24 starts, has 1,265 from there.
    """
    own = begun.attachments[0]
    if not own.rugged or begun.gain < in_force().candidates.rugged_share * best:
        return begun
    if begun.prepared.deadline.skips(f"{own.key} from the simulation"):
        return begun
    row = next(r for r in rows if r.attachment.key == own.key)
    return begin(begun.prepared, begun.base, [row], simulated=True) or begun


def whispering(bank: Bank) -> list[Row]:
    """Return entries under the threshold that chance alone gives once in a hundred recordings, each by itself.

    They name nothing; but where values moved surely, something is there, and one of them may be what.
    """
    rules = in_force().candidates
    quiet = [r for r in bank.rows if r.testable and r.z <= bank.limit(r) and r.p_value <= rules.alone_level]
    return [r for r in quiet if r.attachment.entry not in ("parameter_error", unlisted.ID)]


def fit_whispering(prepared: Prepared, bank: Bank, fitted: Sequence[Candidate]) -> list[Candidate]:
    """Fit the best of those that whisper and were not fitted yet."""
    known = {c.key for c in fitted}
    return fit_rows(prepared, [r for r in whispering(bank) if r.attachment.key not in known][:MAX_FINALISTS])


def hopeless(gain: float, leader: Candidate | None) -> str:
    """Say why a brief fit's gain leaves no hope; empty where it leaves some."""
    rules = in_force().candidates
    if gain < -rules.far_nats:
        return f"{-gain:.0f} nats below the model without it"
    if leader is not None and gain < rules.far_share * leader.fit_gain and gain < leader.fit_gain - rules.far_nats:
        return f"{leader.key} is far ahead"
    return ""


def is_accepted(candidate: Candidate) -> bool:
    """Tell whether a candidate may go to the sealed data: proven on the selection data, or clear and not refuted there.

    The selection data are a fifth of all. An effect worth 81 nats with one parameter gained 7 ± 5 there; nothing of
    that size comes by chance, and the sealed data have the last word as always. One deviation below none they are
    silent still (a second heater's warmth: 33 nats, −5 ± 7, then four of five recordings in turn). The fit data must
    speak for it beyond what its parameters cost: where a simulator's model was bent to the fit data, two values worth
    5 nats there gained 36 and 126 on the other parts, of a recording that lacked nothing.
    """
    evidence = in_force().evidence
    if not candidate.plausible or candidate.fit_gain <= candidate.handicap:
        return False
    spread = float(np.sqrt(len(candidate.select_difference)) * np.std(candidate.select_difference))
    proven = candidate.select_gain > max(evidence.validation_nats, evidence.five_percent_z * spread)
    # a candidate with a smaller noise model than the baseline has fewer parameters, which is no gain of its own
    clear = candidate.fit_gain - max(candidate.parameters, 1) > evidence.clear_nats
    return proven or (clear and candidate.select_gain > -spread)


def select_density(prepared: Prepared) -> Array:
    """Return the baseline's log-density of each sample of the selection data; -1000 where it runs away.

    As in the proof: without a bound every candidate was infinitely better than the model of a pendulum that stands on
    its end, and none of them led.
    """
    bare = prepared.only(())
    density = bare.predictor.score_elsewhere(bare.fit, prepared.split.select)[0]
    return np.where(np.isfinite(density), density, RUN_AWAY)
