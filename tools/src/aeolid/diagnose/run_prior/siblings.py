"""Tell which of several like blades a fault is of: by how each stands among its siblings.

A predictor in the fixed frame sees that one blade is scaled, or that two are swapped, and hardly which. Levels of the
blades among each other and the phase in which each goes once round with the rotor's angle say it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Pair, Side
from aeolid.diagnose.run_prior.search import Scored

Array = NDArray[np.complex128]
_KINDS = ("sensor_scale", "sensor_sign", "data_channel_swap")


def of_blades(
    pair: Pair, best: Scored, rivals: Sequence[Scored], table: Sequence[Scored]
) -> tuple[Scored, tuple[Scored, ...]]:
    """Return the likeliest of a hypothesis, its rivals and its like of other blades, and those not told from it.

    table: every hypothesis with its gain. All as they were where they are not of blades of one set, or where no rotor
    angle is known.
    """
    sides, rules = (*pair.recordings, *pair.runs), in_force().run_prior
    blades = next((b for b in pair.blades if all(_is_of(s, b) for s in (best, *rivals))), ())
    if not blades or any(s.azimuth is None for s in sides):
        return best, tuple(rivals)
    least = rules.explained_share * best.nats
    like = [s for s in table if s.hypothesis.entry == best.hypothesis.entry and s.nats > least and _is_of(s, blades)]
    every = [best, *rivals, *(s for s in like if s is not best and s not in rivals)]
    recorded = _of_all(pair.recordings, blades, NOTHING)
    miss = [float(np.sum(np.abs(recorded - _of_all(pair.runs, blades, s.change)) ** 2)) for s in every]
    order = np.argsort(miss)
    near = rules.sibling_ratio * miss[order[0]]
    return every[order[0]], tuple(every[k] for k in order[1:] if miss[k] < near)


def _is_of(scored: Scored, blades: tuple[int, ...]) -> bool:
    """Tell whether a hypothesis scales blades of a set or takes them for each other."""
    change = scored.change
    moved = {j for j, k in enumerate(change.order) if j != k} | set(change.outputs)
    return bool(moved) and moved <= set(blades) and not change.inputs and scored.hypothesis.entry in _KINDS


def _of_all(sides: Sequence[Side], blades: tuple[int, ...], change: Change) -> Array:
    """Return how each blade stands among its set (2, blades): level, and cosine and sine of the rotor's angle.

    Both are parts of the set's mean level, so that other wind on the other side is none of it.
    """
    found: Array = np.mean([_of(s, blades, change) for s in sides], axis=0)
    return found


def _of(side: Side, blades: tuple[int, ...], change: Change) -> Array:
    assert side.azimuth is not None
    y = side.y.copy()
    for j, f in change.outputs.items():
        y[:, j] = f(y[:, j], side.step)
    y = (y[:, list(change.order)] if change.order else y)[:, list(blades)]
    good = ~side.missing
    angle = side.azimuth[good] + change.turned
    waves = np.column_stack([np.ones(len(angle)), np.cos(angle), np.sin(angle)])
    level, cosine, sine = np.linalg.solve(waves.T @ waves, waves.T @ y[good])
    found: Array = np.vstack([level - level.mean(), cosine + 1j * sine]) / level.mean()
    return found
