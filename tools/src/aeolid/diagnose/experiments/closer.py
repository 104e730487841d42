"""Compute which experiment would show what this recording is too quiet or too short to show (S7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.experiments.experiment import Experiment, menu_of, stretch_of
from aeolid.diagnose.hypotheses.catalogue import entry
from aeolid.diagnose.hypotheses.generic import unlisted
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.directions import deviations
from aeolid.diagnose.scoring.scores import Bank, Row, minimum_detectable
from aeolid.diagnose.validation.proof import imitate
from aeolid.record import Channel

Array = NDArray[np.float64]
_TOLD = 3  # effects whose sizes are told
_ROWS = 400  # of what is simulated
_FARTHEST = 1e12  # what a planned recording may reach


@dataclass(frozen=True)
class Closer:
    """Hold an experiment and what it would show, in a recording as long as the data of this fit.

    finer: median of how many times smaller an effect shows; count: effects that it is of; sizes: of those that gain
    most id, parameter, unit, smallest size now and then; new: ids that this recording cannot test.
    """

    experiment: Experiment
    minutes: float
    finer: float
    count: int
    sizes: tuple[tuple[str, str, str, float, float], ...]
    new: tuple[str, ...]

    def says(self) -> str:
        """Describe what to record and what would show."""
        parts = [f"effects {self.finer:.2g} times smaller in the median of {self.count}"] if self.count else []
        if self.sizes:
            told = [
                f"{i} {'' if label == i else label + ' '}{now:.2g} → {then:.2g} {unit}".strip()
                for i, label, unit, now, then in self.sizes
            ]
            parts[-1] += f" ({'; '.join(told)})"
        if self.new:
            parts.append(f"{', '.join(self.new)}, which this recording cannot test")
        return (
            f"To look closer: {self.experiment.says()} for {self.minutes:.0f} min; by simulation that shows"
            f" {', and '.join(parts)}"
        )


def look_closer(prepared: Prepared, inputs: Sequence[Channel], bank: Bank, seed: int) -> Closer | None:
    """Return the experiment of the menu that lowers the smallest sizes most; None where none does so by a quarter.

    inputs: the channels that can be moved; bank: scores of the recording, whose thresholds count. The baseline makes a
    recording of each experiment, the recorded inputs with the test signal on top, and all hypotheses are scored on it:
    how surely a small effect is seen is the inverse of its deviation there, against that of the same stretch without
    the signal. Cost: one pass of the score bank an experiment.
    """
    rules = in_force().experiments
    longest = stretch_of(prepared)
    stretch = longest.head(min(len(longest.y), _ROWS))
    asked = [r for r in bank.rows if r.attachment.entry != unlisted.ID and not r.attachment.always_fit]
    plain = _seen(prepared, stretch, asked, seed)
    best: tuple[float, Experiment, dict[str, float]] | None = None
    for test in feasible(menu_of(prepared, inputs, stretch), stretch.step):
        if prepared.deadline.skips("some of the experiments that would show more"):
            break
        u = stretch.u.copy()
        place = [s.name for s in prepared.declared.inputs].index(test.channel)
        u[:, place] += test.signal(len(u), stretch.fine_step, seed)
        found = _seen(prepared, replace(stretch, u=u), asked, seed)
        ratios = {k: _ratio(plain.get(k, 0.0), v) for k, v in found.items() if v > 0}
        ratios |= {k: 1 / rules.most_finer_ratio for k, v in plain.items() if v > 0 and k not in ratios}
        value = float(np.mean([np.log(r) for r in ratios.values()])) if ratios else 0.0
        if best is None or value > best[0]:
            best = value, test, ratios
    return None if best is None else _told(prepared, best[1], best[2], asked, bank, plain)


def feasible(menu: Sequence[Experiment], step: float) -> list[Experiment]:
    """Return a menu's loudest steps of each dwell, without those held for one sample, which no drive follows."""
    most: dict[tuple[str, float], Experiment] = {}
    for test in menu:
        key = test.channel, test.dwell_s
        if (
            test.kind == "steps"
            and test.dwell_s > 1.5 * step
            and (key not in most or most[key].amplitude < test.amplitude)
        ):
            most[key] = test
    return list(most.values())


def _ratio(before: float, after: float) -> float:
    most = in_force().experiments.most_finer_ratio
    return float(np.clip(after / before, 1 / most, most)) if before > 0 else most


def _seen(prepared: Prepared, planned: Segment, asked: Sequence[Row], seed: int) -> dict[str, float]:
    """Return for each hypothesis, by key, the inverse deviation of its size; nothing where the model runs away."""
    bare = prepared.only(())
    point = replace(bare.fit.point, x0=bare.fit.point.x0[:1])
    made = imitate(bare.predictor, bare.fit, [planned], point, np.random.default_rng(seed))[0]
    known = np.isfinite(planned.y)
    if not np.all(np.isfinite(made.y[known])) or np.max(np.abs(made.y[known]), initial=0.0) > _FARTHEST:
        return {}
    predictor = bare.predictor.on([made])
    if predictor.objective(point) >= 1e299:
        return {}
    world = replace(bare, predictor=predictor, fit=predictor.at(point, bare.fit.free))
    return {key: 1.0 / std for key, std in deviations(world, [r.attachment for r in asked]).items() if std > 0}


def _told(
    prepared: Prepared, test: Experiment, ratios: dict[str, float], asked: Sequence[Row], bank: Bank,
    plain: dict[str, float],
) -> Closer | None:  # fmt: skip
    old = {k: r for k, r in ratios.items() if plain.get(k, 0.0) > 0}
    named = {r.attachment.key: r for r in asked}
    new = tuple(dict.fromkeys(named[k].attachment.entry for k in ratios if k not in old))
    finer = float(np.median(list(old.values()))) if old else 1.0
    if finer < in_force().experiments.finer_ratio and not new:
        return None
    sizes: dict[str, tuple[str, str, str, float, float]] = {}
    for key, ratio in sorted(old.items(), key=lambda p: -p[1]):
        row = named[key]
        least = minimum_detectable(row, bank.fair) if row.testable and not row.graded else {}
        plainly = {s.label: s for s in row.attachment.slots if s.label in least and s.show is float}
        family = entry(row.attachment.entry).family
        if plainly and family not in sizes and ratio > 1:
            label, slot = next(iter(plainly.items()))
            now, unit = abs(float(least[str(label)]["value"])), "" if slot.unit == "1" else slot.unit
            sizes[family] = (row.attachment.entry, str(label), unit, now, now / ratio)
    rows = sum(len(s.y) - s.burn for s in prepared.split.fit)
    minutes = float(np.ceil(rows * prepared.split.fit[0].step / 60))
    return Closer(test, minutes, finer, len(old), tuple(sizes.values())[:_TOLD], new)


def describe_closer(closer: Closer | None, inputs: bool = True) -> dict[str, object]:
    """Return the entry of diagnosis.json. inputs: whether the recording has any that steps could be put on."""
    if closer is None:
        text = "To look closer, record longer: the smallest size that shows falls with the square root of the time"
        if inputs:
            text += ". Steps on the recorded inputs, up to twice their present spread, would not show appreciably more"
        return {"text": text, "minutes": 0, "separates": []}
    return {"text": closer.says(), "minutes": closer.minutes, "separates": []}
