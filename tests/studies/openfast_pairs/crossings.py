"""What is changed on other turbines: sets of effects, of a size that is plain on the corpus' turbine.

`first` and `crossed` are effects on a direct drive of 15 MW and on a turbine of 2.8 MW at 16 m/s, the wind the same
over the disc; `field` are effects on these in full fields of turbulence; `third` is a turbine of 5 MW with slender
blades of 100 m and no torsion of its drive train; `sea` is the direct drive on a monopile in waves of 3 m at 14 m/s,
and `floating` the same turbine on a semi-submersible at 16 m/s, every run with waves of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from openfast_pairs.decks import Setting
from openfast_pairs.effects import Values

TURN = math.pi / 180
PLAIN = {  # seeds of the two runs of a turbine as it is, by wind
    ("iea15", "u16"): (11, 12), ("nrel28", "u16"): (21, 22), ("iea15", "f14"): (71, 72), ("nrel28", "f18"): (81, 82),
    ("bar", "u16"): (91, 92), ("pile15", "u14"): (111, 112), ("float15", "u16"): (131, 132),
}  # fmt: skip


@dataclass(frozen=True)
class Change:
    """Describe what a run has that the turbine as it is has not.

    drive: settings of the controller's wrapper; settings: file of the deck, key, value; heavy: factor on the mass of
    the second blade; twisted_deg: angle by which its sections are twisted; shear: exponent of the wind's profile;
    values: true ones, as a diagnosis names them; wind: the same over the disc (u) or a full field of turbulence (f), in
    m/s.
    """

    effect: str
    seed: int
    drive: Mapping[str, float] = field(default_factory=dict)
    settings: tuple[Setting, ...] = ()
    heavy: float | None = None
    twisted_deg: float = 0.0
    shear: float = 0.14
    wind: str = "u16"
    values: Values = field(default_factory=dict)


def _off(effect: str, seed: int, *modes: str) -> Change:
    return Change(effect, seed, settings=tuple(("elastic", m, "False") for m in modes))


def _aero(effect: str, seed: int, key: str) -> Change:
    """Return a part of the aerodynamics that is switched off."""
    return Change(effect, seed, settings=(("aero", key, 0),))


def _drive(effect: str, seed: int, key: str, name: str, value: float, unit: str) -> Change:
    """Return what the controller's wrapper does to a command; value: in the unit that is told."""
    return Change(effect, seed, {key: value * (TURN if unit.startswith("deg") else 1.0)}, values={name: (value, unit)})


def _air(seed: int, factor: float) -> Change:
    values = {"factor": (factor, "1"), "density_change": (factor - 1, "1")}
    settings = tuple((file, "AirDens", 1.225 * factor) for file in ("main", "aero"))
    return Change("density", seed, settings=settings, values=values)


def _second_order(seed: int, omega: float) -> Change:
    values = {"omega_rad_s": (omega, "rad/s"), "zeta": (0.7, "1")}
    return Change("second_order", seed, {"w2": omega, "z2": 0.7}, values=values)


def _lag(seed: int, tau: float) -> Change:
    return _drive("lag", seed, "lag", "tau_s", tau, "s")


def _play(seed: int, width: float) -> Change:
    return _drive("backlash", seed, "backlash", "width", width, "deg")


def _late(seed: int, delay: float) -> Change:
    return _drive("delay", seed, "delay", "delay_s", delay, "s")


def _late_torque(seed: int, tau: float) -> Change:
    return _drive("torque_lag", seed, "torque_lag", "tau_s", tau, "s")


def _yaw(seed: int, angle: float) -> Change:
    return Change("yaw", seed, settings=(("inflow", "PropagationDir", angle),))


def _softer_tower(seed: int, factor: float) -> Change:
    return Change("stiffness_tower", seed, settings=(("tower", "AdjFASt", factor),))


def _pitched(seed: int, angle: float) -> Change:
    return _drive("imbalance_aero", seed, "off1", "offset", angle, "deg")


def _twisted(seed: int, angle: float) -> Change:
    return Change("imbalance_aero", seed, twisted_deg=angle, values={"offset": (angle, "deg")})


def _in(wind: str, *changes: Change) -> tuple[Change, ...]:
    return tuple(replace(c, wind=wind) for c in changes)


_FIRST: Mapping[str, tuple[Change, ...]] = {
    "iea15": (
        _aero("unsteady", 13, "UA_Mod"), _off("mode_flap", 14, "FlapDOF1"), _aero("inflow", 15, "DBEMT_Mod"),
        _lag(16, 0.3), _off("mode_tower", 17, "TwFADOF1"), Change("imbalance_mass", 18, heavy=1.02), _air(19, 0.92),
        _play(20, 0.3), _yaw(31, 10), _softer_tower(33, 0.85),
    ),
    "nrel28": (
        _aero("unsteady", 23, "UA_Mod"), _off("mode_flap", 24, "FlapDOF1"), _aero("inflow", 25, "DBEMT_Mod"),
        _off("mode_shaft", 26, "DrTrDOF"), Change("shear", 27, shear=0.28), _second_order(28, 5.0), _pitched(29, 0.8),
        Change("mass", 30, settings=(("elastic", "NacMass", 147_533),)), _late(32, 0.2),
        _off("mode_edge", 34, "EdgeDOF"),
    ),
}  # fmt: skip
_CROSSED: Mapping[str, tuple[Change, ...]] = {
    "iea15": (
        Change("shear", 41, shear=0.28), _aero("shadow", 42, "TwrPotent"), _off("mode_edge", 43, "EdgeDOF"),
        _second_order(44, 5.0), _late(45, 0.2), _twisted(46, 0.8), _off("mode_side", 47, "TwSSDOF1"),
        _drive("rate", 48, "rate", "rate", 2.0, "deg/s"), _late_torque(49, 0.4),
        _drive("deadband", 50, "deadband", "width", 0.4, "deg"),
    ),
    "nrel28": (
        _lag(61, 0.3), _off("mode_tower", 62, "TwFADOF1"), Change("imbalance_mass", 63, heavy=1.02), _air(64, 0.92),
        _play(65, 0.3), _yaw(66, 10), _softer_tower(67, 0.85), _aero("shadow", 68, "TwrPotent"),
        _off("mode_side", 69, "TwSSDOF1"), _late_torque(70, 0.4),
    ),
}  # fmt: skip
_FIELD: Mapping[str, tuple[Change, ...]] = {
    "iea15": _in(
        "f14", _lag(73, 0.25), _off("mode_tower", 74, "TwFADOF1"), _off("mode_flap", 75, "FlapDOF1"),
        _aero("unsteady", 76, "UA_Mod"), Change("imbalance_mass", 77, heavy=1.03), _play(78, 0.3), _air(79, 0.9),
    ),
    "nrel28": _in(
        "f18", _late(83, 0.2), _off("mode_shaft", 84, "DrTrDOF"), _off("mode_edge", 85, "EdgeDOF"),
        _twisted(86, 1.0), _aero("inflow", 87, "DBEMT_Mod"), _second_order(88, 5.0), _yaw(89, 10),
    ),
}  # fmt: skip
_THIRD: Mapping[str, tuple[Change, ...]] = {
    "bar": (
        _lag(93, 0.25), _off("mode_flap", 94, "FlapDOF1"), _off("mode_tower", 95, "TwFADOF1"), _play(96, 0.25),
        Change("imbalance_mass", 97, heavy=1.02), _aero("unsteady", 98, "UA_Mod"), _air(99, 0.93),
        _aero("inflow", 100, "DBEMT_Mod"), _second_order(101, 5.0), _off("mode_edge", 102, "EdgeDOF"),
        _twisted(103, 0.6), Change("shear", 104, shear=0.26),
    ),
}  # fmt: skip
_ROUGHER = (("sea", "WaveHs", 5.0), ("sea", "WaveTp", 11.0))
_SEA: Mapping[str, tuple[Change, ...]] = {
    "pile15": _in(
        "u14", _lag(113, 0.3), _off("mode_tower", 114, "TwFADOF1"), Change("rougher_sea", 115, settings=_ROUGHER),
        _aero("inflow", 116, "DBEMT_Mod"), Change("imbalance_mass", 117, heavy=1.02), _air(118, 0.92),
        _play(119, 0.3), _off("mode_flap", 120, "FlapDOF1"), _late(121, 0.2), _softer_tower(122, 0.85),
        _aero("unsteady", 123, "UA_Mod"), _off("mode_side", 124, "TwSSDOF1"),
    ),
}  # fmt: skip
_FLOATING: Mapping[str, tuple[Change, ...]] = {
    "float15": (
        _lag(133, 0.3), _off("mode_tower", 134, "TwFADOF1"), Change("rougher_sea", 135, settings=_ROUGHER),
        _off("mode_flap", 136, "FlapDOF1"), _twisted(137, 0.8), _air(138, 0.92), _second_order(139, 5.0),
        Change("shear", 140, shear=0.28), _off("mode_edge", 141, "EdgeDOF"), _play(142, 0.3),
    ),
}  # fmt: skip
SETS = {
    "first": _FIRST, "crossed": _CROSSED, "field": _FIELD, "third": _THIRD, "sea": _SEA, "floating": _FLOATING,
}  # fmt: skip
