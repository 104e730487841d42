"""Gather what a page shows of both sides: modes, frequency responses, and the mean over the rotor's angle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.localise.turn import angles_deg, mean_over_turn
from aeolid.diagnose.run_prior.answering import angle_of, shown_outputs
from aeolid.diagnose.run_prior.modal import Modal
from aeolid.diagnose.run_prior.pair import Pair, Side
from aeolid.diagnose.run_prior.responses import Answering
from aeolid.models.modes import Mode
from aeolid.models.multiblade import PARTS

Array = NDArray[np.float64]


def sides_of(pair: Pair, modal: Modal, units: Mapping[str, str]) -> dict[str, Any]:
    """Return modes and, where they are known, frequency responses and means over the rotor's angle, as JSON."""
    facts: dict[str, Any] = {
        "modes": {
            side: [m.to_json() | {"width": _width(m, pair.step * sum(len(s.y) for s in sides))} for m in modes]
            for side, modes, sides in (
                ("recorded", modal.recorded, pair.recordings),
                ("simulated", modal.simulated, pair.runs),
            )
        }
    }
    if modal.responses:
        facts["responses"] = dict(zip(("recorded", "simulated"), modal.responses, strict=True)) | {"units": dict(units)}
    recorded, simulated = (turning_mean(sides) for sides in (pair.recordings, pair.runs))
    if recorded is not None and simulated is not None:
        angle = angles_deg()
        facts["turning"] = {
            name: {"azimuth_deg": angle.tolist(), "recorded": recorded[:, j].tolist(),
                   "simulated": simulated[:, j].tolist(), "unit": units.get(name, "")}
            for j, name in enumerate(pair.outputs)
        }  # fmt: skip
    return facts


def _width(mode: Mode, duration_s: float) -> float | None:
    width = mode.width(duration_s)
    return width if math.isfinite(width) else None


def answers_of(pair: Pair, answering: Answering | None) -> dict[str, Any]:
    """Return the recordings' answers to the pitch angle over the runs', by output and band, as JSON.

    gain, phase_deg: of their ratio; std: of the gain's logarithm, and of the phase in rad; wind: ratio of the powers of
    what the answers leave.
    """
    angle = angle_of(pair)
    if answering is None or angle is None:
        return {}
    own, run = answering.whole, answering.run
    outputs = []
    for j in shown_outputs(pair):
        a, b = own.H[:, angle, j], run.H[:, angle, j]
        ratio = a / np.where(b == 0, np.nan, b)
        spread = np.sqrt(0.5 * (own.V[:, angle, j] / np.abs(a) ** 2 + run.V[:, angle, j] / np.abs(b) ** 2))
        outputs.append({
            "output": pair.shown[j], "gain": np.abs(ratio).tolist(), "phase_deg": np.angle(ratio, deg=True).tolist(),
            "std": spread.tolist(), "wind": (own.rest[:, j] / run.rest[:, j]).tolist(),
        })  # fmt: skip
    orders = answering.orders.tolist()
    return {"answers": {"input": pair.inputs[angle], "orders": orders, "hz": answering.hz, "outputs": outputs}}


def series_of(pair: Pair, series: Mapping[str, Mapping[str, Any]], units: Mapping[str, str]) -> dict[str, Any]:
    """Return the sealed series with the unit of each output; parts of a set of blades have that of its blades."""
    turning = {j for places in pair.blades for j in places}
    sources = [n for j, n in enumerate(pair.outputs) if j not in turning]
    sources += [pair.outputs[places[0]] for places in pair.blades for _ in PARTS]
    told = dict(zip(pair.shown, sources, strict=True))
    return {name: {**facts, "unit": units.get(told.get(name, name), "")} for name, facts in series.items()}


def turning_mean(sides: Sequence[Side]) -> Array | None:
    """Return the mean of each output (bins, outputs) over the rotor's angle, less its mean over the turn.

    None where no angle is recorded, or where it does not go all the way round.
    """
    kept = [s for s in sides if s.azimuth is not None]
    if not kept:
        return None
    angle = np.concatenate([np.asarray(s.azimuth)[~s.missing] for s in kept])
    return mean_over_turn(angle, np.vstack([s.y[~s.missing] for s in kept]))
