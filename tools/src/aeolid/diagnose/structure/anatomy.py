"""Find the mechanics in a model: where it moves, how fast, and where a force would act."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.structure.baseline import mass_of, with_force
from aeolid.diagnose.structure.eigenvectors import left_vectors
from aeolid.models import expressions as ex
from aeolid.models.equations import Auxiliary, Equations, Parameter, State
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
VELOCITY_UNITS = {"m/s", "mm/s", "rad/s", "deg/s", "rpm", "1/min", "ticks/s"}
ACCELERATION_UNITS = {"m/s^2", "m/s**2", "m/s2", "rad/s^2", "deg/s^2", "g"}
LEAST_MODULUS = float(np.exp(-np.pi))  # of an eigenvalue: what decays faster than the Nyquist frequency is no motion
_UNSEEN = 1e-9  # of an output's spread, by a mode of unit length
_FORCE_OF_MASS = {
    "kg": ("force_N", "N"),
    "g": ("force_mN", "mN"),
    "t": ("force_kN", "kN"),
    "kgm^2": ("torque_N_m", "N m"),
    "kgm2": ("torque_N_m", "N m"),
}


@dataclass(frozen=True, eq=False)
class Motion:
    """Hold one velocity of the model, its position if it has one, and how an extra force enters.

    inject(model, force, name) adds the force, called `name`, to the equation of motion; force_unit is its unit (an
    acceleration where the model shows no mass). forces is what the model has there already, in that unit; mass the
    parameter it is divided by; shown_by the output that shows a mode of a linear model most. Sizes are typical
    magnitudes from the baseline's own run. recorded: the ends of a recorded position, where the motion is an input and
    the force an output of a static law; nothing is accelerated there. direction: the sign of a velocity that is not
    recorded, as the position tells it.
    """

    location: str
    velocity: ast.expr
    position: ast.expr | None
    inject: Callable[[Equations, ast.expr, str], Equations]
    force_name: str
    force_unit: str
    velocity_size: float
    position_size: float
    force_size: float
    frequency_hz: float | None
    forces: ast.expr
    mass: Parameter | None
    position_unit: str
    shown_by: str = ""
    recorded: tuple[float, float] | None = None
    direction: ast.expr | None = None


def motions_of_equations(model: Equations, sizes: Array, rates: Array) -> list[Motion]:
    """Find velocities in first-principles equations: dq/dt = v, or a state whose unit is a velocity.

    sizes, rates: typical magnitude (n,) of each state and of its derivative.
    """
    names = [s.name for s in model.states]
    found: list[Motion] = []
    paired: dict[str, str] = {}
    for state in model.states:
        if isinstance(state.derivative, ast.Name) and state.derivative.id in names:
            paired[state.derivative.id] = state.name
    for i, state in enumerate(model.states):
        if state.name not in paired and (_is_alone(state, model) or state.unit.replace(" ", "") not in VELOCITY_UNITS):
            continue
        position = paired.get(state.name)
        mass = mass_of(state.derivative, model)
        label, unit = _FORCE_OF_MASS.get(mass.unit.replace(" ", ""), ("force", "")) if mass else ("acceleration", "")
        if not mass and state.unit:
            unit = f"{state.unit}/s"
        found.append(
            Motion(
                f"state:{state.name}", ast.Name(id=state.name), ast.Name(id=position) if position else None,
                _force_on(state.name), label, unit, float(sizes[i]),
                float(sizes[names.index(position)]) if position else 0.0,
                float(rates[i]) * (abs(mass.value) if mass else 1.0), None, _forces(state, mass), mass,
                model.states[names.index(position)].unit if position else base_unit(state.unit),
            )
        )  # fmt: skip
    return found


def _is_alone(state: State, model: Equations) -> bool:
    """Tell whether nothing but itself and constants enters a state's equation: a wind with memory, no body."""
    return ex.names_in(state.derivative) <= {state.name, *(p.name for p in model.parameters)}


def _forces(state: State, mass: Parameter | None) -> ast.expr:
    whole = state.derivative
    return whole.left if mass is not None and isinstance(whole, ast.BinOp) else whole


def _force_on(name: str) -> Callable[[Equations, ast.expr, str], Equations]:
    def inject(model: Equations, force: ast.expr, _: str) -> Equations:
        return with_force(model, name, force)

    return inject


def motions_of_state_space(
    model: StateSpace, converted: Equations, sizes: Array, spreads: Array
) -> tuple[list[Motion], Equations]:
    """Read each oscillatory mode as q̈ = −ω² q − 2ζω q̇ with q, q̇ linear in the states.

    The output that shows the mode most (against its spread, spreads (l,)) and the derivative order in its unit fix
    the mode's scale and phase. Returns the motions, and the equations with their coordinates as intermediates.
    """
    values, right = (np.asarray(part, dtype=complex) for part in np.linalg.eig(model.A))
    left = left_vectors(model.A, values, right)
    found: list[Motion] = []
    shared: list[Auxiliary] = []
    kept = np.flatnonzero((values.imag > 1e-9) & (np.abs(values) > LEAST_MODULUS))
    named = in_digits(np.abs(np.log(values[kept])) / model.sample_time_s / (2 * np.pi))
    for k, hertz in zip(kept, named, strict=True):
        lam = np.log(values[k]) / model.sample_time_s
        shape = model.C @ right[:, k]  # (l,): how each output sees the mode
        j = int(np.argmax(np.abs(shape) / spreads))
        if abs(shape[j]) < _UNSEEN * spreads[j]:
            continue  # no output shows this mode: a force on it would not either
        order = _derivative_order(model.outputs[j].unit)
        beta = 2j * shape[j] / lam**order
        q = np.imag(beta * left[k])
        v = np.imag(beta * lam * left[k])
        held = np.expm1(lam * model.sample_time_s) / (lam * model.sample_time_s)  # of a force held over the sample
        push = 2 * np.real(right[:, k] * held / (beta * lam.imag))
        feels = _felt(model.C @ right[:, k] / (beta * lam.imag * lam), model)
        tag = f"modal{len(found) + 1}"
        shared += [
            Auxiliary(f"{tag}_position", linear_in(q, converted)),
            Auxiliary(f"{tag}_velocity", linear_in(v, converted)),
            Auxiliary(f"{tag}_acceleration", _mean_rate(v, model, converted)),
            Auxiliary(f"{tag}_position_next", next_of(q, model, converted)),
            Auxiliary(f"{tag}_velocity_next", next_of(v, model, converted)),
        ]
        span = np.abs(q) @ sizes[: len(q)], np.abs(v) @ sizes[: len(v)]
        found.append(
            Motion(
                f"mode:{hertz} Hz", ast.Name(id=f"{tag}_velocity"), ast.Name(id=f"{tag}_position"),
                force_on_states(tag, push * model.sample_time_s, feels, converted), "acceleration",
                acceleration_unit(model.outputs[j].unit),
                float(span[1]), float(span[0]), float(span[1] * abs(lam)), float(abs(lam) / 2 / np.pi),
                ast.Name(id=f"{tag}_acceleration"), None, base_unit(model.outputs[j].unit), model.outputs[j].name,
            )
        )  # fmt: skip
    return found, replace(converted, auxiliaries=(*converted.auxiliaries, *shared))


def in_digits(values: Array) -> list[str]:
    """Write values with three digits, or as many more as tell them apart: places have these as their names.

    A tower's two modes of 0.3214 and 0.3208 Hz had one name, and one's model was taken for the other's.
    """
    for digits in range(3, 16):
        words = [f"{v:.{digits}g}" for v in values.tolist()]
        if len(set(words)) == len(words):
            return words
    return [f"{v:.3g} ({i + 1})" for i, v in enumerate(values.tolist())]


def _derivative_order(unit: str) -> int:
    plain = unit.replace(" ", "")
    return 1 if plain in VELOCITY_UNITS else 2 if plain in ACCELERATION_UNITS else 0


def base_unit(unit: str) -> str:
    """Return the unit of the position of a velocity or an acceleration, of other units themselves.

    Times are in s, so that what turns at so many rpm goes so many rpm s.

    >>> [base_unit(u) for u in ("mm/s", "rad/s^2", "rpm", "g", "N/m", "")]
    ['mm', 'rad', 'rpm s', 'g s^2', 'N/m', '1']
    """
    plain = unit.strip() or "1"
    of_seconds = re.fullmatch(r"(.*?)\s*/\s*s\s*((\^|\*\*)?\s*2|²)?", plain)
    if of_seconds:
        return of_seconds[1] or "1"
    of_others = 1 if re.search(r"/\s*(min|h)$", plain) or plain in ("kn", "mph") else _derivative_order(plain)
    return plain + ("", " s", " s^2")[of_others]


def acceleration_unit(unit: str) -> str:
    """Return the unit of the acceleration that belongs to a position, a velocity or an acceleration.

    >>> [acceleration_unit(u) for u in ("mm/s", "rad/s^2", "rpm", "g", "N/m", "")]
    ['mm/s^2', 'rad/s^2', 'rpm/s', 'g', 'N/m/s^2', '1/s^2']
    """
    base = base_unit(unit)
    for integrals, rest in ((" s^2", ""), (" s", "/s")):
        if base.endswith(integrals):
            return base.removesuffix(integrals) + rest
    return f"{base}/s^2"


def linear_in(row: Array, model: Equations) -> ast.expr:
    """Write row·x."""
    terms = [f"{c!r}*{s.name}" for c, s in zip(row.tolist(), model.states, strict=False) if c]
    return ex.parse(" + ".join(terms) or "0", "mode coordinate")


def _felt(shape: Array, model: StateSpace) -> dict[str, float]:
    """Return what each accelerometer feels at once of a unit push on a mode; shape (l,): the velocity it implies."""
    felt = zip(model.outputs, (2 * np.real(shape)).tolist(), strict=True)
    return {s.name: c for s, c in felt if _derivative_order(s.unit) == 2 and c}


def next_of(row: Array, model: StateSpace, converted: Equations) -> ast.expr:
    """Write row·x⁺ from the model's own A and B."""
    a, b = row @ model.A, row @ model.B
    terms = [f"{c!r}*{s.name}" for c, s in zip(a.tolist(), converted.states, strict=False) if c]
    terms += [f"{c!r}*drive{i + 1}" for i, c in enumerate(b.tolist()) if c]
    return ex.parse(" + ".join(terms) or "0", "mode coordinate")


def _mean_rate(v: Array, model: StateSpace, converted: Equations) -> ast.expr:
    """Write the mean rate of v·x over a sample, (v·x⁺ − v·x)/step."""
    change = ex.combine("-", next_of(v, model, converted), linear_in(v, converted))
    return ex.combine("/", change, ast.Constant(model.sample_time_s))


def force_on_states(
    tag: str, push: Array, feels: dict[str, float], model: Equations, moving: tuple[str, ...] = ("position", "velocity")
) -> Callable[[Equations, ast.expr, str], Equations]:
    """Return what pushes states with the mean of a force at both ends of a sample (Heun: second order in the step).

    push (n,): of a unit force over a sample. moving: which intermediates <tag>_… with a value <tag>_…_next there are.

    Held from the start of the sample, a force would come half a sample late, and a push at its end would leave the
    position out: at 20 samples a period a quadratic spring was estimated 38 % low so, drag 22 %. Accelerometers feel
    the force of the instant.
    """
    ends = {f"{tag}_{what}": ast.Name(id=f"{tag}_{what}_next") for what in moving}
    share = {s.name: float(c) for s, c in zip(model.states, push, strict=False)}

    def inject(target: Equations, force: ast.expr, name: str) -> Equations:
        both = ex.combine("+", force, ex.substitute(force, ends))
        mean = Auxiliary(f"{name}_mean", ex.combine("*", ast.Constant(0.5), both))
        shared = (*target.auxiliaries, Auxiliary(name, force), mean)
        states = tuple(_push(s, name) if share.get(s.name) else s for s in target.states)
        outputs = tuple(
            replace(o, equation=_plus(o.equation, feels[o.name], name)) if o.name in feels else o
            for o in target.outputs
        )
        return replace(target, states=states, outputs=outputs, auxiliaries=shared)

    def _push(state: State, name: str) -> State:
        return replace(state, derivative=_plus(state.derivative, share[state.name], f"{name}_mean"))

    return inject


def _plus(equation: ast.expr, factor: float, name: str) -> ast.expr:
    return ex.combine("+", equation, ex.combine("*", ast.Constant(factor), ast.Name(id=name)))
