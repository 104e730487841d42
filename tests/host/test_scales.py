"""Offsets and scales: what fits a channel, and which channels a filter with others hardly sees."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.filters import replay_filter, save_markov
from aeolid.filters.scales import FACTOR, OFF_MOST, ChannelSums, RunSums, find_problems, fitting
from aeolid.formats.controller_channels import CHANNELS, OPENFAST, factor_to, find_tapped
from aeolid.identify.streamed import StreamedMarkov
from aeolid.identify.varx import identify_varx
from aeolid.record import Channel, Record

ROOT = Path(__file__).resolve().parents[2]
RNG = np.random.default_rng(4)


def sums_of(values):
    sums = ChannelSums.empty(values.shape[1])
    sums.add(values)
    return sums


def problems_of(column, offset, scale, unit="rad/s"):
    sums = sums_of(np.asarray(column, float)[:, None])
    return find_problems(("generator_speed",), (unit,), np.array([offset]), np.array([scale]), sums)


def test_sums_of_pieces_are_those_of_the_whole():
    """Against numpy's two passes, with missing samples, a mean far from zero and pieces of any length."""
    x = np.array([1e4, -3.0, 0.0]) + RNG.standard_normal((1000, 3)) * [1e-2, 1.0, 7.0]
    x[RNG.random(x.shape) < 0.2] = np.nan
    sums, start = ChannelSums.empty(3), 0
    while start < len(x):
        stop = start + int(RNG.integers(0, 9))
        sums.add(x[start:stop])
        start = stop
    np.testing.assert_array_equal(sums.count, np.isfinite(x).sum(axis=0))
    np.testing.assert_allclose(sums.mean, np.nanmean(x, axis=0), rtol=1e-12)
    np.testing.assert_allclose(sums.deviation, np.nanstd(x, axis=0), rtol=1e-8)
    np.testing.assert_array_equal([sums.least, sums.most], [np.nanmin(x, axis=0), np.nanmax(x, axis=0)])


def test_a_direct_drive_speed_with_the_scale_of_a_gearbox_is_told():
    (told,) = problems_of(0.79 + 0.011 * np.resize([1.0, -1.0], 600), 122.0, 5.0)
    assert "generator_speed: its mean lies -24.2 scales from its offset" in told
    assert "deviation is 0.0022 scales (offset 122, scale 5 rad/s): the filter hardly sees it" in told
    assert told.endswith("offset 0.79 scale 0.011 would fit")


@pytest.mark.parametrize("mean", [0.0, 0.79, -3.0, 4e6])
@pytest.mark.parametrize("deviation", [1e-3, 0.5, 1e3])
def test_what_is_told_fits(mean, deviation):
    offset, scale = (float(text) for text in fitting(mean, deviation))
    assert abs(offset - mean) <= 0.05 * deviation and abs(scale - deviation) <= 0.05 * deviation
    column = mean + deviation * np.resize([1.0, -1.0], 600)
    assert problems_of(column, offset, scale) == ()
    assert len(problems_of(column, offset, 1.01 * FACTOR * deviation)) == 1
    assert len(problems_of(column, offset, 0.99 * deviation / FACTOR)) == 1
    assert problems_of(column, offset, 0.9 * FACTOR * deviation) == ()
    assert problems_of(column, mean + 0.99 * OFF_MOST * deviation, deviation) == ()
    assert len(problems_of(column, mean + 1.01 * OFF_MOST * deviation, deviation)) == 1


def test_a_constant_channel_has_its_remedies_and_few_samples_none():
    (told,) = problems_of(np.full(600, 43093.0), 4e4, 2e3, "N m")
    assert "is constant at 43093 N m" in told and "role ignore" in told and "controller's filter" in told
    assert problems_of(np.full(19, 43093.0), 4e4, 2e3) == ()
    assert problems_of(np.full(600, np.nan), 4e4, 2e3) == ()


def test_the_start_of_a_run_is_left_aside_where_more_follows():
    rows = np.arange(700.0)[:, None]
    run = RunSums(1, 600)
    for start in range(0, 700, 37):
        run.add(rows[start : start + 37])
    assert run.judged.mean[0] == pytest.approx(np.mean(rows[600:]))
    short = RunSums(1, 600)
    short.add(rows[:610])
    assert short.judged.mean[0] == pytest.approx(np.mean(rows[:600]))


def test_identify_says_which_channels_the_filter_hardly_saw(tmp_path):
    u, e = RNG.standard_normal((2000, 1)), 0.1 * RNG.standard_normal((2000, 1))
    y = np.zeros((2000, 1))
    for k in range(1, 2000):
        y[k] = 0.8 * y[k - 1] + u[k - 1] + e[k]
    channels = (Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output"))
    record = Record(0.1 * np.arange(2000), np.hstack([u, 7.55 + 0.1 * y]), channels, 0.1, "rec.csv", "0" * 64)
    said = {}
    for offset, scale in ((7.55, 0.15), (1165.0, 48.0)):
        result = replay_filter(u, record.matrix("output"), past=3, sample_time_s=0.1, offset=(0, offset),
                               scale=(1, scale))  # fmt: skip
        with (tmp_path / "m.npz").open("wb") as handle:
            save_markov(handle, result, record)
        markov = StreamedMarkov.load(tmp_path / "m.npz")
        notes = identify_varx([record], past=3, order=1, markov=markov).notes
        said[scale] = [note for note in notes if note.startswith("the filter that streamed")]
    assert said[0.15] == []
    (note,) = said[48.0]
    assert "speed: its mean lies -24.1 scales" in note
    (fits,) = (float(n) for n in re.findall(r"scale ([0-9.]+) would fit", note))
    assert 0.13 < fits < 0.2  # of 0.0034 scales of 48, two digits told; float sums round otherwise elsewhere


# ---- the command ----


def test_the_channels_are_those_of_the_wrapper():
    text = (ROOT / "port/discon/records.c").read_text(encoding="utf-8")
    assert dict(re.findall(r'\{"(\w+)", "([^"]+)", SOURCE_', text)) == CHANNELS
    assert OPENFAST.keys() <= CHANNELS.keys()


def test_units_are_brought_to_those_of_the_wrapper():
    assert factor_to("generator_speed", "rpm") == pytest.approx(2 * np.pi / 60)
    assert factor_to("torque_command", "kN-m") == factor_to("torque_command", "kN·m") == 1000.0
    assert factor_to("pitch_command", "rad") == 1.0 and factor_to("nacelle_nod", "deg/s^2") == np.pi / 180
    assert factor_to("tower_fore_aft", "m/s²") == factor_to("tower_fore_aft", "m/s^2") == 1.0
    assert factor_to("pitch_command", "m") is None and factor_to("speed", "rpm") is None
    found = find_tapped({"Time": "s", "GenSpeed": "rpm", "BldPitch1": "deg", "BlPitchC1": "deg", "GenTq": "rad"})
    assert [(t.name, t.heading) for t in found] == [("pitch_command", "BlPitchC1"), ("generator_speed", "GenSpeed")]


def write_out(path, rows):
    """Write a text file of OpenFAST: Time, GenSpeed in rpm, GenTq in kN·m, Azimuth, all about their means."""
    wave = np.sin(np.arange(rows) * 0.7)
    lines = ["", "made by a test", "", "", "", "", "Time GenSpeed GenTq Azimuth", "(s) (rpm) (kN-m) (deg)"]
    for k in range(rows):
        speed = 7.55 + 0.14 * wave[k] if k >= 200 else 0.0  # starts from rest
        lines.append(f"{0.1 * k:.1f} {speed:.6f} 19600 {k % 360}")
    path.write_text("\n".join(lines) + "\n")


def test_lines_of_a_simulators_run_are_settings_of_the_wrapper(tmp_path, capsys):
    write_out(tmp_path / "turbine.out", 2000)
    assert main(["scales", str(tmp_path / "turbine.out"), "--json", str(tmp_path / "facts.json")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("turbine.out, 49.975 to 199.9 s: mean and standard deviation")
    assert lines[1:] == ["# torque_command is constant at 19600 kN-m: excite it, or leave it out",
                         "output = generator_speed offset 0.791 scale 0.01 # rad/s, from GenSpeed"]  # fmt: skip
    (speed,) = [c for c in json.loads((tmp_path / "facts.json").read_text())["channels"] if not c["constant"]]
    assert speed["wrapper"]["deviation"] == pytest.approx(0.14 / np.sqrt(2) * np.pi / 30, rel=1e-2)
    assert main(["scales", str(tmp_path / "turbine.out"), "--skip", "0"]) == 0
    assert "scale 0.24 #" in capsys.readouterr().out  # with the start


def test_roles_name_channels_of_any_recording(tmp_path, capsys):
    write_out(tmp_path / "turbine.out", 2000)
    (tmp_path / "roles.toml").write_text(
        '[recording]\ntime = "Time"\n[[channel]]\nname = "speed"\ncolumn = "GenSpeed"\nunit = "rpm"\nrole = "output"\n'
    )
    words = ["scales", str(tmp_path / "turbine.out"), "--roles", str(tmp_path / "roles.toml")]
    assert main([*words, "--c"]) == 0
    assert '{"speed", "rpm", 7.55f, 0.099f},' in capsys.readouterr().out
    assert main(words) == 0
    assert "# speed: offset 7.55 scale 0.099 rpm; no channel of the wrapper" in capsys.readouterr().out


def test_what_cannot_be_told_is_said(tmp_path, capsys):
    write_out(tmp_path / "turbine.out", 2000)
    assert main(["scales", str(tmp_path / "turbine.out"), "--skip", "199"]) == 3
    assert "has 10 samples after 199 s; 20 are needed" in capsys.readouterr().err
    assert main(["scales", str(tmp_path / "turbine.out"), "--skip", "-1"]) == 2
    (tmp_path / "own.csv").write_text("time_s,a\n0,1\n1,2\n")
    assert main(["scales", str(tmp_path / "own.csv")]) == 2
    assert "give --roles" in capsys.readouterr().err
