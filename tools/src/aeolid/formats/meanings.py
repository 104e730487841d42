"""Recognise what a heading means: those of OpenFAST and ROSCO by name, those of Bladed, HAWC2 and SCADA by their words.

A heading that stands in a simulator's list of outputs is looked up. Any other is split into words, and the words that
a turbine engineer would read it by decide: what is measured (pitch, torque, …), whether it is demanded, which blade.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from aeolid.formats.headings import split_heading


@dataclass(frozen=True)
class Meaning:
    """Say what a channel is: kind, blade (1 … 3) or 0, and whether it is a demand rather than a measurement."""

    kind: str
    blade: int = 0
    demand: bool = False


KINDS: dict[str, tuple[str, str, str]] = {  # kind: role, unit where nothing says it, what it is
    "pitch": ("input", "deg", "blade pitch angle"),
    "torque": ("input", "kN m", "generator torque"),
    "generator_speed": ("output", "rpm", "generator speed"),
    "rotor_speed": ("output", "rpm", "rotor speed"),
    "tower_acc_fore_aft": ("output", "m/s^2", "tower-top acceleration, fore-aft"),
    "tower_acc_side_side": ("output", "m/s^2", "tower-top acceleration, side-side"),
    "flap_moment": ("output", "kN m", "blade-root moment, flapwise"),
    "edge_moment": ("output", "kN m", "blade-root moment, edgewise"),
    "tower_fore_aft": ("output", "m", "tower-top displacement, fore-aft"),
    "tower_side_side": ("output", "m", "tower-top displacement, side-side"),
    "tower_moment_fore_aft": ("output", "kN m", "tower-base moment, fore-aft"),
    "tower_moment_side_side": ("output", "kN m", "tower-base moment, side-side"),
    "shaft_torque": ("output", "kN m", "rotor torque"),
    "thrust": ("output", "kN", "rotor thrust"),
    "power": ("output", "kW", "electrical power"),
    "wind": ("scheduling", "m/s", "wind speed"),
    "azimuth": ("azimuth", "deg", "rotor azimuth"),
    "pitch_excitation": ("excitation", "deg", "test signal added to the pitch demand"),
    "torque_excitation": ("excitation", "kN m", "test signal added to the torque demand"),
}

_EXACT = {
    "blpitchc": ("pitch", True), "bldpitch": ("pitch", False), "blpitch": ("pitch", False),
    "ptchpmzc": ("pitch", False),
    "ptchpmzb": ("pitch", False), "pitcom": ("pitch", True), "pcpitcomt": ("pitch", True), "pitcomt": ("pitch", True),
    "blpitchcmeas": ("pitch", False), "gentq": ("torque", False), "gentqmeas": ("torque", False),
    "gentorque": ("torque", False), "vslastgentrq": ("torque", True), "vsgentrqcom": ("torque", True),
    "genspeed": ("generator_speed", False), "hssspeed": ("generator_speed", False), "hssv": ("generator_speed", False),
    "rotspeed": ("rotor_speed", False), "rotv": ("rotor_speed", False), "lssv": ("rotor_speed", False),
    "lsstipv": ("rotor_speed", False), "azimuth": ("azimuth", False), "lsstipp": ("azimuth", False),
    "lssgagp": ("azimuth", False), "yawbrtaxp": ("tower_acc_fore_aft", False),
    "ncimutaxs": ("tower_acc_fore_aft", False),
    "faacc": ("tower_acc_fore_aft", False), "nacimufaacc": ("tower_acc_fore_aft", False),
    "ttaccfa": ("tower_acc_fore_aft", False), "ttaccss": ("tower_acc_side_side", False),
    "lsshfttq": ("shaft_torque", False), "lsshftmxa": ("shaft_torque", False),
    "yawbrtayp": ("tower_acc_side_side", False), "ncimutays": ("tower_acc_side_side", False),
    "ttdspfa": ("tower_fore_aft", False), "yawbrtdxp": ("tower_fore_aft", False), "ttdspss": ("tower_side_side", False),
    "yawbrtdyp": ("tower_side_side", False), "rootmyb": ("flap_moment", False), "rootmflp": ("flap_moment", False),
    "rootmyc": ("flap_moment", False), "rootmoop": ("flap_moment", False), "rootmxb": ("edge_moment", False),
    "rootmxc": ("edge_moment", False), "rootmedg": ("edge_moment", False), "rootmip": ("edge_moment", False),
    "wind1velx": ("wind", False), "windvelx": ("wind", False), "horwindv": ("wind", False), "wevw": ("wind", False),
    "windhubvelx": ("wind", False), "rtvavgxh": ("wind", False), "genpwr": ("power", False),
    "rotthrust": ("thrust", False), "lssthrxs": ("thrust", False), "rottorq": ("shaft_torque", False),
    "lsstq": ("shaft_torque", False), "twrbsmyt": ("tower_moment_fore_aft", False),
    "twrbsmxt": ("tower_moment_side_side", False),
}  # fmt: skip


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_DEMAND = _set("demand demanded dem cmd command commanded ref reference setpoint sp com desired target soll")
_TEST = _set("excitation excite injected injection perturbation chirp prbs probing dither")
_SPEED = _set("speed spd rpm omega revs rotation velocity freq frequency")
_TORQUE = _set("torque tq trq mom moment")
_GENERATOR = _set("generator gen hss electrical airgap")
_ROTOR = _set("rotor rot lss shaft main")
_TOP = _set("tower nacelle nac tt towertop top twr nacac")
_ACC = _set("acc acceleration accel accelerometer acce")
_FORE = _set("fa fore aft foreaft longitudinal axial x xx along")
_SIDE = _set("ss side sideside lateral transversal transverse y yy cross")
_NOT_PITCH = _set(
    "rate speed velocity torque tq motor current temp temperature acc acceleration accel platform ptfm "
    "bearing force moment mom pressure battery voltage hydraulic error status nacelle tower"
)
_NOT_WIND = _set("y z standard deviation direction dir std stdev turbulence ti gust power vane yaw shear max min angle")
_OTHER = _set("moment mom torque force shear my mx base bending stress damper vel velocity speed strain")
_SPOILT = _set("temp temperature pressure oil status alarm count counter std stdev error")


def words_of(heading: str) -> tuple[str, ...]:
    """Split a heading into its words, in lower case: at signs, digits and capitals.

    >>> words_of("BldPitch1"), words_of("Nacelle fore-aft acceleration")
    (('bld', 'pitch', '1'), ('nacelle', 'fore', 'aft', 'acceleration'))
    """
    spaced = re.sub(r"([a-z])([A-Z])", r"\1 \2", heading)
    return tuple(w.lower() for w in re.findall(r"[^\W\d_]+|\d+", spaced))


def meaning_of(heading: str) -> Meaning | None:
    """Return what a heading means, None where that is not known. A unit behind the name does not matter.

    >>> meaning_of("BldPitch1 [deg]"), meaning_of("Pitch angle demand blade B"), meaning_of("Oil temperature")
    (Meaning(kind='pitch', blade=1, demand=False), Meaning(kind='pitch', blade=2, demand=True), None)
    """
    name = split_heading(heading)[0]
    own = re.fullmatch(rf"({'|'.join(KINDS)})(?:_([123]))?(_demand)?", name.lower())
    if own is not None:
        return Meaning(own[1], int(own[2] or 0) if own[1] in BLADED else 0, own[3] is not None)
    if re.fullmatch(r".*\(\d\)", heading.strip()):  # rootMOOP(1)
        name = heading.strip().rstrip(")").replace("(", "")
    found = re.fullmatch(r"(.*?)[_\s]*([1-3]?)(?:xa|[xy]?[a-z]?s)?", re.sub(r"[_\s-]", "", name).lower())
    plain = re.sub(r"[\W_]", "", name).lower()
    for stem, blade in ((plain, ""), (plain[:-1], plain[-1:]), *([(found[1], found[2])] if found else [])):
        if stem in _EXACT and (not blade or blade in "123"):
            kind, demand = _EXACT[stem]
            return Meaning(kind, int(blade or 0) if kind in BLADED else 0, demand)
    lss = re.fullmatch(r"(lsstip|lssgag)([pv])xa", plain)
    if lss is not None:
        return Meaning("azimuth" if lss[2] == "p" else "rotor_speed")
    words = words_of(name)
    if "mbdy" in words:  # in HAWC2 the x axis of a blade's body points along the chord: Mx bends it flapwise
        swapped = {"mx": "my", "my": "mx"}
        words = tuple(swapped.get(w, w) for w in words)
    kind_found = next((kind for kind, fits in _RULES if fits(set(words))), None)
    if kind_found is None:
        return None
    return Meaning(kind_found, _blade(words) if kind_found in BLADED else 0, bool(_DEMAND & set(words)))


BLADED = ("pitch", "flap_moment", "edge_moment")  # kinds that each blade has


def _blade(words: tuple[str, ...]) -> int:
    """Return the number of the blade a heading names: a digit, or a letter of its own."""
    for i, word in enumerate(words):
        if word in ("1", "2", "3"):
            return int(word)
        letter = word in ("a", "b", "c") and (i + 1 == len(words) or words[i - 1] in ("blade", "bld", "axis", "angle"))
        if letter:
            return "abc".index(word) + 1
    return 0


Words = set[str]


def _is_pitch(w: Words) -> bool:
    named = bool({"pitch", "pit", "ptch", "blpitch", "bldpitch"} & w) or (
        {"blade", "angle"} <= w and "azimuth" not in w
    )
    numbered = any(x.startswith("pitch") for x in w)
    return (named or numbered) and not _NOT_PITCH & w


def _is_azimuth(w: Words) -> bool:
    of_rotor = bool({"rotor", "shaft", "rot"} & w) and bool({"position", "angle"} & w)
    return bool({"azimuth", "azim", "azi"} & w) or (of_rotor and not (_SPEED | _TEST | {"yaw"}) & w)


def _is_flap(w: Words) -> bool:
    at_root = bool({"root", "blade", "bld", "flap", "flapwise"} & w)
    return bool({"flap", "flapwise", "my", "oop", "outofplane"} & w) and at_root and "tip" not in w


def _is_edge(w: Words) -> bool:
    at_root = bool({"root", "blade", "bld", "edge", "edgewise"} & w)
    return bool({"edge", "edgewise", "mx", "inplane", "lag", "lagwise"} & w) and at_root and "tip" not in w


def _is_torque(w: Words) -> bool:
    of_rotor = bool((_ROTOR | {"aero", "aerodynamic", "ae", "tower", "yaw", "blade", "root"}) & w)
    of_pitch = bool({"pitch", "motor"} & w)
    return bool({"torque", "tq", "trq"} & w) and (bool(_GENERATOR & w) or not of_rotor) and not of_pitch


def _is_wind(w: Words) -> bool:
    named = bool({"wind", "windspeed", "wsp", "ws", "anemometer", "vhub"} & w)
    return named and not (_NOT_WIND | _SPOILT) & w


_RULES: tuple[tuple[str, Callable[[Words], bool]], ...] = (
    ("pitch_excitation", lambda w: bool(_TEST & w) and bool({"pitch", "pit", "blade"} & w)),
    ("torque_excitation", lambda w: bool(_TEST & w) and bool({"torque", "tq", "trq", "gen"} & w)),
    ("azimuth", _is_azimuth),
    ("pitch", _is_pitch),
    ("tower_acc_fore_aft", lambda w: bool(_ACC & w) and bool(_TOP & w) and bool(_FORE & w)),
    ("tower_acc_side_side", lambda w: bool(_ACC & w) and bool(_TOP & w) and bool(_SIDE & w)),
    ("flap_moment", _is_flap),
    ("edge_moment", _is_edge),
    ("generator_speed", lambda w: bool(_GENERATOR & w) and bool(_SPEED & w) and not _SPOILT & w),
    ("rotor_speed", lambda w: bool(_ROTOR & w) and bool(_SPEED & w) and not (_SPOILT | {"wind"}) & w),
    ("rotor_speed", lambda w: w == {"omega"}),
    ("torque", _is_torque),
    ("shaft_torque", lambda w: bool(_TORQUE & w) and bool((_ROTOR | {"aero", "aerodynamic"}) & w) and "tower" not in w),
    ("tower_fore_aft", lambda w: bool(_TOP & w) and ({"fore", "aft"} <= w or "fa" in w) and not _OTHER & w),
    ("tower_side_side", lambda w: bool(_TOP & w) and bool({"side", "ss"} & w) and not _OTHER & w),
    ("thrust", lambda w: "thrust" in w),
    ("wind", _is_wind),
    ("power", lambda w: bool({"power", "pwr"} & w) and not {"reactive", "factor", "coefficient", "std", "supply"} & w),
)  # fmt: skip
