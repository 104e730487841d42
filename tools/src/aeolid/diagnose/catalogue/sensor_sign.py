"""A channel that was recorded with the sign reversed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from aeolid.diagnose.catalogue.base import Attachment, Entry, Site, Slot, location
from aeolid.diagnose.catalogue.wiring import with_filter, with_reading
from aeolid.models.equations import Equations, Parameter


def _statement(name: str, what: str, _: Mapping[str, float]) -> str:
    return f"the {name} {what} is recorded with the wrong sign"


def _attach(site: Site) -> list[Attachment]:
    """Offer a reversed sign of every output and input; the factor goes from 1 to −1."""
    result = []
    for j, name in enumerate(site.output_names):
        sign = f"sensor_sign_{j + 1}"

        def turn(model: Equations, name: str = name, sign: str = sign) -> Equations:
            return with_reading(model, name, f"{sign}*reading", (_factor(sign),), slope=sign)

        where = location(f"output:{name}", outputs=(name,))
        result.append(_hypothesis(name, "sensor", where, turn, sign))
    for i, name in enumerate(site.input_names):
        sign = f"input_sign_{i + 1}"

        def mirror(model: Equations, name: str = name, sign: str = sign) -> Equations:
            return with_filter(model, name, "input_scale", (_factor(sign),))

        result.append(_hypothesis(name, "input", location(f"input:{name}", inputs=(name,)), mirror, sign))
    return result


def _factor(sign: str) -> Parameter:
    return Parameter(sign, 1.0, "1", -1.0, 1.0)


def _hypothesis(
    name: str, what: str, where: dict[str, object], edit: Callable[[Equations], Equations], sign: str
) -> Attachment:
    return Attachment(
        "sensor_sign", f"sensor_sign {where['entry']}", where, edit,
        (Slot(sign, None, "", 1.0, -1.0, 1.0, 0.01),),
        fixed={sign: -1.0},
        equation=f"{name}_recorded = -{name}",
        statement=partial(_statement, name, what),
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
)
