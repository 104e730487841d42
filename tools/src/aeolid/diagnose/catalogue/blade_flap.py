"""The blades bend flapwise, and the model has them rigid."""

from __future__ import annotations

from dataclasses import replace

from aeolid.diagnose.catalogue.base import Attachment, Site
from aeolid.diagnose.catalogue.blade_response import responses
from aeolid.diagnose.catalogue.modes import attach_named, named_mode


def _attach(site: Site) -> list[Attachment]:
    return attach_named("blade_flap", site) + responses("blade_flap", site)


ENTRY = replace(
    named_mode(
        "blade_flap",
        "flapwise blade mode",
        "Jonkman, Butterfield, Musial, Scott 2009 (NREL 5 MW), first flapwise 0.65-0.7 Hz;"
        " Hansen 2007, Wind Energy 10(6)",
        "strongly damped by the air, up to 60 %",
        (
            ("rotational_sampling", "a rotor harmonic moves with the rotor speed, a mode hardly does"),
            ("unsteady_aero", "lift that builds up is a lag, a mode turns the phase by 180 degrees"),
        ),
    ),
    attach=_attach,
)
