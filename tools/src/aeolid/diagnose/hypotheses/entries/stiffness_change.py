"""A stiffness that steps or drifts while the machine runs: scour, a crack, a loosened bolt."""

from __future__ import annotations

import math

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.forces import natural, per, with_spring
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.hypotheses.parts.timed import Coefficient, changes
from aeolid.diagnose.structure.anatomy import Motion


def _attach(site: Site) -> list[Attachment]:
    return [a for i, motion in with_spring(site) for a in changes(site, motion, i, _stiffness(motion))]


def _stiffness(motion: Motion) -> Coefficient:
    if motion.frequency_hz:  # of a mode: relative to its own
        own = (2 * math.pi * motion.frequency_hz) ** 2
        return Coefficient("stiffness_change", "stiffness_change", "1", 0.95, f"{own!r}*{{q}}", "stiffness", "w^2*q")
    return Coefficient(
        "stiffness_change", "stiffness_change", per(motion, 1), 10 * natural(motion), "{q}", "stiffness", "q"
    )


ENTRY = Entry(
    id="stiffness_change",
    family="stiffness_change",
    name="changed stiffness",
    equation="F = -stiffness_change*s(t)*q, s a step at time_s or a ramp over the recording;"
    " of a mode times w^2, w = 2*pi*frequency",
    source="Prendergast, Hester, Gavin, O'Sullivan 2013 (scour); Basseville and Nikiforov 1993 (change points)",
    quantities=(
        Quantity(
            "stiffness_change",
            "N/m (1/s^2 without a mass, 1 for a mode)",
            -1e12,
            1e12,
            0.0,
            "change; of a mode relative to its own",
        ),
        Quantity(
            "stiffness_change_over_fit",
            "N/m (1/s^2 without a mass, 1 for a mode)",
            -1e12,
            1e12,
            0.0,
            "change from first to last, of a ramp",
        ),
        Quantity("time_s", "s", 0.0, 1e9, float("nan"), "when it steps"),
    ),
    attaches_to="every position with an equation of motion, every oscillatory mode, where one recording holds time",
    signature="the resonance is elsewhere before and after",
    confused_with=(
        ("parameter_error", "a wrong value is wrong from the first sample to the last"),
        ("cubic_stiffness", "a resonance that moves with amplitude moves back"),
        ("temperature_dependence", "follows the recorded temperature, not the clock"),
    ),
    attach=_attach,
    rank=380,
    settings=(
        Setting(OPENFAST, "ElastoDyn: AdjFASt, AdjSSSt (tower), AdjFlSt, AdjEdSt (blades), DTTorSpr (shaft)"),
        Setting(BLADED, "Tower, blade and foundation: stiffness"),
    ),
)
