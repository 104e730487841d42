"""Check angles that wrap, and channels too large or too small to be squared."""

import json

import numpy as np
import pytest
from small_cases import write_case

from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import find_scaling
from aeolid.magnitudes import LARGEST, SMALLEST, require_magnitude
from aeolid.models.angles import find_angles, split_angles, turn_of, with_parts, wraps
from aeolid.record import Channel, Record

RNG = np.random.default_rng(0)


def record_of(columns, units, roles):
    channels = tuple(Channel(n, u, r) for n, u, r in zip(columns, units, roles, strict=True))
    values = np.column_stack(list(columns.values()))
    return Record(0.1 * np.arange(len(values)), values, channels, 0.1, "rotor.csv", "0" * 64)


@pytest.mark.parametrize("turn", [360.0, 2 * np.pi, 1.0])
def test_what_wraps_and_what_does_not(turn):
    for _ in range(20):
        rate, start = RNG.uniform(0.002, 0.1) * RNG.choice([-1, 1]), RNG.uniform(0, 1)
        angle = turn * (start + np.cumsum(rate * RNG.uniform(0.5, 1.5, 3000)))
        assert wraps(angle % turn, turn) and wraps(angle % turn - turn / 2, turn)
        holes = np.where(RNG.random(3000) < 0.1, np.nan, angle % turn)
        assert wraps(holes, turn)
        assert not wraps(angle, turn) and not wraps(np.full(10, np.nan), turn)
    vane = turn * 0.02 * RNG.standard_normal(500)  # a wind direction about north
    assert wraps(vane % turn, turn) and not wraps(vane, turn)
    assert not wraps(turn * RNG.uniform(0, 1, 3000), turn)  # scatters, moves like nothing
    assert not wraps(np.repeat(RNG.uniform(0, 0.7, 30), 50) * turn, turn)  # steps below a turn


def test_units_and_what_is_split():
    assert turn_of("deg") == turn_of(" Degrees ") == 360 and turn_of("rad") == 2 * np.pi and turn_of("m") is None
    angle = np.cumsum(RNG.uniform(1, 9, 400))
    record = record_of(
        {"yaw": angle % 360, "pitch": angle / 500, "other": angle % 360, "y": angle % 360},
        ("deg", "deg", "", "deg"), ("input", "input", "input", "output"),
    )  # fmt: skip
    assert find_angles([record], record.names("input")) == ("yaw",)
    (split,), names, notes = split_angles([record])
    assert names == ("yaw",) and split.names("input") == (
        "yaw_cos",
        "yaw_sin",
        "pitch",
        "other",
    )
    assert np.allclose(split.column("yaw_cos") ** 2 + split.column("yaw_sin") ** 2, 1)
    assert "yaw_cos and yaw_sin" in notes[0] and "output 'y' wraps" in notes[1]
    made = with_parts(record, ["yaw_sin", "pitch", "nothing_cos"])
    assert np.array_equal(made.column("yaw_sin"), split.column("yaw_sin")) and len(made.channels) == 5
    assert split_angles([record], ["pitch"])[1] == ("pitch",) and split_angles([record], [])[1] == ()
    for bad in ("y", "missing", "other"):
        with pytest.raises(UsageError, match=f"--angle {bad}"):
            split_angles([record], [bad])


def test_command_schedules_with_cosine_and_sine_and_its_model_takes_the_angle(tmp_path, capsys):
    """y⁺ = (.6 + .3 cos ψ) y + u + e: scheduled with the angle itself nothing of it is linear."""
    samples = 2500
    psi = np.cumsum(RNG.uniform(5, 15, samples))
    u, y = RNG.standard_normal(samples), np.zeros(samples)
    for k in range(samples - 1):
        y[k + 1] = (0.6 + 0.3 * np.cos(np.deg2rad(psi[k]))) * y[k] + u[k] + 0.05 * RNG.standard_normal()
    channels = (("u", "", "input"), ("psi", "deg", "scheduling"), ("y", "", "output"))
    write_case(tmp_path, "", 0.1, channels, np.column_stack([u, psi % 360, y]))
    base = [str(tmp_path / "recording.csv"), "--roles", str(tmp_path / "roles.toml")]
    model, told = str(tmp_path / "m.json"), tmp_path / "v.json"
    options = ["--method", "lpv", "--past", "3", "--order", "1", "--out", model]
    vaf = {}
    for angle in ("auto", "none"):
        assert main(["identify", *base, *options, "--angle", angle, "--force"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert ("psi_cos and psi_sin" in said) == (angle == "auto")
        assert main(["validate", model, *base, "--json", str(told), "--force"]) == 0
        vaf[angle] = json.loads(told.read_text())["free_run"]["vaf"]["y"]
    assert vaf["auto"] > 98 and vaf["none"] < 90, vaf
    assert main(["identify", *base, *options, "--angle", "u", "--force"]) == 2


@pytest.mark.parametrize("size", [1e200, -1e120, 1e-200])
def test_sizes_whose_squares_leave_double_precision_are_refused(tmp_path, capsys, size):
    u = RNG.standard_normal(600)
    y = np.convolve(u, [0, 1, 0.5])[:600] * size
    channels = (("u", "", "input"), ("y", "m", "output"))
    write_case(tmp_path, "", 0.1, channels, np.column_stack([u, y]))
    command = [
        "identify",
        str(tmp_path / "recording.csv"),
        "--roles",
        str(tmp_path / "roles.toml"),
    ]
    assert main([*command, "--past", "5", "--out", str(tmp_path / "m.json")]) == 3
    said = " ".join(capsys.readouterr().err.split())
    assert "channel 'y'" in said and "unit" in said and "recording.csv" in said
    with pytest.raises(DataError, match=r"'y' is .*sample \d+"):
        find_scaling([record_of({"u": u, "y": y}, ("", ""), ("input", "output"))])


@pytest.mark.parametrize("size", [1e65, 1e-65])
def test_sizes_that_are_taken_give_the_same_model(size):
    u = RNG.standard_normal(1500)
    y = np.convolve(u, 0.7 ** np.arange(30))[:1500] + 0.1 * RNG.standard_normal(1500)
    y = np.concatenate([[0], y[:-1]])
    plain, scaled = (
        identify_varx(
            [record_of({"u": u, "y": y * s}, ("", ""), ("input", "output"))],
            past=6,
            order=1,
        )
        for s in (1.0, size)
    )
    assert scaled.eigenvalues[0] == pytest.approx(plain.eigenvalues[0], rel=1e-9)
    assert scaled.modes[0].damping_std == pytest.approx(plain.modes[0].damping_std, rel=1e-6)


def test_magnitudes_at_the_border():
    require_magnitude("a.csv", "y", np.array([LARGEST, np.nan, np.inf]))
    require_magnitude("a.csv", "y", np.array([SMALLEST, 0.0]))
    require_magnitude("a.csv", "y", np.zeros(3))
    for value in (1.01 * LARGEST, 0.99 * SMALLEST):
        with pytest.raises(DataError, match="sample 2"):
            require_magnitude("a.csv", "y", np.array([0.0, value]))
