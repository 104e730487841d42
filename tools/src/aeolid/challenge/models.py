"""The five plants, and what their users would write down: equations without the hidden effect."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from aeolid.challenge import bench, flows, rotor
from aeolid.challenge.plants import Column, Plant, heater_start, tanks_start, turbine_start, zeros

Row = tuple[str, float, str, tuple[float, float] | None]  # symbol, value, unit, limits of a free parameter


def model_text(
    name: str, parameters: Sequence[Row], states: Sequence[tuple[str, str, str, float]],
    outputs: Sequence[tuple[str, str, str]], declared: dict[str, float],
) -> str:  # fmt: skip
    """Return model.toml; declared: factors on what is written of a parameter."""
    lines = ["[model]", f'name = "{name}"', 'time = "continuous"', "[parameters]"]
    for symbol, value, unit, limits in parameters:
        bounds = ""
        if limits is not None:
            low, high = sorted((limits[0] * value, limits[1] * value))
            bounds = f", min = {low!r}, max = {high!r}, free = true"
        lines.append(f'{symbol} = {{ value = {value * declared.get(symbol, 1.0)!r}, unit = "{unit}"{bounds} }}')
    for symbol, unit, derivative, start in states:
        lines += ["[[state]]", f'name = "{symbol}"', f'unit = "{unit}"', f'derivative = "{derivative}"']
        lines.append(f"initial = {{ value = {start!r}, free = true }}")
    for symbol, unit, equation in outputs:
        lines += ["[[output]]", f'name = "{symbol}"', f'unit = "{unit}"', f'equation = "{equation}"']
    return "\n".join(lines) + "\n"


def _spring(e: Any, outputs: tuple[str, ...], declared: dict[str, float], memory: float) -> str:
    wide = (0.1, 8.0)
    if declared.get("no_mass"):  # written without a mass: only ratios are known
        rows: list[Row] = [("a", e.gain / e.m, "N/(V kg)", None), ("b", e.c / e.m, "1/s", wide)]
        rows.append(("w2", e.k / e.m, "1/s^2", wide))
        motion = "a*drive - b*v - w2*q"
    else:
        rows = [("M", e.m, "kg", None), ("g", e.gain, "N/V", None), ("k", e.k, "N/m", wide)]
        rows += [("c", e.c, "N s/m", wide)] if e.c else []
        motion = f"(g*drive{' - c*v' if e.c else ''} - k*q)/M"
    states = [("q", "m", "v", 0.0), ("v", "m/s", motion, 0.0)]
    listed = {"position": ("position", "m", "q"), "speed": ("speed", "m/s", "v")}
    return model_text("mass on a spring", rows, states, [listed[o] for o in outputs], declared)


def _shaft(e: Any, outputs: tuple[str, ...], declared: dict[str, float], memory: float) -> str:
    wide = (0.1, 8.0)
    rows: list[Row] = [("g", e.gain, "N m/V", None), ("bm", e.bearing, "N m s", wide)]
    if e.rigid:
        rows += [("J", e.motor + e.m, "kg m^2", (0.3, 3.0))]
        states = [("w", "rad/s", "(g*voltage - bm*w)/J", 0.0)]
        listed = {n: (n, "rad/s", "w") for n in ("motor_speed", "load_speed")}
    else:
        rows += [("Jm", e.motor, "kg m^2", None), ("Jl", e.m, "kg m^2", (0.3, 3.0)), ("k", e.k, "N m", wide)]
        rows += [("c", e.c, "N m s", wide)] + ([("bl", e.load, "N m s", wide)] if e.load else [])
        shaft = "(k*twist + c*(wm - wl))"
        states = [("twist", "rad", "wm - wl", 0.0), ("wm", "rad/s", f"(g*voltage - bm*wm - {shaft})/Jm", 0.0)]
        states.append(("wl", "rad/s", f"({shaft}{' - bl*wl' if e.load else ''})/Jl", 0.0))
        listed = {"motor_speed": ("motor_speed", "rad/s", "wm"), "load_speed": ("load_speed", "rad/s", "wl")}
    return model_text("motor, shaft and load", rows, states, [listed[o] for o in outputs], declared)


def _tanks(e: Any, outputs: tuple[str, ...], declared: dict[str, float], memory: float) -> str:
    rows: list[Row] = [("a", e.drain, "m^0.5/s", (0.1, 8.0)), ("b", e.fill, "m/(s V)", (0.1, 8.0))]
    level = float(tanks_start(e)[0])
    out, below = "a*sqrt(max(upper, 0))", "a*sqrt(max(lower, 0))"
    states = [("upper", "m", f"b*pump - {out}", level), ("lower", "m", f"{out} - {below}", level)]
    listed = {"upper_level": ("upper_level", "m", "upper"), "lower_level": ("lower_level", "m", "lower")}
    return model_text("two tanks", rows, states, [listed[o] for o in outputs], declared)


def _heater(e: Any, outputs: tuple[str, ...], declared: dict[str, float], memory: float) -> str:
    wide = (0.1, 8.0)
    rows: list[Row] = [("p", e.heat, "K/s", wide), ("h1", e.couple, "1/s", wide), ("h2", e.shell, "1/s", wide)]
    rows.append(("h3", e.air, "1/s", wide))
    block, shell = (float(x) for x in heater_start(e)[:2])
    states = [("T1", "K", "p*power - h1*(T1 - T2)", block), ("T2", "K", "h2*(T1 - T2) - h3*T2", shell)]
    listed = {"block": ("block", "K", "T1"), "shell": ("shell", "K", "T2")}
    return model_text("heated block", rows, states, [listed[o] for o in outputs], declared)


def _turbine(e: Any, outputs: tuple[str, ...], declared: dict[str, float], memory: float) -> str:
    held, wide = None, (0.3, 3.0)
    rows: list[Row] = [("J", e.jr + e.jg, "kg m^2", held), ("M", e.mass, "kg", held), ("Q0", rotor.Q0, "N m", held)]
    slopes = held if declared.get("held") else wide  # a user whose aerodynamics are known holds them
    rows += [("T0", rotor.T0, "N", held), ("Qv", e.q_v, "N s", held), ("Qb", e.q_b, "N m/deg", slopes)]
    rows += [("Qw", e.q_w, "N m s", slopes), ("Tv", e.t_v, "N s/m", held), ("Tb", e.t_b, "N/deg", slopes)]
    rows += [("Tw", e.t_w, "N s", held), ("cf", e.c_fa, "N s/m", wide), ("kf", e.k_fa, "N/m", wide)]
    rows += [("cs", e.c_ss, "N s/m", wide), ("ks", e.k_ss, "N/m", wide), ("roll", e.roll, "1/m", held)]
    rows.append(("wr", 0.125 / memory, "1/s", (0.1, 10.0)))
    v, d, n = "(gust - vf)", f"(pitch - {rotor.B0!r})", f"(w - {rotor.W0!r})"
    turn, push = f"Q0 + Qv*{v} + Qb*{d} + Qw*{n}", f"Tv*{v} + Tb*{d} + Tw*{n}"
    if e.curve:
        turn += f" + 1.6e4*{v}**2 - 2.4e4*{d}**2 - 3.0e4*{v}*{d}"
        push += f" - 1.1e3*{v}**2 - 9.0e2*{d}**2 + 1.8e3*{v}*{d}"
    torque = "Q0" if declared.get("unconnected") else "1000*torque"
    fa, ss = f"({push} - cf*vf - kf*xf)/M", f"(roll*({torque} - Q0) - cs*vs - ks*xs)/M"
    states = [("w", "rad/s", f"({turn} - {torque})/J", rotor.W0), ("xf", "m", "vf", 0.0), ("vf", "m/s", fa, 0.0)]
    states += [("xs", "m", "vs", 0.0), ("vs", "m/s", ss, 0.0), ("gust", "m/s", "-wr*gust", 0.0)]
    power = "3823.2*w" if declared.get("unconnected") else "0.944*torque*w"
    flap = f"{rotor.ARM / rotor.BLADES / 1e3!r}*(T0 + {push})"
    listed = {"rotor_speed": ("rotor_speed", "rad/s", "w"), "tower_fore_aft": ("tower_fore_aft", "m/s^2", fa),
              "tower_side_side": ("tower_side_side", "m/s^2", ss), "power": ("power", "kW", power),
              "flap_moment_1": ("flap_moment_1", "kN m", flap)}  # fmt: skip
    return model_text("turbine above rated", rows, states, [listed[o] for o in outputs], declared)


_BENCH = {"machine": "rig"}
SPRING = Plant(
    "spring", _BENCH, 0.05, 40, bench.Bench(), (bench.spring_flow, bench.spring_see, bench.spring_control),
    bench.STATES, (0, 1), zeros(bench.STATES), (0.0,), (Column("drive", "V", "input"),),
    (Column("position", "m", "output", 4e-3), Column("speed", "m/s", "output", 0.02)), ((0, 1.0, 0.5),),
    ((3.0, 7),), 0.12, 3, _spring, ("c", "k"), (("q", "m"), ("v", "m/s")), Column("side_force", "N", "disturbance"), 0,
)  # fmt: skip
SHAFT = Plant(
    "shaft", _BENCH, 0.02, 20, bench.Bench(m=1.4, c=0.4, k=90.0, gain=2.0),
    (bench.shaft_flow, bench.shaft_see, bench.shaft_control), bench.STATES, (0, 1, 2), zeros(bench.STATES), (0.0,),
    (Column("voltage", "V", "input"),),
    (Column("motor_speed", "rad/s", "output", 0.04), Column("load_speed", "rad/s", "output", 0.04)),
    ((0, 0.6, 0.4),), ((3.0, 11),), 2.0, 3, _shaft, ("bearing", "m", "k", "c", "load"),
    (("twist", "rad"), ("wm", "rad/s"), ("wl", "rad/s")), Column("brake_current", "A", "disturbance"), 1,
)  # fmt: skip
TANKS = Plant(
    "tanks", _BENCH, 1.0, 20, flows.Tanks(), (flows.tanks_flow, flows.tanks_see, flows.tanks_control), flows.STATES,
    (0, 1), tanks_start, (2.2,), (Column("pump", "V", "input"),),
    (Column("upper_level", "m", "output", 5e-3), Column("lower_level", "m", "output", 5e-3)), ((0, 1e-3, 4.0),),
    ((1.1, 35),), 0.12, 3, _tanks, ("drain", "fill"), (("upper", "m"), ("lower", "m")),
    Column("second_inflow", "l/s", "disturbance"), 1,
)  # fmt: skip
HEATER = Plant(
    "heater", _BENCH, 5.0, 20, flows.Heater(), (flows.heater_flow, flows.heater_see, flows.heater_control),
    flows.STATES, (0, 1), heater_start, (20.0,), (Column("power", "W", "input"),),
    (Column("block", "K", "output", 0.1), Column("shell", "K", "output", 0.1)), ((0, 1e-2, 40.0),), ((12.0, 14),),
    4.0, 3, _heater, ("heat", "couple", "shell", "air"), (("T1", "K"), ("T2", "K")),
    Column("air_temperature", "K", "disturbance"), 0,
)  # fmt: skip
_MACHINE = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": rotor.W0}
TURBINE = Plant(
    "turbine", _MACHINE, 0.1, 20, rotor.Turbine(), (rotor.rotor_flow, rotor.rotor_see, rotor.rotor_control),
    rotor.STATES, (1, 4, 5, 6, 7), turbine_start, (rotor.B0, rotor.Q0 / 1e3),
    (Column("pitch", "deg", "input"), Column("torque", "kN m", "input")),
    (Column("rotor_speed", "rad/s", "output", 1e-3), Column("tower_fore_aft", "m/s^2", "output", 8e-3),
     Column("tower_side_side", "m/s^2", "output", 5e-3), Column("power", "kW", "output", 8.0),
     Column("flap_moment_1", "kN m", "output", 40.0), Column("azimuth", "deg", "azimuth")),
    ((0, 1.0, 8.0), (1, 2.5e3, 3.0)), ((0.9, 12), (120.0, 7)), 0.0, 6, _turbine,
    ("q_b", "q_w", "t_b", "k_fa", "c_fa", "k_ss", "c_ss"),
    (("w", "rad/s"), ("xf", "m"), ("vf", "m/s"), ("xs", "m"), ("vs", "m/s")),
    Column("mast_gust", "m/s", "disturbance"), 1, True,
)  # fmt: skip
PLANTS = {p.name: p for p in (SPRING, SHAFT, TANKS, HEATER, TURBINE)}
