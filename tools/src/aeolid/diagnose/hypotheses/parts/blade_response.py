"""A load on a blade that the model passes on at once, and the blade by its own bending."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.following import Filter, following, is_possible, memories_of
from aeolid.diagnose.hypotheses.parts.modes import KINDS, Kind, attach_named, derivatives_seen, kind_of, named_mode
from aeolid.diagnose.hypotheses.parts.settings import Setting
from aeolid.diagnose.hypotheses.parts.wiring import with_reading
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations, Parameter

_LEAST_DAMPING = 0.01
_EQUATION = "m'' = w^2*({name} - m) - 2*damping*w*m', w = 2*pi*frequency_hz, m is the moment in the blade"
_FREQUENCIES = 6  # of the grid that the bank scores
_STARTS = tuple((share, zeta) for share in (0.3, 0.6) for zeta in (0.15, 0.6))  # of the band, of the highest damping


def blade_mode(
    entry: str, name: str, source: str, damping: str, rivals: tuple[tuple[str, str], ...], *,
    rank: int, settings: tuple[Setting, ...],
) -> Entry:  # fmt: skip
    """Return the entry of a blade's mode: driven by the inputs, or by the load that the model passes on at once."""
    made = named_mode(entry, name, source, damping, rivals, rank=rank, settings=settings, bends=True)
    return replace(made, attach=lambda site: attach_named(entry, site) + responses(entry, site))


def responses(entry: str, site: Site) -> list[Attachment]:
    """Offer that a blade's moment follows its load as the blade bends, where the model has the moment at once.

    The same equations as a second-order sensor; only another sensor, or the blade's band, tells the two apart. In
    equations the bending is a state, so that the predictor's gain knows of it.
    """
    kind = next(k for k in KINDS if k.entry == entry)
    outputs = [j for j, name in enumerate(site.output_names) if kind_of(name, site) is kind]
    fastest = 0.4 / site.row_step
    if kind.place != "blade" or fastest < in_force().hypotheses.least_band * kind.band_hz[0]:
        return []
    attach = _as_states if is_possible(site) else _on
    return [attach(site, j, kind, min(kind.band_hz[1], fastest)) for j in outputs if not derivatives_seen(site, j)]


def _frequency(inverse: float) -> float:
    """Return f in Hz of 1/ω in s; a rigid blade answers at once."""
    return 1.0 / (2 * math.pi * inverse) if inverse > 0 else math.inf


def _statement(name: str, words: str, v: Mapping[str, float]) -> str:
    return (
        f"{name} answers to its load by {words} at {v['frequency_hz']:.3g} Hz with damping {v['damping']:.2g};"
        " the model has it at once"
    )


def _as_states(site: Site, j: int, kind: Kind, highest_hz: float) -> Attachment:
    name, tag, most, low = site.output_names[j], f"bending_{j + 1}", kind.most_damping, kind.band_hz[0]
    f, zeta = f"{tag}_frequency_hz", f"{tag}_damping"
    slots = (
        Slot(f, "frequency_hz", "Hz", low, low, highest_hz, highest_hz / 3, local=False),
        Slot(zeta, "damping", "1", 0.5 * most, _LEAST_DAMPING, most, 0.05, local=False),
    )
    grid = np.geomspace(0.95 * highest_hz, 1.05 * low, _FREQUENCIES)
    bending = Filter(
        f"(1/(2*pi*{f}))", zeta, slots, tuple({f: float(x), zeta: 0.3 * most} for x in grid),
        tuple({f: low * (highest_hz / low) ** s, zeta: z * most} for s, z in _STARTS),
    )  # fmt: skip
    return following(
        site, j, tag, bending, entry=kind.entry, key=f"{kind.entry} response output:{name}",
        where=location(kind.place, outputs=(name,)), equation=_EQUATION.format(name=name),
        statement=partial(_statement, name, kind.words),
    )  # fmt: skip


def _on(site: Site, j: int, kind: Kind, highest_hz: float) -> Attachment:
    name, tag = site.output_names[j], f"bending_{j + 1}"
    inverse, zeta = f"{tag}_inverse_omega", f"{tag}_damping"
    most, start = kind.most_damping, min(0.3, 0.5 * kind.most_damping)
    low, high = (1.0 / (2 * math.pi * f) for f in (highest_hz, kind.band_hz[0]))
    parameters = (Parameter(inverse, 0.0, "s", 0.0, high), Parameter(zeta, start, "1", _LEAST_DAMPING, most))

    def edit(model: Equations) -> Equations:
        return with_reading(model, name, tag, parameters, memories=memories_of(tag, inverse, zeta))

    return Attachment(
        kind.entry, f"{kind.entry} response output:{name}", location(kind.place, outputs=(name,)), edit,
        (Slot(inverse, "frequency_hz", "Hz", 0.0, low, high, 0.3 * low, show=_frequency),
         Slot(zeta, "damping", "1", start, _LEAST_DAMPING, most, 0.05, local=False)),
        stepped=True, starts=tuple({inverse: low + s * (high - low), zeta: z * most} for s, z in _STARTS),
        equation=_EQUATION.format(name=name),
        statement=partial(_statement, name, kind.words),
    )  # fmt: skip
