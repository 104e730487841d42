"""The pages say what the facts say, escape every text, and need nothing but themselves."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import report_examples
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.errors import UsageError
from aeolid.report import identification_facts, render_demo, render_diagnosis, render_identification
from aeolid.report.answer import verdict_sentence
from aeolid.report.bode import _deviation, _phase, _shade
from aeolid.report.charts import AFTER, GREY, decade, sketch, smooth_spectrum, thin
from aeolid.report.evidence import score_bank
from aeolid.report.identification import _singular_values
from aeolid.report.markup import Html, tag, write_page
from aeolid.report.numbers import number, with_std
from aeolid.report.response import response

SINGLE = ["no_mismatch", "immaterial", "data_fault", "parameter", "named"]
VERDICTS = [*SINGLE, "ambiguous", "multiple", "unnamed", "not_testable"]


class Text(HTMLParser):
    """Collect what a reader sees outside the drawings, and check that every element is closed."""

    VOID = frozenset({"meta", "br", "input", "path", "use", "rect", "image"})

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen = ""
        self.feed(page)

    def handle_starttag(self, name: str, attributes: Any) -> None:
        if name not in self.VOID:
            self.open.append(name)

    def handle_endtag(self, name: str) -> None:
        if name not in self.VOID:
            assert self.open.pop() == name

    def handle_data(self, data: str) -> None:
        if not {"style", "svg"} & set(self.open):
            self.seen += data


def page_of(render: Callable[[Path], None], folder: Path) -> str:
    path = folder / "page.html"
    render(path)
    page = path.read_text(encoding="utf-8")
    assert not Text(page).open
    return page


def test_identification_page_says_the_facts(tmp_path: Path) -> None:
    seen = Text(page_of(lambda p: render_identification(report_examples.identification(), p), tmp_path)).seen
    for part in ("5 MW turbine <prototype>", "0.32130 ± 0.00080", "1.960 ± 0.070", "tower fore-aft", "+0.41 %",
                 "The largest gap among the singular values is after 4", "95.1", "4.83 %"):  # fmt: skip
        assert part in seen, part


def test_bands_of_the_frequency_response_are_drawn_where_they_are_known(tmp_path: Path) -> None:
    """Grey areas beside the lines, one for gain and one for phase a pair; an unknown phase leaves its own out."""
    facts = report_examples.identification()
    grid = np.geomspace(0.005, 4.9, 60)
    g = response(facts["model"], grid)
    pairs = [
        {"input": source, "output": target, "gain": abs(g[:, i, j]).tolist(),
         "gain_std": (0.1 * abs(g[:, i, j])).tolist(), "phase_deg": np.degrees(np.angle(g[:, i, j])).tolist(),
         "phase_std_deg": [5.7 if known else None] * 60}
        for i, target in enumerate(("generator_speed", "tower_fore_aft"))
        for j, (source, known) in enumerate((("pitch", True), ("torque", False)))
    ]  # fmt: skip
    plain = page_of(lambda p: render_identification(facts, p), tmp_path)
    facts["frequency_response"] = {"frequency_hz": grid.tolist(), "pairs": pairs}
    page = page_of(lambda p: render_identification(facts, p), tmp_path)
    assert "Grey: 95 % at each frequency" in Text(page).seen and "Grey" not in Text(plain).seen
    shades = len(re.findall("opacity: 0.45", page)) - len(re.findall("opacity: 0.45", plain))
    assert shades >= 2 * (2 + 1)  # two outputs: gain and phase from the pitch, gain alone from the torque


def test_a_band_is_two_deviations_wide_and_reaches_down_where_the_phase_is_unknown() -> None:
    grid, g = np.array([0.1, 1.0, 2.0]), np.array([2.0, 2j, -2.0])
    bands = {"frequency_hz": [0.1, 1.0, 2.0],
             "pairs": [{"input": "u", "output": "y", "gain": [2.0] * 3, "gain_std": [0.2, 0.4, 0.5],
                        "phase_deg": [0.0, 90.0, 180.0], "phase_std_deg": [5.0, 10.0, None]}]}  # fmt: skip
    with sketch((4.0, 3.0), 2, 1) as drawing:
        gain, phase = drawing.axes[:, 0]
        gain.set_ylim(0.5, 9.0)
        _shade(gain, phase, grid, g, *_deviation(bands, "u", "y", grid))
        corners = gain.collections[0].get_paths()[0].vertices
        assert gain.get_ylim()[0] == 0.5
        for f, low, high in ((0.1, 2 - 0.392, 2.392), (1.0, 2 - 0.784, 2.784), (2.0, 0.5, 2.98)):
            there = corners[np.isclose(corners[:, 0], f), 1]
            assert there.min() == pytest.approx(low) and there.max() == pytest.approx(high)
        corners = phase.collections[0].get_paths()[0].vertices
        assert corners[:, 0].max() == 1.0 and corners[:, 1].max() == pytest.approx(90 + 19.6)
    assert _deviation(bands, "v", "y", grid) == (None, None) and _deviation(None, "u", "y", grid) == (None, None)


def test_phases_are_drawn_on_the_same_turn() -> None:
    """One begins a degree below the cut of the angle and one above: they lie two degrees apart, not 358."""
    lag = np.linspace(0.0, 400.0, 50)
    g, reference = (np.exp(1j * np.radians(start - lag)) for start in (-179.0, 179.0))
    phase = _phase(g, reference, abs(g))
    np.testing.assert_allclose(phase, 181.0 - lag, atol=1e-9)
    np.testing.assert_allclose(_phase(reference, reference, abs(g)), 179.0 - lag, atol=1e-9)
    assert np.isnan(_phase(g, reference, np.full(50, np.nan))).all()


def test_as_many_singular_values_are_kept_as_the_order_says() -> None:
    drawn = str(_singular_values({"singular_values": [10, 5, 3, 2, 0.1, 0.05, 0.04], "order": 4}))
    places = [len(re.findall(rf"<use[^>]*{colour}", drawn)) for colour in (AFTER, GREY)]
    assert places == [4 + 1, 3 + 1]  # and one each in the legend


def test_diagnosis_page_starts_with_the_verdict(tmp_path: Path) -> None:
    diagnosis, evidence = report_examples.diagnosis(), report_examples.evidence()
    seen = Text(page_of(lambda p: render_diagnosis(diagnosis, evidence, p), tmp_path)).seen
    order = ["Verdict: Named · first-order actuator lag", diagnosis["effects"][0]["statement"],
             "In ROSCO: set PA_Mode = 1", "What to record next", "Pitch PRBS of 0.5 deg", "Before and after", "41.2 %",
             "4.30 %", "0.312 ± 0.021", "What decided", "transport delay, at the input pitch", "Where it sits",
             "Score test of every effect", "0.12 1/m²", "20 recordings generated", "as declared",
             "−37\u202f100 ± 310"]  # fmt: skip
    place = 0
    for part in order:  # each one after the one before it
        place = seen.index(part, place)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_has_a_sentence(verdict: str, tmp_path: Path) -> None:
    diagnosis = {"schema": 1, "verdict": verdict, "effects": []}
    sentence = verdict_sentence(diagnosis)
    assert len(sentence) > 20 and sentence.endswith(".")
    assert sentence in Text(page_of(lambda p: render_diagnosis(diagnosis, {}, p), tmp_path)).seen


def test_what_is_named_is_shown_among_the_effects_tried_however_softly_it_speaks() -> None:
    loud = [{"id": "backlash", "entry": f"output:y{i}", "statistic": 9.0, "threshold": 4.4} for i in range(40)]
    named = {"id": "actuator_lag", "entry": "input:pitch", "statistic": 2.98, "threshold": 4.4}
    assert "first-order actuator lag" in score_bank([*loud, named], {("actuator_lag", "input:pitch")})
    assert "first-order actuator lag" not in score_bank([*loud, named], set())


@pytest.mark.parametrize("key", ["none", *report_examples.evidence()])
def test_every_part_of_the_evidence_stands_alone(key: str, tmp_path: Path) -> None:
    evidence = {k: v for k, v in report_examples.evidence().items() if k == key}
    page_of(lambda p: render_diagnosis(report_examples.diagnosis(), evidence, p), tmp_path)


@pytest.mark.parametrize("key", ["none", *report_examples.identification()])
def test_every_fact_stands_alone(key: str, tmp_path: Path) -> None:
    facts = {k: v for k, v in report_examples.identification().items() if k == key}
    page_of(lambda p: render_demo(facts, {}, {}, p), tmp_path)


@settings(max_examples=40, deadline=None)
@given(st.text(min_size=1, max_size=60))
def test_no_text_becomes_markup(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    folder = tmp_path_factory.mktemp("page")
    page = page_of(lambda p: write_page(p, text, tag("p", text, title=text)), folder)
    plain = page_of(lambda p: write_page(p, "t", tag("p", "t", title="t")), folder)
    assert page.count("<") == plain.count("<")
    assert page.count('"') == plain.count('"')
    assert isinstance(tag("p", Html("<b>")), Html) and "<b>" in tag("p", Html("<b>"))


def test_pages_refer_to_nothing_outside(tmp_path: Path) -> None:
    examples = report_examples.identification(), report_examples.diagnosis(), report_examples.evidence()
    page = page_of(lambda p: render_demo(*examples, p), tmp_path)
    assert not re.search(r"<(link|iframe|object|embed|base)\b", page) and not re.search(r"<script[^>]", page)
    assert not re.search(r"(?:src|href)\s*=\s*[\"'](?!#|data:)", page.replace('xlink:href="#', 'href="#'))
    assert not re.search(r"@import|url\((?!#)", page)
    assert "Content-Security-Policy" in page
    assert len(page) < 1_000_000


def test_a_page_is_the_same_every_time(tmp_path: Path) -> None:
    pages = {page_of(lambda p: render_identification(report_examples.identification(), p), tmp_path) for _ in range(2)}
    assert len(pages) == 1


def test_a_folder_that_is_not_there_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        write_page(tmp_path / "no" / "page.html", "t")


@settings(max_examples=200, deadline=None)
@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12))
def test_numbers_keep_three_digits(value: float) -> None:
    text = number(value).replace("−", "-").replace("\u202f", "")
    mantissa, _, power = text.partition("·10")
    exponent = power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or "0"
    assert float(mantissa) * 10.0 ** int(exponent) == pytest.approx(value, rel=0.0051, abs=1e-320)
    assert len(text) <= 12


def test_numbers_are_cut_where_the_uncertainty_begins() -> None:
    assert with_std(0.312345, 0.0212) == "0.312 ± 0.021"
    assert with_std(20431.0, 1300.0) == "20\u202f400 ± 1300"
    assert with_std(-3.0, None) == "−3.00"
    assert with_std(0.4371, 1.0066, 4) == "0.4371 ± 1.0"
    assert number(float("nan")) == "–" and number(None) == "–" and number(12) == "12"


def test_frequency_response_agrees_with_scipy() -> None:
    from scipy import signal

    model = report_examples.model()
    frequency = np.array([0.01, 0.3, 2.0])
    system = [np.array(model[k]) for k in "ABCD"]
    for column in range(2):
        numerator, denominator = signal.ss2tf(*system, input=column)
        for row in range(2):
            _, expected = signal.freqz(numerator[row], denominator, worN=2 * np.pi * frequency * 0.1)
            np.testing.assert_allclose(response(model, frequency)[:, row, column], expected, rtol=1e-9)


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 20_000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_extremes(length: int, seed: int) -> None:
    y = np.random.default_rng(seed).standard_normal(length)
    x, kept = thin(np.arange(length), y)
    assert len(kept) <= 1500 and kept.min() == y.min() and kept.max() == y.max()
    assert np.all(np.diff(x) > 0)


def test_smoothing_a_spectrum_keeps_its_level() -> None:
    frequency = np.linspace(0.0, 5.0, 2001)
    centre, level = smooth_spectrum(frequency.tolist(), np.full(2001, 3.0).tolist())
    np.testing.assert_allclose(level, 3.0)
    assert np.all(np.diff(centre) > 0) and centre[0] > 0 and centre[-1] <= 5.0
    peak = smooth_spectrum(frequency, np.exp(-(((frequency - 0.44) / 0.02) ** 2)))
    assert peak[0][np.argmax(peak[1])] == pytest.approx(0.44, rel=2 ** (1 / 12) - 1)


@pytest.mark.parametrize(
    ("ends", "labels"),
    [((0.02, 30.0), {"0.1", "1", "10"}), ((2e-7, 0.3), {"10⁻⁶", "10⁻⁴", "10⁻²"}), ((0.21, 0.47), {"0.3", "0.4"})],
)
def test_logarithmic_axes_are_labelled_in_plain_text(ends: tuple[float, float], labels: set[str]) -> None:
    with sketch((5.0, 3.0)) as drawing:
        drawing.axes[0, 0].loglog([1.0, 2.0], ends)
    texts = set(re.findall(r"<text[^>]*>([^<]+)</text>", drawing.svg))
    assert labels <= texts and not any("$" in t or "e-" in t for t in texts)


def test_a_power_of_ten_has_its_factor() -> None:
    assert [decade(x, plain=False) for x in (1e-7, 2e5, 1.0, 0.05)] == ["10⁻⁷", "2·10⁵", "10⁰", "5·10⁻²"]


def chromium_messages(page: Path, tmp_path: Path) -> list[str]:
    """Open a page in headless Chromium and return what it says on the console."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("chromium is not installed")
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0",
               "--disable-background-networking", f"--user-data-dir={tmp_path / 'profile'}",
               f"--screenshot={tmp_path / 'page.png'}", "--window-size=1200,4000", f"file://{page}"]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=3600, check=True)
    return [line for line in done.stderr.splitlines() if "CONSOLE" in line]


@pytest.mark.slow
def test_pages_render_in_a_browser_without_complaint(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    render_demo(report_examples.identification(), report_examples.diagnosis(), report_examples.evidence(), page)
    assert chromium_messages(page, tmp_path) == []
    from matplotlib.image import imread

    picture = imread(tmp_path / "page.png")
    assert picture.shape[:2] == (4000, 1200)
    assert np.mean(picture[..., :3] < 0.5) > 0.005  # there is ink on it


def test_a_page_that_reaches_for_the_network_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    write_page(page, "t", Html('<img src="http://127.0.0.1:9/x.png">'))
    assert any("Content Security Policy" in line for line in chromium_messages(page, tmp_path))


def test_facts_come_from_a_model_file(tmp_path: Path) -> None:
    """A model.json as `identify` writes it, its true system, and nothing else make the whole page."""
    from aeolid.identify.varx import identify_varx
    from aeolid.plants import hawt

    record = hawt.simulate_closed_loop(1500, 3, excitation=hawt.Excitation(noise=0.1))
    model = identify_varx([record], past=15, order=7).model_json()
    true = hawt.build_turbine().model().to_json()
    facts = identification_facts(model, true_model=true, true_names={0: "rotor speed"}, title="Turbine")
    seen = Text(page_of(lambda p: render_identification(facts, p), tmp_path)).seen
    for part in ("Turbine", "Order", "Poles", "rotor speed", "VAF (%), one step", "order 7", "varx", "1500 samples"):
        assert part in seen, part
    assert len(facts["true_eigenvalues"]) == 7
