"""A drive that cannot move faster than a certain rate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.settings import (
    BLADED,
    DRIVES_PITCH,
    DRIVES_TORQUE,
    OPENFAST,
    ROSCO,
    Setting,
    given,
)
from aeolid.diagnose.hypotheses.parts.wiring import blended_filter, commanded, spread_of, unit_of_input
from aeolid.diagnose.rules import in_force

_GRID, _STARTS = 5, 14
_FASTEST, _WITHIN = 20.0, (6.0, 2.0)  # of the fastest recorded rate: steps are then ramps within a sample
_SLOWEST = 200.0  # of the fastest recorded rate: below that the drive would stand still


def _statement(name: str, unit: str, v: Mapping[str, float]) -> str:
    return f"{name} cannot move faster than {v['rate_per_s']:.3g} {unit}; the model follows the command at once"


def _late_enough(fastest: float) -> Callable[[Mapping[str, float]], str]:
    """Return what objects to a limit that hardly delays the fastest recorded steps; fastest: 1/s.

    Steps of one row are ramps then that end within it, in the mean fastest/(2 rate) rows late.
    """

    def credible(values: Mapping[str, float]) -> str:
        rows = fastest / (2 * values["rate_per_s"])
        if rows >= in_force().hypotheses.ramp_rows:
            return ""
        return f"its fastest steps come {rows:.2g} samples late, less than what the sampling alone can cause"

    return credible


def _attach(site: Site) -> list[Attachment]:
    return [a for i in commanded(site) for a in _on(site, i)]


def _on(site: Site, i: int) -> list[Attachment]:
    rates = np.abs(np.diff(site.u[:, i])) / site.step
    fastest = float(np.quantile(rates, 0.999)) if len(rates) else 0.0
    slowest = max(fastest / _SLOWEST, 10 * spread_of(site.u[:, i]) / (len(site.u) * site.step))
    if not slowest < 0.9 * fastest:
        return []
    name, unit = site.input_names[i], f"{unit_of_input(site, i) or '1'}/s"
    rate = f"rate_limit_{i + 1}"
    slot = Slot(rate, "rate_per_s", unit, fastest, 0.2 * slowest, _FASTEST * fastest, 0.01 * fastest, local=False)
    quick = [{rate: share * fastest} for share in _WITHIN]
    grid = [*quick, *({rate: float(r)} for r in np.geomspace(0.9 * fastest, slowest, _GRID))]
    starts = [*quick, *({rate: float(r)} for r in np.geomspace(0.95 * fastest, slowest, _STARTS))]
    limit = blended_filter(
        site, i, "rate_limit", (slot,), entry="rate_limit", grid=grid, starts=({}, *starts),
        equation=f"|d({name}_actual)/dt| <= rate_per_s",
        statement=partial(_statement, name, unit),
    )  # fmt: skip
    return [replace(limit, credible=_late_enough(fastest))]


ENTRY = Entry(
    id="rate_limit",
    family="input_nonlinearity",
    name="rate limit",
    equation="|d(u_actual)/dt| <= rate_per_s",
    source="Jonkman et al. 2009 (NREL 5 MW: 8 deg/s); Gaertner et al. 2020 (IEA 15 MW: 2 deg/s)",
    quantities=(Quantity("rate_per_s", "unit of the input/s", 1e-6, 1e6, float("inf"), "highest rate"),),
    attaches_to="every input that moves at different rates, but for measured disturbances",
    signature="large commands come late, small ones do not: the lag grows with amplitude",
    confused_with=(
        ("actuator_lag", "two amplitudes of one test signal: a rate limit delays the larger one more"),
        ("input_saturation", "slow commands pass a rate limit whatever their size"),
    ),
    attach=_attach,
    rank=70,
    settings=(
        Setting(
            OPENFAST,
            "no switch: ServoDyn only tells PtchRate_Min and PtchRate_Max to a controller library; limit the demand's"
            " rate there to {rate_per_s:.3g} of its unit a second",
            "no switch: ServoDyn only tells PtchRate_Min and PtchRate_Max to a controller library; limit the demand's"
            " rate there",
            at=DRIVES_PITCH,
        ),
        Setting(
            ROSCO,
            "PC_MaxRat and PC_MinRat (rad/s) = ± {rate_per_s:.3g} of the demand's unit a second",
            "PC_MaxRat, PC_MinRat",
            at=DRIVES_PITCH,
        ),
        Setting(
            BLADED,
            "Pitch actuator: rate limits ± {rate_per_s:.3g} of the demand's unit a second",
            "Pitch actuator: rate limits",
            at=DRIVES_PITCH,
        ),
        Setting(
            OPENFAST,
            "no switch: limit the demand's rate in the controller library to {rate_per_s:.3g} of its unit a second",
            "no switch: limit the demand's rate in the controller library",
            at=DRIVES_TORQUE,
        ),
        Setting(
            ROSCO,
            "VS_MaxRat (N m/s) = {rate_per_s:.3g} of the demand's unit a second",
            "VS_MaxRat",
            at=DRIVES_TORQUE,
        ),
        Setting(
            BLADED,
            "no switch: limit the demand's rate in the external controller to {rate_per_s:.3g} of its unit a second",
            "no switch: limit the demand's rate in the external controller",
            at=DRIVES_TORQUE,
        ),
        *given(
            "limit the rate of what the run is given to {rate_per_s:.3g} of its unit a second",
            "limit the rate of what the run is given",
        ),
    ),
)
