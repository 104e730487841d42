"""The tower bends fore and aft, and the model has it rigid."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.modes import named_mode
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting

ENTRY = named_mode(
    "tower_fore_aft",
    "tower fore-aft bending mode",
    "Jonkman, Butterfield, Musial, Scott 2009 (NREL 5 MW), first fore-aft 0.32 Hz; Burton et al., Handbook",
    "structural 0.3-1 %, with the rotor's thrust 4-10 % above rated",
    (
        ("tower_side_side", "fore-aft is damped by the rotor, side-side is not"),
        ("rotational_sampling", "a rotor harmonic moves with the rotor speed, a mode does not"),
    ),
    rank=340,
    settings=(
        Setting(
            OPENFAST,
            (
                "ElastoDyn: TwFADOF1 = True (TwFADOF2 for the second); tower file: AdjFASt until it "
                "swings at {frequency_hz:.3g} Hz, TwrFADmp(1) for its damping without wind"
            ),
            "ElastoDyn: TwFADOF1 = True; tower file: AdjFASt, TwrFADmp(1)",
        ),
        Setting(BLADED, "Modal analysis: include the tower's fore-aft modes"),
    ),
)
