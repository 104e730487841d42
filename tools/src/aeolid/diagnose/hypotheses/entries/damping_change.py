"""A damping that steps or drifts while the machine runs: a failing damper, oil that warms up."""

from __future__ import annotations

import math

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.forces import natural, per
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.hypotheses.parts.timed import Coefficient, changes
from aeolid.diagnose.structure.anatomy import Motion


def _attach(site: Site) -> list[Attachment]:
    return [a for i, motion in enumerate(site.motions) for a in changes(site, motion, i, _damping(motion))]


def _damping(motion: Motion) -> Coefficient:
    if motion.frequency_hz:  # of a mode: added to its damping ratio
        twice = 4 * math.pi * motion.frequency_hz
        return Coefficient("damping_change", "damping_change", "1", 0.9, f"{twice!r}*{{v}}", "damping", "2*w*v")
    unit, most = per(motion, 1, velocity=True), 10 * natural(motion, velocity=True)
    return Coefficient("damping_change", "damping_change", unit, most, "{v}", "damping", "v")


ENTRY = Entry(
    id="damping_change",
    family="damping",
    name="changed damping",
    equation="F = -damping_change*s(t)*v, s a step at time_s or a ramp over the recording;"
    " of a mode times 2*w, w = 2*pi*frequency",
    source="Basseville and Nikiforov 1993, Detection of Abrupt Changes",
    quantities=(
        Quantity(
            "damping_change",
            "N s/m (1/s without a mass, 1 for a mode)",
            -1e12,
            1e12,
            0.0,
            "change; of a mode of its damping ratio",
        ),
        Quantity(
            "damping_change_over_fit",
            "N s/m (1/s without a mass, 1 for a mode)",
            -1e12,
            1e12,
            0.0,
            "change from first to last, of a ramp",
        ),
        Quantity("time_s", "s", 0.0, 1e9, float("nan"), "when it steps"),
    ),
    attaches_to="every velocity with an equation of motion, every oscillatory mode, where one recording holds time",
    signature="free motion decays faster or slower before and after, at the same frequency",
    confused_with=(
        ("parameter_error", "a wrong value is wrong from the first sample to the last"),
        ("quadratic_damping", "drag follows the amplitude, not the clock"),
    ),
    attach=_attach,
    rank=220,
    settings=(
        Setting(OPENFAST, "ElastoDyn: TwrFADmp, TwrSSDmp, BldFlDmp, BldEdDmp, DTTorDmp"),
        Setting(BLADED, "Modal analysis: damping of the modes"),
    ),
)
