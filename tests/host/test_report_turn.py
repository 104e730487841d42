"""What turns with the rotor is drawn over its angle, beside the effect where one of the rotor is named."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import report_examples
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.localise.turn import BINS, angles_deg, mean_over_turn, turning_errors
from aeolid.record import Channel
from aeolid.report import render_diagnosis
from aeolid.report.turn import turns_with_rotor, wave

STEP, OMEGA = 0.1, 1.267  # s, rad/s


def turning(samples: int, amplitude: float, at_deg: float, order: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return azimuth (N,) in degrees and a wave of it under noise (N,)."""
    azimuth = np.degrees(OMEGA * STEP * np.arange(samples)) % 360.0
    noise = np.random.default_rng(3).standard_normal(samples)
    return azimuth, amplitude * np.cos(order * np.radians(azimuth - at_deg)) + noise + 7.0


@settings(max_examples=30, deadline=None)
@given(st.floats(0.1, 50.0), st.floats(0.0, 359.0), st.sampled_from([1, 2, 3]))
def test_size_and_place_of_a_wave_are_read(amplitude: float, at: float, order: int) -> None:
    """Exactly: waves of 1 to 3 periods are orthogonal on 36 even places."""
    values = amplitude * np.cos(order * np.radians(angles_deg() - at)) + 0.3 * np.cos(5 * np.radians(angles_deg()))
    size, peak = wave(angles_deg().tolist(), values.tolist(), order)
    assert size == pytest.approx(amplitude, rel=1e-9)
    apart = (peak - at + 180.0 / order) % (360.0 / order) - 180.0 / order
    assert abs(apart) < 1e-6 and 0.0 <= peak < 360.0 / order + 1e-9


def test_the_mean_over_the_turn_holds_the_wave_and_little_noise() -> None:
    azimuth, y = turning(30_000, 0.5, 132.0)
    means = mean_over_turn(np.radians(azimuth), y[:, None])
    assert means is not None and means.shape == (BINS, 1) and abs(means.mean()) < 1e-12
    size, at = wave(angles_deg().tolist(), means[:, 0].tolist(), 1)
    # 30,000 samples of unit noise: amplitude to sqrt(2/N) = 0.008, phase to that over 0.5; four of them
    assert size == pytest.approx(0.5, abs=0.033) and at == pytest.approx(132.0, abs=4.0)


def test_rows_that_are_missing_do_not_count_and_a_rotor_that_stands_has_no_turn() -> None:
    azimuth, y = turning(4000, 2.0, 40.0)
    holes = y.copy()
    holes[::7] = np.nan
    kept = np.isfinite(holes)
    expected = mean_over_turn(np.radians(azimuth[kept]), y[kept][:, None])
    np.testing.assert_array_equal(mean_over_turn(np.radians(azimuth), holes[:, None]), expected)  # type: ignore[arg-type]
    assert mean_over_turn(np.zeros(500), y[:500, None]) is None
    assert mean_over_turn(np.radians(azimuth[:150]), y[:150, None]) is None  # some four rows a bin


CHANNELS = [Channel("pitch", "deg", "input"), Channel("azimuth", "deg", "azimuth"), Channel("y", "m", "output")]


def stretch(burn: int = 50, stride: int = 2) -> tuple[Segment, dict[str, dict[str, Any]], np.ndarray]:
    """Return a segment with an angle at twice the outputs' rate, its series, and the wave left over before."""
    count = 4000
    fine, _ = turning(count * stride, 0.0, 0.0)
    u = np.column_stack([np.ones(count * stride), fine])
    left = 0.4 * np.cos(np.radians(fine[::stride] - 70.0))
    y = np.random.default_rng(8).standard_normal(count)
    segment = Segment(u, y[:, None], STEP * stride, "a.csv", 100.0, burn, stride)
    time = 100.0 + STEP * stride * np.arange(burn, count)
    facts = {"time_s": time.tolist(), "measured": y[burn:].tolist(), "before": (y - left)[burn:].tolist(),
             "after": y[burn:].tolist(), "unit": "m"}  # fmt: skip
    return segment, {"y": facts}, left


def test_what_is_left_over_is_measured_less_predicted_at_the_angle_of_its_row() -> None:
    segment, series, _ = stretch()
    found = turning_errors([segment], ["pitch", "azimuth"], CHANNELS, series)["y"]
    size, at = wave(found["azimuth_deg"], found["before"], 1)
    # within a bin of 10 degrees a wave falls by sin(5°)/5° = 0.13 %; rows stand anywhere in their bin
    assert size == pytest.approx(0.4, rel=0.01) and at == pytest.approx(70.0, abs=1.0)
    assert np.abs(found["after"]).max() < 1e-12 and found["unit"] == "m"


def test_all_sealed_stretches_count_each_at_its_own_angles() -> None:
    """Two halves say what the whole says; a wave in the second alone is half as high over both."""
    segment, series, left = stretch(burn=50)
    half = 2000
    first = replace(segment, u=segment.u[: 2 * half], y=segment.y[:half])
    second = replace(segment, u=segment.u[2 * half :], y=segment.y[half:], start_s=100.0 + 2 * STEP * half, burn=0)
    names = ["pitch", "azimuth"]
    whole, both = (turning_errors(s, names, CHANNELS, series)["y"] for s in ([segment], [first, second]))
    np.testing.assert_array_equal(both["before"], whole["before"])
    facts = dict(series["y"])
    facts["before"] = (np.array(facts["before"]) + np.append(left[50:half], np.zeros(half))).tolist()
    found = turning_errors([first, second], names, CHANNELS, {"y": facts})["y"]
    assert wave(found["azimuth_deg"], found["before"], 1)[0] == pytest.approx(0.2, rel=0.05)
    assert turning_errors([first], names, CHANNELS, series) == {}


def test_without_an_angle_or_of_another_stretch_nothing_is_said() -> None:
    segment, series, _ = stretch()
    assert turning_errors([segment], ["pitch"], CHANNELS, series) == {}
    assert turning_errors([segment], ["pitch", "azimuth"], CHANNELS[:1], series) == {}
    other = {"y": series["y"] | {"time_s": [t + 50.0 for t in series["y"]["time_s"]]}}
    assert turning_errors([segment], ["pitch", "azimuth"], CHANNELS, other) == {}
    short = {"y": {k: v if k == "unit" else v[:-1] for k, v in series["y"].items()}}
    assert turning_errors([segment], ["pitch", "azimuth"], CHANNELS, short) == {}


def page(effect: dict[str, Any], evidence: dict[str, Any], folder: Path) -> str:
    diagnosis = report_examples.diagnosis()
    diagnosis["effects"] = [diagnosis["effects"][0] | effect]
    few = {"candidates": report_examples.candidates()}
    render_diagnosis(diagnosis, few | evidence, folder / "page.html")
    return (folder / "page.html").read_text(encoding="utf-8")


ROTOR = {"id": "mass_imbalance", "family": "rotor_1p"}


def test_an_effect_of_the_rotor_has_its_picture_beside_it_and_others_where_they_sit(tmp_path: Path) -> None:
    segment, series, _ = stretch()
    errors = {"turning_errors": turning_errors([segment], ["pitch", "azimuth"], CHANNELS, series)}
    parts = ("The effect</h2>", "Over the rotor", "What decided</h2>", "Where it sits</h2>")
    named, other = page(ROTOR, errors, tmp_path), page({}, errors, tmp_path)
    assert named.count("measured less predicted") == other.count("measured less predicted") == 1
    effect, picture, decided, _ = (named.index(p) for p in parts)
    assert effect < picture < decided and "Size and place of the waves" in named
    where = other.index(parts[3])
    assert other.index("measured less predicted") > where
    assert turns_with_rotor([{"location": {"azimuth_order": 3}}]) and not turns_with_rotor([{"family": "input_lag"}])


def test_a_pair_shows_its_two_sides_there_once_and_a_missing_angle_is_said(tmp_path: Path) -> None:
    """A recording with an angle is held against a simulation with one; without either there is a sentence."""
    named = page(ROTOR, {"turning": report_examples.sides()["turning"]}, tmp_path)
    assert named.count("gusts average out") == 1
    assert named.index("gusts average out") < named.index("What decided</h2>")
    assert "with the role azimuth is recorded" not in named
    row = re.search(r"<td class=.t.>1P</td>(.*?)</tr>", named)
    assert row is not None  # recorded cos ψ, simulated nothing: their difference is the recorded wave
    cells = re.findall(r"<td class=.n.>([^<]*)</td>", row[1])
    assert cells[:2] == cells[4:6] == ["1.00", "0"] and "difference" in named
    bare = page(ROTOR, {}, tmp_path)
    assert "no channel with the role azimuth is recorded" in bare
