"""One output whose rows come later than those of all other channels is found, and put right, before any physics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_cases import as_case, draw_case
from numpy.typing import NDArray
from scipy.signal import lfilter
from small_cases import SWING, SWING_CHANNELS, write_case

from aeolid.diagnose.baseline import late_output as late_module
from aeolid.diagnose.baseline.channel_faults import with_faults
from aeolid.diagnose.baseline.late_output import LateOutput, first_order, late_output, second_order
from aeolid.diagnose.baseline.wiring_columns import moved_ahead
from aeolid.diagnose.baseline.wiring_evidence import judge_of
from aeolid.diagnose.data.case import Case, load_case
from aeolid.models.state_space import StateSpace

Array = NDArray[np.float64]


def with_outputs(case: Case, y: Array) -> Case:
    """Return a drawn case with other outputs."""
    assert isinstance(case.baseline, StateSpace)
    return as_case(case.baseline, case.records[0].values[:, :2], y)


def late_by(y: Array, rows: float) -> Array:
    """Return outputs of which the second comes so many rows later."""
    moved = y.copy()
    moved[:, 1] = moved_ahead(y[:, 1], -rows, beyond="edge")
    return moved


@pytest.mark.parametrize("rows", [3, 8, -5])
def test_the_output_is_found_and_put_right(rows: int) -> None:
    """On plants that nobody chose; what was recorded comes back, but for the rows that nobody has."""
    found = 0
    for seed in range(6):
        whole, _, y = draw_case(seed)
        late, right = late_output(with_outputs(whole, late_by(y, rows)))
        if late is None:
            continue
        assert (late.output, late.rows) == ("y1", rows)
        kept = slice(None, -rows) if rows > 0 else slice(-rows, None)
        assert np.array_equal(right.records[0].values[kept], whole.records[0].values[kept])
        assert np.isnan(right.records[0].values[:, 3]).sum() == abs(rows)
        found += 1
    assert found >= 4  # of six: some outputs are mostly noise


def swing(folder: Path, rows: float) -> Case:
    """Return a swing whose speed another logger samples as often, but so many rows (quarters of one) later."""
    rng = np.random.default_rng(5)
    push = np.asarray(lfilter([0.2], [1, -0.8], np.repeat(rng.standard_normal(400), 5))) * 10
    held = np.column_stack([np.repeat(push, 4), np.zeros((8000, 2))])
    (folder / "often").mkdir()
    often = load_case(write_case(folder / "often", SWING, 0.005, SWING_CHANNELS, held))
    y = often.baseline.simulate(often.records[0])  # type: ignore[union-attr]
    read = np.column_stack([y[::4, 0], y[np.clip(np.arange(0, 8000, 4) - round(4 * rows), 0, 7999), 1]])
    read += 0.05 * read.std(axis=0) * rng.standard_normal(read.shape)
    return load_case(write_case(folder, SWING, 0.02, SWING_CHANNELS, np.column_stack([push, read])))


@pytest.mark.parametrize("rows", [0.0, 7.0, 4.5, -3.5, 6.25])
def test_equations_are_asked_too(tmp_path: Path, rows: float) -> None:
    """Within a quarter of a row, which is what the sampling may cause anyway."""
    late, _ = late_output(swing(tmp_path, rows))
    if rows == 0.0:
        assert late is None
    else:
        assert late is not None and late.output == "speed"
        assert late.rows == pytest.approx(rows, abs=0.25 + 1e-9)


def test_channels_that_are_right_are_left_alone() -> None:
    """A lag of an input, constants that are off, levels and much noise: no output is late."""
    for seed in range(8):
        case, u, y = draw_case(100 + seed, lag=[0.0, 2.0, 20.0][seed % 3], mean=[0.0, 5.0][seed % 2])
        assert isinstance(case.baseline, StateSpace)
        off = replace(case.baseline, A=0.97 * case.baseline.A, B=case.baseline.B * [1.5, 1.0])
        for model in (case.baseline, off):
            late, same = late_output(as_case(model, u, y))
            assert late is None and np.array_equal(same.records[0].values, np.hstack([u, y]))


@pytest.mark.parametrize("sensor", [first_order(1, 6.0), second_order(1, 6.0, 0.6), second_order(1, 6.0, 1.5)])
def test_a_sensor_that_lags_is_none(sensor: object) -> None:
    """What delays slow signals and takes fast ones away is left to the physics."""
    for seed in range(6):
        whole, _, y = draw_case(seed)
        y = y.copy()
        y[:, 1] = sensor.behind(y[:, 1])  # type: ignore[attr-defined]
        assert late_output(with_outputs(whole, y))[0] is None


def test_an_output_of_the_other_sign_is_not_half_a_period_late(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other sign is worth what the recording with the right one is; what it explains as well is not late."""
    whole, _, y = draw_case(1)
    right = judge_of(whole, 10)
    reversed_one = judge_of(with_outputs(whole, y * (1.0, -1.0)), 10)
    assert right is not None and reversed_one is not None
    base = replace(right.declared, late=(0, 0))
    worth = late_module.with_own_values(right, base).worth(base, 15)[0]
    found = late_module._as_reversed(reversed_one, base, replace(base, late=(0, 6)))
    assert found == pytest.approx(worth, abs=1.0)
    late = with_outputs(whole, late_by(y, 6))
    assert late_output(late)[0] is not None
    monkeypatch.setattr(late_module, "_as_reversed", lambda *_: np.inf)
    assert late_output(late)[0] is None


def test_an_input_that_is_late_is_no_output_that_is_early() -> None:
    """An input, or both, that act later than their rows say."""
    for seed in range(6):
        whole, u, y = draw_case(seed)
        assert isinstance(whole.baseline, StateSpace)
        for late in ([0], [0, 1]):
            recorded = u.copy()
            recorded[:-6, late] = u[6:, late]
            assert late_output(as_case(whole.baseline, recorded, y))[0] is None


def test_columns_move_between_rows_as_a_cubic_does() -> None:
    """Exactly so through four rows; beyond the ends they are held or missing, and a gap takes what touches it."""
    t = np.arange(50.0)
    cubic = 2.0 - t + 0.3 * t**2 - 0.01 * t**3
    for rows in (3.0, 2.25, -1.5, -0.75):
        at = t + rows
        moved = moved_ahead(cubic, rows, beyond="missing")
        there = np.isfinite(moved)
        assert moved[there] == pytest.approx((2.0 - at + 0.3 * at**2 - 0.01 * at**3)[there], rel=1e-12)
        assert there.sum() >= 50 - abs(rows) - 3
        assert np.isfinite(moved_ahead(cubic, rows, beyond="edge")).all()
    gap = cubic.copy()
    gap[20] = np.nan
    assert np.flatnonzero(np.isnan(moved_ahead(gap, 0.5, beyond="edge"))).tolist() == [18, 19, 20, 21]
    assert np.flatnonzero(np.isnan(moved_ahead(gap, 2.0, beyond="edge"))).tolist() == [18]


def test_the_answer_says_it_first() -> None:
    """As an effect with a value and how sure it is, and in words."""
    told = with_faults({"verdict": "named", "statement": "a lag", "effects": []}, [LateOutput("p", -4, 0.5, 90.0)])
    assert told["verdict"] == "data_fault" and told["location"]["entry"] == "output:p"
    assert told["statement"].startswith("p is recorded 2 s (4 rows) early against all other channels")
    offset = told["effects"][0]["parameters"]["offset_s"]
    assert offset["value"] == -2.0 and offset["std"] == pytest.approx(0.5 / np.sqrt(12))


def test_what_cannot_be_asked_is_left_alone() -> None:
    """One output, short recordings, standing channels: no answer, no error."""
    case, u, y = draw_case(3)
    assert isinstance(case.baseline, StateSpace)
    one = replace(case.baseline, C=case.baseline.C[:1], D=case.baseline.D[:1], outputs=case.baseline.outputs[:1])
    for asked in (as_case(one, u, y[:, :1]), as_case(case.baseline, u[:90], y[:90]), with_outputs(case, 0 * y)):
        late, same = late_output(asked)
        assert late is None and same is asked
