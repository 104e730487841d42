"""A lightly damped mode that the model does not have."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.bending_modes import within_motions
from aeolid.diagnose.hypotheses.parts.carried_mass import carried_masses
from aeolid.diagnose.hypotheses.parts.modes import RINGS, kind_of, mode_at
from aeolid.diagnose.hypotheses.parts.response_modes import behind_static
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.hypotheses.parts.shared_modes import seen_in_all

_FORE_AFT = r"^output:.*(fore.?aft|taxp|twrbsmyt)"  # outputs of a turbine that show its further modes
_SIDE = r"^output:.*(side.?(to.?)?side|tayp|twrbsmxt|lateral)"
_FLAP = r"^output:.*(flap|out.?of.?plane|rootmy[bc])"


def _attach(site: Site) -> list[Attachment]:
    """Offer a mode at every output that is not known to show one with a name of its own, and in every motion."""
    plain = [j for j, name in enumerate(site.output_names) if kind_of(name, site) is None]
    found = [a for a in (mode_at(site, j, None) for j in plain) if a is not None]
    return found + seen_in_all(site) + within_motions(site) + carried_masses(site) + behind_static(site)


ENTRY = Entry(
    id="structural_mode",
    family="structural_mode",
    name="structural mode",
    equation="q'' + 2*damping*w*q' + w^2*q = w^2*b*u, w = 2*pi*frequency_hz; of a body that carries it, q beside it,"
    " x'' = a - 2*damping*w*x' - w^2*x, (1 - share)*q'' = a - share*(w^2*x + 2*damping*w*x')",
    source="Craig and Kurdila 2006, Fundamentals of Structural Dynamics",
    quantities=(
        Quantity("frequency_hz", "Hz", 0.01, 50.0, float("nan"), "natural frequency"),
        Quantity("damping", "1", 1e-4, RINGS, float("nan"), "damping ratio"),
        Quantity("share", "1", 0.0, 0.95, 0.0, "part of the body's mass that swings, where a body carries it"),
    ),
    attaches_to="every output without a named mode of a turbine, driven by every input and by noise; all such outputs"
    " together, with one shape; of a static law one, two or three, driven by every input and its rate; every motion of"
    " equations that two outputs read, driven as the motion is; beside turbines every body and every mode of a linear"
    " model that carries a part of its mass on a spring, or, where it moves in metres, from a hinge",
    signature="a narrow band in one output or several, phase turning by 180 degrees through it; a part that is carried"
    " splits the resonance of its body in two",
    confused_with=(
        ("rotational_sampling", "a rotor harmonic moves with the rotor speed, a mode does not"),
        ("parameter_error", "a shifted mode leaves a pair of opposite residues, a missing one a single band"),
    ),
    attach=_attach,
    rank=320,
    settings=(
        Setting(
            OPENFAST,
            "ElastoDyn: TwFADOF2 = True (the tower's second fore-aft mode) or FlapDOF2 = True (the blades' second"
            " flapwise mode), whichever swings at {frequency_hz:.3g} Hz",
            "ElastoDyn: TwFADOF2 = True or FlapDOF2 = True",
            f"{_FORE_AFT}|{_FLAP}",
        ),
        Setting(
            OPENFAST,
            "ElastoDyn: TwSSDOF2 = True (the tower's second side-side mode), if that swings at {frequency_hz:.3g} Hz",
            "ElastoDyn: TwSSDOF2 = True",
            _SIDE,
        ),
        Setting(
            BLADED,
            "Modal analysis: include the modes of tower and blades up to {frequency_hz:.3g} Hz",
            "Modal analysis: include further modes of tower and blades",
            f"{_FORE_AFT}|{_FLAP}|{_SIDE}",
        ),
    ),
)
