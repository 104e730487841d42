"""Take Markov parameters that a controller streamed, in place of those estimated on the host."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.display import token, without_quotes
from aeolid.errors import DataError
from aeolid.filters.scales import ChannelSums, find_problems
from aeolid.formats.archive import Archive
from aeolid.formats.table import listed
from aeolid.identify.markov import MarkovEstimate, regressor_columns, with_theta
from aeolid.identify.recursive_spread import LEAST_SHARE, FilterMemory, measure, sample_indices
from aeolid.identify.windows import Scaling, WindowFactor
from aeolid.record import Record

Array = NDArray[np.float64]
GROWTH_MAX = 10.0  # of the variances of a filter that does not say its own; the wire never does
ON_WIRE = 32, 16  # bytes of a channel's name and unit that a controller sends
_READ = ("theta", "residual", "innovation", "settings", "inputs", "outputs", "input_units", "output_units", "sha256",
         "sample_index")  # fmt: skip
SAME_TIME = 0.02  # relative; clocks and rounded time columns differ by less, decimated recordings by more


@dataclass(frozen=True)
class Origin:
    """Hold what a file of Markov parameters says of the filter they come from.

    channels, units: inputs first, r of them, then the outputs; feedthrough: indices of inputs whose present value is a
    regressor; sha256 of the recording that was filtered, empty where samples came over the bus (`wired`: names may be
    cut or made up). memory: how the filter weighed its samples, None where the file does not say.
    """

    channels: tuple[str, ...]
    units: tuple[str, ...]
    inputs: int
    past: int
    model_set: str
    feedthrough: tuple[int, ...]
    sample_time_s: float
    sha256: str
    wired: bool
    memory: FilterMemory | None = None

    @classmethod
    def read(cls, archive: Mapping[str, NDArray[Any]]) -> Origin | None:
        """Read it from the arrays of a markov.npz; None where the file does not say.

        Raises ValueError, TypeError, LookupError, ArithmeticError or AttributeError where it says what cannot be.
        """
        if not {"settings", "inputs", "outputs", "input_units", "output_units"} <= archive.keys():
            return None
        settings, wired = json.loads(str(archive["settings"])), "sample_index" in archive
        channels, units = (
            tuple(str(v) for key in keys for v in archive[key])
            for keys in (("inputs", "outputs"), ("input_units", "output_units"))
        )
        step, past = float(settings["sample_time_s"]), int(settings["past"])
        through, inputs = tuple(int(i) for i in settings["feedthrough"]), len(archive["inputs"])
        if len(units) != len(channels) or not 0 < step < 1e6 or past < 1 or not set(through) <= set(range(inputs)):
            raise ValueError("its settings contradict each other")
        return cls(
            channels, units, inputs, past, str(settings["model_set"]), through, step,
            "" if wired else str(archive["sha256"]), wired, _read_memory(settings, archive, wired),
        )  # fmt: skip

    def find_conflict(
        self, record: Record, method: str, past: int, feedthrough: Sequence[str], sample_time_s: float
    ) -> str:
        """Say how an identification differs from the filter; empty where it does not."""
        inputs, outputs = record.names("input"), record.names("output")
        if self.model_set != method:
            return f"it is of a {self.model_set.upper()} filter: --method {self.model_set}"
        if self.past != past:
            return f"the filter had a past window of {self.past}: --past {self.past}"
        if (self.inputs, len(self.channels)) != (len(inputs), len(inputs + outputs)):
            return (
                f"the filter had {self.inputs} inputs and {len(self.channels) - self.inputs} outputs, the recording has"
                f" {len(inputs)} and {len(outputs)}; use the roles file of the filter, or identify without --markov"
            )
        conflict = self._compare_channels(record, inputs + outputs)
        if conflict:
            return conflict
        present = [n for i, n in enumerate(inputs) if i in self.feedthrough]
        if sorted(present) != sorted(set(feedthrough)):
            asked = " ".join(f"--feedthrough {n}" for n in present) or "no --feedthrough"
            return f"the filter had feedthrough of {', '.join(present) or 'no input'}: {asked}"
        if abs(sample_time_s - self.sample_time_s) > SAME_TIME * self.sample_time_s:
            return (
                f"the filter took a sample every {self.sample_time_s:g} s, the identification every "
                f"{sample_time_s:g} s; use every sample, and no --decimate"
            )
        return ""

    def _compare_channels(self, record: Record, names: Sequence[str]) -> str:
        cut_names, cut_units = ON_WIRE
        here, there = (tuple(n.encode()[:cut_names] for n in group) for group in (names, self.channels))
        if here != there and (not self.wired or sorted(here) == sorted(there)):
            return (
                f"the filter's channels were {', '.join(self.channels)}, the recording's are {', '.join(names)}; "
                "use the roles file of the filter"
            )
        for name, unit in zip(names, self.units, strict=True):
            if unit and unit.encode()[:cut_units] != record.unit(name).encode()[:cut_units]:
                here_unit = record.unit(name) or "no unit"
                return f"channel {name!r} was in {unit} there and is in {here_unit} here; use the same unit"
        return ""


@dataclass(frozen=True, eq=False)
class StreamedMarkov:
    """Hold Ξ (l, p m + d) in the channels' units as `filter` and `listen` write it, order of paper 000 eq. (9) or (14).

    innovation (N, l): what the filter took for e, NaN where it made no update; None where the file has none. origin:
    what the file says of the filter; None where it does not, then only the size of Ξ is checked.
    """

    theta: Array
    source: str
    innovation: Array | None = None
    origin: Origin | None = None

    @classmethod
    def load(cls, path: str | Path) -> StreamedMarkov:
        """Read Ξ, innovations and origin from a markov.npz; raises DataError that names the file."""
        with Archive(path) as archive:
            names = archive.shapes
            if "theta" not in names:
                raise DataError(f"{path}: no array 'theta'; it holds {listed(list(names)) or 'nothing'}")
            content = archive.load([name for name in _READ if name in names])
        try:
            theta = np.asarray(content["theta"], dtype=np.float64)
            # e is the a posteriori residual where the file has it; a stream carries the innovation only
            kinds = [np.asarray(content[k], np.float64) for k in ("residual", "innovation") if k in content]
            innovation = next((e for e in kinds if e.ndim == 2 and np.isfinite(e).any()), None)
            origin = Origin.read(content)
        except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
            cause = token(without_quotes(str(error)), 160)
            raise DataError(f"{path}: not a readable .npz of Markov parameters: {cause}") from None
        if theta.ndim != 2:
            raise DataError(f"{path}: theta has shape {theta.shape}, a matrix (outputs x regressors) is needed")
        if not np.isfinite(theta).all():
            row, column = np.argwhere(~np.isfinite(theta))[0]
            raise DataError(f"{path}: theta[{row}, {column}] is not finite; the snapshot is incomplete, listen longer")
        return cls(theta, str(path), innovation, origin)

    def require_match(
        self, records: Sequence[Record], method: str, past: int, feedthrough: Sequence[str], decimation: int
    ) -> None:
        """Refuse an identification that is not of the filter's kind; raises DataError with what to change."""
        if self.origin is None:
            return
        step = records[0].sample_time_s * decimation
        conflict = self.origin.find_conflict(records[0], method, past, feedthrough, step)
        if conflict:
            raise DataError(f"{self.source}: {conflict}")

    def innovation_of(self, records: Sequence[Record]) -> Array | None:
        """Return the filter's innovations (N, l), None where they are of other samples than these recordings'."""
        rows = sum(len(r) for r in records)
        if self.innovation is None or len(self.innovation) != rows:
            return None
        told = self.origin.sha256 if self.origin is not None else ""
        return None if told and [r.sha256 for r in records] != [told] else self.innovation

    def replace_in(
        self, estimate: MarkovEstimate, records: Sequence[Record], factor: WindowFactor, scaling: Scaling,
        through: tuple[bool, ...],
    ) -> tuple[MarkovEstimate, tuple[str, ...]]:  # fmt: skip
        """Return the estimate with Ξ from the stream, scaled as the samples, and what is to be said of it.

        records: with the channels of `scaling`. Its noise is that of the filter where the recordings are those that the
        filter saw; else standard deviations are not known, and a note says why.
        """
        theta = self.scaled(scaling, factor.past, through)
        plain = with_theta(estimate, theta, factor)
        memory, why = self._memory_of(records)
        hidden = self._hidden_channels(records, scaling)
        if memory is not None:
            found = measure(records, scaling, factor, theta, regressor_columns(factor, through), memory)
            if found.share >= LEAST_SHARE:
                known = replace(
                    plain, spread=found.spread, direct=found.direct, bias=found.bias,
                    residual_covariance=found.residual_covariance,
                )  # fmt: skip
                return known, hidden
            why = (
                f"the recording holds {found.share:.0%} of what the filter had learnt from, {LEAST_SHARE:.0%} are"
                " needed; record from the filter's start"
            )
        note = f"standard deviations are not known: {why}"
        return replace(plain, spread=np.full_like(plain.spread, np.nan)), (note, *hidden)

    def _hidden_channels(self, records: Sequence[Record], scaling: Scaling) -> tuple[str, ...]:
        """Say which channels of these recordings the filter hardly saw with its offsets and scales."""
        names = (*scaling.inputs, *scaling.outputs)
        if self.origin is None or self.origin.memory is None or len(self.origin.memory.offset) != len(names):
            return ()
        sums = ChannelSums.empty(len(names))
        for record in records:
            sums.add(record.columns(names))
        units = tuple(records[0].unit(name) for name in names)
        found = find_problems(names, units, self.origin.memory.offset, self.origin.memory.scale, sums)
        return tuple(f"the filter that streamed: {problem}" for problem in found)

    def _memory_of(self, records: Sequence[Record]) -> tuple[FilterMemory | None, str]:
        """Return how the filter weighed the samples of these recordings, or None and why that cannot be said."""
        memory = self.origin.memory if self.origin is not None else None
        if self.origin is None or memory is None:
            return None, f"{self.source} does not say how the filter weighed its samples"
        if self.origin.wired:
            if memory.last is None:
                return None, f"{self.source} does not say which sample was the last that the parameters are made of"
            starts = [sample_indices(r)[[0, -1]] for r in records]
            if any(b[0] <= a[1] for a, b in pairwise(starts)):
                return None, "the recordings are not successive parts of one stream"
        elif [r.sha256 for r in records] != [self.origin.sha256]:
            return None, f"{self.source} is of another recording; identify the one that was filtered"
        return memory, ""

    def scaled(self, scaling: Scaling, past: int, through: tuple[bool, ...]) -> Array:
        """Return Ξ (l, p m + r) in the scaled units of the windows; raises DataError when its size does not fit."""
        outputs, m, r = len(scaling.outputs), scaling.channels, len(scaling.inputs)
        present = [i for i in range(r) if through[i]]
        expected = (outputs, past * m + len(present))
        if self.theta.shape != expected:
            other = {
                (outputs, past * (m + outputs) + len(present)): "; it is of a VARMAX filter: --method varmax",
                (outputs, past * (m - outputs) + len(present)): "; it is of a VARX filter: --method varx",
            }
            raise DataError(
                f"{self.source}: theta is {self.theta.shape[0]}x{self.theta.shape[1]}; past window {past} with {r} "
                f"inputs, {outputs} outputs and feedthrough of {len(present)} needs {expected[0]}x{expected[1]}"
                + other.get(self.theta.shape, "")
            )
        keep = [*range(past * m), *(past * m + i for i in present)]
        columns = np.concatenate([np.tile(scaling.scale, past), scaling.scale[:r][present]])
        theta = np.zeros((outputs, past * m + r))
        theta[:, keep] = self.theta * columns / scaling.scale[r : r + outputs, None]
        return theta


def _read_memory(settings: dict[str, Any], archive: Mapping[str, NDArray[Any]], wired: bool) -> FilterMemory | None:
    """Read how the filter weighed its samples; None where the file does not say."""
    keys = ("forgetting", "regularisation", "offset", "scale")
    if any(settings.get(key) is None for key in keys):
        return None
    numbers: list[Any] = [settings[key] for key in keys]
    count = len(archive["inputs"]) + len(archive["outputs"])
    offset, scale = (np.asarray(n, dtype=np.float64)[:count] for n in numbers[2:])
    if len(offset) != count or len(scale) != count or not np.all(scale > 0) or not 0 < float(numbers[0]) <= 1:
        return None
    last = int(archive["sample_index"]) if wired else -1
    # the wire does not carry the guards of the filter: their defaults
    growth, ridge = float(settings.get("growth_max") or GROWTH_MAX), float(numbers[1])
    if not np.isfinite([growth, ridge, *offset, *scale]).all():
        return None
    return FilterMemory(float(numbers[0]), ridge, offset, scale, growth, last if last >= 0 else None)


def theta_in_units(theta: Array, scaling: Scaling, past: int) -> Array:
    """Undo the scaling of Ξ (l, p m + r): what `StreamedMarkov.scaled` does, backwards."""
    r, outputs = len(scaling.inputs), len(scaling.outputs)
    columns = np.concatenate([np.tile(scaling.scale, past), scaling.scale[:r]])
    out: Array = scaling.scale[r : r + outputs, None] * theta / columns
    return out
