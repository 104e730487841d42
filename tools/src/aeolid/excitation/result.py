"""Hold a designed excitation: its samples, what it will show, and what else was tried."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.excitation.expected import Method
from aeolid.excitation.forecast import Forecast, ModeForecast
from aeolid.excitation.quantities import Bound
from aeolid.excitation.signals import Signals
from aeolid.excitation.wrapper import unplayable, wrapper_text
from aeolid.formats import write_table
from aeolid.models.modes import Mode
from aeolid.wording import plus_minus

Array = NDArray[np.float64]
ROUGH = 0.3  # relative deviation beyond which first-order deviations are a rough guide


@dataclass(frozen=True)
class Candidate:
    """Hold one signal that was tried.

    text: its kind; score: relative deviation of the goal; firm: whether that is so without a penalty, too (see
    `ModeForecast`).
    """

    text: str
    score: float
    crest: tuple[float, ...]
    amplitude: tuple[float, ...]
    firm: bool

    @classmethod
    def of(cls, signals: Signals, score: float, firm: bool) -> Candidate:
        """Return what is told of a trial."""
        text = signals.shape.text(signals.step_s)
        return cls(text, score, signals.crest, tuple(p.amplitude for p in signals.played), firm)

    def to_json(self) -> dict[str, Any]:
        """Return JSON facts; a score of infinity as null."""
        score = self.score if math.isfinite(self.score) else None
        return {"signal": self.text, "relative_deviation": score, "crest": list(self.crest),
                "amplitude": list(self.amplitude), "firm": self.firm}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Design:
    """Hold the best of the candidates, which are sorted by score; goals are the modes that the score is the worst of.

    score: relative deviation of `quantity` of the goals; limits: by output, of the whole, or on_top of the noise.
    """

    signals: Signals
    forecast: Forecast
    candidates: tuple[Candidate, ...]
    score: float
    goals: tuple[Mode, ...]
    quantity: str
    seed: int
    bounds: tuple[Bound, ...]
    limits: Mapping[str, float]
    on_top: bool
    method: Method
    closed_loop: bool
    notes: tuple[str, ...]
    source: str

    @property
    def duration_s(self) -> float:
        """Return the length of the signal in seconds."""
        return len(self.signals.values) * self.signals.step_s

    @property
    def time_s(self) -> Array:
        """Return the instants (rows,) of the signal, from 0."""
        return np.round(np.arange(len(self.signals.values)) * self.signals.step_s, 9)

    def write(self, path: str | Path) -> None:
        """Write the signal as a table: time_s and a column an input; .csv, .csv.gz or .parquet."""
        columns = {"time_s": self.time_s} | {b.name: self.signals.values[:, i] for i, b in enumerate(self.bounds)}
        write_table(path, columns, {"time_s": "s"} | {b.name: b.unit for b in self.bounds})

    def wrapper(self, start_s: float = 0.0) -> str:
        """Return the sections that make `port/discon` play this signal; raises UsageError where it cannot."""
        return wrapper_text(self.signals, self.bounds, start_s)

    def to_json(self) -> dict[str, Any]:
        """Return JSON facts; the signal itself is in the table."""
        signals = self.signals
        return {
            "model": self.source, "signal": signals.shape.text(signals.step_s), "kind": signals.shape.kind,
            "duration_s": self.duration_s, "sample_time_s": signals.step_s, "rows": len(signals.values),
            "seed": self.seed, "closed_loop": self.closed_loop, "quantity": self.quantity,
            "goal_hz": [m.frequency_hz for m in self.goals],
            "relative_deviation": self.score if math.isfinite(self.score) else None,
            "inputs": [self._input(i) for i in range(len(self.bounds))],
            "limits": dict(self.limits), "limits_on_top": self.on_top,
            "identification": {"past": self.method.past, "order": self.method.order},
            "modes": [m.to_json() for m in self.forecast.modes],
            "channels": [dict(c.__dict__) for c in self.forecast.channels],
            "candidates": [c.to_json() for c in self.candidates],
            "wrapper_plays": unplayable(signals, self.bounds) == "",
            "notes": [*self.notes, *self.remarks()],
        }  # fmt: skip

    def _input(self, i: int) -> dict[str, Any]:
        bound, played, values = self.bounds[i], self.signals.played[i], self.signals.values[:, i]
        told = {k: v for k, v in played.__dict__.items() if k not in ("rate", "rows") and (v or k == "seed")}
        return told | {
            "bound": bound.amplitude, "rate_bound": bound.rate if math.isfinite(bound.rate) else None,
            "rms": float(np.sqrt((values**2).mean())), "crest": self.signals.crest[i],
        }  # fmt: skip

    def remarks(self) -> tuple[str, ...]:
        """Return what should be known of the forecast: modes out of reach, deviations that are rough."""
        out = []
        swings = [m for m in self.forecast.modes if not m.mode.is_real]
        for m in swings:
            where = f"the mode at {m.mode.frequency_hz:.4g} Hz"
            if m.reached is False:
                names = ", ".join(b.name for b in self.bounds)
                out.append(f"{where} is not reached by {names}: the plant's own noise tells as much of it")
        if not self.candidates[0].firm:
            out.append(
                "not firm: the signal leaves so much of the windows unexcited that the penalty of the regression "
                "decides, and the spread may be several times the deviations; widen the band, or take prbs"
            )
        rough = [m for m in swings if m.relative("both") > ROUGH]
        if rough:
            told = ", ".join(f"{m.mode.frequency_hz:.4g}" for m in rough)
            out.append(
                f"deviations beyond {ROUGH:.0%} of the value ({told} Hz) are a rough guide: they are first-order"
            )
        return tuple(out)

    def summary(self) -> str:
        """Return the design as lines of text."""
        signals = self.signals
        loop = "closed loop" if self.closed_loop else "open loop"
        rows = f"{len(signals.values)} values every {signals.step_s:g} s, {self.duration_s:.6g} s, {loop}"
        lines = [f"best: {signals.shape.text(signals.step_s)}; {rows}"]
        lines += [self._input_line(i) for i in range(len(self.bounds))]
        lines += ["", *self._mode_lines(), "", *self._channel_lines(), "", *self._candidate_lines()]
        lines += [f"Note: {note}" for note in (*self.notes, *self.remarks())]
        return "\n".join(lines)

    def _input_line(self, i: int) -> str:
        bound, crest = self.bounds[i], self.signals.crest[i]
        played, rms = self.signals.played[i], float(np.sqrt((self.signals.values[:, i] ** 2).mean()))
        rate = f", at most {bound.rate:g} {bound.unit}/s" if math.isfinite(bound.rate) else ""
        return f"  {bound.name}: ±{played.amplitude:g} {bound.unit} (rms {rms:.4g}, crest {crest:.2f}){rate}".rstrip()

    def _mode_lines(self) -> list[str]:
        modes = [m for m in self.forecast.modes if not m.mode.is_real]
        width = max([len("mode"), *(len(m.mode.name) for m in modes)])
        past = f"identify --past {self.method.past} --order {self.method.order}"
        lines = [
            f"one standard deviation of {past}; beside it the Cramér-Rao bound, and that bound by noise alone",
            f"  {'mode':{width}s}  frequency Hz       bound      noise       damping           bound      noise",
        ]
        return lines + [_mode_line(m, width) for m in modes]

    def _channel_lines(self) -> list[str]:
        width = max(len(c.name) for c in self.forecast.channels)
        lines = [f"  {'rms':{width}s}  by noise    with excitation"]
        for c in self.forecast.channels:
            limit = (
                f"  (limit {self.limits[c.name]:g}{' on top' if self.on_top else ''})" if c.name in self.limits else ""
            )
            lines.append(f"  {c.name:{width}s}  {c.noise:<10.4g}  {c.total:<10.4g} {c.unit}{limit}".rstrip())
        return lines

    def _candidate_lines(self) -> list[str]:
        what = "frequency or damping, the larger" if self.quantity == "both" else self.quantity
        modes = ", ".join(f"{m.frequency_hz:.4g}" for m in self.goals)
        lines = [f"relative deviation of {what}, worst of {modes} Hz"]
        for c in self.candidates:
            crest = ", ".join(f"{v:.2f}" for v in c.crest)
            lines.append(f"  {c.score:8.2%}  crest {crest}  {c.text}{'' if c.firm else '; not firm'}")
        return lines


def _mode_line(m: ModeForecast, width: int) -> str:
    mode = m.mode
    cells = [
        f"{mode.name:{width}s}", f"{_told(mode.frequency_hz, m.frequency_std_hz):20s}",
        _short(m.least_frequency_std_hz), _short(m.noise_frequency_std_hz),
        f"{_told(mode.damping, m.damping_std):19s}", _short(m.least_damping_std), _short(m.noise_damping_std),
    ]  # fmt: skip
    return ("  " + "  ".join(cells)).rstrip()


def _told(value: float, std: float | None) -> str:
    known = std is not None and math.isfinite(std)
    return plus_minus(value, std) if known else f"{value:.4g} ± {_short(std).strip()}"


def _short(value: float | None) -> str:
    text = "-" if value is None else "unknown" if not math.isfinite(value) else f"{value:.2g}"
    return f"{text:9s}"
