"""Read what an identification says of itself, from its result or from the model.json that it wrote."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from aeolid.api.table import Table
from aeolid.models.modes import Mode
from aeolid.models.multiblade import Whirl
from aeolid.models.shapes import shape_from_json
from aeolid.text_files import is_number, is_short

Facts = Mapping[str, Any]


def modes_table(modes: Sequence[Mode]) -> Table[Mode]:
    """Return modes as a table: what swings with frequency in Hz and damping, a real pole with its time constant in s.

    The columns of the other kind, and deviations that are not known, are NaN. The time constant of a pole that grows is
    negative, that of an integrator infinite.
    """
    return Table("modes", modes, _mode_row, tuple(_mode_row(Mode(0.0, 0.0, 0j, None, None, {}))))


def _mode_row(mode: Mode) -> dict[str, Any]:
    hertz, swings = mode.frequency_hz, not mode.is_real
    values = [hertz, mode.frequency_std_hz, mode.damping, mode.damping_std] if swings else [None] * 4
    constant = constant_std = None
    if not swings:
        constant = math.inf if hertz == 0 else math.copysign(1 / (2 * math.pi * hertz), mode.damping)
        known = mode.frequency_std_hz is not None and hertz > 0
        constant_std = abs(constant) * (mode.frequency_std_hz or 0.0) / hertz if known else None
    columns = ("frequency_hz", "frequency_std_hz", "damping", "damping_std", "time_constant_s", "time_constant_std_s")
    told = zip(columns, [*values, constant, constant_std], strict=True)
    return {
        "name": mode.name, **{key: math.nan if value is None else value for key, value in told},
        "mostly_in": max(mode.shares, key=lambda n: mode.shares[n], default=""),
        "share": max(mode.shares.values(), default=None), "rotor_order": mode.rotor_order,
    }  # fmt: skip


def stated_modes(facts: Facts | None) -> tuple[Mode, ...] | None:
    """Return the modes that the facts of an identification hold; None where they are not complete."""
    rows = (facts or {}).get("modes")
    try:
        return tuple(_stated(row) for row in rows) if isinstance(rows, list) else None
    except (LookupError, TypeError, ValueError):
        return None


def _stated(row: dict[str, Any]) -> Mode:
    real, imaginary = row["eigenvalue"]
    numbers = [row["frequency_hz"], row["damping"], real, imaginary, *row["outputs"].values()]
    spread = [row["frequency_std_hz"], row["damping_std"]]
    if not all(map(is_number, numbers)) or not all(v is None or is_number(v) for v in spread):
        raise ValueError("a mode holds what is no number")
    order = row["rotor_order"] if isinstance(row.get("rotor_order"), int) else None
    folded = row["folded_from_hz"] if is_number(row.get("folded_from_hz")) else None
    name = row["name"] if is_short(row.get("name")) else ""
    shares = dict(row["outputs"])
    known = Mode(row["frequency_hz"], row["damping"], complex(real, imaginary), spread[0], spread[1], shares, order)
    shape, tone = shape_from_json(row.get("shape")), row.get("tone") is True
    return replace(known, name=name, tone=tone, shape=shape, folded_from_hz=folded, whirl=_whirl(row.get("whirl")))


def _whirl(told: Any) -> Whirl | None:
    """Return how a mode moves the blades, None where that is not told."""
    if not isinstance(told, dict):
        return None
    stem, direction, degree, collective, blade_hz = (
        told.get(k) for k in ("blades", "direction", "degree", "collective", "blade_frequency_hz")
    )
    if not is_short(stem) or not is_short(direction) or not is_number(degree) or not is_number(collective):
        return None
    return Whirl(stem, direction, degree, collective, blade_hz) if blade_hz is None or is_number(blade_hz) else None


def fit_table(facts: Facts | None, outputs: Sequence[str]) -> Table[dict[str, Any]]:
    """Return VAF in percent and NRMSE of each output, one step ahead and running free; empty where nothing is said."""
    fit = (facts or {}).get("fit")
    rows = []
    for name in outputs if isinstance(fit, dict) else ():
        row: dict[str, Any] = {"output": name}
        for run in ("one_step", "free_run"):
            for measure, label in (("vaf", "vaf_percent"), ("nrmse", "nrmse")):
                row[f"{run}_{label}"] = _number(fit, run, measure, name)
        rows.append(row)
    columns = [f"{run}_{label}" for run in ("one_step", "free_run") for label in ("vaf_percent", "nrmse")]
    return Table("outputs", rows, dict, ("output", *columns))


def one_step_fit(table: Table[dict[str, Any]]) -> float | None:
    """Return the VAF in percent of the output that is predicted worst one step ahead; None where it is not known."""
    values = [row["one_step_vaf_percent"] for row in table]
    return None if not values or None in values else float(min(values))


def _number(facts: Any, *keys: str) -> float | None:
    for key in keys:
        facts = facts.get(key) if isinstance(facts, dict) else None
    return float(facts) if is_number(facts) else None


def texts(facts: Facts | None, key: str) -> tuple[str, ...]:
    """Return a list of texts, without what is none."""
    found = (facts or {}).get(key)
    return tuple(t for t in found if isinstance(t, str)) if isinstance(found, list) else ()
