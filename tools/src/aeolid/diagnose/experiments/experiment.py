"""Compute which experiment would tell two explanations apart soonest (S7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared
from aeolid.diagnose.candidates.candidate import Candidate
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.validation.proof import imitate
from aeolid.record import Channel

Array = NDArray[np.float64]
_AMPLITUDES = (1.0, 2.0)  # of the input's own spread
_DWELLS = (1, 4, 16, 64)  # samples a level is held
_LADDER = (-2.0, -1.0, 0.0, 1.0, 2.0, 1.0, 0.0, -1.0)  # levels, in spreads
_RUNG = 40  # samples
_BEST = 3  # experiments for which the wrong model may adapt itself to the data
_ITERATIONS = 8
_MOST_ROWS = 1500  # of what is simulated


@dataclass(frozen=True)
class Experiment:
    """Hold a test signal on one input: its name, unit, amplitude, kind, and the seconds each level is held."""

    channel: str
    unit: str
    amplitude: float
    kind: str
    dwell_s: float

    def says(self) -> str:
        """Describe it as an instruction."""
        size = f"{self.amplitude:.3g} {self.unit if self.unit != '1' else ''}".strip()
        if self.kind == "ladder":
            return f"step {self.channel} up and down a ladder of {size} a rung, {self.dwell_s:.3g} s each"
        return f"add pseudo-random steps of ±{size} with a dwell of {self.dwell_s:.3g} s to {self.channel}"

    def signal(self, rows: int, step: float, seed: int) -> Array:
        """Return the test signal (rows,) of a recording with this sample time."""
        held = max(round(self.dwell_s / step), 1)
        count = rows // held + 1
        if self.kind == "ladder":
            levels = np.resize(np.array(_LADDER), count)
        else:
            levels = np.random.default_rng(seed).choice(np.array([-1.0, 1.0]), count)
        result: Array = self.amplitude * np.repeat(levels, held)[:rows]
        return result


@dataclass(frozen=True)
class Advice:
    """Hold the best experiment and the evidence it brings at least, nats a minute, whichever model is true."""

    experiment: Experiment
    nats_a_minute: float

    @property
    def minutes(self) -> float:
        """Return how long to record for odds of 400 to 1."""
        return float(max(1.0, np.ceil(in_force().experiments.decided_nats / self.nats_a_minute)))


def advise(
    prepared: Prepared, inputs: Sequence[Channel], rivals: tuple[Candidate, Candidate], seed: int
) -> Advice | None:
    """Return the experiment of a menu that tells the rivals apart soonest; None where none would in four hours.

    inputs: the channels that can be moved.

    Menu: pseudo-random steps and a ladder on each input, at its own spread and twice that. Each rival makes a recording
    of each (its own noise, the recorded inputs with the test signal on top), both are held against it, and the smaller
    of the two expected log-likelihood ratios counts. For the best few both are fitted anew to that recording first: a
    wrong model gives what its parameters can. Cost: two filter passes an experiment, four fits for each of the best.
    """
    rules = in_force().experiments
    stretch = stretch_of(prepared)
    menu = menu_of(prepared, inputs, stretch)
    ranked = sorted(((_evidence(rivals, stretch, prepared, e, seed, 0), i) for i, e in enumerate(menu)), reverse=True)
    best: Advice | None = None
    for rough, i in ranked[:_BEST]:
        rate = _evidence(rivals, stretch, prepared, menu[i], seed, _ITERATIONS) if rough > 0 else 0.0
        if rate > rules.decided_nats / rules.most_minutes and (best is None or rate > best.nats_a_minute):
            best = Advice(menu[i], rate)
    return best


def stretch_of(prepared: Prepared) -> Segment:
    """Return the longest stretch of the fitting part, at most some thousand rows of it."""
    longest = max(prepared.split.fit, key=lambda s: len(s.y))
    return longest.head(min(len(longest.y), _MOST_ROWS))


def menu_of(prepared: Prepared, inputs: Sequence[Channel], stretch: Segment) -> list[Experiment]:
    """Return the experiments to choose from: steps held for 1 to 64 samples and a ladder, on each input that moves."""
    found, units = [], {c.name: c.unit for c in inputs}
    for place, s in enumerate(prepared.declared.inputs):
        spread = float(np.nanstd(stretch.u[:, place]))
        if s.name not in units or not spread > 0:
            continue
        unit = units[s.name]
        found += [Experiment(s.name, unit, a * spread, "steps", d * stretch.step) for a in _AMPLITUDES for d in _DWELLS]
        found.append(Experiment(s.name, unit, spread, "ladder", _RUNG * stretch.step))
    return found


def _evidence(
    rivals: tuple[Candidate, Candidate], stretch: Segment, prepared: Prepared, test: Experiment, seed: int,
    iterations: int,
) -> float:  # fmt: skip
    """Return the nats a minute by which the true rival leads, whichever is true at least; −inf where one diverges."""
    rules = in_force().experiments
    place = [s.name for s in prepared.declared.inputs].index(test.channel)
    u = stretch.u.copy()
    u[:, place] += test.signal(len(u), stretch.fine_step, seed)
    planned = replace(stretch, u=u)
    rates = []
    for true, other in (rivals, rivals[::-1]):
        made = _recorded(true, planned, seed)
        values = [_likelihood(c, made, iterations) for c in (true, other)]
        if made is None or values[0] is None:
            return -np.inf
        ahead = values[0] - values[1] if values[1] is not None else rules.decided_nats * len(stretch.y)
        rates.append(ahead / (len(stretch.y) * stretch.step / 60))
    return float(min(rates))


def _recorded(true: Candidate, planned: Segment, seed: int) -> Segment | None:
    """Return what a rival would answer to the planned inputs, None where it runs away."""
    point = replace(true.fit.point, x0=true.fit.point.x0[:1])
    made = imitate(true.predictor, true.fit, [planned], point, np.random.default_rng(seed))[0]
    known = np.isfinite(planned.y)
    return made if np.all(np.isfinite(made.y[known])) and np.max(np.abs(made.y[known]), initial=0.0) < 1e12 else None


def _likelihood(candidate: Candidate, made: Segment | None, iterations: int) -> float | None:
    if made is None:
        return None
    predictor = candidate.predictor.on([made])
    point = replace(candidate.fit.point, x0=candidate.fit.point.x0[:1])
    if not iterations:
        value = predictor.objective(point)
        return -value if value < 1e299 else None
    fit = predictor.fit(point, candidate.fit.free, iterations)
    return None if fit is None else fit.log_likelihood


def describe(advice: Advice | None, ids: Sequence[str], hint: str, inputs: bool = True) -> dict[str, object]:
    """Return the entry of diagnosis.json: what to record, for how long, and what it tells apart.

    inputs: whether the recording has any that a test signal could be put on.
    """
    rules = in_force().experiments
    pair = f"{ids[0]} and {ids[1]}"
    if advice is None and not inputs:
        text = (
            f"To decide between {pair}: {hint}. The recording has no input that steps could be put on: record from"
            " another start, with another sensor or at another operating point"
        )
        return {"text": text, "minutes": 0, "separates": list(ids)}
    if advice is None:
        text = (
            f"To decide between {pair}: {hint}. No steps on the recorded inputs, up to twice their present spread,"
            f" would decide within {rules.most_minutes / 60:g} hours: another sensor or another operating point is"
            " needed"
        )
        return {"text": text, "minutes": 0, "separates": list(ids)}
    rate = advice.nats_a_minute
    text = (
        f"To decide between {pair}: {advice.experiment.says()} for {advice.minutes:.0f} min; simulated with either one,"
        f" it brings {rate:.3g} nats a minute at least, odds of 400 to 1 in that time ({hint})"
    )
    return {"text": text, "minutes": advice.minutes, "separates": list(ids)}
