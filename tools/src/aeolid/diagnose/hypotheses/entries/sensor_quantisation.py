"""A sensor that shows only certain values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.data.forensics import grid_of, spacing_of
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.wiring import SHARE_SIZE, unit_of_output, with_reading
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations, Parameter

_SURE = 1e-3  # of the spacing, which the recorded values show as they are
_TERMS = 6  # of the Fourier series of the rounding error; the staircase is rounded over a tenth of a step


def _statement(name: str, unit: str, truncated: bool, v: Mapping[str, float]) -> str:
    how = ", always the next lower one" if truncated else ""
    return f"the {name} sensor shows values {v['spacing']:.4g} {unit} apart only{how}".replace("  ", " ")


def _attach(site: Site) -> list[Attachment]:
    """Attach where the recorded values themselves lie on a grid: a coarse one, or of truncation a finer one too."""
    rules = in_force().hypotheses
    result = []
    for j, name in enumerate(site.output_names):
        y = site.y[:, j][np.isfinite(site.y[:, j])]
        step = spacing_of(y) or grid_of(y)
        if step is None:
            continue
        ways = {False: rules.rounded_spacing, True: rules.truncated_spacing}
        result += [_on(site, j, name, step, float(y[0]), way) for way, w in ways.items() if step > w * float(np.std(y))]
    return result


def _on(site: Site, j: int, name: str, step: float, level: float, truncated: bool) -> Attachment:
    """Round by y − Σ (−1)^(n+1) a_n spacing/(π n) sin(2π n (y − level)/spacing), a_n Lanczos' factors.

    What is predicted has an error of its own, which blurs the stairs: blur is its deviation in spacings, a_n falls as a
    normal distribution's characteristic function. A converter that truncates rounds what lies half a step lower; where
    all stairs are blurred, a bias of just that is left.
    """
    tag, way = f"sensor_{'floors' if truncated else 'steps'}_{j + 1}", "down " if truncated else ""
    share, spacing, blur, unit = f"{tag}_share", f"{tag}_spacing", f"{tag}_blur", unit_of_output(site, name)
    lower = f"{spacing}/2" if truncated else "0"
    ends, terms = ((1 - _SURE) * step, (1 + _SURE) * step), []
    for n in range(1, _TERMS + 1):
        ratio = math.pi * n / (_TERMS + 1)
        weight = (-1) ** (n + 1) * math.sin(ratio) / ratio / (math.pi * n)
        terms.append(
            f"({weight!r})*exp(-2*({n}*pi*{blur})**2)*sin({2 * n}*pi*(reading - {lower} - ({level!r}))/{spacing})"
        )
    parameters = (
        Parameter(spacing, step, unit, *ends), Parameter(blur, 0.1, "1", 0.0, 1.0),
        Parameter(share, 0.0, "", 0.0, 1.0),
    )  # fmt: skip

    def edit(model: Equations) -> Equations:
        return with_reading(model, name, f"reading - {share}*({lower} + {spacing}*({' + '.join(terms)}))", parameters)

    return Attachment(
        "sensor_quantisation", f"sensor_quantisation {way}output:{name}", location(f"output:{name}", outputs=(name,)),
        edit,
        (Slot(spacing, "spacing", unit, step, *ends, 1e-4 * step, local=False),
         Slot(blur, None, "1", 0.1, 0.0, 1.0, 0.05, local=False),
         Slot(share, None, "", 0.0, 0.0, 1.0, SHARE_SIZE)),
        fixed={share: 1.0}, grid=tuple({spacing: step, blur: b} for b in (0.05, 0.2, 0.5)), share=share,
        equation=f"{name}_recorded = spacing*{'floor' if truncated else 'round'}({name}/spacing)",
        statement=partial(_statement, name, unit, truncated),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_quantisation",
    family="sensor_nonlinearity",
    name="quantised sensor",
    equation="y_recorded = spacing*round(y/spacing)",
    source="Widrow and Kollár 2008, Quantization Noise",
    quantities=(Quantity("spacing", "unit of the output", 0.0, 1e12, 0.0, "distance of two values"),),
    attaches_to="every output whose recorded values lie on a grid, a coarse one where they are rounded",
    signature="few distinct values, equally spaced",
    confused_with=(
        ("sensor_bias", "a bias of just half a step, recorded values on a grid: the converter truncates"),
        ("deadband", "a held value stays whatever it is, a quantised one returns to the same levels"),
    ),
    attach=_attach,
    rank=250,
)
