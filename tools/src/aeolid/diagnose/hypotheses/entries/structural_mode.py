"""A lightly damped mode that the model does not have."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.bending_modes import within_motions
from aeolid.diagnose.hypotheses.parts.modes import RINGS, kind_of, mode_at
from aeolid.diagnose.hypotheses.parts.response_modes import behind_static


def _attach(site: Site) -> list[Attachment]:
    """Offer a mode at every output that is not known to show one with a name of its own, and in every motion."""
    plain = [j for j, name in enumerate(site.output_names) if kind_of(name, site) is None]
    found = [a for a in (mode_at(site, j, None) for j in plain) if a is not None]
    return found + within_motions(site) + behind_static(site)


ENTRY = Entry(
    id="structural_mode",
    family="structural_mode",
    name="structural mode",
    equation="q'' + 2*damping*w*q' + w^2*q = w^2*b*u, w = 2*pi*frequency_hz",
    source="Craig and Kurdila 2006, Fundamentals of Structural Dynamics",
    quantities=(
        Quantity("frequency_hz", "Hz", 0.01, 50.0, float("nan"), "natural frequency"),
        Quantity("damping", "1", 1e-4, RINGS, float("nan"), "damping ratio"),
    ),
    attaches_to="every output without a named mode of a turbine, driven by every input and by noise; of a static law"
    " one, two or three, driven by every input and its rate; every motion of equations that two outputs read, driven as"
    " the motion is",
    signature="a narrow band in one output, phase turning by 180 degrees through it",
    confused_with=(
        ("rotational_sampling", "a rotor harmonic moves with the rotor speed, a mode does not"),
        ("parameter_error", "a shifted mode leaves a pair of opposite residues, a missing one a single band"),
    ),
    attach=_attach,
    rank=320,
)
