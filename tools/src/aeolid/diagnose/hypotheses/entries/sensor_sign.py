"""A channel that was recorded with the sign reversed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.wiring import SHARE_SIZE, likeness, with_filter, with_reading
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations, Parameter


def _statement(name: str, what: str, _: Mapping[str, float]) -> str:
    return f"the {name} {what} is recorded with the wrong sign"


def _attach(site: Site) -> list[Attachment]:
    """Offer a reversed sign of every output and input: by a share s the channel counts 1 − 2 s times."""
    result = []
    against = likeness(site)[:, 0] < -in_force().hypotheses.unit_correlation
    for j, name in enumerate(site.output_names):
        share = f"sensor_sign_{j + 1}"

        def turn(model: Equations, name: str = name, share: str = share) -> Equations:
            sign = f"1 - 2*{share}"
            return with_reading(model, name, f"({sign})*reading", (_share(share),), slope=sign)

        result.append(
            _hypothesis(name, "sensor", location(f"output:{name}", outputs=(name,)), turn, share, bool(against[j]))
        )
    for i, name in enumerate(site.input_names):
        share = f"input_sign_{i + 1}"

        def mirror(model: Equations, name: str = name, share: str = share) -> Equations:
            minus = Parameter(f"{share}_factor", -1.0, "1", -1.0, -1.0)
            return with_filter(model, name, "input_scale", (minus, _share(share)))

        result.append(
            _hypothesis(name, "input", location(f"input:{name}", inputs=(name,)), mirror, share, bool(np.all(against)))
        )
    return result


def _share(name: str) -> Parameter:
    return Parameter(name, 0.0, "", 0.0, 1.0)


def _hypothesis(
    name: str, what: str, where: dict[str, object], edit: Callable[[Equations], Equations], share: str, clear: bool
) -> Attachment:
    return Attachment(
        "sensor_sign", f"sensor_sign {where['entry']}", where, edit,
        (Slot(share, None, "", 0.0, 0.0, 1.0, SHARE_SIZE),),
        fixed={share: 1.0},
        equation=f"{name}_recorded = -{name}",
        statement=partial(_statement, name, what),
        always_fit=clear,
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_sign",
    family="sensor_nonlinearity",
    name="reversed sign of a channel",
    equation="y_recorded = -y",
    source="Ljung 1999, System Identification: Theory for the User, section 14.1 (faults of recorded data)",
    quantities=(),
    attaches_to="every output and every input",
    signature="every response in this channel has the opposite direction",
    confused_with=(
        ("parameter_error", "size: a reversed sign keeps the gain, a wrong value changes it"),
        ("sensor_rectified", "an absolute value is right half of the time"),
    ),
    attach=_attach,
    rank=270,
    turns=True,
)
