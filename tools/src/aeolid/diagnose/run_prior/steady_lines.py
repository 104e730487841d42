"""Compare loads that keep step with the rotor between recordings and runs: what the runs lack must have grown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.run_prior.pair import Pair, Side

Array = NDArray[np.float64]


def grown_line(pair: Pair, order: int) -> float:
    """Return the largest ratio over outputs of the line at `order` a revolution, recordings over runs.

    A line is what keeps step with the rotor's angle, so that turbulence of the same frequency averages out. 0 where no
    angle is known; infinite where the runs have no line. Cost: one pass over the samples.
    """
    recorded, run = (_lines(sides, order) for sides in (pair.recordings, pair.runs))
    if recorded is None or run is None:
        return 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.max(np.where(recorded > 0, recorded / run, 0.0)))


def _lines(sides: Sequence[Side], order: int) -> Array | None:
    """Return the mean amplitude (l,) of the line over sides that have an angle, by their samples; None for none."""
    known = [s for s in sides if s.turned is not None]
    if not known:
        return None
    found: Array = np.average([_amplitude(s, order) for s in known], axis=0, weights=[len(s) for s in known])
    return found


def _amplitude(side: Side, order: int) -> Array:
    """Return the amplitude (l,) of cosine and sine of the angle that fit the outputs best, beside a constant."""
    assert side.turned is not None
    good = ~side.missing & np.isfinite(side.turned) & np.all(np.isfinite(side.y), axis=1)
    angle = order * side.turned[good]
    waves = np.column_stack([np.ones(len(angle)), np.cos(angle), np.sin(angle)])
    gram = waves.T @ waves + 1e-9 * len(angle) * np.eye(3)
    found = np.linalg.solve(gram, waves.T @ side.y[good]) if len(angle) else np.zeros((3, side.y.shape[1]))
    amplitude: Array = np.hypot(found[1], found[2])
    return amplitude
