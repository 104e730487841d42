"""List what may be wrong with how a recording's channels were taken: units, names, clocks, the rotor angle's zero.

Such faults change every answer of a plant, so that physics would be found in them: a pitch angle in radians acts as
strongly as no rotor does, and swapped blades turn the other way.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.forensics import RATIOS, ratio_text
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior import operators as op
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values
from aeolid.diagnose.run_prior.pair import Change, Pair, Side

Array = NDArray[np.float64]
_ANGLES = (-120.0, -60.0, -20.0, 20.0, 60.0, 120.0, 180.0)  # degrees, of the rotor's angle: where a search begins
_LATE = (-8, -4, -2, -1, 1, 2, 3, 4, 5, 6, 8, 11)  # samples: between them lines interpolate, and the evidence ripples
_NEAR = 1.2  # factor to either side of a ratio of units within which its best value is looked for


def faults_of(pair: Pair, units: Mapping[str, str]) -> list[Hypothesis]:
    """Return every fault of single channels and pairs of them that the two sides allow."""
    return [*_units(pair), *_names(pair, units), *_clocks(pair), *_zero(pair)]


def _units(pair: Pair) -> list[Hypothesis]:
    """Return channels whose deviation and level are a ratio of known units times the simulation's."""
    found = []
    for i, name in enumerate(pair.inputs):
        factor = _other_unit(*(np.concatenate([s.u[:, i] for s in sides]) for sides in (pair.recordings, pair.runs)))
        if factor is not None:
            found.append(_scaled(f"input:{name}", factor, i))
    turning = {j for places in pair.blades for j in places}
    for j, name in enumerate(pair.outputs):
        factor = _other_unit(*(np.concatenate([s.y[:, j] for s in sides]) for sides in (pair.recordings, pair.runs)))
        if factor is not None and j not in turning:
            found.append(_scaled(f"output:{name}", factor, j))
    found += [h for places in pair.blades if (h := _blades_scaled(pair, places)) is not None]
    return found


def _other_unit(recorded: Array, simulated: Array) -> float | None:
    """Return the ratio of units that a channel's deviation and level stand in, or None."""
    rules = in_force()
    spreads = float(np.std(recorded)), float(np.std(simulated))
    if not min(spreads) > 0:
        return None
    ratio = spreads[0] / spreads[1]
    known = [r for said, _ in RATIOS for r in (said, 1 / said)]
    near = min(known, key=lambda r: abs(np.log(ratio / r)))
    close = rules.run_prior.unit_slack
    if not 1 / close < ratio / near < close or abs(np.log(near)) < np.log(rules.data.unit_ratio):
        return None
    levels = float(np.mean(recorded)), float(np.mean(simulated))
    if abs(levels[1]) > spreads[1] and not 1 / close < levels[0] / levels[1] / near < close:
        return None
    return near


def _scaled(place: str, factor: float, at: int) -> Hypothesis:
    def change(values: Values) -> Change:
        if place.startswith("input:"):
            return Change(inputs={at: lambda x, step: x / values[0]})
        return Change(outputs={at: lambda x, step: x * values[0]})

    return _in_other_units(place, factor, change)


def _blades_scaled(pair: Pair, places: tuple[int, ...]) -> Hypothesis | None:
    """Return all blades of a set in other units: a set comes from one amplifier."""
    recorded, simulated = (
        np.concatenate([s.y[:, list(places)].ravel() for s in g]) for g in (pair.recordings, pair.runs)
    )
    factor = _other_unit(recorded, simulated)
    if factor is None:
        return None

    def change(values: Values) -> Change:
        return Change(outputs=dict.fromkeys(places, lambda x, step: x * values[0]))

    return _in_other_units(f"output:{pair.outputs[places[0]]}", factor, change)


def literal(text: str) -> str:
    """Return a text whose braces stand for themselves in a format string: names of channels may have some."""
    return text.replace("{", "{{").replace("}", "}}")


def _in_other_units(place: str, factor: float, change: Callable[[Values], Change]) -> Hypothesis:
    channel, ratio = literal(place.partition(":")[2]), f"{factor:.4g} times as large{ratio_text(factor)}"
    words = f"{channel} is recorded in another unit than in the simulation: {ratio}"
    return Hypothesis(
        "sensor_scale", place, ("factor",), ("1",), (factor / _NEAR,), (factor * _NEAR,), ((factor,),), change,
        fault=True, words=words,
    )  # fmt: skip


def _names(pair: Pair, units: Mapping[str, str]) -> list[Hypothesis]:
    """Return every two outputs of one unit under each other's name."""
    found = []
    for a, b in itertools.combinations(range(len(pair.outputs)), 2):
        own, other = pair.outputs[a], pair.outputs[b]
        if not units.get(own) or units.get(own) != units.get(other):
            continue
        order = list(range(len(pair.outputs)))
        order[a], order[b] = b, a
        words = literal(f"the channels {own} and {other} are swapped: each was recorded under the other's name")
        found.append(
            Hypothesis(
                "data_channel_swap", f"outputs:{own} and {other}", (), (), (), (), ((),),
                partial(_always, Change(order=tuple(order))), fault=True, words=words,
            )
        )  # fmt: skip
    return found


def _always(change: Change, _: Values) -> Change:
    return change


def _clocks(pair: Pair) -> list[Hypothesis]:
    """Return single outputs that another logger stamps late (early where negative).

    Blades are none of them: lift that builds up late is what a late set of blades would be.
    """
    turning = {j for places in pair.blades for j in places}
    far = pair.past * pair.block_s / 2
    starts = tuple((k * pair.step,) for k in _LATE if abs(k) * pair.step < far)

    def of(j: int, name: str) -> Hypothesis:
        def change(values: Values) -> Change:
            return Change(outputs={j: lambda x, step: op.stamped_later(x, values[0], step)})

        return Hypothesis(
            "data_time_offset", f"output:{name}", ("offset_s",), ("s",), (-far,), (far,), starts, change,
            scaled=False, fault=True,
            words=f"{literal(name)} is stamped {{offset_s:.3g}} s late against the other channels",
        )  # fmt: skip

    return [of(j, name) for j, name in enumerate(pair.outputs) if j not in turning]


def _zero(pair: Pair) -> list[Hypothesis]:
    """Return the zero of the rotor's angle at another blade or place than in the simulation."""
    sides: tuple[Side, ...] = (*pair.recordings, *pair.runs)
    if not pair.blades or any(s.azimuth is None for s in sides):
        return []
    return [
        Hypothesis(
            "sensor_bias", "channel:azimuth", ("bias",), ("deg",), (-180.0,), (180.0,), tuple((a,) for a in _ANGLES),
            lambda values: Change(turned=float(np.deg2rad(values[0]))), scaled=False, fault=True,
            words="the recorded rotor angle reads {bias:+.3g} deg against the simulation's: its zero is elsewhere",
        )
    ]  # fmt: skip
