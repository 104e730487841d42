"""The tower bends from side to side, and the model has it rigid."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.modes import named_mode
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting

ENTRY = named_mode(
    "tower_side_side",
    "tower side-side bending mode",
    "Jonkman, Butterfield, Musial, Scott 2009 (NREL 5 MW), first side-side 0.31 Hz; Burton et al., Handbook",
    "structural 0.3-1 %, nearly none from the air",
    (
        ("tower_fore_aft", "fore-aft is damped by the rotor, side-side is not"),
        ("mass_imbalance", "an imbalance moves with the rotor speed, a mode does not"),
    ),
    rank=350,
    settings=(
        Setting(
            OPENFAST,
            (
                "ElastoDyn: TwSSDOF1 = True (TwSSDOF2 for the second); tower file: AdjSSSt until it "
                "swings at {frequency_hz:.3g} Hz, TwrSSDmp(1)"
            ),
            "ElastoDyn: TwSSDOF1 = True; tower file: AdjSSSt, TwrSSDmp(1)",
        ),
        Setting(BLADED, "Modal analysis: include the tower's side-side modes"),
    ),
)
