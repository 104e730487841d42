"""A sensor that is off by a constant."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.imitation import imitated_by_forces
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.hypotheses.parts.wiring import spread_of, unit_of_output, with_reading
from aeolid.models.equations import Equations, Parameter


def _statement(name: str, unit: str, v: Mapping[str, float]) -> str:
    return f"the {name} sensor is off by a constant {v['bias']:+.3g} {unit}".rstrip()


def _attach(site: Site) -> list[Attachment]:
    """Offer an offset where no constant force could do the same; elsewhere say that it cannot be tested."""
    result = []
    for j, name in enumerate(site.output_names):
        if imitated_by_forces(site)[j]:
            result.append(Attachment("sensor_bias", f"sensor_bias output:{name}", _where(name), lambda m: m, ()))
        else:
            result.append(_on(site, j, name))
    return result


def _where(name: str) -> dict[str, object]:
    return location(f"output:{name}", outputs=(name,))


def _on(site: Site, j: int, name: str) -> Attachment:
    bias, unit, spread = f"sensor_bias_{j + 1}", unit_of_output(site, name), spread_of(site.y[:, j])
    reach = 100 * spread

    def edit(model: Equations) -> Equations:
        return with_reading(model, name, f"reading + {bias}", (Parameter(bias, 0.0, unit, -reach, reach),))

    return Attachment(
        "sensor_bias", f"sensor_bias output:{name}", _where(name), edit,
        (Slot(bias, "bias", unit, 0.0, -reach, reach, 1e-2 * spread),),
        equation=f"{name}_recorded = {name} + bias",
        statement=partial(_statement, name, unit),
    )  # fmt: skip


ENTRY = Entry(
    id="sensor_bias",
    family="sensor_nonlinearity",
    name="biased sensor",
    equation="y_recorded = y + bias",
    source="Doebelin 2004, Measurement Systems, chapter 3 (zero offset)",
    quantities=(Quantity("bias", "unit of the output", -1e12, 1e12, 0.0, "recorded less true"),),
    attaches_to="outputs of equations that no constant force could move alone wherever they go; against a simulator's"
    " run of a turbine the pitch angle and the zero of the rotor's angle; elsewhere it cannot be tested",
    signature="a constant difference that contradicts the other outputs",
    confused_with=(
        ("parameter_error", "a wrong value changes with the operating point, a bias does not"),
        ("air_density", "air of another density changes what a degree of pitch does, an offset of the angle does not"),
    ),
    attach=_attach,
    rank=290,
    settings=(
        Setting(
            OPENFAST,
            "AeroDyn: BlTwist in the blade files (ADBlFile) of all blades moved by {bias:.3g} of the angle's unit the"
            " other way, where the blades and not the sensor are off",
            at=r"^input:.*(pitch|blpit|beta)",
        ),
        Setting(
            BLADED,
            "Rotor: blade set angle error of all blades, {bias:.3g} of the angle's unit the other way",
            at=r"^input:.*(pitch|blpit|beta)",
        ),
    ),
)
