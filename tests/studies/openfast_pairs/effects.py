"""The effects of the corpus: how each is made, in what wind, at what sizes, and what a right answer says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Values = Mapping[str, tuple[float, str]]  # name in a diagnosis → value, unit
_DEG = 3.141592653589793 / 180
_BLADE_MASS, _BLADE_MOMENT = 1.04536, 363_231.0  # AdjBlMs of the deck; a blade's static moment in kg m


@dataclass(frozen=True)
class Made:
    """Describe how one size is made: field of the wind, options of run.py, true values as a diagnosis names them.

    Several names of one value (a factor, a relative change) are alternatives: the one that is told is compared.
    """

    wind: str
    options: tuple[str, ...]
    values: Values = field(default_factory=dict)


@dataclass(frozen=True)
class Effect:
    """Describe an effect: its sizes, and by what names of the catalogue an answer is right.

    made: three sizes, or two (the second one, its recording cut, is the small size), or one (three lengths); ids: all
    are asked for; accepted: names that will do for any; families: right families; place: the location's entry of what
    acts on an input; simulated: the simulation is the side with the option (it lacks what the turbine has).
    """

    key: str
    ids: tuple[str, ...]
    accepted: tuple[str, ...]
    families: tuple[str, ...]
    made: tuple[Made, ...]
    place: str | None = None
    simulated: bool = False


def _drive(key: str, name: str, unit: str, *sizes: tuple[str, float], scale: float = 1.0) -> tuple[Made, ...]:
    """Return sizes by a key of the controller's wrapper; scale: of the wrapper's unit over the one that is told."""
    return tuple(Made(w, ("--drive", f"{key}={v * scale:.6g}"), {name: (v, unit)}) for w, v in sizes)


def _set(key: str, *sizes: tuple[str, float], of: float = 1.0) -> tuple[Made, ...]:
    """Return sizes by one value of an input file; of: the deck's own, where they are factors."""
    return tuple(Made(w, ("--set", f"{key}={v * of:.8g}")) for w, v in sizes)


def _air(*sizes: tuple[str, float]) -> tuple[Made, ...]:
    made = []
    for wind, factor in sizes:
        density = f"AirDens={1.225 * factor:.6g}"
        options = ("--set", f"turbine.fst:{density}", "--set", f"AeroDyn.dat:{density}")
        made.append(Made(wind, options, {"factor": (factor, "1"), "density_change": (factor - 1, "1")}))
    return tuple(made)


def _heavy(*sizes: tuple[str, float]) -> tuple[Made, ...]:
    made = []
    for wind, factor in sizes:
        options = ("--set", f"blade2.dat:AdjBlMs={_BLADE_MASS * factor:.8g}")
        made.append(Made(wind, options, {"static_moment": (_BLADE_MOMENT * (factor - 1), "kg m")}))
    return tuple(made)


def _without(mode: str, wind: str, **values: tuple[float, str]) -> tuple[Made, ...]:
    """Return a mode switched off; values: of the simulator's own linearisation in that wind (campbell_openfast.py)."""
    return (Made(wind, ("--off", mode), values),)


def _second_order(*sizes: tuple[str, float]) -> tuple[Made, ...]:
    return tuple(
        Made(w, ("--drive", f"w2={v}", "--drive", "z2=0.7"), {"omega_rad_s": (v, "rad/s"), "zeta": (0.7, "1")})
        for w, v in sizes
    )


_LAG, _PLAY, _STIFF = ("input_lag",), ("input_nonlinearity",), ("stiffness_change", "parameter", "structural_mode")
_PITCH, _TORQUE, _MODE = "input:pitch_demand", "input:torque_demand", ("structural_mode",)
_POWER, _SLOW, _ONCE, _THRICE = ("power_level", "parameter"), ("slow_aero",), ("rotor_1p",), ("rotor_3p", "rotor_1p")

EFFECTS = (
    Effect("lag", ("actuator_lag",), ("actuator_second_order",), _LAG,
           _drive("lag", "tau_s", "s", ("u18", 0.08), ("f14", 0.2), ("u14", 0.4)), _PITCH),
    Effect("mode_tower", ("tower_fore_aft",), _MODE, _MODE,
           _without("TwFADOF1", "u14", frequency_hz=(0.3406, "Hz")), simulated=True),
    Effect("imbalance_mass", ("mass_imbalance",), (), _ONCE, _heavy(("u18", 1.003), ("f18", 1.015), ("u14", 1.05))),
    Effect("backlash", ("backlash",), ("deadband",), _PLAY,
           _drive("backlash", "width", "deg", ("u14", 0.1), ("f18", 0.25), ("u20", 0.5), scale=_DEG), _PITCH),
    Effect("density", ("air_density",), ("cp_change", "parameter_error", "aero_nonlinearity"), _POWER,
           _air(("u20", 0.98), ("u14", 0.94), ("f18", 0.87))),
    Effect("mode_shaft", ("drivetrain_torsion",), _MODE, _MODE,
           _without("DrTrDOF", "f18", frequency_hz=(1.674, "Hz")), simulated=True),
    Effect("delay", ("transport_delay",), ("data_time_offset",), _LAG,
           _drive("delay", "delay_s", "s", ("u16", 0.05), ("f18", 0.15), ("u18", 0.3)), _PITCH),
    Effect("inflow", ("dynamic_inflow",), (), _SLOW,
           (Made("u16", ("--set", "AeroDyn.dat:DBEMT_Mod=0")),), simulated=True),
    Effect("stiffness_tower", ("stiffness_change",), ("tower_fore_aft", "parameter_error"), _STIFF,
           _set("tower.dat:AdjFASt", ("u16", 0.97), ("u18", 0.9), ("f14", 0.75))),
    Effect("yaw", ("yaw_misalignment",), (), _ONCE,
           _set("InflowWind.dat:PropagationDir", ("u14", 3), ("f18", 8), ("u18", 15))),
    Effect("mode_edge", ("blade_edge",),
           ("drivetrain_torsion", "structural_mode", "stiffness_change", "parameter_error"), _MODE,
           _without("EdgeDOF", "u18"), simulated=True),
    Effect("rate", ("rate_limit",), (), _PLAY,
           _drive("rate", "rate", "deg/s", ("u18", 6), ("f14", 4), ("u16", 2), scale=_DEG), _PITCH),
    Effect("shear", ("wind_shear",), (), _THRICE,
           tuple(Made(w, ("--shear", str(v))) for w, v in (("u18", 0.17), ("u16", 0.21), ("f14", 0.3)))),
    Effect("unsteady", ("unsteady_aero",), (), _SLOW,
           (Made("f14", ("--set", "AeroDyn.dat:UA_Mod=0")),), simulated=True),
    Effect("inertia", ("parameter_error",), ("added_mass",), _STIFF,
           _set("ElastoDyn.dat:GenIner", ("u14", 1.08), ("f18", 1.3), of=534.116)),
    Effect("imbalance_aero", ("aero_imbalance",), (), _ONCE,
           _drive("off1", "offset", "deg", ("u16", 0.3), ("u18", 1.0), scale=_DEG)),
    Effect("mode_flap", ("blade_flap",), ("unsteady_aero", "structural_mode"), _MODE,
           _without("FlapDOF1", "u14"), simulated=True),
    Effect("second_order", ("actuator_second_order",), (), _LAG, _second_order(("u18", 8), ("f14", 4)), _PITCH),
    Effect("shadow", ("tower_shadow",), ("rotational_sampling",), _THRICE,
           (Made("u18", ("--set", "AeroDyn.dat:TwrPotent=0")),), simulated=True),
    Effect("deadband", ("deadband",), ("backlash",), _PLAY,
           _drive("deadband", "width", "deg", ("u14", 0.15), ("f18", 0.5), scale=_DEG), _PITCH),
    Effect("mass", ("added_mass",), ("parameter_error", "tower_fore_aft"), _STIFF,
           _set("ElastoDyn.dat:NacMass", ("u18", 1.08), ("f14", 1.4), of=240_000)),
    Effect("mode_side", ("tower_side_side",), _MODE, _MODE,
           _without("TwSSDOF1", "u18", frequency_hz=(0.321, "Hz")), simulated=True),
    Effect("torque_lag", ("actuator_lag",), ("actuator_second_order",), _LAG,
           _drive("torque_lag", "tau_s", "s", ("u20", 0.2), ("f14", 0.6)), _TORQUE),
    Effect("efficiency", ("efficiency_loss",), ("cp_change",), _POWER,
           _set("ElastoDyn.dat:GBoxEff", ("u18", 95))),
    Effect("stiffness_shaft", ("stiffness_change",), ("drivetrain_torsion", "parameter_error"), _STIFF,
           _set("ElastoDyn.dat:DTTorSpr", ("f18", 0.7), of=8.67637e8)),
    Effect("lag_and_imbalance", ("actuator_lag", "mass_imbalance"), (), _LAG + _ONCE,
           (Made("u18", ("--drive", "lag=0.25", *_heavy(("u18", 1.03))[0].options), {"tau_s": (0.25, "s")}),)),
    Effect("backlash_and_density", ("backlash", "air_density"), (), _PLAY + _POWER,
           (Made("f14", ("--drive", f"backlash={0.4 * _DEG:.6g}", *_air(("f14", 0.92))[0].options),
                 {"width": (0.4, "deg")}),)),
    Effect("mode_tower_2", ("tower_fore_aft",), _MODE, _MODE, _without("TwFADOF2", "u18"), simulated=True),
    Effect("mode_side_2", ("tower_side_side",), _MODE, _MODE, _without("TwSSDOF2", "f14"), simulated=True),
    Effect("mode_flap_2", ("blade_flap",), ("unsteady_aero", "structural_mode"), _MODE,
           _without("FlapDOF2", "u18"), simulated=True),
    Effect("tilt", (), ("yaw_misalignment", "wind_shear"), _ONCE, _set("ElastoDyn.dat:ShftTilt", ("u20", -8))),
)  # fmt: skip

BOTH = (  # two at once without a further run: the turbine has the one, the simulation lacks the other
    ("lag-large", "mode_tower"), ("density-large", "mode_shaft"), ("delay-large", "mode_edge"),
    ("rate-large", "inflow"), ("imbalance_mass-medium", "mode_shaft"), ("yaw-large", "mode_side"),
)  # fmt: skip
