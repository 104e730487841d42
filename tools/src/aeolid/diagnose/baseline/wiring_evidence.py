"""Say what a wiring of a recording's channels is worth: the baseline's prediction, whitened by an autoregression.

The baseline predicts the transformed recording, and a vector autoregression whitens what it leaves over, so that
unmeasured forces of any colour cost every wiring the same. The evidence is the Gaussian log-likelihood of the
autoregression's innovations of covariance S, −N/2 log det S + N Σ log|f_j| for outputs multiplied by f_j. A lag of an
input, which the model may lack besides, turns phases and would be taken for a sign: every wiring, the declared one too,
may have one.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.diagnose.baseline.wiring_columns import Sensor, Wiring, all_behind, one_behind
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.data.held import discretise
from aeolid.diagnose.predictor.riccati import steady_gain
from aeolid.diagnose.rules import in_force
from aeolid.errors import DataError
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate
from aeolid.models.recursion import run_states
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]
PARTS = 10  # stretches into which evidence is told
_LAGS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # time constants of one input's lag, samples; none is off by more than √2
_MOST_ROWS = 20_000  # of all recordings: more make no sign clearer
_KEPT = 3  # wirings of the inputs whose simulations are kept: some tens of megabytes at most


class Judge:
    """Hold a baseline and recordings, and say what each wiring is worth."""

    def __init__(
        self, model: StateSpace | Equations, blocks: Sequence[tuple[Array, Array]], step: float,
        units: Mapping[str, str] = MappingProxyType({}), reach: int = 0,
    ) -> None:  # fmt: skip
        """units: those that the roles give the channels; `stated` has them where the model has none.

        reach: rows by which an output's column may be asked to be late or early; as many do not count at either end.
        """
        self.model, self.blocks, self.step, self.reach = model, blocks, step, reach
        self.names = [s.name for s in model.inputs], [s.name for s in model.outputs]
        self.stated = tuple([s.unit or units.get(s.name, "") for s in part] for part in (model.inputs, model.outputs))
        r, m = len(self.names[0]), len(self.names[1])
        self.declared = Wiring(
            (1.0,) * r, (1.0,) * m, tuple(range(r)), tuple(range(m)), (0.0,) * r, (0.0,) * m
        )  # fmt: skip
        self._gain = _observer(model, blocks) if isinstance(model, StateSpace) else None
        self._compiled = compile_equations(model) if isinstance(model, Equations) else None
        self._runs: dict[object, dict[object, Array | None]] = {}
        self.skip = max(self._settled(), reach)

    def _settled(self) -> int:
        """Return the samples after which the start no longer counts; at most a fifth of the shortest recording."""
        shortest = min(len(u) for u, _ in self.blocks)
        if not isinstance(self.model, StateSpace) or self._gain is None:
            return shortest // 5
        slowest = float(np.max(np.abs(np.linalg.eigvals(self.model.A - self._gain @ self.model.C)), initial=0.0))
        return int(min(3 / max(1 - slowest, 1e-6), shortest // 5))

    def counted(self, block: Array) -> Array:
        """Return those rows of a recording that count."""
        return block[self.skip : len(block) - self.reach]

    def residuals(
        self, wiring: Wiring, lags: tuple[float, ...], sensor: Sensor | None = None
    ) -> list[Array] | None:  # fmt: skip
        """Return what the baseline leaves over of each recording; None where it does not run on it.

        sensor: what one output passes besides. A linear model foretells what all other channels are behind the same
        filter; what it leaves over of them is behind it, too, and so smaller (`plain` makes up for that).
        """
        result = []
        for number, (u, y) in enumerate(self.blocks):
            v, z = wiring.apply(u, y)
            if self._compiled is None:
                left: Array | None = self._observed(*all_behind(sensor, _late(v, lags), z))
            else:
                run = self._run(v, lags, number, (wiring.inputs, wiring.input_order, wiring.input_zeros))
                left = None if run is None else z - one_behind(sensor, run)
            if left is None or not np.all(np.isfinite(left)):
                return None
            result.append(self.counted(left))
        return result

    def _observed(self, u: Array, y: Array) -> Array:
        """Return what a linear model leaves over behind an observer."""
        m, K = self.model, self._gain
        assert isinstance(m, StateSpace)
        assert K is not None
        v, z = u - m.u_offset, y - m.y_offset
        states = run_states(m.A - K @ m.C, v @ (m.B - K @ m.D).T + z @ K.T, np.zeros(m.order))[:-1]
        left: Array = z - states @ m.C.T - v @ m.D.T
        return left

    def _run(self, u: Array, lags: tuple[float, ...], number: int, inputs: object) -> Array | None:
        """Return the simulation by equations on inputs behind lags, None where it runs away; kept for a while.

        What is asked of an output changes no simulation: those of the last wirings of the inputs are looked up.
        """
        assert self._compiled is not None
        model = self._compiled.model
        kept = self._runs.pop(inputs, {})
        self._runs[inputs] = kept  # the last one used
        if len(self._runs) > _KEPT:
            del self._runs[next(iter(self._runs))]
        if (number, lags) not in kept:
            try:
                kept[number, lags] = simulate(self._compiled, _late(u, lags), model.theta, model.x0, self.step)
            except DataError:
                kept[number, lags] = None
        return kept[number, lags]

    def worth(self, wiring: Wiring, order: int) -> tuple[float, Array, tuple[float, ...]]:
        """Return the log-likelihood with the best lag, its parts by stretch, and the lag."""
        none = (0.0,) * len(self.names[0])
        best = (-np.inf, np.zeros(PARTS), none)
        for lags in [none, *_one_lag(len(none))]:
            left = self.residuals(wiring, lags)
            if left is None:
                continue
            total, parts = _evidence(left, order)
            jacobian = wiring.log_determinant
            rows = sum(len(r) - order for r in left)
            if total + rows * jacobian > best[0]:
                best = (total + rows * jacobian, parts + rows * jacobian / PARTS, lags)
        return best

    @property
    def rows(self) -> int:
        """Return the number of samples that count, times the outputs."""
        return sum(len(self.counted(u)) for u, _ in self.blocks) * len(self.names[1])

    def plain(
        self, wiring: Wiring, order: int, *, free: bool = False,
        lags: tuple[float, ...] | None = None, sensor: Sensor | None = None,
    ) -> float:  # fmt: skip
        """Return the log-likelihood of a wiring, without lags by default.

        free: past inputs have free weights besides; sensor: what one output passes besides.
        """
        left = self.residuals(wiring, lags or (0.0,) * len(self.names[0]), sensor)
        if left is None:
            return -np.inf
        inputs = [self.counted(wiring.apply(u, y)[0]) for u, y in self.blocks]
        rows = sum(len(r) - order for r in left)
        jacobian = rows * wiring.log_determinant
        if sensor is not None and self._compiled is None:
            jacobian += rows * (len(wiring.outputs) - 1) * float(np.log(sensor.gain))
        return _evidence(left, order, inputs if free else None)[0] + jacobian


def judge_of(case: Case, reach: int = 0) -> Judge | None:
    """Return the judge of a case; None where the baseline is no model or the recordings are too short.

    reach: rows by which an output's column may be asked to be late, at most a tenth of a recording.
    """
    rules = in_force().baseline
    model = case.baseline
    if not isinstance(model, StateSpace | Equations) or not model.outputs or not model.inputs:
        return None
    step = case.records[0].sample_time_s
    model = discretise(model, step) if isinstance(model, StateSpace) else model
    share = max(_MOST_ROWS // len(case.records), rules.wiring_rows)
    blocks = []
    for record in case.records:
        piece = record.slice(0, share)
        try:
            u = (
                model.inputs_of(piece)
                if isinstance(model, Equations)
                else piece.columns([s.name for s in model.inputs])
            )
        except DataError:
            return None
        y = piece.columns([s.name for s in model.outputs])
        there = rules.present_share
        long = len(piece) >= rules.wiring_rows
        if long and np.isfinite(u).all(axis=1).mean() > there and np.isfinite(y).mean() > there:
            blocks.append((_filled(u), _filled(y)))
    moving = [np.vstack([b[k] for b in blocks]) for k in (0, 1)] if blocks else []
    if not moving or not all(np.all(np.ptp(part, axis=0) > 0) for part in moving):
        return None
    shortest = min(len(u) for u, _ in blocks)
    units = {c.name: c.unit for c in case.records[0].channels}
    return Judge(model, blocks, step, units, min(reach, shortest // 10))


def _filled(values: Array) -> Array:
    """Return channels whose missing samples are drawn straight: a few change no sign."""
    filled, rows = values.copy(), np.arange(len(values))
    for column in filled.T:
        bad = ~np.isfinite(column)
        if bad.any() and not bad.all():
            column[bad] = np.interp(rows[bad], rows[~bad], column[~bad])
    return filled


def _observer(model: StateSpace, blocks: Sequence[tuple[Array, Array]]) -> Array:
    """Return a gain K with A − K C stable: that of unmeasured inputs of a third of the recorded ones' spread."""
    u, y = (np.vstack([b[k] for b in blocks]) for k in (0, 1))
    moved = model.B @ np.diag(0.1 * np.var(u, axis=0)) @ model.B.T
    moved += 1e-9 * max(float(np.trace(moved)), 1e-300) * np.eye(model.order)
    return steady_gain(model.A, model.C, moved, np.diag(0.01 * np.var(y, axis=0)))


def _late(u: Array, lags: tuple[float, ...]) -> Array:
    """Return inputs (N, r), each behind its lag."""
    return np.column_stack([_lagged(u[:, j], lag) for j, lag in enumerate(lags)]) if u.shape[1] else u


def _lagged(u: Array, samples: float) -> Array:
    """Return a channel behind a first-order lag of so many samples, settled at its start; 0 returns it."""
    if samples <= 0.0:
        return u
    keep = float(np.exp(-1.0 / samples))
    late: Array = u[0] + np.asarray(lfilter([1.0 - keep], [1.0, -keep], u - u[0]))
    return late


def _one_lag(inputs: int) -> Iterator[tuple[float, ...]]:
    for j, lag in itertools.product(range(inputs), _LAGS):
        yield tuple(lag if i == j else 0.0 for i in range(inputs))


def _evidence(left: Sequence[Array], order: int, inputs: Sequence[Array] | None = None) -> tuple[float, Array]:
    """Return the log-likelihood of an autoregression (with past inputs where given), whole and by stretch."""
    rows, targets = [], []
    for i, r in enumerate(left):
        past = [r[order - k - 1 : len(r) - k - 1] for k in range(order)]
        if inputs is not None:
            past += [inputs[i][order - k - 1 : len(r) - k - 1] for k in range(order)]
        rows.append(np.column_stack([*past, np.ones(len(r) - order)]))
        targets.append(r[order:])
    Z, T = np.vstack(rows), np.vstack(targets)
    scale = np.maximum(np.sqrt(np.mean(Z**2, axis=0)), 1e-300)
    Z = Z / scale
    gram = Z.T @ Z
    E = T - Z @ np.linalg.solve(gram + 1e-10 * len(Z) * np.eye(len(gram)), Z.T @ T)
    S = E.T @ E / len(E)
    S += 1e-12 * np.diag(np.maximum(np.var(T, axis=0), 1e-300))
    L = np.linalg.cholesky(S)
    each = -0.5 * np.sum(np.linalg.solve(L, E.T) ** 2, axis=0) - float(np.sum(np.log(np.diag(L))))
    return float(each.sum()), np.array([part.sum() for part in np.array_split(each, PARTS)])
