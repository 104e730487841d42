"""The tower bends fore and aft, and the model has it rigid."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.modes import named_mode

ENTRY = named_mode(
    "tower_fore_aft",
    "tower fore-aft bending mode",
    "Jonkman, Butterfield, Musial, Scott 2009 (NREL 5 MW), first fore-aft 0.32 Hz; Burton et al., Handbook",
    "structural 0.3-1 %, with the rotor's thrust 4-10 % above rated",
    (
        ("tower_side_side", "fore-aft is damped by the rotor, side-side is not"),
        ("rotational_sampling", "a rotor harmonic moves with the rotor speed, a mode does not"),
    ),
)
