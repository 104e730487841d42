"""Say where a simulator has an effect: words of OpenFAST, ROSCO and Bladed, each beside its entry.

OpenFAST's are keys of its input files (OpenFAST 3 to 5: turbine.fst, ElastoDyn, ServoDyn, AeroDyn 15, InflowWind,
SeaState, HydroDyn), ROSCO's those of DISCON.IN (2.6 to 2.10), Bladed's names of its screens (4.x). A program that has
no such setting has "no switch", and what to do instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi

OPENFAST, ROSCO, BLADED = "OpenFAST", "ROSCO", "Bladed"
_PITCH = r"pitch|blpit|ptch|pitcom|beta"
_TORQUE = r"(?!.*(rot|aero|yaw|shft|shaft)).*(torque|tq|trq)"  # of the generator
DRIVES_PITCH = rf"^$|^input:.*({_PITCH})"  # places (lower case) of an effect: a pitch drive, or no place told
DRIVES_TORQUE = rf"^input:(?!.*({_PITCH})){_TORQUE}"
DRIVES_ELSE = rf"^input:(?!.*({_PITCH}))(?!{_TORQUE})"  # neither: measured winds and what else a run is given
DRIVES = f"{DRIVES_PITCH}|{DRIVES_TORQUE}"
# what a row may name beside the quantities of its entry: the quantity that it follows from, and how
DERIVED: Mapping[str, tuple[str, Callable[[float], float]]] = {
    "corner_rad_s": ("tau_s", lambda tau: 1.0 / tau),
    "corner_hz": ("tau_s", lambda tau: 1.0 / (2 * pi * tau)),
    "density_factor": ("density_change", lambda change: 1.0 + change),
}


@dataclass(frozen=True)
class Setting:
    """Say what to set in one simulator.

    valued: with values of the effect in braces, quantities of its entry or DERIVED from one; general: for values that
    were not told, "" where valued names none; at: a pattern of the places (lower case) that it is for, "" for all.
    """

    simulator: str
    valued: str
    general: str = ""
    at: str = ""


def given(valued: str, general: str) -> tuple[Setting, ...]:
    """Return the rows of an input that is neither pitch nor torque: no drive of a simulator lies behind it.

    valued, general: what to do instead to "what the run is given", a wind or another time series in a file.
    """
    wind = {OPENFAST: "InflowWind: WindType = 2, the uniform wind file", BLADED: "Wind: time history at one point"}
    return tuple(
        Setting(s, f"no switch: {valued} (a wind: {file})", f"no switch: {general} (a wind: {file})", DRIVES_ELSE)
        for s, file in wind.items()
    )
