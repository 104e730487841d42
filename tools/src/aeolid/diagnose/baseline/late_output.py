"""Find the one output of several whose rows come later, or earlier, than those of all other channels (S0).

A channel of another logger, of an analyser or of a counter stands beside the others by so many rows. A filter in the
model has the phase of a delay only at low frequencies, so the column itself is moved and the recording judged again, as
`wiring_evidence` does. It is said where nothing else that delays explains as much: a sensor's lag of first or second
order, the other sign, any input that is late instead, or a lag of an input besides.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.baseline.wiring_columns import Sensor, Wiring, moved_ahead
from aeolid.diagnose.baseline.wiring_evidence import PARTS, Judge, judge_of
from aeolid.diagnose.baseline.wiring_values import with_own_values
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.rules import in_force
from aeolid.errors import NotIdentifiable
from aeolid.models.equations import Equations
from aeolid.record import Record

Array = NDArray[np.float64]
_REACH = 40  # rows, either way
_COARSE, _FINE = 4, 15  # orders of the autoregression: to choose whom to ask again, and to answer
_AGAIN = 4  # shifts that are asked again
_LATER = (0.4, 0.8, 1.6)  # delays of a sensor to start from, as a part of the shift
_DAMPING = (0.5, 1.0)
_TIMES = np.geomspace(0.25, 8.0, 16).tolist()  # time constants of a lag, as a part of the shift
_MOST = 60  # evaluations from the best start
_NEAR = (-2, -1, 0, 1, 2)  # rows beside the shift by which inputs may be late instead
_LOOKS = 3  # at the parabola
_FAILED = 1e12  # loss of a sensor with which the model runs away


@dataclass(frozen=True)
class LateOutput:
    """Hold which output is late, by how many rows of `step` s (negative: early), and the nats that it gains."""

    output: str
    rows: float
    step: float
    gain: float

    @property
    def statement(self) -> str:
        """Return it in words."""
        how = "late" if self.rows > 0 else "early"
        count, seconds = abs(self.rows), abs(self.rows) * self.step
        return (
            f"{self.output} is recorded {seconds:.3g} s ({count:.3g} rows) {how} against all other channels, as by"
            f" another logger's clock or a sensor's dead time ({self.gain:.0f} nats)"
        )

    def to_effect(self) -> dict[str, Any]:
        """Return it as an effect of diagnosis.json; the value is as sure as a row."""
        offset = {"value": self.rows * self.step, "std": self.step / np.sqrt(12), "unit": "s"}
        return {
            "id": "data_time_offset", "family": "input_lag", "statement": self.statement,
            "location": {"entry": f"output:{self.output}", "inputs": [], "outputs": [self.output]},
            "equation": f"{self.output}_recorded(t) = {self.output}(t - offset_s)", "parameters": {"offset_s": offset},
            "rivals": [], "weight": 1.0, "sealed_gain_share": None,
        }  # fmt: skip


def late_output(case: Case) -> tuple[LateOutput | None, Case]:
    """Return the output that is late or early by rows of its own, and the case with that put right; None mostly.

    Only baselines that are models of several outputs are asked. Cost: some 80 l evaluations of 32 N l² operations, and
    a few hundred of 450 N l² where one is found.
    """
    judge = judge_of(case, _REACH)
    if judge is None or len(judge.names[1]) < 2:
        return None, case
    found = _clearest(judge)
    if found is None:
        return None, case
    wiring, gain = found
    number = _place(wiring)
    name, rows = judge.names[1][number], wiring.late[number]
    right = replace(case, records=tuple(_moved(r, name, rows) for r in case.records))
    return (None, case) if _is_refuted(case, right) else (LateOutput(name, rows, judge.step, gain), right)


def _clearest(judge: Judge) -> tuple[Wiring, float] | None:
    """Return the shift of one output that the recording asks for, beside the habits of its rows, and its nats."""
    clear = in_force().evidence.clear_nats
    base = _with_habits(judge)
    asked = [_shifted(base, j, k) for j in range(len(base.late)) for k in _rows(judge)]
    least = clear + np.log(len(asked))
    enough = judge.plain(base, _COARSE) + least
    coarse = sorted(((judge.plain(w, _COARSE), i) for i, w in enumerate(asked)), reverse=True)
    ranked = [asked[i] for worth, i in coarse[:_AGAIN] if worth > enough > -np.inf]
    whole = max(ranked, key=lambda w: judge.worth(w, _FINE)[0], default=base)
    if abs(whole.late[_place(whole)]) < in_force().baseline.late_rows:
        return None
    best = _between_rows(judge, whole)
    before, parts, _ = with_own_values(judge, base).worth(base, _FINE)
    after, of_best, lags = with_own_values(judge, best).worth(best, _FINE)
    gain, spread = after - before, float(np.std(of_best - parts)) * np.sqrt(PARTS)
    told = (
        gain >= max(least, in_force().evidence.one_percent_z * spread)
        and _is_most(judge, base, after)
        and after - _as_reversed(judge, base, best) >= clear
        and after - _as_late_inputs(judge, base, best) >= clear
        and after - _as_sensor(judge, base, best, lags) >= clear
    )
    return (best, gain) if told else None


def _between_rows(judge: Judge, best: Wiring) -> Wiring:
    """Return a shift by whole rows with the part of a row by which the evidence lies beside; small parts are none.

    The evidence of three shifts a row apart, which interpolate alike, is a parabola in the shift. No input has a lag
    beside: it would take the part of a row away.
    """
    number, fitted = _place(best), with_own_values(judge, best)
    whole = rows = best.late[number]
    for _ in range(_LOOKS):
        below, here, above = (fitted.plain(_shifted(best, number, rows + d), _FINE) for d in (-1.0, 0.0, 1.0))
        bend = below - 2 * here + above
        if not (np.isfinite(bend) and bend < 0):
            break
        rows = float(np.clip(rows + 0.5 * (below - above) / bend, whole - 0.5, whole + 0.5))
    return best if abs(rows - whole) < in_force().hypotheses.habit_rows else _shifted(best, number, rows)


def _is_most(judge: Judge, base: Wiring, worth: float) -> bool:
    """Tell whether something gains most of what past inputs with free weights gain over a wiring, beyond chance."""
    plain, free = judge.plain(base, _FINE), judge.plain(base, _FINE, free=True)
    by_chance = 0.5 * _FINE * len(judge.names[0]) * len(judge.names[1])  # half a nat for each free weight
    return worth - plain >= in_force().baseline.fault_explained_share * (free - plain - by_chance)


def _with_habits(judge: Judge) -> Wiring:
    """Return the wiring with the outputs a row late or early for which the recording asks: how loggers fill rows."""
    base = replace(judge.declared, late=(0,) * len(judge.names[1]))
    worth = judge.plain(base, _COARSE)
    for j in range(len(base.late)):
        for k in (-1, 1):
            asked = _shifted(base, j, k)
            if (found := judge.plain(asked, _COARSE)) > worth + in_force().evidence.clear_nats:
                base, worth = asked, found
    return base


def _place(wiring: Wiring) -> int:
    """Return which output is moved farthest."""
    return max(range(len(wiring.late)), key=lambda j: abs(wiring.late[j]))


def _rows(judge: Judge) -> Sequence[float]:
    return [k for k in range(-judge.reach, judge.reach + 1) if k != 0]


def _shifted(base: Wiring, output: int, rows: float) -> Wiring:
    return replace(base, late=tuple(rows if j == output else k for j, k in enumerate(base.late)))


def _as_sensor(judge: Judge, base: Wiring, best: Wiring, lags: tuple[float, ...]) -> float:
    """Return what the recording is worth with the late output behind a sensor of first or second order."""
    number = _place(best)
    rows, base = best.late[number], _shifted(base, number, 0)
    if rows < 0:
        return -np.inf  # an output that is early is behind no sensor

    def worth(sensor: Sensor) -> float:
        return judge.plain(base, _FINE, lags=lags, sensor=sensor)

    def loss(values: Array) -> float:
        delay, damping = np.exp(values)
        found = worth(second_order(number, delay, damping))
        return -found if np.isfinite(found) else _FAILED

    first = max(worth(first_order(number, part * rows)) for part in _TIMES)
    starts = [np.log([part * rows, damping]) for part, damping in itertools.product(_LATER, _DAMPING)]
    end = minimize(loss, min(starts, key=loss), method="Nelder-Mead", options={"maxfev": _MOST})
    return max(first, -float(end.fun))


def first_order(output: int, rows: float) -> Sensor:
    """Return a sensor of first order with a time constant of so many rows."""
    return Sensor(output, (1.0, -float(np.exp(-1.0 / rows))))


def second_order(output: int, rows: float, damping: float) -> Sensor:
    """Return a sensor of second order that delays slow signals by so many rows."""
    omega = 2 * damping / rows
    if damping < 1:
        radius, angle = np.exp(-damping * omega), omega * np.sqrt(1 - damping**2)
        return Sensor(output, (1.0, float(-2 * radius * np.cos(angle)), float(radius**2)))
    spread = omega * np.sqrt(damping**2 - 1)
    slow, fast = np.exp(-damping * omega + spread), np.exp(-damping * omega - spread)
    return Sensor(output, (1.0, float(-slow - fast), float(slow * fast)))


def _as_reversed(judge: Judge, base: Wiring, best: Wiring) -> float:
    """Return what the recording is worth with the late output in the other sign instead.

    Of a narrow band half a period late is the other sign: a tower's mode at 0.38 Hz, reversed, was 1.3 s late (120 nats
    for 205).
    """
    number = _place(best)
    outputs = tuple(-f if j == number else f for j, f in enumerate(base.outputs))
    other = replace(base, outputs=outputs)
    return with_own_values(judge, other).worth(other, _FINE)[0]


def _as_late_inputs(judge: Judge, base: Wiring, best: Wiring) -> float:
    """Return what the recording is worth with one input, or all of them, late by about as many rows instead."""
    rows = best.late[_place(best)]
    inputs = range(len(judge.names[0]))
    groups = [*([j] for j in inputs), list(inputs)]
    worths = []
    for group, near in itertools.product(groups, _NEAR):
        blocks = [(_delayed(u, group, rows + near), y) for u, y in judge.blocks]
        worths.append(Judge(judge.model, blocks, judge.step, reach=judge.reach).plain(base, _FINE))
    return max(worths, default=-np.inf)


def _delayed(u: Array, inputs: Sequence[int], rows: float) -> Array:
    moved = u.copy()
    for j in inputs:
        moved[:, j] = moved_ahead(u[:, j], -rows, beyond="edge")
    return moved


def _moved(record: Record, output: str, rows: float) -> Record:
    """Return a recording whose output is what it was so many rows later; what is known of no row is missing."""
    values = record.values.copy()
    column = next(i for i, c in enumerate(record.channels) if c.name == output)
    values[:, column] = moved_ahead(values[:, column], rows, beyond="missing")
    return replace(record, values=values)


def _is_refuted(case: Case, right: Case) -> bool:
    """Tell whether the baseline, fitted to either, fits the recording put right no better than its rows as given."""
    if not isinstance(case.baseline, Equations):
        return False
    same = [
        replace(g, values=np.where(np.isnan(r.values), np.nan, g.values))
        for g, r in zip(case.records, right.records, strict=True)
    ]
    try:
        return prepare(right).fit.log_posterior <= prepare(replace(case, records=tuple(same))).fit.log_posterior
    except (NotIdentifiable, np.linalg.LinAlgError):
        return False
