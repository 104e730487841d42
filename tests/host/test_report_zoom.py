"""Lines over time can be looked into: what the page holds of them, the one script it may run, and what that does."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import sys
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import report_examples
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.record import Channel, Record
from aeolid.report import render_diagnosis, render_identification
from aeolid.report.markup import Html, write_page
from aeolid.report.recordings import render_recordings
from aeolid.report.zoom import MOST_ALONE, MOST_SAMPLES, Line, Panel, zoomed

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "sil"))
from monitor_browser import Browser

STILL = Html('<svg class="wide"><path d="M0 0"/></svg>')
_LINES = re.compile(r'data-lines="([^"]*)"')


def facts_of(markup: str) -> dict[str, Any]:
    found = _LINES.search(markup)
    assert found is not None
    read: dict[str, Any] = json.loads(unescape(found[1]))
    return read


def decoded(line: dict[str, Any]) -> np.ndarray:
    """Return samples as the script reads them."""
    codes = np.frombuffer(base64.b64decode(line["data"]), dtype="<u2")
    return np.where(codes == 65535, np.nan, line["low"] + line["step"] * codes)


def one(values: list[float] | np.ndarray, time: np.ndarray | None = None, most: int = 10_000) -> dict[str, Any]:
    y = np.asarray(values, dtype=float)
    t = 0.1 * np.arange(len(y)) if time is None else time
    line = Line("a", "ink", y)
    return facts_of(zoomed(STILL, "c", t, [Panel("a", (line,))], (0, len(y)), most))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1e12, 1e12) | st.just(float("nan")), min_size=4, max_size=60))
def test_samples_are_kept_to_16_bits_of_their_range(values: list[float]) -> None:
    (line,) = one(values)["panels"][0]["lines"]
    y = np.array(values)
    known = y[np.isfinite(y)]
    range_ = float(np.ptp(known)) if known.size else 0.0
    scale = float(np.max(np.abs(known))) if known.size else 0.0
    # half a step of the code, and the rounding of a sum of numbers of that size
    np.testing.assert_allclose(decoded(line), y, rtol=0, atol=0.5001 * range_ / 65534 + 4e-16 * scale)


def test_a_range_beyond_all_numbers_is_no_line() -> None:
    (line,) = one([-1.7e308, 1.7e308, 0.0, 1.0])["panels"][0]["lines"]
    assert np.isnan(decoded(line)).all()


def test_an_even_clock_is_three_numbers_and_another_is_kept_as_it_is() -> None:
    even = 480.0 + 0.05 * np.arange(500)
    assert one(np.zeros(500), np.round(even, 3))["clock"] == pytest.approx({"start": 480.0, "step": 0.05, "count": 500})
    gap = np.concatenate([even[:200], even[300:]])
    clock = one(np.zeros(400), gap)["clock"]
    np.testing.assert_array_equal(np.frombuffer(base64.b64decode(clock["data"]), dtype="<f8"), gap)


@pytest.mark.parametrize(("view", "first"), [((0, 100), 0), ((5000, 5400), 4700), ((9900, 10_000), 9000)])
def test_of_long_lines_what_surrounds_the_view_is_kept(view: tuple[int, int], first: int) -> None:
    y = np.arange(10_000.0)
    panel = Panel("a", (Line("a", "ink", y),))
    facts = facts_of(zoomed(STILL, "c", y, [panel], view, 1000))
    assert facts["clock"]["count"] == 1000 and facts["clock"]["start"] == first
    assert facts["view"] == [view[0], view[1] - 1]


def test_three_samples_stay_a_picture() -> None:
    assert "data-lines" not in zoomed(STILL, "c", np.arange(3.0), [], (0, 3), 1000)


def long_diagnosis(samples: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return a diagnosis of six outputs with so many sealed samples."""
    rng = np.random.default_rng(5)
    time = (0.05 * np.arange(samples)).tolist()
    series = {
        f"y{j}": {"time_s": time, "unit": "m", **{k: rng.standard_normal(samples).tolist() for k in
                                                  ("measured", "before", "after")}}
        for j in range(6)
    }  # fmt: skip
    return report_examples.diagnosis(), report_examples.evidence() | {"series": series, "spectra": {}}


def test_an_hour_of_six_outputs_stays_a_page_that_can_be_sent(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    render_diagnosis(*long_diagnosis(72_000), path)
    assert 1.0e6 < path.stat().st_size < 3.0e6
    held = [facts_of(m[0]) for m in _LINES.finditer(path.read_text())]
    assert len(held) == 6 and sum(f["clock"]["count"] * 5 for f in held) <= MOST_SAMPLES


def test_a_page_may_run_this_one_script_and_only_where_it_needs_it(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    render_diagnosis(report_examples.diagnosis(), report_examples.evidence(), path)
    page = path.read_text(encoding="utf-8")
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.S)
    (policy,) = re.findall(r'Security-Policy" content="([^"]*)"', page)
    own = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy.endswith(f"; script-src 'sha256-{own}'") and "unsafe-inline' script" not in policy
    assert page.count("<script") == 1 and not re.search(r"https?://(?!www\.w3\.org)", script)
    render_identification(report_examples.identification(), path)
    assert "script" not in path.read_text(encoding="utf-8")


@settings(max_examples=30, deadline=None)
@given(st.text(min_size=1, max_size=40))
def test_no_name_of_a_line_becomes_markup(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("page") / "page.html"
    panel = Panel(text, (Line(text, "ink", np.arange(9.0)),))
    write_page(path, "t", zoomed(STILL, "c", np.arange(9.0), [panel], (0, 9), 100))
    page = path.read_text(encoding="utf-8")
    plain = tmp_path_factory.mktemp("page") / "page.html"
    simple = Panel("t", (Line("t", "ink", np.arange(9.0)),))
    write_page(plain, "t", zoomed(STILL, "c", np.arange(9.0), [simple], (0, 9), 100))
    assert page.count("<") == plain.read_text(encoding="utf-8").count("<")
    facts_of(page)


def recording(samples: int, step: float = 0.05, first: float = 100.0) -> Record:
    channels = (Channel("pitch", "deg", "input"), Channel("speed", "rpm", "output"))
    values = np.arange(2.0 * samples).reshape(2, samples).T
    return Record(first + step * np.arange(samples), values, channels, step, "a.csv", "")


def drawn_of(path: Path, records: list[Record], run: Record | None) -> list[dict[str, Any]]:
    render_recordings("t", records, run, [], [], path)
    page = path.read_text(encoding="utf-8")
    panels: list[dict[str, Any]] = facts_of(page)["panels"] if "data-lines" in page else []
    return panels


def test_recordings_and_the_run_share_one_clock(tmp_path: Path) -> None:
    """The run is shorter and has half the rate: each of its samples stands at the times nearest to it, then nothing."""
    run = recording(20, 0.1, 0.0)
    pitch, speed = drawn_of(tmp_path / "a.html", [recording(50)], run)
    assert [(li["name"], li["kind"]) for li in pitch["lines"]] == [("recording", "after"), ("baseline run", "before")]
    own, other = (decoded(li) for li in speed["lines"])
    np.testing.assert_allclose(own, 50.0 + np.arange(50), atol=1e-3)
    np.testing.assert_allclose(other[:39:2], 20.0 + np.arange(20), atol=1e-3)
    between = other[1:38:2] - 20.0 - np.arange(19)  # a time between two samples has one of them
    assert np.all((np.abs(between) < 1e-3) | (np.abs(between - 1) < 1e-3)) and np.isnan(other[40:]).all()
    two = drawn_of(tmp_path / "b.html", [recording(30), recording(50)], None)
    assert np.isnan(decoded(two[0]["lines"][0])).tolist() == [False] * 30 + [True] * 20  # the longest is shown whole
    assert not np.isnan(decoded(two[0]["lines"][1])).any()
    assert [li["kind"] for li in two[0]["lines"]] == ["after", "ink"] and two[0]["lines"][0]["name"] == "a.csv"


def test_recordings_too_long_for_a_page_stay_a_picture(tmp_path: Path) -> None:
    assert drawn_of(tmp_path / "a.html", [recording(MOST_ALONE // 2 + 1)], None) == []
    assert (tmp_path / "a.html").stat().st_size < 1e6
    assert drawn_of(tmp_path / "b.html", [recording(50)], recording(50, 1e9)) == []  # 10¹² places of the first's clock


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    made = Browser(tmp_path_factory.mktemp("browser"))
    yield made
    made.close()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "page.html"
    render_diagnosis(report_examples.diagnosis(), report_examples.evidence(), path)
    return path


SEEN = "getComputedStyle(document.querySelector('figure[data-lines] > {}')).display"
TOLD = "document.querySelector('.live .told').textContent"


def mouse(browser: Browser, kind: str, x: float, y: float, clicks: int = 1) -> None:
    browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=clicks)


@pytest.mark.slow
def test_a_stretch_is_chosen_by_dragging_and_read_by_pointing(browser: Browser, page: Path) -> None:
    browser.open(f"file://{page}", 1280, 1400)
    assert browser.leave() == [] and browser.evaluate(SEEN.format(".scroll")) == "none"
    whole = report_examples.evidence()["series"]["generator_speed"]
    time, y = np.array(whole["time_s"]), np.array(whole["measured"])
    box = browser.evaluate(
        "(() => {const s = document.querySelector('.live svg'); s.scrollIntoView();"
        " const b = s.getBoundingClientRect(); return {x: b.x, y: b.y, w: b.width}})()"
    )
    y_at, left, wide = box["y"] + 60, box["x"] + 62, box["w"] - 62 - 12  # the margins of zoom.js
    mouse(browser, "mousePressed", left + 0.25 * wide, y_at)
    mouse(browser, "mouseMoved", left + 0.5 * wide, y_at)
    mouse(browser, "mouseReleased", left + 0.5 * wide, y_at)
    first = facts_of(page.read_text())["view"]
    mouse(browser, "mouseMoved", left - 30, y_at)  # off the panels: which stretch is shown
    a, b = (float(v) for v in re.findall(r"(\d+\.\d+) s to (\d+\.\d+) s of", browser.evaluate(TOLD))[0])
    length = first[1] - first[0]
    assert [a, b] == pytest.approx([first[0] + 0.25 * length, first[0] + 0.5 * length], abs=0.02 * length)
    mouse(browser, "mouseMoved", left + 0.5 * wide, y_at)
    told = browser.evaluate(TOLD).replace("\u2212", "-")
    t, value = re.match(r"([\d.]+) s, generator_speed \(rad/s\): measured (-?[\d.e-]+),", told).groups()  # type: ignore[union-attr]
    k = int(np.argmin(np.abs(time - float(t))))
    assert abs(float(t) - 0.5 * (a + b)) < 0.2 and float(value) == pytest.approx(y[k], abs=2e-4 * np.ptp(y))
    mouse(browser, "mousePressed", left + 0.5 * wide, y_at, 2)
    mouse(browser, "mouseReleased", left + 0.5 * wide, y_at, 2)
    mouse(browser, "mouseMoved", left - 30, y_at)
    assert f"{time[0]:.2f} s to {time[-1]:.2f} s of" in browser.evaluate(TOLD)
    assert browser.leave() == []


@pytest.mark.slow
def test_printed_and_without_scripts_the_still_picture_stands(browser: Browser, page: Path) -> None:
    browser.open(f"file://{page}", 390, 900, dark=True)
    assert browser.evaluate(SEEN.format(".live")) == "block"
    assert browser.evaluate("document.documentElement.scrollWidth") <= 390
    browser.call("Emulation.setEmulatedMedia", media="print")
    assert browser.evaluate(SEEN.format(".live")) == "none" and browser.evaluate(SEEN.format(".scroll")) == "block"
    browser.call("Emulation.setEmulatedMedia", media="screen")
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    browser.open(f"file://{page}", 1280, 900)
    assert browser.evaluate("document.querySelectorAll('.live').length") == 0
    assert browser.evaluate(SEEN.format(".scroll")) == "block"
    browser.call("Emulation.setScriptExecutionDisabled", value=False)
