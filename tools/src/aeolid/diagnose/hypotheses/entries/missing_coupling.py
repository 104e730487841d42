"""An input that the recording has and the model does not connect."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts import unused_channel
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site


def _attach(site: Site) -> list[Attachment]:
    channels = [c for c in site.exogenous if c.role == "input"]
    unused = unused_channel.attach(site, "missing_coupling", channels, "acts on the plant, but the model leaves it out")
    return unused + unused_channel.across(site, "missing_coupling", "acts also where the model does not let it reach")


ENTRY = Entry(
    id="missing_coupling",
    family="coupling",
    name="input that the model does not connect",
    equation="dx/dt = f(x, u) + gain*(u_unused - mean)",
    source="Ljung 1999, System Identification: Theory for the User, chapter 16 (residuals against other inputs)",
    quantities=(
        Quantity(
            "gain", "unit of the place/unit of the channel", -1e12, 1e12, 0.0, "force on a motion, rate of a pole"
        ),
    ),
    attaches_to="every channel of role input that the model has no use for (at most 3), into at most 4 motions, other"
    " states or real poles; every input of equations (at most 3), into those that it reaches in no way",
    signature="innovations follow a recorded input that no equation holds",
    confused_with=(
        ("missing_disturbance", "the channel's role: set by a controller, or measured and free of feedback"),
        ("parameter_error", "the channel itself: a wrong value shows without it too"),
    ),
    attach=_attach,
    rank=560,
)
