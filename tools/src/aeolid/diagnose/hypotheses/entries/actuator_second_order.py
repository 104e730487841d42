"""A drive that follows its command as a damped second-order system."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot, location
from aeolid.diagnose.hypotheses.parts.lateness import later_than_a_reading
from aeolid.diagnose.hypotheses.parts.settings import (
    BLADED,
    DRIVES_PITCH,
    DRIVES_TORQUE,
    OPENFAST,
    ROSCO,
    Setting,
    given,
)
from aeolid.diagnose.hypotheses.parts.wiring import with_filter
from aeolid.models.equations import Equations, Parameter

LOWEST_DAMPING, HIGHEST_DAMPING = 0.2, 0.98  # below: a resonance, not a drive; above: two lags
_STARTS = tuple((period, zeta) for period in (0.7, 1.5, 3.0, 6.0, 12.0) for zeta in (0.5, 0.85))  # samples, 1


def rate_of(inverse: float) -> float:
    """Return ω in rad/s of 1/ω in s; a drive without delay is infinitely fast."""
    return 1.0 / inverse if inverse > 0 else math.inf


def _statement(name: str, v: Mapping[str, float]) -> str:
    return (
        f"{name} acts through a second-order drive of {v['omega_rad_s']:.3g} rad/s with damping {v['damping']:.2g}"
        " that the model leaves out"
    )


def _attach(site: Site) -> list[Attachment]:
    longest = len(site.u) * site.step / 20
    result = []
    for i, name in enumerate(site.input_names):
        inverse, zeta = f"drive_inverse_omega_{i + 1}", f"drive_damping_{i + 1}"
        parameters = (
            Parameter(inverse, 0.0, "s", 0.0, longest),
            Parameter(zeta, 0.7, "1", LOWEST_DAMPING, HIGHEST_DAMPING),
        )

        def edit(model: Equations, name: str = name, added: tuple[Parameter, ...] = parameters) -> Equations:
            return with_filter(model, name, "actuator_second_order", added)

        result.append(
            Attachment(
                "actuator_second_order", f"actuator_second_order input:{name}",
                location(f"input:{name}", inputs=(name,)), edit,
                (Slot(inverse, "omega_rad_s", "rad/s", 0.0, 0.0, longest, 0.3 * site.step, show=rate_of),
                 Slot(zeta, "damping", "1", 0.7, LOWEST_DAMPING, HIGHEST_DAMPING, 0.05, local=False)),
                stepped=True,
                starts=tuple({inverse: p * site.step, zeta: z} for p, z in _STARTS),
                equation=f"w'' = omega_rad_s^2*({name} - w) - 2*damping*omega_rad_s*w', w acts in place of {name}",
                statement=partial(_statement, name), credible=later_than_a_reading(site.step),
            )
        )  # fmt: skip
    return result


ENTRY = Entry(
    id="actuator_second_order",
    family="input_lag",
    name="second-order actuator",
    equation="w'' = omega_rad_s^2*(beta_cmd - w) - 2*damping*omega_rad_s*w'",
    source="Bossanyi and Witcher 2009, Upwind controller for the 5 MW reference; Franklin, Powell, Emami-Naeini 2015",
    quantities=(
        Quantity("omega_rad_s", "rad/s", 0.1, 1000.0, float("inf"), "natural frequency"),
        Quantity("damping", "1", LOWEST_DAMPING, HIGHEST_DAMPING, 0.7, "damping ratio"),
    ),
    attaches_to="every input",
    signature="the phase falls twice as far as with a lag; the gain stays flat up to omega, then drops twice as fast",
    confused_with=(
        ("actuator_lag", "excitation above omega: the gain falls by 12 dB an octave, behind a lag by 6 dB"),
        ("transport_delay", "excitation above omega: the gain falls, behind a dead time it does not"),
        ("sensor_second_order", "one input to all outputs (actuator) against all inputs to one output (sensor)"),
    ),
    attach=_attach,
    rank=40,
    turns=True,
    without_ringing="actuator_lag",
    settings=(
        Setting(
            OPENFAST,
            "OpenFAST 5: ElastoDyn: PitchDOF = True, ServoDyn: PitSpr and PitDamp for {omega_rad_s:.3g} rad/s and a"
            " damping of {damping:.2g} (before: in the controller library)",
            "OpenFAST 5: ElastoDyn: PitchDOF = True, ServoDyn: PitSpr and PitDamp (before: in the controller library)",
            at=DRIVES_PITCH,
        ),
        Setting(
            ROSCO,
            "PA_Mode = 2, PA_CornerFreq = {omega_rad_s:.3g} rad/s, PA_Damping = {damping:.2g}",
            "PA_Mode = 2, PA_CornerFreq, PA_Damping",
            at=DRIVES_PITCH,
        ),
        Setting(
            BLADED,
            "Pitch actuator: second order, frequency {omega_rad_s:.3g} rad/s, damping {damping:.2g}",
            "Pitch actuator: second order",
            at=DRIVES_PITCH,
        ),
        Setting(
            OPENFAST,
            "no switch: neither ServoDyn nor ROSCO has a drive of the torque; filter the demand in the controller"
            " library, second order of {omega_rad_s:.3g} rad/s and damping {damping:.2g}",
            "no switch: neither ServoDyn nor ROSCO has a drive of the torque; filter the demand in the controller"
            " library",
            at=DRIVES_TORQUE,
        ),
        Setting(
            BLADED,
            "no switch: the generator's time constant is of first order; filter the demand in the external controller,"
            " second order of {omega_rad_s:.3g} rad/s and damping {damping:.2g}",
            "no switch: the generator's time constant is of first order; filter the demand in the external controller",
            at=DRIVES_TORQUE,
        ),
        *given(
            "filter what the run is given, second order of {omega_rad_s:.3g} rad/s and damping {damping:.2g}",
            "filter what the run is given, second order",
        ),
    ),
)
