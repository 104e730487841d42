"""A sensor that shows only certain values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.catalogue.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.catalogue.wiring import SHARE_SIZE, unit_of_output, with_reading
from aeolid.diagnose.forensics import spacing_of
from aeolid.models.equations import Equations, Parameter

_COARSE = 0.05  # of the spread: a finer spacing is far below what any model predicts
_TERMS = 6  # of the Fourier series of the rounding error; the staircase is rounded over a tenth of a step


def _statement(name: str, unit: str, v: Mapping[str, float]) -> str:
    return f"the {name} sensor shows values {v['spacing']:.4g} {unit} apart only".replace("  ", " ")


def _attach(site: Site) -> list[Attachment]:
    """Attach where the recorded values themselves lie on a coarse grid."""
    result = []
    for j, name in enumerate(site.output_names):
        y = site.y[:, j][np.isfinite(site.y[:, j])]
        step = spacing_of(y)
        if step is not None and step > _COARSE * float(np.std(y)):
            result.append(_on(site, j, name, step, float(y[0])))
    return result


def _on(site: Site, j: int, name: str, step: float, level: float) -> Attachment:
    """Round by y − Σ (−1)^(n+1) a_n spacing/(π n) sin(2π n (y − level)/spacing), a_n Lanczos' factors."""
    share, spacing, unit = f"sensor_steps_share_{j + 1}", f"sensor_steps_{j + 1}", unit_of_output(site, name)
    terms = []
    for n in range(1, _TERMS + 1):
        ratio = math.pi * n / (_TERMS + 1)
        weight = (-1) ** (n + 1) * math.sin(ratio) / ratio / (math.pi * n)
        terms.append(f"({weight!r})*sin({2 * n}*pi*(reading - ({level!r}))/{spacing})")
    parameters = (
        Parameter(spacing, step, unit, 0.98 * step, 1.02 * step), Parameter(share, 0.0, "", 0.0, 1.0),
    )  # fmt: skip

    def edit(model: Equations) -> Equations:
        return with_reading(model, name, f"reading - {share}*{spacing}*({' + '.join(terms)})", parameters)

    return Attachment(
        "sensor_quantisation", f"sensor_quantisation output:{name}", location(f"output:{name}", outputs=(name,)), edit,
        (Slot(spacing, "spacing", unit, step, 0.98 * step, 1.02 * step, 1e-3 * step, local=False),
         Slot(share, None, "", 0.0, 0.0, 1.0, SHARE_SIZE)),
        fixed={share: 1.0}, grid=({spacing: step},), share=share,
        equation=f"{name}_recorded = spacing*round({name}/spacing)",
        statement=partial(_statement, name, unit),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_quantisation",
    family="sensor_nonlinearity",
    name="quantised sensor",
    equation="y_recorded = spacing*round(y/spacing)",
    source="Widrow and Kollár 2008, Quantization Noise",
    quantities=(Quantity("spacing", "unit of the output", 0.0, 1e12, 0.0, "distance of two values"),),
    attaches_to="every output whose recorded values lie on a coarse grid",
    signature="few distinct values, equally spaced",
    confused_with=(("deadband", "a held value stays whatever it is, a quantised one returns to the same levels"),),
    attach=_attach,
)
