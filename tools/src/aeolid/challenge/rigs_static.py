"""Two rigs whose motion is imposed and whose force is the output: baselines without states, a balance of forces."""

from __future__ import annotations

from aeolid.challenge.engine import joint, motor, page, sensor
from aeolid.challenge.models import Row, model_text
from aeolid.challenge.plants import Column
from aeolid.challenge.rigs import RIGS, WIDE, Rig, Values, body, no_effects


def _servo(v: Values, at: str) -> str:
    """Return a servo that holds a commanded position: force k_s (u − q) − d_s v."""
    return motor(at, gain=v["hold"], bias=f"0 {-v['hold']!r} {-v['hold_d']!r}")


def _damper(rig: Rig, v: Values) -> str:
    """Damper with a gas spring on a test stand; its rod is light."""
    sliding = joint("x", "slide", "1 0 0", damping=v["c"], stiffness=v["k"], dry=v["dry"], drag=v["drag"],
                    cubic=v["cubic"], stop=v["stop"])  # fmt: skip
    seen = sensor("jointpos", "x") + sensor("jointvel", "x") + sensor("actuatorfrc", "x_drive")
    return page(rig.step_s, body(sliding, 0.001, mass=v["mass"]), actuators=_servo(v, "x"), sensors=seen, rule="Euler")


def _damper_model(v: Values, declared: Values, flags: Values) -> str:
    rows: list[Row] = [("c", v["c"], "N s/m", WIDE), ("k", v["k"], "N/m", WIDE)]
    return model_text("damper", rows, [], [("force", "N", "c*speed + k*stroke")], dict(declared))


def _balance(rig: Rig, v: Values) -> str:
    """Pendulum that a servo swings: which torque does it take?"""
    turning = joint("q", "hinge", "0 1 0", damping=v["c"], dry=v["dry"], drag=v["drag"])
    bodies = body(turning, v["inertia"], mass=v["mass"], low=v["arm"])
    seen = sensor("jointpos", "q") + sensor("jointvel", "q") + sensor("actuatorfrc", "q_drive")
    return page(rig.step_s, bodies, actuators=_servo(v, "q"), sensors=seen, gravity=9.81, rule="Euler")


def _balance_model(v: Values, declared: Values, flags: Values) -> str:
    rows: list[Row] = [("J", v["inertia"] + v["mass"] * v["arm"] ** 2, "kg m^2", WIDE), ("c", v["c"], "N m s", WIDE)]
    rows.append(("h", 9.81 * v["mass"] * v["arm"], "N m", WIDE))
    law = "J*acceleration + c*speed + h*sin(angle)"
    return model_text("torque of a pendulum", rows, [], [("torque", "N m", law)], dict(declared))


DAMPER = Rig(
    "damper", "damper on a test stand", 0.01, no_effects(mass=0.3, c=300.0, k=400.0, hold=1e5, hold_d=140.0), _damper,
    _damper_model, Column("target", "m", "ignore"),
    (Column("stroke", "m", "input", 2e-5), Column("speed", "m/s", "input", 5e-4), Column("force", "N", "output", 0.3)),
    0.04, 20, 0.0, ("c", "k"), weak=0.3, wrong=("c", "k"), servo=True,
)  # fmt: skip
BALANCE = Rig(
    "balance", "torque of a pendulum", 0.02,
    no_effects(mass=0.8, arm=0.35, inertia=0.004, c=0.06, hold=2e3, hold_d=20.0), _balance, _balance_model,
    Column("target", "rad", "ignore"),
    (Column("angle", "rad", "input", 2e-4), Column("speed", "rad/s", "input", 2e-3),
     Column("torque", "N m", "output", 5e-3), Column("acceleration", "rad/s^2", "input", 0.02)),
    0.8, 25, 0.0, ("c", "mass"), weak=0.003, wrong=("h", "c"), servo=True,
)  # fmt: skip
STATIC = {r.name: r for r in (DAMPER, BALANCE)}
ALL = RIGS | STATIC
