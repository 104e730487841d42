"""Name the channels of the wrapper for Bladed-style controllers, and find them in a simulator's recording."""

from __future__ import annotations

import re
from dataclasses import dataclass

from aeolid.units import factor, rightly

# `port/discon/records.c`: what the wrapper taps, in its units.
CHANNELS = {
    "pitch_command": "rad", "pitch_command_1": "rad", "pitch_command_2": "rad", "pitch_command_3": "rad",
    "torque_command": "N m", "yaw_rate_command": "rad/s", "pitch": "rad", "pitch_1": "rad", "pitch_2": "rad",
    "pitch_3": "rad", "generator_torque": "N m", "generator_speed": "rad/s", "rotor_speed": "rad/s",
    "shaft_power": "W", "power": "W", "yaw_error": "rad", "wind": "m/s", "nacelle_angle": "rad",
    "tower_fore_aft": "m/s^2", "tower_side_side": "m/s^2", "azimuth": "rad", "blade_root_out_1": "N m",
    "blade_root_out_2": "N m", "blade_root_out_3": "N m", "blade_root_in_1": "N m", "blade_root_in_2": "N m",
    "blade_root_in_3": "N m", "nacelle_roll": "rad/s^2", "nacelle_nod": "rad/s^2", "nacelle_yaw": "rad/s^2",
    "shaft_torque": "N m", "thrust": "N", "excitation_pitch": "rad", "excitation_pitch_1": "rad",
    "excitation_pitch_2": "rad", "excitation_pitch_3": "rad", "excitation_torque": "N m",
}  # fmt: skip

# OpenFAST's headings of the quantities that ServoDyn hands to a controller, the better source of one first. Commands
# are seldom among them: the blade's angle and the generator's torque have about their mean and deviation.
OPENFAST = {
    "pitch_command": ("BlPitchC1", "BldPitch1"), "torque_command": ("GenTq",), "generator_speed": ("GenSpeed",),
    "tower_fore_aft": ("YawBrTAxp",), "tower_side_side": ("YawBrTAyp",), "blade_root_out_1": ("RootMyc1",),
    "blade_root_out_2": ("RootMyc2",), "blade_root_out_3": ("RootMyc3",), "nacelle_nod": ("NcIMURAys",),
}  # fmt: skip


@dataclass(frozen=True)
class Tapped:
    """Hold a channel of a recording that the wrapper taps too: its heading, and the wrapper's unit over its own."""

    name: str
    heading: str
    factor: float


def factor_to(name: str, unit: str) -> float | None:
    """Return what a number in `unit` is multiplied with to be in the wrapper's unit of `name`; None where unknown."""
    wanted = CHANNELS.get(name)
    if wanted is None:
        return None
    plain = re.sub(r"[-·*\s]+", " ", unit.replace("²", "^2")).strip()
    return factor(rightly(plain) or plain, wanted)


def role_of(name: str) -> str:
    """Return the role that a channel of the wrapper usually has: demands act, what turns or blows schedules."""
    if "command" in name:
        return "input"
    return (
        "scheduling" if name in ("wind", "azimuth", "yaw_error", "nacelle_angle") or "excitation" in name else "output"
    )


def find_tapped(headings: dict[str, str]) -> list[Tapped]:
    """Find the wrapper's channels among headings (name: unit) of a log of the wrapper or a file of OpenFAST.

    Excitation is left out: the wrapper taps it by itself.
    """
    found = []
    for name in (n for n in CHANNELS if not n.startswith("excitation")):
        for heading in (name, *OPENFAST.get(name, ())):
            ratio = factor_to(name, headings[heading]) if heading in headings else None
            if ratio is not None:
                found.append(Tapped(name, heading, ratio))
                break
    return found
