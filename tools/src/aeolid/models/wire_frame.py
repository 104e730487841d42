"""Move a wire frame by a mode's complex shape, and say how far the shape is from a standing one.

A sensor at a point measures a = d·u, the part of the point's displacement u along its direction d. Of several sensors
at one point u is the shortest vector that explains all of them (least squares): their vector sum Σ a d where they are
perpendicular, their mean where they point alike. A direction that no sensor of a point looks along is drawn at rest.

Points without a sensor that a line passes straight on (within 30°, so that a bent chain of lines is one) move as knots
of a weightless taut string do: each is the mean of its neighbours along it with the weights 1/length, which is linear
interpolation along a straight line. Others stay, and so does what is fixed.

A recorded derivative of the displacement x(t) = Re(u exp(s t)) is turned into it by 1/s for a velocity and 1/s² for an
acceleration, s the continuous-time pole of the mode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import pinv
from aeolid.geometry import Geometry, Point, Sensor, Triple
from aeolid.models.modes import Mode
from aeolid.units import factor

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Indices = NDArray[np.intp]
DISPLACEMENT = "displacement"
REACH = 0.15  # of the frame's extent: how far the point that moves most is drawn from its place
_ONE_PLACE = 1e-6  # of the extent: nearer points are one
_ALIKE = 0.1  # of singular values: directions within some 11° tell one component, not two
_STRAIGHT = np.cos(np.radians(30.0))
_DERIVATIVES = ("m", "m/s", "m/s^2")
_MORE = {"mm/s": (1, 1e-3), "cm/s": (1, 1e-2), "um": (0, 1e-6), "um/s": (1, 1e-6), "mg": (2, 9.80665e-3)}


@dataclass(frozen=True, eq=False)
class Frame:
    """Hold a wire frame: positions (P, 3) in m, its edges as pairs of indices (E, 2), no two points at one place.

    sensors: of each its name, unit, index of the point and direction; fixed: (P,) what stays whatever moves; extent:
    the largest distance of two points in m, 1 where all is at one.
    """

    positions: Array
    edges: Indices
    sensors: tuple[tuple[str, str, int, Triple], ...]
    fixed: NDArray[np.bool_]
    extent: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Hold how a mode moves a frame: displacements (P, 3), complex, their best real axis the real one.

    The point that moves most has the amplitude √(|u_x|² + |u_y|² + |u_z|²) = 1. unit:
    DISPLACEMENT, or that of the sensors where it is no displacement; sensors: those it was made from. collinearity: the
    modal phase collinearity |Σ a²|²/(Σ |a|²)² (Pappa, Elliott and Schenk 1993) of the sensors' amplitudes a, 1 where
    all move in phase or against it, 0 for a wave that travels. phase_deviation_deg: their mean distance from the best
    real axis, weighted by |a| (Reynders, Houbrechts and De Roeck 2012), 0° for the one and some 45° for the other.
    derived: whether several derivatives were brought together.
    """

    displacement: ComplexArray
    unit: str
    sensors: tuple[str, ...]
    collinearity: float
    phase_deviation_deg: float
    derived: bool


def frame_of(geometry: Geometry) -> Frame:
    """Return the wire frame of a geometry: one point a place, lines cut at the points that lie on them.

    Cost: lines times points.
    """
    named: list[Sensor | Point] = [*geometry.sensors, *geometry.points]
    places = np.array([p.position for p in named], dtype=np.float64).reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(places, axis=0))) or 1.0
    rounded = np.round(places / (_ONE_PLACE * size))
    _, first, home = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    home = home.ravel()
    at = dict(zip((p.name for p in named), map(int, home), strict=True))
    positions = places[first]
    fixed = np.zeros(len(positions), dtype=bool)
    fixed[[at[p.name] for p in geometry.points if p.fixed]] = True
    edges: dict[tuple[int, int], None] = {}
    for start, end in geometry.lines:
        if start in at and end in at and at[start] != at[end]:
            knots = _along(positions, at[start], at[end], _ONE_PLACE * size)
            edges |= dict.fromkeys((min(a, b), max(a, b)) for a, b in pairwise(knots))
    pairs = np.array(list(edges), dtype=np.intp).reshape(-1, 2)
    sensors = tuple((s.name, s.unit, at[s.name], s.direction) for s in geometry.sensors)
    extent = max(float(np.linalg.norm(positions - p, axis=1).max()) for p in positions)
    return Frame(positions, pairs, sensors, fixed, extent if extent > 0 else 1.0)


def _along(positions: Array, start: int, end: int, near: float) -> list[int]:
    """Return the points on a line from its start to its end, in order."""
    way = positions[end] - positions[start]
    length = float(np.linalg.norm(way))
    share = (positions - positions[start]) @ way / length**2
    off = np.linalg.norm(positions - positions[start] - share[:, None] * way, axis=1)
    on = np.flatnonzero((off < near) & (share > 0) & (share < 1))
    between = [int(i) for i in on[np.argsort(share[on])] if i not in (start, end)]
    return [start, *between, end]


def motions(frame: Frame, shape: Mapping[str, complex], s: complex) -> list[Motion]:
    """Return how a mode moves a frame: once for all sensors of displacements, once for each other unit.

    shape: complex amplitude of each output in its unit; sensors that it lacks count as none. s: the mode's pole in
    rad/s. Amplitudes of displacements, velocities and accelerations are all brought to displacements. Empty where no
    sensor of the frame has an amplitude. Cost: the cube of the number of points without a sensor.
    """
    groups: dict[str, list[tuple[str, int, int, Triple, complex]]] = {}
    for name, unit, point, direction in frame.sensors:
        value = complex(shape.get(name, np.nan))
        order, size = _derivative(unit)
        if not np.isfinite(value) or (order and s == 0):
            continue
        amplitude = value if order is None else value * size / s**order
        key = DISPLACEMENT if order is not None else unit
        groups.setdefault(key, []).append((name, -1 if order is None else order, point, direction, amplitude))
    found = [_motion(frame, unit, group) for unit, group in groups.items()]
    return [motion for motion in found if motion is not None]


def _derivative(unit: str) -> tuple[int | None, float]:
    """Return which derivative of a displacement a unit is of, None for another quantity, and its size in m, m/s, …."""
    if unit in _MORE:
        return _MORE[unit]
    for order, base in enumerate(_DERIVATIVES):
        size = factor(unit, base)
        if size is not None:
            return order, size
    return None, 1.0


def _motion(
    frame: Frame, unit: str, group: Sequence[tuple[str, int, int, Triple, complex]]
) -> Motion | None:  # fmt: skip
    names, orders, points, directions, amplitudes = zip(*group, strict=True)
    a = np.array(amplitudes, dtype=np.complex128)
    if not abs(a).max() > 0:
        return None
    a = to_real_axis(a / abs(a).max())
    u, at = np.zeros(frame.positions.shape, dtype=np.complex128), np.array(points)
    D, count = np.array(directions), np.bincount(at, minlength=len(u))
    single = count[at] == 1
    u[at[single]] = D[single] * a[single, None]
    for point in np.flatnonzero(count > 1):
        mine = at == point  # D[mine] (sensors, 3)
        u[point] = pinv(D[mine], rcond=_ALIKE) @ a[mine]
    u[frame.fixed] = 0.0
    u = _interpolated(frame, u, at)
    largest = float(np.linalg.norm(u, axis=1).max())
    return Motion(
        u / largest if largest > 0 else u, unit, names, collinearity(a), phase_deviation(a), len(set(orders)) > 1
    )  # fmt: skip


def _interpolated(frame: Frame, u: ComplexArray, moved: Indices) -> ComplexArray:
    """Return displacements with those of points that lines pass: W_ff u_f − diag(Σ w) u_f = −W_fk u_k."""
    W = _straight_on(frame)
    W[frame.fixed] = 0.0
    W[moved] = 0.0
    free = _follow(W)
    if not free.any():
        return u
    L = np.diag(W[free].sum(axis=1)) - W[np.ix_(free, free)]
    out = u.copy()
    out[free] = np.linalg.solve(L, W[np.ix_(free, ~free)] @ u[~free])
    return out


def _straight_on(frame: Frame) -> Array:
    """Return the weights 1/length (P, P) of each point's neighbours whose edge another one of it goes on from."""
    count = len(frame.positions)
    around: list[list[int]] = [[] for _ in range(count)]
    for a, b in frame.edges.tolist():
        around[a].append(b)
        around[b].append(a)
    W = np.zeros((count, count))
    for i, near in enumerate(around):
        if len(near) < 2:
            continue
        ways = frame.positions[near] - frame.positions[i]
        length = np.linalg.norm(ways, axis=1)
        along = ways / length[:, None]
        goes_on = (along @ along.T).min(axis=1) < -_STRAIGHT
        W[i, np.array(near)[goes_on]] = 1 / length[goes_on]
    return W


def _follow(W: Array) -> NDArray[np.bool_]:
    """Return which points (P,) are moved by others: they have weights, and by them a way to one that has none."""
    led: list[list[int]] = [[] for _ in W]
    for i, k in zip(*np.nonzero(W), strict=True):
        led[k].append(int(i))
    weighted = np.asarray(W.any(axis=1), dtype=bool)
    met = ~weighted
    waiting = np.flatnonzero(met).tolist()
    while waiting:
        for i in led[waiting.pop()]:
            if not met[i]:
                met[i] = True
                waiting.append(i)
    out: NDArray[np.bool_] = met & weighted
    return out


def to_real_axis(a: ComplexArray) -> ComplexArray:
    """Return amplitudes turned so that Σ (Re a)² is largest, the largest real part positive: a·exp(−½ i arg Σ a²)."""
    turned = a * np.exp(-0.5j * np.angle((a**2).sum()))
    largest = turned.real.flat[int(np.argmax(abs(turned.real)))]
    out: ComplexArray = turned if largest >= 0 else -turned
    return out


def collinearity(a: ComplexArray) -> float:
    """Return the modal phase collinearity of amplitudes of one quantity, 0 … 1."""
    return float(abs((a**2).sum()) ** 2 / (abs(a) ** 2).sum() ** 2)


def phase_deviation(a: ComplexArray) -> float:
    """Return the mean distance in degrees of amplitudes from their best real axis, weighted by their size."""
    turned, size = to_real_axis(a), abs(a)
    away = np.degrees(np.arctan2(abs(turned.imag), abs(turned.real)))
    return float((size * away).sum() / size.sum())


def mode_motions(frame: Frame, mode: Mapping[str, Any]) -> list[Motion]:
    """Return `motions` of a mode given as JSON facts (`Mode.to_json`); empty where it has no shape."""
    told = (mode.get("shape") or {}).get("outputs") or {}
    values = {name: complex(entry["re"], entry["im"]) for name, entry in told.items()}
    damping = float(mode["damping"])
    omega = 2 * np.pi * float(mode["frequency_hz"])
    return motions(frame, values, complex(-damping * omega, omega * np.sqrt(max(1 - damping**2, 0.0))))


def geometry_facts(geometry: Geometry | None, modes: Sequence[Mode]) -> dict[str, Any]:
    """Return what JSON facts of modes say of a geometry: itself, and for each mode how complex its shape is on it.

    Empty where there is none.
    """
    if geometry is None:
        return {}
    frame = frame_of(geometry)
    told = [
        {"frequency_hz": mode.frequency_hz, "unit": m.unit, "sensors": list(m.sensors),
         "collinearity": m.collinearity, "phase_deviation_deg": m.phase_deviation_deg}
        for mode in modes for m in mode_motions(frame, mode.to_json())
    ]  # fmt: skip
    return {"geometry": geometry.to_json(), "complexity": told}


def complexity_lines(geometry: Geometry | None, modes: Sequence[Mode]) -> list[str]:
    """Return how complex the shapes are on a geometry as lines of text; none where there is none."""
    told = geometry_facts(geometry, modes).get("complexity")
    if not told:
        return []
    lines = ["  on the structure (modal phase collinearity, mean phase deviation):"]
    for one in told:
        unit = "" if one["unit"] == DISPLACEMENT else f" in {one['unit'] or 'no unit'}"
        lines.append(
            f"    {one['frequency_hz']:.4g} Hz{unit}: {100 * one['collinearity']:.3g} %, "
            f"{one['phase_deviation_deg']:.2g} degrees"
        )
    return lines
