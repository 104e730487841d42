"""Bring either kind of baseline into one form: equations with free nuisance parameters."""

from __future__ import annotations

import ast
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete

from aeolid.models import expressions as ex
from aeolid.models.equations import Auxiliary, Equations, Output, Parameter, State
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]


def discretise(model: StateSpace, step: float) -> StateSpace:
    """Return the zero-order-hold equivalent of a continuous-time model; its noise model does not carry over."""
    if model.sample_time_s:
        return model
    A, B, C, D, _ = cont2discrete((model.A, model.B, model.C, model.D), step, method="zoh")
    return replace(model, A=A, B=B, C=C, D=D, K=None, innovation_covariance=None, sample_time_s=step)


def equations_of(model: StateSpace) -> Equations:
    """Write x⁺ = A x + B (u − u₀ + b_u), y = C x + D (…) + y₀ + b_y + d as equations.

    The constant offsets b_u, b_y are free: a linear model knows its operating point only as far as it was told. Each
    output has a shaped disturbance d⁺ = a d + (gain) e with a free pole: noise whose colour the plant's poles lack.
    """
    shaped = [f"noise{j + 1}" for j in range(len(model.outputs))]
    poles = [Parameter(f"noise_pole{j + 1}", 0.5, "1", 0.0, 0.9999, True) for j in range(len(model.outputs))]
    states = [f"x{i + 1}" for i in range(model.order)]
    inputs = [f"u{i + 1}" for i in range(len(model.inputs))]
    drive = [f"drive{i + 1}" for i in range(len(model.inputs))]
    acting = [
        Auxiliary(d, ex.parse(f"u{i + 1} - {s.offset!r} + bias_u{i + 1}", "input"))
        for i, (d, s) in enumerate(zip(drive, model.inputs, strict=True))
    ]
    rows = [_row(model.A[i], states, model.B[i], drive) for i in range(model.order)]
    reads = [_row(model.C[j], states, model.D[j], drive) for j in range(len(model.outputs))]
    bias = [Parameter(f"bias_u{i + 1}", 0.0, s.unit, free=True) for i, s in enumerate(model.inputs)]
    bias += [Parameter(f"bias_y{j + 1}", 0.0, s.unit, free=True) for j, s in enumerate(model.outputs)]
    return Equations(
        "baseline", model.sample_time_s, (*bias, *poles),
        (
            *(
                State(n, s.unit, r, float(x), True)
                for n, s, r, x in zip(states, model.states, rows, model.x0, strict=True)
            ),
            *(
                State(n, s.unit, ex.parse(f"{p.name}*{n}", "noise"), 0.0)
                for n, s, p in zip(shaped, model.outputs, poles, strict=True)
            ),
        ),
        tuple(
            Output(s.name, s.unit, ex.combine("+", read, ex.parse(f"{s.offset!r} + bias_y{j + 1} + {d}", "offset")))
            for j, (s, read, d) in enumerate(zip(model.outputs, reads, shaped, strict=True))
        ),
        model.inputs, tuple(inputs), (), tuple(acting),
    )  # fmt: skip


def _row(a: Array, states: list[str], b: Array, inputs: list[str]) -> ast.expr:
    """Sum coefficient times name as a balanced tree, so that long rows stay shallow."""
    terms = [ex.parse(f"{c!r}*{n}", "model row") for c, n in zip(a.tolist(), states, strict=True) if c]
    terms += [ex.parse(f"{c!r}*{n}", "model row") for c, n in zip(b.tolist(), inputs, strict=True) if c]
    if not terms:
        return ast.Constant(0.0)
    while len(terms) > 1:
        pairs = [ex.combine("+", p, q) for p, q in zip(terms[::2], terms[1::2], strict=False)]
        terms = pairs + ([terms[-1]] if len(terms) % 2 else [])
    return terms[0]
