"""A baseline's leftovers are told by place: in the facts of the report, in diagnosis.json, and by equation."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import binom
from small_cases import SWING, SWING_CHANNELS, SWING_STEP, swinging, write_case

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.conclusion.where import where_of
from aeolid.diagnose.data.case import Case, load_case
from aeolid.diagnose.localise import deficiency
from aeolid.diagnose.localise.deficiency import deficient, wander
from aeolid.diagnose.localise.locate import evidence_cells, whereabouts
from aeolid.diagnose.stats.blocks import blocks_of
from aeolid.diagnose.stats.projection import outside, span

Array = NDArray[np.float64]
TURN_S = 1.25  # of the rotor


def planted(folder: Path, *roles: str, **hidden: float) -> Case:
    """Return a swing with a wind (m/s) and a rotor's angle (deg) recorded, of these roles, and errors of the speed.

    line: at three turns, m/s; windy: above 14 m/s, m/s; burst: from 20 to 24 s, m/s. Ten readings are missing.
    """
    swinging(folder)
    rows = np.loadtxt(folder / "recording.csv", delimiter=",", skiprows=1)[:, 1:]
    rng = np.random.default_rng(8)
    t = SWING_STEP * np.arange(len(rows))
    pole = np.exp(-SWING_STEP / 1.0)  # it remembers a second
    wind = 12 + 2 * lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(len(rows)))
    turned = np.cumsum(1 + 0.05 * np.sin(2 * np.pi * t / 17)) * SWING_STEP / TURN_S
    rows[:, 2] += hidden.get("line", 0.0) * np.cos(2 * np.pi * 3 * turned)
    rows[:, 2] += hidden.get("windy", 0.0) * (wind > 14) * rng.standard_normal(len(rows))
    rows[:, 2] += hidden.get("burst", 0.0) * ((t >= 20) & (t < 24)) * rng.standard_normal(len(rows))
    rows[300:310, 1] = np.nan
    extra = (("wind", "m/s", "scheduling"), ("angle", "deg", "azimuth"))
    channels = [c if c[2] in roles else (c[0], c[1], "ignore") for c in extra]
    rows = np.column_stack([rows, wind, (360 * turned) % 360])
    return load_case(write_case(folder, SWING, SWING_STEP, (*SWING_CHANNELS, *channels), rows))


def located(case: Case) -> tuple[dict[str, list[dict[str, Any]]], dict[str, Any]]:
    cells = evidence_cells(prepare(case), case, 1)
    return cells, whereabouts(cells)


NOWHERE = {"azimuth_order": None, "region": None, "time_s": None, "inputs": []}


def test_a_line_is_told_by_its_order_and_nothing_else(tmp_path: Path) -> None:
    """A line of 6 mm/s beside innovations of 8 mm/s; the recorded angle is in degrees."""
    cells, told = located(planted(tmp_path, "scheduling", "azimuth", line=0.006))
    assert told == NOWHERE | {"azimuth_order": 3}
    assert {(c["output"], c["order"]) for c in cells["azimuth"] if c["significant"]} <= {("speed", 3), ("position", 3)}
    assert {c["output"] for c in cells["time"]} == {"position", "speed"}
    assert len({tuple(c["range"]) for c in cells["region"]}) == 6 and cells["region"][0]["unit"] == "m/s"


def test_an_error_above_a_wind_speed_is_told_by_its_region(tmp_path: Path) -> None:
    """Tell the upper of six bins, by the mean of a fifth of a second before: from 13.3 m/s on."""
    told = located(planted(tmp_path, "scheduling", windy=0.02))[1]
    name, low, _, high, unit = str(told["region"]).split()
    assert (name, unit) == ("wind", "m/s") and float(low) == pytest.approx(14, abs=1) and float(high) > 15
    assert told["azimuth_order"] is None  # a gust lasts, and its time may be told too


def test_a_gust_that_the_model_has_to_guess_is_no_region(tmp_path: Path) -> None:
    """A force is recorded as a wind and the model is not told of it: each innovation follows the wind there."""
    case = planted(tmp_path, "scheduling")
    prepared = prepare(case)
    white = prepared.fit.residual.reshape(-1, 2)
    segment = prepared.predictor.segments[0]
    place = [s.name for s in prepared.extended.inputs].index("wind")
    segment.u[:, place] = 12 + white[:, 1]
    cells = evidence_cells(prepared, case, 1)["region"]
    assert len(cells) == 2 * 2 * 6 and not any(c["significant"] for c in cells)


def test_a_burst_is_told_by_its_time(tmp_path: Path) -> None:
    """Four seconds of the 50 of the fit; a stretch is 2.1 s, so both ends are right to that."""
    told = located(planted(tmp_path, "scheduling", "azimuth", burst=0.03))[1]
    first, last = told["time_s"]
    assert first == pytest.approx(20, abs=2.2) and last == pytest.approx(24, abs=2.2)
    assert told | {"time_s": None} == NOWHERE


def test_only_what_is_recorded_has_a_map(tmp_path: Path) -> None:
    """Without wind and angle: the push is new every 0.2 s, its mean over a settling time says no operating point."""
    cells, told = located(planted(tmp_path))
    assert cells["time"] and not cells["region"] and not cells["azimuth"]
    assert told == NOWHERE


def cell(place: tuple[float, float], z: float, **more: Any) -> dict[str, Any]:
    return {"output": "y", "kind": "power", "value": 2.0, "statistic": z, "threshold": 4.0, "significant": z > 4.0,
            "time_s": list(place), "range": list(place), **more}  # fmt: skip


def test_marked_neighbours_of_the_strongest_cell_belong_to_it() -> None:
    ends = [(float(k), float(k + 1)) for k in range(8)]
    z = [5.0, 1.0, 5.0, 9.0, 4.5, 3.0, 1.0, 1.0]
    cells = {"time": [cell(e, v, source="a.csv") for e, v in zip(ends, z, strict=True)],
             "region": [cell((100 * a, 100 * a + 100), v, channel="speed", unit="rpm") for (a, _), v in
                        zip(ends, z, strict=True)],
             "azimuth": [{"output": "y", "order": k, **cell((0, 0), v)} for k, v in ((1, 5.0), (3, 7.0))]}  # fmt: skip
    cells["path"] = [cell((0.1, 0.2), v, channel=n) for n, v in (("push", 4.5), ("pull", 6.0), ("wind", 1.0))]
    want = {"azimuth_order": 3, "region": "speed 200 to 500 rpm", "time_s": [2.0, 5.0], "inputs": ["pull"]}
    assert whereabouts(cells) == want
    study: Any = SimpleNamespace(
        bands=[], cells=cells, findings=(), candidates=(), ceiling=SimpleNamespace(groups=()),
        prepared=SimpleNamespace(extended=SimpleNamespace(outputs=())), winner=None, completed=None, second=None,
    )  # fmt: skip
    study.alternatives, study.whole = (), None
    where = where_of(study, "unnamed")
    assert where is not None and where["time_s"] == [2.0, 5.0] and where["azimuth_order"] == 3
    assert where["inputs"] == ["pull"]
    assert where_of(study, "no_mismatch") is None


def test_what_is_marked_nearly_everywhere_is_nowhere_in_particular() -> None:
    ends = [(float(k), float(k + 1)) for k in range(8)]
    cells = {"time": [cell(e, 5.0 if k < 5 else 1.0, source="a.csv") for k, e in enumerate(ends)]}
    assert whereabouts(cells) == NOWHERE and whereabouts({}) == NOWHERE


def test_a_recording_that_is_off_as_a_whole_is_told_by_name() -> None:
    """Of three recordings of six stretches one: a third of all stretches, and its name beside the time."""
    cells = {
        "time": [cell((float(k), k + 1.0), 6.0 if s == "b.csv" else 1.0, source=s)
                 for s in ("a.csv", "b.csv", "c.csv") for k in range(6)]
    }  # fmt: skip
    assert whereabouts(cells) == NOWHERE | {"time_s": [0.0, 6.0], "recording": "b.csv"}


def swing(folder: Path, **hidden: float) -> Prepared:
    return prepare(load_case(swinging(folder, **hidden)))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    """Prepare the swing that lacks nothing; gusts push it."""
    return swing(tmp_path_factory.mktemp("plain") / "case")


def test_gusts_are_the_noise_of_the_equation_they_act_on(plain: Prepared) -> None:
    """Without noise on the speed the fit loses far more than the 5.7 nats of chance; no value wanders, v = dq/dt."""
    rows = {r["name"]: r for r in deficient(plain, 1)}
    assert rows["v"]["significant"] and rows["v"]["scale"] == "nats" and (rows["v"]["statistic"] or np.inf) > 100
    assert {n for n, r in rows.items() if r["significant"]} == {"v"}
    assert {n for n, r in rows.items() if r["what"] == "parameter"} == {"m", "k", "c"}
    assert rows["q"]["asked"] == "noise where no force acts"


def test_a_stiffness_that_goes_is_told_as_a_value_that_wanders(tmp_path: Path) -> None:
    """A tenth of it over the recording: the spring leads the values; damping, which is none of it, does not wander."""
    rows = [r for r in deficient(swing(tmp_path, softening=0.1), 1) if r["what"] == "parameter"]
    assert rows[0]["name"] == "k" and rows[0]["significant"]
    assert not next(r for r in rows if r["name"] == "c")["significant"]


def test_a_value_that_acts_nowhere_does_not_wander(tmp_path: Path) -> None:
    """A stop at 50 m that the swing never meets: its slope was one of rounding, of unit length like any other."""
    case = swinging(tmp_path / "case")
    text = (case / "model.toml").read_text()
    text = text.replace("[[input]]", 'far = { value = 3.0, unit = "N/m" }\n[[input]]', 1)
    (case / "model.toml").write_text(text.replace("- k*q)", "- k*q - far*max(q - 50.0, 0.0))"))
    assert "far" not in {r["name"] for r in deficient(prepare(load_case(case)), 1)}


def test_white_residuals_let_a_value_wander_once_in_a_hundred(plain: Prepared, monkeypatch: pytest.MonkeyPatch) -> None:
    """200 white residuals, less what the fit takes, through the directions of all values; at 1 % no more than 8."""
    bare = plain.only(())
    model, fit = bare.extended, bare.fit
    places = [i for i, p in enumerate(model.parameters) if p.name in ("m", "k", "c")]
    moved = deficiency._columns(bare.predictor, fit.point, places, [], bare)
    basis = span(np.vstack([fit.jacobian, fit.prior_jacobian]))
    hits = 0
    for seed in range(200):
        white = outside(np.random.default_rng(seed).standard_normal((len(basis), 1)), basis)[:, 0]
        blocks = blocks_of(len(fit.residual) // 2, 2, len(fit.prior_residual), seed, 999)
        found = [w for w in (wander(c, basis, white, blocks, 2) for c in moved.T) if w is not None]
        limit = np.quantile(np.max([w.null for w in found], axis=0), 0.99)
        hits += max(w.z for w in found) > limit
    assert len(found) == 3 and hits <= binom.isf(1e-3, 200, 0.01), hits


def test_a_linear_model_has_no_equations_to_accuse(plain: Prepared) -> None:
    linear: Any = SimpleNamespace(only=lambda a: SimpleNamespace(linear=object(), fit=plain.fit))
    assert deficient(linear, 1) == []
