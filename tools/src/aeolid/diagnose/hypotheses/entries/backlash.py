"""Play between command and drive."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.driven_through_play import driven_through_play
from aeolid.diagnose.hypotheses.parts.settings import (
    BLADED,
    DRIVES,
    DRIVES_PITCH,
    DRIVES_TORQUE,
    OPENFAST,
    Setting,
    given,
)
from aeolid.diagnose.hypotheses.parts.wiring import blended_filter, commanded, spread_of, unit_of_input

_GRID = (0.1, 0.3, 0.8, 1.6)  # of the input's spread
_STARTS = 10


def _statement(name: str, unit: str, v: Mapping[str, float]) -> str:
    return f"{name} acts with {v['width']:.3g} {unit} of play (backlash) that the model leaves out".replace("  ", " ")


def _attach(site: Site) -> list[Attachment]:
    result = []
    for i in commanded(site):
        name = site.input_names[i]
        spread, unit, width = spread_of(site.u[:, i]), unit_of_input(site, i), f"backlash_width_{i + 1}"
        if spread <= 0:
            continue
        slot = Slot(width, "width", unit, 0.0, 0.0, 6 * spread, 0.01 * spread, local=False)
        result.append(
            blended_filter(
                site, i, "backlash", (slot,), entry="backlash",
                grid=[{width: share * spread} for share in _GRID],
                starts=({}, *({width: float(w)} for w in spread * np.geomspace(0.03, 3.0, _STARTS))),
                equation=f"{name}_actual = min(max({name}_actual, {name} - width/2), {name} + width/2)",
                statement=partial(_statement, name, unit),
            )
        )  # fmt: skip
    return result + driven_through_play(site)


ENTRY = Entry(
    id="backlash",
    family="input_nonlinearity",
    name="backlash",
    equation="u_actual = min(max(u_actual, u - width/2), u + width/2); of a body share*(1 - share)*R between it and its"
    " drive, R = w^2*(x - min(max(x, -width/2), width/2))",
    source="Nordin and Gutman 2002, Automatica 38(10), Controlling mechanical systems with backlash; the play operator",
    quantities=(
        Quantity("width", "unit of the input (m for a body)", 0.0, 1e9, 0.0, "full width of the play"),
        Quantity("share", "1", 0.02, 0.98, float("nan"), "part of the inertia behind the play, where a body has it"),
    ),
    attaches_to="every input but measured disturbances; beside turbines every body of first-principles equations that"
    " an input moves: between its drive and what the outputs read",
    signature="after each reversal nothing happens until the play is taken up; a loop as wide at every rate",
    confused_with=(
        ("coulomb_friction", "loop area against amplitude: the loop of play keeps its width, friction acts on forces"),
        ("deadband", "a dead band has no memory of the direction"),
        ("transport_delay", "slow motion: the lag behind play grows in time as the command slows down"),
    ),
    attach=_attach,
    rank=100,
    settings=(
        Setting(
            OPENFAST,
            "no switch: pass the demand through {width:.3g} of play (in its unit) between controller library and"
            " ServoDyn",
            "no switch: pass the demand through the play between controller library and ServoDyn",
            at=DRIVES,
        ),
        Setting(
            BLADED,
            "Pitch actuator in an external library, with {width:.3g} of play",
            "Pitch actuator in an external library, with play",
            at=DRIVES_PITCH,
        ),
        Setting(
            BLADED,
            "no switch: pass the torque demand through {width:.3g} of play (in its unit) in the external controller",
            "no switch: pass the torque demand through the play in the external controller",
            at=DRIVES_TORQUE,
        ),
        *given(
            "pass what the run is given through {width:.3g} of play (in its unit)",
            "pass what the run is given through the play",
        ),
    ),
)
