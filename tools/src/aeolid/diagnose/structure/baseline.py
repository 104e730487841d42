"""Bring either kind of baseline into one form: equations with free nuisance parameters."""

from __future__ import annotations

import ast
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.structure.felt import felt_in
from aeolid.diagnose.structure.forces import FORCE, RATE
from aeolid.diagnose.structure.modal import ModalForm
from aeolid.diagnose.structure.sums import factors_of, written_out
from aeolid.models import expressions as ex
from aeolid.models.equations import Auxiliary, Equations, Output, Parameter, State
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
FELT = "felt_"  # what an accelerometer feels of a state's equation: name of the intermediate, before the state's
_STILL = 1e-9  # spread of an input, in its value, below which only rounding moves it


def equations_of(model: StateSpace, *, shaped_noise: bool, modal: ModalForm | None = None) -> Equations:
    """Write x⁺ = A x + B (u − u₀ + b_u), y = C x + D (…) + y₀ + b_y + d as equations.

    The constant offsets b_u, b_y are free: a linear model knows its operating point only as far as it was told. Each
    output gets, with `shaped_noise`, a disturbance d⁺ = a d + (gain) e with a free pole: noise whose colour the plant's
    poles lack. With `modal` the entries of A, B and C are free parameters.
    """
    shaped = [f"noise{j + 1}" for j in range(len(model.outputs))] if shaped_noise else []
    poles = [Parameter(f"noise_pole{j + 1}", 0.5, "1", 0.0, 0.9999, True) for j in range(len(shaped))]
    states = [f"x{i + 1}" for i in range(model.order)]
    inputs = [f"u{i + 1}" for i in range(len(model.inputs))]
    drive = [f"drive{i + 1}" for i in range(len(model.inputs))]
    acting = [
        Auxiliary(d, ex.parse(f"u{i + 1} - {s.offset!r} + bias_u{i + 1}", "input"))
        for i, (d, s) in enumerate(zip(drive, model.inputs, strict=True))
    ]
    named = {} if modal is None else modal.names
    rows = [linear_row((model.A[i], "A", states), (model.B[i], "B", drive), i, named) for i in range(model.order)]
    reads = [
        linear_row((model.C[j], "C", states), (model.D[j], "D", drive), j, named) for j in range(len(model.outputs))
    ]
    bias = [Parameter(f"bias_u{i + 1}", 0.0, s.unit, free=True) for i, s in enumerate(model.inputs)]
    bias += [Parameter(f"bias_y{j + 1}", 0.0, s.unit, free=True) for j, s in enumerate(model.outputs)]
    entries = [] if modal is None else [Parameter(n, v, free=True) for n, v in modal.values.items()]
    added = [f" + {d}" for d in shaped] or [""] * len(model.outputs)
    return Equations(
        "baseline", model.sample_time_s, (*bias, *poles, *entries),
        (
            *(
                State(n, s.unit, r, float(x), True)
                for n, s, r, x in zip(states, model.states, rows, model.x0, strict=True)
            ),
            *(
                State(n, s.unit, ex.parse(f"{p.name}*{n}", "noise"), 0.0)
                for n, s, p in zip(shaped, model.outputs, poles, strict=False)
            ),
        ),
        tuple(
            Output(s.name, s.unit, ex.combine("+", read, ex.parse(f"{s.offset!r} + bias_y{j + 1}{d}", "offset")))
            for j, (s, read, d) in enumerate(zip(model.outputs, reads, added, strict=True))
        ),
        model.inputs, tuple(inputs), (), tuple(acting),
    )  # fmt: skip


def offset_sizes(u: Array, spreads: Array) -> dict[str, float]:
    """Return the typical sizes of the offsets b_u, b_y of `equations_of`: how far their channels move.

    u (N, r) recorded inputs; spreads (l,) of the outputs. An input that never moves has the size of its value, or one
    unit where that is zero.
    """
    moves, levels = np.nanstd(u, axis=0), np.abs(np.nanmedian(u, axis=0))
    moves = np.where(moves > _STILL * levels, moves, np.where(levels > 0, levels, 1.0))
    sizes = {f"bias_u{i + 1}": float(v) for i, v in enumerate(moves)}
    return sizes | {f"bias_y{j + 1}": float(v) for j, v in enumerate(spreads)}


def shape_forces(model: Equations, slowest_s: float, step: float) -> tuple[Equations, tuple[str, ...]]:
    """Add an unmeasured force with memory to every equation that noise may drive: d' = −a d + noise, a free.

    Wind and other unmeasured inputs are seldom white; without memory in the noise a lightly damped mode would be the
    only coloured noise on offer and would get a name. a lies between 1/(slowest_s) and one a step. Returns the model
    and the names of the added states.
    """
    parameters, added = list(model.parameters), []
    for i in noisy_states(model):
        state = model.states[i]
        force, rate = f"{FORCE}{state.name}", f"{RATE}{state.name}"
        model = with_force(model, state.name, ast.Name(id=force))
        low, high = 1.0 / slowest_s, 1.0 / step
        decay = f"-{rate}*{force}"
        if model.sample_time_s:
            decay = f"exp(-{rate}*{model.sample_time_s!r})*{force}"
        parameters.append(Parameter(rate, float(np.sqrt(low * high)), "1/s", low, high, True))
        added.append(State(force, "", ex.parse(decay, "unmeasured force"), 0.0))
    model = replace(model, parameters=tuple(parameters), states=(*model.states, *added))
    return model, tuple(s.name for s in added)


def mass_of(derivative: ast.expr, model: Equations) -> Parameter | None:
    """Return the parameter M of an equation of motion (forces)/M; None where the equation has another shape."""
    is_quotient = isinstance(derivative, ast.BinOp) and isinstance(derivative.op, ast.Div)
    if is_quotient and isinstance(derivative.right, ast.Name):  # type: ignore[attr-defined]
        return next((p for p in model.parameters if p.name == derivative.right.id), None)  # type: ignore[attr-defined]
    return None


def add_force(state: State, force: ast.expr, model: Equations) -> State:
    """Add a force to the forces of (forces)/M, or to the derivative where no mass shows."""
    d = state.derivative
    if mass_of(d, model) is not None and isinstance(d, ast.BinOp):
        return replace(state, derivative=ex.combine("/", ex.combine("+", d.left, force), d.right))
    return replace(state, derivative=ex.combine("+", d, force))


def with_force(model: Equations, name: str, force: ast.expr) -> Equations:
    """Add a force to one state's equation, and to what feels it: every output and state that repeats the equation.

    What is felt becomes an intermediate of its own, `felt_<state>`, kept last, so that later forces find it whatever
    has been done to the output meanwhile.
    """
    model, label = _with_felt(model, name), f"{FELT}{name}"
    before = next(s for s in model.states if s.name == name)
    after = add_force(before, force, model)
    kept = [a for a in model.auxiliaries if a.name != label]
    for a in model.auxiliaries:
        if a.name == label:
            kept.append(replace(a, equation=add_force(replace(before, derivative=a.equation), force, model).derivative))
    states = tuple(after if s.name == name else s for s in model.states)
    return replace(model, states=states, auxiliaries=tuple(kept))


def _with_felt(model: Equations, name: str) -> Equations:
    """Let what repeats a state's equation read it as an intermediate: outputs, also all of it that states move; states.

    A pendulum's equation holds the acceleration of its cart in full: friction on the cart that did not reach the
    pendulum was no friction, and had no name. Of states only what an input moves: a twist's rate, which a damping
    repeats, is geometry.
    """
    d, label = next(s.derivative for s in model.states if s.name == name), f"{FELT}{name}"
    shared = {a.name for a in model.auxiliaries}
    is_signal = isinstance(d, ast.Constant) or (isinstance(d, ast.Name) and d.id not in shared)
    if is_signal or label in shared:
        return model
    state = next(s for s in model.states if s.name == name)
    outputs = tuple(_feeling(o, state, label, model) for o in model.outputs)
    moved = bool(ex.names_in(d) & set(model.symbols))
    states = tuple(_carried(s, d, label) if moved and s is not state else s for s in model.states)
    if not any(label in ex.names_in(e) for e in (*(o.equation for o in outputs), *(s.derivative for s in states))):
        return model
    return replace(model, outputs=outputs, states=states, auxiliaries=(*model.auxiliaries, Auxiliary(label, d)))


def _carried(state: State, d: ast.expr, label: str) -> State:
    """Return a state that reads another's equation `d` as an intermediate where it repeats it in full."""
    return replace(state, derivative=ex.swap(state.derivative, d, ast.Name(id=label)))


def _feeling(output: Output, state: State, label: str, model: Equations) -> Output:
    """Return an output that reads what it repeats of a state's equation as an intermediate."""
    swapped = ex.swap(output.equation, state.derivative, ast.Name(id=label))
    if label in ex.names_in(swapped):
        return replace(output, equation=swapped)
    found = felt_in(output, state, model)
    if found is None:
        return output
    factor, rest = found
    felt = ast.Name(id=label) if factor == 1.0 else ex.combine("*", ast.Constant(factor), ast.Name(id=label))
    is_all = isinstance(rest, ast.Constant) and not rest.value
    return replace(output, equation=felt if is_all else ex.combine("+", felt, rest))


_Part = tuple[Array, str, list[str]]  # coefficients, the matrix they stand in, the names they multiply


def linear_row(own: _Part, driven: _Part, row: int, named: dict[tuple[str, int, int], str]) -> ast.expr:
    """Sum coefficient times name as a balanced tree, so that long rows stay shallow."""
    terms = []
    for coefficients, matrix, names in (own, driven):
        for column, (value, name) in enumerate(zip(coefficients.tolist(), names, strict=True)):
            text = named.get((matrix, row, column), repr(value) if value else "")
            terms += [ex.parse(f"{text}*{name}", "model row")] if text else []
    if not terms:
        return ast.Constant(0.0)
    while len(terms) > 1:
        pairs = [ex.combine("+", p, q) for p, q in zip(terms[::2], terms[1::2], strict=False)]
        terms = pairs + ([terms[-1]] if len(terms) % 2 else [])
    return terms[0]


def noisy_states(model: Equations) -> tuple[int, ...]:
    """List the states that noise may drive: all but the kinematic ones.

    Where the derivative is another state, or the difference of two bodies' velocities, it is geometry: no force acts.
    """
    names = {s.name for s in model.states}
    bodies = {s.name for s in model.states if mass_of(s.derivative, model) is not None}

    def kinematic(state: State) -> bool:
        if isinstance(state.derivative, ast.Name):
            return state.derivative.id in names
        if len(bodies - {state.name}) < 2:  # as in every linear model: nothing to be a difference of
            return False
        return len(factors_of(written_out(state.derivative, model), model, bodies - {state.name})) > 1

    return tuple(i for i, s in enumerate(model.states) if not kinematic(s))
