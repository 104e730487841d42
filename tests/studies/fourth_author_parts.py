"""What the systems of fourth_author.py share: what nobody records, how a logger reads, and declared values.

Steps of Runge and Kutta, commands and tones are those of third_author_parts.py. All that is random comes from the
generator that is passed, in the order of the calls. Every case has the true values of its model in `true`. None has
`clean`, as in nearly all of them something drives the plant that nobody records; without that (`gust`, `hiss`) and
without a logger (`logged`) the models of the nulls at `true` are the machines.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, lfilter_zi
from second_author_parts import converted, smooth
from textbook_plants import Array
from third_author_parts import off

LOOP = "closed_loop = true\n"
WT = "wind turbine"


def gust(rng: np.random.Generator, rows: int, lag: float, rms: float) -> Array:
    """Return what drives a plant and nobody records, behind a lag of so many rows."""
    return smooth(rng, rows, lag, rms)


def hiss(rng: np.random.Generator, rows: int, std: float) -> Array:
    """Return white noise of a sensor that a loop hears, too."""
    return np.asarray(std * rng.standard_normal(rows))


def filtered(y: Array, corner: float) -> Array:
    """Return a signal behind a filter of second order against aliases, its corner a share of the sampling rate."""
    rows, fine = len(y), 10
    between = CubicSpline(np.arange(rows), y)(np.arange((rows - 1) * fine + 1) / fine)
    b, a = butter(2, 2 * corner / fine)
    return np.asarray(lfilter(b, a, between, zi=lfilter_zi(b, a) * y[0])[0][::fine])


def logged(rng: np.random.Generator, y: Array, share: float, *, lag: float = 0.0,
           ends: tuple[float, float] | None = None, bits: int = 14, corner: float = 0.0,
           jitter: float = 0.0) -> Array:  # fmt: skip
    """Return what a logger keeps of a signal, with noise of a share of its deviation.

    Half of the noise is behind a lag of so many rows where one is given. Instants jitter by a share of the sample
    time, a filter comes before and a converter with these ends of its range at last.
    """
    read, std = np.asarray(y, dtype=float), share * float(np.std(y))
    if jitter:
        shift = np.clip(jitter * rng.standard_normal(len(y)), -3 * jitter, 3 * jitter)
        read = CubicSpline(np.arange(len(y)), read)(np.arange(len(y)) + shift)
    if corner:
        read = filtered(read, corner)
    noise = rng.standard_normal(len(y))
    if lag:
        noise = 0.7 * noise + 0.7 * smooth(rng, len(y), lag, 1.0)
    read = read + std * noise
    return converted(read, *ends, bits) if ends else np.asarray(read)


def declared(rng: np.random.Generator, true: Mapping[str, float], most: float = 0.10, **units: str) -> dict[str, str]:
    """Return free values that are declared 1 % to `most` off, between a quarter and four times the true ones."""
    return off(rng, true, 0.01, most, **units)
