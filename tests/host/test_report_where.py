"""The maps of where a mismatch sits: each stands where it has data, and dots stand on what is marked and only there."""

from __future__ import annotations

import re
from typing import Any

import pytest
import report_examples

from aeolid.report.charts import DOT as INK
from aeolid.report.where import equations, maps

CAPTIONS = {
    "bands": ("by channel and third octave", "A dot marks what is significant"),
    "time": ("by channel and stretch of time", "A dot marks a stretch that differs"),
    "region": ("By channel and by the value of wind", "innovations shifted in time against wind"),
    "azimuth": ("By channel and azimuth order", "A dot marks a line"),
    "path": ("Which recorded channel the innovations depend on", "A dot marks a significant dependence"),
    "horizon": ("How far ahead the model before correction predicts", "A dot marks what is significant"),
    "effort": ("Control effort: power of the inputs", "A dot marks what is significant"),
    "inferred": ("Inferred inputs: power of the wind", "A dot marks what is significant"),
}


def dots(page: str) -> int:
    """Count the dots: markers filled with ink and rimmed in white."""
    return len(re.findall(rf"<use [^>]*fill: {INK}; stroke: #ffffff", page))


def only(name: str) -> dict[str, Any]:
    facts = report_examples.evidence()
    return {"bands": facts["bands"]} if name == "bands" else {"cells": {name: facts["cells"][name]}}


@pytest.mark.parametrize("name", CAPTIONS)
def test_a_map_stands_where_it_has_data_with_a_caption_that_says_what_a_dot_means(name: str) -> None:
    page = maps(only(name))
    said = {n for n, parts in CAPTIONS.items() if all(p in page for p in parts)}
    assert said == {name} and all(p in page for p in CAPTIONS[name])
    assert page.count("<figure>") == 1 and "1 % for" in page


@pytest.mark.parametrize("name", CAPTIONS)
def test_dots_stand_on_what_is_marked_and_only_there(name: str) -> None:
    facts = only(name)
    cells = facts["bands"] if name == "bands" else facts["cells"][name]
    assert dots(maps(facts)) == sum(c["significant"] for c in cells) > 0
    for c in cells:
        c["significant"] = False
    assert dots(maps(facts)) == 0


def test_nothing_is_drawn_of_nothing() -> None:
    assert maps({}) == "" and maps({"cells": {"time": [], "region": [], "azimuth": []}, "equations": []}) == ""


def test_many_recordings_do_not_make_a_map_unreadable() -> None:
    cells = report_examples.evidence()["cells"]["time"]
    more = [c | {"source": f"{i}.csv"} for i in range(3) for c in cells]
    page = maps({"cells": {"time": [*cells, *more]}})
    assert "Shown: 4 of 5 recordings." in page
    loud = [c | {"statistic": 50 * c["threshold"], "significant": True} for c in cells]
    page = maps({"cells": {"time": [*cells, *more, *(c | {"source": "9.csv"} for c in loud)]}})
    assert "Shown: 4 of 6 recordings." in page and "9.csv" in page  # whichever are the most marked


def test_equations_say_what_was_asked_and_what_no_fit_does_without() -> None:
    page = equations(report_examples.equations())
    for part in ("no fit without", "211 nats", "5.70 nats", "wanders in time", "1.20", "3.40"):
        assert part in page, part
    assert page.count(">significant<") == 2
    long = [*report_examples.equations()] * 10
    assert equations(long).count("<tr") == 1 + 12
