"""Take dead times out of recordings before identification, and put them back into the model as states.

An input that acts d samples late is moved d samples later: the past window then holds what the plant does, not d
samples in which it does nothing. Moved later an input holds no sample of the future, so that the loop may be closed.
In the model a chain of d states carries the input: everything that runs or converts a state-space model then has the
delay without knowing of it. The alternative, a number beside each input, would have to be honoured by each of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.assemble import with_start
from aeolid.identify.bands import Band
from aeolid.identify.result import Identification
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]


def without_delays(records: Sequence[Record], delays: Mapping[str, int]) -> list[Record]:
    """Return the recordings with each input moved later by its delay; the samples before the longest are cut off."""
    longest = max(delays.values(), default=0)
    if not longest:
        return list(records)
    out = []
    for record in records:
        values = record.values.copy()
        for i, channel in enumerate(record.channels):
            samples = delays.get(channel.name, 0)
            if samples:
                values[samples:, i] = record.values[: max(len(record) - samples, 0), i]
        start = min(longest, len(record))
        out.append(replace(record, values=values[start:], time_s=record.time_s[start:]))
    return out


def with_delays(
    result: Identification, records: Sequence[Record], delays: Mapping[str, int], found: bool
) -> Identification:
    """Return the result with the delays in its model, frequency response, settings and notes.

    result: of the recordings without delays; records: those with them, on which the first state is estimated; found:
    whether the delays were estimated.
    """
    if not delays:
        return result
    model = with_start(delayed(result.model, delays), records)
    how = ", as the recordings tell" if found else ""
    notes = [
        f"input {name!r} acts {counted(samples, 'sample')} ({samples * model.sample_time_s:g} s) late{how}: the "
        "model carries "
        f"it in {counted(samples, 'state')} beside the {result.order} of its order"
        for name, samples in delays.items()
    ]
    names = [s.name for s in model.inputs]
    band = None if result.band is None else _delayed_band(result.band, names, delays, model.sample_time_s)
    settings = replace(result.settings, delays=tuple(delays.items()))
    return replace(result, model=model, band=band, settings=settings, notes=(*result.notes, *notes))


def delayed(model: StateSpace, delays: Mapping[str, int]) -> StateSpace:
    """Return a discrete-time model whose inputs act later by whole samples, one state for each.

    x⁺ = [A  B_d; 0  N] x + [B_0; E] u, where a chain of d states holds u_{k−1} … u_{k−d}, and its last one acts as the
    input did. The first states of the chains are zero: the inputs' operating point. delays: samples ≥ 0 by name.
    """
    names, n = [s.name for s in model.inputs], model.order
    chains = [delays.get(name, 0) for name in names]
    size = n + sum(chains)
    A, B = np.zeros((size, size)), np.zeros((size, len(names)))
    C, D = np.zeros((len(model.C), size)), model.D.copy()
    A[:n, :n], B[:n], C[:, :n] = model.A, model.B, model.C
    states, start = list(model.states), n
    for i, samples in enumerate(chains):
        if not samples:
            continue
        end = start + samples
        A[:n, end - 1], C[:, end - 1] = model.B[:, i], model.D[:, i]
        B[:, i], D[:, i] = 0.0, 0.0
        B[start, i] = 1.0
        A[start + 1 : end, start : end - 1] = np.eye(samples - 1)
        states += [Signal(f"{names[i]}_{k}_ago", model.inputs[i].unit) for k in range(1, samples + 1)]
        start = end
    more = np.zeros(size - n)
    K = None if model.K is None else np.vstack([model.K, np.zeros((size - n, model.K.shape[1]))])
    return replace(model, A=A, B=B, C=C, D=D, K=K, x0=np.concatenate([model.x0, more]), states=tuple(states))


def _delayed_band(band: Band, names: Sequence[str], delays: Mapping[str, int], sample_time_s: float) -> Band:
    """Return a frequency response turned by what the delays turn it."""
    late = np.array([delays.get(name, 0) for name in names]) * sample_time_s
    angle = -2 * np.pi * band.frequency_hz[:, None] * late  # (points, r)
    turn = np.moveaxis(np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]), (0, 1), (2, 3))
    covariance = turn[:, None] @ band.covariance @ np.swapaxes(turn, -1, -2)[:, None]
    return replace(band, response=band.response * np.exp(1j * angle)[:, None, :], covariance=covariance)
