"""Hold out every recording or block once: what a choice made without it gains on it (S6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.candidates.plausible import objection
from aeolid.diagnose.candidates.refit import finalists
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.data.split import segments_of
from aeolid.diagnose.predictor.evaluation import RUN_AWAY
from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import Bank, score_bank
from aeolid.diagnose.selection.rivals import are_kin, rivals_of
from aeolid.diagnose.stats.blocks import block_interval
from aeolid.record import Record

Array = NDArray[np.float64]
_BLOCKS = {1: 5, 2: 3}  # blocks of each recording, where there are so few of them; else a recording is one
_MOST_FOLDS = 7
_FITTED = 6  # hypotheses that are fitted again without a fold
_ITERATIONS = 12  # Gauss–Newton iterations: each starts from values of most of these data
REPEATED = (
    "without each fold: the baseline's values, the score bank and its choice among the hypotheses that the whole search"
    " had fitted and found worth their parameters, their values, the best of these for what its parameters cost; not"
    " the starts of fits, nor which hypotheses were fitted at all"
)


@dataclass(frozen=True, eq=False)
class Fold:
    """Hold one part that was held out: what it is, the choice made without it (None: nothing), its gain on it."""

    name: str
    choice: Candidate | None
    difference: Array  # nats of each of its samples
    interval: tuple[float, float]

    @property
    def gain(self) -> float:
        """Return its nats."""
        return float(self.difference.sum())

    def to_json(self) -> dict[str, Any]:
        """Return the row of diagnosis.json."""
        return {
            "held_out": self.name, "choice": None if self.choice is None else self.choice.key, "nats": self.gain,
            "interval": list(self.interval), "samples": len(self.difference),
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Rotation:
    """Hold all folds, the interval of their sum, and whether most of them came to what is named."""

    folds: tuple[Fold, ...]
    interval: tuple[float, float]
    agrees: bool

    @property
    def gain(self) -> float:
        """Return the nats of all folds together."""
        return float(sum(f.gain for f in self.folds))

    @property
    def speaks(self) -> bool:
        """Tell whether what was chosen without each fold gains on all together, by enough to be seen in predictions."""
        samples = sum(len(f.difference) for f in self.folds)
        material = self.gain > in_force().validation.material_rate * samples
        return self.interval[0] > in_force().evidence.proven_nats and material

    @property
    def proves(self) -> bool:
        """Tell whether the folds together bear out what is named."""
        return self.agrees and self.speaks

    @property
    def against(self) -> tuple[Fold, ...]:
        """Return the folds that refute what most that are not silent bear out; none where it is not so."""
        least = in_force().evidence.proven_nats
        borne_out = sum(f.interval[0] > least for f in self.folds)
        found = tuple(f for f in self.folds if f.interval[1] < 0.0)
        most = in_force().validation.agreeing_share * (borne_out + len(found))
        return found if self.agrees and not self.proves and borne_out >= max(most, 2) else ()

    def to_json(self) -> dict[str, Any]:
        """Return the content of `rotation` in diagnosis.json."""
        return {
            "nats": self.gain, "interval": list(self.interval), "agrees": self.agrees, "proves": self.proves,
            "repeated": REPEATED, "folds": [f.to_json() for f in self.folds],
        }  # fmt: skip


def is_silent(interval: tuple[float, float]) -> bool:
    """Tell whether a sealed part neither bears out nor refutes."""
    return interval[0] <= in_force().evidence.proven_nats and interval[1] > 0.0


def rotate(
    prepared: Prepared, bank: Bank, candidates: Sequence[Candidate], named: Candidate, seed: int
) -> Rotation | None:
    """Hold out each recording, or block of one or two, and choose again without it; None where it cannot be done.

    Not on a simulator's run, where one fit takes half a minute. What is repeated is said in REPEATED. What is not worth
    its parameters on all data is no choice: a sensor's range, 1.8 nats, was chosen without one of seven groups and lost
    215 on that. Cost: for each of five to seven folds a bank and up to six fits from where they stand.
    """
    rules = in_force().validation
    names = [s.name for s in prepared.frame.working.inputs], [o.name for o in prepared.declared.outputs]
    stride = prepared.predictor.segments[0].stride
    parts = folds_of(prepared.records, *names, prepared.settle_s, stride) if prepared.surrogate is None else []
    if len(parts) < rules.fewest_folds:
        return None
    worth = [c for c in candidates if c.complete and c.plausible and c.score > 0]
    pool = [c for c in worth if len(c.attachments) == 1]
    starts = _Starts(prepared, [s for _, part in parts for s in part])
    folds = []
    for place, (name, held) in enumerate(parts):
        if prepared.deadline.skips("the proof by rotation"):
            return None
        rest = [s for k, (_, part) in enumerate(parts) if k != place for s in part]
        fold = _without(prepared, bank, pool, starts, (name, held, rest), seed)
        folds += [fold] if fold is not None else []
    if len(folds) < len(parts):
        return None
    chosen = [f.choice for f in folds if f.choice is not None]
    same = {named.key, *(c.key for c in rivals_of(candidates, named))}
    kin = [c for c in chosen if c.key in same or are_kin(c.attachments[0], named.attachments[0])]
    every = np.concatenate([f.difference for f in folds])
    return Rotation(tuple(folds), block_interval(every, seed), len(kin) >= rules.agreeing_share * len(folds))


def adds_in_turn(prepared: Prepared, fewer: Candidate, more: Candidate, seed: int) -> bool:
    """Tell whether a set of effects predicts parts held out in turn better than a smaller one, in most of them.

    Both are fitted anew without each part. Asked where the sealed part alone is silent; a bias of a sensor beside an
    effect is not asked about: any curve that is left has a mean.
    """
    rules = in_force().validation
    evidence = in_force().evidence
    names = [s.name for s in prepared.frame.working.inputs], [o.name for o in prepared.declared.outputs]
    parts = folds_of(prepared.records, *names, prepared.settle_s, prepared.predictor.segments[0].stride)
    if len(parts) < rules.fewest_folds or prepared.surrogate is not None or more.attachments[-1].entry == "sensor_bias":
        return False
    starts, gained = _Starts(prepared, [s for _, part in parts for s in part]), []
    for place, (_, held) in enumerate(parts):
        if prepared.deadline.skips("the proof of a further effect by rotation"):
            return False
        rest = [s for k, (_, part) in enumerate(parts) if k != place for s in part]
        pair = [_again(c.key, c.predictor, c.fit, starts, rest) for c in (fewer, more)]
        if pair[0] is None or pair[1] is None:
            return False
        less, greater = (predictor.score_elsewhere(fit, held)[0] for predictor, fit in (pair[0], pair[1]))
        gained.append(np.where(np.isfinite(greater), greater, RUN_AWAY) - np.where(np.isfinite(less), less, RUN_AWAY))
    every, better = np.concatenate(gained), sum(float(g.sum()) > 0 for g in gained)
    material = float(every.sum()) > rules.material_rate * len(every)
    proven = block_interval(every, seed)[0] > evidence.proven_nats and material
    return proven and better >= rules.agreeing_share * len(parts)


def folds_of(
    records: Sequence[Record], inputs: Sequence[str], outputs: Sequence[str], settle_s: float, stride: int = 1
) -> list[tuple[str, list[Segment]]]:
    """Return what is held out in turn, by name: recordings, grouped where they are many, or blocks of one or two."""
    blocks = _BLOCKS.get(len(records), 1)
    found: list[tuple[str, list[Segment]]] = []
    for record in records:
        cuts = np.linspace(0, len(record), blocks + 1).astype(int).tolist()
        for rows in pairwise(cuts):
            part = segments_of(record, rows, inputs, outputs, settle_s, stride)
            own = record.source.rsplit("/", 1)[-1]
            span = f" from {record.time_s[rows[0]]:.6g} s to {record.time_s[rows[1] - 1]:.6g} s" if blocks > 1 else ""
            found += [(own + span, part)] if part else []
    count = min(len(found), _MOST_FOLDS)
    groups = [found[k::count] for k in range(count)]
    return [(", ".join(n for n, _ in g), [s for _, part in g for s in part]) for g in groups]


class _Starts:
    """Know from which state a fitted predictor runs over each segment; asked for once."""

    def __init__(self, prepared: Prepared, segments: Sequence[Segment]) -> None:
        self._bare = prepared.only(())
        self._segments = list(segments)
        self._known: dict[str, dict[int, Array]] = {}

    def of(self, key: str, predictor: Predictor, fit: Fit, segments: Sequence[Segment]) -> tuple[Array, ...]:
        """Return the start states of these segments."""
        if key not in self._known:
            point = predictor.score_elsewhere(fit, self._segments)[2]
            self._known[key] = {id(s): x for s, x in zip(self._segments, point.x0, strict=True)}
        return tuple(self._known[key][id(s)] for s in segments)


def _without(
    prepared: Prepared, bank: Bank, pool: Sequence[Candidate], starts: _Starts,
    part: tuple[str, list[Segment], list[Segment]], seed: int,
) -> Fold | None:  # fmt: skip
    """Choose without one part, and return what the choice gains on it; None where the baseline cannot be fitted."""
    name, held, rest = part
    bare = prepared.only(())
    base = _again("", bare.predictor, bare.fit, starts, rest)
    if base is None:
        return None
    predictor, fit = base
    stage = replace(bare, predictor=predictor, fit=fit, split=replace(bare.split, fit=predictor.segments, select=()))
    rows = finalists(score_bank(stage, [c.attachments[0] for c in pool], seed, known=bank)) if pool else []
    by_key = {c.key: c for c in pool}
    best: tuple[float, Candidate, Predictor, Fit] | None = None
    for candidate in [by_key[r.attachment.key] for r in rows][:_FITTED]:
        found = _again(candidate.key, candidate.predictor, candidate.fit, starts, rest)
        if found is None:
            continue
        gain = found[1].log_posterior - fit.log_posterior
        own = replace(candidate, fit_density=found[1].per_sample)
        model = found[0].compiled.model
        if objection(candidate.attachments, found[1], model, gain, candidate.parameters):
            continue
        if gain - own.handicap > (0.0 if best is None else best[0]):
            best = gain - own.handicap, candidate, *found
    before = predictor.score_elsewhere(fit, held)[0]
    if best is None:
        return Fold(name, None, np.zeros_like(before), (0.0, 0.0))
    after = best[2].score_elsewhere(best[3], held)[0]
    difference = np.where(np.isfinite(after), after, RUN_AWAY) - np.where(np.isfinite(before), before, RUN_AWAY)
    return Fold(name, best[1], difference, block_interval(difference, seed))


def _again(
    key: str, predictor: Predictor, fit: Fit, starts: _Starts, segments: Sequence[Segment]
) -> tuple[Predictor, Fit] | None:
    """Fit once more to other data, from where a fit stands."""
    x0 = starts.of(key, predictor, fit, segments)
    other = predictor.on([s.head(len(s.y)) for s in segments])
    again = fit_quietly(other, replace(fit.point, x0=x0), fit.free, _ITERATIONS)
    return None if again is None else (other, again)
