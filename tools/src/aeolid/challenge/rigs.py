"""Six rigs of the foreign engine that move freely, and what a control engineer would write of each: no effect in it.

Every rig is a text in the engine's language, made from constants by name. Those of an effect are zero where it is not
there: dry (friction), drag, cubic (spring), gap (half the play), slack, stop, lag, late, most (command), clip (sensor),
uneven (kg m of a load), loose (kg of a load's part).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from aeolid.challenge.engine import disturber, joint, motor, page, sensor, spring
from aeolid.challenge.models import Row, model_text
from aeolid.challenge.plants import Column

Values = Mapping[str, float]
EFFECTS = ("dry", "drag", "cubic", "gap", "slack", "stop", "lag", "late", "most", "clip", "swing", "uneven",
           "loose")  # fmt: skip
WIDE = (0.2, 5.0)
_LUMP = 0.2  # kg, of a load out of balance
_RADIUS, _AT_SPEED = 0.1, 12.0  # m, rad/s: where a loose part rests, and the speed that its spring cannot hold


@dataclass(frozen=True)
class Rig:
    """Hold a rig: its constants, its text, its model, what is recorded, and its test signal.

    outputs: columns with the spread of their noise, in the order of the engine's sensors; swing, dwell: amplitude and
    samples of the test signal's steps; rest: the command at rest; start: positions at rest; force: spread of the
    unmeasured force at a chain of size 1; free: constants whose declared values may be wrong; linear: a state-space
    model tells all of it.
    """

    name: str
    title: str
    step_s: float
    values: Values
    text: Callable[[Rig, Values], str]
    model: Callable[[Values, Values, Values], str]
    drive: Column
    outputs: tuple[Column, ...]
    swing: float
    dwell: int
    force: float
    free: tuple[str, ...]
    states: tuple[tuple[str, str], ...] = ()
    rest: Callable[[Values], float] = lambda v: 0.0
    start: Callable[[Values], tuple[float, ...]] = lambda v: (0.0,)
    weak: float = 0.0  # dry friction that every such rig has
    wrong: tuple[str, ...] = ("k", "c")  # parameters of the model that may be declared quite wrong
    servo: bool = False  # a stiff servo imposes the motion: what is recorded of it is the input, the force the output
    project: tuple[tuple[float, ...], ...] = ()  # states of the linear model from the engine's, where they are fewer

    @property
    def linear(self) -> bool:
        """Tell whether a linear model tells all of the rig without an effect."""
        return bool(self.states)

    def write(self, v: Values) -> str:
        """Return the rig in the engine's language."""
        return self.text(self, v)


def _drive(rig: Rig, v: Values, at: str, gain: float, gear: float = 1.0, bias: str = "") -> str:
    return motor(at, gain=gain, gear=gear, bias=bias, lag=v["lag"], late=v["late"], most=v["most"], step_s=rig.step_s)


def body(joints: str, inertia: float, *, mass: float = 0.001, low: float = 0.0, inner: str = "") -> str:
    """Return a body `low` below its joints, with what hangs on it."""
    size = f"{inertia!r} {inertia!r} {inertia!r}"
    return f'<body>{joints}<inertial pos="0 0 {-low!r}" mass="{mass!r}" diaginertia="{size}"/>{inner}</body>'


def _gears(rig: Rig, v: Values) -> str:
    """Motor behind a gear, held at a commanded angle; with play, motor and load are two bodies, the teeth a spring."""
    n, stiff = v["ratio"], v["k"]
    held = f"0 {-stiff / n**2!r} {-v['kv'] / n**2!r}"
    resists = {"damping": v["c"], "dry": v["dry"], "drag": v["drag"]}
    seen = sensor("jointpos", "load", v["clip"]) + sensor("jointvel", "load")
    if not v["gap"]:
        turning = joint("load", "hinge", "0 0 1", armature=v["motor"] * n**2, **resists)
        drives = _drive(rig, v, "load", stiff / n, gear=n, bias=held) + disturber("load")
        return page(rig.step_s, body(turning, v["inertia"]), actuators=drives, sensors=seen)
    bodies = body(joint("motor", "hinge", "0 0 1", damping=0.0), v["motor"])
    bodies += body(joint("load", "hinge", "0 0 1", **resists), v["inertia"])
    teeth = spring("teeth", {"motor": 1 / n, "load": -1.0}, stiffness=v["teeth"], damping=v["teeth_c"],
                   low=-v["gap"] - 1e-12, high=v["gap"])  # fmt: skip
    drives = _drive(rig, v, "motor", stiff / n, bias=held) + disturber("load")
    return page(rig.step_s, bodies, tendons=teeth, actuators=drives, sensors=seen)


def _gears_model(v: Values, declared: Values, flags: Values) -> str:
    whole = v["inertia"] + v["motor"] * v["ratio"] ** 2
    rows: list[Row] = [("J", whole, "kg m^2", None), ("k", v["k"], "N m/rad", WIDE)]
    rows.append(("d", v["kv"] + v["c"], "N m s/rad", WIDE))
    states = [("q", "rad", "w", 0.0), ("w", "rad/s", "(k*(command - q) - d*w)/J", 0.0)]
    return model_text("geared motor", rows, states, [("angle", "rad", "q"), ("speed", "rad/s", "w")], dict(declared))


def _pendulum(rig: Rig, v: Values) -> str:
    """Pendulum driven at its pivot."""
    turning = joint("q", "hinge", "0 1 0", damping=v["c"], dry=v["dry"], drag=v["drag"], stop=v["stop"])
    bodies = body(turning, v["inertia"], mass=v["mass"], low=v["arm"])
    drives, seen = _drive(rig, v, "q", 1.0) + disturber("q"), sensor("jointpos", "q", v["clip"])
    return page(rig.step_s, bodies, actuators=drives, sensors=seen + sensor("jointvel", "q"), gravity=9.81)


def _pendulum_model(v: Values, declared: Values, flags: Values) -> str:
    rows: list[Row] = [("J", v["inertia"] + v["mass"] * v["arm"] ** 2, "kg m^2", None), ("g", 1.0, "1", WIDE)]
    rows += [("c", v["c"], "N m s", WIDE), ("h", 9.81 * v["mass"] * v["arm"], "N m", WIDE)]
    states = [("q", "rad", "w", 0.0), ("w", "rad/s", "(g*torque - c*w - h*sin(q))/J", 0.0)]
    return model_text("pendulum", rows, states, [("angle", "rad", "q"), ("speed", "rad/s", "w")], dict(declared))


def _cart(rig: Rig, v: Values) -> str:
    """Cart on a rail between two springs; perhaps with a load that swings below it."""
    sliding = joint("x", "slide", "1 0 0", damping=v["c"], stiffness=v["k"], dry=v["dry"], drag=v["drag"],
                    cubic=v["cubic"], stop=v["stop"])  # fmt: skip
    inner = ""
    if v["swing"]:  # a share of the mass hangs below
        inner = body(joint("load", "hinge", "0 1 0", damping=v["load_c"]), 1e-5, mass=v["swing"], low=v["arm"])
    bodies = body(sliding, 0.001, mass=v["mass"] - v["swing"], inner=inner)
    drives, seen = _drive(rig, v, "x", v["gain"]) + disturber("x"), sensor("jointpos", "x", v["clip"])
    return page(rig.step_s, bodies, actuators=drives, sensors=seen + sensor("jointvel", "x"), gravity=9.81)


def _cart_model(v: Values, declared: Values, flags: Values) -> str:
    rows: list[Row] = [("M", v["mass"], "kg", None), ("g", v["gain"], "N/V", WIDE), ("k", v["k"], "N/m", WIDE)]
    rows.append(("c", v["c"], "N s/m", WIDE))
    states = [("x", "m", "v", 0.0), ("v", "m/s", "(g*drive - c*v - k*x)/M", 0.0)]
    return model_text(
        "cart between springs", rows, states, [("position", "m", "x"), ("speed", "m/s", "v")], dict(declared)
    )


def _arm(rig: Rig, v: Values) -> str:
    """Arm that hangs from a motor by a flexible joint."""
    bend = joint("joint", "hinge", "0 1 0", damping=v["d"], stiffness=v["k"], cubic=v["cubic"])
    arm = body(bend, v["inertia"], mass=v["mass"], low=v["arm"])
    turning = joint("motor", "hinge", "0 1 0", damping=v["c"], armature=v["motor"], dry=v["dry"], drag=v["drag"])
    drives, seen = _drive(rig, v, "motor", 1.0) + disturber("motor"), sensor("jointpos", "motor", v["clip"])
    bodies = body(turning, 1e-6, inner=arm)
    return page(rig.step_s, bodies, actuators=drives, sensors=seen + sensor("jointvel", "motor"), gravity=9.81)


def _arm_model(v: Values, declared: Values, flags: Values) -> str:
    link, pull = v["inertia"] + v["mass"] * v["arm"] ** 2, 9.81 * v["mass"] * v["arm"]
    rows: list[Row] = [("g", 1.0, "1", WIDE), ("c", v["c"], "N m s", WIDE), ("h", pull, "N m", WIDE)]
    if flags.get("rigid"):
        rows.append(("J", v["motor"] + link, "kg m^2", None))
        states = [("q", "rad", "w", 0.0), ("w", "rad/s", "(g*torque - c*w - h*sin(q))/J", 0.0)]
    else:
        rows += [("Jm", v["motor"], "kg m^2", None), ("Jl", link, "kg m^2", None)]
        rows += [("k", v["k"], "N m/rad", WIDE), ("d", v["d"], "N m s/rad", WIDE)]
        states = [("q", "rad", "w", 0.0), ("w", "rad/s", "(g*torque - c*w - k*(q - p) - d*(w - s))/Jm", 0.0)]
        states += [("p", "rad", "s", 0.0), ("s", "rad/s", "(k*(q - p) + d*(w - s) - h*sin(p))/Jl", 0.0)]
    return model_text("arm", rows, states, [("angle", "rad", "q"), ("speed", "rad/s", "w")], dict(declared))


def _cable(rig: Rig, v: Values) -> str:
    """Drum that pulls a load by a cable against a preloaded spring."""
    r, preload = v["radius"], v["preload"]
    turning = joint("drum", "hinge", "0 1 0", damping=v["b"], armature=v["drum"])
    sliding = joint("x", "slide", "1 0 0", damping=v["c"], stiffness=v["k"], rest=-preload / v["k"], dry=v["dry"])
    bodies = body(turning, 1e-6) + body(sliding, 0.001, mass=v["mass"])
    low, high = (-1e3, 0.0) if v["slack"] else (-v["gap"] - 1e-12, v["gap"])
    rope = spring("cable", {"drum": r, "x": -1.0}, stiffness=v["rope"], damping=v["rope_c"], low=low, high=high)
    seen = sensor("jointpos", "x", v["clip"]) + sensor("jointvel", "drum")
    drives = _drive(rig, v, "drum", 1.0) + disturber("x")
    return page(rig.step_s, bodies, tendons=rope, actuators=drives, sensors=seen)


def _cable_model(v: Values, declared: Values, flags: Values) -> str:
    rows: list[Row] = [("J", v["drum"], "kg m^2", None), ("r", v["radius"], "m", None), ("m", v["mass"], "kg", None)]
    rows += [("b", v["b"], "N m s", WIDE), ("c", v["c"], "N s/m", WIDE), ("k", v["k"], "N/m", WIDE)]
    rows += [("kc", v["rope"], "N/m", WIDE), ("dc", v["rope_c"], "N s/m", WIDE), ("F0", v["preload"], "N", WIDE)]
    rows.append(("g", 1.0, "1", WIDE))
    rope = "kc*e + dc*(r*w - v)"
    states = [("e", "m", "r*w - v", v["preload"] / v["rope"]), ("w", "rad/s", f"(g*torque - b*w - r*({rope}))/J", 0.0)]
    states += [("x", "m", "v", 0.0), ("v", "m/s", f"({rope} - c*v - k*x - F0)/m", 0.0)]
    outputs = [("position", "m", "x"), ("drum_speed", "rad/s", "w")]
    return model_text("load on a cable", rows, states, outputs, dict(declared))


def _masses(rig: Rig, v: Values) -> str:
    """Motor and load with a shaft between them."""
    bodies = body(joint("motor", "hinge", "0 0 1", damping=v["b"], armature=v["motor"]), 1e-7)
    turning = joint("load", "hinge", "0 1 0", damping=v["c"], dry=v["dry"], drag=v["drag"])
    inertia, inner = v["inertia"] - v["uneven"] ** 2 / _LUMP, ""  # the lump's own is in the rig's
    if v["loose"]:  # a part of the load slides outwards on a spring as the load turns faster, as in a governor
        inertia -= v["loose"] * _RADIUS**2
        held, loss = v["loose"] * _AT_SPEED**2, 0.6 * v["loose"] * _AT_SPEED
        slides = joint("part", "slide", "0 0 1", stiffness=held, damping=loss)
        inner = body(slides, 1e-7, mass=v["loose"], low=_RADIUS)
    lump, low = (_LUMP, v["uneven"] / _LUMP) if v["uneven"] else (0.001, 0.0)
    bodies += body(turning, inertia, mass=lump, low=low, inner=inner)
    shaft = spring("shaft", {"motor": 1.0, "load": -1.0}, stiffness=v["k"], damping=v["d"],
                   low=-v["gap"] - 1e-12, high=v["gap"])  # fmt: skip
    seen = sensor("jointvel", "motor", v["clip"]) + sensor("jointvel", "load")
    drives = _drive(rig, v, "motor", 1.0) + disturber("load")
    gravity = 9.81 if v["uneven"] else 0.0
    return page(rig.step_s, bodies, tendons=shaft, actuators=drives, sensors=seen, gravity=gravity)


def _masses_model(v: Values, declared: Values, flags: Values) -> str:
    rows: list[Row] = [("g", 1.0, "1", WIDE)]
    if flags.get("rigid"):
        rows += [("J", v["motor"] + v["inertia"], "kg m^2", None), ("b", v["b"] + v["c"], "N m s", WIDE)]
        states = [("w", "rad/s", "(g*torque - b*w)/J", 0.0)]
        load = "w"
    else:
        rows += [("Jm", v["motor"], "kg m^2", None), ("Jl", v["inertia"], "kg m^2", None), ("b", v["b"], "N m s", WIDE)]
        rows += [("c", v["c"], "N m s", WIDE), ("k", v["k"], "N m/rad", WIDE), ("d", v["d"], "N m s/rad", WIDE)]
        shaft = "(k*twist + d*(w - s))"
        states = [("twist", "rad", "w - s", 0.0), ("w", "rad/s", f"(g*torque - b*w - {shaft})/Jm", 0.0)]
        states.append(("s", "rad/s", f"({shaft} - c*s)/Jl", 0.0))
        load = "s"
    outputs = [("motor_speed", "rad/s", "w"), ("load_speed", "rad/s", load)]
    return model_text("motor and load", rows, states, outputs, dict(declared))


def no_effects(**own: float) -> Values:
    """Return a rig's constants beside those of every effect, which are zero."""
    return {**dict.fromkeys(EFFECTS, 0.0), **own}


_ANGLE, _POSITION = Column("angle", "rad", "output", 5e-4), Column("position", "m", "output", 2e-4)
GEARS = Rig(
    "gears", "geared motor", 0.01,
    no_effects(ratio=30.0, motor=2e-5, inertia=0.012, k=10.6, kv=0.8, c=0.12, teeth=3000.0, teeth_c=1.0), _gears,
    _gears_model, Column("command", "rad", "input"), (_ANGLE, Column("speed", "rad/s", "output", 5e-3)), 0.5, 25, 0.02,
    ("k", "kv"), (("angle", "rad"), ("speed", "rad/s")), weak=0.005,
    wrong=("k", "d"),
)  # fmt: skip
PENDULUM = Rig(
    "pendulum", "pendulum", 0.02, no_effects(mass=0.8, arm=0.35, inertia=0.004, c=0.06), _pendulum, _pendulum_model,
    Column("torque", "N m", "input"), (_ANGLE, Column("speed", "rad/s", "output", 4e-3)), 1.0, 20, 0.01, ("c", "mass"),
    weak=0.002, wrong=("h", "c"),
)  # fmt: skip
CART = Rig(
    "cart", "cart between springs", 0.02, no_effects(mass=1.5, k=60.0, c=2.0, gain=4.0, arm=0.25, load_c=2e-3), _cart,
    _cart_model, Column("drive", "V", "input"), (_POSITION, Column("speed", "m/s", "output", 2e-3)), 2.0, 16, 0.05,
    ("k", "c", "gain"), (("position", "m"), ("speed", "m/s")), weak=0.02,
)  # fmt: skip
ARM = Rig(
    "arm", "robot arm", 0.01,
    no_effects(motor=0.02, mass=0.5, arm=0.2, inertia=0.03, c=0.15, d=0.05, k=20.0), _arm, _arm_model,
    Column("torque", "N m", "input"), (_ANGLE, Column("speed", "rad/s", "output", 5e-3)), 0.9, 18, 0.01,
    ("c", "k", "d"), start=lambda v: (0.0, 0.0), weak=0.002, wrong=("k", "h"),
)  # fmt: skip
CABLE = Rig(
    "cable", "load on a cable", 0.01,
    no_effects(drum=0.01, radius=0.1, mass=2.0, rope=1500.0, rope_c=12.0, k=80.0, c=6.0, b=0.05, preload=5.0), _cable,
    _cable_model, Column("torque", "N m", "input"), (_POSITION, Column("drum_speed", "rad/s", "output", 0.01)), 0.8, 25,
    0.1, ("c", "k", "b", "rope"), (("drum_angle", "rad"), ("position", "m"), ("drum_speed", "rad/s"), ("speed", "m/s")),
    lambda v: v["preload"] * v["radius"], lambda v: (v["preload"] / v["rope"] / v["radius"], 0.0), 0.03,
    ("k", "kc"),
)  # fmt: skip
MASSES = Rig(
    "masses", "motor and load", 0.005, no_effects(motor=0.005, inertia=0.01, k=30.0, d=0.02, b=0.02, c=0.03), _masses,
    _masses_model, Column("torque", "N m", "input"),
    (Column("motor_speed", "rad/s", "output", 0.02), Column("load_speed", "rad/s", "output", 0.02)), 0.8, 30, 0.01,
    ("b", "c", "k", "d"), (("twist", "rad"), ("motor_speed", "rad/s"), ("load_speed", "rad/s")),
    start=lambda v: (0.0,) * (3 if v["loose"] else 2), weak=0.002,
    project=((1.0, -1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
)  # fmt: skip
RIGS = {r.name: r for r in (GEARS, PENDULUM, CART, ARM, CABLE, MASSES)}


def free_frequency(v: Values) -> float:
    """Return the frequency in Hz of two inertias that a spring couples and nothing holds: ω² = k (1/J₁ + 1/J₂)."""
    link = v["inertia"] + v.get("mass", 0.0) * v.get("arm", 0.0) ** 2
    return math.sqrt(v["k"] * (1 / v["motor"] + 1 / link)) / (2 * math.pi)
