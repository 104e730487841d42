"""Draw models on matplotlib axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aeolid.api import axes as places
from aeolid.errors import UsageError

if TYPE_CHECKING:
    from aeolid.api.linear import LinearModel

Array = NDArray[np.float64]
_NORMAL = 1.96  # 95 %


def draw_bode(
    model: LinearModel, axes: Any, inputs: Sequence[str] | None, outputs: Sequence[str] | None
) -> Any:  # fmt: skip
    """Draw gains (rows 0, 2, …) and phases (rows 1, 3, …) from each input to each output."""
    from aeolid.identify.frequency import frequency_response

    if not model.inputs:
        raise UsageError("the model has no input, identified from outputs alone: it has no frequency response")
    sources, targets = _chosen(inputs, model.inputs, "input"), _chosen(outputs, model.outputs, "output")
    found = places.grid(axes, 2 * len(targets), len(sources), size=(4.0, 1.9), sharex=True)
    response = frequency_response(model.state_space)
    units = {s.name: s.unit or "1" for s in (*model.state_space.inputs, *model.state_space.outputs)}
    for i, target in enumerate(targets):
        for j, source in enumerate(sources):
            gain, phase = found[2 * i, j], found[2 * i + 1, j]
            g = response.response[:, model.outputs.index(target), model.inputs.index(source)]
            angle = np.degrees(np.unwrap(np.angle(g)))
            gain.loglog(response.frequency_hz, np.where(np.abs(g) > 0, np.abs(g), np.nan), linewidth=1.3)
            phase.semilogx(response.frequency_hz, angle, linewidth=1.3)
            _shade(gain, phase, _pair(model.facts, source, target), response.frequency_hz, np.abs(g), angle)
            _dots(gain, phase, model.facts, (source, target), (response.frequency_hz, angle))
            gain.set_title(places.label(f"{source} to {target}"), fontsize="medium")
            gain.set_ylabel(places.label(f"gain ({units[target]} / {units[source]})"))
            phase.set_ylabel("phase (deg)")
    for place in found[-1]:
        place.set_xlabel("frequency (Hz)")
    return found


def _chosen(wanted: Sequence[str] | None, have: Sequence[str], what: str) -> list[str]:
    names = [wanted] if isinstance(wanted, str) else list(have if wanted is None else wanted)
    for name in names:
        if name not in have:
            raise UsageError(f"{name!r} is no {what} of the model; it has {', '.join(have)}")
    if not names:
        raise UsageError(f"no {what} is left to draw")
    return names


def _pair(facts: Any, source: str, target: str) -> tuple[Array, Array, Array] | None:
    """Return frequency, relative deviation of the gain, and that of the phase in degrees; None where not known."""
    try:
        told = facts["frequency_response"]
        row = next(p for p in told["pairs"] if (p["input"], p["output"]) == (source, target))
        frequency, *columns = (
            np.array(v, dtype=float) for v in (told["frequency_hz"], row["gain"], row["gain_std"], row["phase_std_deg"])
        )
    except (LookupError, TypeError, ValueError, StopIteration):
        return None
    gain, spread, turn = columns
    return frequency, spread / np.maximum(gain, 1e-300), turn


def _shade(
    gain: Any, phase: Any, known: tuple[Array, Array, Array] | None, grid: Array, g: Array, angle: Array
) -> None:
    """Draw the 95 % bands; a gain that may be zero is shaded to the bottom, an unknown phase not."""
    if known is None:
        return
    frequency, relative, turn = known
    inside = (grid >= frequency[0]) & (grid <= frequency[-1])
    at = np.log(grid[inside])
    relative, turn = (np.interp(at, np.log(frequency), v) for v in (relative, turn))
    size, bottom = g[inside], gain.get_ylim()[0]
    low = np.where(np.isfinite(turn), np.maximum(size * (1 - _NORMAL * relative), bottom), bottom)
    style: dict[str, Any] = {"color": "0.6", "alpha": 0.4, "linewidth": 0}
    gain.fill_between(grid[inside], low, size * (1 + _NORMAL * relative), **style)
    gain.set_ylim(bottom=bottom)
    middle, width = angle[inside], _NORMAL * turn
    phase.fill_between(grid[inside], middle - width, middle + width, where=np.isfinite(turn), **style)


def _dots(gain: Any, phase: Any, facts: Any, pair: tuple[str, str], model: tuple[Array, Array]) -> None:
    """Draw what spectra of the same recordings say, phases by turns near the model's (frequency, degrees)."""
    from aeolid.report.charts import holding

    try:
        told = facts["spectral"]
        row = next(p for p in told["pairs"] if (p["input"], p["output"]) == pair)
        at, size, spread, turn = (
            np.array(v, dtype=float) for v in (told["frequency_hz"], row["gain"], row["gain_std"], row["phase_deg"])
        )
    except (LookupError, TypeError, ValueError, StopIteration):
        return
    known = size > _NORMAL * spread  # others are zero, as far as these data go
    near = np.interp(np.log(at), np.log(model[0]), model[1])
    style: dict[str, Any] = {"color": "0.5", "linestyle": "none", "marker": "o", "markersize": 2, "zorder": 1}
    limits = holding(gain.get_ylim(), size[known])
    gain.loglog(at[known], size[known], **style)
    gain.set_ylim(*limits)
    phase.semilogx(at[known], (turn + 360 * np.round((near - turn) / 360))[known], **style)


def draw_poles(groups: Sequence[tuple[NDArray[np.complex128], str]], sample_time_s: float, axes: Any) -> Any:
    """Draw poles in the z-plane with the unit circle, or for continuous time in the s-plane with its axis."""
    place = places.one(axes, size=(4.5, 4.5))
    if sample_time_s > 0:
        circle = np.exp(1j * np.linspace(0, 2 * np.pi, 361))
        place.plot(circle.real, circle.imag, linewidth=0.8, color="0.6")
        place.set_aspect("equal")
    else:
        place.axvline(0.0, linewidth=0.8, color="0.6")
    for poles, name in groups:
        place.plot(poles.real, poles.imag, "x", label=places.label(name))
    place.set_xlabel("real part" + ("" if sample_time_s > 0 else " (1/s)"))
    place.set_ylabel("imaginary part" + ("" if sample_time_s > 0 else " (1/s)"))
    if len(groups) > 1:
        place.legend(loc="best", fontsize="small")
    return place


def draw_stabilisation(facts: Any, axes: Any) -> Any:
    """Draw the poles of a modal analysis over frequency and order, those of modes with 95 % bands."""
    place = places.one(axes, size=(9.0, 4.6))
    poles, lines = facts["poles"], {m["frequency_hz"] for m in facts["harmonics"]}
    hertz, order = (np.array(poles[n], dtype=float) for n in ("frequency_hz", "order"))
    width = np.array([np.nan if v is None else v for v in poles["frequency_std_hz"]], dtype=float)
    kind = np.array([0 if m is None else 1 if m in lines else 2 for m in poles["mode_hz"]])
    for which, colour, text in ((0, "0.7", "spurious"), (1, "#d55e00", "harmonics, sines"), (2, "#0072b2", "modes")):
        mine = kind == which
        bars = None if which == 0 else _NORMAL * width[mine]
        size = 2.0 if which == 0 else 3.5
        place.errorbar(
            hertz[mine], order[mine], xerr=bars, fmt="o", color=colour, markersize=size, elinewidth=0.7, label=text
        )
    known = [m["frequency_hz"] for m in [*facts["modes"], *facts["harmonics"]]]
    place.set_xlim(0.0, min(4 / 3 * max(known, default=np.inf), 0.5 / facts["sample_time_s"]))
    place.set_xlabel("frequency (Hz)")
    place.set_ylabel("order")
    place.legend(loc="upper right", fontsize="small")
    return place


def draw_setups(facts: Any, axes: Any) -> Any:
    """Draw the diagram of each set-up of merged ones, on a common axis of frequency."""
    setups = facts["setups"]
    found = places.grid(axes, len(setups), 1, size=(9.0, 3.2)).ravel()
    for i, (setup, place) in enumerate(zip(setups, found, strict=True)):
        draw_stabilisation(setup, place)
        place.set_title(f"set-up {i + 1}", fontsize="small")
    right = max(place.get_xlim()[1] for place in found)
    for place in found:
        place.set_xlim(0.0, right)
    return found
