"""Weigh candidates against each other: who is not told apart from the winner, and who outdoes it (S7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.hypotheses.catalogue import ENTRIES, entry
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.hypotheses.parts.base import Attachment
from aeolid.diagnose.hypotheses.parts.lateness import lateness, most_of_a_reading
from aeolid.diagnose.rules import in_force

Array = NDArray[np.float64]


def rivals_of(candidates: Sequence[Candidate], winner: Candidate) -> list[Candidate]:
    """List the candidates that the data do not tell from the winner: |Vuong z| below 2 on fit and selection data.

    Without those that the selection data refute, if softly; but one that is ahead all the same is the stronger for it
    (a gain that grows with the wind, 75 nats and −2, beside one that jumps, 35 and 0.4, which alone was allowed). One
    that gains nothing explains nothing: where few samples tell, z is small (a sensor without a sign, 0.002 nats, made a
    gain that switches, 34, `ambiguous`).
    """
    rules = in_force().selection
    result = []
    for other in candidates:
        if other is winner or other.unlisted or not other.plausible or other.fit_gain <= rules.told_apart_nats:
            continue
        if other.select_gain <= 0 and other.score <= winner.score:
            continue
        if not tells_apart(winner, other):
            result.append(other)
    return result


def one_of_each(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the first, and of the others the best of each that say the same: one entry, one place, one equation.

    A sensor's lag that replaces a reading and one that follows a state are two ways to work out one explanation.
    """
    found: dict[tuple[str, str, str], Candidate] = {}
    for c in (*candidates[:1], *sorted(candidates[1:], key=lambda c: -c.score)):
        found.setdefault(explanation(c.attachments[-1]), c)
    kept = set(map(id, found.values()))
    return [c for c in candidates if id(c) in kept]


def explanation(attachment: Attachment) -> tuple[str, str, str]:
    """Return what an effect says, however it is worked out: its entry, its place and its equation."""
    return attachment.entry, str(attachment.location["entry"]), attachment.equation or entry(attachment.entry).equation


def tells_apart(winner: Candidate, other: Candidate) -> bool:
    """Tell whether the data prefer a candidate to another one that has no more than its share of parameters.

    What more parameters gain by chance is taken off (Vuong 1989, section 5, with the penalty of Schwarz). Equal models
    differ by rounding, always to one side, and a value more of which the data say nothing does not part them. Nor do a
    few nats that come evenly: a lag of 8 ms, sampled every 20, beside a filter of second order, 1.9 nats ahead.
    """
    rules = in_force().selection
    difference = _difference(winner, other)
    fairly = _vuong(difference, other.handicap - winner.handicap)
    return fairly >= rules.vuong_z and abs(difference.sum()) >= rules.told_apart_nats


def are_kin(a: Attachment, b: Attachment) -> bool:
    """Tell whether two effects are of one family at one place: the same entry, or an output that both move."""
    at_one_place = a.location["entry"] == b.location["entry"] or set(a.location["outputs"]) & set(b.location["outputs"])
    return bool(at_one_place) and entry(a.entry).family == entry(b.entry).family


def outdone_by(candidates: Sequence[Candidate], named: Candidate) -> Candidate | None:
    """Return who explains far more than what would be named, with a value at its range's end or a form without a name.

    Then what is missing resembles that one more than anything that has a name here: naming the second best would be
    forced (a sensor 4 ms late, less than the least lag that is believed, was called a bending mode). |Vuong z| above 2
    and 10 nats are asked for; None where nobody is. One of the same family takes nothing: stick and slip fits a stage
    better than dry friction alone, with a force at its range's end; what is missing is friction all the same.
    A form that fits no worse is enough where the name is a sensor's factor that no calibrated sensor has. Nor does one
    whose range ends where it is what would be named: a slider whose spring yields at once is dry friction (a simulated
    joint's, which gives way a little before it slides, 57 nats ahead of dry friction); nor a mode that no input drives,
    which is the colour of the noise.
    """
    families = {entry(a.entry).family for a in named.attachments}
    ahead = [
        c for c in candidates
        if c.complete and ((c.at_end and not c.plausible and not c.undriven) or (c.unlisted and c.plausible))
        and (leads(c, named) or stands_for(named, c))
        and not families & {entry(a.entry).family for a in c.attachments} and not _ends_as(c, named)
    ]  # fmt: skip
    return max(ahead, key=lambda c: c.score, default=None)


def _ends_as(candidate: Candidate, named: Candidate) -> bool:
    """Tell whether a candidate ran to where it is an effect that would be named, known by that one's entry."""
    names = {a.entry for a in named.attachments}
    return any((label, name) in entry(a.entry).at_least for a, label in candidate.low_ends for name in names)


def late_ahead(candidates: Sequence[Candidate], named: Candidate, row_step: float) -> Candidate | None:
    """Return who explains far more than what would be named by a channel that is late by a part of a row.

    The way of taking samples can be that, and what bends to imitate it has no name: a filtered speed beside a position,
    0.09 rows apart, was named as a bending mode that fitted 120 nats worse. row_step: time of a row in s.
    """
    ahead = [c for c in late_by_a_reading(candidates, row_step) if leads(c, named)]
    return max(ahead, key=lambda c: c.score, default=None)


def late_by_a_reading(candidates: Sequence[Candidate], row_step: float) -> list[Candidate]:
    """Return those that say no more than that one channel is late by what the way of taking samples may be."""
    return [
        c for c in candidates
        if c.complete and not c.plausible and len(c.attachments) == 1
        and lateness({n: v for n, (v, _) in c.values[c.attachments[0].key].items()})
        < row_step * most_of_a_reading(c.attachments[0].entry)
    ]  # fmt: skip


def leads(ahead: Candidate, other: Candidate) -> bool:
    """Tell whether a candidate explains far more than another: 10 nats, some on the selection data, Vuong z > 2."""
    rules = in_force().selection
    return (
        ahead.score > other.score + rules.outdone_nats
        and ahead.select_gain > other.select_gain
        and _vuong(_difference(ahead, other), other.handicap - ahead.handicap) > rules.vuong_z
    )


def stands_for(factor: Candidate, form: Candidate) -> bool:
    """Tell whether a sensor's factor or bias only stands for a form outside the catalogue, which fits as well.

    A neglected loss in proportion to a temperature and a factor of its sensor are one linear model (289.9 and 289.5
    nats, factor 0.71). Of the two a sensor that is a third off is the stranger; and so is any factor that leaves
    declared values wrong which the form makes right (heat that is radiated: 62.9 and 62.7 nats, factor 1.12, beside it
    three values off by up to 27 %). A bias takes up the mean of any curve that is not even (a car's steering, 28.3 nats
    and 29.6 as a bend): of what fits within a nat of a form it says nothing.
    """
    rules = in_force().selection
    (first, *more) = factor.attachments
    if form.unlisted and not more and first.entry == "sensor_bias":
        return form.score > factor.score - in_force().evidence.tied_nats and not tells_apart(factor, form)
    if not form.unlisted or more or first.entry != "sensor_scale":
        return False
    value = factor.values[first.key]["factor"][0]
    stranger = not 1 / rules.far_off_ratio < value < rules.far_off_ratio or left_wrong(factor, form) > 0
    return stranger and not tells_apart(factor, form)


def weights_of(candidates: Sequence[Candidate]) -> list[float]:
    """Return weights that sum to one, by the odds of the candidates' scores and of what is more often wrong."""
    scores = np.array(standings(candidates))
    odds = np.exp(np.clip(scores - scores.max(), -50, 0))
    return [float(w) for w in odds / odds.sum()]


def leading(candidates: Sequence[Candidate]) -> Candidate | None:
    """Return the best; of those within a nat of it the one with the fewest parameters, then a wrong declared value.

    Then the first in the catalogue. A value that is wrong leaves the structure right: nothing need be missing.

    A dead time and a clock offset of one input are the same model: rounding must not choose. Nor between dry friction
    and sticking with nothing in excess, which were third effects in turn when only the selection data ranked them. A
    form outside the catalogue leads where no entry is left only; one that fits far better takes the entry's name in the
    verdict. Of sets the effects last added are compared. That the structure is right is one claim, whichever declared
    value is wrong: the best of them stands for all. A second-order drive or filter that nothing tells from the lag at
    its place, and that may be damped critically, leaves the lead to the lag.
    """
    evidence = in_force().evidence
    candidates = [c for c in candidates if not c.unlisted] or candidates
    scores = _taken_together(candidates, standings(candidates))
    order = [*(e.id for e in ENTRIES), unlisted.ID]
    if not candidates:
        return None
    best = candidates[int(np.argmax(scores))]
    tied = [
        c
        for c, s in zip(candidates, scores, strict=True)
        if max(scores) - s < evidence.tied_nats or _is_all_of(c, best)
    ]

    def rank(c: Candidate) -> tuple[int, bool, int]:
        last = c.attachments[-1].entry
        return c.parameters, last != "parameter_error", order.index(last)

    return min(tied, key=rank)


def _is_all_of(lag: Candidate, filtered: Candidate) -> bool:
    """Tell whether a first-order lag is all that a second-order one shows: nothing in it has to ring."""
    own, other = lag.attachments[-1], filtered.attachments[-1]
    if own.entry != entry(other.entry).without_ringing or own.location["entry"] != other.location["entry"]:
        return False
    damping, deviation = filtered.values[other.key]["damping"]
    return damping + 2 * deviation >= in_force().selection.critical_damping and not tells_apart(filtered, lag)


def standings(candidates: Sequence[Candidate]) -> list[float]:
    """Return the scores, less what is rarer than what is claimed by the others.

    A sensor's factor is behind by the log of 10 where a wrong declared value is among the others: a tower's mass and
    the factor of the accelerometer that alone shows it are one model, and a sensor has been calibrated, a constant was
    assumed. Who leaves a declared value wrong that is right beside another is behind by the log of 10 for each. So is a
    filter that rings, where a blade's bending is among the others: they are one model, and filters are damped.
    """
    rules = in_force().selection
    last = [c.attachments[-1].entry for c in candidates]
    rarer, coincidence = np.log(rules.rarer_odds), np.log(rules.coincidence_odds)
    behind = rarer if "parameter_error" in last else 0.0
    bent = [max((left_wrong(c, other) for other in candidates), default=0) for c in candidates]
    rings = [any(_rings_like(c, other) for other in candidates) for c in candidates]
    return [
        c.score - (behind if e == "sensor_scale" else 0.0) - coincidence * n - rarer * r
        for c, e, n, r in zip(candidates, last, bent, rings, strict=True)
    ]


def _rings_like(candidate: Candidate, other: Candidate) -> bool:
    """Tell whether one is a sensor's filter with less damping than filters have, the other a blade's bending there."""
    own, blade = candidate.attachments[-1], other.attachments[-1]
    if own.entry != "sensor_second_order" or not entry(blade.entry).bends:
        return False
    least = in_force().selection.damped_filter
    return candidate.values[own.key]["damping"][0] < least and own.location["outputs"] == blade.location["outputs"]


def _taken_together(candidates: Sequence[Candidate], scores: list[float]) -> list[float]:
    """Return the scores, the best of the wrong declared values with the odds of all of them.

    A mass, an inertia or one of two other values: each less likely than a torque that is 9 % low, together likelier.
    """
    values = [i for i, c in enumerate(candidates) if c.attachments[-1].entry == "parameter_error"]
    if not values:
        return scores
    best = max(values, key=scores.__getitem__)
    together = float(np.logaddexp.reduce([scores[i] for i in values]))
    return [together if i == best else s for i, s in enumerate(scores)]


def left_wrong(candidate: Candidate, other: Candidate) -> int:
    """Count the declared values that one leaves wrong and the other, which leaves no other value wrong, makes right.

    A stiffness is 8 % off beside an accelerometer's factor; beside a mass that is wrong it is as declared: one thing is
    wrong, not two that happen to fit. Right is what came at least twice as near. What both leave wrong, as values from
    data sheets are, decides nothing.
    """
    rules = in_force().selection
    theirs = {m.parameter.name for m in other.moved if m.is_wrong}
    wrong = [m for m in candidate.moved if m.is_wrong]
    if not theirs < {m.parameter.name for m in wrong}:
        return 0
    near = {m.parameter.name: m.distance for m in other.moved if m.parameter.name not in theirs}
    return sum(near.get(m.parameter.name, np.inf) <= rules.put_right_share * m.distance for m in wrong)


def leaves_open(winner: Candidate, other: Candidate, weight: float) -> bool:
    """Tell whether one that was not told apart is said as well.

    By its weight only: a sensor's factor beside a value, and who leaves values wrong that the winner makes right. And
    beside a wrong value, which leaves the structure right, what is missing must come near it: a mode 45 nats behind a
    mass that was wrong differed in bursts, so that z was below 2, and had a share of 2e-20 in what was told.
    """
    rules, pair = in_force().selection, (winner.attachments[0].entry, other.attachments[0].entry)
    if pair[0] == "parameter_error" != pair[1] and weight < np.exp(-rules.outdone_nats):
        return False
    rarer = pair == ("parameter_error", "sensor_scale") or left_wrong(other, winner) > 0
    return not rarer or weight >= 1 / rules.rarer_odds


def is_other(rival: Candidate, winner: Candidate) -> bool:
    """Tell whether a rival is another effect, or the same elsewhere: a sensor's factor is one over it of its neighbour.

    Which declared value is wrong is no such difference: the structure is right either way.
    """
    own, other = winner.attachments[0], rival.attachments[0]
    elsewhere = own.location["entry"] != other.location["entry"] and own.entry != "parameter_error"
    return own.entry != other.entry or elsewhere


def _difference(a: Candidate, b: Candidate) -> Array:
    """Return what each sample of fit and selection data gains by a over b."""
    return np.concatenate([a.fit_density - b.fit_density, a.select_difference - b.select_difference])


def _vuong(difference: Array, head_start: float = 0.0) -> float:
    """Return the sum and a head start over the sum's deviation, from blocks of N^(1/2) samples (Vuong 1989)."""
    length = max(1, int(np.sqrt(len(difference))))
    blocks = np.add.reduceat(difference, np.arange(0, len(difference), length))
    return float((blocks.sum() + head_start) / max(np.sqrt(len(blocks)) * np.std(blocks), 1e-12))
