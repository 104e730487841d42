"""Say places and likelihoods on the screen as an engineer says them."""

from __future__ import annotations

import math

_KINDS = {"input": "at the input", "output": "at the sensor of", "state": "in the equation of", "shaft": "in the shaft"}
_LARGEST = 12  # powers of ten of odds that are written out; beyond, nobody tells one from the next


def place(entry: str) -> str:
    """Return where an effect enters, in words.

    >>> place("input:pitch"), place("mode:0.33 Hz"), place("shaft"), place("output:flap_moment_1")
    ('at the input pitch', 'in the mode near 0.33 Hz', 'in the shaft', 'at the sensor of flap moment 1')
    """
    kind, _, rest = entry.partition(":")
    name = rest.replace("_", " ").strip()
    if kind == "mode":
        return f"in the mode near {name}"
    if kind in _KINDS:
        return f"{_KINDS[kind]} {name}".rstrip()
    return f"at {entry.replace('_', ' ')}" if entry else ""


def odds(gain: float) -> str:
    """Return a gain in log-likelihood as odds for the corrected model, in words.

    >>> odds(3.0), odds(646.0), odds(-2.0)
    ('odds 20 : 1', 'odds beyond 10^12 : 1', 'odds 1 : 7.4')
    """
    if abs(gain) > _LARGEST * math.log(10):
        return f"odds beyond 10^{_LARGEST} : 1" if gain > 0 else f"odds beyond 1 : 10^{_LARGEST}"
    ratio = math.exp(abs(gain))
    told = f"{ratio:.2g}" if ratio < 100 else f"{float(f'{ratio:.2g}'):,.0f}"
    return f"odds {told} : 1" if gain >= 0 else f"odds 1 : {told}"
