"""A sensor that also shows a share of what its neighbour measures: a skewed or cross-sensitive axis."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.wiring import spread_of, unit_of_output, with_reading
from aeolid.models.equations import Equations, Parameter

_AXES = {"x", "y", "z", "fa", "ss", "fore", "side", "flap", "edge", "lateral", "axial", "vertical", "horizontal"}
_MOST = 0.7  # a skew of 45 degrees: beyond, the channels are swapped rather than skewed


def _statement(name: str, other: str, v: Mapping[str, float]) -> str:
    return f"the {name} sensor also shows {v['share']:+.1%} of {other}: its axis is skewed or cross-sensitive"


def _attach(site: Site) -> list[Attachment]:
    """Pair outputs of one unit, or of none whose names tell axes."""
    result = []
    for i, name in enumerate(site.output_names):
        for j, other in enumerate(site.output_names):
            if i != j and _are_axes(site, name, other) and spread_of(site.y[:, j]) > 0:
                result.append(_between(site, i, j))
    return result


def _are_axes(site: Site, name: str, other: str) -> bool:
    """Tell whether two outputs may be one sensor's axes: one unit, or none and names of different axes."""
    units = {unit_of_output(site, n).replace(" ", "").replace("·", "") for n in (name, other)}
    if len(units) != 1:
        return False
    words = [set(re.split(r"[^a-z]+", n.lower())) & _AXES for n in (name, other)]
    return bool(units - {"", "1"}) or (bool(words[0] and words[1]) and words[0] != words[1])


def _between(site: Site, i: int, j: int) -> Attachment:
    name, other = site.output_names[i], site.output_names[j]
    share = f"cross_axis_{i + 1}_{j + 1}"
    ratio = spread_of(site.y[:, i]) / spread_of(site.y[:, j])

    def edit(model: Equations) -> Equations:
        added = Parameter(share, 0.0, "1", -_MOST, _MOST)
        plain = next(o.equation for o in model.outputs if o.name == other)  # by the words of this very model
        return with_reading(model, name, f"reading + {share}*neighbour", (added,), others={"neighbour": plain})

    return Attachment(
        "sensor_cross_axis", f"sensor_cross_axis output:{name} from {other}",
        location(f"output:{name}", outputs=(name,)), edit,
        (Slot(share, "share", "1", 0.0, -_MOST, _MOST, min(1e-3 * max(ratio, 1e-3), 1e-2)),),
        equation=f"{name}_recorded = {name} + share*{other}",
        statement=partial(_statement, name, other),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_cross_axis",
    family="sensor_nonlinearity",
    name="cross-axis sensitivity",
    equation="y1_recorded = y1 + share*y2",
    source="ISO 16063-31 (transverse vibration sensitivity); IEEE Std 1293, accelerometer misalignment",
    quantities=(Quantity("share", "1", -_MOST, _MOST, 0.0, "part of the neighbour that shows"),),
    attaches_to="pairs of outputs of one unit (where none is given, whose names tell axes)",
    signature="what moves one axis shows in the other in the same proportion at every frequency",
    confused_with=(
        ("missing_coupling", "a coupling of the machine turns through its resonances, a skewed sensor does not"),
        ("sensor_scale", "a wrong scale is in proportion to the channel itself"),
    ),
    attach=_attach,
    rank=310,
)
