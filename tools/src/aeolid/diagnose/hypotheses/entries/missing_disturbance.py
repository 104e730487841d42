"""A measured disturbance that the model ignores."""

from __future__ import annotations

from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.entries import wave_load
from aeolid.diagnose.hypotheses.parts import unused_channel
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site


def _attach(site: Site) -> list[Attachment]:
    waves = wave_load.recorded(site) if is_turbine(site.context) else None  # waves have a name of their own
    channels = [c for c in site.exogenous if c.role == "disturbance" and c is not waves]
    says = "disturbs the plant and is recorded, but the model ignores it"
    found = unused_channel.attach(site, "missing_disturbance", channels, says)
    return found + unused_channel.within_states(site, "missing_disturbance", channels, says)


ENTRY = Entry(
    id="missing_disturbance",
    family="coupling",
    name="recorded disturbance that the model ignores",
    equation="dx/dt = f(x, u) + gain*(d_unused - mean); of an unmeasured state d that nothing but noise drives,"
    " d -> d + gain*(d_unused - mean) wherever it acts",
    source="Ljung 1999, System Identification: Theory for the User, chapter 16 (residuals against other inputs)",
    quantities=(
        Quantity(
            "gain", "unit of the place/unit of the channel", -1e12, 1e12, 0.0, "force on a motion, rate of a pole"
        ),
    ),
    attaches_to="every channel of role disturbance that the model has no use for (at most 3), into at most 4 motions,"
    " other states or real poles; and as a part of every state that noise alone drives, a wind that nobody measured; a"
    " wave elevation of a turbine belongs to wave_load",
    signature="innovations follow a recorded disturbance that no equation holds",
    confused_with=(
        ("missing_coupling", "the channel's role: measured and free of feedback, or set by a controller"),
        ("wave_load", "the channel: a wave elevation in m pushes the tower alone"),
    ),
    attach=_attach,
    rank=570,
)
