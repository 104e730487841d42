"""Change between the blades of a rotor and the frame that does not turn: the multi-blade coordinates of Coleman.

Blade b = 1 … B of a rotor at the angle ψ of blade 1 stands at ψ_b = ψ + 2π(b − 1)/B, counted the way the rotor turns.
What is measured on the blades becomes (Coleman, Feingold 1958; Bir 2008, eq. 2)

    a₀ = 1/B Σ y_b,   a_c = 2/B Σ y_b cos ψ_b,   a_s = 2/B Σ y_b sin ψ_b,

and of three blades y_b = a₀ + a_c cos ψ_b + a_s sin ψ_b gives all of it back. A model that is linear and does not vary
with time holds for these on a rotor of equal blades, not for a single blade.

A mode of frequency ω has amplitudes (c, s) of (a_c, a_s). On the blades it is a wave of ω − Ω that runs round the disc
with the rotor (forward whirl, of size |c + i s|/2), and one of ω + Ω against it (backward whirl, |c − i s|/2): with
s = −i c, a quarter of a period late, only the first is there. So a blade's frequency is seen from the tower plus and
minus the rotor's (Hansen 2007).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PARTS = ("collective", "cosine", "sine")
FEWEST = 3  # blades: two have no cosine and sine part that a constant law holds for
LEAST = 0.2  # of the powers of both waves, by which one must exceed the other: noise in a shape makes some


def blade_angles(azimuth: Array, blades: int) -> Array:
    """Return the angles (N, B) of all blades, rad, from that of the first (N,)."""
    return np.asarray(azimuth[:, None] + 2 * np.pi * np.arange(blades) / blades, dtype=np.float64)


def to_fixed(values: Array, azimuth: Array) -> Array:
    """Return the collective, cosine and sine part (N, 3) of what blades measure (N, B), B ≥ 3; azimuth (N,) in rad."""
    blades = values.shape[1]
    angle = blade_angles(azimuth, blades)
    cosine, sine = (2 / blades * (values * wave(angle)).sum(axis=1) for wave in (np.cos, np.sin))
    return np.column_stack([values.mean(axis=1), cosine, sine])


def to_blades(parts: Array, azimuth: Array, blades: int = FEWEST) -> Array:
    """Return what blades measure (N, B) from the collective, cosine and sine part (N, 3); azimuth (N,) in rad."""
    angle = blade_angles(azimuth, blades)
    return np.asarray(parts[:, :1] + parts[:, 1:2] * np.cos(angle) + parts[:, 2:] * np.sin(angle), dtype=np.float64)


def fixed_frame(y: Array, azimuth: Array | None, blades: Sequence[Sequence[int]]) -> Array:
    """Return the columns of y (N, l) with every set of blade columns as its three parts, behind all others.

    blades: places of the columns of each set, in the order of the blades. y as it is without sets or azimuth.
    """
    if not blades or azimuth is None:
        return y
    turning = {j for places in blades for j in places}
    still = y[:, [j for j in range(y.shape[1]) if j not in turning]]
    return np.hstack([still, *(to_fixed(y[:, list(places)], azimuth) for places in blades)])


def part_names(stem: str) -> tuple[str, str, str]:
    """Return what the three parts of a set are called.

    >>> part_names("RootMyb")
    ('RootMyb_collective', 'RootMyb_cosine', 'RootMyb_sine')
    """
    first, second, third = (f"{stem}_{part}" for part in PARTS)
    return first, second, third


def without_part(name: str) -> tuple[str, str]:
    """Return the stem of a channel in the fixed frame and which part it is, the name and "" of any other channel.

    >>> without_part("RootMyb_sine"), without_part("GenSpeed")
    (('RootMyb', 'sine'), ('GenSpeed', ''))
    """
    stem, _, part = name.rpartition("_")
    return (stem, part) if stem and part in PARTS else (name, "")


@dataclass(frozen=True)
class Whirl:
    """Say how a mode moves the blades: stem of the set it moves most, direction, and what it is on a blade.

    direction: "forward", "backward", "standing" (both waves alike) or "collective" (all blades at once). degree: power
    of the forward wave less that of the backward one, of both, −1 … 1. collective: share of the power that all blades
    have in common, 0 … 1. blade_hz: frequency on the blade; None of a standing one, which has two.
    """

    stem: str
    direction: str
    degree: float
    collective: float
    blade_hz: float | None

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON facts."""
        return {
            "blades": self.stem, "direction": self.direction, "degree": self.degree, "collective": self.collective,
            "blade_frequency_hz": self.blade_hz,
        }  # fmt: skip

    def text(self) -> str:
        """Return it in words."""
        on = "" if self.blade_hz is None else f", {self.blade_hz:.4g} Hz on the blade"
        return {"collective": "all blades alike", "standing": "no sense of rotation"}.get(
            self.direction, f"{self.direction} whirl{on}"
        )


def whirl_of(
    values: Mapping[str, complex], shares: Mapping[str, float], frequency_hz: float, rotor_hz: float | None
) -> Whirl | None:  # fmt: skip
    """Return how a mode moves the blades, None where no set of them is among the outputs with cosine and sine part.

    values: complex amplitude of each output, in its unit; shares: of each output in the mode, in comparable units, by
    which the set is chosen; rotor_hz: 1P, None where it is not known.
    """
    stems = [stem for stem, part in map(without_part, values) if part == PARTS[1]]
    stems = [stem for stem in stems if part_names(stem)[2] in values]
    if not stems:
        return None
    stem = max(stems, key=lambda s: sum(shares.get(name, 0.0) for name in part_names(s)))
    common, c, s = (values.get(name, 0j) for name in part_names(stem))
    forward, backward = abs(c + 1j * s) ** 2 / 4, abs(c - 1j * s) ** 2 / 4
    cyclic = forward + backward  # mean square over the blades; that of the collective part is |a₀|²
    whole = cyclic + abs(common) ** 2
    if not np.isfinite(whole) or whole == 0:
        return None
    degree = (forward - backward) / cyclic if cyclic > 0 else 0.0
    sense = np.sign(degree) if abs(degree) >= LEAST else 0
    way = "collective" if abs(common) ** 2 > cyclic else ("standing", "forward", "backward")[int(sense)]
    on_blade = {"collective": 0, "forward": -1, "backward": 1}.get(way)
    known = on_blade == 0 or (on_blade is not None and rotor_hz is not None)
    hertz = abs(frequency_hz + (on_blade or 0) * (rotor_hz or 0.0)) if known else None
    return Whirl(stem, way, float(degree), float(abs(common) ** 2 / whole), hertz)
