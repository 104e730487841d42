"""Floquet modes from recordings to the command: identified, saved, analysed, drawn, and what is refused."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aeolid as ae
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.identify.lpv import identify_lpv
from aeolid.identify.rotor import rotation_by_parts
from aeolid.models.floquet import floquet_of
from aeolid.models.floquet_request import analyse
from aeolid.report.floquet_text import summary

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "studies"))
import floquet as study


@pytest.fixture(scope="module")
def identified():
    """Return the identification of one recording of the study's plant."""
    return identify_lpv([study.recording(study.plant(), 1200, 3)], past=3, order=4, varying=("A",))


@pytest.fixture(scope="module")
def model_file(identified, tmp_path_factory):
    path = tmp_path_factory.mktemp("floquet") / "model.json"
    path.write_text(json.dumps(identified.model_json()))
    return path


def test_a_periodic_plant_is_found_again_within_its_deviations(identified):
    """Frequency and damping of both modes by 1200 noisy samples; the study has the figures of many."""
    found = analyse(identified.model, identified.model_json()["identification"])
    true = floquet_of(study.plant(), study.HERTZ)
    assert found.rotor_hz == pytest.approx(study.HERTZ, rel=1e-6)
    assert len(found.modes) == 2
    for mode, real in zip(found.modes, true.modes, strict=True):
        # four deviations: one of four numbers beyond them by chance once in 4000 seeds
        assert abs(mode.frequency_hz - real.frequency_hz) < 4 * mode.frequency_std_hz < 0.02 * real.frequency_hz
        assert abs(mode.damping - real.damping) < 4 * mode.damping_std < 0.02
        largest = {h.order: h.participation["blade"] for h in real.harmonics if h.participation["blade"] > 0.1}
        ours = {h.order: h.participation["blade"] for h in mode.harmonics}
        for order, share in largest.items():
            assert ours[order] == pytest.approx(share, abs=0.1)


def test_the_command_says_what_the_interface_says(model_file, tmp_path, capsys):
    out = {key: tmp_path / f"f.{key}" for key in ("json", "html", "svg")}
    assert main(["floquet", str(model_file), "--json", str(out["json"]), "--report", str(out["html"]),
                 "--picture", str(out["svg"])]) == 0  # fmt: skip
    said = capsys.readouterr().out
    facts = json.loads(out["json"].read_text())
    assert "12.3 rpm" in said and "stable: a revolution" in said and "+1P" in said
    found = ae.load_model(model_file).floquet_modes()
    assert found.to_json() == facts and found.summary() in said
    assert repr(found) == "<FloquetModes: 2 modes at 12.3 rpm, stable>"
    frame = found.to_frame()
    assert set(frame["output"]) == {"tower", "blade"} and set(frame["mode"]) == {1, 2}
    assert frame.groupby(["mode", "output"])["participation"].sum().to_numpy() == pytest.approx(1, abs=1e-4)
    page = out["html"].read_text()
    assert "Harmonics" in page and "<svg" in page and out["svg"].read_bytes().startswith(b"<?xml")
    assert "FloquetModes" in found._repr_html_()


def test_another_speed_is_another_system(model_file, capsys):
    slow, fast = (ae.load_model(model_file).floquet_modes(speed) for speed in ("6rpm", 12.3))
    assert slow.result.rotor_hz == pytest.approx(0.1)
    assert abs(slow.modes[0].frequency_hz - fast.modes[0].frequency_hz) > 1e-4
    assert main(["floquet", str(model_file), "--rotor-speed", "6rpm", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["modes"] == slow.to_json()["modes"]


@pytest.mark.parametrize(("options", "said"), [
    (["--rotor-speed", "0"], "turns is needed"),
    (["--rotor-speed", "1e9rpm"], "rotor speed"),
    (["--rotor-speed", "500rpm"], "more than two"),
    (["--rotor-speed", "fast"], "no speed"),
    (["--harmonics", "-3"], "limits"),
    (["--harmonics", "99999999"], "limits"),
    (["--at", "wind"], "NAME=VALUE"),
    (["--at", "wind=strong"], "a number is needed"),
    (["--at", "wind=9"], "no scheduling channel"),
    (["--at", "azimuth_cos=1"], "no scheduling channel"),
    (["--multiple", "azimuth=-1"], "whole number"),
    (["--multiple", "azimuth=0"], "turns 1"),
    (["--multiple", "azimuth=2", "--multiple", "azimuth=2"], "given twice"),
    (["--picture", "f.bmp"], "is written as"),
])  # fmt: skip
def test_a_bad_call_is_told(model_file, capsys, options, said):
    assert main(["floquet", str(model_file), *options]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_models_that_are_not_periodic_are_refused(model_file, tmp_path, capsys):
    data = json.loads(model_file.read_text())
    plain = data | {k: data[k][0] for k in ("A", "B", "K")} | {"scheduling": None, "state_constant": None}
    wind = data | {"scheduling": {"channels": ["wind", "pitch"], "first_is_one": True}}
    for name, content, said in (("plain", plain, "no scheduled model"), ("wind", wind, "not periodic")):
        path = tmp_path / f"{name}.json"
        path.write_text(json.dumps(content))
        assert main(["floquet", str(path)]) == 2
        assert said in " ".join(capsys.readouterr().err.split())


def test_speeds_of_the_recording_that_vary_are_told_or_refused(identified):
    facts = identified.model_json()["identification"]
    for part, said in ((0.05, "deviation of 5 %"), (0.001, "")):
        facts["rotation"]["azimuth"]["deviation_hz"] = part * study.HERTZ
        notes = analyse(identified.model, facts).notes
        assert ("".join(notes) == "") if not said else said in notes[0]
    facts["rotation"]["azimuth"]["deviation_hz"] = 0.15 * study.HERTZ
    with pytest.raises(UsageError, match="too uneven"):
        analyse(identified.model, facts)
    assert analyse(identified.model, facts, rotor_speed="12rpm").modes
    with pytest.raises(UsageError, match="does not say"):
        analyse(identified.model, None)


def test_a_speed_that_is_given_goes_round_as_the_recorded_angle_does(identified):
    """Where that falls 12 rpm are -12: harmonics of the same model would be those of the other whirl."""
    facts = identified.model_json()["identification"]
    falling = {"rotation": {"azimuth": {"frequency_hz": -0.2, "deviation_hz": 0.0}}}
    found = [analyse(identified.model, facts | falling, rotor_speed=v) for v in ("12rpm", "-12rpm", None)]
    assert [f.rotor_hz for f in found] == pytest.approx([-0.2] * 3)
    assert [len(f.notes) for f in found] == [1, 0, 0] and "falls" in found[0].notes[0]
    assert all(", which falls, " in summary(f.to_json()) for f in found)
    rising = analyse(identified.model, facts, rotor_speed="12rpm")
    assert rising.rotor_hz == pytest.approx(0.2) and "falls" not in summary(rising.to_json())


@pytest.mark.parametrize("change", [
    {"rotation": {"azimuth": {"frequency_hz": "fast", "deviation_hz": 0}}},
    {"rotation": {"azimuth": {"frequency_hz": 0, "deviation_hz": 0}}},
    {"rotation": {"azimuth": [1, 2]}},
    {"A_covariance": {"lower": [1.0], "offset": [0, 0], "scale": [1, 1]}},
    {"A_covariance": 7},
    {"A_covariance": {"lower": ["x"] * 1176, "offset": [0, 0], "scale": [1, 1]}},
    {"A_covariance": {"lower": [1.0] * 1176, "offset": [0], "scale": [1, 1]}},
    {"A_covariance": {"lower": [1.0] * 1176, "offset": [0, 0], "scale": [1, 0]}},
])  # fmt: skip
def test_a_file_that_somebody_changed_is_refused(identified, change):
    with pytest.raises(DataError):
        analyse(identified.model, identified.model_json()["identification"] | change)


def test_a_channel_that_is_no_angle_stands_at_its_mean_or_where_it_is_put(identified):
    """With wind as a third channel A(wind, ψ) = A(ψ) + wind W: at wind w the modes are those of A(ψ) + w W."""
    model = identified.model
    wide = replace(
        model, scheduling=(*model.scheduling, replace(model.scheduling[0], name="wind")),
        **{k: np.concatenate([v, (0.01 if k == "A" else 0) * v[:1]]) for k in "ABCDK" for v in [getattr(model, k)]},
        b=np.concatenate([model.b, 0 * model.b[:1]]),
    )  # fmt: skip
    facts = {"operating_points": [{"scheduling": {"wind": 2.0, "azimuth_cos": 0.0}}]}
    moved = replace(model, A=np.concatenate([[1.03 * model.A[0]], model.A[1:]]))
    at_mean = replace(model, A=np.concatenate([[1.02 * model.A[0]], model.A[1:]]))
    for given, expected in (({"at": {"wind": 3.0}}, moved), ({}, at_mean)):
        found = analyse(wide, facts, rotor_speed=12, **given)
        truth = floquet_of(expected, 0.2)
        assert [m.frequency_hz for m in found.modes] == pytest.approx([m.frequency_hz for m in truth.modes])
    with pytest.raises(DataError, match="wind"):
        analyse(wide, {"operating_points": [{"scheduling": {"wind": "strong"}}]}, rotor_speed=12)


def test_the_sense_of_the_angle_is_kept():
    psi = 0.3 * np.arange(400.0)
    for sign in (1, -1):
        found = rotation_by_parts(np.cos(sign * psi), np.sin(sign * psi), 0.1)
        assert found.frequency_hz == pytest.approx(sign * 0.3 / 0.2 / np.pi) and found.deviation_hz < 1e-9
    assert rotation_by_parts(np.ones(50), np.zeros(50), 0.1) is None
