"""Say where a simulator has an effect: words of OpenFAST, ROSCO and Bladed, each beside its entry.

OpenFAST's are keys of its input files (OpenFAST 3 to 5: turbine.fst, ElastoDyn, ServoDyn, AeroDyn 15, InflowWind,
SeaState, HydroDyn), ROSCO's those of DISCON.IN (2.6 to 2.10), Bladed's names of its screens (4.x).
"""

from __future__ import annotations

from dataclasses import dataclass

OPENFAST, ROSCO, BLADED = "OpenFAST", "ROSCO", "Bladed"
DRIVES_PITCH = r"^(?!input:)|pitch|blpit|beta"  # places of an effect: a pitch drive, or no drive at all
DRIVES_ELSE = r"^input:(?!.*(pitch|blpit|beta))"


@dataclass(frozen=True)
class Setting:
    """Say what to set in one simulator.

    valued: with values of the effect in braces; general: for values that were not told, "" where valued names none;
    at: a pattern of the places (lower case) that it is for, "" for all.
    """

    simulator: str
    valued: str
    general: str = ""
    at: str = ""
