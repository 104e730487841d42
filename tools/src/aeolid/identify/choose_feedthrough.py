"""Choose which inputs get feedthrough, from the recordings: see `feedthrough` for the questions that decide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import lstsq
from aeolid.identify.feedthrough import (
    LEVEL,
    LOOP_LEVEL,
    Feedthrough,
    ask_excitation,
    ask_memory,
    lag_zero,
    loop_p_value,
)
from aeolid.identify.plant_states import Halves, ask_predicted, ask_states
from aeolid.identify.windows import Scaling, WindowFactor, window_rows
from aeolid.record import Record

Array = NDArray[np.float64]
CHUNK = 8192
LONGEST = 100_000  # windows whose innovations are looked at; more change nothing but the time it takes


def choose_feedthrough(
    records: Sequence[Record], scaling: Scaling, factor: WindowFactor, halves: Halves
) -> tuple[Feedthrough, ...]:  # fmt: skip
    """Say for each input whether the model is better with its feedthrough than without.

    records: as the windows are taken from them; factor: of all their windows, of a length that predicts the outputs;
    halves: of the same windows in the part that is fitted and the part held out. Level 1 % over all inputs together
    (Bonferroni). Cost: N q (l + r) operations.
    """
    e, v, u, x = _innovations(records, scaling, factor)
    count = len(scaling.inputs)
    p_values, most = lag_zero(e, v)
    suspected = [i for i in range(count) if p_values[i] * count < LEVEL]
    free = [i for i in suspected if loop_p_value(e, u[:, i]) >= LOOP_LEVEL]
    found = []
    for i, name in enumerate(scaling.inputs):
        output = scaling.outputs[most[i]]
        if i not in suspected:
            on, sure, reason = False, True, "nothing of it shows in the outputs within the sample"
        elif i in free and ask_memory(factor, i) is not False:
            on, sure, reason = True, True, f"acts on {output} within the sample, and past outputs do not move it"
        else:
            on, sure, reason = _in_loop(factor, e, v, x, i, output)
        found.append(Feedthrough(name, on, sure, float(min(1.0, p_values[i] * count)), output, reason))
    return _with_states(found, suspected, halves)


def _with_states(found: list[Feedthrough], suspected: list[int], halves: Halves) -> tuple[Feedthrough, ...]:
    """Return the answers with those on that few states need (`plant_states`): asked where the others left off.

    An input that F is told of by the questions before is asked the second only.
    """
    level = LEVEL / len(found)
    for i in suspected:
        through = tuple(t.on for t in found)
        if through[i]:
            continue
        how = ""
        if not found[i].sure and ask_states(halves, through, i, level):
            how = "without it the plant needs the states of the loop's controller too"
        elif ask_predicted(halves, through, i, level):
            how = "what the past tells of it shows in the outputs beyond the states"
        if how:
            reason = f"acts on {found[i].output} within the sample: {how}"
            found[i] = replace(found[i], on=True, sure=True, reason=reason)
    return tuple(found)


def _in_loop(factor: WindowFactor, e: Array, v: Array, x: Array | None, i: int, output: str) -> tuple[bool, bool, str]:
    """Return whether an input of a loop has feedthrough, whether that is sure, and why."""
    answer = None if x is None else ask_excitation(e, v, i, x)
    if answer is not None:
        how = "by the recorded excitation, "
    else:
        answer, how = ask_memory(factor, i), "by the memory of what moves it, "
    if answer is None:
        return False, False, f"hangs together with {output} within the sample, and lies in a loop: not decided"
    if answer:
        return True, True, f"{how}it acts on {output} within the sample and the loop has a sample of delay"
    return False, True, f"{how}it is computed from {output} of the same sample, or does not act on it"


def _innovations(
    records: Sequence[Record], scaling: Scaling, factor: WindowFactor
) -> tuple[Array, Array, Array, Array | None]:
    """Return what the past leaves of outputs (N, l) and inputs (N, r), the inputs, and recorded excitations or None."""
    r, width = len(scaling.inputs), factor.past * factor.channels
    last = width + r + len(scaling.outputs)
    theta = lstsq(factor.R[:, :width], factor.R[:, width:last], rcond=1e-9)
    names = records[0].names("excitation", "disturbance")
    left, inputs, outside, windows = [], [], [], 0
    for record in records:
        at = factor.past
        place = {c.name: i for i, c in enumerate(record.channels)}
        for rows in window_rows(record, scaling, factor.past, CHUNK):
            centred = rows - factor.mean
            x = record.values[at : at + len(rows), [place[n] for n in names]]
            at += len(rows)
            good = np.isfinite(centred).all(axis=1) & np.isfinite(x).all(axis=1)
            left.append((centred[:, width:last] - centred[:, :width] @ theta)[good])
            inputs.append(rows[good, width : width + r])
            outside.append(x[good])
            windows += int(np.count_nonzero(good))
            if windows >= LONGEST:
                break
    both = np.vstack(left)
    moving = np.vstack(outside)
    moving = moving[:, moving.std(axis=0) > 0] if len(names) else moving
    return both[:, r:], both[:, :r], np.vstack(inputs), moving if moving.shape[1] else None
