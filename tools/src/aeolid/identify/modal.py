"""Find the modes of recordings of outputs alone: poles over orders and windows, clustered, with deviations and shapes.

Values of a mode are the medians over the models that count; all are estimates from the same data, so that their median
deviation, not that over the root of their number, is that of the median. What order and window still move a mode by is
added to it: σ² = median(σ_i)² + var over the models, for frequency, damping and each entry of the shape alike.

The first window is the shortest that predicts no worse than chance explains. Where many poles stay over the orders of
the longest window and not of all, one below two periods of the slowest mode is doubled, as far as the data leave longer
ones to compare with: what a window leaves out is little of the error and much of a weak mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.decompositions import pinv
from aeolid.errors import UsageError
from aeolid.geometry import Geometry, united
from aeolid.identify.clusters import Cluster, Criteria, cluster
from aeolid.identify.diagram import Diagram, Pole, draw_up, ladder_of, shortest_window
from aeolid.identify.folding import tell_of_folding
from aeolid.identify.harmonics import marked
from aeolid.identify.mode_names import mode_lines
from aeolid.identify.output_only import ALL, of_outputs_alone
from aeolid.identify.prepare import at_a_glance, slower
from aeolid.identify.recorded_speed import turning_as_recorded, unread
from aeolid.identify.request_checks import check_whole
from aeolid.identify.rotor import Rotation, rotation
from aeolid.identify.uncertainty import covariance_of
from aeolid.identify.windows import find_scaling
from aeolid.models.blade_sets import in_fixed_frame
from aeolid.models.fill_values import told_with, without_fill_values
from aeolid.models.modes import Mode
from aeolid.models.prediction import complete_stretches
from aeolid.models.shapes import Shape, index_of_reference
from aeolid.models.wire_frame import complexity_lines, geometry_facts
from aeolid.record import Record
from aeolid.wording import counted

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
UNSETTLED = 1 / 3  # of the modes found: fewer poles that move with the window may be noise
TWICE = 2  # periods of the slowest mode: a window of more is not doubled, for poles of noise then stay as well
APART = 1.2  # of two windows: closer ones share too much to tell what moves
ROUNDING = 1e-12  # of the largest variance: less is none
FEWEST, LONGEST = 32, 2048  # samples of a segment of the spectrum


@dataclass(frozen=True, eq=False)
class Modal:
    """Hold the modes of recordings of outputs alone and the diagram behind them.

    modes: by frequency, harmonics and steady sines among them, marked; stability: of each the cluster it came from;
    spurious: clusters that are not physical; sources: of each recording its name, SHA-256 and samples.
    spectrum: frequencies in Hz, and the sum of the outputs' spectra, each in its own scale. geometry: where the
    sensors are, None where the roles file does not say it. notes: what was done to the samples first, plain warnings.
    """

    modes: tuple[Mode, ...]
    stability: tuple[Cluster, ...]
    spurious: tuple[Cluster, ...]
    diagram: Diagram
    criteria: Criteria
    turning: Rotation | None
    sources: tuple[dict[str, Any], ...]
    spectrum: tuple[Array, Array]
    geometry: Geometry | None = None
    notes: tuple[str, ...] = ()

    @property
    def listed(self) -> tuple[Mode, ...]:
        """Return the modes without harmonics and steady sines."""
        return tuple(m for m in self.modes if not m.rotor_order and not m.tone)

    def to_json(self) -> dict[str, Any]:
        """Return the facts for machines."""
        d, turning = self.diagram, self.turning
        return {
            "outputs": list(d.outputs), "sample_time_s": d.sample_time_s, "data": list(self.sources),
            "rotor_hz": None if turning is None else turning.frequency_hz,
            "rotor_deviation_hz": None if turning is None else turning.deviation_hz,
            "past": d.past, "order": d.order, "windows": list(d.windows), "orders": [d.orders[0], d.orders[-1]],
            "criteria": self.criteria.to_json(),
            "modes": [m.to_json() | {"stability": c.to_json()} for m, c in self._pairs() if m in self.listed],
            "harmonics": [m.to_json() | {"stability": c.to_json()} for m, c in self._pairs() if m not in self.listed],
            "unsettled_hz": list(self.unsettled), "notes": list(self.notes), "poles": self._pole_facts(),
            "spectrum": {"frequency_hz": self.spectrum[0].tolist(), "power": self.spectrum[1].tolist()},
        } | geometry_facts(self.geometry, self.listed)  # fmt: skip

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        d, h = self.diagram, self.diagram.sample_time_s
        lines = [
            f"windows of {', '.join(map(str, d.windows))} samples, orders {d.orders[0]} to {d.orders[-1]}; window "
            f"{d.past} ({d.past * h:.3g} s) and order {d.order} predict held-out samples; values are medians from "
            f"order {min(n for _, n in d.counting)}",
            *mode_lines(self.modes, h),
            *self._shape_lines(),
            *complexity_lines(self.geometry, self.listed),
            f"{counted(len(self.spurious), 'cluster')} of poles that come and go with order and window: spurious",
            *self._unsettled_lines(),
        ]
        if not self.listed:
            lines.append("no mode is stable over orders and windows; record longer, or lower the rate (--decimate)")
        return "\n".join([*lines, *self.notes])

    @property
    def unsettled(self) -> tuple[float, ...]:
        """Return frequencies in Hz at which poles stay over the orders of the longest window, but not of all."""
        longest, known = self.diagram.windows[-1], [m.frequency_hz for m in self.modes]
        found = [
            c.centre.frequency_hz for c in self.spurious if c.by_window.get(longest, 0.0) >= self.criteria.share
        ]  # fmt: skip
        return tuple(f for f in found if all(abs(f - k) > self.criteria.frequency * k for k in known))

    def _unsettled_lines(self) -> list[str]:
        if not self.unsettled:
            return []
        told = ", ".join(f"{f:.4g}" for f in self.unsettled)
        return [
            f"poles at {told} Hz stay over the orders of window {self.diagram.windows[-1]} and move with the window: "
            "neither modes nor spurious for sure; lengthen --past, or --decimate"
        ]

    def _pairs(self) -> list[tuple[Mode, Cluster]]:
        return list(zip(self.modes, self.stability, strict=True))

    def _shape_lines(self) -> list[str]:
        """Return a line a mode: each output's amplitude and phase beside the reference."""
        if len(self.diagram.outputs) < 2 or not self.listed:
            return []
        lines = ["  shapes (amplitude beside the reference, phase in degrees):"]
        for mode in self.listed:
            if mode.shape is None:
                continue
            parts = [
                f"{name} {abs(value):.3g} at {np.degrees(np.angle(value)):.0f}"
                for name, value in mode.shape.values.items() if name != mode.shape.reference
            ]  # fmt: skip
            lines.append(f"    {mode.frequency_hz:.4g} Hz: {mode.shape.reference} 1, {', '.join(parts)}")
        return lines

    def _pole_facts(self) -> dict[str, list[Any]]:
        """Return all poles as columns; cluster: the frequency of the mode they belong to, None for spurious ones."""
        home = {id(p): m.frequency_hz for m, c in self._pairs() for p in c.poles}
        poles = self.diagram.poles
        return {
            "past": [p.past for p in poles], "order": [p.order for p in poles],
            "frequency_hz": [p.frequency_hz for p in poles], "damping": [p.damping for p in poles],
            "frequency_std_hz": [_known(p.frequency_std_hz) for p in poles],
            "damping_std": [_known(p.damping_std) for p in poles], "mode_hz": [home.get(id(p)) for p in poles],
        }  # fmt: skip


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def find_modal(
    records: Sequence[Record], *, outputs: Sequence[str] | str | None = None, past: int | None = None,
    largest: int | None = None, decimation: int = 1, reference: str | None = None, criteria: Criteria | None = None,
    blades: Sequence[str] | str | None = None,
) -> Modal:  # fmt: skip
    """Find the modes of one experiment set by its outputs alone.

    outputs: names, default all of the role; inputs are left out. past: window in samples; largest: order of the
    diagram; both default by the data (`diagram`). decimation: factor by which the rate is lowered first. reference:
    output that shapes are scaled to. criteria: of the clusters. blades: sets that go to the fixed frame first, as in
    `blade_sets.find_sets`. Samples that read a fill value count as missing, and a note says so (`fill_values`).
    Raises UsageError on settings that cannot be, NotIdentifiable on too few samples.
    """
    asked = {"decimate": decimation, "past": past, "largest-order": largest}
    check_whole({option: value for option, value in asked.items() if value is not None})
    if past is not None and past < 2:
        raise UsageError(f"past window {past} is not at least 2")
    if largest is not None and largest < 2:
        raise UsageError(f"largest order {largest} is not at least 2")
    named = [outputs] if isinstance(outputs, str) else list(outputs or [ALL])
    known, filled = without_fill_values(records)
    with told_with(filled):
        found = _found(known, named, past, largest, decimation, reference, criteria, blades)
    return replace(found, notes=(*filled, *unread(known[0]), *found.notes))


def _found(
    records: Sequence[Record], outputs: Sequence[str], past: int | None, largest: int | None, decimation: int,
    reference: str | None, criteria: Criteria | None, blades: Sequence[str] | str | None,
) -> Modal:  # fmt: skip
    """Find the modes as `find_modal`, fill values missing already."""
    alone = of_outputs_alone(in_fixed_frame(records, blades), outputs)
    at = index_of_reference(alone[0].names("output"), reference)
    known = at_a_glance(alone, "auto", "offset", "auto").each(partial(slower, factor=decimation))
    seen = turning_as_recorded(known.records, alone)
    scaling = find_scaling(seen)
    ladder = ladder_of(known, scaling, past)
    window, criteria = past or shortest_window(ladder), criteria or Criteria()
    while True:
        found = _gathered(draw_up(ladder, scaling, window, largest), criteria, seen, records, at)
        longer = _longer(found, window)
        if past is not None or longer == window or ladder.longest < APART * longer:
            return _with_images_marked(found, alone, decimation)
        window = longer


def _longer(found: Modal, window: int) -> int:
    """Return the window that a result asks for, samples: that it had where it is long enough."""
    slowest = min((m.frequency_hz for m in found.listed), default=np.inf)
    period = round(1 / (slowest * found.diagram.sample_time_s))
    many = len(found.unsettled) > max(UNSETTLED * len(found.modes), 1)
    return 2 * window if many and window < TWICE * period else window


def _gathered(
    diagram: Diagram, criteria: Criteria, seen: Sequence[Record], records: Sequence[Record], reference: int | None
) -> Modal:
    """Return what the poles of a diagram say; seen: the recordings as they were used."""
    clusters = cluster(diagram, criteria)
    found = [(_mode(c, diagram, reference), c) for c in clusters if c.physical]
    found = [(mode, c) for mode, c in found if criteria.is_narrow(mode, diagram.duration_s)]
    found.sort(key=lambda pair: pair[0].frequency_hz)
    kept = [c for _, c in found]
    return Modal(
        marked([mode for mode, _ in found], seen, output_only=True), tuple(kept),
        tuple(c for c in clusters if c not in kept), diagram, criteria, rotation(seen[0]),
        tuple({"source": r.source, "sha256": r.sha256, "samples": len(r)} for r in records),
        _spectrum(seen, diagram), united(r.geometry for r in records),
    )  # fmt: skip


def _with_images_marked(found: Modal, raw: Sequence[Record], factor: int) -> Modal:
    """Return what was found at a lowered rate, what may be the image of a mode beyond its half marked as such.

    raw: the recordings before. A pole at half of the rate counts as spurious. Notes say what folds.
    """
    if factor == 1:
        return found
    kept, notes = tell_of_folding(found.modes, found.notes, raw, factor)
    own = [m.eigenvalue for m in kept]
    stays = [m.eigenvalue in own for m in found.modes]
    stability = tuple(c for c, here in zip(found.stability, stays, strict=True) if here)
    gone = tuple(c for c, here in zip(found.stability, stays, strict=True) if not here)
    images = [f"{m.frequency_hz:.4g} Hz of {m.folded_from_hz:.4g} Hz" for m in kept if m.folded_from_hz is not None]
    if images:
        notes = (*notes, f"may be images of what lies beyond half of the lowered rate: {', '.join(images)}")
    return replace(found, modes=kept, stability=stability, spurious=(*found.spurious, *gone), notes=notes)


def _spectrum(records: Sequence[Record], diagram: Diagram) -> tuple[Array, Array]:
    """Return frequencies and the sum of the outputs' spectra by Welch's method, over the longest complete stretch."""
    from scipy.signal import welch  # a second to load

    stretches = [
        (b - a, r.columns(diagram.outputs)[a:b])
        for r in records for a, b in complete_stretches(r.columns(diagram.outputs), 2)
    ]  # fmt: skip
    length, y = max(stretches, key=lambda s: s[0], default=(0, np.zeros((0, 1))))
    if length < FEWEST:
        return np.zeros(0), np.zeros(0)
    part = min(max(length // 8, FEWEST), LONGEST)
    hertz, power = welch(y / diagram.scaling.scale, fs=1 / diagram.sample_time_s, nperseg=part, axis=0)
    return np.asarray(hertz, dtype=np.float64), np.asarray(power.sum(axis=1), dtype=np.float64)


def _mode(cluster: Cluster, diagram: Diagram, reference: int | None) -> Mode:
    """Return a cluster as a mode: medians, with the deviations of a model and what the models differ by."""
    poles = cluster.counted
    told = np.array([[p.frequency_hz, p.damping, p.frequency_std_hz, p.damping_std] for p in poles])
    hertz, damping, *own = np.median(told, axis=0)
    spread = np.hypot(own, told[:, :2].std(axis=0))
    size = np.median([abs(p.shape) for p in poles], axis=0)
    at = int(np.argmax(size)) if reference is None else reference
    s = 2 * np.pi * hertz * (-damping + 1j * np.sqrt(max(1 - damping**2, 0.0)))
    shares = dict(zip(diagram.outputs, map(float, size / size.sum()), strict=True))
    return Mode(
        float(hertz), float(damping), complex(np.exp(s * diagram.sample_time_s)), float(spread[0]), float(spread[1]),
        shares, shape=_shape(poles, diagram, at, float(hertz)),
    )  # fmt: skip


def _shape(poles: Sequence[Pole], diagram: Diagram, at: int, hertz: float) -> Shape:
    """Return the median shape in the channels' units, beside the output at an index, its phases shrunk."""
    scale, names = diagram.scaling.scale, diagram.outputs
    every = np.array([p.shape / p.shape[at] for p in poles])  # (models, l)
    middle = np.median(every.real, axis=0) + 1j * np.median(every.imag, axis=0)
    far = [abs(p.frequency_hz - hertz) for p in poles]  # of an even number two lie alike around the median
    near = [p for p, d in zip(poles, far, strict=True) if d <= min(far) + 1e-6 * hertz]
    nearest = max(near, key=lambda p: (p.past, p.order))
    reach = diagram.model(nearest.past, nearest.order).shape_reach(nearest.eigenvalue, at)  # (l, white noises)
    apart = (every - every.mean(axis=0)).T / np.sqrt(len(every))
    around = np.array([covariance_of(row) for row in np.hstack([reach, apart])])
    middle = shrunk_phases(middle, np.hstack([reach, apart]).imag)
    unit = scale / scale[at]
    values = dict(zip(names, map(complex, middle * unit), strict=True))
    spread = {
        name: (float(s[0, 0] * u**2), float(s[0, 1] * u**2), float(s[1, 1] * u**2))
        for name, s, u in zip(names, around, unit, strict=True)
    }
    return Shape(names[at], values, spread if np.isfinite(around).all() else None)


def shrunk_phases(shape: ComplexArray, reach: Array) -> ComplexArray:
    """Return a shape (l,), 1 at its reference, its imaginary parts less by what chance explains of them.

    reach (l, k): what white noise of unit variance makes of the imaginary parts. Where damping is in proportion to
    mass and stiffness a shape is real, and nearly so in most structures; with χ² = ιᵀ S⁻¹ ι of the imaginary parts ι
    (degrees of freedom ν) they are multiplied by max(0, 1 − 2ν/χ²). With ν/χ² that is the empirical Bayes estimate of
    what scatters about none by an unknown variance (Efron and Morris 1973); twice that, none is left until Akaike's
    criterion prefers a complex shape. A shape that is surely complex stays as it is.
    """
    power = (reach**2).sum(axis=1)
    moving = np.flatnonzero(power > ROUNDING * power.max(initial=0.0))  # all but the reference
    if not len(moving) or not np.isfinite(reach).all():
        return shape
    own = shape.imag[moving]
    statistic, freedom = float(own @ pinv(reach[moving] @ reach[moving].T, 1e-9, hermitian=True) @ own), len(moving)
    kept = max(0.0, 1 - 2 * freedom / statistic) if statistic > 0 else 0.0
    out: ComplexArray = shape.real + 1j * kept * shape.imag
    return out
