"""Gather what a page shows of both sides: modes, frequency responses, and the mean over the rotor's angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.localise.turn import angles_deg, mean_over_turn
from aeolid.diagnose.run_prior.modal import Modal
from aeolid.diagnose.run_prior.pair import Pair, Side

Array = NDArray[np.float64]


def sides_of(pair: Pair, modal: Modal, units: Mapping[str, str]) -> dict[str, Any]:
    """Return modes and, where they are known, frequency responses and means over the rotor's angle, as JSON."""
    facts: dict[str, Any] = {
        "modes": {
            side: [m.to_json() for m in modes]
            for side, modes in (("recorded", modal.recorded), ("simulated", modal.simulated))
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


def turning_mean(sides: Sequence[Side]) -> Array | None:
    """Return the mean of each output (bins, outputs) over the rotor's angle, less its mean over the turn.

    None where no angle is recorded, or where it does not go all the way round.
    """
    kept = [s for s in sides if s.azimuth is not None]
    if not kept:
        return None
    angle = np.concatenate([np.asarray(s.azimuth)[~s.missing] for s in kept])
    return mean_over_turn(angle, np.vstack([s.y[~s.missing] for s in kept]))
