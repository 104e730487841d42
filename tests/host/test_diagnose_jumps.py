"""Values on which the answer depends in jumps: found by looking closely, with deviations of their own."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.candidates.seen_values import at_round_values, between_jumps, rounded, with_jump_deviations
from aeolid.diagnose.data.case import Case
from aeolid.diagnose.hypotheses.parts.base import Attachment, Slot
from aeolid.diagnose.predictor.fitted import Fit
from aeolid.diagnose.predictor.point import Free, shifted
from aeolid.diagnose.predictor.predictor import Predictor
from aeolid.models import equations_file
from aeolid.models.integrate import compile_equations, simulate
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP, BAND = 0.5, 2.0
TANK = """
[model]
name = "tank"
time = "continuous"
[parameters]
tau = { value = 3.0, min = 0.5, max = 20.0, unit = "s", free = true }
[[state]]
name = "x"
derivative = "(u - x)/tau"
unit = "l/min"
[[output]]
name = "flow"
equation = "x"
unit = "l/min"
"""


@pytest.fixture(scope="module")
def stage() -> Prepared:
    """Return the stage of a flow behind a valve that moves when its command has left it by two per cent."""
    rng, rows = np.random.default_rng(11), 1200
    u = 50 + np.cumsum(0.4 * rng.standard_normal(rows))
    stem, held = u[0], np.empty(rows)
    for k in range(rows):
        stem = u[k] if abs(u[k] - stem) > BAND else stem
        held[k] = stem
    model = equations_file.from_toml(tomllib.loads(TANK), TANK, "tank.toml")
    y = simulate(compile_equations(model), held[:, None], model.theta, np.array([u[0]]), STEP)[:, 0]
    y += 0.05 * rng.standard_normal(rows)
    channels = (Channel("u", "%", "input"), Channel("flow", "l/min", "output"))
    record = Record(STEP * np.arange(rows), np.column_stack([u, y]), channels, STEP, "a.csv", "")
    return prepare(Case("tank", (record,), "equations", model, "tank.toml", "", {}, Path()))


def slot_of(attachment: Attachment) -> Slot:
    (slot,) = (s for s in attachment.slots if s.jumps)
    return slot


def held_by(stage: Prepared, width: float) -> tuple[Predictor, Fit, Free, Attachment]:
    """Return the predictor with the dead band in it, and its fit with the band held at a width."""
    (own,) = (a for a in stage.hypotheses if a.entry == "deadband")
    extended = stage.only((own,))
    model = extended.extended
    values = {slot_of(own).name: width} | dict(own.fixed)
    point = shifted(extended.fit.point, model, values)
    free = replace(extended.free, theta=(*extended.free.theta, model.index(slot_of(own).name)))
    fit = extended.predictor.fit(point, replace(free, theta=extended.free.theta), 40)
    assert fit is not None
    return extended.predictor, extended.predictor.at(fit.point, free), free, own


@pytest.mark.parametrize("start", [1.75, 1.9, 2.2])
def test_a_band_is_found_among_the_jumps_of_the_likelihood(stage: Prepared, start: float) -> None:
    """From up to an eighth off; a fit by slopes stays where it is, a hundred nats short and more."""
    predictor, fit, free, own = held_by(stage, start)
    model, slot = predictor.compiled.model, slot_of(own)
    slopes = predictor.fit(fit.point, free, 40)
    assert slopes is not None and abs(float(slopes.point.theta[model.index(slot.name)]) - BAND) > 0.02
    found = between_jumps(predictor, fit, free, (own,))
    assert abs(float(found.point.theta[model.index(slot.name)]) - BAND) < 0.02
    assert found.log_posterior > slopes.log_posterior + 100


def test_its_deviation_is_where_the_likelihood_falls(stage: Prepared) -> None:
    """Slopes say that the data tell nothing of it; two nats are lost within a hundredth of the command's steps."""
    predictor, fit, free, own = held_by(stage, BAND)
    fit = between_jumps(predictor, fit, free, (own,))
    place = free.theta.index(predictor.compiled.model.index(slot_of(own).name))
    assert not np.isfinite(fit.std[place])
    told = with_jump_deviations(predictor, fit, (own,))
    value = float(fit.point.theta[free.theta[place]])
    assert 0 < told.std[place] < 0.02
    assert abs(value - BAND) < 3 * told.std[place] + 0.01
    assert np.array_equal(np.delete(told.std, place), np.delete(fit.std, place))


def test_the_roundest_number_that_fits_as_well_is_told(stage: Prepared) -> None:
    """Between two jumps any value fits as well; one that fits worse by more than a nat is none of them."""
    predictor, fit, free, own = held_by(stage, 1.9)
    index = predictor.compiled.model.index(slot_of(own).name)
    found = between_jumps(predictor, fit, free, (own,))
    told = at_round_values(predictor, found, free, (own,))
    assert float(told.point.theta[index]) == BAND
    assert told.log_posterior > found.log_posterior - 1.0


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -np.inf, 5e-324, 1.7e308])
def test_what_has_no_digits_has_no_round_numbers(value: float) -> None:
    assert rounded(value) == []


@pytest.mark.parametrize("value", [1e-299, 1e299, 9.97, -0.0731])
def test_round_numbers_are_near(value: float) -> None:
    """Within half of the first digit, of half of it, of a tenth of it."""
    found = rounded(value)
    assert found and all(abs(r - value) <= 0.51 * 10.0 ** np.floor(np.log10(abs(value))) for r in found)
    assert abs(found[-1] - value) <= 0.051 * 10.0 ** np.floor(np.log10(abs(value)))
