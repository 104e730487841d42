"""The menu of effects, plant by plant."""

from __future__ import annotations

import math
from dataclasses import replace

from aeolid.challenge.items import (
    BOTH,
    WRITTEN,
    Item,
    Put,
    declared,
    drive_a,
    field,
    in_plant,
    on_drive,
    on_sensor,
    sensor_a,
)
from aeolid.challenge.models import PLANTS
from aeolid.challenge.paths import Sensor
from aeolid.challenge.plants import Setup

ALL = ("spring", "shaft", "tanks", "heater", "turbine")
RUNS = ("equations", "state_space", "run")
_LAG = {"spring": 0.015, "shaft": 0.01, "tanks": 2.0, "heater": 6.0, "turbine": 0.15}
_OMEGA = {"spring": 60.0, "shaft": 120.0, "tanks": 0.6, "heater": 0.15, "turbine": 6.0}
_RATE = {"spring": 20.0, "shaft": 40.0, "tanks": 0.4, "heater": 1.5, "turbine": 2.5}
_LIMIT = {"spring": 2.2, "shaft": 2.2, "tanks": 0.8, "heater": 9.0}
_PLAY = {"spring": 0.15, "shaft": 0.15, "tanks": 0.06, "heater": 0.6, "turbine": 0.15}
_STEP = {"spring": 0.2, "shaft": 0.2, "tanks": 0.1, "heater": 2.0, "turbine": 0.2}
_SEEN = {"spring": 0.15, "shaft": 0.1, "tanks": 3e-4, "heater": 0.4, "turbine": 0.4}
_READ = {"spring": 1, "shaft": 1, "tanks": 1, "heater": 1, "turbine": 0}  # the output whose sensor is at fault
_SPAN = {"spring": (0.0, 2.4), "shaft": (0.1, 1.5), "tanks": (0.55, 0.25), "heater": (51.5, 6.5)}  # middle, reach
_GRAIN = {"spring": 0.05, "shaft": 0.1, "tanks": 0.02, "heater": 0.2}


def drives(p: str) -> list[Item]:
    """List what a drive may hide."""
    closed = (1, 18) if p == "turbine" else (2, 6)
    found = [
        Item(p, ("actuator_lag",), on_drive("lag", _LAG[p]), closed, "drive lags", RUNS, ("tau_s", drive_a)),
        Item(p, ("actuator_second_order",), on_drive("second_order", _OMEGA[p], inverse=True, b=0.7), closed,
             "drive rings", BOTH, ("omega_rad_s", drive_a)),
        Item(p, ("transport_delay", "data_time_offset"), on_drive("delay", 1.3 * _LAG[p]), (*closed, 16),
             "drive is late", RUNS, ("delay_s", drive_a)),
        Item(p, ("rate_limit",), on_drive("rate", _RATE[p], inverse=True), (12, 19), "drive has a highest rate", BOTH,
             ("rate_per_s", drive_a)),
        Item(p, ("backlash",), on_drive("backlash", _PLAY[p], b=0.2 * _LAG[p]), (2, 6), "drive has play", BOTH,
             ("width", drive_a)),
        Item(p, ("input_quantisation",), on_drive("levels", _STEP[p], snap=True), (4, 9), "drive has levels", BOTH,
             ("spacing", drive_a)),
    ]  # fmt: skip
    if p in _LIMIT:
        high = PLANTS[p].rest[0]
        found.append(Item(p, ("input_saturation",), on_drive("saturation", _LIMIT[p], inverse=True), (12, 6),
                          "drive clips", BOTH, ("high", lambda s: high + s.drive.a)))  # fmt: skip
    if p in ("spring", "shaft"):
        found.append(Item(p, ("deadband",), on_drive("deadband", 0.08), (19, 6), "drive has a dead zone", BOTH,
                          ("width", drive_a)))  # fmt: skip
    return found


def sensors(p: str) -> list[Item]:
    """List what a sensor or logger may hide."""
    at = _READ[p]
    found = [
        Item(p, ("sensor_lag",), on_sensor("lag", at, _LAG[p]), (17, 2), "sensor lags", BOTH, ("tau_s", sensor_a)),
        Item(p, ("sensor_second_order",), on_sensor("second_order", at, _OMEGA[p], inverse=True, b=0.7), (17, 2),
             "sensor is filtered", BOTH, ("omega_rad_s", sensor_a)),
        Item(p, ("sensor_scale",), on_sensor("scale", at, 0.03, plus=1.0), (20, 6), "sensor reads too much", BOTH,
             ("factor", sensor_a), forms=1),
    ]  # fmt: skip
    if p != "turbine":  # accelerations jump with the command: any offset at all would show there
        names = ("data_time_offset", "transport_delay")  # of a single input they are one model
        found.append(Item(p, names, _offset(_LAG[p]), (16, 2), "clock offset", BOTH,
                          ("offset_s", sensor_a)))  # fmt: skip
    if p in _SPAN:
        middle, reach = _SPAN[p]
        found += [
            Item(p, ("sensor_saturation",), on_sensor("saturation", at, reach, inverse=True, b=middle), (9, 12),
                 "sensor clips", BOTH, ("high", lambda s: s.sensors[-1].b + s.sensors[-1].a)),
            Item(p, ("sensor_quantisation",), on_sensor("levels", at, _GRAIN[p], snap=True), (9, 4),
                 "sensor has levels", BOTH, ("spacing", sensor_a)),
        ]  # fmt: skip
    if p in ("spring", "shaft"):
        found += [
            Item(p, ("sensor_rectified",), on_sensor("rectified", at, 1.0), (9,), "sensor has no sign", fixed=True,
                 outputs=("position", "speed") if p == "spring" else ("motor_speed", "load_speed")),
            Item(p, ("sensor_bias",), on_sensor("bias", at, 0.01), (15, 6), "sensor is off", WRITTEN,
                 ("bias", sensor_a), forms=1),
            Item(p, ("sensor_drift",), on_sensor("drift", at, 0.02 / 100.0), (15, 22), "sensor drifts", WRITTEN,
                 ("rate_per_s", sensor_a)),
        ]  # fmt: skip
    if p in ("shaft", "turbine"):
        skew = on_sensor("skew", 1, 0.02)
        both: tuple[str, ...] = ()
        if p == "turbine":
            skew, both = on_sensor("skew", 2, 0.01, b=1.0), ("rotor_speed", "tower_fore_aft", "tower_side_side")
        found.append(Item(p, ("sensor_cross_axis",), skew, (5, 20), "sensor is turned", BOTH, ("share", sensor_a),
                          outputs=both))  # fmt: skip
    name = PLANTS[p].seen.name
    found.append(Item(p, ("missing_disturbance",), in_plant({"seen": _SEEN[p]}), (11, 4), f"{name} acts", BOTH, None,
                      roles=("seen",), forms=1))  # fmt: skip
    return found


def _offset(size: float) -> Put:
    def put(s: Setup, strength: float, form: int) -> Setup:
        return replace(s, sensors=(*s.sensors, Sensor(0, "offset", form, size * strength)))

    return put


def bench(p: str) -> list[Item]:
    """List what springs, friction and hysteresis of a bench may hide."""
    m = p == "spring"  # else the shaft: smaller strokes, larger stiffness
    u = 1.0 if m else 0.4
    found = [
        Item(p, ("coulomb_friction",), in_plant({"dry": 0.12 * u}), (19, 6), "dry friction", BOTH,
             ("force_N" if m else "torque_N_m", field("dry"))),
        Item(p, ("stiction",), in_plant({"excess": 0.5 * u}, {"dry": 0.3 * u, "slow": 0.12}), (19, 2),
             "stick and slip", BOTH),
        Item(p, ("cubic_stiffness",), in_plant({"cubic": 15.0 if m else 100.0}), (19, 6), "hardening spring", BOTH,
             ("k3", field("cubic")), forms=2 if m else 1),
        Item(p, ("quadratic_stiffness",), in_plant({"square": 12.0 if m else 50.0}), (19, 6), "one-sided spring",
             BOTH, ("k2", field("square"))),
        Item(p, ("clearance",), in_plant({"gap": 0.004 if m else 5e-4}), (19, 12), "play in the spring", BOTH,
             ("half_gap", field("gap"))),
        Item(p, ("bouc_wen_hysteresis", "play_hysteresis"),
             in_plant({"loop": 0.3 if m else 0.1}, {"loop_at": 0.05 if m else 0.3}), (2, 6), "hysteresis", BOTH),
        Item(p, ("quadratic_damping",), in_plant({"drag": 0.05 if m else 0.1}), (19, 6), "drag", BOTH,
             ("c2", field("drag"))),
        Item(p, ("stiffness_change",), in_plant({"softer": 0.01 if m else 0.05}, {"at": _AT[p]}), (15, 6),
             "softer from a time on", BOTH, ("time_s", field("at"))),
        Item(p, ("damping_change",), in_plant({"damper": 0.12 * u}, {"at": _AT[p]}), (15, 6),
             "more damping from a time on", BOTH, ("time_s", field("at"))),
        Item(p, ("temperature_dependence",), in_plant({"melt": 0.05 if m else 0.5}), (15, 11), "spring feels warmth",
             BOTH, roles=("warmth",)),
    ]  # fmt: skip
    return found + (_spring_only() if m else _shaft_only())


_AT = {"spring": 90.0, "shaft": 36.0}  # s, for a recording of 6000 samples; drawn anew for other lengths


def _spring_only() -> list[Item]:
    return [
        Item("spring", ("end_stop",), in_plant({"stop": 30.0}, {"stop_at": 0.3}), (12, 7), "stop", BOTH,
             ("high_stop", field("stop_at"))),
        Item("spring", ("play_hysteresis", "bouc_wen_hysteresis"), in_plant({"slider": 4.0}, {"slider_at": 0.06}),
             (2, 6), "slider", BOTH),
        Item("spring", ("viscous_friction_change",), in_plant({}, c=0.0), (6,), "damping left out", WRITTEN,
             ("damping_change", field("c")), fixed=True, forms=1),
        Item("spring", ("added_mass",), declared(in_plant({"extra": 0.01}), no_mass=1.0), (6,), "ice", BOTH,
             ("mass_ratio", field("extra")), forms=1),
        Item("spring", ("structural_mode",), in_plant({}, {"bracket": 2 * math.pi * 6.0}), (3, 17),
             "soft bracket", BOTH, ("frequency_hz", lambda s: s.truth.bracket / (2 * math.pi)), fixed=True, forms=1),
    ]  # fmt: skip


def _shaft_only() -> list[Item]:
    def twist(s: Setup) -> float:
        return math.sqrt(s.truth.k * (1 / s.truth.m + 1 / s.truth.motor)) / (2 * math.pi)

    return [
        Item("shaft", ("structural_mode", "drivetrain_torsion"), in_plant({}, rigid=1.0), (3, 2), "shaft twists",
             RUNS, ("frequency_hz", twist), fixed=True, outputs=("motor_speed",), forms=1),
        Item("shaft", ("viscous_friction_change",), in_plant({}, load=0.0), (6,), "load's friction left out", WRITTEN,
             fixed=True, forms=1),
    ]  # fmt: skip


def stores() -> list[Item]:
    """List what tanks may hide."""
    return [
        Item("tanks", ("overflow",), in_plant({}, {"brim": 0.72}), (12,), "upper tank runs over", WRITTEN,
             ("brim_level", field("brim")), fixed=True),
        Item("tanks", ("overflow",), in_plant({}, {"brim": 0.8, "share": 0.2}), (12, 4), "upper tank spills",
             WRITTEN, ("brim_level", field("brim")), fixed=True),
        Item("tanks", ("one_sided_storage",), in_plant({}, {"floor": 0.4}), (12, 7), "lower tank keeps some", WRITTEN,
             ("floor_level", field("floor")), fixed=True),
    ]  # fmt: skip
