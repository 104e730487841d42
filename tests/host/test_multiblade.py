"""Multi-blade coordinates: laws of the transformation, whirling pairs in recordings, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rotor_rig import FORE_AFT, SIDE_SIDE, blade_hz, rotor, without

from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.formats import write_table
from aeolid.identify.harmonics import locked_share, marked
from aeolid.identify.modal import Modal, find_modal
from aeolid.identify.rotor import rotation
from aeolid.models.blade_sets import find_sets, in_fixed_frame, to_multiblade
from aeolid.models.modes import Mode
from aeolid.models.multiblade import blade_angles, fixed_frame, part_names, to_blades, to_fixed, whirl_of
from aeolid.models.rotor_angle import rotor_angle
from aeolid.record import Roles

RPM = 12.0
P = RPM / 60
EDGE = "edge_moment_1..3"
FEW = ["tower_acc_fore_aft", "tower_acc_side_side", *part_names("edge_moment")]
# A frequency of 400 s of a mode of 1 % at 1 Hz has a deviation of f √(ζ/(2π f T))/… ≈ 0.2 %; four of them, and 1 %
# for the decays of the filter that lowers the rate.
NEAR = 0.01


@cache
def found(unit: str = "deg", missing: str = "") -> Modal:
    """Return the modes of the rig, with its azimuth in a unit and without a channel."""
    record = without(rotor(1, RPM, unit=unit), *filter(None, [missing]))
    return find_modal([record], blades=EDGE, outputs=FEW, past=16, largest=22, decimation=2)


@pytest.mark.parametrize("blades", [3, 4, 5])
def test_the_columns_of_the_transformation_are_orthogonal(blades: int) -> None:
    psi = np.linspace(0, 7, 29)
    columns = np.stack([to_blades(np.tile(e, (29, 1)), psi, blades) for e in np.eye(3)], axis=-1)  # (29, B, 3)
    products = np.einsum("nbi,nbj->nij", columns, columns)
    expected = np.diag([blades, blades / 2, blades / 2])
    np.testing.assert_allclose(products, np.tile(expected, (29, 1, 1)), atol=1e-12)


def test_there_and_back_is_nothing_and_power_is_kept() -> None:
    rng = np.random.default_rng(0)
    y, psi = rng.standard_normal((50, 3)), np.linspace(0, 20, 50)
    parts = to_fixed(y, psi)
    np.testing.assert_allclose(to_blades(parts, psi), y, atol=1e-12)
    power = 3 * parts[:, 0] ** 2 + 1.5 * (parts[:, 1] ** 2 + parts[:, 2] ** 2)
    np.testing.assert_allclose(power, (y**2).sum(axis=1), rtol=1e-12)
    five = to_fixed(
        to_blades(parts, psi, 5), psi
    )  # of five blades three parts are a projection, which does nothing twice
    np.testing.assert_allclose(five, parts, atol=1e-12)


def test_all_columns_at_once_are_those_of_each_set() -> None:
    rng = np.random.default_rng(1)
    y, psi = rng.standard_normal((20, 7)), np.linspace(0, 9, 20)
    both = fixed_frame(y, psi, ((1, 3, 5), (6, 2, 0)))
    each = [y[:, [4]], to_fixed(y[:, [1, 3, 5]], psi), to_fixed(y[:, [6, 2, 0]], psi)]
    np.testing.assert_array_equal(both, np.hstack(each))
    assert fixed_frame(y, None, ((0, 1, 2),)) is y


@pytest.mark.parametrize(("sense", "direction"), [(1, "forward"), (-1, "backward")])
def test_a_wave_round_the_disc_is_a_whirl_and_one_line_on_the_blade(sense: int, direction: str) -> None:
    """From the tower at 0.9 Hz: with the rotor's 0.2 Hz on the blade at 0.7 Hz, against it at 1.1 Hz."""
    t = np.arange(0, 200, 0.05)
    psi = 2 * np.pi * 0.2 * t
    angle = blade_angles(psi, 3)
    y = np.cos(2 * np.pi * 0.9 * t[:, None] - sense * angle)
    parts = to_fixed(y, psi)
    late = np.exp(-2j * np.pi * 0.9 * t) @ parts / len(t)
    whirl = whirl_of(dict(zip(part_names("tip"), map(complex, late), strict=True)), {}, 0.9, 0.2)
    assert whirl is not None
    assert whirl.direction == direction and whirl.degree == pytest.approx(sense, abs=1e-9)
    spectrum = abs(np.fft.rfft(y[:, 0]))
    assert np.fft.rfftfreq(len(t), 0.05)[spectrum.argmax()] == pytest.approx(whirl.blade_hz, abs=1e-9)


def test_a_shape_without_a_sense_says_so_and_one_of_all_blades_too() -> None:
    shape = dict(zip(part_names("tip"), (0.1, 1.0, 0.05j), strict=True))
    standing = whirl_of(shape, {}, 1.0, 0.2)
    together = whirl_of(dict(zip(part_names("tip"), (1.0, 0.1, 0.1j), strict=True)), {}, 1.0, 0.2)
    assert standing is not None and standing.direction == "standing" and standing.blade_hz is None
    assert together is not None and together.direction == "collective" and together.blade_hz == 1.0
    assert whirl_of({"speed": 1.0}, {}, 1.0, 0.2) is None


@pytest.mark.parametrize(
    ("unit", "missing"), [("deg", ""), ("rad", ""), ("rev", "rotor_speed"), ("deg", "azimuth")], ids=str
)
def test_blades_that_swing_alike_are_a_pair_one_p_below_and_above(unit: str, missing: str) -> None:
    """Also where the azimuth is in another unit, and where only the rotor's speed is recorded."""
    modal = found(unit, missing)
    own = blade_hz(P)
    for direction, hertz in (("backward", own - P), ("forward", own + P), ("collective", own)):
        mode = min(modal.listed, key=lambda m: abs(m.frequency_hz - hertz))
        assert mode.frequency_hz == pytest.approx(hertz, rel=NEAR)
        assert mode.whirl is not None and mode.whirl.direction == direction
        assert mode.whirl.blade_hz == pytest.approx(own, rel=NEAR)
        if direction != "collective":
            assert mode.name == f"blade edgewise, {direction}"
            assert f"{direction} whirl" in modal.summary()
    for hertz, _ in (FORE_AFT, SIDE_SIDE):
        assert min(abs(m.frequency_hz / hertz - 1) for m in modal.listed) < 0.02
    assert all(abs(m.frequency_hz / (k * P) - 1) > 0.01 for m in modal.listed for k in (1, 2, 3, 6))


def test_on_the_blades_themselves_the_pair_is_not_seen() -> None:
    """Without the transformation a blade has its own frequency alone: nothing at one P below and above."""
    modal = find_modal([rotor(1, RPM)], outputs=["edge_moment_1"], past=16, largest=12, decimation=2)
    own = blade_hz(P)
    assert all(abs(m.frequency_hz - own) < 0.05 for m in modal.listed) and modal.listed


@pytest.mark.parametrize("unit", ["deg", "rad", "rev"])
def test_the_rotor_turns_alike_in_every_unit(unit: str) -> None:
    record = rotor(1, RPM, unit=unit)
    turning = rotation(record)
    assert turning is not None and turning.frequency_hz == pytest.approx(P, rel=1e-3)
    angle = rotor_angle(record)
    assert angle is not None
    np.testing.assert_allclose(np.exp(1j * angle), np.exp(1j * (rotor_angle(rotor(1, RPM)))), atol=1e-9)


def test_a_unit_that_the_azimuth_is_not_in_is_refused() -> None:
    record = rotor(1, RPM, unit="rad")
    channels = tuple(replace(c, unit="deg") if c.name == "azimuth" else c for c in record.channels)
    with pytest.raises(DataError, match=r"in deg by the roles file, and wraps at 6\.283 as an angle in rad"):
        in_fixed_frame([replace(record, channels=channels)], EDGE)
    channels = tuple(replace(c, unit="m") if c.name == "azimuth" else c for c in record.channels)
    with pytest.raises(DataError, match="no unit of angles"):
        in_fixed_frame([replace(record, channels=channels)], EDGE)


def test_without_azimuth_and_speed_there_is_no_fixed_frame() -> None:
    with pytest.raises(DataError, match="neither the rotor's azimuth nor its speed"):
        in_fixed_frame([without(rotor(1, RPM), "azimuth", "rotor_speed")], EDGE)


@pytest.mark.parametrize(
    ("asked", "error", "text"),
    [
        ("edge_moment_1", UsageError, "1 blade; a fixed frame takes three"),
        ("edge_moment_1,edge_moment_2", UsageError, "2 blades; a fixed frame takes three"),
        ("edge_moment_1..4", UsageError, "no channel 'edge_moment_4'"),
        ("edge_moment_1,edge_moment_1,edge_moment_2", UsageError, "different channels"),
        ("generator_speed,edge_moment_1,edge_moment_2", DataError, "one unit"),
        ([EDGE, EDGE], UsageError, "is in two sets"),
    ],
)
def test_sets_that_are_none_are_refused(asked: str, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        find_sets(rotor(1, RPM, 100), asked)


def test_a_missing_blade_is_said() -> None:
    with pytest.raises(DataError, match="of the blades of 'edge_moment' number 2 is missing"):
        find_sets(without(rotor(1, RPM, 100), "edge_moment_2"), "auto")


def test_blades_in_the_wrong_order_are_refused_with_the_right_one() -> None:
    """Gravity stands still in space: through blades in the wrong order it runs backwards."""
    record = rotor(1, RPM)
    wrong = "edge_moment_1,edge_moment_3,edge_moment_2"
    with pytest.raises(DataError, match="against the rotor") as said:
        in_fixed_frame([record], wrong)
    advice = str(said.value).rpartition("--blades ")[2]
    np.testing.assert_array_equal(in_fixed_frame([record], advice)[0].values, in_fixed_frame([record], EDGE)[0].values)


def test_unequal_blades_have_no_order_to_be_wrong() -> None:
    """1P on one blade alone runs both ways alike, and says nothing."""
    record = rotor(1, RPM, lines=0.0)
    values = record.values.copy()
    values[:, 3] += 5 * np.cos(2 * np.pi * P * record.time_s)
    to_multiblade(replace(record, values=values), find_sets(record, EDGE))


ROLES = """
[recording]
sample_time_s = 0.1
"""


def test_sets_of_the_roles_file_are_those_of_the_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = rotor(1, RPM, 2500)
    write_table(tmp_path / "a.csv", {c.name: record.column(c.name) for c in record.channels})
    entries = [
        f'[[channel]]\nname = "{c.name}"\nunit = "{c.unit}"\nrole = "{c.role}"\n'
        + (f"blade = {c.name[-1]}\n" if c.name.startswith("edge") else "")
        for c in record.channels
    ]
    roles = tmp_path / "roles.toml"
    roles.write_text(ROLES + "\n".join(entries), encoding="utf-8")
    options = ["modes", str(tmp_path / "a.csv"), "--roles", str(roles), "--past", "16", "--largest-order", "16"]
    facts = []
    for more in ([], ["--blades", EDGE]):
        files = ["--json", str(tmp_path / "m.json"), "--report", str(tmp_path / "m.html")]
        assert main([*options, "--decimate", "2", *more, *files]) == 0
        facts.append(json.loads((tmp_path / "m.json").read_text(encoding="utf-8")))
    assert facts[0] == facts[1]
    page = (tmp_path / "m.html").read_text(encoding="utf-8")
    assert "On the blades" in page and "backward" in page
    assert {"edge_moment_collective", "edge_moment_cosine", "edge_moment_sine"} < set(facts[0]["outputs"])
    whirls = {m["whirl"]["direction"] for m in facts[0]["modes"]}
    assert {"forward", "backward"} <= whirls
    model = str(tmp_path / "model.json")
    given = [str(tmp_path / "a.csv"), "--roles", str(roles)]
    assert main(["identify", *given, "--past", "8", "--order", "8", "--uncertainty", "none", "--out", model]) == 0
    names = [s["name"] for s in json.loads(Path(model).read_text(encoding="utf-8"))["outputs"]]
    assert "edge_moment_sine" in names and "edge_moment_1" not in names
    assert main(["validate", model, *given]) == 0
    capsys.readouterr()


def test_a_model_of_the_fixed_frame_is_validated_on_the_blades(tmp_path: Path) -> None:
    """A recording that has the blades serves a model of their parts, whatever its roles file says of sets."""
    from aeolid.models.load import matched
    from aeolid.models.state_space import Signal

    record = rotor(1, RPM, 300)
    signals = [Signal(n, "kN m") for n in part_names("edge_moment")]
    expected = to_fixed(record.columns([f"edge_moment_{b}" for b in (1, 2, 3)]), rotor_angle(record))
    np.testing.assert_allclose(matched(record, signals), expected, atol=1e-12)
    with pytest.raises(DataError, match="'tip_moment_cosine' is missing"):
        matched(record, [Signal("tip_moment_cosine", "kN m")])


@pytest.mark.parametrize("value", ["0", "10", "1.5", '"1"', "true"])
def test_a_number_of_a_blade_that_is_none_is_refused(tmp_path: Path, value: str) -> None:
    path = tmp_path / "roles.toml"
    path.write_text(f'[[channel]]\nname = "a"\nunit = ""\nrole = "output"\nblade = {value}\n', encoding="utf-8")
    with pytest.raises(DataError, match="no number of a blade"):
        Roles.load(path)


def test_modes_near_a_smeared_line_are_modes_and_lines_are_not() -> None:
    """A speed that wanders by 7 % smears 2P over the tower's mode: the rotor's angle tells which is which."""
    record = rotor(2, 9.9, uneven=0.07, lines=0.6)  # 2P at 0.33 Hz: the tower's own frequency
    still = in_fixed_frame([record], EDGE)[0]
    order, turning = 2, rotation(record)
    assert turning is not None
    angle = order * rotor_angle(record)
    spread = order * turning.deviation_hz * record.sample_time_s
    line = np.cos(angle + 1)
    assert locked_share(line, angle, spread) > 0.99
    clean = rotor(2, 9.9, uneven=0.07, lines=0.0)
    assert locked_share(clean.column("tower_acc_fore_aft"), angle, spread) < 0.2
    quiet = without(clean, "generator_speed")
    modal = find_modal([quiet], blades=EDGE, past=16, largest=18, decimation=2)
    for hertz in (SIDE_SIDE[0], blade_hz(0.165) - 0.165, blade_hz(0.165) + 0.165):
        assert min(abs(m.frequency_hz / hertz - 1) for m in modal.listed) < 0.02, hertz
    assert still.names("output")[-1] == "edge_moment_sine"


def test_harmonics_of_a_model_of_the_fixed_frame_are_told_on_recordings_that_have_the_blades() -> None:
    """A pole at 2P without damping that no sine of the rotor's angle explains is a mode, whoever holds the channel."""
    s = 2j * np.pi * 2 * P
    mode = Mode(2 * P, 0.0, complex(np.exp(0.1 * s)), 1e-3, 1e-3, {"edge_moment_sine": 1.0})
    (seen,) = marked([mode], [rotor(1, RPM)], output_only=True)
    assert seen.rotor_order is None
