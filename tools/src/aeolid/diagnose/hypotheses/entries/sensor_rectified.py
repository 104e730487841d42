"""A sensor that reports the absolute value of what it measures."""

from __future__ import annotations

import ast
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Site, Slot, location
from aeolid.diagnose.rules import in_force
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Output, Parameter

Array = NDArray[np.float64]


def _attach(site: Site) -> list[Attachment]:
    rules = in_force().hypotheses
    result = []
    for j, name in enumerate(site.output_names):
        measured = site.y[:, j][np.isfinite(site.y[:, j])]
        spread = float(np.ptp(measured)) if len(measured) else 0.0
        below = min(in_force().evidence.noise_deviations * noise_of(measured), rules.rectified_most * spread)
        if not spread or measured.min() < -max(rules.rectified_least * spread, below):
            continue  # a channel that goes negative is not an absolute value
        result.append(_on(j, name, float(measured.min()) < rules.rectified_touches * spread))
    return result


def noise_of(y: Array) -> float:
    """Estimate the noise of samples y (N,): the deviation that their second differences tell, robust against turns."""
    return float(1.4826 * np.median(np.abs(np.diff(y, 2))) / np.sqrt(6.0)) if len(y) > 2 else 0.0


def _on(j: int, name: str, touches_zero: bool) -> Attachment:
    switch = f"rectified_{j + 1}"

    def edit(model: Equations) -> Equations:
        outputs = tuple(_fold(o, switch) if o.name == name else o for o in model.outputs)
        return replace(model, outputs=outputs, parameters=(*model.parameters, Parameter(switch, 0.0, "", 0.0, 1.0)))

    return Attachment(
        "sensor_rectified", f"sensor_rectified output:{name}", location(f"output:{name}", outputs=(name,)), edit,
        (Slot(switch, None, "", 0.0, 0.0, 1.0, 1.0, local=False),),
        fixed={switch: 1.0},
        equation=f"{name}_measured = abs({name})",
        statement=lambda v: f"the {name} sensor reports the absolute value: it does not show the direction",
        always_fit=touches_zero,
    )  # fmt: skip


def _fold(output: Output, switch: str) -> Output:
    on = ast.Name(id=switch)
    off = ex.parse(f"1 - {switch}", "switch")
    plain = output.equation
    folded = ast.Call(func=ast.Name(id="abs"), args=[plain], keywords=[])
    sign = ast.Call(func=ast.Name(id="sign"), args=[plain], keywords=[])
    equation = ex.combine("+", ex.combine("*", off, plain), ex.combine("*", on, folded))
    return replace(output, equation=equation, slope=ex.combine("+", off, ex.combine("*", on, sign)))


ENTRY = Entry(
    id="sensor_rectified",
    family="sensor_nonlinearity",
    name="rectifying sensor (absolute value)",
    equation="y_measured = abs(y)",
    source="Wigren and Schoukens 2017, Coupled electric drives data set (pulse counter)",
    quantities=(),
    attaches_to="every output that is never negative",
    signature="never negative, sharp turns at zero, twice the expected frequency near reversals",
    confused_with=(("sensor_saturation", "a sensor clipped at zero stays there, a rectified one rises again"),),
    attach=_attach,
    rank=230,
)
