"""A lightly damped mode that the model does not have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aeolid.diagnose.catalogue.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter, State

_DAMPING_START = 0.03


def _attach(site: Site) -> list[Attachment]:
    """Offer a mode at every output; all share the frequency, damping and drive of one pair of states."""
    return [_on(j, name, site) for j, name in enumerate(site.output_names)]


def _on(j: int, name: str, site: Site) -> Attachment:
    tag = f"mode{j + 1}"
    q, v, w, zeta = f"{tag}_q", f"{tag}_v", f"{tag}_frequency_hz", f"{tag}_damping"
    drives = [f"{tag}_b{i + 1}" for i in range(len(site.input_names))]
    low, high = 4.0 / (len(site.u) * site.step), 0.4 / site.row_step
    spread = float(np.nanstd(site.y[:, j])) or 1.0
    sizes = [spread / (float(np.std(site.u[:, i])) or 1.0) for i in range(len(drives))]

    def edit(model: Equations) -> Equations:
        extra = [Parameter(w, low, "Hz", low, high), Parameter(zeta, _DAMPING_START, "1", 1e-4, 0.7)]
        extra += [Parameter(b, 0.0, "", -1e4 * s, 1e4 * s) for b, s in zip(drives, sizes, strict=True)]
        push = " + ".join(f"{b}*{u}" for b, u in zip(drives, site.symbols, strict=True)) or "0"
        states = _states(q, v, w, zeta, push, model.sample_time_s)
        outputs = tuple(
            replace(o, equation=ex.combine("+", o.equation, ex.parse(q, "mode"))) if o.name == name else o
            for o in model.outputs
        )
        return replace(model, parameters=(*model.parameters, *extra), states=(*model.states, *states), outputs=outputs)

    frequencies = np.geomspace(low * 2, high, 24)
    slots = [
        Slot(w, "frequency_hz", "Hz", low, low, high, high / 3, local=False),
        Slot(zeta, "damping", "1", _DAMPING_START, 1e-4, 0.7, 0.02, local=False),
    ]
    slots += [Slot(b, None, "", 0.0, -1e4 * s, 1e4 * s, 1e-3 * s) for b, s in zip(drives, sizes, strict=True)]
    return Attachment(
        "structural_mode", f"structural_mode output:{name}", location(f"output:{name}", outputs=(name,)), edit,
        tuple(slots), gain_states=(q, v),
        grid=tuple({w: float(f), zeta: _DAMPING_START} for f in frequencies),
        equation="q'' + 2*damping*w*q' + w^2*q = w^2*b*u + noise, w = 2*pi*frequency_hz, added to the output",
        statement=lambda p: (
            f"a mode at {p['frequency_hz']:.3g} Hz with damping {p['damping']:.2g} shows in {name};"
            " the model does not have it"
        ),
    )  # fmt: skip


def _states(q: str, v: str, w: str, zeta: str, push: str, step: float) -> list[State]:
    """Write q̈ = ω²(push − q) − 2ζω q̇ exactly sampled (discrete) or as it stands (continuous); v is q̇/ω."""
    omega = f"(2*pi*{w})"
    if not step:
        forms = [f"{omega}*{v}", f"{omega}*(({push}) - {q} - 2*{zeta}*{v})"]
    else:
        t = f"({omega}*{step!r})"
        decay, turn = f"exp(-{zeta}*{t})", f"({t}*sqrt(1 - {zeta}**2))"
        ratio = f"({zeta}/sqrt(1 - {zeta}**2))"
        root = f"sqrt(1 - {zeta}**2)"
        x = f"({q} - ({push}))"
        forms = [
            f"({push}) + {decay}*({x}*(cos({turn}) + {ratio}*sin({turn})) + {v}/{root}*sin({turn}))",
            f"{decay}*({v}*(cos({turn}) - {ratio}*sin({turn})) - {x}/{root}*sin({turn}))",
        ]
    return [State(n, "", ex.parse(f, "mode"), 0.0, True) for n, f in zip((q, v), forms, strict=True)]


ENTRY = Entry(
    id="structural_mode",
    family="structural_mode",
    name="structural mode",
    equation="q'' + 2*damping*w*q' + w^2*q = w^2*b*u, w = 2*pi*frequency_hz",
    source="Craig and Kurdila 2006, Fundamentals of Structural Dynamics",
    quantities=(
        Quantity("frequency_hz", "Hz", 0.01, 50.0, float("nan"), "natural frequency"),
        Quantity("damping", "1", 1e-4, 0.7, float("nan"), "damping ratio"),
    ),
    attaches_to="every output, driven by every input and by noise",
    signature="a narrow band in one output, phase turning by 180 degrees through it",
    confused_with=(
        ("rotational_sampling", "a rotor harmonic moves with the rotor speed, a mode does not"),
        ("parameter_error", "a shifted mode leaves a pair of opposite residues, a missing one a single band"),
    ),
    attach=_attach,
)
