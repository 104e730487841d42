"""Take from a model and what its identification wrote beside it how to analyse it: speed, values held, covariance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from aeolid.errors import DataError, UsageError
from aeolid.models.floquet import Floquet, floquet_of
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.model_file import read_array
from aeolid.models.periodic import Covariance, angle_of, angles_of, scaled_weights, weights_of
from aeolid.models.rotor_speed import read_rotor_speed
from aeolid.text_files import is_number, shown

UNEVEN, TOO_UNEVEN = 0.02, 0.10  # deviation of the speed beside its mean that is told, and that is refused
Facts = Mapping[str, Any]


def analyse(
    model: LpvStateSpace,
    facts: Facts | None,
    *,
    rotor_speed: str | float | None = None,
    at: Mapping[str, float] | None = None,
    harmonics: int | None = None,
    multiples: Mapping[str, int] | None = None,
    source: str = "the model",
) -> Floquet:
    """Return the modes of a periodic model at a rotor speed, by default the mean of its recordings.

    facts: what the identification wrote beside the model, or None; rotor_speed as `read_rotor_speed` takes it, above 0
    in the sense in which the recorded angle turns, below 0 where that falls; at:
    values of scheduling channels that are no angle, by default their means. Raises as `floquet_of`, UsageError where
    the speed is not known, or varied by more than 10 % and is not given; DataError on facts that cannot be.
    """
    told, times = facts or {}, dict(multiples or {})
    held = dict(_means(model, told, source)) | dict(at or {})
    if not angles_of(model):
        return floquet_of(model, 1e-3 / model.sample_time_s, at=held)  # says what is missing
    weights = weights_of(model, held, times)
    notes: list[str] = []
    if rotor_speed is None:
        hertz = _recorded_speed(model, told, times, source, notes)
    else:
        hertz = _as_the_angle_turns(read_rotor_speed(rotor_speed), model, told, notes)
    covariance = _covariance(model, told, weights, source)
    if covariance is not None and told.get("bands_hold") is False:
        reason = told.get("bands_reason")
        notes.append(f"WARNING: {reason if isinstance(reason, str) else 'the standard deviations do not hold'}")
    return floquet_of(
        model, hertz, at=held, harmonics=harmonics, multiples=times, covariance=covariance, notes=tuple(notes)
    )


def _as_the_angle_turns(hertz: float, model: LpvStateSpace, facts: Facts, notes: list[str]) -> float:
    """Return a speed that was given without a sign in the sense of the recorded angle; notes gains a changed one."""
    rotation = facts.get("rotation")
    entry = rotation.get(angles_of(model)[0]) if isinstance(rotation, dict) else None
    recorded = entry.get("frequency_hz") if isinstance(entry, dict) else None
    if hertz < 0 or not is_number(recorded) or not recorded < 0:
        return hertz
    notes.append(f"the recorded angle falls as the rotor turns: analysed at {-60 * hertz:.4g} rpm")
    return -hertz


def _means(model: LpvStateSpace, facts: Facts, source: str) -> dict[str, float]:
    """Return the means of the scheduling channels that are no angle, as far as they are known."""
    points = facts.get("operating_points")
    first = points[0] if isinstance(points, list) and points and isinstance(points[0], dict) else {}
    means = first.get("scheduling")
    means = means if isinstance(means, dict) else {}
    wanted = [s.name for s in model.scheduling if not angle_of(s.name) and s.name in means]
    for name in wanted:
        if not is_number(means[name]):
            raise DataError(f"{source}: operating_points: {name} is {shown(means[name])}, a finite number is needed")
    return {name: float(means[name]) for name in wanted}


def _recorded_speed(
    model: LpvStateSpace, facts: Facts, multiples: Mapping[str, int], source: str, notes: list[str]
) -> float:
    """Return the mean speed of the recordings in Hz, signed; notes gains a sentence where it varied."""
    angle = angles_of(model)[0]
    rotation = facts.get("rotation")
    entry = rotation.get(angle) if isinstance(rotation, dict) else None
    if entry is None:
        raise UsageError(f"{source} does not say how fast {angle} turned; --rotor-speed 12.1rpm does")
    values = [entry.get(k) if isinstance(entry, dict) else None for k in ("frequency_hz", "deviation_hz")]
    if not (is_number(values[0]) and is_number(values[1]) and values[0] and values[1] >= 0):
        raise DataError(f"{source}: rotation of {angle} is {shown(entry)}; frequency and deviation in Hz are needed")
    times = multiples.get(angle, 1)
    hertz, deviation = float(values[0]) / times, float(values[1]) / times
    uneven = deviation / abs(hertz)
    told = f"the rotor turned at {60 * abs(hertz):.4g} rpm with a deviation of {100 * uneven:.2g} %"
    if uneven > TOO_UNEVEN:
        raise UsageError(f"{told}: too uneven for a constant speed; name the one to analyse, --rotor-speed 12.1rpm")
    if uneven > UNEVEN:
        notes.append(f"{told}; the modes are those of the constant mean")
    return hertz


def _covariance(model: LpvStateSpace, facts: Facts, weights: Any, source: str) -> Covariance | None:
    """Return the covariance of the entries of A that the identification wrote; None where there is none."""
    entry = facts.get("A_covariance")
    if entry is None:
        return None
    lower = entry.get("lower") if isinstance(entry, dict) else None
    count = len(lower) if isinstance(lower, list) else 0
    size = (int(np.sqrt(8 * count + 1)) - 1) // 2
    if not isinstance(entry, dict) or size * (size + 1) // 2 != count or size not in (
        model.order**2, model.order**2 * len(model.A)
    ):  # fmt: skip
        raise DataError(f"{source}: A_covariance does not fit a model of {model.order} states")
    m = (len(model.scheduling),)
    offset, scale = (read_array(entry.get(k), m, f"A_covariance.{k}", source) for k in ("offset", "scale"))
    values = read_array(lower, (count,), "A_covariance.lower", source)
    if not (scale > 0).all():
        raise DataError(f"{source}: A_covariance.scale is not above 0")
    matrix = np.zeros((size, size))
    matrix[np.tril_indices(size)] = values
    matrix += np.tril(matrix, -1).T
    return Covariance(matrix, scaled_weights(weights, offset, scale))
