"""Bring a recording to a model's rate, causes before their effects, and its inputs to what lies between samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.models.equations import Equations, InputFilter, Parameter
from aeolid.models.intersample import OFFSET, PREFIX
from aeolid.record import Record
from aeolid.wording import counted

FEWEST = 10  # long samples; fewer are no recording
AVERAGED = ("input", "disturbance", "excitation", "scheduling")  # what acts all through a sample
SAME = 1e-3  # relative; clocks and rounded time columns differ by less


def decimate_causally(record: Record, factor: int) -> Record:
    """Return longer samples: what acts is averaged over each, what is measured is read at its start.

    With x_{k+1} = A x_k + B u_k, y_k = C x_k and blocks of M samples, the state at the start of the next block is
    A^M x + Σ A^{M−1−i} B u_i over the block: inputs of block j drive the outputs at the start of block j + 1 and no
    earlier ones, as in the recording itself, and their mean stands for them as long as the plant changes little within
    a block. Noise that a controller feeds back is in inputs of its own block and later ones; a filter that reads later
    samples, or one over the outputs, puts it into earlier ones as well, and the model of a loop is biased by it.

    factor: M ≥ 1; 1 returns the recording. Inputs, disturbances, excitation and scheduling are averaged over samples
    j M … j M + M − 1, missing where one of them is; every other channel is read at j M. An incomplete block at the end
    is left out. Outputs are not filtered: what they hold above the new Nyquist frequency folds down.
    Raises UsageError on another factor, NotIdentifiable where fewer than 10 long samples remain.
    """
    if factor == 1:
        return record
    if factor < 1:
        raise UsageError(f"decimation factor {factor} is not a whole number of at least 1")
    count = len(record) // factor
    if count < FEWEST:
        raise NotIdentifiable(
            f"{record.source}: {counted(len(record), 'sample')}; decimation by {factor} needs at least "
            f"{FEWEST * factor}"
        )
    rows = record.values[: count * factor]
    values = rows[::factor].copy()
    acting = [i for i, channel in enumerate(record.channels) if channel.role in AVERAGED]
    values[:, acting] = rows[:, acting].reshape(count, factor, len(acting)).mean(axis=1)
    time, step = record.time_s[: count * factor : factor], record.sample_time_s * factor
    return replace(record, time_s=time, values=values, sample_time_s=step)


def same_step(sample_time_s: float, step: float) -> bool:
    """Tell whether a recording of this sample time, s, is at the sample time of a discrete-time model.

    >>> same_step(0.1, 0.1 * (1 + SAME / 2)), same_step(0.1, 0.1 * (1 + 2 * SAME))
    (True, False)
    """
    return abs(sample_time_s - step) <= SAME * sample_time_s


def at_rate_of(sample_time_s: float, record: Record) -> Record:
    """Return a recording at the sample time of a discrete-time model, whose inputs hold over each of its samples.

    sample_time_s: of the model, s; 0 (continuous time) and that of the recording return the recording. A whole multiple
    of the recording's is reached by `decimate_causally`, as `identify --decimate` does. Raises DataError on any other.
    """
    if sample_time_s <= 0 or same_step(sample_time_s, record.sample_time_s):
        return record
    ratio = sample_time_s / record.sample_time_s
    factor = round(ratio)
    if factor > 1 and abs(ratio - factor) <= SAME * factor:
        return decimate_causally(record, factor)
    raise DataError(
        f"{record.source}: sample time {record.sample_time_s:g} s, the model has {sample_time_s:g} s, {ratio:.4g} "
        "times as much and no whole multiple; " + _remedy(record.sample_time_s, sample_time_s)
    )


def holds_of(record: Record, names: Sequence[str]) -> list[str]:
    """Return how the roles file lets each of these inputs go on between samples; held where it leaves that open."""
    known = {c.name: c.hold for c in record.channels}
    return ["zoh" if known.get(n, "auto") == "auto" else known[n] for n in names]


def read_as_declared(model: Equations, record: Record) -> Equations:
    """Return a model whose inputs go on between the samples of a recording as its roles file says.

    A model that says so itself, as a corrected one does, is returned as it is.
    """
    names = [s.name for s in model.inputs]
    own = [(n, h) for n, h in zip(names, holds_of(record, names), strict=True) if h != "zoh"]
    if not own or any(f.kind.startswith(PREFIX) for f in model.filters):
        return model
    filters = tuple(InputFilter(n, f"{PREFIX}{h}", (OFFSET,)) for n, h in own)
    parameters = (*model.parameters, Parameter(OFFSET, 0.0, "s"))
    return replace(model, parameters=parameters, filters=(*filters, *model.filters))


def rate_of(model: object) -> float:
    """Return the sample time of a model of any kind in seconds; 0 where it has none of its own."""
    inner = getattr(model, "state_space", model)
    value = getattr(inner, "sample_time_s", 0.0)
    return float(value) if isinstance(value, int | float) else 0.0


def _remedy(recorded: float, wanted: float) -> str:
    if wanted < recorded:
        return f"record at {wanted:g} s or faster, or identify a model from recordings of {recorded:g} s"
    return f"resample the recording to {wanted:g} s, or identify with --decimate {max(round(wanted / recorded), 1)}"
