"""Modes behind a static law: how many of them the inputs drive, where they start, how they enter the output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.signal import lfilter, welch

from aeolid.decompositions import lstsq
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.forces import with_parameters
from aeolid.diagnose.hypotheses.parts.modes import RINGS, highest_hz
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.structure.anatomy import ACCELERATION_UNITS
from aeolid.diagnose.structure.signals import static_outputs
from aeolid.models import expressions as ex
from aeolid.models.equations import TIME, Equations, State

Array = NDArray[np.float64]
Modes = tuple[tuple[float, float], ...]  # frequency in Hz and damping ratio of each

MOST_MODES = 3
_LEAST_DAMPING = 1e-4
_ORDERS = (4, 8, 12, 20)  # of the autoregressions whose poles are tried, beside an even grid
_GRID_HZ, _GRID_DAMPING = 24, (0.01, 0.05, 0.2)
_ROWS = 4000  # of the recording that the search looks at
_GONE = -60.0  # logarithm of a start that nobody sees any more; smaller numbers are slow
_RIDGE = 1e-12  # of the mean square of the regressors: two that are alike share
_STEPS = 120  # of a simplex, for each number of modes
_BINS = 256
_VALUES = 2  # of a mode itself; each input that drives it has two more


@dataclass(frozen=True, eq=False)
class _Seen:
    """Hold one output and what may drive its modes: y (N,), drives (N, r) of unit size, low and high in Hz."""

    y: Array
    drives: Array
    step: float
    low: float
    high: float


def behind_static(site: Site) -> list[Attachment]:
    """Return, for each output that follows inputs at once, one, two and three modes, as far as each more is worth it.

    Each starts where it explains most of the simulated output (orthogonal matching pursuit over the poles of
    autoregressions and a grid), then all frequencies and dampings are refined together, their shares being linear
    (variable projection). Worth it by the criterion of Schwarz on the squares of the simulation error.
    """
    rules = in_force().hypotheses
    driving = [i for i, name in enumerate(site.input_names) if name != TIME and np.std(site.u[:, i]) > 0]
    found = []
    for j in static_outputs(site.model) if site.linear is None and driving else []:
        seen = _seen(site, j, driving)
        pool, cost = _pool(seen), _cost(seen, ())
        modes: Modes = ()
        for _ in range(MOST_MODES if seen.high > rules.least_band * seen.low else 0):
            more = _one_more(seen, pool, modes)
            least = _cost(seen, more)
            gained = _left(seen, modes)[0] - _left(seen, more)[0]
            trifle = gained < rules.mode_variance_share * float(np.var(seen.y))
            if trifle or _objection(more, seen.high) or least >= cost:
                break
            modes, cost = more, least
            found.append(_attachment(site, j, driving, seen, modes))
    return found


def _seen(site: Site, j: int, driving: list[int]) -> _Seen:
    stride = max(round(site.row_step / site.step), 1)
    y, u = site.y[:_ROWS, j], site.u[::stride, driving][: min(len(site.y), _ROWS)]
    y = np.where(np.isfinite(y), y, np.nanmean(y))
    slowest = 4.0 / (len(y) * site.row_step)
    drives = (u - u.mean(axis=0)) / np.maximum(u.std(axis=0), 1e-300)
    return _Seen(y, drives, site.row_step, slowest, min(highest_hz(site), _excited_hz(drives, site.row_step)))


def _excited_hz(drives: Array, step: float) -> float:
    """Return up to where the inputs excite: 40 dB below their strongest band. Beyond, a mode is a residual term."""
    hz, power = welch(drives, fs=1 / step, nperseg=min(len(drives), _BINS), axis=0)
    return float(hz[np.any(power > in_force().hypotheses.excited_share * power.max(axis=0), axis=1)].max())


def _pool(seen: _Seen) -> list[tuple[float, float]]:
    """Return modes to try: the poles of autoregressions with inputs, and a grid."""
    hz = np.geomspace(1.5 * seen.low, seen.high / 1.05, _GRID_HZ)
    found = [(float(f), d) for f in hz for d in _GRID_DAMPING]
    for order in _ORDERS:
        if len(seen.y) > 20 * order * (1 + seen.drives.shape[1]):
            found += _poles(seen, order)
    return found


def _poles(seen: _Seen, order: int) -> list[tuple[float, float]]:
    rows = len(seen.y) - order
    past = [seen.y[order - k : order - k + rows] for k in range(1, order + 1)]
    driven = [seen.drives[order - k : order - k + rows] for k in range(order + 1)]
    regressors = np.column_stack([*past, *driven, np.ones(rows)])
    weights = lstsq(regressors, seen.y[order:])[:order]
    poles = np.roots(np.concatenate([[1.0], -weights]))
    rates = np.log(poles[poles.imag > 0]) / seen.step
    modes = [(float(abs(s) / (2 * np.pi)), float(-s.real / abs(s))) for s in rates]
    inside = [(f, min(max(d, _LEAST_DAMPING), RINGS)) for f, d in modes if d < RINGS]
    return [(f, d) for f, d in inside if seen.low < f < seen.high]


def _columns(seen: _Seen, f: float, damping: float) -> Array:
    """Return what a mode can make of the drives and of a start of its own: (N, 2 r + 2)."""
    pole = np.exp(2 * np.pi * f * seen.step * (-damping + 1j * np.sqrt(1 - damping**2)))
    moved = lfilter([0.0, 1.0], [1.0, -pole], seen.drives.astype(complex), axis=0)
    turned = np.log(pole) * np.arange(len(seen.y))
    decay = np.exp(np.maximum(turned.real, _GONE)) * np.exp(1j * turned.imag)
    return np.column_stack([moved.real, moved.imag, decay.real, decay.imag])


def _left(seen: _Seen, modes: Modes) -> tuple[float, Array]:
    """Return the mean square of the simulation error with these modes, and the error (N,)."""
    static = np.column_stack([seen.drives, np.ones(len(seen.y))])
    regressors = np.column_stack([static, *(_columns(seen, *m) for m in modes)])
    gram = regressors.T @ regressors
    gram += _RIDGE * np.diag(np.diag(gram))
    error = seen.y - regressors @ np.linalg.solve(gram, regressors.T @ seen.y)
    return float(np.mean(error**2)), error


def _cost(seen: _Seen, modes: Modes) -> float:
    values = len(modes) * (_VALUES + 2 * seen.drives.shape[1])
    return 0.5 * float(len(seen.y) * np.log(max(_left(seen, modes)[0], 1e-300)) + values * np.log(len(seen.y)))


def _one_more(seen: _Seen, pool: list[tuple[float, float]], modes: Modes) -> Modes:
    error = _left(seen, modes)[1]

    def explained(mode: tuple[float, float]) -> float:
        basis = np.linalg.qr(_columns(seen, *mode))[0]
        return float(np.sum((basis.T @ error) ** 2))

    start = np.log(np.array([*modes, max(pool, key=explained)])).ravel()

    def cost(logs: Array) -> float:
        tried = np.exp(logs).reshape(-1, 2)
        good = np.all((tried[:, 0] > seen.low) & (tried[:, 0] < seen.high) & (tried[:, 1] < RINGS))
        if not good:
            return 1e3
        return float(np.log(_left(seen, tuple((float(f), float(d)) for f, d in tried))[0]))

    simplex = np.vstack([start, start + np.diag(np.tile([0.01, 0.2], len(start) // 2))])
    found = minimize(cost, start, method="Nelder-Mead", options={"maxfev": _STEPS * len(start) // 2,
                     "initial_simplex": simplex})  # fmt: skip
    best = np.exp(found.x if found.fun < cost(start) else start).reshape(-1, 2)
    return tuple((float(f), float(max(d, _LEAST_DAMPING))) for f, d in best)


def _attachment(site: Site, j: int, driving: list[int], seen: _Seen, modes: Modes) -> Attachment:
    """Return the hypothesis of so many modes, each driven by every input and its rate.

    A mode with a rate of its own in the drive has any phase: samples that lie between rows, poles further up.
    """
    name, count = site.output_names[j], len(modes)
    tags = [f"response{count}_{j + 1}_{k + 1}" for k in range(count)]
    slots: list[Slot] = []
    start: dict[str, float] = {}
    for k, (tag, (f, damping)) in enumerate(zip(tags, modes, strict=True)):
        order = "" if k == 0 else f"_{k + 1}"
        slots += [
            Slot(f"{tag}_hz", f"frequency{order}_hz", "Hz", f, seen.low, seen.high, f / 3, local=False),
            Slot(f"{tag}_damping", f"damping{order}", "1", damping, _LEAST_DAMPING, RINGS, 0.02, local=False),
        ]
        slots += [Slot(f"{tag}_{way}{i + 1}", None, "", 0.0, -1e4, 1e4, 1e-3) for i in driving for way in ("b", "c")]
        start |= {f"{tag}_hz": f, f"{tag}_damping": damping}
    parts = tuple(f"{tag}_{what}" for tag in tags for what in ("q", "v"))
    kind = f", {count} modes" if count > 1 else ", driven"
    return Attachment(
        "structural_mode", f"structural_mode output:{name}{kind}", location(f"output:{name}", outputs=(name,)),
        partial(_with_modes, site, j, driving, tags, tuple(slots)), tuple(slots), start_states=parts, grid=(start,),
        equation="q'' + 2*damping*w*q' + w^2*q = w^2*(b*u + c*u'/w), w = 2*pi*frequency_hz, for each mode",
        statement=partial(_says, name, count), credible=partial(_not_modes, count, seen.high),
    )  # fmt: skip


def _objection(modes: Modes, high: float) -> str:
    """Say why these are not so many modes: one at the end of what is excited, one as broad as it may be, or two alike.

    Two nearer to each other than their half-power bandwidths show one peak (Ewins 2000, section 3.3).
    """
    rules = in_force().hypotheses
    for k, (f, damping) in enumerate(modes):
        if f > rules.range_end * high:
            return f"the inputs do not excite what lies beyond {high:.4g} Hz, and a mode ran there"
        if damping > rules.range_end * RINGS:
            return f"a mode at {f:.4g} Hz does not ring"
        for other, broad in modes[:k]:
            if abs(f - other) < damping * f + broad * other:
                return f"modes at {other:.4g} and {f:.4g} Hz are nearer to each other than they are broad"
    return ""


def _not_modes(count: int, high: float, p: Mapping[str, float]) -> str:
    orders = ["", *(f"_{k}" for k in range(2, count + 1))]
    return _objection(tuple((p[f"frequency{o}_hz"], p[f"damping{o}"]) for o in orders), high)


def _says(name: str, count: int, p: Mapping[str, float]) -> str:
    orders = ["", *(f"_{k}" for k in range(2, count + 1))]
    said = [f"{p[f'frequency{o}_hz']:.4g} Hz (damping {p[f'damping{o}']:.2g})" for o in orders]
    if count == 1:
        return f"a mode at {said[0]} shows in {name}; the model follows its inputs at once"
    return f"modes at {', '.join(said[:-1])} and {said[-1]} show in {name}; the model follows its inputs at once"


def _with_modes(
    site: Site, j: int, driving: list[int], tags: list[str], slots: tuple[Slot, ...], model: Equations
) -> Equations:
    """Write each mode as q' = w (v + c·u), v' = w (b·u − q − 2 damping v), in the output's size and the inputs'."""
    name, spread = site.output_names[j], float(np.nanstd(site.y[:, j])) or 1.0
    unit = model.outputs[[o.name for o in model.outputs].index(name)].unit.replace(" ", "")
    drives = {i: f"({site.symbols[i]} - {float(site.u[:, i].mean())!r})/{float(site.u[:, i].std())!r}" for i in driving}
    states, shown = [], []
    for tag in tags:
        q, v, w = f"{tag}_q", f"{tag}_v", f"(2*pi*{tag}_hz)"
        b, c = (" + ".join(f"{tag}_{way}{i + 1}*{drives[i]}" for i in driving) for way in ("b", "c"))
        pull = f"{b} - {q} - 2*{tag}_damping*{v}"
        forms = (q, f"{w}*({v} + {c})"), (v, f"{w}*({pull})")
        states += [State(n, "", ex.parse(f, "mode"), 0.0, True) for n, f in forms]
        shown.append(f"({pull})" if unit in ACCELERATION_UNITS else q)
    seen = ex.parse(f"{spread!r}*({' + '.join(shown)})", "mode")
    outputs = tuple(replace(o, equation=ex.combine("+", o.equation, seen)) if o.name == name else o
                    for o in model.outputs)  # fmt: skip
    return replace(with_parameters(model, slots), states=(*model.states, *states), outputs=outputs)
