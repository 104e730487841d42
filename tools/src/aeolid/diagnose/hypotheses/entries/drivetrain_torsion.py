"""The drive train twists, and the model has it stiff."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.modes import named_mode
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting

ENTRY = named_mode(
    "drivetrain_torsion",
    "drive train torsion",
    "Jonkman, Butterfield, Musial, Scott 2009 (NREL 5 MW), 8.7e8 N m/rad; Burton et al., Wind Energy Handbook",
    "0.5-5 %; 1-2.5 Hz with a gearbox",
    (
        ("rotational_sampling", "three per revolution moves with the rotor speed, torsion does not"),
        ("blade_edge", "edgewise bending shows in the blade roots, torsion in the generator speed"),
    ),
    rank=330,
    settings=(
        Setting(
            OPENFAST,
            (
                "ElastoDyn: DrTrDOF = True, DTTorSpr until it swings at {frequency_hz:.3g} Hz, DTTorDmp"
                " for a damping of {damping:.2g}"
            ),
            "ElastoDyn: DrTrDOF = True, DTTorSpr, DTTorDmp",
        ),
        Setting(BLADED, "Drive train: flexible low speed shaft, torsional stiffness and damping"),
    ),
)
