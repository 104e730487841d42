"""Settle with the baseline how inputs go on between their samples and which instant a row belongs to (S1).

Whatever physics is left out, half a sample that nobody settled is found first and bends every value: at 60 dB the
damping of an oscillator came out 13 times too large, and a clock offset, a stop and a spring were named. So the hold of
each input, and one offset of all inputs against all outputs up to a sample either way, are chosen by the likelihood of
the fitted baseline, and once more beside the first effect, which may have hidden or imitated them.

What the likelihood may choose among depends on the recording:
- measured inputs (smooth, and likelier to move than to be held): straight or band-limited, any offset within a sample;
- commands (held for several samples, new at every sample up to the Nyquist frequency, or likeliest to be held): up to
  a sample early, which no drive can be, or late, or late and rounded as behind an anti-alias filter of all outputs. A
  drive faster than the sampling looks the same and is told with it; what is later than a sample is physics;
- feedback: an input that answers an output knows of its error, and let into the prediction of its own row it brings
  that along. What this may gain at most is a price to be paid; a case that says closed_loop has only a whole sample
  early.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.feedback import feedback_of
from aeolid.diagnose.candidates.sampling_choice import TINY, Choice, choice_of
from aeolid.diagnose.candidates.sampling_stage import THOROUGH, Stage, goes_on, is_slowest, stage_of
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.intersample import Sampling
from aeolid.diagnose.rules import in_force
from aeolid.models.intersample import FILTERED, HOLDS

Array = NDArray[np.float64]
_LEADERS, _ENDED = 4, 2  # kinds of effects beside which it is looked again; of those whose values ran to an end


def settle(case: Case, prepared: Prepared, winner: Candidate | None = None) -> Sampling | None:
    """Return the sampling under which the fit data are clearly likelier than as the stage reads them; None elsewhere.

    winner: the effect beside which to look, none by default. Clearly: by more than ln N nats, the price of two
    parameters in N rows (BIC). An optimum beyond a sample either way is no habit and is left to the catalogue. Models
    in discrete time were identified on rows and have their habit. Cost:
    sensitivities where the scores promise nothing, else some ten to twenty brief fits.
    """
    if prepared.surrogate is not None or not prepared.sampling.holds:
        return None
    stage, choice = stage_of(prepared, winner), choice_of(case, prepared)
    if stage is None:
        return None
    ended = winner is not None and winner.at_end  # where a value is held by its range, a slope tells nothing
    asked = ended or max(stage.promised) >= in_force().evidence.two_deviations_nats or _moves(stage, choice)
    best = _likelier(stage, choice) if asked else None
    if winner is None:
        return best
    plain = _as_plain(stage, choice, 0.0 if best is None else best.gain)
    if plain is not None or best is not None or not prepared.sampling.free:
        return plain or best
    offset, delay = (float(stage.point.theta[i]) for i in (stage.place, stage.delay))
    beside = replace(prepared.sampling, offset_s=offset, filter_s=delay)
    if abs(beside.late_s - prepared.sampling.late_s) < in_force().candidates.offset_moved_samples * stage.step:
        return None
    return _nearly_whole(stage, beside)


def _moves(stage: Stage, choice: Choice) -> bool:
    """Tell whether measured inputs promise something by going on between their rows, whatever one offset of all does.

    A wind from a mast beside a torque that is held: half a row of the one is none of the other, and a filter of the
    speed was told as 2.19 ± 0.03 rad/s for 1.9, 130 nats short.
    """
    holds = tuple((n, HOLDS[1] if n in choice.moving else h) for n, h in stage.sampling.holds)
    moved = replace(stage.sampling, holds=holds)
    return holds != stage.sampling.holds and stage.tried(moved).gain > in_force().evidence.two_deviations_nats


@dataclass(frozen=True, eq=False)
class Beside:
    """Hold an effect, the sampling that is likeliest beside it (None for the stage's own), and nats of the two."""

    candidate: Candidate
    sampling: Sampling | None
    value: float


def settle_beside(case: Case, prepared: Prepared, candidates: Sequence[Candidate]) -> list[Beside]:
    """Return the likeliest pairs of an effect and a sampling, best first, one of each sampling.

    An offset that a missing lag bent, or a curve that it hid, lets another effect lead: the best few of all kinds are
    fitted with what else the inputs may do (an analogue input half a sample off and a lag of six: 634 nats for the lag
    as the baseline alone reads the input, 984 for a mode that is not there). Leaving the plain reading has its price
    in this race, too (12.5 nats for a throttle one sample early beside one drive, and 12.5 more for another without).
    A reading that is wrong may drive a value to the end of its range, so the best of these are asked, too.
    """
    rows = sum(len(s.y) for s in prepared.predictor.segments)
    price = float(np.log(rows)) if prepared.sampling.is_plain else 0.0
    found: list[Beside] = []
    for c in _leaders(candidates):
        if prepared.deadline.skips("how inputs go on between samples, beside the effects found"):
            break
        own = settle(case, prepared, c)
        found.append(Beside(c, own, c.fit.log_posterior + (0.0 if own is None else own.gain - price)))
    best: dict[object, Beside] = {}
    for pair in sorted(found, key=lambda p: -p.value):
        best.setdefault(None if pair.sampling is None else (pair.sampling.holds, pair.sampling.is_filtered), pair)
    return list(best.values())


def _leaders(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the best of each kind of effect, and of those whose values ran to an end what nearly leads.

    Half of a blade's lift was late by 0.9 s and all outputs by a filter: with the inputs read as held and no filter
    1,214 nats for a lag, 1,105 for lift of which more than three quarters is late; with the filter 94 and 161.
    """
    share, led = in_force().selection.nearly_share, sorted(candidates, key=lambda c: -c.score)
    kinds: dict[str, Candidate] = {}
    for c in (c for c in led if c.plausible):
        kinds.setdefault(c.attachments[0].entry, c)
    best = list(kinds.values())[:_LEADERS]
    ended: dict[str, Candidate] = {}
    for c in (c for c in led if c.at_end and not (c.plausible or c.undriven) and c.attachments[0].entry not in kinds):
        ended.setdefault(c.attachments[0].entry, c)
    return best + [c for c in ended.values() if best and c.score > share * best[0].score][:_ENDED]


def _likelier(stage: Stage, choice: Choice) -> Sampling | None:
    """Return the best of what may be chosen where it is clearly likelier than as the stage reads its inputs.

    Where the best has a command that comes later than it may, that is physics, and the question is how inputs move
    between rows alone. One that moves and is late by a sample is like a held one late by half of one. A filter as slow
    as it may be is physics, too, but not what a lateness alone does nearly as well: what it adds may be a play, or a
    drive's range (two linear models, 0.7 rows late, had a dead time and a lag instead of these).
    """
    best = _best(stage, choice)
    if best is not None and not best.is_held and goes_on(stage, best):
        best = _best(stage, choice := replace(choice, moving=()))
    if best is not None and is_slowest(stage, best):
        choice = replace(choice, filtered=False)
        plainer = _best(stage, choice)
        share = in_force().candidates.late_share
        best = plainer if plainer is not None and plainer.gain > share * best.gain else best
    if best is not None and _is_too_late(stage, choice, best):
        choice = replace(choice, any_offset=False, late=False, early=False)
        best = _best(stage, choice)
    if best is None:
        return None
    price = _price(stage)
    if best.offset_s < 0 or (best.holds != stage.sampling.holds and not best.is_filtered):
        price += _feedback(stage, choice, best)
    clear = best.gain > price and choice.allows(best, stage.step)
    return best if clear and not goes_on(stage, best) else None


def _feedback(stage: Stage, choice: Choice, best: Sampling) -> float:
    """Return the nats that feedback may have lent the best reading: what innovations tell of inputs of their own row.

    Under a wrong reading they tell it in open loop, too, and nothing of it is left under the right one (an analogue
    command of a geared motor: 1,277 nats as held, 65 as it moves; the reading gained 1,106). A controller goes on to
    answer: of seven loops with P and PD controllers all of it was left, and early inputs gained nothing.
    """
    told = feedback_of(stage.predictor, stage.point, choice.kinds)
    if not told:
        return 0.0
    _, predictor, point = stage.fitted(best, THOROUGH)
    left = feedback_of(predictor, point, choice.kinds)
    return left if left < in_force().candidates.feedback_left_share * told else told


def _is_too_late(stage: Stage, choice: Choice, best: Sampling) -> bool:
    """Tell whether the best has a held command beside it whose lateness is more than a habit of the recording."""
    if not choice.allows(best, stage.step):
        return choice.any_offset or choice.late
    return best.is_held and best.late_s > 0 and goes_on(stage, best)


def _price(stage: Stage) -> float:
    """Return what two parameters cost in all rows, in nats (BIC)."""
    return float(np.log(sum(len(s.y) for s in stage.predictor.segments)))


def _as_plain(stage: Stage, choice: Choice, gain: float) -> Sampling | None:
    """Return the plain reading, what may be held is and nothing is offset, where no other is clearly likelier.

    Alone, a baseline reads its inputs early or late for the lag or the dead band that it lacks (a car's throttle 0.1 s
    early, 12.5 nats, and the lag of its drive was 0.1 s too long). The other reading must be worth its price beside
    what was found, too. gain: nats of the best other reading.
    """
    now, step = stage.sampling, stage.step
    holds = tuple((n, "zoh" if n in choice.moving or h == FILTERED else h) for n, h in now.holds)
    if not now.free and abs(now.offset_s) < TINY * step and holds == now.holds:
        return None
    plain = stage.tried(replace(now, holds=holds, offset_s=0.0, free=False), THOROUGH)
    return plain if plain.gain > gain - _price(stage) else None


def _best(stage: Stage, choice: Choice) -> Sampling | None:
    """Return the best of what may be chosen, fitted further, which may have carried it beyond that."""
    trials = [stage.tried(s) for s in choice.trials(stage.sampling, stage.step)]
    allowed = [s for s in trials if choice.allows(s, stage.step)]
    best = _likeliest(stage, allowed)
    late = _later(stage, choice, trials, best)
    if late is not None:
        return late
    if best is None or not np.isfinite(best.gain):
        return None
    return _finished(stage, choice, _not_early(allowed, best))


def _not_early(trials: Sequence[Sampling], best: Sampling) -> Sampling:
    """Return the best trial or, where that has inputs early, one that is as likely without.

    Nothing answers before it is asked. Beside a dead time of one input a row early takes the dead time along and leaves
    the other one early alone, as one that goes on between its rows is by half of that: 9.2 nats and 8.4, and a pitch
    command of 0.3 s was one of 0.401 ± 0.005 s.
    """
    if best.offset_s >= 0 or best.free:
        return best
    plain = max((s for s in trials if s.offset_s == 0 and not s.free), key=lambda s: s.gain, default=best)
    return plain if plain.gain > best.gain - in_force().evidence.two_deviations_nats else best


def _likeliest(stage: Stage, trials: list[Sampling]) -> Sampling | None:
    """Return the best trial; where one with a filter of the outputs gains, too, both kinds are fitted further first.

    A filter has one parameter more, a longer way: 967 nats for an offset's 966 after 4 iterations, 1,012 for 994 at 12.
    """
    half = 0.5 * _price(stage)
    kinds = [[s for s in trials if s.is_filtered is kind] for kind in (False, True)]
    leading = [max(kind, key=lambda s: s.gain) for kind in kinds if kind]
    if len(leading) > 1 and leading[1].gain > half:
        leading = [stage.tried(s, THOROUGH) if s.free else s for s in leading]
    return max(leading, key=lambda s: s.gain - half * s.is_filtered, default=None)


def _later(stage: Stage, choice: Choice, trials: list[Sampling], best: Sampling | None) -> Sampling | None:
    """Return the likeliest held command that is later than it may be, where that is likelier than all that may be.

    At exactly one sample late it may be again.
    """
    held = [s for s in trials if s.is_held and s.late_s > 0 and not choice.allows(s, stage.step)]
    late = max(held, key=lambda s: s.gain, default=None)
    if late is None or (best is not None and best.gain >= late.gain):
        return None
    return _nearly_whole(stage, late)


def _finished(stage: Stage, choice: Choice, best: Sampling) -> Sampling:
    """Return the best trial, fitted further, after each moving input had its chance of being held.

    Where that may be: of a command beside a measured input none is late, and a turbine's pitch and torque, 0.8 rows
    late and likelier by 4 nats with one of them held, were read plainly; a rate limit and a clock had names.
    """
    for name in choice.moving if len(choice.moving) > 1 else ():
        holds = tuple((n, "zoh" if n == name else h) for n, h in best.holds)
        if holds != best.holds:
            trial = stage.tried(replace(best, holds=holds))
            best = trial if trial.gain > best.gain and choice.allows(trial, stage.step) else best
    return _nearly_whole(stage, best) if best.free else best


def _nearly_whole(stage: Stage, sampling: Sampling) -> Sampling:
    """Return a sampling with its offset held at the nearest whole sample where that is as likely."""
    free = stage.tried(replace(sampling, free=True), THOROUGH)
    near = float(np.rint(free.offset_s / stage.step)) * stage.step
    exact = stage.tried(replace(free, offset_s=near, free=False), THOROUGH)
    return exact if exact.gain > free.gain - in_force().evidence.two_deviations_nats else free
