"""The blades bend flapwise, and the model has them rigid."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.blade_response import blade_mode
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting

ENTRY = blade_mode(
    "blade_flap",
    "flapwise blade mode",
    "Jonkman, Butterfield, Musial, Scott 2009 (NREL 5 MW), first flapwise 0.65-0.7 Hz; Hansen 2007, Wind Energy 10(6)",
    "strongly damped by the air, up to 60 %",
    (
        ("rotational_sampling", "a rotor harmonic moves with the rotor speed, a mode hardly does"),
        ("unsteady_aero", "lift that builds up is a lag, a mode turns the phase by 180 degrees"),
    ),
    rank=360,
    settings=(
        Setting(
            OPENFAST,
            (
                "ElastoDyn: FlapDOF1 = True (FlapDOF2 for the second); blade file: AdjFlSt, "
                "BldFlDmp(1); or BeamDyn (CompElast = 2)"
            ),
        ),
        Setting(BLADED, "Modal analysis: include the blades' flapwise modes"),
    ),
)
