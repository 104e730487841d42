"""The blades bend edgewise, and the model has them rigid."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.blade_response import blade_mode
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting

ENTRY = blade_mode(
    "blade_edge",
    "edgewise blade mode",
    "Jonkman, Butterfield, Musial, Scott 2009 (NREL 5 MW), first edgewise 1.08 Hz; Hansen 2007, Wind Energy 10(6)",
    "1-3 %, little from the air",
    (
        ("gravity_1p", "gravity stands at once per revolution, a mode does not move with the speed"),
        ("drivetrain_torsion", "torsion shows in the generator speed, edgewise bending in the blade roots"),
    ),
    rank=370,
    settings=(
        Setting(OPENFAST, "ElastoDyn: EdgeDOF = True; blade file: AdjEdSt, BldEdDmp(1); or BeamDyn (CompElast = 2)"),
        Setting(BLADED, "Modal analysis: include the blades' edgewise modes"),
    ),
)
