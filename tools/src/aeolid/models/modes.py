"""Turn the poles of a discrete-time model into modes: frequency in Hz and damping."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.models.multiblade import Whirl, whirl_of
from aeolid.models.shapes import Shape
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
NORMAL = 1.959964  # 95 % of a normal deviate
BLADES, WIDENED = 3, 9
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Mode:
    """Hold one mode; standard deviations are None where no uncertainty is known.

    frequency_hz is the undamped natural frequency |s|/2π, damping the ratio −Re s/|s| of the continuous-time pole s
    (1 for a decaying real pole, −1 for a growing one, 0 with frequency 0 for a pure integrator); eigenvalue the pole
    in the z-plane with Im ≥ 0; shares maps each output to its part of the mode's motion, in units of the outputs'
    scales, sum 1.
    rotor_order is k where the mode sits on k times the rotor speed and is more likely its harmonic than a mode.
    folded_from_hz is a peak beyond Nyquist whose image the mode may be, in a decimated recording. name says what an
    engineer would call it (tower fore-aft, 3P), empty where that is not known. tone: the outputs hold a steady sine
    there, and the damping may be none: a periodic force rather than a mode. shape is None of real poles, and where a
    model was not identified with shapes. whirl: how it moves the blades, where a set of them is in the fixed frame.
    """

    frequency_hz: float
    damping: float
    eigenvalue: complex
    frequency_std_hz: float | None
    damping_std: float | None
    shares: dict[str, float]
    rotor_order: int | None = None
    folded_from_hz: float | None = None
    name: str = ""
    tone: bool = False
    shape: Shape | None = None
    whirl: Whirl | None = None

    @property
    def is_real(self) -> bool:
        """Tell whether it is a single pole on the positive real axis: a decay or a growth, which swings at no rate."""
        return abs(self.damping) >= 1 or self.frequency_hz == 0 or (self.eigenvalue.imag == 0 <= self.eigenvalue.real)

    def is_beyond(self, sample_time_s: float) -> bool:
        """Tell whether it is faster than half the sample rate, or changes sign from sample to sample."""
        return self.frequency_hz >= 0.5 / sample_time_s * (1 - 1e-9)

    def vanishes(self, duration_s: float, uneven: float = 0.0, deviations: float = NORMAL) -> bool:
        """Tell whether the damping may be none: its band holds what a recording of this length cannot resolve.

        That is a swing that decays by less than e within it, and what a line of a frequency that varies by the relative
        deviation `uneven` is widened by. The band is of 95 %, or of so many deviations. False where the deviation of
        the damping is not known.
        """
        if self.damping_std is None or self.is_real:
            return False
        unresolved = 1 / (2 * np.pi * max(self.frequency_hz, 1e-12) * duration_s)
        return bool(self.damping - deviations * self.damping_std <= max(unresolved, NORMAL * uneven))

    def width(self, duration_s: float) -> float:
        """Return `lone_width` of its deviations in a recording of that length."""
        return lone_width(self.frequency_hz, self.frequency_std_hz, self.damping, self.damping_std, duration_s)

    def to_json(self) -> dict[str, Any]:
        """Return the mode as JSON facts; the eigenvalue as [real, imaginary]."""
        return {
            "frequency_hz": self.frequency_hz,
            "frequency_std_hz": self.frequency_std_hz,
            "damping": self.damping,
            "damping_std": self.damping_std,
            "eigenvalue": [self.eigenvalue.real, self.eigenvalue.imag],
            "outputs": self.shares,
            "rotor_order": self.rotor_order,
            "folded_from_hz": self.folded_from_hz,
            "name": self.name,
            "tone": self.tone,
        } | {key: told.to_json() for key, told in (("shape", self.shape), ("whirl", self.whirl)) if told is not None}


def lone_width(
    frequency_hz: float, frequency_std_hz: float | None, damping: float, damping_std: float | None, duration_s: float
) -> float:  # fmt: skip
    """Return the larger deviation, of the relative frequency or of the damping, over √(ζ/(2π f T)).

    That is what a mode of frequency f and damping ζ has that stands alone above the noise in a recording of T seconds
    (Au 2014); the damping of a line is not resolved below 1/(2π f T). Infinite where a deviation is not known.
    """
    if frequency_std_hz is None or damping_std is None or not frequency_hz > 0:
        return math.inf
    cycles = 2 * math.pi * frequency_hz * duration_s
    return max(frequency_std_hz / frequency_hz, damping_std) / math.sqrt(max(damping, 1 / cycles) / cycles)


def with_whirl(modes: Sequence[Mode], rotor_hz: float | None) -> tuple[Mode, ...]:
    """Return the modes with how they move the blades, by their shapes; rotor_hz: 1P, None where it is not known."""
    return tuple(
        m if m.shape is None else replace(m, whirl=whirl_of(m.shape.values, m.shares, m.frequency_hz, rotor_hz))
        for m in modes
    )


def continuous_poles(eigenvalues: ComplexArray, sample_time_s: float) -> ComplexArray:
    """Return the continuous-time poles log(z)/h; sample_time_s = 0 returns the poles as they are."""
    z: ComplexArray = np.asarray(eigenvalues, dtype=np.complex128)
    if sample_time_s == 0:
        return z
    # a pole at z = 0 (pure delay) has no finite logarithm; the floor keeps it a very fast real mode
    floored = np.where(abs(z) < 1e-12, 1e-12, z).astype(np.complex128)
    return np.asarray(np.log(floored) / sample_time_s, dtype=np.complex128)


def frequency_and_damping(s: complex) -> tuple[float, float]:
    """Return |s|/2π in Hz and −Re s/|s|; an integrator (s = 0) has damping 0."""
    size = abs(s)
    return size / (2 * np.pi), (-s.real / size if size > 0 else 0.0)


def pole_words(frequency_hz: float, is_real: bool) -> str:
    """Return what a sentence calls a pole, as lists of modes tell it: by frequency, or a real pole by time constant.

    >>> pole_words(0.33, False), pole_words(0.02, True)
    ('the mode near 0.33 Hz', 'the real pole of 7.96 s')
    """
    if is_real and frequency_hz > 0:
        return f"the real pole of {1 / (2 * np.pi * frequency_hz):.3g} s"
    return f"the mode near {frequency_hz:.3g} Hz"


def modes_of(
    model: StateSpace, *, output_scale: Array | None = None, pole_covariance: NDArray[np.float64] | None = None
) -> tuple[Mode, ...]:
    """List the modes of a model, one for each real pole or conjugate pair, by frequency.

    output_scale: (l,) by which outputs of different units are made comparable in the shares, default 1.
    pole_covariance: (n, 2, 2) covariance of real and imaginary part of each eigenvalue in the order of
    numpy.linalg.eig(model.A), default unknown. The standard deviations follow by linearisation of s = log(z)/h.
    """
    values, vectors = np.linalg.eig(model.A)
    values, vectors = values.astype(complex), vectors.astype(complex)
    scale = np.ones(len(model.outputs)) if output_scale is None else output_scale
    shape = abs(model.C @ vectors) / scale[:, None]  # (l, n)
    poles = continuous_poles(values, model.sample_time_s)
    found = []
    for i, s in enumerate(poles):
        if values[i].imag < 0:
            continue
        frequency, damping = frequency_and_damping(complex(s))
        deviation: tuple[float | None, float | None] = (None, None)
        if pole_covariance is not None:
            spread = pushed_to_modes(complex(values[i]), complex(s), model.sample_time_s, pole_covariance[i])
            deviation = spread if np.isfinite(spread).all() else (None, None)
        total = shape[:, i].sum() or 1.0
        shares = {o.name: float(v / total) for o, v in zip(model.outputs, shape[:, i], strict=True)}
        found.append(Mode(frequency, damping, complex(values[i]), deviation[0], deviation[1], shares))
    return tuple(sorted(found, key=lambda m: m.frequency_hz))


def is_widened(order: int) -> bool:
    """Tell whether wind that three blades cut through widens a multiple of the rotor's speed: 1P, 3P, 6P, 9P."""
    return order in (1, *range(BLADES, WIDENED + 1, BLADES))


def mark_harmonics(
    modes: Sequence[Mode], rotor_hz: float, deviation_hz: float = 0.0, duration_s: float = np.inf
) -> tuple[Mode, ...]:
    """Mark modes that are more likely harmonics: near a multiple of the rotor's speed, with little or no damping.

    deviation_hz: of the rotor's speed; duration_s: of the recording. Near: within 1.5 %, 3 deviations of the frequency
    or what the speed varies by, at most 0.05 P or what it varies by. On 1P, 3P, 6P and 9P, which wind that three blades
    cut through widens, damping below 5 % is little. On another multiple only that which may
    vanish is (see `vanishes`): a structure may well swing there. So is any below 5 % whose deviation is not known.
    """
    uneven = deviation_hz / rotor_hz
    marked = []
    for mode in modes:
        order = round(mode.frequency_hz / rotor_hz)
        varied = NORMAL * order * deviation_hz
        near = max(0.015 * mode.frequency_hz, 3 * (mode.frequency_std_hz or 0.0), varied)
        close = order >= 1 and abs(mode.frequency_hz - order * rotor_hz) <= min(near, max(0.05 * rotor_hz, varied))
        little = abs(mode.damping) < 0.05 and (is_widened(order) or mode.damping_std is None)
        harmonic = close and (little or mode.vanishes(duration_s, uneven))
        marked.append(replace(mode, rotor_order=order if harmonic else None))
    return tuple(marked)


def pushed_to_modes(z: complex, s: complex, h: float, covariance: Array) -> tuple[float, float]:
    """Push the covariance (2, 2) of (Re z, Im z) through s = log(z)/h to frequency and damping.

    ds = dz/(h z); d|s| = Re(s̄ ds)/|s|; dζ = −Re(ds)/|s| + Re(s) d|s|/|s|².
    """
    g = 1 / (h * z) if h > 0 and z != 0 else 1.0  # ds/dz
    g = complex(g)
    to_s = np.array([[g.real, -g.imag], [g.imag, g.real]])
    size = max(abs(s), 1e-12)
    d_size = np.array([s.real, s.imag]) / size
    d_damping = np.array([-1.0, 0.0]) / size + s.real / size**2 * d_size
    around = to_s @ covariance @ to_s.T
    frequency_std = float(np.sqrt(max(d_size @ around @ d_size, 0.0))) / (2 * np.pi)
    damping_std = float(np.sqrt(max(d_damping @ around @ d_damping, 0.0)))
    return frequency_std, damping_std
