"""What errors one row ahead tell of a turbine: patterns of their growth, as three simulated turbines have them."""

from __future__ import annotations

import pytest

from aeolid.diagnose.run_prior.standing import grown

OUTPUTS = (
    "generator_speed", "tower_acc_fore_aft", "tower_acc_side_side",
    "flap_moment_collective", "flap_moment_cosine", "flap_moment_sine",
)  # fmt: skip


def of(*growth: float) -> dict[str, float]:
    return dict(zip(OUTPUTS, growth, strict=True))


@pytest.mark.parametrize(
    "moved",
    [
        of(1.62, 3.16, 2.05, 4.13, 4.68, 7.04),
        of(3.0, 5.7, 2.32, 6.18, 2.99, 8.5),
        of(1.24, 2.14, 1.56, 2.58, 1.86, 1.93),
    ],
    ids=["5 MW", "15 MW", "2.8 MW, 120 s"],
)  # fmt: skip
def test_other_blades_spoil_all_that_moves_out_of_the_plane(moved: dict[str, float]) -> None:
    found = grown(moved)
    assert found is not None and found.entries == ("blade_flap",) and found.own
    assert found.place["blade_flap"] == "output:flap_moment_collective"


@pytest.mark.parametrize(
    ("moved", "first"),
    [
        (of(2.39, 1.06, 1.32, 1.04, 1.06, 1.03), "drivetrain_torsion"),
        (of(2.24, 1.31, 3.43, 1.54, 1.34, 1.17), "tower_side_side"),
        ({"edge_moment_sine": 2.0, "generator_speed": 1.4, "flap_moment_sine": 1.1}, "blade_edge"),
    ],
)
def test_a_mode_in_the_plane_spoils_what_moves_there_alone(moved: dict[str, float], first: str) -> None:
    found = grown(moved)
    assert found is not None and found.entries[0] == first
    assert set(found.entries) == {"drivetrain_torsion", "blade_edge", "tower_side_side"} == set(found.words)


@pytest.mark.parametrize(
    "moved",
    [
        of(1.2, 1.63, 2.27, 5.4, 2.07, 1.65),  # a tower without its mode: the blades' moment more than the tower
        of(1.33, 2.34, 1.38, 1.94, 1.67, 1.85),  # another one: the tower more than the blades
        of(1.78, 1.19, 1.09, 1.29, 1.07, 1.09),  # a late pitch drive
        of(1.09, 1.07, 1.44, 1.11, 1.66, 1.19),  # a tower's shadow
        of(1.0, 1.0, 1.0, 1.0, 1.0, 1.0),
        {"generator_speed": 2.5},  # nothing out of the plane was recorded
        {"rotor_speed": 1.78, "tower_acc_fore_aft": 1.19},  # a late pitch drive again: no blades tell
        {"platform_pitch": 3.0, "tower_acc_fore_aft": 1.0},
    ],
)
def test_other_patterns_are_not_named(moved: dict[str, float]) -> None:
    assert grown(moved) is None
