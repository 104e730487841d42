"""Say how inputs go on between their samples and which instant a row belongs to: what it is, and how a model has it.

Both are habits of a recording, not physics: a measured input went on changing where a command is held, and a logger may
write an output at the end of the interval whose command stands beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.forensics import Finding
from aeolid.diagnose.rules import in_force
from aeolid.models.equations import TIME, Equations, InputFilter, Parameter
from aeolid.models.intersample import FILTER, FILTERED, HOLDS, OFFSET
from aeolid.models.intersample import PREFIX as KIND
from aeolid.record import Record

Array = NDArray[np.float64]
ROOM = 1.05  # samples: an offset of one sample has a deviation, too
SLOWEST = 1.0  # samples: delay of an anti-alias filter whose corner is 0.45 of the Nyquist frequency
_FASTEST = 1e-3  # samples: a filter without a delay is none
_CORNER = 2**0.5 / (2 * np.pi)  # corner in Hz times delay of a second-order Butterworth filter
_WORDS = {
    "zoh": "held over each sample (zoh)",
    "foh": "straight from sample to sample (foh)",
    "band_limited": "the smooth curve through its samples (band-limited)",
    FILTERED: "held over each sample (zoh), of outputs that passed a filter",
}
_LOOKS = {
    "declared": "as the roles file says",
    "held": "it keeps its value for several samples",
    "rough": "it changes up to the Nyquist frequency, as a command does",
    "smooth": "by likelihood",
}


@dataclass(frozen=True)
class Sampling:
    """Say how a recording is read: the hold of each input, and by how much all of them act after their stamps, in s.

    filter_s: delay of the filter that all outputs passed, where holds are "filtered". free: whether fits go on
    estimating offset and delay; gain: nats over the inputs held, without an offset.
    """

    holds: tuple[tuple[str, str], ...] = ()
    offset_s: float = 0.0
    filter_s: float = 0.0
    free: bool = False
    gain: float = 0.0

    @property
    def is_plain(self) -> bool:
        """Tell whether nothing is to be done: all inputs held, no offset."""
        return self.offset_s == 0.0 and not self.free and all(h == "zoh" for _, h in self.holds)

    @property
    def is_held(self) -> bool:
        """Tell whether all inputs are held, whatever the outputs passed."""
        return all(h in (HOLDS[0], FILTERED) for _, h in self.holds)

    @property
    def is_filtered(self) -> bool:
        """Tell whether outputs passed a filter."""
        return any(h == FILTERED for _, h in self.holds)

    @property
    def late_s(self) -> float:
        """Return by how much outputs show their inputs late in all, offset and filter, in s; early below 0."""
        return self.offset_s + (self.filter_s if self.is_filtered else 0.0)


@dataclass(frozen=True)
class Trait:
    """Hold what an input looks like ("declared", "held", "rough", "smooth"), and its hold where that settles it."""

    name: str
    kind: str
    hold: str | None


def with_sampling(model: Equations, sampling: Sampling, step: float) -> Equations:
    """Return the model whose inputs pass first what lies between their samples; step: of the recording, s."""
    own = (OFFSET, FILTER)
    kept = tuple(f for f in model.filters if not f.kind.startswith(KIND))
    model = replace(model, parameters=tuple(p for p in model.parameters if p.name not in own), filters=kept)
    if sampling.is_plain:
        return model
    reach, free = max(ROOM * step, abs(sampling.offset_s)), sampling.free
    prior = in_force().data.offset_prior * step if free else None
    added = [Parameter(OFFSET, sampling.offset_s, "s", -reach, reach, free, prior)]
    if sampling.is_filtered:
        slowest = max(SLOWEST * step, sampling.filter_s)
        added.append(Parameter(FILTER, sampling.filter_s, "s", _FASTEST * step, slowest, free))
    return replace(model, parameters=(*model.parameters, *added), filters=(*filters_of(sampling), *kept))


def filters_of(sampling: Sampling) -> tuple[InputFilter, ...]:
    """Return what stands in front of a model for a sampling."""
    return tuple(
        InputFilter(name, f"{KIND}{hold}", (OFFSET, FILTER) if hold == FILTERED else (OFFSET,))
        for name, hold in sampling.holds
    )


def traits_of(records: Sequence[Record], names: Sequence[str]) -> tuple[Trait, ...]:
    """Say of each input whether it is declared, held for several samples, rough up to Nyquist, or smooth.

    Time and rotor angles are left out: nothing is recorded of the one, the other jumps once a turn.
    """
    known = {c.name: c for c in records[0].channels if c.role != "azimuth" and c.name != TIME}
    found = []
    for name in (n for n in names if n in known):
        hold = known[name].hold
        kind = "declared" if hold in HOLDS else _kind([r.column(name) for r in records])
        found.append(Trait(name, kind, hold if hold in HOLDS else None if kind == "smooth" else "zoh"))
    return tuple(found)


def _kind(series: Sequence[Array]) -> str:
    rules = in_force().data
    repeats = changes = 0
    power = np.zeros(2)
    for values in series:
        v = values[np.isfinite(values)]
        if len(v) < 3:  # a Hann window of two is nothing
            continue
        repeats, changes = repeats + int(np.sum(np.diff(v) == 0)), changes + len(v) - 1
        shape = np.abs(np.fft.rfft((v - v.mean()) * np.hanning(len(v)))) ** 2
        power += np.array([shape[int(rules.rough_from * len(shape)) :].sum(), shape.sum()])
    if not changes or repeats > rules.repeats_share * changes or power[1] <= 0:
        return "held"
    return "rough" if power[0] > rules.rough_share * power[1] else "smooth"


def declared_sampling(records: Sequence[Record], names: Sequence[str]) -> Sampling:
    """Return what the roles file declares; what it leaves open is held until the likelihood says otherwise."""
    return Sampling(tuple((t.name, t.hold or "zoh") for t in traits_of(records, names)))


def sampling_findings(records: Sequence[Record], sampling: Sampling, step: float) -> tuple[Finding, ...]:
    """Return the notes of the data checks: the hold of each input and why, the offset where there is one."""
    looks = {t.name: t.kind for t in traits_of(records, [n for n, _ in sampling.holds])}
    found = [
        Finding("intersample", name, f"{_WORDS[hold]}: {_LOOKS[looks[name]]}", "info") for name, hold in sampling.holds
    ]
    return (*found, *_late_findings(sampling, step))


def _late_findings(sampling: Sampling, step: float) -> tuple[Finding, ...]:
    """Return the notes on a filter of the outputs and on the offset between inputs and outputs."""
    found, settled = [], f"settled with the baseline ({sampling.gain:.4g} nats for how the inputs are read in all)"
    if sampling.is_filtered:
        text = (
            f"the response to the inputs is smoothed and late by {sampling.filter_s:.4g} s"
            f" ({sampling.filter_s / step:.2f} samples), as behind an anti-aliasing filter with a corner at"
            f" {_CORNER / sampling.filter_s:.3g} Hz; a drive faster than the sampling looks the same: {settled}"
        )
        found.append(Finding("filter", "all outputs", text, "info"))
    if sampling.offset_s:
        share, way = abs(sampling.offset_s) / step, "before" if sampling.offset_s < 0 else "after"
        text = (
            f"inputs act {abs(sampling.offset_s):.4g} s ({share:.2f} samples) {way} the rows that hold them beside the"
            f" outputs: a habit of the logger, {settled}"
        )
        found.append(Finding("offset", "all inputs", text, "info"))
    return tuple(found)
