"""Sealed data bear one effect after the other out, and a form of what is named stands beside it without a name."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aeolid.diagnose.conclusion.verdict import diagnose
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.pipeline import study
from aeolid.diagnose.selection.several import KIN
from aeolid.diagnose.validation import sealed

STEP, ROWS, FINE = 0.02, 2400, 10
MASS = """[model]
name = "mass on a spring"
time = "continuous"
[parameters]
c = { value = 0.8, min = 0.1, max = 8.0, unit = "1/s", free = true }
k = { value = 40.0, min = 4.0, max = 400.0, unit = "1/s^2", free = true }
[[input]]
name = "push"
unit = "m/s^2"
[[state]]
name = "q"
unit = "m"
derivative = "v"
initial = { value = 0.0, free = true }
[[state]]
name = "v"
unit = "m/s"
derivative = "push - c*v - k*q"
[[output]]
name = "position"
unit = "m"
equation = "q"
"""
CASE = """[case]
title = "spring"
[recordings]
files = ["recording.csv"]
roles = "roles.toml"
[baseline]
kind = "equations"
file = "model.toml"
[context]
machine = "rig"
"""
ROLES = """[recording]
time = "time_s"
[[channel]]
name = "push"
unit = "m/s^2"
role = "input"
[[channel]]
name = "position"
unit = "m"
role = "output"
"""


def proof(gain: float) -> Any:
    """Return a proof whose gain comes evenly, with as much scatter as a tenth of it."""
    rows = np.full(400, gain / 400) * (1 + 0.1 * np.random.default_rng(1).choice([-1, 1], 400))
    return SimpleNamespace(gain=float(rows.sum()), difference=rows, interval=(0.9 * gain, 1.1 * gain))


@pytest.mark.parametrize(
    ("gains", "kept"),
    [
        ((69.0, -36.0, 155.0), 0),  # the second is not borne out, so no third stands on it
        ((-42.0, 24.0), 1),  # the first is not either, alone: what is missing bends it
        ((540.0, 568.0), 0),  # a twentieth more is not worth a name, as where it was chosen
        ((76.0, 92.0), 1),
        ((100.0, 130.0, 170.0), 2),
    ],
)
def test_one_effect_follows_another(gains: tuple[float, ...], kept: int, monkeypatch: pytest.MonkeyPatch) -> None:
    proofs = iter([proof(g) for g in gains])
    monkeypatch.setattr(sealed, "estimated_on_all", lambda prepared, candidate: candidate)
    monkeypatch.setattr(sealed, "prove", lambda *_: next(proofs))
    monkeypatch.setattr(sealed, "_with_form", lambda *_: None)
    chain: Any = [SimpleNamespace(predictor=None, fit=None) for _ in gains]
    prepared: Any = SimpleNamespace(split=SimpleNamespace(sealed=()), settle_s=1.0)
    whole: Any = SimpleNamespace(predictor=None, fit=None)
    assert sealed.hold_against(prepared, whole, chain, 1).kept == kept


@pytest.mark.parametrize(
    ("lead", "rivals", "errs", "kept"),
    [
        (-22.0, (-20.0, 20.0, 59.0), (), "2"),  # the sealed data say which of those that were not told apart it is
        (-22.0, (59.0, 20.0, 30.0), ("0",), "2"),  # not one whose longer predictions err more
        (-22.0, (2.0, -3.0, 1.0), (), "lead"),  # the best of three must be above what three are worth
        (12.0, (59.0, 20.0, 30.0), (), "lead"),  # what is borne out stays, whatever gains more there
        (-22.0, (), (), "lead"),
    ],
)
def test_a_rival_that_the_sealed_data_bear_out_takes_the_place_of_a_leader_that_they_do_not(
    lead: float, rivals: tuple[float, ...], errs: tuple[str, ...], kept: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    gains = {"lead": lead} | {str(k): g for k, g in enumerate(rivals)}

    def held(prepared: Any, whole: Any, chain: Any, seed: int) -> Any:
        own = proof(gains[chain[0].key])
        own.worse = chain[0].key in errs
        return sealed.Held((chain[0],), 0, None, own)

    candidates = {key: SimpleNamespace(key=key, score=-k, unlisted=False) for k, key in enumerate(gains)}
    monkeypatch.setattr(sealed, "hold_against", held)
    monkeypatch.setattr(sealed, "rivals_of", lambda of, winner: [c for c in of if c is not winner])
    monkeypatch.setattr(sealed.Held, "several", property(lambda self: None))
    stage: Any = SimpleNamespace(surrogate=None, deadline=unlimited())
    chain: Any = [candidates["lead"]]
    found = sealed.hold_leader(stage, stage, chain, list(candidates.values()), 1)  # type: ignore[arg-type]
    assert found.sets[0].key == kept


@pytest.mark.parametrize(
    ("needless", "kin_gain", "plausible", "named"),
    [
        (True, 90.0, True, "cubic_stiffness state:v"),  # beside it the stop has no stiffness: it is the spring
        (True, 40.0, True, "end_stop state:v"),  # the sealed data prefer the stop
        (True, 90.0, False, "end_stop state:v"),
        (False, 90.0, True, "end_stop state:v"),  # both are there: the stop is named, its kin completes the model
    ],
)
def test_an_effect_of_which_its_kin_leaves_nothing_gives_way_to_that(
    needless: bool, kin_gain: float, plausible: bool, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def effect(key: str, **more: Any) -> Any:
        part = SimpleNamespace(key=key, entry=key.split()[0])
        usual = {
            "key": key,
            "attachments": (part,),
            "predictor": key,
            "fit": None,
            "plausible": True,
            "unlisted": False,
        }
        return SimpleNamespace(**(usual | more))

    stop, cubic = effect("end_stop state:v"), effect("cubic_stiffness state:v", plausible=plausible)
    form = SimpleNamespace(key=f"{sealed.KIN} {cubic.key}", entry="unlisted")
    both = effect("both", attachments=(*stop.attachments, form))
    gains = {stop.key: 50.0, cubic.key: kin_gain, "both": 95.0}
    monkeypatch.setattr(sealed, "estimated_on_all", lambda prepared, candidate: candidate)
    monkeypatch.setattr(sealed, "prove", lambda before, after, *_: proof(gains[after[0]]))
    monkeypatch.setattr(sealed, "_with_form", lambda prepared, found, *_: both if found is stop else None)
    monkeypatch.setattr(sealed, "without_the_needless", lambda prepared, full: cubic if needless else full)
    stage: Any = SimpleNamespace(
        surrogate=None, deadline=unlimited(), split=SimpleNamespace(sealed=()), settle_s=1.0, predictor=None, fit=None
    )
    held = sealed.hold_leader(stage, stage, [stop], [stop, cubic], 1)
    assert held.sets[held.kept].key == named
    assert (held.completed is both) is not needless


def spring(folder: Path, k2: float, k3: float) -> Path:
    """Write a recording of a spring with quadratic and cubic parts, integrated here by Runge and Kutta's rule."""
    rng = np.random.default_rng(8)
    push = np.repeat(12.0 * rng.standard_normal(ROWS // 8), 8)
    x, y, h = np.zeros(2), np.empty(ROWS), STEP / FINE

    def slope(x: Any, u: float) -> Any:
        return np.array([x[1], u - 0.8 * x[1] - 40.0 * x[0] - k2 * x[0] ** 2 - k3 * x[0] ** 3])

    for k in range(ROWS):
        y[k] = x[0]
        for _ in range(FINE):
            a = slope(x, push[k])
            b = slope(x + 0.5 * h * a, push[k])
            c = slope(x + 0.5 * h * b, push[k])
            x = x + h / 6 * (a + 2 * b + 2 * c + slope(x + h * c, push[k]))
    y += 1e-3 * np.std(y) * rng.standard_normal(ROWS)
    for name, text in (("model.toml", MASS), ("case.toml", CASE), ("roles.toml", ROLES)):
        (folder / name).write_text(text)
    rows = np.column_stack([STEP * np.arange(ROWS), push, y])
    np.savetxt(folder / "recording.csv", rows, "%.9g", ",", header="time_s,push,position", comments="")
    return folder


@pytest.mark.diagnosis
def test_a_cubic_spring_that_is_a_little_stiffer_to_one_side_has_one_name(tmp_path: Path) -> None:
    found = study(load_case(spring(tmp_path, k2=4.0, k3=60.0)), sham=0, seed=1, progress=lambda *_: None)
    told = diagnose(found)
    assert [e["id"] for e in told["effects"]] == ["cubic_stiffness"], told["statement"]
    assert found.completed is not None
    form = found.completed.attachments[-1]
    assert form.key == f"{KIN} quadratic_stiffness state:v"
    assert found.completed.values[form.key]["k2"][0] == pytest.approx(4.0, rel=0.1)
    assert told["effects"][0]["parameters"]["k3"]["value"] == pytest.approx(60.0, rel=0.03)
    assert "grows with the square" in told["statement"] and "no catalogue entry" not in told["statement"]
