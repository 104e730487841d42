"""The wake takes seconds to follow the pitch: loads overshoot after a pitch step."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts import pitch_path
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting

_TAUS = (2.5, 5.0, 10.0, 20.0)


def _attach(site: Site) -> list[Attachment]:
    return pitch_path.lead_lag(
        site, "dynamic_inflow", gain=("overshoot", 0.0, 2.0), tau=(1.5, 40.0), grid=_TAUS,
        equation="load ~ pitch + overshoot*(pitch - pitch_slow), d(pitch_slow)/dt = (pitch - pitch_slow)/tau_s",
        says=lambda name, v: (
            f"the wake follows {name} with {v['tau_s']:.3g} s: loads overshoot by {v['overshoot']:.0%} before it does;"
            " the model has no dynamic inflow"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="dynamic_inflow",
    family="slow_aero",
    name="dynamic inflow",
    equation="load ~ pitch + overshoot*(pitch - pitch_slow), d(pitch_slow)/dt = (pitch - pitch_slow)/tau_s",
    source="Øye 1990, in Pedersen (ed.); Snel and Schepers 1995 (ECN-C--94-107); Hansen, Aerodynamics of Wind Turbines",
    quantities=(
        Quantity("overshoot", "1", 0.0, 2.0, 0.0, "load of the frozen wake over that of the settled one, less 1"),
        Quantity("tau_s", "s", 1.5, 40.0, float("nan"), "time constant of the wake (anchor: 4 to 15 s)"),
    ),
    attaches_to="the pitch input of a wind turbine",
    signature="after a pitch step torque and thrust overshoot and relax over 4 to 15 s, alike in both",
    confused_with=(
        ("controller_state", "direction: a hidden integrator makes the slow response larger, the wake smaller"),
        ("aero_nonlinearity", "amplitude: the overshoot is in proportion to the step"),
    ),
    attach=_attach,
    rank=480,
    settings=(
        Setting(OPENFAST, "AeroDyn: Wake_Mod = 1 with DBEMT_Mod = 2 (before 4.0: WakeMod = 2)"),
        Setting(BLADED, "Aerodynamics: dynamic wake (Oye or Pitt and Peters) in place of equilibrium wake"),
    ),
)
