"""Every part of the data is held out once: how that divides them, what it proves, where it decides."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.conclusion.correction import correct
from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.validation import in_turn
from aeolid.diagnose.validation.rotation import Fold, Rotation, folds_of, is_silent
from aeolid.models import equations_file
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP = 0.1
FIRST_ORDER = """
[model]
name = "first order"
time = "continuous"
[parameters]
a = { value = 2.0, min = 0, max = 10, free = true }
[[state]]
name = "x"
derivative = "(a*u - x)/0.8"
initial = { value = 0.0 }
[[output]]
name = "y"
equation = "x"
"""


def record(u: Array, y: Array, source: str) -> Record:
    channels = (Channel("u", "1", "input"), Channel("y", "1", "output"))
    return Record(STEP * np.arange(len(u)), np.column_stack([u, y]), channels, STEP, source, "")


@pytest.mark.parametrize(("count", "folds"), [(1, 5), (2, 6), (3, 3), (7, 7), (17, 7)])
def test_every_sample_is_held_out_once(count: int, folds: int) -> None:
    rows = np.arange(150.0)
    records = [record(rows, rows + 1000 * k, f"{k}.csv") for k in range(count)]
    parts = folds_of(records, ["u"], ["y"], 1.0)
    assert len(parts) == folds and len({name for name, _ in parts}) == folds
    seen = np.concatenate([s.y[:, 0] for _, part in parts for s in part])
    assert sorted(seen.tolist()) == sorted(y for r in records for y in r.column("y").tolist())


def test_what_nobody_measured_is_in_no_fold() -> None:
    rows = np.arange(100.0)
    whole, blank = record(rows, rows, "a.csv"), record(rows, np.full(100, np.nan), "b.csv")
    assert [name for name, _ in folds_of([whole, blank, whole], ["u"], ["y"], 1.0)] == ["a.csv", "a.csv"]


@pytest.mark.parametrize(
    ("interval", "silent"), [((-5.0, 20.0), True), ((1.0, 9.0), True), ((3.0, 9.0), False), ((-9.0, -1.0), False)]
)
def test_a_sealed_part_is_silent_where_it_neither_proves_nor_refutes(
    interval: tuple[float, float], silent: bool
) -> None:
    assert is_silent(interval) is silent


@pytest.mark.parametrize(
    ("agrees", "low", "gain", "proves"),
    [(True, 3.0, 20.0, True), (False, 3.0, 20.0, False), (True, 1.0, 20.0, False), (True, 3.0, 0.3, False)],
)
def test_folds_prove_what_most_of_them_chose(agrees: bool, low: float, gain: float, proves: bool) -> None:
    """With agreement, beyond chance, and by more than 0.002 nats a sample."""
    fold = Fold("a", None, np.full(200, gain / 200), (low, 2 * gain))
    assert Rotation((fold,), (low, 2 * gain), agrees).proves is proves


@pytest.mark.parametrize(
    ("forms", "low", "borne_out", "score", "replaced"),
    [
        (5, 30.0, 9.0, 40.0, True), (4, 30.0, 9.0, 40.0, True), (2, 30.0, 9.0, 40.0, False),
        (5, 1.0, 9.0, 40.0, False), (5, 30.0, 1.0, 40.0, False), (5, 30.0, 9.0, 99.0, False),
    ],
)  # fmt: skip
def test_a_form_that_most_folds_choose_takes_the_place_of_a_name(
    forms: int, low: float, borne_out: float, score: float, replaced: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the folds speak and the sealed part bears it out; a diode had been a saturation and a stop.

    Not a form that is as good as the name on all data: a pitch gain that grows with the pitch is a bent pitch.
    """
    named = SimpleNamespace(key="saturation", unlisted=False, score=100.0)
    form = SimpleNamespace(key="form", unlisted=True, score=score)
    choices = [form] * forms + [named] * (5 - forms)
    folds = tuple(Fold("a", c, np.full(40, 1.0), (low, 60.0)) for c in choices)
    before = SimpleNamespace(single=named)
    instead = SimpleNamespace(single=form, proof=SimpleNamespace(interval=(borne_out, 60.0)))
    monkeypatch.setattr(in_turn, "hold_against", lambda *_: instead)
    found: Any = in_turn.form_in_turn
    turned = Rotation(folds, (low, 300.0), False)
    assert found(None, None, before, [named, form], turned, 1) is (instead if replaced else before)
    assert found(None, None, before, [named, form], None, 1) is before
    assert found(None, None, SimpleNamespace(single=form), [], turned, 1).single is form
    assert found(None, None, SimpleNamespace(single=None), [], turned, 1).single is None


@pytest.mark.parametrize(
    ("chosen", "low", "sealed", "slight", "kept"),
    [
        (5, 30.0, (-1.0, 17.0), True, False), (4, 30.0, (-1.0, 17.0), True, False), (3, 30.0, (-1.0, 17.0), True, True),
        (5, 1.0, (-1.0, 17.0), True, True), (5, 30.0, (9.0, 17.0), True, True), (5, 30.0, (-1.0, 17.0), False, True),
    ],
)  # fmt: skip
def test_a_constant_that_most_folds_choose_takes_the_place_of_a_form(
    chosen: int, low: float, sealed: tuple[float, float], slight: bool, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the sealed part does not bear the form out, and the constant is off by no more than is usual."""
    constant = SimpleNamespace(key="frequency", unlisted=False)
    form = SimpleNamespace(key="form", unlisted=True)
    choices = [constant] * chosen + [form] * (5 - chosen)
    folds = tuple(Fold("a", c, np.full(40, 1.0), (low, 60.0)) for c in choices)
    before = SimpleNamespace(single=form, proof=SimpleNamespace(interval=sealed))
    instead = SimpleNamespace(single=constant)
    monkeypatch.setattr(in_turn, "hold_leader", lambda *_: instead)
    monkeypatch.setattr(in_turn, "is_slight", lambda _: slight)
    found: Any = in_turn.constant_in_turn
    turned = Rotation(folds, (low, 300.0), False)
    assert found(None, None, before, [constant], [], turned, 1) is (before if kept else instead)
    assert found(None, None, before, [], [], turned, 1) is before
    assert found(None, None, before, [constant], [], None, 1) is before
    decided: Any = in_turn.decided_in_turn
    if not kept:
        result, rotation = decided(None, None, before, [constant], [], turned, 1)
        assert result is instead and rotation.agrees and rotation.folds is turned.folds


@pytest.mark.parametrize(
    ("first", "both", "borne_out", "more", "kept"),
    [
        ((5.0, 9.0), 0.0, True, 20.0, True), ((5.0, 9.0), 0.0, False, 20.0, False),
        ((5.0, 9.0), -9.0, True, 90.0, False), ((-1.0, 3.0), 0.0, True, 20.0, True),
        ((5.0, 9.0), 99.0, True, 90.0, False), ((5.0, 9.0), 0.0, False, 90.0, True),
    ],
    ids=["silent of the second", "not by folds", "refuted", "silent of both", "borne out by itself", "one of both"],
)  # fmt: skip
def test_a_second_effect_that_the_sealed_part_does_not_speak_of_is_decided_by_folds(
    first: tuple[float, float], both: float, borne_out: bool, more: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a plate's stop and friction the sealed part told the stop alone; what it bears out itself is not asked.

    Where the folds are silent, too: both, if alone they are not told apart and together they explain far more.
    """
    noise = np.random.default_rng(1).standard_normal(400)
    places = [SimpleNamespace(key=k) for k in ("stop", "friction")]
    one, two = (
        SimpleNamespace(key=k, predictor=None, fit=None, score=s, attachments=places[:n])
        for k, s, n in (("stop", 60.0, 1), ("stop + friction", 60.0 + more, 2))
    )
    monkeypatch.setattr(in_turn, "rivals_of", lambda *_: places[1:])
    proof = SimpleNamespace(interval=first, difference=np.zeros(400))
    larger = SimpleNamespace(interval=(1.0, 9.0), difference=noise - noise.mean() + both / 40)
    held: Any = in_turn.Held((one,), 0, None, proof)
    monkeypatch.setattr(in_turn, "estimated_on_all", lambda _, c: c)
    monkeypatch.setattr(in_turn, "prove", lambda *_: larger)
    monkeypatch.setattr(in_turn, "adds_in_turn", lambda *_: borne_out)
    monkeypatch.setattr(in_turn.Held, "several", None)
    turned = Rotation((Fold("a", one, np.full(40, 1.0), (30.0, 60.0)),), (30.0, 300.0), True)  # type: ignore[arg-type]
    stage: Any = SimpleNamespace(predictor=None, fit=None, split=SimpleNamespace(sealed=()), settle_s=1.0)
    found = in_turn._with_more_in_turn(stage, stage, held, [one, two], [one], turned, 1)  # type: ignore[list-item]
    assert (found is not held) is kept
    assert not kept or (found.kept == 1 and found.sets == (one, two))


@pytest.mark.parametrize(
    ("intervals", "agrees", "against"),
    [
        (((60.0, 80.0), (60.0, 75.0), (0.0, 0.0), (-800.0, -600.0), (60.0, 73.0)), True, 1),
        (((60.0, 80.0), (60.0, 75.0), (0.0, 0.0), (-800.0, -600.0), (60.0, 73.0)), False, 0),
        (((60.0, 80.0), (-5.0, 9.0), (0.0, 0.0), (-800.0, -600.0), (0.5, 73.0)), True, 0),
        (((60.0, 80.0), (60.0, 75.0), (-80.0, -60.0), (-800.0, -600.0), (60.0, 73.0)), True, 0),
        (((60.0, 80.0), (60.0, 75.0), (-5.0, 4.0)), True, 0),
    ],
    ids=["one against three", "no agreement", "one alone", "three to two", "none against"],
)
def test_a_fold_against_what_most_bear_out_is_told(
    intervals: tuple[tuple[float, float], ...], agrees: bool, against: int
) -> None:
    folds = tuple(Fold(f"{k}", None, np.full(300, sum(ends) / 600), ends) for k, ends in enumerate(intervals))
    turned = Rotation(folds, (-700.0, 150.0), agrees)
    assert len(turned.against) == against and all(f.interval[1] < 0 for f in turned.against)
    assert Rotation(folds, (20.0, 150.0), True).against == () or turned.gain < 0


def lagging(folder: Path, tau_s: float) -> Case:
    """Return six runs of 12 s of a machine behind a lag; the third, soon lost, shows it after a step at rest."""
    path, truth = folder / "model.toml", folder / "truth.toml"
    path.write_text(FIRST_ORDER)
    lag = f'[[state]]\nname = "v"\nderivative = "(u - v)/{tau_s}"\ninitial = {{ value = 0.0 }}\n[[output]]'
    truth.write_text(FIRST_ORDER.replace("a*u", "a*v").replace("[[output]]", lag) if tau_s else FIRST_ORDER)
    records = []
    for k in range(6):
        rng = np.random.default_rng((k, 5))
        u = np.repeat(rng.standard_normal(24), 5) * (0.8 + 0.1 * k)
        u = np.repeat([1.0, -1.0], 60) if k == 2 else u
        noise = 0.25 * rng.standard_normal(len(u))
        noise[50:] += np.nan if k == 2 else 0.0
        clean = equations_file.load(truth).simulate(record(u, u, ""))[:, 0]
        records.append(record(u, clean + noise, f"{k}.csv"))
    model = equations_file.load(path)
    return Case("machine", tuple(records), "equations", model, "model.toml", "", {}, folder, False)


def test_rotation_decides_where_the_sealed_part_is_silent(tmp_path: Path) -> None:
    """The lag is clear in five runs of six; the sealed one, a step long before what is scored, not."""
    found = diagnose(study(lagging(tmp_path, 0.25), sham=0, seed=1, progress=lambda *_: None))
    turned = found["rotation"]
    assert found["sealed"]["data"].startswith("2.csv") and is_silent(tuple(found["sealed"]["interval"]))
    assert turned["decides"] and turned["proves"] and turned["nats"] > 50
    assert [f["held_out"] for f in turned["folds"]] == [f"{k}.csv" for k in range(6)]
    assert found["verdict"] in ("named", "ambiguous") and "input_lag" in {e["family"] for e in found["effects"]}


def test_the_corrected_model_has_its_sensors_zero(tmp_path: Path) -> None:
    """A constant is no finding where a force may be the same; the file that is run free has it."""
    case = lagging(tmp_path, 0.0)
    shifted = tuple(replace(r, values=r.values + np.array([0.0, 0.5])) for r in case.records)
    found = correct(study(replace(case, records=shifted), sham=0, seed=1, progress=lambda *_: None))
    zero = next(p.value for p in found.model.parameters if p.name == "sensor_zero_1")
    assert zero == pytest.approx(0.5, abs=5 * 0.25 / np.sqrt(600))  # five deviations of the mean of the noise


def test_nothing_is_rotated_where_nothing_was_found(tmp_path: Path) -> None:
    found = diagnose(study(lagging(tmp_path, 0.0), sham=0, seed=1, progress=lambda *_: None))
    assert (found["verdict"], found["rotation"]) == ("no_mismatch", None)
