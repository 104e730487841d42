"""Find what two bodies of a model do to each other: the twist of a shaft, the stretch of a spring between them."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.structure.anatomy import Motion
from aeolid.diagnose.structure.baseline import with_force
from aeolid.diagnose.structure.sums import factors_of, written_out
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations

Array = NDArray[np.float64]
_LEAST = 1e-4  # of what its ends move by: the size of a deformation that a rough run hardly shows


def motions_between(
    model: Equations, motions: Sequence[Motion], sizes: Array, rates: Array, moves: Array
) -> list[Motion]:
    """Return the deformations between bodies that have masses, each a motion whose force acts on both.

    A state whose derivative is a sum of such velocities (twist' = w_rotor − w_generator/ratio), or the difference of
    two positions of one unit where each body feels the other's. By virtual work a force on the deformation acts on each
    body times the factor of its velocity. sizes, rates: typical magnitude (n,) of each state and of its derivative;
    moves: covariance (n, n) of the states, from which the size of a difference is: two ends of a stiff joint move far
    and bend it little (an arm that turns by 0.4 rad, its joint by 0.03: the range of a cubic spring was too short).
    """
    bodies = {m.velocity.id: m for m in motions if isinstance(m.velocity, ast.Name) and m.mass is not None}
    found = []
    for i, state in enumerate(model.states):
        rate = written_out(state.derivative, model)
        factors = factors_of(rate, model, bodies)
        if len(factors) > 1:
            size = float(sizes[i]), float(rates[i])
            found.append(
                _between(model, state.name, (ast.Name(id=state.name), rate), bodies, factors, size, state.unit)
            )
    pairs = itertools.combinations(bodies.values(), 2)
    return found + [_apart(model, bodies, (a, b), moves) for a, b in pairs if _coupled(model, a, b)]


def _between(
    model: Equations, name: str, coordinates: tuple[ast.expr, ast.expr], bodies: Mapping[str, Motion],
    factors: Mapping[str, float], size: tuple[float, float], unit: str,
) -> Motion:  # fmt: skip
    """Return the motion; coordinates: its position and velocity, size: their typical magnitudes."""
    leader = max(factors, key=lambda v: abs(factors[v]))
    body = bodies[leader]
    forces = written_out(body.forces, model)
    if factors[leader] != 1.0:
        forces = ex.combine("/", forces, ast.Constant(factors[leader]))
    return Motion(
        f"state:{name}", coordinates[1], coordinates[0], _force_on(factors), body.force_name, body.force_unit, size[1],
        size[0], body.force_size, None, forces, body.mass, unit,
    )  # fmt: skip


def _apart(model: Equations, bodies: Mapping[str, Motion], ends: tuple[Motion, Motion], moves: Array) -> Motion:
    """Return the difference of two positions as a motion."""
    a, b = ends
    assert a.position is not None
    assert b.position is not None
    coordinates = ex.combine("-", a.position, b.position), ex.combine("-", a.velocity, b.velocity)
    sizes = (
        max(_difference(model, moves, a.position, b.position), _LEAST * max(a.position_size, b.position_size)),
        max(_difference(model, moves, a.velocity, b.velocity), _LEAST * max(a.velocity_size, b.velocity_size)),
    )
    name = f"{ex.to_text(a.position)}-{ex.to_text(b.position)}"
    factors = {ex.to_text(a.velocity): 1.0, ex.to_text(b.velocity): -1.0}
    return _between(model, name, coordinates, bodies, factors, sizes, a.position_unit)


def _difference(model: Equations, moves: Array, one: ast.expr, other: ast.expr) -> float:
    """Return the standard deviation of the difference of two states."""
    names = [s.name for s in model.states]
    i, j = (names.index(ex.to_text(end)) for end in (one, other))
    return float(np.sqrt(max(moves[i, i] + moves[j, j] - 2 * moves[i, j], 0.0)))


def _coupled(model: Equations, a: Motion, b: Motion) -> bool:
    """Tell whether each of two bodies feels where the other is."""
    if a.position is None or b.position is None or a.position_unit != b.position_unit:
        return False
    return all(
        ex.to_text(there) in ex.names_in(written_out(here.forces, model))
        for here, there in ((a, b.position), (b, a.position))
    )


def _force_on(factors: Mapping[str, float]) -> Callable[[Equations, ast.expr, str], Equations]:
    def inject(model: Equations, force: ast.expr, _: str) -> Equations:
        for velocity, factor in factors.items():
            part = force if factor == 1.0 else ex.combine("*", ast.Constant(factor), force)
            model = with_force(model, velocity, part)
        return model

    return inject
