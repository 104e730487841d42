"""The lift of a blade builds up while its shed vortices drift away: part of the response lags."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts import pitch_path
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting

_ONE_LAG = "load ~ pitch - lagging_share*(pitch - lag(pitch, tau_s))"
_EQUATION = "load ~ pitch - lagging_share*(pitch - (2*lag(pitch, tau_s/6.6) + lag(pitch, tau_s))/3)"


def _attach(site: Site) -> list[Attachment]:
    """Offer Jones' two terms, and the single lag that blades of many chords and air speeds together come near to."""
    top = 3.0
    low = 0.5 * site.step
    if low >= top:
        return []
    grid = tuple(t for t in (0.2, 0.5, 1.2) if low < t)
    return [
        attachment
        for form, kind, equation in (("", "indicial", _EQUATION), ("_one_lag", "lead_lag", _ONE_LAG))
        for attachment in pitch_path.lead_lag(
            site, "unsteady_aero", gain=("lagging_share", -0.75, 0.0), tau=(low, top), grid=grid, equation=equation,
            says=lambda name, v: (
                f"{v['lagging_share']:.0%} of the blades' response to {name} builds up over {v['tau_s']:.3g} s"
                " (shed vorticity); the model's aerodynamics are instantaneous"
            ),
            show=lambda gain: -gain, kind=kind, form=form,
        )
    ]  # fmt: skip


ENTRY = Entry(
    id="unsteady_aero",
    family="slow_aero",
    name="unsteady aerodynamics (shed vorticity)",
    equation=_EQUATION,
    source="Wagner 1925; Theodorsen 1935; R. T. Jones 1938: 1 - 0.165 e^(-0.0455 s) - 0.335 e^(-0.3 s)",
    quantities=(
        Quantity("lagging_share", "1", 0.0, 0.75, 0.0, "share that is not there at once (flat plate: 0.5)"),
        Quantity("tau_s", "s", 0.05, 3.0, float("nan"), "slow time constant: 11 chords over the blade's air speed"),
    ),
    attaches_to="the pitch input of a wind turbine, down to half a sample",
    signature="half of every load change comes at once, the rest within a second; gain falls to a half, phase recovers",
    confused_with=(
        ("actuator_lag", "gain above 1/tau: a drive's droops to nothing, the blades' stops at about a half"),
        ("transport_delay", "gain: a delay leaves it flat"),
    ),
    attach=_attach,
    rank=490,
    settings=(
        Setting(OPENFAST, "AeroDyn: UA_Mod = 3 (Beddoes-Leishman; before 4.0: AFAeroMod = 2)"),
        Setting(BLADED, "Aerodynamics: dynamic stall (Beddoes-Leishman or Oye)"),
    ),
)
