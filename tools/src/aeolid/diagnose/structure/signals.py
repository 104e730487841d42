"""Find where a model without states moves: recorded positions and velocities, and outputs that follow them at once.

A static law (force = c·velocity + k·displacement) has no equation of motion for a friction or a stop to act on; what it
moves along is recorded. Each output that depends on no state, and that is a balance of forces, is the force over every
such coordinate. Springs and friction have no meaning in the equation of a rate, a position or a temperature: it is
kinematics or a sensor's curve, and what it lacks there are lags, delays and curves of its inputs. An output balances
forces where its unit is one of a force, moment, pressure or acceleration. A unit that does not say (none, a number, the
volts or amperes of a drive or of a sensor) leaves it to the name: an output called a speed, an angle, a level does not.
"""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq, pinv
from aeolid.diagnose.data.exogenous import Exogenous
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.data.shaft_angle import ROLE as SHAFT_ANGLE
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import Motion, base_unit
from aeolid.models import expressions as ex
from aeolid.models.equations import STEP, TIME, Equations, Memory, Output

Array = NDArray[np.float64]
_LENGTHS = {"m", "mm", "cm", "um", "µm", "km", "in", "inch", "ft", "rad", "mrad", "deg", "°", "rev", "ticks"}
_SPEEDS = {f"{u}/s" for u in _LENGTHS} | {"rpm", "1/min", "rad/min"}
_POSITION = re.compile(r"displ|posit|deflec|stroke|travel|angle|stretch|twist|elong", re.IGNORECASE)
_SPEED = re.compile(r"veloc|speed", re.IGNORECASE)
_MOST = 4  # coordinates of one output
_WINDOWS = (3, 5, 9, 15, 25)  # rows that a derivative looks at; the first that is quiet enough is taken
_NOISE = 0.01  # of a velocity's spread, that a derivative may have; whitened, its high frequencies count most
_ROUNDING = 1e-9  # of a position's spread
_THIRD = np.sqrt(20.0)  # spread of white noise's third differences over its own
_FORCES = {
    *("N", "kN", "MN", "mN", "lb", "lbf", "klb", "kip", "kips", "kgf", "tf", "dyn", "Pa", "kPa", "MPa", "bar", "psi"),
    *("m/s^2", "mm/s^2", "cm/s^2", "in/s^2", "ft/s^2", "rad/s^2", "deg/s^2", "g", "mg"),
    *(
        "Nm",
        "kNm",
        "MNm",
        "mNm",
        "Nmm",
        "Ncm",
        "kgfm",
        "lbft",
        "lbfft",
        "ftlb",
        "lbin",
        "inlb",
        "kipin",
        "kipft",
        "ozin",
    ),
}
_SAYS_NOTHING = {"", "1", "-", "%", "V", "mV", "kV", "A", "mA", "counts", "count", "pu"}
_MOVEMENT = re.compile(
    r"displ|posit|deflec|stroke|travel|angle|stretch|twist|elong|veloc|speed|(?<![a-z])(rate|rpm|temp|level|height)",
    re.IGNORECASE,
)
_ELSEWHERE = re.compile(
    r"flow|power|concentr|humid|(?<![a-z])(yaw|pitch|roll|heading|azimuth|angular)(?![a-z])", re.IGNORECASE
)
_FORCE = re.compile(r"force|torque|moment|load|thrust|tension|accel|pressure|stress|reaction", re.IGNORECASE)
_LABELS = {"N": "force_N", "kN": "force_kN", "Nm": "torque_N_m"}


@dataclass(frozen=True, eq=False)
class Coordinate:
    """Hold what is recorded of a movement: its expressions in the model, and their values on each stretch.

    memories: what the model must remember to know its velocity; direction: its sign, where that is not recorded.
    """

    name: str
    unit: str
    position: ast.expr | None
    velocity: ast.expr
    q: tuple[Array, ...]
    v: tuple[Array, ...]
    memories: tuple[Memory, ...] = ()
    direction: ast.expr | None = None


@dataclass(frozen=True, eq=False)
class _Channel:
    name: str
    unit: str
    symbol: str
    values: tuple[Array, ...]


def static_outputs(model: Equations) -> list[int]:
    """List the outputs that follow inputs at once and depend on no state or memory."""
    slow = {s.name for s in model.states} | {m.name for m in model.memories}
    found = []
    for j, output in enumerate(model.outputs):
        seen = ex.names_in(output.equation)
        for a in reversed(model.auxiliaries):
            seen |= ex.names_in(a.equation) if a.name in seen else set()
        if not seen & slow and seen & set(model.symbols):
            found.append(j)
    return found


def balances_forces(name: str, unit: str) -> bool:
    """Tell whether an output is a balance of forces, by its unit or, where that does not say, by its name."""
    plain = re.sub(r"[\s*·.]", "", unit.replace("**", "^").replace("²", "^2").replace("s2", "s^2"))
    if plain not in _SAYS_NOTHING:
        return plain in _FORCES
    return not _MOVEMENT.search(name) and (bool(_FORCE.search(name)) or not _ELSEWHERE.search(name))


def motions_of_signals(
    model: Equations, exogenous: Sequence[Exogenous], segments: Sequence[Segment], units: Mapping[str, str]
) -> tuple[tuple[Motion, ...], Equations]:
    """Return a motion for each static output over each recorded coordinate, and the model that knows the velocities.

    segments: u holds the model's inputs first, then the exogenous channels; units of the channels by name.
    """
    shown = [(j, model.outputs[j].name, model.outputs[j].unit) for j in static_outputs(model)]
    outputs = [j for j, name, unit in shown if balances_forces(name, unit or units.get(name, ""))]
    if not outputs:
        return (), model
    found = _coordinates(_channels(model, exogenous, segments, units), segments[0].step)
    for c in found:
        model = _remembering(model, c.memories)
    pairs = [(j, c) for j in outputs for c in found]
    return tuple(_motion(model, j, c, segments, several=len(outputs) > 1) for j, c in pairs), model


def _channels(
    model: Equations, exogenous: Sequence[Exogenous], segments: Sequence[Segment], units: Mapping[str, str]
) -> list[_Channel]:
    """Return the recorded channels that move, as the rows of y see them."""
    own = [(s.name, s.unit, symbol) for s, symbol in zip(model.inputs, model.symbols, strict=True)]
    own += [(c.name, c.unit, c.symbol) for c in exogenous]
    computed = {c.name for c in exogenous if c.role == SHAFT_ANGLE}
    found = []
    for i, (name, unit, symbol) in enumerate(own):
        if name in computed:
            continue
        values = tuple(s.u[:: s.stride, i][: len(s.y)] for s in segments)
        whole = np.concatenate(values)
        if name != TIME and np.all(np.isfinite(whole)) and np.std(whole) > 0:
            found.append(_Channel(name, (unit or units.get(name, "")).replace(" ", ""), symbol, values))
    return found


def _coordinates(channels: Sequence[_Channel], step: float) -> list[Coordinate]:
    data = in_force().data
    positions = [c for c in channels if _is(c, _LENGTHS, _POSITION)]
    velocities = [c for c in channels if c not in positions and _is(c, _SPEEDS, _SPEED)]
    found, used = [], set()
    for p in positions:
        best = max(velocities, key=lambda v: abs(_likeness(p, v, step)), default=None)
        if best is not None and abs(_likeness(p, best, step)) > data.recognised_correlation:
            used.add(best.name)
            found.append(_recorded(p, best, step))
        else:
            found.append(_derived(p.name, p.unit, p.symbol, (ast.Name(id=p.symbol), p.values), step))
    for a, b in itertools.combinations(found[:], 2):
        if a.unit == b.unit and a.position is not None and b.position is not None:
            found.append(_apart(a, b, step))
    alone = [v for v in velocities if v.name not in used]
    return [*found[:_MOST], *(_moving(v, step) for v in alone)][:_MOST]


def _is(channel: _Channel, units: set[str], words: re.Pattern[str]) -> bool:
    known = channel.unit not in ("", "1", "-")
    return channel.unit in units if known else bool(words.search(channel.name))


def _rates(values: Sequence[Array], step: float) -> Array:
    return np.concatenate([np.gradient(x, step) for x in values])


def _likeness(p: _Channel, v: _Channel, step: float) -> float:
    return float(np.corrcoef(_rates(p.values, step), np.concatenate(v.values))[0, 1])


def _recorded(p: _Channel, v: _Channel, step: float) -> Coordinate:
    """Return a position with its recorded velocity, in the position's unit a second."""
    rate, whole = _rates(p.values, step), np.concatenate(v.values)
    whole = whole - whole.mean()
    factor = float(whole @ rate / (whole @ whole))
    # noise on the position takes a few percent
    factor = 1.0 if abs(factor - 1) < in_force().data.known_ratio_distance else factor
    velocity: ast.expr = ast.Name(id=v.symbol)
    if factor != 1.0:
        velocity = ex.combine("*", ast.Constant(float(f"{factor:.6g}")), velocity)
    return Coordinate(
        p.name, p.unit, ast.Name(id=p.symbol), velocity, p.values, tuple(factor * x for x in v.values)
    )  # fmt: skip


def _derived(name: str, unit: str, tag: str, followed: tuple[ast.expr, tuple[Array, ...]], step: float) -> Coordinate:
    """Return a position whose velocity the model works out: the slope of a parabola through its last rows.

    It has no delay (a lag of one row made a clock offset of one beside dry friction, 9.5 ms at 100 Hz). As few rows
    are taken as the noise on the position allows.
    """
    position, values = followed
    rate = np.concatenate([np.diff(x) / step for x in values])
    noise = float(np.std(np.concatenate([np.diff(x, 3) for x in values]))) / _THIRD / step
    quiet = [w for w in _WINDOWS if np.linalg.norm(_slope(w)) * noise < _NOISE * float(np.std(rate))]
    weights = _slope(quiet[0] if quiet else _WINDOWS[-1])
    past = [f"{tag}_{k}_before" for k in range(1, len(weights))]
    lagged = [f"({ex.to_text(position)})", *past]
    speed = " + ".join(f"{c!r}*{x}" for c, x in zip(weights.tolist(), lagged, strict=True))
    shifted = [Memory(n, unit, ex.parse(x, "derivative"), position) for n, x in zip(past, lagged, strict=False)]
    rated = Memory(f"{tag}_rate", f"{unit}/s", ex.parse(f"({speed})/{STEP}", "derivative"), ast.Constant(0.0))
    v = tuple(np.convolve(np.concatenate([np.full(len(past), x[0]), x]), weights, "valid") / step for x in values)
    spread = float(np.std(np.concatenate(values)))
    reach = float(max(in_force().evidence.noise_deviations * noise * step, _ROUNDING * spread))
    slid, way = _followed(tag, unit, position, reach)
    return Coordinate(name, unit, position, ast.Name(id=rated.name), values, v, (slid, rated, *reversed(shifted)), way)


def _followed(tag: str, unit: str, position: ast.expr, reach: float) -> tuple[Memory, ast.expr]:
    """Return a slider that a position drags along at a distance, and the way it points: the sign of the velocity.

    It turns when the position has come back by twice the reach, not with each error of a difference of two rows.
    """
    slider, q = f"{tag}_slider", f"({ex.to_text(position)})"
    follow = ex.parse(f"min(max({slider}, {q} - {reach!r}), {q} + {reach!r})", "derivative")
    way = ex.parse(f"min(max(({q} - {slider})/{reach!r}, -1), 1)", "derivative")
    return Memory(slider, unit, follow, position), way


def _slope(window: int) -> Array:
    """Return weights (window,) of the newest row and those before it: slope of the fitted parabola at the newest."""
    rows = -np.arange(window, dtype=np.float64)
    result: Array = pinv(np.vander(rows, 3, increasing=True))[1]
    return result


def _apart(a: Coordinate, b: Coordinate, step: float) -> Coordinate:
    """Return the difference of two positions."""
    assert a.position is not None
    assert b.position is not None
    name, position = f"{a.name}-{b.name}", ex.combine("-", a.position, b.position)
    q = tuple(x - y for x, y in zip(a.q, b.q, strict=True))
    if a.memories or b.memories:
        tag = f"{ex.to_text(a.position)}_{ex.to_text(b.position)}"
        return _derived(name, a.unit, tag, (position, q), step)
    v = tuple(x - y for x, y in zip(a.v, b.v, strict=True))
    return Coordinate(name, a.unit, position, ex.combine("-", a.velocity, b.velocity), q, v)


def _moving(v: _Channel, step: float) -> Coordinate:
    """Return a velocity without a position; how far it goes is known, from its changes."""
    q = tuple(np.cumsum(x - x.mean()) * step for x in v.values)
    return Coordinate(v.name, base_unit(v.unit), None, ast.Name(id=v.symbol), q, v.values)


def _remembering(model: Equations, memories: Sequence[Memory]) -> Equations:
    known = {m.name for m in model.memories}
    return replace(model, memories=(*(m for m in memories if m.name not in known), *model.memories))


def _motion(model: Equations, j: int, c: Coordinate, segments: Sequence[Segment], *, several: bool) -> Motion:
    """Return the motion; its force is what resists it, so that a recorded force that drives it shows it reversed."""
    output = model.outputs[j]
    y, q, v = np.concatenate([s.y[:, j] for s in segments]), np.concatenate(c.q), np.concatenate(c.v)
    sign = _sign(y, q, v)
    forces = output.equation if sign < 0 else ast.UnaryOp(op=ast.USub(), operand=output.equation)
    unit = output.unit.replace(" ", "")
    low, high = (float(x) for x in np.quantile(q, [0.001, 0.999]))
    return Motion(
        f"motion:{c.name}, output:{output.name}" if several else f"motion:{c.name}", c.velocity, c.position,
        _acting_on(output.name, sign, c.memories), _LABELS.get(unit, "force"), output.unit, float(np.std(v)),
        float(np.std(q)), float(np.nanstd(y)), None, forces, None, c.unit,
        recorded=(low, high) if c.position is not None else (0.0, 0.0), direction=c.direction,
    )  # fmt: skip


def _sign(y: Array, q: Array, v: Array) -> float:
    """Return 1 where the output grows with position or velocity (what drives them), −1 where it falls (a reaction)."""
    good = np.isfinite(y)
    moving = [(x - x.mean()) / max(float(x.std()), 1e-300) for x in (q[good], v[good])]
    weights = lstsq(np.column_stack([*moving, np.ones(int(good.sum()))]), y[good])[:2]
    return 1.0 if weights[int(np.argmax(np.abs(weights)))] >= 0 else -1.0


def _acting_on(
    name: str, sign: float, memories: Sequence[Memory]
) -> Callable[[Equations, ast.expr, str], Equations]:  # fmt: skip
    def inject(model: Equations, force: ast.expr, _: str) -> Equations:
        def felt(o: Output) -> Output:
            return replace(o, equation=ex.combine("-" if sign > 0 else "+", o.equation, force))

        outputs = tuple(felt(o) if o.name == name else o for o in model.outputs)
        return replace(_remembering(model, memories), outputs=outputs)

    return inject
