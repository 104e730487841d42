"""A drive that takes its command in steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.wiring import blended_filter, is_continuous, spread_of, unit_of_input

_FINEST, _COARSEST = 0.1, 2.0  # of the input's spread
_STARTS = 60  # 5 % apart: the levels of a spacing 5 % off are still those next to the true ones over a few steps


@dataclass(frozen=True)
class _Form:
    """Say how a drive chooses its level: the kind of filter, what is added to a key, to a statement, the equation."""

    kind: str
    key: str
    words: str
    equation: str


_FORMS = (
    _Form("input_quantisation", "", "", "spacing*round({0}/spacing)"),
    _Form("input_mid_rise", ", between", ", none at zero", "spacing*(floor({0}/spacing) + 1/2)"),
    _Form("input_floor", ", down", ", always the one below the command", "spacing*floor({0}/spacing)"),
    _Form("input_truncation", ", towards zero", ", always the one nearer to zero", "spacing*trunc({0}/spacing)"),
)


def _statement(name: str, unit: str, words: str, v: Mapping[str, float]) -> str:
    return f"{name} acts in steps of {v['spacing']:.4g} {unit}{words}; the recorded command is finer"


def _round_numbers(low: float, high: float) -> list[float]:
    """List 1, 2, 5 times powers of ten in a range: what designers choose."""
    exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    return [d * 10.0**e for e in exponents for d in (1.0, 2.0, 5.0) if low <= d * 10.0**e <= high]


def _attach(site: Site) -> list[Attachment]:
    return [a for i in range(len(site.input_names)) for form in _FORMS for a in _at(site, i, form)]


def _at(site: Site, i: int, form: _Form) -> list[Attachment]:
    """Return the hypothesis of one form at one input, none where that takes few values."""
    u, name, unit = site.u[:, i], site.input_names[i], unit_of_input(site, i)
    spread = spread_of(u)
    if spread <= 0 or not is_continuous(u) or (form.kind == "input_truncation" and _has_one_sign(u)):
        return []
    spacing = f"{form.kind.removesuffix('_quantisation')}_spacing_{i + 1}"
    low, high = _FINEST * spread, _COARSEST * spread
    slot = Slot(spacing, "spacing", unit, 0.0, 0.5 * low, 2 * high, 0.01 * spread, local=False, jumps=True)
    starts = [*_round_numbers(low, high), *np.geomspace(low, high, _STARTS).tolist()]
    return [
        blended_filter(
            site, i, form.kind, (slot,), entry="input_quantisation",
            grid=[{spacing: v} for v in _round_numbers(low, high)],
            starts=({}, *({spacing: v} for v in starts)),
            equation=f"{name}_actual = {form.equation.format(name)}",
            statement=partial(_statement, name, unit, form.words), form=form.key,
        )
    ]  # fmt: skip


def _has_one_sign(u: NDArray[np.float64]) -> bool:
    """Tell whether cutting off towards zero is cutting down, or up, everywhere."""
    return not (np.nanmin(u) < 0 < np.nanmax(u))


ENTRY = Entry(
    id="input_quantisation",
    family="input_nonlinearity",
    name="quantised drive",
    equation="u_actual = spacing*round(u/spacing)",  # or floor(u/spacing), floor + 1/2, trunc
    source="Widrow and Kollár 2008, Quantization Noise; Franklin, Powell, Workman 1998, Digital Control, chapter 10",
    quantities=(Quantity("spacing", "unit of the input", 0.0, 1e9, 0.0, "step between two levels"),),
    attaches_to="every input that takes many values, its level the nearest, the lower, the one nearer to zero or the "
    "nearest beside zero; spacings of 1, 2 and 5 times a power of ten are looked for",
    signature="noise that repeats whenever the command passes the same values",
    confused_with=(("deadband", "levels: a quantised drive always comes back to the same ones"),),
    attach=_attach,
    rank=110,
)
