"""Gaps in channels that the model does not use are bridged, and said; they take no effect and no sample away."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.data.bridging import bridged, bridged_case, gaps_of
from aeolid.diagnose.data.case import Case, load_case
from aeolid.diagnose.rules import in_force

rig = load_study("rigs/turbine")
MOST = in_force().data.bridged_rows


@given(
    pace=st.floats(-40.0, 40.0), start=st.floats(0.0, 360.0), low=st.sampled_from([0.0, -180.0]),
    lost=st.sets(st.integers(0, 79), max_size=40),
)  # fmt: skip
def test_a_steady_angle_is_found_again_wherever_it_is_missing(
    pace: float, start: float, low: float, lost: set[int]
) -> None:
    """Any range of one turn, any gaps: pace and neighbours tell where a rotor was, also over the jump."""
    angle = low + np.mod(start + pace * np.arange(80.0) - low, 360.0)
    holed = angle.copy()
    holed[sorted(lost)] = np.nan
    if np.isfinite(np.diff(holed)).sum() < 1:
        return
    found = bridged(holed, gaps_of(holed), 360.0)
    miss = found - angle
    assert np.all(np.abs(miss - 360.0 * np.rint(miss / 360.0)) < 1e-6)
    kept = np.isfinite(holed)
    np.testing.assert_array_equal(found[kept], angle[kept])


def test_other_values_go_on_straight_and_stay_at_the_ends() -> None:
    holed = np.array([np.nan, 1.0, np.nan, np.nan, 4.0, np.nan])
    np.testing.assert_allclose(bridged(holed, gaps_of(holed)), [1.0, 1.0, 2.0, 3.0, 4.0, 4.0])


def _case(folder: Path, gaps: dict[str, range]) -> Case:
    """Return the case of a turbine whose rotor angle and wind are recorded, with samples missing from channels."""
    trial = next(t for t in rig.trials() if t.kind == "equations")
    case = load_case(rig.write_case(folder, replace(trial, roles=(("azimuth", "azimuth"),)), 1200, 3))
    record = case.records[0]
    values = record.values.copy()
    for name, rows in gaps.items():
        values[list(rows), [c.name for c in record.channels].index(name)] = np.nan
    return replace(case, records=(replace(record, values=values),))


def test_a_short_gap_is_bridged_and_a_long_one_is_said(tmp_path: Path) -> None:
    whole = _case(tmp_path, {})
    short, findings = bridged_case(_case(tmp_path, {"azimuth": range(300, 300 + MOST)}))
    assert [(f.check, f.channel, f.severity) for f in findings] == [("missing", "azimuth", "info")]
    assert "bridged" in findings[0].finding
    miss = short.records[0].column("azimuth") - whole.records[0].column("azimuth")
    assert np.max(np.abs(miss - 360 * np.rint(miss / 360))) < 3.0  # the speed changes over half a second
    asked = {a.entry for a in prepare(short).hypotheses}
    assert {"tower_shadow", "mass_imbalance", "gravity_1p"} <= asked
    gone, findings = bridged_case(_case(tmp_path, {"azimuth": range(300, 301 + MOST)}))
    assert [(f.check, f.channel, f.severity) for f in findings] == [("missing", "azimuth", "warning")]
    assert "tower_shadow" not in {a.entry for a in prepare(gone).hypotheses}


@pytest.mark.parametrize("role", ["input", "output"])
def test_what_the_model_uses_is_not_filled(tmp_path: Path, role: str) -> None:
    name = _case(tmp_path, {}).records[0].names(role)[0]
    case, findings = bridged_case(_case(tmp_path, {name: range(40, 42)}))
    assert not findings
    assert np.isnan(case.records[0].column(name)[40:42]).all()
