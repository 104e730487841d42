"""Declared values that move: because they are wrong, or because they stand in for an effect."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from small_cases import SWING, SWING_CHANNELS, write_case

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.candidates.moved import Moved
from aeolid.diagnose.candidates.race import fit_rows
from aeolid.diagnose.conclusion import declared, sentence
from aeolid.diagnose.conclusion.declared import explains_away, far_off, parameter_effect
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.rules import in_force
from aeolid.diagnose.scoring.scores import score_bank
from aeolid.models.equations import Parameter

Array = NDArray[np.float64]
STEP, SAMPLES = 0.02, 2000


def swing(stiffness: float, drag: float) -> Array:
    """Simulate push, position, speed (N, 3): a spring in N/m, a drag in N/(m/s)^2; scipy's RK45, noise on both."""
    rng = np.random.default_rng(4)
    push = np.repeat(rng.uniform(-16.0, 16.0, SAMPLES // 20), 20)
    x, rows = np.zeros(2), np.empty((SAMPLES, 2))
    for i, load in enumerate(push):
        rows[i] = x

        def rate(_: float, x: Array, load: float = float(load)) -> list[float]:
            return [x[1], load - x[1] - stiffness * x[0] - drag * x[1] * abs(x[1])]

        x = solve_ivp(rate, (0.0, STEP), x, rtol=1e-8).y[:, -1]
    return np.column_stack([push, rows + rng.standard_normal((SAMPLES, 2)) * (1e-3, 5e-3)])


@pytest.mark.parametrize(
    ("stiffness", "drag", "moving", "explained"), [(40.0, 0.3, "c", True), (42.0, 0.0, "k", False)],
    ids=["a drag bends the damping", "the stiffness is wrong"],
)  # fmt: skip
def test_an_effect_is_an_answer_only_where_the_declared_values_hold_beside_it(
    stiffness: float, drag: float, moving: str, explained: bool, tmp_path: Path
) -> None:
    prepared = prepare(load_case(write_case(tmp_path, SWING, STEP, SWING_CHANNELS, swing(stiffness, drag))))
    names = [prepared.extended.parameters[i].name for i in prepared.free.theta]
    place = names.index(moving)
    value = prepared.fit.point.theta[prepared.free.theta[place]]
    assert abs(value - {"c": 1.0, "k": 40.0}[moving]) > in_force().evidence.moved_deviations * prepared.fit.std[place]
    bank = score_bank(prepared, prepared.hypotheses, 0)
    rows = [r for r in bank.rows if r.attachment.key == "quadratic_damping state:v"]
    (found,) = fit_rows(prepared, rows)
    assert explains_away(found) is explained


@pytest.mark.parametrize(
    ("value", "std", "said"),
    [(250.0, 20.0, True), (250.0, 60.0, False), (140.0, 1.0, False), (40.0, 5.0, True), (-20.0, 5.0, True)],
)
def test_a_value_that_is_off_by_a_large_factor_may_stand_for_more(value: float, std: float, said: bool) -> None:
    """Of 100 that were declared; one deviation nearer it is still beyond the factor. The next one moved too little."""
    k, c = Parameter("k", 100.0, "N/m", -1e3, 1e3, True), Parameter("c", 0.01, "N s/m", 0.0, 1.0, True)
    text = far_off([Moved(k, value, std), Moved(c, 0.05, 0.03)])
    assert bool(text) is said and "c" not in text.partition(" off ")[0].split()
    assert not said or text.startswith("; k is off by more than a factor of 2")


def test_values_that_are_right_are_not_listed_among_the_wrong_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stiffness 40 % off by 20 deviations, a damping off by one: the effect tells the stiffness alone."""
    k, c = Parameter("k", 100.0, "N/m", 0.0, 1e3, True), Parameter("c", 1.0, "N s/m", 0.0, 10.0, True)
    values = (Moved(k, 140.0, 2.0), Moved(c, 1.1, 0.1))
    monkeypatch.setattr(declared, "moved", lambda study: list(values))
    study: Any = SimpleNamespace(declared_values=values)
    effect = parameter_effect(study)
    assert list(effect["parameters"]) == ["k"] and effect["location"]["entry"] == "parameter:k"


@pytest.mark.parametrize(("weight", "told"), [(0.4, True), (1e-3, False)])
def test_of_a_product_of_constants_it_is_said_that_either_may_be_wrong(
    weight: float, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def value(name: str) -> Any:
        part = SimpleNamespace(entry="parameter_error", key=name)
        return SimpleNamespace(attachments=(part,), says=lambda a: f"the structure is right, but {name} is off")

    first, other = value("K"), value("g")
    monkeypatch.setattr(sentence, "weighed", lambda study, winner: [(other, weight)])
    proof: Any = object()
    study: Any = SimpleNamespace(winner=first, second=None, proof=proof)
    said = sentence._or_values(study, [{"id": "parameter_error"}], proof)
    assert said == (", or g is off: the recording does not tell which" if told else "")
    assert not sentence._or_values(study, [{"id": "parameter_error"}], None)  # of other values than the winner's
    assert not sentence._or_values(study, [{"id": "coulomb_friction"}], proof)
