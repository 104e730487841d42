"""Write a narrow band of force that nothing recorded drives, at a frequency known beforehand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site, Slot, location
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter, State

WIDEST = 0.12  # relative half width (damping ratio) of what is still a band and not just coloured noise
_WIDTH = 0.03
EQUATION = "F = p, p' = w*q - relative_width*w*p + noise, q' = -w*p - relative_width*w*q + noise"


def narrow_band(
    site: Site, entry: str, place: rotor.Place, omega: str, slots: tuple[Slot, ...], equation: str,
    says: Callable[[Mapping[str, float]], str], grid: tuple[Mapping[str, float], ...] = ({},),
) -> Attachment:  # fmt: skip
    """Offer a force of unknown size around omega (text in rad/s, of slots or of what the model knows).

    A pair of states turns at omega and is kicked by noise: p' = -d p + w q, q' = -w p - d q + noise, d = width*w;
    the force is p in the size of what it acts on over the spread of the output that shows it.
    """
    shown = float(np.nanstd(site.y[:, site.output_names.index(place.output)])) or 1.0
    scale = place.size / shown
    p, q, width = f"{entry}_p", f"{entry}_q", f"{entry}_width"
    band = Slot(width, "relative_width", "1", 0.0, 0.0, WIDEST, 0.01, local=False)
    own = (*slots, band)

    def edit(model: Equations) -> Equations:
        extra = [Parameter(s.name, _WIDTH if s is band else s.null, s.unit, s.low, s.high) for s in own]
        w, h = f"({omega})", model.sample_time_s
        if h:
            fade, turn = f"exp(-{width}*{w}*{h!r})", f"({w}*{h!r})"
            forms = [f"{fade}*(cos({turn})*{p} + sin({turn})*{q})", f"{fade}*(cos({turn})*{q} - sin({turn})*{p})"]
        else:
            forms = [f"{w}*{q} - {width}*{w}*{p}", f"-{w}*{p} - {width}*{w}*{q}"]
        states = [State(n, "", ex.parse(f, entry), 0.0, True) for n, f in zip((p, q), forms, strict=True)]
        model = replace(model, parameters=(*model.parameters, *extra), states=(*model.states, *states))
        return rotor.push(model, place.add, ex.parse(f"{scale!r}*{p}", entry), f"{entry}_force")

    where = location(place.location, outputs=(place.output,))
    return Attachment(
        entry, f"{entry} {place.location}", where, edit, own, gain_states=(p, q), noise_driven=True,
        grid=tuple({**g, width: _WIDTH} for g in grid), equation=equation, statement=says,
    )  # fmt: skip
