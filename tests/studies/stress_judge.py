"""Judge an answer of `aeolid identify` by the true plant: which bands hold, what is far off, what was said of it.

Excited is a pole of the plant that the recordings show and tell: (1) its motion makes at least SHOWN of some output's
variance: 5 %, a fifth of that output's deviation, is what stands out of a spectrum; (2) the Cramér–Rao bound of the
pole, N counted without what is missing, is at most TOLD of its distance to the unit circle: with more than a quarter
the 95 % band of the best estimator there is reaches from half to one and a half times the damping, and nobody could be
blamed for missing the mode; (3) the recordings last LASTS of its time constants, without which the bound (of a
stationary process) means nothing. An integrator's distance is taken as LASTS/N.

Each excited pole has the identified mode that optimal assignment of all poles gives it, if that lies within NEAR of its
own natural frequency (real poles: within a factor of two); else it is missed, which counts as wrong where nothing is
said. Its deviations are those of frequency and damping (of a real pole: of 1/time constant), each in deviations told.
At the frequency of the answer's own grid next to the mode's peak the gain of the pair of channels where the mode is
largest is held against the true one.
An answer is marked where it says that it is not to be relied on: `bands_hold` false, a note that begins with WARNING or
tells poles outside the unit circle, no deviation, or exit code 4 with a model written.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment
from stress_plants import Drawn, Plant, bounds

from aeolid.identify.frequency import transfer
from aeolid.models.modes import continuous_poles, frequency_and_damping

SHOWN, TOLD, LASTS = 0.05, 0.25, 3.0
NEAR, FACTOR = 0.25, 2.0
FAR, BAND = 5.0, 1.959964
DIGITS = 2e-5  # relative rounding of gains in the JSON
GROWING = "outside the unit circle"


def excited(drawn: Drawn) -> Any:
    """Return for each pole whether the recordings show and tell it, (modes,) bool; worked out once."""
    if "excited" not in drawn.facts:
        drawn.facts["excited"] = _excited(drawn)
    return drawn.facts["excited"]


def _excited(drawn: Drawn) -> Any:
    size = sum(len(p) for p in drawn.recordings)
    missing = sum(int(np.isnan(p).any(axis=1).sum()) for p in drawn.recordings)
    present = max(size - missing, size // 4)
    try:
        bound = bounds(drawn.plant, present)
    except np.linalg.LinAlgError:
        return np.zeros(len(drawn.poles), bool)
    distance = 1 - abs(drawn.poles)
    integrates = distance < 1e-9
    lasts = integrates | (distance * present >= LASTS)
    told = bound <= TOLD * np.where(integrates, LASTS / present, distance)
    return (drawn.share >= SHOWN) & lasts & told


def match(true: Any, found: Any) -> list[int | None]:
    """Return for each true pole s the index of its own among the found ones, None where none is near; in 1/s.

    A pair that is not near costs as much as the worst one that is, however far: else the sum of distances is least
    where a found pole that belongs to none pushes all others on to their neighbours.
    """
    cost = np.ones((len(true), len(found)))
    for i, s in enumerate(true):
        for j, other in enumerate(found):
            cost[i, j] = min(_apart(complex(s), complex(other)), 1.0)
    rows, columns = linear_sum_assignment(cost)
    place: list[int | None] = [None] * len(true)
    for i, j in zip(rows, columns, strict=True):
        place[i] = int(j) if cost[i, j] < 1.0 else None
    return place


def _apart(s: complex, other: complex) -> float:
    """Return the distance of a found pole over what is near: NEAR of |s|, of a real pole the factor FACTOR."""
    if s.imag != 0:
        return abs(s - other) / (NEAR * abs(s))
    if other.imag != 0:
        return np.inf
    if abs(s) < 1e-9:
        return 0.5
    ratio = other.real / s.real
    return float(abs(np.log(ratio)) / np.log(FACTOR)) if ratio > 0 else np.inf


def judge(drawn: Drawn, code: int, facts: dict[str, Any] | None) -> dict[str, Any]:
    """Return what became of the plant: "outcome", whether it is marked, and a row for each excited pole."""
    at = np.flatnonzero(excited(drawn))
    row: dict[str, Any] = {"code": code, "classes": list(drawn.classes), "samples": drawn.samples, "excited": len(at)}
    if facts is None:
        return row | {"outcome": "refused" if code in (3, 4) else "failed", "modes": []}
    h = drawn.plant.sample_time_s
    true = continuous_poles(drawn.poles, h)
    told = facts["modes"]
    found = continuous_poles(np.array([complex(*m["eigenvalue"]) for m in told]), h)
    place = match(true, found)
    modes = [
        _mode(drawn.plant, true[i], drawn.poles[i], None if place[i] is None else told[place[i]], facts) for i in at
    ]
    notes = facts.get("notes", [])
    doubt = [n for n in notes if n.startswith("WARNING") or GROWING in n]
    marked = code == 4 or facts.get("bands_hold") is False or bool(doubt) or any(m["unknown"] for m in modes)
    row |= {"outcome": "answered", "marked": marked, "modes": modes, "order": facts["order"], "notes": notes}
    return row | {"past": facts["settings"]["past"], "truth": 2 * len(drawn.poles) - int((drawn.poles.imag == 0).sum())}


def _mode(plant: Plant, s: complex, z: complex, told: dict[str, Any] | None, facts: dict[str, Any]) -> dict[str, Any]:
    frequency, damping = frequency_and_damping(complex(s))
    row: dict[str, Any] = {
        "hz": frequency,
        "damping": damping if s.imag else None,
        "missed": told is None,
        "unknown": False,
    }
    if told is None:
        return row
    row |= {"told_hz": told["frequency_hz"], "told_damping": told["damping"]}
    spread = told["frequency_std_hz"], told["damping_std"]
    if spread[0] is None or spread[1] is None:
        return row | {"unknown": True}
    if s.imag == 0:  # a real pole has 2π frequency = |s|, and the sign of its damping
        off = abs(told["frequency_hz"] * (told["damping"] or 1.0) - frequency * damping)
        return row | {"deviations": {"rate": _over(off, spread[0], frequency)}}
    off = abs(told["frequency_hz"] - frequency), abs(told["damping"] - damping)
    deviations = {"frequency": _over(off[0], spread[0], frequency), "damping": _over(off[1], spread[1], damping)}
    peak = _peak(plant, z, facts.get("frequency_response"))
    return row | {"deviations": deviations | ({} if peak is None else {"peak": peak})}


def _peak(plant: Plant, z: complex, response: dict[str, Any] | None) -> float | None:
    """Return how many deviations the gain beside the peak is off, in the pair of channels where the mode is largest."""
    if response is None:
        return None
    poles, right = np.linalg.eig(plant.A)
    i = int(np.argmin(abs(poles - z)))
    residue = abs(np.outer(plant.C @ right[:, i], np.linalg.inv(right)[i] @ plant.B))
    outputs, inputs = residue.shape
    scale = abs(transfer(plant.A, plant.B, plant.C, plant.D, np.exp(1j * np.linspace(0.02, 3.1, 200)))).mean(axis=0)
    output, source = np.unravel_index(int(np.argmax(residue / scale)), (outputs, inputs))
    grid = np.array(response["frequency_hz"])
    near = int(np.argmin(abs(grid - np.angle(z) / (2 * np.pi * plant.sample_time_s))))
    point = np.exp(2j * np.pi * grid[near : near + 1] * plant.sample_time_s)
    gain = abs(transfer(plant.A, plant.B, plant.C, plant.D, point)[0, output, source])
    pair = next(p for p in response["pairs"] if (p["output"], p["input"]) == (f"y{output + 1}", f"u{source + 1}"))
    told, spread = pair["gain"][near], pair["gain_std"][near]
    return None if told is None or spread is None else _over(abs(told - gain), spread, float(gain))


def _over(off: float, spread: float, size: float) -> float:
    """Return the error in deviations; the rounding of printed figures is part of the deviation."""
    return float(off / max(float(np.hypot(spread, DIGITS * size)), 1e-300))


def worst(row: dict[str, Any]) -> float:
    """Return the largest deviation of a row's excited poles and peaks, infinite where one is missed."""
    each = [np.inf if m["missed"] else max(m.get("deviations", {"none": 0.0}).values()) for m in row["modes"]]
    return max(each, default=0.0)


def silent(row: dict[str, Any]) -> bool:
    """Return whether the answer is off by more than FAR deviations, or lacks an excited pole, without a word."""
    return row["outcome"] == "answered" and not row["marked"] and worst(row) > FAR
