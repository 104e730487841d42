"""Hold the part that chooses between models to what is known of it: its beginning, and that no drawn cell judges."""

from dataclasses import replace

import numpy as np
import pytest

import aeolid as ae
from aeolid.errors import NotIdentifiable
from aeolid.identify.chain import Chain, predict_cells
from aeolid.identify.choices import Choices, with_choices_made
from aeolid.identify.choose_past import NEAR, check_window, ladder_of, shows
from aeolid.identify.missing import Completed, complete
from aeolid.identify.split import FIT_PART, border, cut
from aeolid.identify.truncation import WindowCheck, WindowFit
from aeolid.identify.windows import factorise, find_scaling
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Channel, Record

STEP, HERTZ, DAMPING = 0.1, (0.6, 1.7), (0.05, 0.03)
CHANNELS = (Channel("u", "", "input"), Channel("y", "", "output"))


def two_modes(samples: int, seed: int, noise: float = 0.1) -> Record:
    """Return a recording of two modes under a white input, white measurement noise."""
    random, poles = np.random.default_rng(seed), []
    for f, d in zip(HERTZ, DAMPING, strict=True):
        poles.append(np.exp(2 * np.pi * f * STEP * complex(-d, np.sqrt(1 - d * d))))
    u, x, y = random.standard_normal(samples), np.zeros(2, complex), np.empty(samples)
    for k in range(samples):
        y[k] = 2 * (x.real @ np.array([1.0, 0.7])) + noise * random.standard_normal()
        x = np.array(poles) * x + np.array([1.0, 0.6j]) * u[k]
    return Record(STEP * np.arange(samples), np.column_stack([u, y]), CHANNELS, STEP, "modes.csv", "0" * 64)


def without(record: Record, rows: slice, column: int = 1) -> Record:
    values = record.values.copy()
    values[rows, column] = np.nan
    return replace(record, values=values)


def test_a_complete_recording_is_cut_at_seventy_percent() -> None:
    z = np.random.default_rng(0).standard_normal((1001, 3))
    assert border(z, 20) == round(FIT_PART * 1001)
    assert border(z[:5], 20) == round(FIT_PART * 5)  # shorter than a window


@pytest.mark.parametrize(("first", "last"), [(0, 650), (690, 1000), (300, 600)])
def test_the_cut_goes_with_the_samples_that_are_there(first: int, last: int) -> None:
    """Missing rows at either end move it as cutting them off does; samples that no whole window holds do not count."""
    z = np.random.default_rng(1).standard_normal((1000, 2))
    z[:first, 1], z[last:, 1] = np.nan, np.nan
    assert border(z, 20) == first + border(z[first:last], 20)
    broken = z.copy()
    apart = np.r_[0 : max(first - 1, 0), min(last + 1, 1000) : 1000]
    broken[apart, 1] = np.where(apart % 10, 1.0, np.nan)
    assert border(broken, 20) == border(z, 20)


def test_a_long_quiet_start_does_not_fill_the_fit_part() -> None:
    z = np.random.default_rng(2).standard_normal((1000, 2))
    z[:750, 0] = z[0, 0]
    assert abs(border(z, 20) - (750 + round(FIT_PART * 250))) <= 1
    z[:, 0] = z[0, 0]  # never moves: nothing to wait for
    assert border(z, 20) == 700


def test_both_parts_together_hold_every_window_once() -> None:
    record = without(simulate_fourth_order(900, 1), slice(400, 700))
    scaling = find_scaling([record])
    heads, tails = cut([record], scaling, 8)
    parts = factorise(heads, scaling, 8).merge(factorise(tails, scaling, 8))
    whole = factorise([record], scaling, 8)
    assert parts.windows == whole.windows
    np.testing.assert_allclose(parts.R.T @ parts.R, whole.R.T @ whole.R, atol=1e-8 * whole.windows)


@pytest.mark.parametrize("rows", [slice(1000, None), slice(0, 520)])
def test_a_sensor_lost_or_late_costs_nothing_but_its_samples(rows: slice) -> None:
    """The answer is that of the recording cut by hand, window, order and modes."""
    record = two_modes(1500, 3)
    kept = np.ones(1500, bool)
    kept[rows] = False
    where = np.flatnonzero(kept)
    lost, cut_off = (ae.identify(r) for r in (without(record, rows), record.slice(where[0], where[-1] + 1)))
    assert lost.state_space.order == cut_off.state_space.order == 4
    for one, other in zip(lost.result.modes, cut_off.result.modes, strict=True):
        assert one.frequency_hz == pytest.approx(other.frequency_hz, abs=one.frequency_std_hz)


def test_samples_that_never_meet_are_refused_with_the_channel_that_lacks_most() -> None:
    record = without(simulate_fourth_order(300, 1), slice(0, None, 2), 2)
    with pytest.raises(NotIdentifiable, match=r"no two samples in a row hold every channel: 'y1' has 150 of 300"):
        ladder_of(Completed([record]), find_scaling([record]), 10)


def test_cells_are_predicted_from_those_before_alone() -> None:
    """Against the autoregression by hand; nothing after a cell moves it, and an output never moves an input."""
    random = np.random.default_rng(4)
    root = random.standard_normal((2, 2))
    chain = Chain(np.array([np.eye(2), *0.3 * random.standard_normal((2, 2, 2))]), root @ root.T)
    z, missing = random.standard_normal((30, 2)), np.zeros((30, 2), bool)
    missing[10, 1] = missing[11, 0] = True
    found = predict_cells(chain, np.where(missing, 0.0, z), missing, 5, 1)
    mean = -(chain.a[1] @ z[9] + chain.a[2] @ z[8])
    covariance = np.linalg.inv(chain.W)
    np.testing.assert_allclose(found[10, 1], mean[1] + covariance[1, 0] / covariance[0, 0] * (z[10, 0] - mean[0]))
    np.testing.assert_allclose(found[11, 0], -(chain.a[1] @ found[10] + chain.a[2] @ z[9])[0])
    later = z.copy()
    later[12:] += 1.0
    later[11, 1] += 1.0
    again = predict_cells(chain, np.where(missing, 0.0, later), missing, 5, 1)
    np.testing.assert_array_equal(again[:11], found[:11])
    assert again[11, 0] == found[11, 0]


@pytest.mark.parametrize(("every", "samples"), [(3, 1500), (4, 600), (5, 1500)])
@pytest.mark.parametrize("method", ["varx", "varmax"])
def test_a_slower_logger_invents_no_modes(every: int, samples: int, method: str) -> None:
    """Outputs missing at every k-th sample: two modes and no other, each within four deviations of the plant's."""
    record = without(two_modes(samples, 2), slice(0, None, every))
    found = ae.identify(record, past=20, method=method)
    assert found.state_space.order == 4 and abs(np.linalg.eigvals(found.state_space.A)).max() < 1
    for mode, f, d in zip(found.result.modes, HERTZ, DAMPING, strict=True):
        assert abs(mode.frequency_hz - f) < 4 * mode.frequency_std_hz and abs(mode.damping - d) < 4 * mode.damping_std
    assert ae.validate(found, two_modes(1000, 9)).result.free_run.vaf["y"] > 99


def test_cells_missing_by_chance_have_no_pattern() -> None:
    """The model of few states is for patterns; elsewhere the autoregression is left as free as the data allow."""
    record = two_modes(1500, 2)
    values = record.values.copy()
    values[np.random.default_rng(0).random(1500) < 0.2, 1] = np.nan
    assert complete([replace(record, values=values)], 20).trial.states is None
    assert complete([without(record, slice(0, None, 4))], 20).trial.states == 4


def test_poles_of_two_windows_are_one_within_a_fifth_of_their_size() -> None:
    poles = np.exp(np.array([0.1 + 0.0j, -0.02 + 0.5j]))
    fit = WindowFit(30, poles, np.zeros((2, 2, 2)), 0.0)
    assert shows(fit, np.exp(-0.02 + 0.5j * (1 + 0.9 * NEAR)))
    assert not shows(fit, np.exp(-0.02 + 0.5j * (1 + 1.4 * NEAR)))
    assert not shows(fit, np.exp(-0.1 + 0.02j))  # as large as the first one, and decays where that grows


def fitted(past: int, *logs: complex) -> WindowFit:
    """Return a model of these poles, log z, whose deviations are a hundredth of their size."""
    size = np.array([0.01 * abs(p) for p in logs])
    return WindowFit(past, np.exp(np.array(logs)), size[:, None, None] ** 2 * np.eye(2), 0.0)


KNOWN, SLOW, GROWS = -0.02 + 0.5j, -0.01 + 0.09j, 0.02 + 0.09j


@pytest.mark.parametrize(
    ("twice", "four", "holds"),
    [
        ((KNOWN, SLOW), (KNOWN, SLOW), False),  # both longer windows show a mode that the short one misses
        ((KNOWN, SLOW), (KNOWN,), True),  # one alone does: noise that this window described
        ((KNOWN,), (KNOWN, SLOW), True),
        ((KNOWN, GROWS), (KNOWN, GROWS), True),  # no mode of a machine that ran
        ((KNOWN, -0.09 + 0j), (KNOWN, SLOW), True),  # a real pole of the same size is another one
    ],
)
def test_a_missing_mode_is_told_where_two_longer_windows_show_it(monkeypatch, twice, four, holds) -> None:
    fits = {30: (KNOWN,), 60: twice, 120: four}

    class Steps:
        longest, sample_time_s = 400, 0.1

        def at(self, past):
            return None, past

    def fit_window(whole, halves, through, regularization, order):
        logs = fits[whole]
        return fitted(whole, *(logs if order is None else logs[:order]))

    monkeypatch.setattr("aeolid.identify.choose_past.fit_window", fit_window)
    check = check_window(Steps(), 30, (), "none")
    assert check.holds is holds and check.missed is not holds


def test_modes_that_no_other_window_shows_have_no_bands() -> None:
    """Where nothing longer could be tried, the end of prediction-error steps stands in, but not for such a mode."""
    record = two_modes(1500, 3)
    found = ae.identify(record, past=20).result
    check = WindowCheck(None, 20, 13, None, 0.0, "cannot be said")
    extra = found.extra | {"contrast": {"taken": True, "ended": True, "reason": None}}
    first = np.log(found.modes[0].eigenvalue)
    all_poles = fitted(13, *np.log([m.eigenvalue for m in found.modes]))
    made = [
        with_choices_made(replace(found, extra=extra), Choices(20, (), check=check, others=(others,)))
        for others in (all_poles, fitted(13, first))
    ]
    assert [m.extra["bands_hold"] for m in made] == [True, False]
    assert f"near {found.modes[1].frequency_hz:.3g} Hz is in no model of a past window of 13" in made[1].notes[-1]
