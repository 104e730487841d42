"""Measure how well a model fits recordings: one-step, k-step and free run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable
from aeolid.models.load import matched, require_sample_time
from aeolid.models.prediction import bridged_stretches, estimate_initial_state, free_run, nrmse, predict_ahead, vaf
from aeolid.models.state_space import StateSpace
from aeolid.record import Record

Array = NDArray[np.float64]
SHORTEST = 10  # complete samples; a stretch with fewer says nothing about a free run
NONE = f"no {SHORTEST} samples in a row without a missing input, nor with outputs in them"
DIVERGES = -1e4  # percent of variance accounted for: an error of ten standard deviations
LEFT = 0.1  # of the errors' number, at least, that first states are taken to leave
LONGEST = 200_000  # samples of each recording that are used: enough for three digits, bounded memory


@dataclass(frozen=True)
class Score:
    """Hold VAF in percent and NRMSE (rms error / standard deviation) for each output name.

    constant: outputs that do not vary where they were recorded, of which neither is defined: not a number in both.
    """

    vaf: dict[str, float]
    nrmse: dict[str, float]
    constant: tuple[str, ...] = ()

    @property
    def worst_vaf(self) -> float | None:
        """Return the lowest VAF of the outputs that have one, NaN where one diverges; None where none has."""
        values = [v for name, v in self.vaf.items() if name not in self.constant]
        return float(np.min(values)) if values else None

    def diverges(self, name: str) -> bool:
        """Say whether an estimate is off by more than ten standard deviations of an output, or not a number."""
        return name not in self.constant and not self.vaf[name] >= DIVERGES

    def text(self, name: str) -> str:
        """Return the scores of one output as text; "diverges" for a free run that left all bounds."""
        if name in self.constant:
            return "no score: the recorded output is constant"
        if self.diverges(name):
            return "diverges"
        return f"VAF {self.vaf[name]:.2f} % (NRMSE {self.nrmse[name]:.4f})"

    def to_json(self) -> dict[str, Any]:
        """Return {"vaf": …, "nrmse": …}; a value that is not finite (a diverging model, no score) as null.

        Where outputs are constant, "constant" lists them.
        """
        tables = (("vaf", self.vaf), ("nrmse", self.nrmse))
        facts = {key: {n: v if np.isfinite(v) else None for n, v in table.items()} for key, table in tables}
        return facts | ({"constant": list(self.constant)} if self.constant else {})


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold the fit on a set of recordings; `steps` maps a horizon k to its score.

    samples: complete ones; innovations (N, l): of the stretches one after the other, not a number where y is missing;
    lengths: of the stretches, each of which has its own first state; driven: whether the model has an input; without
    one a free run only decays and is no measure of it.
    """

    samples: int
    one_step: Score
    free_run: Score
    steps: dict[int, Score]
    innovations: Array
    driven: bool = True
    lengths: tuple[int, ...] = ()

    def covariance(self, order: int) -> Array | None:
        """Return the covariance (l, l) of the innovations of a model of n states, None where they do not tell it.

        A first state that is fitted in each stretch takes n of the errors' freedoms, n/l of its samples.
        """
        e = self.innovations[np.isfinite(self.innovations).all(axis=1)]
        if len(e) < 2:
            return None
        left = len(e) - 1 - order * len(self.lengths) / e.shape[1]
        apart = e - e.mean(axis=0)
        found: Array = apart.T @ apart / max(left, LEFT * len(e))
        return found if np.isfinite(found).all() else None

    def to_json(self) -> dict[str, Any]:
        """Return the scores as JSON facts."""
        free = self.free_run.to_json() if self.driven else None
        facts = {"samples": self.samples, "one_step": self.one_step.to_json(), "free_run": free}
        return facts | {"k_step": {str(k): s.to_json() for k, s in self.steps.items()}}


def stretches(model: StateSpace, record: Record, longest: int = LONGEST) -> Iterator[tuple[int, Array, Array]]:
    """Yield (first sample, u (N, r), y (N, l)) of each stretch of a recording, in the channels' units.

    Gaps of outputs are bridged as in `bridged_stretches`; y is not a number there.
    """
    require_sample_time(model, record)
    head = record.slice(0, longest) if len(record) > longest else record
    u, y = matched(head, model.inputs), matched(head, model.outputs)
    for start, stop in bridged_stretches(u, y, SHORTEST):
        yield start, u[start:stop], y[start:stop]


def measure_fit(model: StateSpace, records: Sequence[Record], steps: Sequence[int] = ()) -> Fit:
    """Predict and simulate the recordings with the model.

    steps: horizons k > 1 of the k-step prediction, default none. Each stretch starts from its own estimated state, and
    runs through short gaps of the outputs; at most 200 000 samples of each recording are used. Raises NotIdentifiable
    where no stretch is left.
    """
    parts: list[tuple[Array, ...]] = []
    for record in records:
        for _, u, y in stretches(model, record):
            x0 = estimate_initial_state(model, u - model.u_offset, y - model.y_offset)
            with np.errstate(all="ignore"):  # an unstable model may overflow: its score is then not finite
                ahead = predict_ahead(model, u, y, (1, *steps), x0)
                parts.append((y, free_run(model, u, x0), *ahead))
    if not parts:
        raise NotIdentifiable(f"{records[0].source}: {NONE}")
    y, free, one, *later = (np.concatenate(column) for column in zip(*parts, strict=True))
    names = [s.name for s in model.outputs]
    scores = [score(names, y, estimate) for estimate in later]
    ahead_by = dict(zip(steps, scores, strict=True))
    lengths = tuple(len(part[0]) for part in parts)
    first, free_score = score_one_step(names, y, one, model.order, lengths), score(names, y, free)
    return Fit(count_complete(y), first, free_score, ahead_by, y - one, bool(model.inputs), lengths)


def score_one_step(names: Sequence[str], y: Array, one: Array, order: int, lengths: Sequence[int]) -> Score:
    """Return the score of one-step predictions (N, l) of a model of n states whose starts in the stretches are fitted.

    Every start but the first takes n/l samples' freedom from the errors, which are made larger by as much: a recording
    in pieces is then told as it would be in one.
    """
    count = max(count_complete(y), 1)
    left = count - order * (len(lengths) - 1) / y.shape[1]
    return score(names, y, y - (y - one) * np.sqrt(count / max(left, LEFT * count)))


def count_complete(y: Array) -> int:
    """Return how many samples of y (N, l) are complete."""
    return int(np.isfinite(y).all(axis=1).sum())


def score(names: Sequence[str], y: Array, estimate: Array) -> Score:
    """Return the score of an estimate (N, l) of y (N, l); samples missing in either are left out."""
    still = [len(column) > 0 and bool(np.all(column == column[0])) for column in (c[np.isfinite(c)] for c in y.T)]
    with np.errstate(all="ignore"):  # what rounding leaves of a constant's variance is no measure
        tables = (np.where(still, np.nan, t) for t in (vaf(y, estimate), nrmse(y, estimate)))
        explained, errors = ({n: float(v) for n, v in zip(names, t, strict=True)} for t in tables)
    return Score(explained, errors, tuple(n for n, s in zip(names, still, strict=True) if s))
