"""Simulate rigs by a rigid-body engine of another maker (MuJoCo): not our integrator, and not our forms of effects.

Todorov, Erez, Tassa (2012). Frictions and end stops are constraints that its solver fulfils at every step; drives that
lag or come late, sensors that clip, springs with slack are the engine's own, too.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError, UsageError

Array = NDArray[np.float64]
FINE = 25  # steps of the engine a sample


def require_engine() -> Any:
    """Return the engine's package; raises UsageError with the remedy where it is not installed."""
    if importlib.util.find_spec("mujoco") is None:
        raise UsageError(
            "--physics foreign needs the engine MuJoCo, which is not installed: pip install 'aeolid[challenge]'"
        )
    engine = importlib.import_module("mujoco")
    engine.set_mju_user_warning(lambda told: None)  # which otherwise writes a file where it was called
    return engine


def page(
    step_s: float,
    bodies: str,
    *,
    tendons: str = "",
    actuators: str,
    sensors: str,
    gravity: float = 0.0,
    rule: str = "implicitfast",
) -> str:
    """Return a model in the engine's language (MJCF) at FINE steps a sample; no shapes, hence no contacts but stops.

    rule: of integration; implicitfast adds step × damping to inertias, so that the force of a stiff servo would not be
    what moves the body; Euler (all of it explicit) keeps the balance at every step.
    """
    return (
        f'<mujoco><option timestep="{step_s / FINE!r}" integrator="{rule}" gravity="0 0 {-gravity!r}">'
        f'<flag eulerdamp="disable"/></option>'
        f"<worldbody>{bodies}</worldbody><tendon>{tendons}</tendon><actuator>{actuators}</actuator>"
        f"<sensor>{sensors}</sensor></mujoco>"
    )


def joint(
    name: str, kind: str, axis: str, *, damping: float, stiffness: float = 0.0, armature: float = 0.0, dry: float = 0.0,
    drag: float = 0.0, cubic: float = 0.0, stop: float = 0.0, rest: float = 0.0,
) -> str:  # fmt: skip
    """Return a joint: force −(k (q − rest) + k₃ (q − rest)³) − (c + c₂ |v|) v, dry friction, a stop at ±`stop`."""
    told = f'<joint name="{name}" type="{kind}" axis="{axis}" damping="{damping!r} {drag!r}" springref="{rest!r}"'
    told += f' stiffness="{stiffness!r} 0 {cubic!r}" armature="{armature!r}"'
    if dry:  # a stiff constraint: what creeps while it sticks stays far below a sensor's noise
        told += f' frictionloss="{dry!r}" solreffriction="0.002 1" solimpfriction="0.99 0.999 0.001"'
    if stop:  # a rubber buffer: negative numbers are stiffness and damping over the inertia it feels
        told += f' limited="true" range="{-stop!r} {stop!r}" solreflimit="-4000 -40"'
    return told + "/>"


def spring(name: str, ends: Mapping[str, float], *, stiffness: float, damping: float, low: float, high: float) -> str:
    """Return a spring of length Σ coefficient × joint, without force between `low` and `high`."""
    joints = "".join(f'<joint joint="{j}" coef="{c!r}"/>' for j, c in ends.items())
    return (
        f'<fixed name="{name}" stiffness="{stiffness!r}" damping="{damping!r}" '
        f'springlength="{low!r} {high!r}">{joints}</fixed>'
    )


def motor(
    at: str, *, gain: float, gear: float = 1.0, bias: str = "", lag: float = 0.0, late: float = 0.0, most: float = 0.0,
    step_s: float = 0.0,
) -> str:  # fmt: skip
    """Return a drive of force gain × (what is left of its command) + bias; late: the dead time, whole steps."""
    told = f'<general name="{at}_drive" joint="{at}" gear="{gear!r}" gainprm="{gain!r}"'
    told += f' biastype="affine" biasprm="{bias}"' if bias else ""
    told += f' dyntype="filterexact" dynprm="{lag!r}"' if lag else ""
    steps = round(late / step_s * FINE) if late else 0  # half a step less: what was due then is held, whatever rounding
    told += f' delay="{(steps - 0.5) * step_s / FINE!r}" nsample="{steps + 2}"' if steps else ""
    told += f' ctrllimited="true" ctrlrange="{-most!r} {most!r}"' if most else ' ctrllimited="false"'
    return told + "/>"


def disturber(at: str) -> str:
    """Return a drive for a force that nobody records."""
    return f'<general name="{at}_force" joint="{at}" gainprm="1"/>'


def sensor(kind: str, at: str, clip: float = 0.0) -> str:
    """Return a sensor, which shows nothing beyond ±`clip`."""
    target = {"jointpos": "joint", "jointvel": "joint"}.get(kind, "actuator")
    return f'<{kind} {target}="{at}"' + (f' cutoff="{clip!r}"/>' if clip else "/>")


def load(text: str) -> tuple[Any, Any]:
    """Return the engine's model and its data."""
    engine = require_engine()
    model = engine.MjModel.from_xml_string(text)
    return model, engine.MjData(model)


def simulate(text: str, start: Array, commands: Array, acting: Array | None = None) -> Array:
    """Return every sensor at every step of the engine (steps, sensors); commands (steps, drives), start: positions.

    acting: what the drives' own states begin with. Raises DataError where the rig runs away.
    """
    engine = require_engine()
    rollout = importlib.import_module("mujoco.rollout")
    model, data = load(text)
    data.qpos[:] = start
    if acting is not None and model.na:
        data.act[:] = acting[: model.na]
    engine.mj_forward(model, data)
    kind = engine.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(engine.mj_stateSize(model, kind))
    engine.mj_getState(model, data, state, kind)
    _, shown = rollout.rollout(model, data, state[None], np.ascontiguousarray(commands)[None])
    if np.any(data.warning.number) or not np.all(np.isfinite(shown)):
        raise DataError("a rig of the foreign engine runs away; make the challenge with another --seed")
    return np.asarray(shown[0], dtype=float)


def linearise(text: str, start: Array, commands: Array) -> tuple[Array, Array, Array, Array]:
    """Return A, B, C over one sample of held commands, and the sensors at rest; states are positions, then speeds."""
    engine = require_engine()
    model, data = load(text)
    data.qpos[:], data.ctrl[:] = start, commands
    engine.mj_forward(model, data)
    shown = np.array(data.sensordata)
    n, m, s = 2 * model.nv + model.na, model.nu, model.nsensordata
    A, B, C, D = np.zeros((n, n)), np.zeros((n, m)), np.zeros((s, n)), np.zeros((s, m))
    engine.mjd_transitionFD(model, data, 1e-6, True, A, B, C, D)
    whole, inputs = np.eye(n), np.zeros((n, m))
    for _ in range(FINE):  # x⁺ = A x + B u, FINE times with one u
        whole, inputs = A @ whole, A @ inputs + B
    return whole, inputs, C, shown
