"""Find the white noise of sensors that a recording has and a simulator's run has not, by the floors of their spectra.

A predictor of noisy outputs leans on more of their past than one of clean outputs, so that noise of 5 % on every sensor
of a turbine and nothing else separates run and recording by hundreds of nats. What a machine does has faded at the
upper end of the spectrum; where the recording's floor there stands well above the run's, that is noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from aeolid.diagnose.data.forensics import Finding
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.pair import Pair, Side

Array = NDArray[np.float64]
_SEGMENT = 512  # samples of a segment of the spectrum
_FROM = 0.6  # of the Nyquist frequency, where the part begins that is looked at
_QUANTILE = 0.2  # of the spectrum there: lines and modes stand above


def sensor_noise(pair: Pair) -> Array:
    """Return the variance (l,) of each recorded output's white noise in its unit squared, 0 where none stands out."""
    recorded, simulated = _floors(pair.recordings), _floors(pair.runs)
    swing = _mean([s.y.var(axis=0) for s in pair.recordings], pair.recordings)
    of_run = _mean([s.y.var(axis=0) for s in pair.runs], pair.runs)
    swings = np.maximum(
        1.0, swing / np.maximum(of_run, 1e-300)
    )  # what swings less in the run has less floor there, too
    expected = simulated * swings
    variance: Array = np.where(recorded > in_force().run_prior.floor_ratio * expected, recorded - expected, 0.0)
    return variance


def in_blocks(pair: Pair, variance: Array) -> Array:
    """Return the deviations (shown,) of noise of outputs with that variance (l,) in blocks and the fixed frame.

    Of three blades the mean has a third of a blade's variance, cosine and sine part two thirds.
    """
    turning = {j for places in pair.blades for j in places}
    of_blocks = [variance[j] for j in range(len(variance)) if j not in turning]
    for places in pair.blades:
        mean = float(np.mean(variance[list(places)])) / len(places)
        of_blocks += [mean, 2 * mean, 2 * mean]
    deviations: Array = np.sqrt(np.array(of_blocks) / pair.stride)
    return deviations


def noise_findings(pair: Pair, units: Mapping[str, str]) -> tuple[Finding, ...]:
    """Say which outputs have noise that the simulation has not: it is no finding about the machine."""
    deviations = np.sqrt(sensor_noise(pair))
    text = "white noise of {0:.3g} {1} that the simulation has not; both sides are compared as if they had it"
    return tuple(
        Finding("noise", name, text.format(d, units.get(name, "")), "info")
        for name, d in zip(pair.outputs, deviations, strict=True)
        if d > 0 and pair.noise is not None
    )


def _floors(sides: Sequence[Side]) -> Array:
    """Return the variance (l,) of white noise that has the floor of each output's spectrum, over sides by length."""
    return _mean([_floor(s) for s in sides], sides)


def _mean(values: Sequence[Array], sides: Sequence[Side]) -> Array:
    found: Array = np.average(values, axis=0, weights=[len(s) for s in sides])
    return found


def _floor(side: Side) -> Array:
    frequency, density = welch(side.y, 1.0 / side.step, nperseg=min(_SEGMENT, len(side)), axis=0)
    nyquist = 0.5 / side.step
    floor: Array = np.quantile(density[frequency > _FROM * nyquist], _QUANTILE, axis=0) * nyquist
    return floor
