"""Laws of when the model without any effect predicts as well as any need be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import aeolid.diagnose.validation.adequate as adequate
from aeolid.diagnose.validation import proof
from aeolid.diagnose.validation.proof import Proof


def proof_of(errors: dict[str, list[float]]) -> Proof:
    """Return a proof whose errors before are these: over the settling time, then by horizon."""
    profile = {k: {"steps": [1.0], "before": v[1:], "after": v[1:]} for k, v in errors.items()}
    first = {k: v[0] for k, v in errors.items()}
    return Proof(0.0, (0.0, 0.0), np.zeros(1), first, first, 1.0, profile, {}, {}, False)


@pytest.mark.parametrize(
    ("sealed", "seen", "static", "said"),
    [
        ([0.01, 0.004, 0.018], [0.012, 0.004, 0.019], False, True),
        ([0.01, 0.004, 0.031], [0.012, 0.004, 0.019], False, False),  # of a drive train's torsion, far ahead only
        ([0.01, 0.004, 0.018], [0.012, 0.004, 0.2], False, False),  # what the sealed data do not reach
        ([0.01, 0.004, 0.031], [0.012, 0.004, 0.2], True, True),  # horizons of a static law are its noise's
        ([0.04, 0.004, 0.018], [0.012, 0.004, 0.019], True, False),
    ],
)
def test_every_part_and_horizon_counts(
    sealed: list[float], seen: list[float], static: bool, said: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The worst of all outputs decides, on the sealed data and on those of fit and selection."""
    left = [proof_of({"angle": [0.001, 0.001, 0.001], "speed": seen}), proof_of({"speed": sealed})]
    monkeypatch.setattr(adequate, "prove", lambda *anything: left.pop())
    monkeypatch.setattr(adequate, "seen_before", lambda segments, settle_s: list(segments))
    monkeypatch.setattr(adequate, "is_static", lambda prepared: static)
    split = SimpleNamespace(fit=("a",), select=("b",), sealed=("c",))
    prepared: Any = SimpleNamespace(surrogate=None, split=split, settle_s=1.0)
    bare: Any = SimpleNamespace(predictor=None, fit=None)
    assert adequate.is_adequate_alone(prepared, bare, 1) is said
    assert not adequate.is_adequate_alone(SimpleNamespace(surrogate="run"), bare, 1)  # type: ignore[arg-type]


def test_no_horizon_is_longer_than_what_one_piece_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three pieces of 300 rows an error 500 rows ahead was told as a million times the spread."""
    monkeypatch.setattr(proof, "errors_ahead", lambda run, k: np.array([0.1]))
    pieces = [SimpleNamespace(y=np.zeros((300, 1)), burn=20)] * 9
    run: Any = SimpleNamespace(predictor=SimpleNamespace(segments=pieces))
    assert proof._profile([run, run], np.zeros((2520, 1)), ["y"])["y"]["steps"][-1] == 200.0
