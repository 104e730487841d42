"""Show mode shapes on a page: amplitude and phase of each output beside the reference, with their deviations."""

from __future__ import annotations

from typing import Any

from aeolid.report.markup import Html, section, table, tag
from aeolid.report.numbers import number, with_std

Facts = dict[str, Any]
_MOST = 12  # modes whose shapes are shown
_ROUNDING = 1e-12  # the deviation of a reference's own amplitude, which has none


def shapes_part(modes: list[Facts], units: dict[str, str]) -> Html:
    """Build the section of the shapes of these modes; empty where none has one. units: of the outputs by name."""
    shown = [m for m in modes if m.get("shape") and not m.get("rotor_order") and not m.get("tone")]
    if not shown or len(units) < 2:
        return Html("")
    names = list(shown[0]["shape"]["outputs"])
    rows = [[name, *(_entry(m["shape"]["outputs"].get(name) or {}) for m in shown[:_MOST])] for name in names]
    heads = [f"#{m.get('name') or 'mode'} {number(m.get('frequency_hz'), 4)} Hz" for m in shown[:_MOST]]
    notes = [
        "Complex amplitude of each output beside the reference, whose entry is 1; in units of the output a unit of the "
        "reference. ± is one standard deviation; a phase without one is not known."
    ]
    if len(shown) > _MOST:
        notes.append(f"The shapes of {len(shown) - _MOST} more are in the model file.")
    return section("Mode shapes", table(["output", *heads], rows), *(tag("p", note, class_="soft") for note in notes))


def _entry(told: Facts) -> str:
    deviation = told.get("amplitude_std")
    if deviation is not None and deviation < _ROUNDING and told.get("amplitude") == 1.0:
        return "1 (reference)"
    size = with_std(told.get("amplitude"), told.get("amplitude_std"))
    return f"{size} at {_angle(told.get('phase_deg'), told.get('phase_std_deg'))}°"


def _angle(degrees: float | None, std: float | None) -> str:
    """Return a phase with its deviation; one near zero is as well known as any other."""
    if degrees is None or std is None or abs(degrees) > std:
        return with_std(degrees, std)
    return f"{degrees:.2g} ± {std:.2g}"
