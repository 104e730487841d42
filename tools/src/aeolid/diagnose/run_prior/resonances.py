"""List how a resonance of the runs may differ: elsewhere or damped otherwise, or a tower that only the speed shows.

A tower that nods with the thrust takes from the pitch what the rotor feels of it near its frequency: zeros beside its
poles in every output but its own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts.modes import KINDS
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior import operators as op
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values
from aeolid.diagnose.run_prior.modal import Modal, model_of_runs
from aeolid.diagnose.run_prior.moving import Swing, swing_of
from aeolid.diagnose.run_prior.pair import Change, Pair
from aeolid.models.modes import Mode

Array = NDArray[np.float64]
MOVED = ("stiffness_change", "added_mass")  # entries that move a mode
HIDDEN = ("undamped_share",)  # values that shape an operator and are no facts of the machine
SEEN = "tower_fore_aft"  # entry of a mode that another output shows
_PITCH = r"pitch|blpit|beta"
_BELOW = 2.9  # revolutions at rated speed, below which a tower of three blades swings
_RATIOS = (0.8, 0.9, 0.95, 1.05, 1.1, 1.2)  # of frequencies that are tried
_SPEEDS = ("rpm", "1/min", "rad/s", "deg/s", "m/s")
_FACTOR = 1.6  # a frequency may move by at most
_STEP = (0.03, 0.3)  # of the logarithms of frequency and damping, in which the best is looked for


def resonances(
    pair: Pair, modal: Modal, units: Mapping[str, str], moved: Mapping[str, float], context: Mapping[str, Any]
) -> list[Hypothesis]:  # fmt: skip
    """Return the moves of the runs' modes whose outputs moved, and what a tower does to other outputs."""
    run_modes = in_force().run_modes
    found: list[Hypothesis] = []
    most = max(moved.values(), default=1.0) - 1
    least = run_modes.movable_growth_share * most
    movable = [m for m in modal.simulated if _is_sharp(m) and moved[_strongest(m)] - 1 > least]
    runs = model_of_runs(pair) if movable else None
    if runs is not None:
        model, records = runs
        swings = {s.eigenvalue: (s, _strongest(m)) for m in movable for s in [swing_of(model, records, pair.runs, m)]}
        found += [
            _move(pair, s, entry, name, units)
            for s, name in swings.values()
            if s.damping < run_modes.loose_damping
            for entry in MOVED
        ]
    return found + (_towers(pair, context.get("rated_speed_rad_s")) if is_turbine(context) else [])


def _is_sharp(m: Mode) -> bool:
    """Tell whether a mode's frequency is known and no multiple of the rotor's."""
    run_modes = in_force().run_modes
    known = m.frequency_std_hz is not None and m.frequency_std_hz < run_modes.movable_spread * m.frequency_hz
    return known and 0 < m.damping < run_modes.movable_damping and m.rotor_order is None


def _strongest(m: Mode) -> str:
    return max(m.shares, key=lambda n: m.shares[n])


def _move(pair: Pair, swing: Swing, entry: str, name: str, units: Mapping[str, str]) -> Hypothesis:
    f, zeta = swing.frequency_hz, swing.damping
    grid = (*((f * r, zeta) for r in _RATIOS), (f, 0.5 * zeta), (f, 2 * zeta))
    stems = [n.removesuffix("_collective").removesuffix("_cosine").removesuffix("_sine") for n in pair.shown]
    of = [units.get(n) or next((u for k, u in units.items() if k.startswith(n)), "") for n in stems]
    powers = np.array([_power(u, entry) for u in of])

    def change(values: Values) -> Change:
        return Change(runs=lambda side: swing.moved(side, values[0], values[1], powers))

    return Hypothesis(
        entry, f"output:{name}", ("frequency_hz", "damping"), ("Hz", "1"), (f / _FACTOR, 1e-3), (f * _FACTOR, 0.5),
        grid, change, steps=_STEP, of=(f, zeta),
    )  # fmt: skip


def _power(unit: str, entry: str) -> float:
    """Return with which power of the frequency a mode's part of an output goes, the same force driving it.

    Of x = f/m/(s² + 2 ζ ω s + ω²) the residue is 1/(2 m ω): ω⁻¹ where the stiffness moves, ω where the mass does. Every
    derivative has one power more; a load is the stiffness times x.
    """
    derivatives = 2 if "/s^2" in unit or "/s2" in unit or unit == "g" else 1 if unit in _SPEEDS else 0
    if derivatives == 0 and "N" in unit:
        return 1.0
    return derivatives + (-1.0 if entry == "stiffness_change" else 1.0)


def _towers(pair: Pair, rated: float | None) -> list[Hypothesis]:
    """Return a tower's fore-aft mode in the pitch's effect, where no output shows it itself.

    Below three times the rated speed: blades swing above.
    """
    kind = next(k for k in KINDS if k.entry == SEEN)
    pitch = next((i for i, n in enumerate(pair.inputs) if re.search(_PITCH, n.lower())), None)
    if pitch is None or any(re.search(kind.pattern, n.lower()) for n in pair.outputs):
        return []
    low, high = kind.band_hz
    high = min(high, _BELOW * float(rated) / (2 * np.pi)) if rated else high
    place: int = pitch

    def change(values: Values) -> Change:
        f, zeta, share = values
        zero, pole = (2 * np.pi * f, share * zeta), (2 * np.pi * f, zeta)
        return Change(inputs={place: lambda x, step: op.resonance_moved(x, zero, pole, step)})

    grid = tuple((float(f), 0.1, 0.3) for f in np.geomspace(low, high, 14)[:-1])
    return [
        Hypothesis(SEEN, f"output:{pair.outputs[0]}", ("frequency_hz", "damping", HIDDEN[0]), ("Hz", "1", "1"),
                   (low, 0.02, 0.02), (high, 0.5, 0.9), grid, change, steps=(0.05, 0.3, 0.3))
    ]  # fmt: skip
