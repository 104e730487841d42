"""A drive that takes its command in steps."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.wiring import blended_filter, is_continuous, spread_of, unit_of_input

_FINEST, _COARSEST = 0.1, 2.0  # of the input's spread
_STARTS = 60  # 5 % apart: the levels of a spacing 5 % off are still those next to the true ones over a few steps


def _statement(name: str, unit: str, v: Mapping[str, float]) -> str:
    return f"{name} acts in steps of {v['spacing']:.4g} {unit}; the recorded command is finer"


def _round_numbers(low: float, high: float) -> list[float]:
    """List 1, 2, 5 times powers of ten in a range: what designers choose."""
    exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    return [d * 10.0**e for e in exponents for d in (1.0, 2.0, 5.0) if low <= d * 10.0**e <= high]


def _attach(site: Site) -> list[Attachment]:
    result = []
    for i, name in enumerate(site.input_names):
        u, unit, spacing = site.u[:, i], unit_of_input(site, i), f"input_spacing_{i + 1}"
        spread = spread_of(u)
        if spread <= 0 or not is_continuous(u):
            continue
        low, high = _FINEST * spread, _COARSEST * spread
        slot = Slot(spacing, "spacing", unit, 0.0, 0.5 * low, 2 * high, 0.01 * spread, local=False)
        starts = [*_round_numbers(low, high), *np.geomspace(low, high, _STARTS).tolist()]
        result.append(
            blended_filter(
                site, i, "input_quantisation", (slot,), entry="input_quantisation",
                grid=[{spacing: v} for v in _round_numbers(low, high)],
                starts=({}, *({spacing: v} for v in starts)),
                equation=f"{name}_actual = spacing*round({name}/spacing)",
                statement=partial(_statement, name, unit),
            )
        )  # fmt: skip
    return result


ENTRY = Entry(
    id="input_quantisation",
    family="input_nonlinearity",
    name="quantised drive",
    equation="u_actual = spacing*round(u/spacing)",
    source="Widrow and Kollár 2008, Quantization Noise; Franklin, Powell, Workman 1998, Digital Control, chapter 10",
    quantities=(Quantity("spacing", "unit of the input", 0.0, 1e9, 0.0, "step between two levels"),),
    attaches_to="every input that takes many values; spacings of 1, 2 and 5 times a power of ten are looked for",
    signature="noise that repeats whenever the command passes the same values",
    confused_with=(("deadband", "levels: a quantised drive always comes back to the same ones"),),
    attach=_attach,
    rank=110,
)
