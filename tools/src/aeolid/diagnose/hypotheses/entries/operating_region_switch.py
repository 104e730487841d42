"""The gain of an input differs on the two sides of a threshold."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts import operating_point
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.operating_point import Point
from aeolid.diagnose.hypotheses.parts.settings import BLADED, ROSCO, Setting

_SHARPNESS = 0.1  # of the spread: the width over which the switch turns, so that the threshold can be fitted
_LEVELS = (0.3, 0.5, 0.7)


def _says(p: Point, v: Mapping[str, float]) -> str:
    return (
        f"above {v['threshold']:.4g} {p.unit} of {p.name} the gain of {p.input_name} differs by"
        f" {v['gain_change']:+.0%} from that below; the model has one gain"
    )


def _attach(site: Site) -> list[Attachment]:
    result = []
    for point in operating_point.points(site):
        low, high = (float(np.quantile(point.values, q)) for q in (0.1, 0.9))
        if not high > low:
            continue
        change = Slot(f"region_change_{point.tag}", "gain_change", "1", 0.0, -3.0, 3.0, 1e-3)
        edge = Slot(
            f"region_edge_{point.tag}", "threshold", point.unit, low, low, high, 0.1 * point.spread, local=False
        )
        above = f"0.5*(1 + tanh(({point.symbol} - {edge.name})/{_SHARPNESS * point.spread!r}))"
        result.append(
            operating_point.attachment(
                "operating_region_switch", point, (change, edge), f"{change.name}*{above}*{point.deviation}",
                stepped=False, grid=tuple({edge.name: float(np.quantile(point.values, q))} for q in _LEVELS),
                equation=f"gain of {point.input_name} = gain_0*(1 + gain_change) where {point.name} > threshold",
                says=partial(_says, point),
            )
        )  # fmt: skip
    return result


ENTRY = Entry(
    id="operating_region_switch",
    family="aero_scheduling",
    name="switch between operating regions",
    equation="gain = gain_0*(1 + gain_change*above), above 1 where the channel is beyond threshold, else 0",
    source="Jonkman et al. 2009 (NREL 5 MW control regions); Bianchi, De Battista, Mantz 2007",
    quantities=(
        Quantity("gain_change", "1", -3.0, 3.0, 0.0, "relative change of the gain above the threshold"),
        Quantity("threshold", "unit of the channel", -1e9, 1e9, float("nan"), "where it switches"),
    ),
    attaches_to="the pitch input of a wind turbine, on every recorded scheduling channel, else on the pitch itself;"
    " commanded inputs of other machines on every recorded scheduling channel",
    signature="errors on one side of a threshold only",
    confused_with=(
        ("aero_nonlinearity", "steps on one side only: there the gain is constant, a slope shows everywhere"),
        ("input_saturation", "small steps beyond the threshold: a limited input does nothing there"),
    ),
    attach=_attach,
    rank=510,
    settings=(
        Setting(ROSCO, "VS_ControlMode, PS_Mode, SS_Mode and their set points"),
        Setting(BLADED, "External controller: the same version and parameters as on the turbine"),
    ),
)
