"""Follow modes from period to period and say whether they drift."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from aeolid.fleet.onset import with_deviation
from aeolid.models.modes import continuous_poles

Facts = dict[str, Any]
Place = TypeVar("Place")
ComplexArray = NDArray[np.complex128]
FARTHEST = 0.25  # relative distance of two continuous-time poles beyond which they are not one mode
LEAST_MAC = 0.3  # modal assurance below which they are not, however near


def track(periods: Sequence[tuple[float, Sequence[Facts]]]) -> list[list[int]]:
    """Return the number of the track each mode belongs to, for each period in the order of time.

    periods: sample time (s) and modes of each, with eigenvalue and shape [[re, im], …] in scales that all periods have
    in common. Modes of a period are assigned
    to the tracks seen so far, each at its last place, so that the sum of |Δs|/|s| + (1 − MAC)/2 is least; a mode
    farther than FARTHEST in the first or under LEAST_MAC starts a track. Tracks are numbered as they appear, by
    frequency within a period.
    """
    return follow([[_place(mode, step) for mode in modes] for step, modes in periods], _distance)


def in_common_scales(periods: Sequence[Facts]) -> None:
    """Bring the shapes of all modes of a turbine's periods to one scale of each output, the median over the periods.

    periods: with "output_scale" (l,) and "modes", each with "shape", whose entries are in these scales; both are
    changed. Where an output's slow motion is larger in one period than in the next, shapes in each period's own
    deviations are not alike although the mode is the same.
    """
    common = np.median([p["output_scale"] for p in periods], axis=0)
    for period in periods:
        ratio = np.asarray(period["output_scale"]) / common
        for mode in period["modes"]:
            shape = np.asarray(mode["shape"], dtype=float) * ratio[:, None]
            largest = complex(*max(shape, key=lambda v: float(np.hypot(*v))))
            turned = (shape[:, 0] + 1j * shape[:, 1]) / (largest or 1.0)
            mode["shape"] = [[float(v.real), float(v.imag)] for v in turned]
        period["output_scale"] = common.tolist()


def follow(steps: Sequence[Sequence[Place]], distance: Callable[[Place, Place], float | None]) -> list[list[int]]:
    """Return the number of the track each place belongs to, for each step: those of a step to the tracks seen so far.

    distance: of a place to a track's last one, None where they cannot be the same; the sum of distances is least, and
    as many are followed as can be. Tracks are numbered as they appear.
    """
    last: list[Place] = []
    numbers = []
    for now in steps:
        given = _assign(last, now, distance)
        for i, place in enumerate(now):
            if given[i] < 0:
                given[i] = len(last)
                last.append(place)
            last[given[i]] = place
        numbers.append(given)
    return numbers


def mac(a: ComplexArray, b: ComplexArray) -> float:
    """Return the modal assurance criterion |aᴴ b|²/(aᴴ a bᴴ b) of two shapes, 0 … 1; 1 where one is nil."""
    size = float(np.vdot(a, a).real * np.vdot(b, b).real)
    return 1.0 if size == 0 else float(abs(np.vdot(a, b)) ** 2 / size)


def drift(times: Sequence[float], values: Sequence[float], deviations: Sequence[float | None]) -> Facts | None:
    """Fit a line through the values, weighted by 1/σ²; returns slope and its deviation per unit of time, and change.

    The deviation is enlarged by the scatter about the line where that is more than the σ say. Values of an unknown σ
    are left out. None with fewer than three others or no spread of times.
    """
    t, y, sigma = with_deviation(times, values, deviations)
    if len(t) < 3 or np.ptp(t) == 0:
        return None
    weight = 1 / sigma**2
    middle = float(weight @ t / weight.sum())
    spread = float(weight @ (t - middle) ** 2)
    slope = float(weight @ ((t - middle) * y)) / spread
    rest = y - float(weight @ y / weight.sum()) - slope * (t - middle)
    scatter = max(1.0, float(weight @ rest**2) / (len(t) - 2))
    std = float(np.sqrt(scatter / spread))
    return {"slope": slope, "slope_std": std, "change": slope * float(np.ptp(t)), "change_std": std * float(np.ptp(t))}


def _place(mode: Facts, sample_time_s: float) -> tuple[complex, ComplexArray]:
    pole = continuous_poles(np.array([complex(*mode["eigenvalue"])]), sample_time_s)[0]
    return complex(pole), np.array([complex(*v) for v in mode["shape"]])


def _distance(now: tuple[complex, ComplexArray], before: tuple[complex, ComplexArray]) -> float | None:
    """Return |Δs|/|s| + (1 − MAC)/2, None where two modes are too far apart to be one."""
    (s, shape), (old, other) = now, before
    apart, likeness = abs(s - old) / max(abs(s), abs(old), 1e-12), mac(shape, other)
    same = apart <= FARTHEST and likeness >= LEAST_MAC and (s.imag > 0) == (old.imag > 0)
    return apart + (1 - likeness) / 2 if same else None


def _assign(
    last: Sequence[Place], now: Sequence[Place], distance: Callable[[Place, Place], float | None]
) -> list[int]:  # fmt: skip
    """Return the index into `last` for each of `now`, −1 for none."""
    from scipy.optimize import linear_sum_assignment  # half a second to load

    given = [-1] * len(now)
    if not last or not now:
        return given
    never = 1e6  # finite: the assignment must exist even where nothing fits
    cost = np.full((len(now), len(last)), never)
    for i, place in enumerate(now):
        for j, before in enumerate(last):
            far = distance(place, before)
            cost[i, j] = never if far is None else far
    for i, j in zip(*linear_sum_assignment(cost), strict=True):
        if cost[i, j] < never:
            given[int(i)] = int(j)
    return given
