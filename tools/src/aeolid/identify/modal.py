"""Find the modes of recordings of outputs alone: poles over orders and windows, clustered, with deviations and shapes.

Values of a mode are those of the model of the window and order that predict the held-out part, or of the nearest that
has it: estimates of one model have the deviations that are said, a mean over models that share their data has not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.clusters import Cluster, Criteria, cluster
from aeolid.identify.diagram import Diagram, Pole, draw_up
from aeolid.identify.harmonics import marked
from aeolid.identify.mode_names import mode_lines
from aeolid.identify.output_only import ALL, of_outputs_alone
from aeolid.identify.prepare import at_a_glance
from aeolid.identify.rotor import Rotation, rotation
from aeolid.models.modes import Mode
from aeolid.models.rate import decimate_causally
from aeolid.models.shapes import Shape, index_of_reference
from aeolid.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Modal:
    """Hold the modes of recordings of outputs alone and the diagram behind them.

    modes: by frequency, harmonics and steady sines among them, marked; stability: of each the cluster it came from;
    spurious: clusters that are not physical; sources: of each recording its name, SHA-256 and samples.
    """

    modes: tuple[Mode, ...]
    stability: tuple[Cluster, ...]
    spurious: tuple[Cluster, ...]
    diagram: Diagram
    criteria: Criteria
    turning: Rotation | None
    sources: tuple[dict[str, Any], ...]

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
            "poles": self._pole_facts(),
        }  # fmt: skip

    def summary(self) -> str:
        """Return the result as a few lines of text."""
        d, h = self.diagram, self.diagram.sample_time_s
        lines = [
            f"windows of {', '.join(map(str, d.windows))} samples, orders {d.orders[0]} to {d.orders[-1]}; values are "
            f"those of window {d.past} ({d.past * h:.3g} s) and order {d.order}, which predict held-out samples",
            *mode_lines(self.modes, h),
            *self._shape_lines(),
            f"{len(self.spurious)} clusters of poles come and go with order and window: spurious",
        ]
        if not self.listed:
            lines.append("no mode is stable over orders and windows; record longer, or lower the rate (--decimate)")
        return "\n".join(lines)

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
) -> Modal:  # fmt: skip
    """Find the modes of one experiment set by its outputs alone.

    outputs: names, default all of the role; inputs are left out. past: window in samples; largest: order of the
    diagram; both default by the data (`diagram`). decimation: factor by which the rate is lowered first. reference:
    output that shapes are scaled to. criteria: of the clusters. Raises UsageError on settings that cannot be,
    NotIdentifiable on too few samples.
    """
    if past is not None and past < 2:
        raise UsageError(f"past window {past} is not at least 2")
    if largest is not None and largest < 2:
        raise UsageError(f"largest order {largest} is not at least 2")
    named = [outputs] if isinstance(outputs, str) else list(outputs or [ALL])
    alone = of_outputs_alone(list(records), named)
    at = index_of_reference(alone[0].names("output"), reference)
    seen = [decimate_causally(r, decimation) for r in at_a_glance(alone, "auto", "offset", "auto")]
    criteria = criteria or Criteria()
    diagram = draw_up(seen, past, largest)
    clusters = cluster(diagram, criteria)
    kept = [c for c in clusters if c.physical]
    chosen = [c.nearest_to(diagram.past, diagram.order) for c in kept]
    order = np.argsort([p.frequency_hz for p in chosen], kind="stable")
    modes = [_mode(chosen[i], diagram, at) for i in order]
    return Modal(
        marked(modes, seen, output_only=True), tuple(kept[i] for i in order),
        tuple(c for c in clusters if not c.physical), diagram, criteria, rotation(seen[0]),
        tuple({"source": r.source, "sha256": r.sha256, "samples": len(r)} for r in records),
    )  # fmt: skip


def _mode(pole: Pole, diagram: Diagram, reference: int | None) -> Mode:
    """Return a pole as a mode, with its shape in the channels' units and the deviations of it."""
    scale, names = diagram.scaling.scale, diagram.outputs
    at = int(np.argmax(abs(pole.shape))) if reference is None else reference
    around = diagram.models[pole.past, pole.order].shape_covariance(pole.eigenvalue, at)
    unit = scale / scale[at]
    values = dict(zip(names, map(complex, pole.shape / pole.shape[at] * unit), strict=True))
    spread = {
        name: (float(s[0, 0] * u**2), float(s[0, 1] * u**2), float(s[1, 1] * u**2))
        for name, s, u in zip(names, around, unit, strict=True)
    }
    shape = Shape(names[at], values, spread if np.isfinite(around).all() else None)
    size = abs(pole.shape)
    shares = dict(zip(names, map(float, size / size.sum()), strict=True))
    deviations = _known(pole.frequency_std_hz), _known(pole.damping_std)
    return Mode(pole.frequency_hz, pole.damping, pole.eigenvalue, *deviations, shares, shape=shape)
