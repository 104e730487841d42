"""A blade that stands at another pitch angle than its neighbours."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import swing, swings
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import Equations, Parameter

_RATIO = "aero_imbalance_ratio"
# In-plane force of the blade over what its tilting moment does to the fore-aft motion, 1.5*arm/height of its thrust:
# 0.6 on the NREL 5 MW at 18 m/s, less in lighter wind.
_MOST = 1.0
_WIND = "*(V/V_mean)^2"  # where a wind is recorded


def _attach(site: Site) -> list[Attachment]:
    axial = rotor.place(site, "fore_aft")
    if not is_turbine(site.context) or axial is None:
        return []
    factor, side = rotor.wind_factor(site), rotor.place(site, "side_side")
    as_force = side is not None and side.is_force and axial.is_force
    places = [(p, factor) for p in (axial, None if as_force else side) if p is not None]
    made = rotor.locked(
        site, "aero_imbalance", places, 1, f"F_fore_aft = {swing(axial.label)}{_WIND if factor else ''}",
        lambda size, unit, where: (
            f"one blade stands at another pitch angle: once a turn {size:.3g} {unit} fore and aft at {where}"
            " that the model leaves out"
        ),
    )  # fmt: skip
    if not made or side is None:
        return made
    if not as_force:  # straight on the outputs, each with its own phase: the fore-aft one makes it this effect
        found = replace(made[0], essential=tuple(s.name for s in made[0].slots[:2]))
        return [found if side.unit != axial.unit else replace(found, credible=_mostly_fore_aft(found))]
    return [_with_side(made[0], side, site, factor)]


def _mostly_fore_aft(made: Attachment) -> Callable[[Mapping[str, float]], str]:
    """Refuse what shakes the tower more to its side than fore and aft: a heavy blade does.

    Its weight turns the shaft unevenly, so the thrust swings too: half of the side-side motion fore and aft.
    """
    labels = [s.label or "" for s in made.slots]

    def credible(values: Mapping[str, float]) -> str:
        axial, side = (math.hypot(*(values.get(name, 0.0) for name in part)) for part in (labels[:2], labels[2:]))
        if side <= in_force().hypotheses.side_over_fore_aft * axial:
            return ""
        return f"the side-side motion is {side / max(axial, 1e-300):.2g} times the fore-aft one"

    return credible


def _with_side(made: Attachment, side: rotor.Place, site: Site, factor: str) -> Attachment:
    """Let the in-plane force of the same blade act a quarter turn later on the side-side motion."""
    c, s = (slot.name for slot in made.slots)
    phase = rotor.angle(site, 1)
    assert phase is not None
    texts = [f"{_RATIO}*({c}*sin({x}) - {s}*cos({x})){factor}" for x in (phase.held, phase.now)]
    term = rotor.Term(side, texts[0], texts[1], "aero_imbalance_side")

    def edit(model: Equations) -> Equations:
        model = made.edit(model)
        model = replace(model, parameters=(*model.parameters, Parameter(_RATIO, 0.0, "1", -_MOST, _MOST)))
        return term.on(model)

    ratio = Slot(_RATIO, "side_over_fore_aft", "1", 0.0, -_MOST, _MOST, 0.3, local=False)
    where = {**made.location, "outputs": [*made.location["outputs"], side.output]}
    starts: tuple[dict[str, float], ...] = ({}, {_RATIO: 0.5}, {_RATIO: -0.5})
    return replace(made, edit=edit, slots=(*made.slots, ratio), location=where, starts=starts)


ENTRY = Entry(
    id="aero_imbalance",
    family="rotor_1p",
    name="aerodynamic imbalance (pitch offset of a blade)",
    equation=f"F_fore_aft = {swing('force_N')}{_WIND},"
    f" F_side = side_over_fore_aft*(force_N_cos*sin(azimuth) - force_N_sin*cos(azimuth)){_WIND}",
    source="Niebsch, Ramlau 2014, Renewable Energy 70; Burton et al., Wind Energy Handbook",
    quantities=(
        *swings("force on the fore-aft motion by the tilting moment"),
        Quantity("side_over_fore_aft", "1", -_MOST, _MOST, 0.0, "in-plane force on side-side over that on fore-aft"),
    ),
    attaches_to="tower fore-aft (and side-side, in equations) of a wind turbine with a recorded rotor angle or speed",
    signature="a line at the rotor's speed in the fore-aft motion, locked to the angle, growing with the wind squared",
    confused_with=(
        ("mass_imbalance", "the fore-aft motion: a pitched blade shakes it once a turn, a mass does not"),
        ("wind_shear", "the mean over the blades of their root moments: shear loads every blade alike"),
    ),
    attach=_attach,
    rank=420,
    settings=(
        Setting(
            OPENFAST,
            ("AeroDyn: a blade file of its own for one blade (ADBlFile) with BlTwist moved by the pitch error"),
        ),
        Setting(BLADED, "Rotor: blade set angle error of one blade"),
    ),
)
