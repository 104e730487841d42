"""Hold the references of several set-ups against each other: same sign and gain in all of them, or merging is wrong.

Of a mode that two set-ups share, and that is alone at its frequency in both, reference k beside reference a is
    ρ_k = (φ_k/φ_a in the one) / (φ_k/φ_a in the other),
which is 1 whatever shook the structure. A channel that was turned round, or whose gain is another, makes it the same
real number in all modes; what differs from mode to mode is the structure's, or another mode of that frequency. What
all references of a set-up have in common (its level, all signs turned) cannot be seen by them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.identify.setup_matching import DEVIATIONS, NEAR, Seen, Setup, seen_in

Array = NDArray[np.float64]
CLEAR = 5.0  # deviations of an entry of a shape from which it may divide: ratios of less have no mean
LIKE = 0.5  # of ln ρ between modes of one channel fault, factor 1.6 or 29°, beside DEVIATIONS of each
SHARE = 0.75  # of the modes that must agree on a factor, and of two at least: a fault of a channel is in all
SURE = 5.0  # deviations of ln ρ from 0: known to 5 %, a gain of 1.3 is one
TOLD, REFUSED = 1.1, 1.25  # gains from which a sentence says so, and from which shapes would be wrong to see


@dataclass(frozen=True)
class Factor:
    """Hold by what a reference differs between two set-ups: a real factor, σ of its logarithm, modes that say so.

    of: modes in which it could be compared.
    """

    value: float
    spread: float
    modes: int
    of: int

    @property
    def is_other(self) -> bool:
        """Tell whether sign or gain are not the same, by more than chance explains."""
        gain = abs(float(np.log(abs(self.value))))
        return self.value < 0 or gain > max(float(np.log(TOLD)), SURE * self.spread)

    @property
    def is_wrong(self) -> bool:
        """Tell whether it is too much for shapes to be joined."""
        return self.is_other and (self.value < 0 or abs(np.log(abs(self.value))) > np.log(REFUSED))


@dataclass(frozen=True)
class Unlike:
    """Hold that references (their places) differ in one set-up from another, each by a factor beside an anchor."""

    setup: Setup
    other: Setup
    anchor: int
    factors: dict[int, Factor]


def compared_references(setups: Sequence[Setup], references: Sequence[str]) -> tuple[str, ...]:
    """Return a sentence for each reference whose gain is a little other in a set-up than in most of them.

    Raises DataError on another sign or gain that would spoil the shapes, with set-up, channel and remedy. One reference
    alone has nothing to be held against.
    """
    if len(references) < 2:
        return ()
    shown = [seen_in(s, len(references)) for s in setups]
    unlike = _against_the_most(setups, shown, len(references))
    told = [(f, _sentence(u, k, f, references)) for u in unlike for k, f in u.factors.items()]
    wrong = [sentence for f, sentence in told if f.is_wrong]
    if wrong:
        raise DataError("; ".join(wrong))
    return tuple(sentence for _, sentence in told)


def _against_the_most(setups: Sequence[Setup], shown: Sequence[Sequence[Seen]], count: int) -> list[Unlike]:
    """Return what differs from the set-up that most others agree with, the first of such."""
    found: list[list[Unlike]] = []
    for i, base in enumerate(setups):
        rows = []
        for j, setup in enumerate(setups):
            anchor, factors = _odd(_pairs(shown[i], shown[j]), count) if i != j else (0, {})
            if factors:
                rows.append(Unlike(setup, base, anchor, factors))
        found.append(rows)
    return min(found, key=len)


def _pairs(one: Sequence[Seen], other: Sequence[Seen]) -> list[tuple[Seen, Seen]]:
    """Return modes of two set-ups at one frequency, where neither set-up has a second there."""

    def near(a: Seen, b: Seen) -> bool:
        return abs(a.mode.frequency_hz - b.mode.frequency_hz) < NEAR * a.mode.frequency_hz

    pairs = [(a, [b for b in other if near(a, b)]) for a in one if sum(near(a, c) for c in one) == 1]
    return [(a, b[0]) for a, b in pairs if len(b) == 1 and sum(near(b[0], c) for c in other) == 1]


def _odd(pairs: Sequence[tuple[Seen, Seen]], count: int) -> tuple[int, dict[int, Factor]]:
    """Return the reference beside which the fewest others differ, and the factors of these."""
    found = []
    for anchor in range(count):
        factors = {k: f for k in range(count) if k != anchor and (f := _factor(pairs, k, anchor)) is not None}
        found.append((anchor, {k: f for k, f in factors.items() if f.is_other}))
    return min(found, key=lambda row: len(row[1]))


def _factor(pairs: Sequence[tuple[Seen, Seen]], k: int, anchor: int) -> Factor | None:
    """Return by what reference k differs beside another, None where modes do not agree on it or too few show both."""
    rows = [(*_entry(b, k, anchor), *_entry(a, k, anchor)) for a, b in pairs]
    told = np.array([(r[0] - r[2], np.hypot(r[1].real, r[3].real), np.hypot(r[1].imag, r[3].imag)) for r in rows])
    told = told.reshape(-1, 3)[[bool(np.isfinite(r).all()) for r in told]]
    if len(told) < 2:
        return None
    logs, gain, phase = told[:, 0], np.maximum(told[:, 1].real, 1e-9), np.maximum(told[:, 2].real, 1e-9)
    sign = 1.0 if float(np.cos(logs.imag) @ phase**-2) > 0 else -1.0
    angle = np.angle(sign * np.exp(1j * logs.imag))
    like = abs(logs.real - np.median(logs.real)) < LIKE + DEVIATIONS * gain
    like &= abs(angle) < LIKE + DEVIATIONS * phase
    if like.sum() < max(2, SHARE * len(told)):
        return None
    weights = gain[like] ** -2
    middle = float(weights @ logs.real[like] / weights.sum())
    unlike = float(weights @ (logs.real[like] - middle) ** 2) / (int(like.sum()) - 1)
    spread = float(np.sqrt(max(unlike, 1.0) / weights.sum()))
    return Factor(sign * float(np.exp(middle)), spread, int(like.sum()), len(told))


def _entry(seen: Seen, k: int, anchor: int) -> tuple[complex, complex]:
    """Return ln(φ_k/φ_a) of a mode, and the deviations of its real and imaginary part; NaN where either is not clear.

    d ln φ = dφ/φ; the covariance is that of [real parts; imaginary parts].
    """
    values, covariance = seen.part.values, seen.part.covariance
    variance = np.diag(covariance).reshape(2, -1).sum(axis=0)
    if any(not abs(values[i]) > CLEAR * np.sqrt(variance[i]) for i in (k, anchor)):
        return complex(np.nan), complex(np.nan)
    reach = np.zeros(len(values), dtype=complex)
    reach[k], reach[anchor] = 1 / values[k], -1 / values[anchor]
    gain, phase = np.concatenate([reach, 1j * reach]).real, np.concatenate([reach, 1j * reach]).imag
    spread = complex(np.sqrt(gain @ covariance @ gain), np.sqrt(phase @ covariance @ phase))
    return complex(np.log(values[k] / values[anchor])), spread


def _sentence(unlike: Unlike, place: int, factor: Factor, references: Sequence[str]) -> str:
    name, beside = references[place], references[unlike.anchor]
    here, there = (f"set-up {s.number} ({s.source})" for s in (unlike.setup, unlike.other))
    sign = factor.value < 0
    gain = abs(np.log(abs(factor.value))) > max(np.log(TOLD), SURE * factor.spread)
    what = " and ".join([*(["sign"] if sign else []), *(["gain"] if gain else [])])
    doubt = f", or {beside!r} has" if len(references) == 2 else ""
    remedy = f"{1 / factor.value:.3g}" if gain else "-1"
    return (
        f"reference {name!r} has another {what} in {here} than in {there}{doubt}: beside {beside!r} it is "
        f"{factor.value:.3g} times as large in {factor.modes} of {factor.of} modes; if it is wrong there, multiply it "
        f"by {remedy}; else correct the one that is wrong, or leave it out of the references"
    )
