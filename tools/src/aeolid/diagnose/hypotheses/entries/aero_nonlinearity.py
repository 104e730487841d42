"""The gain of an input changes with the operating point."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from aeolid.diagnose.hypotheses.parts import operating_point
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.operating_point import Point
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting


def _says(p: Point, v: Mapping[str, float]) -> str:
    return (
        f"the gain of {p.input_name} changes by {v['gain_change']:+.0%} for every {p.spread:.3g} {p.unit}"
        f" of {p.name}; the model holds it constant"
    )


def _attach(site: Site) -> list[Attachment]:
    result = []
    for point in operating_point.points(site):
        slope = Slot(f"scheduled_{point.tag}", "gain_change", "1", 0.0, -3.0, 3.0, 1e-3)
        term = f"{slope.name}*({point.symbol} - {point.mean!r})/{point.spread!r}*{point.deviation}"
        result.append(
            operating_point.attachment(
                "aero_nonlinearity", point, (slope,), term, stepped=False,
                equation=f"gain of {point.input_name} = gain_0*(1 + gain_change*({point.name} - mean)/spread)",
                says=partial(_says, point),
            )
        )  # fmt: skip
    return result


ENTRY = Entry(
    id="aero_nonlinearity",
    family="aero_scheduling",
    name="gain that follows the operating point",
    equation="gain = gain_0*(1 + gain_change*(p - mean)/spread)",
    source="Bianchi, De Battista, Mantz 2007, Wind Turbine Control Systems (LPV); Burton et al., Wind Energy Handbook",
    quantities=(Quantity("gain_change", "1", -3.0, 3.0, 0.0, "relative change of the gain for one spread of p"),),
    attaches_to="the pitch input of a wind turbine, on every recorded scheduling channel, else on the pitch itself;"
    " commanded inputs of other machines on every recorded scheduling channel",
    signature="the response to the same step differs with wind, pitch or speed, smoothly",
    confused_with=(
        ("operating_region_switch", "steps on one side only: there the gain is constant, a slope shows everywhere"),
        ("parameter_error", "two operating points: a wrong gain is wrong by the same factor in both"),
    ),
    attach=_attach,
    rank=500,
    settings=(
        Setting(OPENFAST, "AeroDyn in place of a linearised model (CompAero = 2)"),
        Setting(BLADED, "simulate in place of a linear model"),
    ),
)
