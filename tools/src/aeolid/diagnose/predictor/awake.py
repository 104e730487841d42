"""Move noise that a fit left far off: a silent amplitude has hardly a slope, and a sensor no longer heard has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.predictor.explore import fit_quietly
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, Point
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.forces import FORCE

Array = NDArray[np.float64]
_FORCE, _WHITE = 0.5, 0.1  # amplitude of the forces, in sizes of what they act against; factor on white noise
_USUAL = 1.0  # amplitude, in sizes, that is tried instead
_LOUDER = 100.0  # factor on all that is free, which makes the sensor that all are measured by as much quieter
_BRIEF, _ROUNDS = 5, 3  # Gauss–Newton iterations from each moved noise; noises moved one after the other at most
_CLOSE = 0.002  # nats below which the last fit stops; with 0.02 one of thirty ended 2.3 nats short of it


def with_forces_awake(predictor: Predictor, point: Point) -> list[Point]:
    """Return the point with loud unmeasured forces and a tenth of the white noise; nothing where there are none.

    A force that starts at rest beside white noise which has taken its place stays there: 110 nats short of the best, on
    a recording that lacked nothing.
    """
    states = [s.name for s in predictor.compiled.model.states]
    forces = [i for i, n in enumerate(states) if n.startswith(FORCE)]
    if point.K is not None or not forces:
        return []
    noise = point.noise.copy()
    noise[: len(states)] *= _WHITE
    noise[forces] = _FORCE
    return [replace(point, noise=noise)]


def awakened(predictor: Predictor, fit: Fit, free: Free) -> Fit:
    """Bring each noise that is far off back in turn, and fit from the best, as long as that pays; and fit closer.

    Which of several noises takes the place of what a model lacks is chosen early in a fit, by rounding where two are
    near. Of thirty rigs five gained by this, two of them 13 and 17 nats, and ended at one optimum on two instruction
    sets that had been 16 nats apart. Of two sensors one had ended at 10⁸ times its size, where the filter ignores it,
    33 nats short. And a fit that has taken all for noise of the sensor that sets the scale leaves it only if all others
    get louder together: a turbine's rotor speed, 254 nats short, from which 243 had gone to a shaft that twists. Cost:
    a brief fit for each such noise, and one for all.
    """
    if fit.point.K is not None or not free.noise:
        return fit
    for _ in range(_ROUNDS):
        best = _best_moved(predictor, fit.point, free)
        again = None if best is None else fit_quietly(predictor, best, free)
        if again is None or again.log_posterior <= fit.log_posterior:
            break
        fit = again
    closer = None if predictor.deadline.passed else fit_quietly(predictor, fit.point, free, tolerance=_CLOSE)
    return fit if closer is None or closer.log_posterior <= fit.log_posterior else closer


def _best_moved(predictor: Predictor, point: Point, free: Free) -> Point | None:
    """Return where a brief fit from the most useful change of one noise leads; None where none is worth it."""
    least, best = predictor.objective(point) - in_force().predictor.moved_noise_nats, None
    for noise in _moved(point, free):
        if predictor.deadline.skips("some of the starts of a fit"):
            break
        found = predictor.climb(replace(point, noise=noise), free, iterations=_BRIEF)
        if found is not None and found[0] < least:
            least, best = found
    return best


def _moved(point: Point, free: Free) -> list[Array]:
    """Return the noise with each that is far off brought back, one at a time, and with all of them louder."""
    rules, states, moved = in_force().predictor, len(point.x0[0]), []
    for i in free.noise:
        if point.noise[i] >= rules.quiet_process_sizes and (i < states or point.noise[i] <= rules.loud_sensor_sizes):
            continue
        noise = point.noise.copy()
        noise[i] = _USUAL
        moved.append(noise)
    louder = point.noise.copy()
    louder[list(free.noise)] *= _LOUDER
    return [*moved, louder]
