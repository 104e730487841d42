"""One mode that several outputs show, each by its own part of the mode's shape."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.modes import (
    RINGS,
    derivatives_seen,
    highest_hz,
    kind_of,
    not_had,
    own_modes,
    swinging,
)
from aeolid.diagnose.rules import in_force
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations

_DAMPING_START, _LEAST_DAMPING = 0.03, 1e-4
_GRID = 72  # frequencies that the bank scores: 6 % apart over two decades, a peak of damping 0.03
_MOST = 1e4  # of an output's spread over an input's


@dataclass(frozen=True)
class _Names:
    """Hold what a shared mode's states and parameters are called.

    forced, noisy: its states under the inputs and under noise; shape, noise: by output, the latter beside the first;
    drives: by input beside the first.
    """

    forced: tuple[str, str]
    noisy: tuple[str, str]
    w: str
    zeta: str
    shape: Mapping[str, str]
    noise: Mapping[str, str]
    drives: Mapping[str, str]


def seen_in_all(site: Site) -> list[Attachment]:
    """Return, for each input that moves, the hypothesis of one mode that it drives and that all outputs show.

    q'' + 2ζΩ q' + Ω² q = Ω² (u + Σ b_k u_k), and output j reads φ_j q, φ_j q'/Ω or φ_j q''/Ω² by its unit: a mode of a
    structure with a sensor on each storey has one frequency and one damping, not one of each for every sensor (Ewins
    2000, Modal Testing, section 2.4: residues of a mode are of rank one). An output that shows a mode of a turbine with
    a name of its own is left to that. Noise drives a second pair of states with the same poles and a shape of its own:
    with one shape for both, a force in a narrow band that nobody recorded passes for a mode; with none, what noise does
    to the mode bends its damping (a shaft's 0.058 ± 0.001 for 0.053). That shape starts from the outputs' spreads.
    """
    outputs = [j for j, name in enumerate(site.output_names) if kind_of(name, site) is None]
    spreads = np.std(site.u, axis=0)
    low, high = 4.0 / (len(site.u) * site.step), highest_hz(site) * (1 - 1e-6)
    if len(outputs) < 2 or high < in_force().hypotheses.least_band * low:
        return []
    return [_driven_by(site, i, outputs, (low, high)) for i in range(len(site.symbols)) if spreads[i] > 0]


def _driven_by(site: Site, i: int, outputs: Sequence[int], band: tuple[float, float]) -> Attachment:
    tag, (low, high) = f"shared{i + 1}", band
    seen = [site.output_names[j] for j in outputs]
    spreads = [float(s) or 1.0 for s in np.std(site.u, axis=0)]
    others = [k for k in range(len(site.symbols)) if k != i]
    names = _Names(
        (f"{tag}_q", f"{tag}_v"), (f"{tag}_n", f"{tag}_m"), f"{tag}_frequency_hz", f"{tag}_damping",
        {n: f"{tag}_c{j + 1}" for n, j in zip(seen, outputs, strict=True)},
        {n: f"{tag}_s{j + 1}" for n, j in zip(seen[1:], outputs[1:], strict=True)},
        {site.symbols[k]: f"{tag}_b{k + 1}" for k in others},
    )  # fmt: skip
    sizes = [(float(np.nanstd(site.y[:, j])) or 1.0) / spreads[i] for j in outputs]
    noise = _gains(names.noise.values(), [s / sizes[0] for s in sizes[1:]], 0.1, False)
    slots = (
        Slot(names.w, "frequency_hz", "Hz", low, low, high, high / 3, local=False),
        Slot(names.zeta, "damping", "1", _DAMPING_START, _LEAST_DAMPING, RINGS, 0.02, local=False),
        *_gains(names.shape.values(), sizes, 1e-3, True),
        *(replace(slot, null=s / sizes[0]) for slot, s in zip(noise, sizes[1:], strict=True)),
        *_gains(names.drives.values(), [spreads[i] / spreads[k] for k in others], 0.1, False),
    )
    known = [m for j in outputs for m in own_modes(site, j)]
    orders = {n: derivatives_seen(site, j) for n, j in zip(seen, outputs, strict=True)}
    return Attachment(
        "structural_mode", f"structural_mode input:{site.input_names[i]}, all outputs",
        location("structure", outputs=tuple(seen), inputs=(site.input_names[i],)),
        partial(_with_mode, names, site.symbols[i], orders, slots), slots, gain_states=names.noisy,
        start_states=names.forced, drives=tuple(names.shape.values()),
        starts=({}, {names.zeta: 3 * _DAMPING_START}),
        grid=tuple({names.w: float(f), names.zeta: _DAMPING_START} for f in np.geomspace(2 * low, high, _GRID)),
        equation="q'' + 2*damping*w*q' + w^2*q = w^2*b*u + noise, w = 2*pi*frequency_hz; each output sees its part of"
        " the shape times q, q'/w or q''/w^2 by its unit",
        statement=partial(_statement, seen), credible=partial(_apart, known, high),
    )  # fmt: skip


def _gains(names: Iterable[str], sizes: Sequence[float], part: float, local: bool) -> list[Slot]:
    """Return slots for gains of these sizes, a part of which is what a fit begins with."""
    return [
        Slot(n, None, "", 0.0, -_MOST * s, _MOST * s, part * s, local=local) for n, s in zip(names, sizes, strict=True)
    ]


def _apart(own: Sequence[tuple[float, float]], highest: float, p: Mapping[str, float]) -> str:
    """Object also to a mode whose half-power band holds one of the model's: errors of that one's values look so.

    A cart's 1.0 Hz with damping 0.1, constants 2 % off, was told as a further mode of 1.0 Hz with damping 0.26.
    """
    f, band = p["frequency_hz"], p["damping"] * p["frequency_hz"]
    inside = next((known for known, _ in own if abs(known - f) < band), None)
    if (objection := not_had(own, highest, p)) or inside is None:
        return objection
    return f"its half-power band holds the model's own mode at {inside:.4g} Hz, whose errors look so"


def _statement(seen: Sequence[str], p: Mapping[str, float]) -> str:
    return (
        f"a mode at {p['frequency_hz']:.3g} Hz with damping {p['damping']:.2g} shows in {', '.join(seen[:-1])} and"
        f" {seen[-1]}; the model does not have it"
    )


def _with_mode(
    names: _Names, symbol: str, orders: Mapping[str, int], slots: tuple[Slot, ...], model: Equations
) -> Equations:
    """Add the mode's parameters and states, and what each output sees of it."""
    push = " + ".join([symbol, *(f"{b}*{u}" for u, b in names.drives.items())])
    (q, v), (n, m), zeta = names.forced, names.noisy, names.zeta
    forced, noisy = ((q, v, f"(({push}) - {q} - 2*{zeta}*{v})"), (n, m, f"(-{n} - 2*{zeta}*{m})"))
    outputs = []
    for output in model.outputs:
        if output.name in names.shape:
            order = orders[output.name]
            moved = f"{names.shape[output.name]}*{forced[order]} + {names.noise.get(output.name, '1')}*{noisy[order]}"
            output = replace(output, equation=ex.combine("+", output.equation, ex.parse(moved, "mode")))
        outputs.append(output)
    states = [
        s
        for pair, by in ((names.forced, push), (names.noisy, "0"))
        for s in swinging(pair, names.w, zeta, by, model.sample_time_s)
    ]
    return replace(with_parameters(model, slots), states=(*model.states, *states), outputs=tuple(outputs))
