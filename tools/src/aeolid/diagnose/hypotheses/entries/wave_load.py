"""Waves that push the tower of an offshore turbine."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from aeolid.diagnose.data.exogenous import Exogenous
from aeolid.diagnose.data.machine import is_turbine
from aeolid.diagnose.hypotheses.parts import band, rotor
from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.settings import BLADED, OPENFAST, Setting
from aeolid.diagnose.rules import in_force
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Parameter, State

LOW_HZ, HIGH_HZ = 0.0625, 0.25  # peak periods of 4 to 16 s
_BAND = f"{band.EQUATION}, w = 2*pi*peak_frequency_hz"
_RATE_S = 0.3  # time constant of the slope of the recorded elevation: short against every wave


def recorded(site: Site) -> Exogenous | None:
    """Return a recorded wave elevation in m that the model does not use."""
    return next(
        (c for c in site.exogenous if c.role in ("input", "disturbance") and c.unit.strip() == "m"
         and rotor.looks_like("wave", c.name)),
        None,
    )  # fmt: skip


def _attach(site: Site) -> list[Attachment]:
    tower = rotor.place(site, "fore_aft", broad=True) or rotor.place(site, "side_side", broad=True)
    if not is_turbine(site.context) or tower is None:
        return []
    channel = recorded(site)
    if channel is not None:
        return [_driven(site, tower, channel)]
    return [_unseen(site, tower)] if site.context.get("offshore") is True else []


def _driven(site: Site, tower: rotor.Place, channel: Exogenous) -> Attachment:
    """Let the elevation and its slope push: inertia and drag at a depth come with both phases."""
    eta = rotor.samples(site, channel)
    mean, spread = float(np.mean(eta)), float(np.std(eta))
    size = tower.size / spread
    names = ("wave_by_height", "wave_by_slope")
    units = (f"{tower.unit}/m", f"{tower.unit} s/m")
    slots = tuple(Slot(n, n, u, 0.0, -100 * size, 100 * size, 1e-3 * size) for n, u in zip(names, units, strict=True))
    high, h = f"({channel.symbol} - {mean!r})", site.step
    slope = f"(({high} - wave_slow)/{_RATE_S!r})"

    def edit(model: Equations) -> Equations:
        extra = (Parameter(s.name, 0.0, s.unit, s.low, s.high) for s in slots)
        form = slope if not model.sample_time_s else f"wave_slow + {1 - math.exp(-h / _RATE_S)!r}*({high} - wave_slow)"
        state = State("wave_slow", "m", ex.parse(form, "wave"), 0.0)
        model = replace(model, parameters=(*model.parameters, *extra), states=(*model.states, state))
        return rotor.push(model, tower.add, ex.parse(f"{names[0]}*{high} + {names[1]}*{slope}", "wave"), "wave_force")

    return Attachment(
        "wave_load", f"wave_load {tower.location}", location(tower.location, outputs=(tower.output,)), edit, slots,
        equation=f"F = wave_by_height*{channel.name} + wave_by_slope*d({channel.name})/dt",
        statement=lambda v: f"the waves recorded as {channel.name} push the tower; the model leaves their force out",
    )  # fmt: skip


def _unseen(site: Site, tower: rotor.Place) -> Attachment:
    """Look for a band at wave frequencies that nothing recorded drives, away from the rotor's speed."""
    rules = in_force().hypotheses
    name = "wave_frequency_hz"
    once = float(site.context.get("rated_speed_rad_s", 0.0) or abs(rotor.turning(site))) / (2 * np.pi)
    grid = [float(f) for f in np.geomspace(0.07, 0.22, 8) if not once or abs(f / once - 1) > rules.wave_rotor_distance]
    peak = Slot(name, "peak_frequency_hz", "Hz", LOW_HZ, LOW_HZ, HIGH_HZ, 0.02, local=False)
    return band.narrow_band(
        site, "wave_load", tower, f"2*pi*{name}", (peak,),
        _BAND,
        lambda v: f"waves of {1 / v['peak_frequency_hz']:.3g} s push the tower; the model leaves their force out",
        tuple({name: f} for f in grid),
    )  # fmt: skip


ENTRY = Entry(
    id="wave_load",
    family="wave",
    name="wave load",
    equation=f"F = wave_by_height*eta + wave_by_slope*d(eta)/dt; without eta {_BAND}",
    source="Morison, Johnson, Schaaf, O'Brien 1950; Hasselmann et al. 1973 (JONSWAP); DNV-RP-C205",
    quantities=(
        Quantity("wave_by_height", "N/m (unit of the output/m without a motion)", -1e12, 1e12, 0.0, "inertia, drag"),
        Quantity("wave_by_slope", "N s/m (unit of the output s/m without a motion)", -1e12, 1e12, 0.0, "likewise"),
        Quantity("peak_frequency_hz", "Hz", LOW_HZ, HIGH_HZ, float("nan"), "peak of the sea's spectrum"),
        Quantity("relative_width", "1", 0.0, band.WIDEST, 0.0, "half width of the band over its frequency"),
    ),
    attaches_to="the tower of a wind turbine, driven by a recorded wave elevation (m); without one only where the case"
    " says offshore = true, as a band at 0.0625 to 0.25 Hz (ashore such a band has no name here)",
    signature="a narrow band at 0.06 to 0.25 Hz in the motions of the tower, where no part of it resonates",
    confused_with=(
        ("mass_imbalance", "locked to the rotor's angle: waves are not"),
        ("structural_mode", "the record of a wave buoy: waves follow it, a mode does not"),
    ),
    attach=_attach,
    rank=550,
    settings=(
        Setting(OPENFAST, "SeaState: WaveMod, WaveHs, WaveTp; turbine.fst: CompSeaSt, CompHydro"),
        Setting(BLADED, "Sea state: waves"),
    ),
)
