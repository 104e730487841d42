"""Write the modes of a periodic model as lines of text."""

from __future__ import annotations

from typing import Any

from aeolid.display import token
from aeolid.report.numbers import with_std

Facts = dict[str, Any]
SHOWN = 0.01  # participation from which a harmonic is listed
_MOST = 5  # harmonics listed of an output


def summary(facts: Facts) -> str:
    """Return the facts of `Floquet.to_json` as text."""
    lines = [
        f"rotor {60 * abs(facts['rotor_hz']):.4g} rpm, 1P {abs(facts['rotor_hz']):.4g} Hz by {token(facts['angle'])}"
        f"{', which falls' if facts['rotor_hz'] < 0 else ''}, "
        f"{facts['samples_per_revolution']:.4g} samples a revolution; {facts['harmonics']} harmonics",
        stability(facts),
    ]
    for i, mode in enumerate(facts["modes"], 1):
        lines.append(f"mode {i}: {_hertz(mode)}, {_damping(mode)}, a revolution leaves {growth(mode['multiplier'])}")
        lines += [f"  {token(name)}: {harmonics_of(mode, name)}" for name in facts["outputs"]]
    return "\n".join([*lines, *(f"note: {note}" for note in facts["notes"])])


def stability(facts: Facts) -> str:
    """Say whether the model is stable over a revolution, and by how much."""
    largest = facts["growth_per_revolution"]
    if not facts["modes"]:
        return "no motion lasts longer than a sample"
    if largest is None:
        return "unstable: a revolution multiplies the fastest growing motion beyond 1e300"
    word = "stable" if facts["stable"] else "unstable"
    return f"{word}: a revolution multiplies the least damped motion with {largest:.4g}"


def harmonics_of(mode: Facts, output: str) -> str:
    """Return the harmonics of a mode in an output, the largest participation first."""
    parts = [(h["participation"][output], h["order"], h["frequency_hz"]) for h in mode["harmonics"]]
    parts = sorted((p for p in parts if p[0] >= SHOWN), key=lambda p: (-p[0], p[1]))[:_MOST]
    if not parts:
        return "not seen"
    return ", ".join(f"{order_text(n)} {100 * p:.0f} % at {abs(f):.4g} Hz" for p, n, f in parts)


def order_text(n: int) -> str:
    """Return the order of a harmonic as it is read: 0, +1P, −1P."""
    return "0" if n == 0 else f"{'+' if n > 0 else '−'}{abs(n)}P"


def growth(multiplier: list[float] | None) -> str:
    """Return the size of a multiplier."""
    return "beyond 1e300" if multiplier is None else f"{abs(complex(*multiplier)):.3g}"


def _hertz(mode: Facts) -> str:
    return f"{with_std(mode['frequency_hz'], mode['frequency_std_hz'], 4)} Hz"


def _damping(mode: Facts) -> str:
    std = mode["damping_std"]
    return f"damping {with_std(100 * mode['damping'], None if std is None else 100 * std)} %"
