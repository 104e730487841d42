"""The answer and what decided it stand first, in words; what is open is listed; nothing shown is no number at all."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import report_examples
from test_report import Text, page_of

from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.experiments.experiment import Experiment
from aeolid.diagnose.hypotheses.entries.deadband import _zone
from aeolid.diagnose.validation.proof import _spectra
from aeolid.report import render_diagnosis
from aeolid.report.answer import answer, groups_of, sentence_of, share_of
from aeolid.report.charts import AFTER, BEFORE, GREY, INK, WIDE, label, sketch, titled
from aeolid.report.diagnosis import _not_excluded, diagnosis_parts
from aeolid.report.evidence import score_bank
from aeolid.report.markup import STYLE, Html, figure, folded, section, write_page
from aeolid.report.numbers import OPEN, quantity, with_std
from aeolid.report.pair import matched, sides
from aeolid.report.ranking import gain_of, label_of, ranking
from aeolid.report.where import _norm, _strength, maps
from aeolid.wording import place, spoken


def effect(identifier: str, weight: float, said: str, rivals: tuple[str, ...] = ()) -> dict[str, object]:
    listed = [{"id": r, "entry": "input:pitch", "weight": 0.1} for r in rivals]
    return {"id": identifier, "weight": weight, "statement": said, "location": {"entry": "input:pitch"},
            "rivals": listed, "parameters": {}}  # fmt: skip


def test_what_is_open_is_a_list_likeliest_first() -> None:
    first = effect("actuator_lag", 0.2, "pitch acts through a lag", ("transport_delay",))
    page = answer({"verdict": "ambiguous", "effects": [first, effect("transport_delay", 0.8, "pitch acts late")],
                   "statement": "a — or: b"})  # fmt: skip
    assert "— or" not in page and "2 are open" in page
    assert page.index("Pitch acts late (80 % of the evidence)") < page.index("Pitch acts through a lag")


def test_of_effects_that_act_together_each_has_its_alternatives() -> None:
    first, second = (
        effect("actuator_lag", 1.0, "a lag", ("transport_delay",)),
        effect("sensor_lag", 1.0, "a slow sensor"),
    )
    third = effect("transport_delay", 0.5, "a delay")
    assert groups_of([first, second, third]) == [[first, third], [second]]  # type: ignore[list-item]
    page = answer({"verdict": "ambiguous", "effects": [first, second, third]})
    assert "Together:" in page and "one of" in page and page.index("A delay") < page.index("A slow sensor")


def test_shares_of_the_evidence_are_no_powers_of_ten() -> None:
    assert share_of({"weight": 1.9e-22}) == "below 0.1 %" and share_of({"weight": 0.9994}) == "99.9 %"
    assert share_of({"weight": 0.25}) == "25 %" and share_of({}) == "–"


@pytest.mark.parametrize(("value", "told"), [(1.7e63, OPEN), (None, OPEN), (float("inf"), OPEN), (0.07, "0.0700")])
def test_a_value_that_ran_away_is_said_to_be_open_and_a_ratio_has_no_unit(value: float | None, told: str) -> None:
    assert quantity({"value": value, "std": None, "unit": "1"}) == told
    page = score_bank(
        [{"id": "backlash", "entry": "input:pitch", "statistic": 3.0, "estimate": value, "unit": "1"}], set()
    )
    assert "10⁶³" not in page


def test_the_ranking_shows_gains_of_fits_and_marks_what_is_named() -> None:
    page = ranking(report_examples.candidates(), {("actuator_lag", "input:pitch")})
    labels = [t for t in re.findall(r"<text[^>]*>([^<]+)</text>", page) if "at the input pitch" in t]
    assert labels == [  # as drawn: from the best
        "second-order actuator, at the input pitch (not accepted)", "first-order actuator lag, at the input pitch",
        "transport delay, at the input pitch",
    ]  # fmt: skip
    assert page.count(f"fill: var(--after, {AFTER})") == 1 and page.count(f"fill: var(--grey, {GREY})") == 2
    assert "ran to the end of its physical range" in page and "<details>" in page and "251" in page


def test_gains_of_older_files_and_of_runs_are_read() -> None:
    assert gain_of({"fit_gain": 3.0, "select_gain": -1.0}) == 2.0 and gain_of({"nats": 7.0}) == 7.0
    assert gain_of({"score": 5.0, "fit_gain": 9.0}) == 5.0
    assert label_of("actuator_lag input:pitch + sensor_bias output:y") == (
        "first-order actuator lag, at the input pitch and biased sensor, at the sensor of y"
    )


def test_places_are_words_wherever_they_stand() -> None:
    assert spoken("dry friction at state:v opposes") == "dry friction in the equation of v opposes"
    assert spoken("a force at motion:stretch that swings") == "a force in the motion stretch that swings"
    assert spoken("nothing: else, 12:30 o'clock") == "nothing: else, 12:30 o'clock"
    assert place("recording") == "in the recording" and place("") == ""


def test_both_sides_have_their_modes_in_one_table() -> None:
    recorded, simulated = (report_examples.sides()["modes"][k] for k in ("recorded", "simulated"))
    pairs = matched(recorded, simulated)
    assert [(a is not None, b is not None) for a, b in pairs] == [(True, True), (True, False)]
    other = report_examples.mode(0.33, "generator_speed")  # near in frequency, moves another output
    assert (None, other) in matched(recorded, [other])
    page = sides(report_examples.sides())
    for part in ("drive train", "not simulated", "frequency lower in the recording", "rotor azimuth (deg)",
                 "pitch → tower_fore_aft", "gain (m/s / deg)"):  # fmt: skip
        assert part in page, part
    assert sides({}) == ""


def test_a_pole_of_the_noise_does_not_take_a_modes_partner() -> None:
    """The best known mode chooses first, and what is no mode on either side has no row."""

    def row(hertz: float, width: float | None) -> dict[str, Any]:
        return report_examples.mode(hertz, "tower_fore_aft") | {"width": width}

    noise, tower, run, loose = row(0.337, 3.0), row(0.399, 0.5), row(0.391, 3.0), row(1.0, None)
    assert matched([noise, tower, loose], [run]) == [(tower, run)]
    assert matched([tower], [row(0.7, 1.0)]) == [(tower, None), (None, row(0.7, 1.0))]


def test_a_map_without_a_finding_is_pale() -> None:
    """Colours are scaled to the limit of chance, not to the largest value: noise looks like noise."""
    scale = _norm(2.0, None)
    assert abs(scale(0.9) - 0.5) < 0.125 and abs(scale(1.9) - 0.5) > 0.4 and scale(0.0) == 0.5
    assert _strength((0, 1, 0, -20.0, {"statistic": 1.0, "threshold": 4.0})) == -0.25
    assert _strength((0, 1, 0, 0.1, {"statistic": 9.0, "threshold": 3.0})) == 3.0
    cells = [
        {"output": "y", "frequency_hz": [0.1 * 2**k, 0.2 * 2**k], "ratio": 9.0, "statistic": 0.5 * k, "threshold": 4.0,
         "significant": False} for k in range(4)
    ]  # fmt: skip
    drawn = re.findall(r"fill: #([0-9a-f]{6}); stroke: #[0-9a-f]{6}", maps({"bands": cells}))
    assert drawn and all(min(int(c[i : i + 2], 16) for i in (0, 2, 4)) > 0xB0 for c in drawn)


def test_the_restart_of_predictions_is_not_in_the_error_spectrum() -> None:
    """Errors that grow along a line until each restart have no power but the line's, which is taken off."""
    horizon, n, rng = 40, 4000, np.random.default_rng(1)
    noise = 1e-3 * rng.standard_normal((n, 1))
    teeth = (np.arange(n) % horizon)[:, None] / horizon
    segment = _segment(noise + teeth)
    spectra = _spectra([segment], [[np.zeros((n, 1))], [teeth]], ["y"], horizon)["y"]
    np.testing.assert_allclose(spectra["before"], spectra["after"], rtol=1e-6)
    level = 2 * 1e-6 * 0.1  # one-sided density of the noise
    assert np.mean(spectra["after"][2:-1]) == pytest.approx(level, rel=0.2)


def _segment(y: np.ndarray) -> Segment:
    from types import SimpleNamespace

    return SimpleNamespace(y=y, burn=0, step=0.1)  # type: ignore[return-value]


def test_a_page_lists_its_parts_folds_and_enlarges(tmp_path: Path) -> None:
    diagnosis, evidence = report_examples.diagnosis(), report_examples.evidence()
    page = page_of(lambda p: render_diagnosis(diagnosis, evidence, p), tmp_path)
    links = re.findall(r'<li><a href="#(part\d+)">([^<]+)</a>', page)
    assert links == re.findall(r'<h2 id="(part\d+)">([^<]+)</h2>', page) and len(links) > 6
    assert page.index("verdict") < page.index("<nav") < page.index("What to record next</h2>")
    assert page.count("<details>") > 4 and page.count('class="zoom"') == page.count('class="wide"') > 4
    few = page_of(lambda p: write_page(p, "t", section("one", "x"), section("two", "y")), tmp_path)
    assert "<nav" not in few and folded("more", "") == ""


def test_drawings_take_the_colours_of_the_page() -> None:
    with sketch(WIDE) as drawing:
        for colour in (INK, BEFORE, AFTER):
            drawing.axes[0, 0].plot([0, 1], color=colour)
        drawing.axes[0, 0].set_xlabel("x")
    for colour, name in ((INK, "ink"), (BEFORE, "before"), (AFTER, "after")):
        assert f"stroke: var(--{name}, {colour})" in drawing.svg and f"--{name}:" in STYLE
    assert f": {INK}" not in drawing.svg and "#ffffff" not in drawing.svg  # no white paper under it
    assert "prefers-color-scheme: dark" in STYLE and figure(Html("<svg></svg>"), "c").count("zoom") == 0


def test_texts_of_the_page_hold_no_ids_where_words_are(tmp_path: Path) -> None:
    diagnosis = report_examples.diagnosis()
    diagnosis["next_experiment"]["text"] = "To decide between parameter_error and actuator_lag: move state:v"
    seen = Text(page_of(lambda p: render_diagnosis(diagnosis, {}, p), tmp_path)).seen
    assert "between wrong value of a declared parameter and first-order actuator lag: move in the equation of v" in seen


def test_a_value_that_says_nothing_is_no_number_with_a_spread() -> None:
    assert with_std(13.6, 14000.0) == f"13.6 ({OPEN})" and with_std(0.4, 1.0) == "0.400 ± 1.0"
    assert label("acceleration", "1") == "acceleration" and label("speed", "rpm") == "speed (rpm)"
    assert sentence_of("pulse_force is wrong") == "pulse_force is wrong." and sentence_of("h1 spills").startswith("h1")
    twice = [effect("overflow", 1.0, "a"), effect("overflow", 1.0, "b")]
    assert answer({"verdict": "multiple", "effects": twice, "statement": "a; and b"}).count("overflow") == 1  # type: ignore[arg-type]


def test_each_effect_that_is_not_excluded_is_listed_once_by_its_name() -> None:
    """Forms of one effect have a range; one that is tested elsewhere is silent with its place."""

    def least(value: float | None, symbol: str, unit: str = "s") -> dict[str, object]:
        return {"value": value, "unit": unit, "parameter": symbol}

    entries: list[dict[str, object]] = [
        {"id": "sensor_lag", "entry": "output:speed", "minimum_detectable": least(1.3, "tau_s")},
        {"id": "sensor_lag", "entry": "output:speed", "minimum_detectable": least(5.0, "tau_s")},
        {"id": "sensor_lag", "entry": "output:tower", "minimum_detectable": None},
        {"id": "sensor_scale", "entry": "output:speed", "minimum_detectable": None},
        {"id": "sensor_scale", "entry": "output:speed", "minimum_detectable": None},
        {"id": "input_saturation", "entry": "input:pitch", "minimum_detectable": least(-5.0, "low", "deg")},
        {"id": "input_saturation", "entry": "input:pitch", "minimum_detectable": least(77.0, "high", "deg")},
    ]
    page = _not_excluded(entries)
    assert "2 effects may be present" in page and page.count('<tr class="row">') == 2
    assert "time constant 1.3 s to 5.0 s, by its form" in page and "lowest value −5.0 deg; highest value 77 deg" in page
    assert page.count(">sensor_lag<") == 1 and page.count("wrong scale or unit of a channel") == 1
    assert "first-order sensor lag, at the sensor of tower" in page and "sensor_scale" not in page


def test_values_say_what_their_deviations_allow() -> None:
    facts = report_examples.diagnosis()
    assert "size for its form" in diagnosis_parts(facts, {})
    assert "size for its form" not in diagnosis_parts(facts | {"run": {}}, {})


def test_the_next_experiment_says_its_time_and_what_it_parts_once() -> None:
    said = "To decide between first-order actuator lag and transport delay: add steps for 1 min"
    entry = {"text": said, "minutes": 1.0, "separates": ["actuator_lag", "transport_delay"]}
    page = diagnosis_parts({"verdict": "ambiguous", "next_experiment": entry}, {})
    assert "1.00 min" not in page and "It tells apart" not in page


def test_reasons_and_units_are_in_words() -> None:
    why = "damping of actuator_second_order input:pitch is at its end"
    page = ranking(
        [{"key": "actuator_second_order input:pitch", "score": 3.0, "plausible": False, "reason": why}], set()
    )
    assert "damping of second-order actuator at the input pitch is at its end" in page
    assert Experiment("throttle", "1", 0.4, "prbs", 0.1).says().startswith("add pseudo-random steps of ±0.4 with")
    assert _zone("throttle", "", {"width": 0.139}) == "throttle has no effect within ±0.139 of zero (a dead zone)"


def test_a_long_title_is_written_on_several_lines() -> None:
    with sketch((8.0, 3.0), 1, 2) as drawing:
        titled(drawing.axes[0, 0], "generator_speed_of_the_high_speed_shaft → tower_top_acceleration_fore_aft")
        lines = drawing.axes[0, 0].get_title(loc="left").splitlines()
    assert len(lines) > 1 and max(map(len, lines)) < 45
