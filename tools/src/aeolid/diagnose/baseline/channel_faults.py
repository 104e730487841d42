"""Find channels recorded with another sign, in another unit or under another's name, before any physics (S0).

Each hypothesis transforms the recording and adds no parameter; `wiring_evidence` says what each is worth. A fault is
said where the evidence is large, there in most of the recording, at just this factor, and where hardly anything is left
over that past inputs with free weights would explain.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.baseline.wiring_columns import Wiring
from aeolid.diagnose.baseline.wiring_evidence import PARTS, Judge, judge_of
from aeolid.diagnose.baseline.wiring_values import level_errors, with_own_values
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.rules import in_force
from aeolid.errors import NotIdentifiable
from aeolid.models.equations import Equations
from aeolid.record import Record
from aeolid.units import rightly

RATIOS: tuple[tuple[float, str, tuple[str, ...]], ...] = (  # factor, its words, units of which one is exchanged
    (180 / np.pi, "degrees to a radian", ("deg", "rad", "deg/s", "rad/s")),
    (30 / np.pi, "rpm to a rad/s", ("rpm", "rad/s")),
    (6.0, "deg/s to an rpm", ("rpm", "deg/s")),
    (9.80665, "m/s^2 to a g", ("m/s^2", "m/s2", "g")),
    (3.6, "km/h to a m/s", ("m/s", "km/h")),
    (60.0, "seconds to a minute", ("s", "min", "1/s", "1/min", "rpm", "Hz")),
    (10.0, "millimetres to a centimetre", ("mm", "cm", "mm/s", "cm/s")),
    (25.4, "millimetres to an inch", ("mm", "in")),
    (3.28084, "feet to a metre", ("m", "ft", "m/s", "ft/s")),
    (100.0, "centimetres to a metre", ("m", "cm", "m/s", "cm/s")),
    (1000.0, "a thousand", ()),  # of every unit
)
SCALES: tuple[tuple[float, float, str, str], ...] = (  # factor that puts it right, recorded value at zero, unit, words
    (5 / 9, 32.0, "degC", "in degrees Fahrenheit"),
    (9 / 5, -160 / 9, "degF", "in degrees Celsius"),
)
_COARSE, _FINE = 4, 15  # orders of the autoregression: to choose whom to ask again, and to answer
_MOST = 2  # faults at once
_AGAIN = 6  # hypotheses that are asked again
_ASIDE = 1e3  # a factor with which a response does not count


@dataclass(frozen=True)
class ChannelFault:
    """Hold one fault: id and place as in the catalogue, factor (what was recorded over what is meant), nats, words."""

    id: str
    entry: str
    channels: tuple[str, ...]
    factor: float
    gain: float
    statement: str
    equation: str

    def to_effect(self) -> dict[str, Any]:
        """Return it as an effect of diagnosis.json."""
        role, _, _ = self.entry.partition(":")
        where = {"entry": self.entry, "inputs" if role.startswith("input") else "outputs": list(self.channels)}
        values = {} if self.id == "data_channel_swap" else {"factor": {"value": self.factor, "std": None, "unit": "1"}}
        return {
            "id": self.id, "family": "sensor_nonlinearity", "statement": self.statement, "location": where,
            "equation": self.equation, "parameters": values, "rivals": [], "weight": 1.0, "sealed_gain_share": None,
        }  # fmt: skip


@dataclass(frozen=True)
class _Hypothesis:
    """Hold a wiring that puts right what was done to some channels, and what that was."""

    wiring: Wiring
    kind: str  # sign, unit, scale (a unit with a zero of its own), swap
    role: str  # input, output
    numbers: tuple[int, ...]
    factor: float = 1.0  # by which the columns are multiplied to put them right
    words: str = ""


def channel_faults(case: Case) -> tuple[tuple[ChannelFault, ...], Case]:
    """Return what is wrong with the wiring, at most two faults, and the case with that put right.

    Only baselines that are models are asked. Cost: some 2 N (l p)² operations for each of the hypotheses, of which each
    channel has about ten, and each has 1 + 6 r lags.
    """
    judge = judge_of(case)
    if judge is None:
        return (), case
    found: list[ChannelFault] = []
    wiring = judge.declared
    for _ in range(_MOST):
        best = _by_level(judge, wiring) or _clearest(judge, wiring)
        if best is None:
            break
        wiring = best[0].wiring
        found.append(_described(judge, *best))
    right = case if not found else replace(case, records=_put_right(judge, wiring, case.records))
    return ((), case) if _is_refuted(case, right, found) else (tuple(found), right)


def _is_refuted(case: Case, right: Case, found: Sequence[ChannelFault]) -> bool:
    """Tell whether the model fits the recording put right worse than as it is; of signs and names alone.

    The judge's model is linear: of a pendulum that stands on its end, on a cart with dry friction, it turned a sign
    that was right, by 1,074 nats. Cost: the baseline's fit to both, where such a fault was found.
    """
    if not found or any(f.id not in ("sensor_sign", "data_channel_swap") for f in found):
        return False
    try:
        return prepare(right).fit.log_posterior < prepare(case).fit.log_posterior
    except (NotIdentifiable, np.linalg.LinAlgError):
        return False


class Fault(Protocol):
    """Stand for what is wrong with a recording: in words, and as an effect of diagnosis.json."""

    @property
    def statement(self) -> str:
        """Return it in words."""

    def to_effect(self) -> dict[str, Any]:
        """Return it as an effect of diagnosis.json."""


def with_faults(diagnosis: dict[str, Any], faults: Sequence[Fault]) -> dict[str, Any]:
    """Return a diagnosis of the recording put right as one of the recording that was given: its faults come first."""
    if not faults:
        return diagnosis
    said = "; and ".join(f.statement for f in faults)
    effects = [f.to_effect() for f in faults]
    return diagnosis | {
        "verdict": "data_fault",
        "statement": f"{said}. With that put right: {diagnosis['statement']}",
        "effects": [*effects, *diagnosis["effects"]],
        "location": effects[0]["location"],
    }


def _hypotheses(judge: Judge, base: Wiring) -> Iterator[_Hypothesis]:
    """Yield every single change of a wiring that is asked."""
    for role, names, units in (("input", judge.names[0], judge.stated[0]), ("output", judge.names[1], judge.stated[1])):
        for j, unit in enumerate(rightly(u) or u.strip() for u in units):
            yield _scaled(base, "sign", role, j, -1.0)
            for ratio, words, known in RATIOS:
                if not known or unit.replace(" ", "").replace("²", "^2") in known:
                    yield _scaled(base, "unit", role, j, ratio, words)
                    yield _scaled(base, "unit", role, j, 1 / ratio, words)
        for i, j in itertools.combinations(range(len(names)), 2):
            orders = list(base.input_order if role == "input" else base.output_order)
            orders[i], orders[j] = orders[j], orders[i]
            order = tuple(orders)
            swapped = replace(base, input_order=order) if role == "input" else replace(base, output_order=order)
            yield _Hypothesis(swapped, "swap", role, (i, j))


def _scales(judge: Judge, base: Wiring) -> Iterator[_Hypothesis]:
    """Yield the changes of a wiring to units that have another zero."""
    for role, units in (("input", judge.stated[0]), ("output", judge.stated[1])):
        for j, unit in enumerate(units):
            for factor, zero, of, words in SCALES:
                if (rightly(unit) or unit.strip()) == of:
                    yield _with_zero(_scaled(base, "scale", role, j, factor, words), zero)


def _scaled(base: Wiring, kind: str, role: str, number: int, factor: float, words: str = "") -> _Hypothesis:
    factors = list(base.inputs if role == "input" else base.outputs)
    factors[number] *= factor
    told = tuple(factors)
    scaled = replace(base, inputs=told) if role == "input" else replace(base, outputs=told)
    return _Hypothesis(scaled, kind, role, (number,), factor, words)


def _with_zero(found: _Hypothesis, zero: float) -> _Hypothesis:
    """Return a factor of a channel's unit as that of one whose zero is recorded as another number."""
    wiring, j = found.wiring, found.numbers[0]
    zeros = list(wiring.input_zeros if found.role == "input" else wiring.output_zeros)
    zeros[j] = zero
    told = tuple(zeros)
    shifted = replace(wiring, input_zeros=told) if found.role == "input" else replace(wiring, output_zeros=told)
    return replace(found, wiring=shifted)


def _by_level(judge: Judge, base: Wiring) -> tuple[_Hypothesis, float, list[_Hypothesis]] | None:
    """Return a unit with another zero that equations ask for by level as well as by size; None mostly.

    What is recorded in degrees Fahrenheit moves 1.8 times as far and lies 32 above: no values within their ranges make
    up for that, where an autoregression with a level of its own gained 29 nats of 1,920 samples. So each wiring is
    simulated with the values that it asks for, and one is told whose errors are small and, over all outputs together,
    a third of the others'.
    """
    rules, asked = in_force().baseline, list(_scales(judge, base))
    if not asked or not isinstance(judge.model, Equations):
        return None
    before = level_errors(judge, base)
    answers = [(level_errors(judge, h.wiring), h) for h in asked]
    ranked = sorted(((float(np.log(e).sum()), float(e.max()), h) for e, h in answers), key=lambda a: a[:2])
    total, worst, best = ranked[0]
    better = float(np.log(before).sum()) - total
    if better < np.log(rules.level_ratio) or worst > rules.level_error:
        return None
    return best, better * judge.rows / len(before), []


def _clearest(judge: Judge, base: Wiring) -> tuple[_Hypothesis, float, list[_Hypothesis]] | None:
    """Return the change that a wiring asks for, its nats, and what the data do not tell from it; None mostly."""
    rules = in_force().baseline
    evidence = in_force().evidence
    asked = list(_hypotheses(judge, base))
    declared = judge.worth(base, _COARSE)[0]
    if declared == -np.inf:
        return None
    coarse = [(judge.worth(h.wiring, _COARSE)[0], h) for h in asked]
    # whatever whitens: of a disturbance that a loop's command holds, too, order 4 said 1 and order 15 said -1
    ranked = [h for worth, h in sorted(coarse, key=lambda c: -c[0])[:_AGAIN] if worth > declared]
    if not ranked:
        return None
    before, parts, _ = judge.worth(base, _FINE)
    answers = sorted(((judge.worth(h.wiring, _FINE), h) for h in ranked), key=lambda a: -a[0][0])
    least = max(evidence.clear_nats + np.log(len(asked)), rules.fault_rate * judge.rows)
    while answers and answers[0][0][0] - before >= least and _values_explain(judge, base, answers[0][1]):
        answers = answers[1:]
    if not answers or answers[0][0][0] - before < least:
        return None
    (after, of_best, _), best = answers[0]
    gain, steps = after - before, of_best - parts
    if gain < evidence.one_percent_z * float(np.std(steps)) * np.sqrt(PARTS) or not _is_just_this(
        judge, best, after, before
    ):
        return None
    plain, free = judge.plain(base, _FINE), judge.plain(base, _FINE, free=True)
    by_chance = 0.5 * _FINE * len(judge.names[0]) * len(judge.names[1])  # half a nat for each free weight
    if after - plain < rules.fault_explained_share * (free - plain - by_chance):
        return None
    told_apart = in_force().selection.told_apart_nats
    return best, gain, [h for (worth, _, _), h in answers[1:] if after - worth < told_apart]


def _values_explain(judge: Judge, base: Wiring, asked: _Hypothesis) -> bool:
    """Tell whether other values within their ranges do as well: asked of exchanges, and where roles alone give a unit.

    What unit a model without one means is no more certain than its values are.
    """
    signals = judge.model.inputs if asked.role == "input" else judge.model.outputs
    if asked.kind != "swap" and (asked.kind != "unit" or signals[asked.numbers[0]].unit):
        return False
    return _with_values(judge, asked.wiring) - _with_values(judge, base) < in_force().evidence.clear_nats


def _with_values(judge: Judge, wiring: Wiring) -> float:
    """Return what a wiring is worth with the values that it asks for."""
    return with_own_values(judge, wiring).worth(wiring, _FINE)[0]


def _is_just_this(judge: Judge, best: _Hypothesis, worth: float, before: float) -> bool:
    """Tell whether the channel's factor is the known one: not one that lies beside it, nor one near 0.

    Along a factor a of a channel the log-likelihood is a parabola: with its top at −1 it lies 4 c lower at 1 and c
    lower at 0, where the model's response between the channel and the others does not count. Where most of the gain is
    there already, the response is of another kind than the model's and has no sign.
    """
    rules = in_force().baseline
    if best.kind == "swap":
        return True
    if best.kind == "sign":
        aside = _scaled(best.wiring, "", best.role, best.numbers[0], _ASIDE if best.role == "output" else 1 / _ASIDE)
        if worth - judge.worth(aside.wiring, _FINE)[0] < rules.fault_sign_share * (worth - before):
            return False
    ratios = (rules.fault_beside_ratio, 1 / rules.fault_beside_ratio)
    beside = [_scaled(best.wiring, "", best.role, best.numbers[0], f).wiring for f in ratios]
    return all(judge.worth(w, _FINE)[0] < worth for w in beside)


def _put_right(judge: Judge, wiring: Wiring, records: Sequence[Record]) -> tuple[Record, ...]:
    """Return the recordings with their channels exchanged and multiplied as the wiring says."""
    result = []
    for record in records:
        values = record.values.copy()
        places = {c.name: i for i, c in enumerate(record.channels)}
        for names, factors, orders, zeros in (
            (judge.names[0], wiring.inputs, wiring.input_order, wiring.input_zeros),
            (judge.names[1], wiring.outputs, wiring.output_order, wiring.output_zeros),
        ):
            for j, name in enumerate(names):
                if name in places:
                    values[:, places[name]] = factors[j] * (record.column(names[orders[j]]) - zeros[j])
        result.append(replace(record, values=values))
    return tuple(result)


def _described(judge: Judge, best: _Hypothesis, gain: float, alike: Sequence[_Hypothesis]) -> ChannelFault:
    """Say a fault in words, and what explains the recording as well."""
    names = judge.names[0] if best.role == "input" else judge.names[1]
    said, equation = _words(best, names)
    others = [_words(h, judge.names[0] if h.role == "input" else judge.names[1])[0] for h in alike]
    told = "".join(f"; or {o}" for o in others)
    channels = tuple(names[n] for n in best.numbers)
    entry = f"{best.role}s:{' and '.join(channels)}" if best.kind == "swap" else f"{best.role}:{channels[0]}"
    ids = {"sign": "sensor_sign", "unit": "sensor_scale", "scale": "sensor_scale", "swap": "data_channel_swap"}
    return ChannelFault(
        ids[best.kind], entry, channels, 1 / best.factor, gain, f"{said} ({gain:.0f} nats){told}", equation
    )


def _words(fault: _Hypothesis, names: Sequence[str]) -> tuple[str, str]:
    first = names[fault.numbers[0]]
    if fault.kind == "swap":
        other = names[fault.numbers[1]]
        text = f"the channels {first} and {other} are swapped: each was recorded under the other's name"
        return text, f"{first}_recorded = {other}, {other}_recorded = {first}"
    if fault.kind == "sign":
        return f"{first} is recorded with the wrong sign", f"{first}_recorded = -{first}"
    factor = 1 / fault.factor
    if fault.kind == "scale":
        zero = (fault.wiring.input_zeros if fault.role == "input" else fault.wiring.output_zeros)[fault.numbers[0]]
        unit = next(of for factor, _, of, _ in SCALES if factor == fault.factor)
        text = f"{first} is recorded {fault.words}, though its unit is {unit}"
        return text, f"{first}_recorded = {factor:.5g}*{first} {'-' if zero < 0 else '+'} {abs(zero):.5g}"
    text = f"{first} is recorded as {factor:.5g} times what its unit says ({_ratio(fault.factor)}, {fault.words})"
    return text, f"{first}_recorded = {factor:.5g}*{first}"


def _ratio(factor: float) -> str:
    return f"{max(factor, 1 / factor):.5g}"
