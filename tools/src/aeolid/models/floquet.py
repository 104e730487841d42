"""Find the modes of a model that is periodic in the rotor's angle, with the participation of their harmonics.

A model whose scheduling is the cosine and sine of an angle, A(ψ) = A⁽¹⁾ + A⁽²⁾ cos ψ + A⁽³⁾ sin ψ, has at a constant
speed no poles but solutions x(t) = e^{ηt} Σ_n v_n e^{inψ} (Floquet 1883). Each is seen at the frequencies Im η + nΩ at
once; which of them is called the mode's is a choice, here that of the harmonic that moves the outputs most. The
participation of harmonic n in output i is |c_n,i|/Σ_n |c_n,i| with c_n = Σ_m C_{n−m} v_m (Skjoldan and Hansen 2009;
Bottasso and Cacciola 2015).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.models.hill import CONVERGED, Complex, Families, monodromy, shift_between, solve_families, whole_samples
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.modes import frequency_and_damping, pushed_to_modes
from aeolid.models.periodic import Covariance, Series, series_of

Array = NDArray[np.float64]
TOLD = 1e-6  # least participation that is kept
PAIRED = 1e-6  # distance of a multiplier from the conjugate of its partner


@dataclass(frozen=True)
class Harmonic:
    """Hold harmonic n of a mode: the frequency at which it is seen, Hz, and its participation in each output, 0 … 1.

    Negative frequencies are those of a vector that turns against the others; a sensor sees their size.
    """

    order: int
    frequency_hz: float
    participation: dict[str, float]

    def to_json(self) -> dict[str, Any]:
        """Return the harmonic as JSON facts."""
        return {"order": self.order, "frequency_hz": self.frequency_hz, "participation": self.participation}


@dataclass(frozen=True, eq=False)
class FloquetMode:
    """Hold one mode; harmonic 0 is the one that names it.

    frequency_hz |s|/2π and damping −Re s/|s| are those of the exponent s of harmonic 0, 1/s, as of a mode of a
    time-invariant model; standard deviations are None where no covariance is known. principal_exponent: the one of the
    family with −|Ω|/2 < Im ≤ |Ω|/2. multiplier: what a revolution multiplies the motion with. harmonics: those with a
    participation of at least 1e-6, by order. backward_error: the mode is the exact one of a model whose A(ψ) differs
    at no angle by more than this part of its size, which is what the truncation makes.
    """

    frequency_hz: float
    damping: float
    frequency_std_hz: float | None
    damping_std: float | None
    exponent: complex
    principal_exponent: complex
    multiplier: complex
    harmonics: tuple[Harmonic, ...]
    backward_error: float

    @property
    def is_real(self) -> bool:
        """Tell whether it swings at no rate where it is named: a decay or a growth."""
        return abs(self.damping) >= 1 or self.frequency_hz == 0

    def to_json(self) -> dict[str, Any]:
        """Return the mode as JSON facts; complex numbers as [real, imaginary]."""
        pairs = ("exponent", "principal_exponent", "multiplier")
        plain = {k: self.__dict__[k] for k in ("frequency_hz", "frequency_std_hz", "damping", "damping_std")}
        return (
            plain
            | {k: [z.real, z.imag] if np.isfinite(z := self.__dict__[k]) else None for k in pairs}
            | {"backward_error": self.backward_error, "harmonics": [h.to_json() for h in self.harmonics]}
        )


@dataclass(frozen=True, eq=False)
class Floquet:
    """Hold the modes of a periodic model at one rotor speed, by frequency.

    rotor_hz: signed as the angle grows; samples: of a revolution, any number; harmonics: the truncation N; growth: the
    largest |λ| of a revolution, above 1 where the model is unstable, infinite beyond 1e300; monodromy_difference: how
    far the multipliers are from the eigenvalues of the product of all A of a revolution, relative to the largest, None
    where a revolution is no whole number of samples.
    """

    modes: tuple[FloquetMode, ...]
    angle: str
    rotor_hz: float
    samples: float
    harmonics: int
    growth: float
    monodromy_difference: float | None
    outputs: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def stable(self) -> bool:
        """Tell whether every motion decays over a revolution."""
        return self.growth < 1

    def to_json(self) -> dict[str, Any]:
        """Return the facts; a growth beyond 1e300 is null."""
        return {
            "angle": self.angle, "rotor_hz": self.rotor_hz, "rotor_rpm": 60 * self.rotor_hz,
            "samples_per_revolution": self.samples, "harmonics": self.harmonics,
            "growth_per_revolution": self.growth if np.isfinite(self.growth) else None, "stable": self.stable,
            "monodromy_difference": self.monodromy_difference, "outputs": list(self.outputs),
            "modes": [m.to_json() for m in self.modes], "notes": list(self.notes),
        }  # fmt: skip


def floquet_of(
    model: LpvStateSpace,
    rotor_hz: float,
    *,
    at: Mapping[str, float] | None = None,
    harmonics: int | None = None,
    multiples: Mapping[str, int] | None = None,
    covariance: Covariance | None = None,
    notes: tuple[str, ...] = (),
) -> Floquet:
    """Return the modes of a model that is periodic in an angle, at a constant rotor speed.

    rotor_hz: in Hz, below 0 where the angle falls. at: values of the scheduling channels that are no angle, in their
    units. harmonics: the truncation, by default as many as the modes need. multiples: how often an angle turns in a
    revolution of the rotor, default once. covariance: of the entries of A, for standard deviations. Raises UsageError
    where the scheduling is no angle, a value is missing, or a revolution has two samples or fewer; NotIdentifiable
    where no number of harmonics is enough.
    """
    theta = 2 * np.pi * rotor_hz * model.sample_time_s
    if not abs(theta) < np.pi:
        raise UsageError(
            f"at {60 * abs(rotor_hz):.4g} rpm a revolution has {2 * np.pi / abs(theta):.3g} samples of "
            f"{model.sample_time_s:g} s; more than two are needed"
        )
    series = series_of(model, at or {}, multiples or {})
    found = solve_families(series.A, theta, harmonics, left=covariance is not None)
    modes = [_mode(model, series, found, theta, i, covariance) for i in _one_of_pairs(found, theta)]
    modes.sort(key=lambda m: (m.frequency_hz, m.damping))
    sizes = abs(found.values)
    with np.errstate(over="ignore"):
        growth = float(sizes.max() ** (2 * np.pi / abs(theta))) if len(sizes) else 0.0
    difference = _against_monodromy(series.A, found, theta)
    return Floquet(
        tuple(modes), series.angle, rotor_hz, 2 * np.pi / abs(theta), int(abs(found.orders).max()), growth, difference,
        tuple(s.name for s in model.outputs), (*notes, *_notes(found, difference, harmonics)),
    )  # fmt: skip


def _one_of_pairs(found: Families, theta: float) -> list[int]:
    """Return the families without the conjugates of others; that of a real motion is its own."""
    states = found.vectors.sum(axis=1)  # (F, n) at angle 0
    states = states / np.linalg.norm(states, axis=1, keepdims=True)
    kept, used = [], set()
    for i, value in enumerate(found.values):
        if i in used:
            continue
        gaps = [shift_between(np.conj(value), v, theta, 2 * len(found.orders))[1] for v in found.values]
        alike = [j for j, gap in enumerate(gaps) if gap <= PAIRED * abs(value) and j not in used]
        alignment = [abs(states[j].conj() @ states[i].conj()) for j in alike]
        used |= {i, *([alike[int(np.argmax(alignment))]] if alike else [])}
        kept.append(i)
    return kept


def _mode(
    model: LpvStateSpace, series: Series, found: Families, theta: float, i: int, covariance: Covariance | None
) -> FloquetMode:
    """Return family i as a mode, named by the harmonic that moves the outputs most."""
    v, h = found.vectors[i], model.sample_time_s
    orders, motion = series.seen(v, found.orders)
    size: Array = np.abs(motion)
    named = int(orders[np.argmax((size / _scale(model)).sum(axis=1))])
    value = complex(found.values[i] * np.exp(1j * named * theta))
    turned = value.imag < -1e-12 * abs(value)  # the conjugate is the same motion
    value = value.conjugate() if turned else value
    s = complex(np.log(value)) / h
    frequency, damping = frequency_and_damping(s)
    deviations: tuple[float | None, float | None] = (None, None)
    if covariance is not None and found.left is not None:
        g = covariance.derivative(v, found.left[i], found.orders, theta) * np.exp(1j * named * theta)
        spread = pushed_to_modes(value, s, h, covariance.of(g.conj() if turned else g))
        deviations = spread if np.isfinite(spread).all() else (None, None)
    parts = _harmonics(model, size, (named - orders) if turned else (orders - named), s, theta / h)
    omega = abs(theta) / h
    principal = s - 1j * omega * np.ceil(s.imag / omega - 0.5 - 1e-12)
    with np.errstate(over="ignore", invalid="ignore"):
        multiplier = complex(np.exp(s * 2 * np.pi / omega))
    return FloquetMode(
        frequency, damping, *deviations, s, principal, multiplier,
        parts, float(found.errors[i]),
    )  # fmt: skip


def _scale(model: LpvStateSpace) -> Array:
    """Return (l,) what makes outputs of several units comparable: the deviation of their innovations, 1 without one."""
    if model.innovation_covariance is None:
        return np.ones(len(model.outputs))
    variance = np.diag(model.innovation_covariance)
    return np.where(variance > 0, np.sqrt(np.maximum(variance, 0.0)), 1.0)


def _harmonics(
    model: LpvStateSpace, size: Array, orders: NDArray[np.intp], s: complex, omega: float
) -> tuple[Harmonic, ...]:
    """Return the harmonics that take part: size (·, l) of the amplitudes, orders (·,) counted from the named one."""
    total = size.sum(axis=0)
    share = size / np.where(total > 0, total, 1.0)
    nyquist = np.pi / model.sample_time_s
    found = []
    for order, row in sorted(zip(orders.tolist(), share, strict=True), key=lambda pair: pair[0]):
        if row.max(initial=0.0) >= TOLD:
            seen = (s.imag + order * omega + nyquist) % (2 * nyquist) - nyquist  # as the samples show it
            part = {o.name: float(p) for o, p in zip(model.outputs, row, strict=True)}
            found.append(Harmonic(int(order), float(seen / (2 * np.pi)), part))
    return tuple(found)


def _against_monodromy(A: Complex, found: Families, theta: float) -> float | None:
    """Return how far λ^P is from the eigenvalues of the matrix of a revolution, relative to the largest; else None."""
    samples = whole_samples(theta)
    product = None if samples is None or not len(found.values) else monodromy(A if theta > 0 else A[::-1], samples)
    if samples is None or product is None:
        return None
    true = np.linalg.eigvals(product)
    with np.errstate(over="ignore", invalid="ignore"):
        ours = found.values**samples
    if not np.isfinite(ours).all() or not abs(true).max() > 0:
        return None
    return float(max(abs(true - value).min() for value in ours) / abs(true).max())


def _notes(found: Families, difference: float | None, asked: int | None) -> tuple[str, ...]:
    notes = []
    if found.missing:
        notes.append(
            f"{found.missing} of {found.missing + len(found.values)} motions are not listed: a sample brings them "
            "below a thousandth (delays), they coincide with another, or change too much within a revolution"
        )
    if asked is not None and len(found.errors) and found.errors.max() > CONVERGED:
        notes.append(
            f"{asked} harmonics are too few: the modes are those of a model that differs by {found.errors.max():.1g}"
        )
    if difference is not None and difference > 1e-6:
        notes.append(f"multipliers differ by {difference:.1g} of the largest from those of the matrix of a revolution")
    return tuple(notes)
