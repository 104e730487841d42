"""The menu of effects on the turbine, and of those that no catalogue has."""

from __future__ import annotations

import math
from dataclasses import replace

from aeolid.challenge.items import BOTH, WRITTEN, Item, declared, field, in_plant, on_drive, on_sensor
from aeolid.challenge.menu import ALL, bench, drives, sensors, stores
from aeolid.challenge.models import PLANTS
from aeolid.challenge.plants import Setup

_FLAP = ("rotor_speed", "tower_fore_aft", "flap_moment_1")
_SIDE = ("rotor_speed", "tower_fore_aft", "tower_side_side")
_POWER = ("rotor_speed", "tower_fore_aft", "power")
_TURN = ("azimuth",)


def turbine() -> list[Item]:
    """List what rotor, wake, air and sea may hide."""
    t = "turbine"
    held = {"held": 1.0}
    return [
        *_modes(),
        Item(t, ("mass_imbalance",), in_plant({"heavy": 800.0}), (4, 13), "heavy blade", BOTH, roles=_TURN,
             outputs=_SIDE, forms=1),
        Item(t, ("aero_imbalance",), in_plant({"skewed": 0.25}), (4, 13), "blade set wrong", BOTH, roles=_TURN,
             outputs=_SIDE, forms=1),
        Item(t, ("gravity_1p",), in_plant({"weight": 5e4}), (4, 13), "unbalanced weight", BOTH, roles=_TURN,
             outputs=_SIDE, forms=1),
        Item(t, ("wind_shear", "yaw_misalignment"), in_plant({"shear": 0.05}), (4, 13), "shear", BOTH, roles=_TURN,
             outputs=_FLAP),
        Item(t, ("yaw_misalignment",), in_plant({"yaw": 4.0}), (4, 13), "yawed", BOTH, roles=_TURN, outputs=_FLAP,
             forms=1),
        Item(t, ("tower_shadow",), in_plant({"shadow": 0.02}), (13, 3), "tower shadow", BOTH, roles=_TURN,
             outputs=_SIDE),
        Item(t, ("rotational_sampling",), in_plant({"eddies": 0.1}), (22, 3), "eddies cut by the blades", BOTH,
             roles=_TURN, outputs=_SIDE, random=True, forms=1),
        Item(t, ("dynamic_inflow",), declared(in_plant({"wake": 0.2}, {"wake_s": 8.0}), **held), (1, 22),
             "slow wake", BOTH, roles=_TURN),
        Item(t, ("unsteady_aero",), declared(in_plant({"lift": 0.11}, {"lift_s": 0.9}), **held), (1, 6),
             "lift builds up slowly", BOTH, roles=_TURN, forms=1, most=0.5 / 0.11),  # half comes at once (Wagner 1925)
        Item(t, ("aero_nonlinearity",), in_plant({"bend": 0.02}), (12, 6), "pitch gain grows with wind", BOTH,
             roles=("azimuth", "wind")),
        Item(t, ("operating_region_switch",), in_plant({"region": -0.1}), (12, 6), "pitch gain drops above", BOTH,
             roles=("azimuth", "wind")),
        Item(t, ("cp_change",), declared(in_plant({"soiled": -0.03}), **held), (1, 6), "soiled blades", WRITTEN,
             ("cp_change", field("soiled")), roles=_TURN, forms=1),
        Item(t, ("air_density",), declared(in_plant({"density": -0.03}), **held), (1, 6), "thin air", WRITTEN,
             ("density_change", field("density")), roles=_TURN, forms=1),
        Item(t, ("efficiency_loss",), in_plant({"loss": 0.01}), (20, 6), "lossy drive train", WRITTEN,
             ("loss", field("loss")), outputs=_POWER, roles=_TURN, forms=1),
        Item(t, ("wave_load",), in_plant({"sea": 1.5e4}), (11, 22), "sea", BOTH, roles=("azimuth", "wave"), forms=1),
        Item(t, ("missing_coupling",), declared(in_plant({}), unconnected=1.0), (11, 2), "torque not connected",
             WRITTEN, fixed=True, roles=_TURN, forms=1),
        Item(t, ("controller_state",), on_drive("hidden", 0.2, b=12.0), (1, 18), "integrator in the drive", BOTH,
             roles=_TURN, forms=1),
    ]  # fmt: skip


def _modes() -> list[Item]:
    t = "turbine"
    return [
        Item(t, ("drivetrain_torsion",), in_plant({}, {"torsion": 1.0}), (3, 10), "shaft twists", BOTH,
             ("frequency_hz", _twist), fixed=True, roles=_TURN, outputs=_SIDE, forms=1),
        Item(t, ("blade_flap",), in_plant({}, {"flap": 2 * math.pi * 0.68}), (3, 2), "blades bend", BOTH,
             ("frequency_hz", lambda s: 0.68), fixed=True, roles=_TURN, outputs=_FLAP, forms=1),
    ]  # fmt: skip


def _twist(s: Setup) -> float:
    return math.sqrt(s.truth.ks * (1 / s.truth.jr + 1 / s.truth.jg)) / (2 * math.pi)


def singles() -> list[Item]:
    """List every effect that the catalogue has a name for."""
    found = [*bench("spring"), *bench("shaft"), *stores(), *turbine()]
    for p in ALL:
        found += [*drives(p), *sensors(p)]
    return found


def outside() -> list[Item]:
    """List effects that no entry describes."""
    none: tuple[str, ...] = ()
    return [
        Item("spring", none, in_plant({"swing": 0.03}), (15, 6), "stiffness swings", BOTH, forms=1),
        Item("spring", none, in_plant({"lively": 2.0}), (19, 6), "damping falls with the stroke", BOTH, forms=1),
        Item("spring", none, in_plant({"relax": 3.0}, {"relax_s": 0.5}), (2, 6), "relaxing spring", BOTH, forms=1),
        Item("spring", none, on_drive("bent", 0.03), (19, 6), "bent valve curve", BOTH, forms=1),
        Item("shaft", none, in_plant({"teeth": 0.05}, {"pitch": 0.012}), (4, 2), "cogging", BOTH, forms=1),
        Item("shaft", none, in_plant({"swing": 0.08}, {"swing_s": 5.0}), (15, 6), "shaft's stiffness swings", BOTH,
             forms=1),
        Item("tanks", none, in_plant({"leak": 0.003}), (6, 12), "wall lets through", WRITTEN, forms=1),
        Item("tanks", none, in_plant({"foam": 0.02}), (5, 6), "foam", WRITTEN, forms=1),
        Item("heater", none, in_plant({"glow": 0.02}), (19, 6), "radiation", BOTH, forms=1),
        Item("heater", none, in_plant({"boil": 0.01}, {"boil_at": 74.0}), (12,), "boiling takes heat", BOTH, forms=1),
        Item("turbine", none, in_plant({"shed": 1500.0}), (3, 22), "tower sheds eddies", BOTH, roles=_TURN,
             outputs=_SIDE, forms=1),
        Item("turbine", none, in_plant({"stall": 1e6}), (19, 22), "tower's damping leans", BOTH, roles=_TURN, forms=1),
    ]  # fmt: skip


def faults() -> list[Item]:
    """List faults of the recording itself; the verdict data_fault is right for each."""
    found = []
    for p, at, unit in (("spring", 1, 1e3), ("shaft", 0, 30 / math.pi), ("turbine", 1, 1 / 9.80665)):
        sign = on_sensor("scale", at, -1.0)
        found.append(Item(p, ("sensor_sign", "data_fault"), sign, (20,), "sign", fixed=True, forms=1))
        by = on_sensor("scale", at, unit)
        found.append(Item(p, ("sensor_scale", "data_fault"), by, (20,), "unit", fixed=True, forms=1))
    for p in ("shaft", "tanks", "heater"):
        kinds = WRITTEN if p == "tanks" else BOTH
        swap = on_sensor("swap", 0, 1.0, b=1.0)
        twin = on_sensor("twin", 1, 1.0, b=0.0)
        stuck = on_sensor("stuck", 1, 0.35, b=0.3)
        found.append(Item(p, ("data_fault",), stuck, (9,), "stuck", kinds, fixed=True, forms=1))
        found.append(Item(p, ("data_fault",), twin, (20,), "one channel twice", kinds, fixed=True, forms=1))
        if p != "heater":
            continue
        names = ("data_channel_swap", "data_fault")
        found.append(Item(p, names, swap, (20,), "channels swapped", kinds, fixed=True, forms=1))
    return found


def unreachable() -> list[Item]:
    """List effects that a recording never meets: limits and stops beyond reach."""
    never = [
        Item("spring", ("end_stop",), in_plant({"stop": 400.0}, {"stop_at": 5.0}), (7,), "stop out of reach"),
        Item("shaft", ("input_saturation",), on_drive("saturation", 60.0), (7,), "limit out of reach"),
        Item("turbine", ("rate_limit",), on_drive("rate", 400.0), (7,), "rate out of reach", roles=_TURN),
        Item("heater", ("sensor_saturation",), on_sensor("saturation", 1, 400.0), (7,), "clip out of reach"),
    ]
    return [replace(i, fixed=True, forms=1) for i in never]


def plant_outputs(item: Item, drawn: float) -> tuple[str, ...]:
    """Return which outputs a case records: those the effect needs, or a draw of the plant's."""
    if item.outputs:
        return item.outputs
    names = tuple(c.name for c in PLANTS[item.plant].outputs if c.role == "output")
    return (_SIDE if drawn < 0.5 else _FLAP) if item.plant == "turbine" else names
