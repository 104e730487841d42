"""The vocabulary an answer is judged by: ids and families, written apart from the catalogue (a test compares them)."""

from __future__ import annotations

FAMILIES: dict[str, tuple[str, ...]] = {
    "input_lag": ("actuator_lag", "actuator_second_order", "transport_delay", "data_time_offset"),
    "sensor_dynamics": ("sensor_lag", "sensor_second_order"),
    "input_nonlinearity": ("rate_limit", "input_saturation", "deadband", "backlash", "input_quantisation"),
    "friction": ("coulomb_friction", "stiction", "viscous_friction_change"),
    "sensor_nonlinearity": ("sensor_rectified", "sensor_saturation", "sensor_quantisation", "sensor_scale",
                            "sensor_sign", "sensor_bias", "sensor_drift", "sensor_cross_axis", "data_channel_swap"),
    "structural_mode": ("drivetrain_torsion", "tower_fore_aft", "tower_side_side", "blade_flap", "blade_edge",
                        "structural_mode"),
    "stiffness_change": ("stiffness_change", "added_mass", "temperature_dependence"),
    "nonlinear_stiffness": ("cubic_stiffness", "quadratic_stiffness", "end_stop", "clearance"),
    "hysteresis": ("bouc_wen_hysteresis", "play_hysteresis"),
    "damping": ("quadratic_damping", "damping_change"),
    "rotor_1p": ("mass_imbalance", "aero_imbalance", "gravity_1p", "wind_shear", "yaw_misalignment"),
    "rotor_3p": ("tower_shadow", "rotational_sampling"),
    "slow_aero": ("dynamic_inflow", "unsteady_aero"),
    "aero_scheduling": ("aero_nonlinearity", "operating_region_switch"),
    "power_level": ("cp_change", "air_density", "efficiency_loss"),
    "wave": ("wave_load",),
    "storage": ("overflow", "one_sided_storage"),
    "coupling": ("missing_coupling", "missing_disturbance", "controller_state"),
    "parameter": ("parameter_error",),
}  # fmt: skip
OF = {identifier: family for family, ids in FAMILIES.items() for identifier in ids}
VERDICTS = ("no_mismatch", "immaterial", "data_fault", "parameter", "named", "ambiguous", "multiple", "unnamed",
            "not_testable")  # fmt: skip
QUIET = ("no_mismatch", "immaterial", "not_testable")


def family_of(identifier: str) -> str:
    """Return the family of an id; what is no id of the catalogue, such as a verdict, is its own."""
    return OF.get(identifier, identifier)
