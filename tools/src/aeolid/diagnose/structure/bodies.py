"""Find the bodies of a linear model whose motion its outputs show, and where a force on each would enter.

A mode is the motion of all bodies together; a bearing's friction acts on one of them, on the rigid motion as on every
mode. Where a force on a body enters follows from where it shows, by Maxwell's reciprocity: the force of a drive
reaches a second body as a force on that body reaches the driven one. Of x⁺ = A x + B u the k-th mode has the right and
left vectors v_k and w_k, and c_j x is the speed of body j, that of the driven one with j = d. Then a force on body j
has the column Σ_k v_k (w_k B)(c_j v_k)/(c_d v_k). It is in the drive's unit, the speed in that of the body's output.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import (
    LEAST_MODULUS,
    VELOCITY_UNITS,
    Motion,
    base_unit,
    force_on_states,
    linear_in,
    next_of,
)
from aeolid.diagnose.structure.eigenvectors import inverse_of
from aeolid.models import expressions as ex
from aeolid.models.equations import Auxiliary, Equations
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
POSITION_UNITS = {"m", "mm", "rad", "deg", "ticks"}
_UNSEEN = 1e-6  # of the largest: a mode that the driven body shows less tells nothing of what drives it
_SAMPLES = 64  # of a response to a push
_SLOWEST = 1e-3  # of a sample: nothing but integrators has no rate of its own


@dataclass(frozen=True, eq=False)
class _Speed:
    """Hold the speed of a body, row·x + offset, how large it is, and the output that shows it."""

    output: int
    row: Array
    offset: float
    size: float


def bodies_of_state_space(
    model: StateSpace, converted: Equations, sizes: Array, y: Array
) -> tuple[list[Motion], Equations]:
    """Return the bodies, and the equations with their velocities as intermediates.

    sizes: of the states; y (N, l): the recorded outputs, speeds or positions. Only speeds of both signs are taken:
    where a shaft turns one way, its dry friction is a constant torque. Only bodies that more than one mode moves, or a
    mode and what is no oscillation: where there is one mode, it says all there is.
    """
    values, right = np.linalg.eig(model.A)
    kept = values[abs(values) > LEAST_MODULUS].astype(complex)
    if not len(kept):  # nothing but the memory of a sample
        return [], converted
    if (left := inverse_of(right)) is None:  # no full set of modes
        return [], converted
    speeds = _speeds(model, (values.astype(complex), right.astype(complex), left), sizes, y)
    if (driven := _driven(model, speeds)) is None:
        return [], converted
    i, body = driven
    fastest = max(float(abs(np.log(kept)).max()), _SLOWEST)
    found: list[Motion] = []
    shared: list[Auxiliary] = []
    for speed in speeds:
        push = column_of_force(model.A, model.B[:, i], body.row, speed.row)
        gain, tag, shown = abs(float(speed.row @ push)), f"body{len(found) + 1}", model.outputs[speed.output]
        parts = ((speed.row @ right) * (left @ push))[values.imag > 0]
        if not gain > 0 or 2 * abs(parts.real).max(initial=0.0) > in_force().structure.one_mode_share * gain:
            continue
        shared += _velocities(model, converted, speed, tag)
        found.append(
            Motion(
                f"state:{shown.name}", ast.Name(id=f"{tag}_velocity"), None,
                force_on_states(tag, push, {}, converted, ("velocity",)), "force", model.inputs[i].unit,
                speed.size, 0.0, speed.size * fastest / gain, None, ast.Name(id=f"{tag}_acceleration"), None,
                base_unit(shown.unit), shown.name,
            )
        )  # fmt: skip
    return found, replace(converted, auxiliaries=(*converted.auxiliaries, *shared))


def column_of_force(A: Array, B: Array, driven: Array, speed: Array) -> Array:
    """Return the column (n,) by which a force on one body enters, by reciprocity.

    A (n, n) with a full set of eigenvectors; B (n,): the column of a force on the driven body; driven, speed (n,): the
    rows that read the speeds of that body and of the other one.
    """
    _, right = np.linalg.eig(A)
    own, seen = driven @ right, speed @ right
    share = np.divide(seen, own, where=abs(own) > _UNSEEN * abs(own).max(), out=np.zeros_like(seen))
    return np.asarray(np.real(right @ (share * np.linalg.solve(right, B.astype(complex)))), dtype=np.float64)


def _speeds(
    model: StateSpace, modes: tuple[ComplexArray, ComplexArray, ComplexArray], sizes: Array, y: Array
) -> list[_Speed]:
    """Return the speeds that outputs show, of those of one body the first; modes: eigenvalues, right and left vectors.

    A position's speed is its rate in continuous time, x' = log(A)/h x, where no pole lacks a logarithm.
    """
    values, right, left = modes
    rates = None if np.any((abs(values.imag) < 1e-9) & (values.real <= 0)) else np.log(values) / model.sample_time_s
    found: list[_Speed] = []
    directly = [j for j, s in enumerate(model.outputs) if s.unit.replace(" ", "") in VELOCITY_UNITS]
    for j in (*directly, *(j for j in range(len(model.outputs)) if j not in directly)):
        signal = model.outputs[j]
        unit, recorded = signal.unit.replace(" ", ""), y[:, j][np.isfinite(y[:, j])]
        if unit in VELOCITY_UNITS and _turns(recorded):
            speed = _Speed(j, model.C[j], float(signal.offset), float(np.std(recorded)))
        elif unit in POSITION_UNITS and rates is not None and _turns(np.diff(recorded)):
            row = np.real(model.C[j] @ right @ (rates[:, None] * left))
            speed = _Speed(j, row, 0.0, float(abs(row) @ sizes[: len(row)]))
        else:
            continue
        scaled = [s.row * sizes[: len(s.row)] for s in (speed, *found)]
        lengths = [max(float(np.linalg.norm(s)), 1e-300) for s in scaled]
        alike = [abs(scaled[0] @ s) / (lengths[0] * m) for s, m in zip(scaled[1:], lengths[1:], strict=True)]
        if speed.size > 0 and max(alike, default=0.0) < in_force().structure.one_body_cosine:
            found.append(speed)
    return found


def _turns(speed: Array) -> bool:
    """Tell whether a recorded speed is of both signs for a good part of the time."""
    least = in_force().structure.both_ways_share
    return bool(len(speed)) and min(float(np.mean(speed > 0)), float(np.mean(speed < 0))) >= least


def _driven(model: StateSpace, speeds: Sequence[_Speed]) -> tuple[int, _Speed] | None:
    """Return an input and the speed of the body it acts on: the one that starts at once, where one does.

    What a speed changes by within the first sample, beside the most it ever does.
    """
    best: tuple[float, int, _Speed] | None = None
    for i in range(model.B.shape[1]):
        for speed in speeds:
            x, response = model.B[:, i], np.zeros(_SAMPLES)
            for k in range(_SAMPLES):
                response[k], x = abs(float(speed.row @ x)), model.A @ x
            at_once = float(response[0] / max(response.max(), 1e-300))
            if at_once > in_force().structure.driven_share and (best is None or at_once > best[0]):
                best = (at_once, i, speed)
    return None if best is None else best[1:]


def _velocities(model: StateSpace, converted: Equations, speed: _Speed, tag: str) -> list[Auxiliary]:
    """Return the velocity, that after the sample, and its mean rate over it."""
    offset = ast.Constant(speed.offset)
    now = ex.combine("+", linear_in(speed.row, converted), offset)
    after = ex.combine("+", next_of(speed.row, model, converted), offset)
    change = ex.combine("/", ex.combine("-", after, now), ast.Constant(model.sample_time_s))
    return [
        Auxiliary(f"{tag}_velocity", now), Auxiliary(f"{tag}_velocity_next", after),
        Auxiliary(f"{tag}_acceleration", change),
    ]  # fmt: skip
