"""Find a mode that both sides have at different frequencies: of a tower whose simulation bends elsewhere than it does.

Offshore a tower stands on a pile or floats. A simulation that leaves the tower's own bending out still sways with what
is below, at another frequency, so that no mode is missing: the recording's has no partner in the run, the run's none in
the recording, and the spectra's ratio rises at the one and falls at the other. A mode known to less than a hundredth,
as a tower in the wind is, serves here because both signs agree. Waves of two seas look like that as well, but they lie
below the rotor's frequency, or near it, while towers of large turbines swing above it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.modes import KINDS, Kind
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.modal import Modal
from aeolid.diagnose.run_prior.pair import Pair
from aeolid.diagnose.run_prior.standing import Standing
from aeolid.diagnose.run_prior.standing_out import Risen, risen_of
from aeolid.models.modes import Mode

Array = NDArray[np.float64]
_KINDS = ("tower_fore_aft", "tower_side_side")
# Part of a mode's frequency within which bands are its own: they are as wide, and leave multiples of the rotor's out.
_WITHIN = 0.15


def displaced_of(pair: Pair, modal: Modal, context: Mapping[str, Any], fit: float) -> Standing | None:
    """Return what a tower's mode tells that both sides have elsewhere, the plainest one; None where there is none.

    fit: part of each recording that is not sealed. Cost: spectra of all outputs, a tenth of a second.
    """
    turn = context.get("rated_speed_rad_s")
    if not turn or not is_turbine(context) or not (modal.recorded and modal.simulated):
        return None
    risen = risen_of(pair, float(turn) / (2 * np.pi), fit)
    if risen is None:
        return None
    found = []
    for kind in (k for k in KINDS if k.entry in _KINDS):
        lowest = in_force().run_prior.displaced_ratio * float(turn) / (2 * np.pi)
        recorded, simulated = (_of_kind(modes, kind, lowest) for modes in (modal.recorded, modal.simulated))
        for m in (m for m in recorded if not _has_partner(m, simulated)):
            for s in (s for s in simulated if not _has_partner(s, recorded)):
                sign = min(_standing_at(risen, pair, m, 1.0), _standing_at(risen, pair, s, -1.0))
                found.append((sign, kind, m, s))
    plainest = max(found, key=lambda f: f[0], default=None)
    if plainest is None or plainest[0] <= in_force().run_prior.displaced_log:
        return None
    return _told(*plainest[1:])


def _of_kind(modes: Sequence[Mode], kind: Kind, lowest: float) -> list[Mode]:
    """Return the modes that an output of this kind shows most, whose frequency is known and in the kind's range.

    lowest: frequency in Hz below which waves may be.
    """
    rules = in_force().run_modes
    return [
        m for m in modes
        if m.rotor_order is None and 0 < m.damping < rules.movable_damping and m.frequency_std_hz is not None
        and m.frequency_std_hz < rules.movable_spread * m.frequency_hz
        and max(lowest, kind.band_hz[0]) <= m.frequency_hz <= kind.band_hz[1]
        and re.search(kind.pattern, max(m.shares, key=lambda n: m.shares[n]).lower())
    ]  # fmt: skip


def _has_partner(m: Mode, others: Sequence[Mode]) -> bool:
    """Tell whether the other side has a mode of the same kind at this frequency, or within what it is known to."""
    for o in others:
        spread = np.hypot(m.frequency_std_hz or np.inf, o.frequency_std_hz or np.inf)
        apart = abs(o.frequency_hz - m.frequency_hz)
        near = (in_force().run_prior.displaced_ratio - 1) * m.frequency_hz
        if apart < max(near, in_force().evidence.noise_deviations * spread):
            return True
    return False


def _standing_at(risen: Risen, pair: Pair, m: Mode, sign: float) -> float:
    """Return by how much the logarithm of the power's ratio rises (sign 1) or falls (-1) at a mode, in both parts."""
    j = pair.shown.index(max(m.shares, key=lambda n: m.shares[n]))
    near = np.abs(risen.hz / m.frequency_hz - 1) < _WITHIN
    if not near.any():
        return 0.0
    whole, *parts = (sign * r[near, j] for r in (risen.whole, risen.chosen, risen.sealed))
    return float(np.max(np.minimum(whole, 2 * np.minimum(*parts))))


def _told(kind: Kind, m: Mode, s: Mode) -> Standing:
    """Return the names: bending that the simulation leaves out first where it sways far too quickly, else stiffness."""
    flexible = s.frequency_hz > in_force().run_prior.flexible_ratio * m.frequency_hz
    entries = (kind.entry, "stiffness_change") if flexible else ("stiffness_change", kind.entry)
    now = (
        f"{kind.words} is at {m.frequency_hz:.3g} Hz with damping {m.damping:.2g} in the recording and at"
        f" {s.frequency_hz:.3g} Hz with {s.damping:.2g} in the simulation"
    )
    why = {
        kind.entry: "the simulation leaves a part of the bending out",
        "stiffness_change": "the stiffness differs, of the tower or of what it stands on",
    }
    told = {"frequency_hz": (m.frequency_hz, m.frequency_std_hz or np.inf),
            "damping": (m.damping, m.damping_std or np.inf)}  # fmt: skip
    channel = max(m.shares, key=lambda n: m.shares[n])
    return Standing(
        entries, dict.fromkeys(entries, f"output:{channel}"), dict.fromkeys(entries, told),
        {e: f"{now}: {why[e]}" for e in entries}, own=True, units={"frequency_hz": "Hz", "damping": "1"},
    )  # fmt: skip
