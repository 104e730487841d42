"""Say what to set in a simulator so that it has an effect: words of OpenFAST, ROSCO and Bladed.

OpenFAST's are keys of its input files (OpenFAST 3 to 5: turbine.fst, ElastoDyn, ServoDyn, AeroDyn 15, InflowWind,
SeaState, HydroDyn), ROSCO's those of DISCON.IN (2.6 to 2.10), Bladed's names of its screens (4.x). Braces are values of
the effect; a row whose values were not told is shown without them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

OPENFAST, ROSCO, BLADED = "OpenFAST", "ROSCO", "Bladed"
_PITCH = r"pitch|blpit|beta"

# effect → simulator → (with values, without)
_ROWS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "actuator_lag": {
        ROSCO: ("PA_Mode = 1, PA_CornerFreq = {inverse_tau:.3g} rad/s", "PA_Mode = 1, PA_CornerFreq = 1/tau in rad/s"),
        BLADED: ("Pitch actuator: first order, time constant {tau_s:.3g} s", "Pitch actuator: first order lag"),
    },
    "actuator_lag torque": {
        OPENFAST: (
            "ServoDyn has no lag of the torque behind a controller library: low-pass the demand in the library with"
            " {tau_s:.3g} s",
            "ServoDyn has no lag of the torque behind a controller library: low-pass the demand in the library",
        ),
        BLADED: ("Generator: torque time constant {tau_s:.3g} s", "Generator: torque time constant"),
    },
    "actuator_second_order": {
        ROSCO: (
            "PA_Mode = 2, PA_CornerFreq = {omega_rad_s:.3g} rad/s, PA_Damping = {zeta:.2g}",
            "PA_Mode = 2, PA_CornerFreq, PA_Damping",
        ),
        BLADED: (
            "Pitch actuator: second order, frequency {omega_rad_s:.3g} rad/s, damping {zeta:.2g}",
            "Pitch actuator: second order",
        ),
    },
    "transport_delay": {
        OPENFAST: (
            "ServoDyn: DLL_DT = {delay_s:.3g} s delays by up to one such step (DLL_Ramp by one more); else delay the"
            " demand in the controller library by {delay_s:.3g} s",
            "ServoDyn: DLL_DT and DLL_Ramp; else delay the demand in the controller library",
        ),
        BLADED: ("External controller: time delay {delay_s:.3g} s", "External controller: time delay"),
    },
    "rate_limit": {
        ROSCO: ("PC_MaxRat, PC_MinRat: ± {rate:.3g} in the demand's unit a second", "PC_MaxRat, PC_MinRat"),
        BLADED: ("Pitch actuator: rate limits ± {rate:.3g}", "Pitch actuator: rate limits"),
    },
    "input_saturation": {
        ROSCO: ("PC_MaxPit, PC_MinPit, VS_MaxTq",),
        BLADED: ("Pitch actuator: angle limits; generator: torque limits",),
    },
    "backlash": {
        OPENFAST: (
            "no switch: pass the demand through {width:.3g} of play (in its unit) between controller library and"
            " ServoDyn",
            "no switch: pass the demand through the play between controller library and ServoDyn",
        ),
        BLADED: ("Pitch actuator in an external library, with {width:.3g} of play", "Pitch actuator with play"),
    },
    "deadband": {
        ROSCO: ("no switch: hold the demand until it has moved by {width:.3g}", "no switch: hold the demand in a band"),
        BLADED: ("Pitch actuator in an external library, with a dead band of {width:.3g}", "Pitch actuator: dead band"),
    },
    "dynamic_inflow": {
        OPENFAST: ("AeroDyn: Wake_Mod = 1 with DBEMT_Mod = 2 (before 4.0: WakeMod = 2)",),
        BLADED: ("Aerodynamics: dynamic wake (Oye or Pitt and Peters) in place of equilibrium wake",),
    },
    "unsteady_aero": {
        OPENFAST: ("AeroDyn: UA_Mod = 3 (Beddoes-Leishman; before 4.0: AFAeroMod = 2)",),
        BLADED: ("Aerodynamics: dynamic stall (Beddoes-Leishman or Oye)",),
    },
    "air_density": {
        OPENFAST: (
            "turbine.fst: AirDens = {density_factor:.4g} times the present value",
            "turbine.fst: AirDens",
        ),
        BLADED: ("Wind: air density = {density_factor:.4g} times the present value", "Wind: air density"),
    },
    "cp_change": {
        OPENFAST: ("AeroDyn: polars (AFNames) and twist (BlTwist) of the blades",),
        BLADED: ("Aerofoils: lift and drag, for instance of rough blades",),
    },
    "efficiency_loss": {
        OPENFAST: ("ServoDyn: GenEff; ElastoDyn: GBoxEff",),
        ROSCO: ("VS_GenEff",),
        BLADED: ("Losses: mechanical and electrical",),
    },
    "tower_fore_aft": {
        OPENFAST: (
            "ElastoDyn: TwFADOF1 = True (TwFADOF2 for the second); tower file: AdjFASt until it swings at"
            " {frequency_hz:.3g} Hz, TwrFADmp(1) for its damping without wind",
            "ElastoDyn: TwFADOF1 = True; tower file: AdjFASt, TwrFADmp(1)",
        ),
        BLADED: ("Modal analysis: include the tower's fore-aft modes",),
    },
    "tower_side_side": {
        OPENFAST: (
            "ElastoDyn: TwSSDOF1 = True (TwSSDOF2 for the second); tower file: AdjSSSt until it swings at"
            " {frequency_hz:.3g} Hz, TwrSSDmp(1)",
            "ElastoDyn: TwSSDOF1 = True; tower file: AdjSSSt, TwrSSDmp(1)",
        ),
        BLADED: ("Modal analysis: include the tower's side-side modes",),
    },
    "drivetrain_torsion": {
        OPENFAST: (
            "ElastoDyn: DrTrDOF = True, DTTorSpr until it swings at {frequency_hz:.3g} Hz, DTTorDmp for a damping of"
            " {damping:.2g}",
            "ElastoDyn: DrTrDOF = True, DTTorSpr, DTTorDmp",
        ),
        BLADED: ("Drive train: flexible low speed shaft, torsional stiffness and damping",),
    },
    "blade_flap": {
        OPENFAST: (
            "ElastoDyn: FlapDOF1 = True (FlapDOF2 for the second); blade file: AdjFlSt, BldFlDmp(1); or BeamDyn"
            " (CompElast = 2)",
        ),
        BLADED: ("Modal analysis: include the blades' flapwise modes",),
    },
    "blade_edge": {
        OPENFAST: ("ElastoDyn: EdgeDOF = True; blade file: AdjEdSt, BldEdDmp(1); or BeamDyn (CompElast = 2)",),
        BLADED: ("Modal analysis: include the blades' edgewise modes",),
    },
    "stiffness_change": {
        OPENFAST: ("ElastoDyn: AdjFASt, AdjSSSt (tower), AdjFlSt, AdjEdSt (blades), DTTorSpr (shaft)",),
        BLADED: ("Tower, blade and foundation: stiffness",),
    },
    "added_mass": {
        OPENFAST: ("ElastoDyn: NacMass, HubMass, AdjTwMa, AdjBlMs; inertias NacYIner, HubIner, GenIner",),
        BLADED: ("Mass and inertia of hub, nacelle, tower, blades",),
    },
    "damping_change": {
        OPENFAST: ("ElastoDyn: TwrFADmp, TwrSSDmp, BldFlDmp, BldEdDmp, DTTorDmp",),
        BLADED: ("Modal analysis: damping of the modes",),
    },
    "tower_shadow": {
        OPENFAST: ("AeroDyn: TwrPotent = 1 and TwrShadow = 1 (upwind: potential flow; downwind: wake)",),
        BLADED: ("Aerodynamics: tower shadow, potential flow or empirical",),
    },
    "rotational_sampling": {
        OPENFAST: ("InflowWind: WindType = 3 with a full field of TurbSim in place of a uniform wind (1, 2)",),
        BLADED: ("Wind: 3D turbulent in place of single point history",),
    },
    "wind_shear": {
        OPENFAST: ("InflowWind: PLexp, or the shear columns of the uniform wind file; TurbSim: PLExp",),
        BLADED: ("Wind: shear exponent",),
    },
    "yaw_misalignment": {
        OPENFAST: ("ElastoDyn: NacYaw (ServoDyn: YawNeut); or InflowWind: PropagationDir",),
        ROSCO: ("Y_ControlMode and its offsets",),
        BLADED: ("Wind: flow direction; nacelle: yaw angle",),
    },
    "mass_imbalance": {
        OPENFAST: ("ElastoDyn: a blade file of its own for one blade (BldFile) with AdjBlMs, or TipMass",),
        BLADED: ("Rotor: mass imbalance (radial position and mass)",),
    },
    "aero_imbalance": {
        OPENFAST: ("AeroDyn: a blade file of its own for one blade (ADBlFile) with BlTwist moved by the pitch error",),
        BLADED: ("Rotor: blade set angle error of one blade",),
    },
    "gravity_1p": {OPENFAST: ("turbine.fst: Gravity",), BLADED: ("Loads: gravity",)},
    "wave_load": {
        OPENFAST: ("SeaState: WaveMod, WaveHs, WaveTp; turbine.fst: CompSeaSt, CompHydro",),
        BLADED: ("Sea state: waves",),
    },
    "quadratic_damping": {
        OPENFAST: ("HydroDyn: drag coefficients SimplCd",), BLADED: ("Sea: hydrodynamic drag",),
    },
    "aero_nonlinearity": {
        OPENFAST: ("AeroDyn in place of a linearised model (CompAero = 2)",),
        BLADED: ("simulate in place of a linear model",),
    },
    "operating_region_switch": {
        ROSCO: ("VS_ControlMode, PS_Mode, SS_Mode and their set points",),
        BLADED: ("External controller: the same version and parameters as on the turbine",),
    },
    "controller_state": {
        ROSCO: ("F_LPFType, F_LPFCornerFreq, F_LPFDamping and the other filters of DISCON.IN as on the turbine",),
        BLADED: ("External controller: the same version and parameters as on the turbine",),
    },
    "sensor_lag": {
        ROSCO: (
            "for a speed: F_LPFCornerFreq = {inverse_tau:.3g} rad/s with F_LPFType = 1; else filter the simulation's"
            " output by {tau_s:.3g} s",
            "for a speed: F_LPFCornerFreq with F_LPFType = 1; else filter the simulation's output",
        ),
        BLADED: ("Transducers: first order lag {tau_s:.3g} s", "Transducers: first order lag"),
    },
    "coulomb_friction": {
        OPENFAST: ("ElastoDyn: YawFrctMod for the yaw bearing; ElastoDyn: GBoxEff for the drive train",),
        BLADED: ("Pitch and yaw bearings: friction",),
    },
}  # fmt: skip


def settings(effect: str, place: str = "", values: Mapping[str, float] | None = None) -> tuple[tuple[str, str], ...]:
    """Return (simulator, what to set) for an effect at a place with its values; none where no simulator has a switch.

    Values that a row names and that were not told leave the general row.
    """
    rows = _ROWS.get(effect, {})
    if effect == "actuator_lag" and place.startswith("input:") and not re.search(_PITCH, place.lower()):
        rows = _ROWS["actuator_lag torque"]
    told = dict(values or {})
    if told.get("tau_s"):
        told["inverse_tau"] = 1.0 / told["tau_s"]
    if "density_change" in told:
        told["density_factor"] = 1.0 + told["density_change"]
    found = []
    for simulator, texts in rows.items():
        try:
            found.append((simulator, texts[0].format(**told)))
        except KeyError:
            found.append((simulator, texts[-1]))
    return tuple(found)
