"""Converters that truncate: what is left of stairs finer than the noise is a bias of half a step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from study_modules import load_study
from test_catalogue_signals import site_of

from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.entries.sensor_quantisation import ENTRY
from aeolid.diagnose.pipeline import study

rig = load_study("diagnosis")


@pytest.mark.parametrize(
    ("share", "ways"), [(0.2, ("", "down ")), (0.02, ("down ",)), (0.0005, ())], ids=["coarse", "fine", "finest"]
)
def test_a_fine_grid_is_asked_for_truncation_only(share: float, ways: tuple[str, ...]) -> None:
    """share: of the spread; a rounding that fine is far below what any model predicts, half a step is not."""
    y = np.random.default_rng(4).standard_normal((20_000, 1))
    site = site_of("equations", output_names=("x_speed",), y=share * np.floor(y / share))
    found = ENTRY.attach(site)
    assert [a.key for a in found] == [f"sensor_quantisation {way}output:x_speed" for way in ways]
    for a in found:
        spacing = next(s for s in a.slots if s.label == "spacing")
        assert spacing.null == pytest.approx(share, rel=1e-9)  # the values show it as it is
        assert spacing.high - spacing.low < 0.01 * share


@pytest.mark.nightly  # a whole diagnosis
@pytest.mark.diagnosis
def test_what_truncates_is_named_and_not_only_its_bias(tmp_path: Path) -> None:
    """A speed cut down to steps of a hundredth of its spread, 600 of them: a bias of half a step was the answer before.

    The bias stays beside it, behind by the parameter that it costs.
    """
    case = load_case(rig.write_case(tmp_path, rig.Hidden("levels", "equations"), 3000, 3))
    (record,), step = case.records, 0.01
    values, at = record.values.copy(), [c.name for c in record.channels].index("speed")
    values[:, at] = step * np.floor(values[:, at] / step)
    result = study(
        replace(case, records=(replace(record, values=values),)), sham=0, seed=0, progress=lambda text, share: None
    )
    first = result.candidates[0]
    assert first.attachments[0].entry == "sensor_quantisation"
    assert first.values[first.key]["spacing"][0] == pytest.approx(step, rel=2e-3)
    said = diagnose(result)
    assert "always the next lower one" in said["statement"] and said["verdict"] in ("ambiguous", "immaterial", "named")
