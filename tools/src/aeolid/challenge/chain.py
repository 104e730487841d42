"""Pass a plant's signals through a measurement chain, as those of any laboratory: nothing of it is a finding.

A command is held, or an analogue signal that is band-limited and sampled like every other; outputs pass an anti-alias
filter (Butterworth, second order) and a converter of finite steps, at instants that jitter by a hundredth of a sample
and stand off the inputs' by less than one; sensors have coloured noise beside white; a few rows are lost; the machine
stands still for a while.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, lfilter_zi

from aeolid.challenge.march import wander

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Chain:
    """Hold how a recording came to be; the fields as they are do nothing at all.

    analogue: inputs are band-limited and sampled; corner: of the filters over the rate, 0: none; bits: of the
    converters, 0: exact; jitter, offset: of the outputs' instants, in samples; colour: size of coloured noise over that
    of white, of `memory` samples; lost: rows that are missing; still: first and last share of the recording in which
    the commands rest; rough: size of an unmeasured force over the nominal.
    """

    analogue: bool = False
    corner: float = 0.0
    bits: int = 0
    jitter: float = 0.0
    offset: float = 0.0
    colour: float = 0.0
    memory: float = 10.0
    lost: int = 0
    still: tuple[float, float] = (0.0, 0.0)
    rough: float = 0.0


NONE = Chain()


def draw_chain(rng: np.random.Generator) -> Chain:
    """Draw a chain as one meets it: half of the commands are analogue, half of the machines stand for a while."""
    begin = float(rng.uniform(0.1, 0.6))
    still = (begin, begin + float(rng.uniform(0.03, 0.08))) if rng.random() < 0.5 else (0.0, 0.0)
    return Chain(
        analogue=bool(rng.random() < 0.5), corner=float(rng.uniform(0.38, 0.45)), bits=int(rng.choice([12, 14, 16])),
        jitter=float(rng.uniform(0.002, 0.01)), offset=float(rng.uniform(-0.3, 0.3)),
        colour=float(rng.uniform(0.3, 1.0)), memory=float(rng.uniform(5, 40)), lost=int(rng.integers(2, 8)),
        still=still, rough=float(rng.uniform(0.5, 1.5)),
    )  # fmt: skip


def drive_signal(chain: Chain, levels: Array, every: int) -> Array:
    """Return the commands at every fine step (N·every, m) from levels at every sample (N, m)."""
    begin, end = (round(len(levels) * share) for share in chain.still)
    levels = levels.copy()
    levels[begin:end] = 0.0
    fine = np.repeat(levels, every, axis=0)
    if not chain.analogue:
        return fine
    top, bottom = butter(4, 0.25, fs=every)  # half the band of the sampling: what an amplifier passes
    return _settled(top, bottom, fine)


def smooth(fine: Array, every: int) -> Array:
    """Return a motion as a servo is asked for: nothing above a twentieth of the rate."""
    top, bottom = butter(2, 0.05, fs=every)
    return _settled(top, bottom, fine)


def anti_alias(chain: Chain, fine: Array, every: int) -> Array:
    """Return signals at every fine step behind the filter."""
    if not chain.corner:
        return fine
    top, bottom = butter(2, chain.corner, fs=every)
    return _settled(top, bottom, fine)


def _settled(top: Array, bottom: Array, x: Array) -> Array:
    begin = lfilter_zi(top, bottom)[:, None] * x[:1]
    return np.asarray(lfilter(top, bottom, x, axis=0, zi=begin)[0])


def instants(chain: Chain, samples: int, rng: np.random.Generator) -> Array:
    """Return where the outputs are sampled, in samples."""
    rows: Array = np.arange(float(samples)) + chain.offset + chain.jitter * rng.standard_normal(samples)
    return rows if chain is not NONE else np.arange(float(samples))


def sample(fine: Array, rows: Array, every: int) -> Array:
    """Return signals (N·every, k) at instants in samples, by straight lines between fine steps."""
    steps = np.arange(len(fine))
    return np.column_stack([np.interp(rows * every, steps, column) for column in fine.T])


def noise(chain: Chain, spreads: Array, samples: int, rng: np.random.Generator) -> Array:
    """Return what sensors add (N, k)."""
    white = rng.standard_normal((samples, len(spreads))) * spreads
    return np.asarray(white + coloured(chain, spreads, samples, rng))


def coloured(chain: Chain, spreads: Array, samples: int, rng: np.random.Generator) -> Array:
    """Return the coloured part of it (N, k)."""
    if not chain.colour:
        return np.zeros((samples, len(spreads)))
    slow = np.column_stack([wander(rng, samples, chain.memory, 1.0) for _ in spreads])
    return np.asarray(chain.colour * slow * spreads)


def convert(chain: Chain, x: Array) -> Array:
    """Return signals (N, k) in the converter's steps: a range of 1, 2 or 5 times a power of ten that holds them."""
    if not chain.bits:
        return x
    return np.column_stack([_steps(column, chain.bits) for column in x.T])


def _steps(x: Array, bits: int) -> Array:
    most = float(np.max(np.abs(x)))
    if not 0.0 < most < math.inf:  # a plant that runs away is drawn anew
        return x
    decade = 10.0 ** math.floor(math.log10(most))
    reach = next(decade * k for k in (1.0, 2.0, 5.0, 10.0) if decade * k >= most)
    return np.asarray(np.rint(x / reach * 2 ** (bits - 1)) * reach / 2 ** (bits - 1))


def kept(chain: Chain, samples: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which rows are not lost; the first and the last never are."""
    rows = np.ones(samples, dtype=bool)
    if chain.lost:
        rows[rng.choice(np.arange(1, samples - 1), chain.lost, replace=False)] = False
    return rows
