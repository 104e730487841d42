"""Recordings with missing cells, spikes, drift and offsets lead to the poles that undamaged ones do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.errors import NotIdentifiable, UsageError
from aeolid.identify.chain import Chain, fill
from aeolid.identify.detrend import detrend
from aeolid.identify.result import Identification
from aeolid.identify.spikes import remove_spikes
from aeolid.identify.varx import identify_varx
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
TRUE = 0.04  # damping of the mode
CHANNELS = tuple(Channel(n, "", role) for n, role in (("u", "input"), ("y", "output"), ("w", "output")))


def _plant(samples: int, seed: int, gust: float = 0.0) -> Record:
    """Return a lightly damped mode of 0.5 rad a sample, two outputs, white innovations; gust: one huge innovation."""
    random = np.random.default_rng(seed)
    pole = np.exp(0.5 * complex(-TRUE, np.sqrt(1 - TRUE**2)))
    A = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
    B, C, K = (
        np.array([1.0, 0.5]),
        np.array([[1.0, 0.3], [0.4, -0.8]]),
        np.array([[0.1, 0.05], [0.02, 0.1]]),
    )
    x, out = np.zeros(2), np.empty((samples, 3))
    u, e = random.standard_normal(samples), random.standard_normal((samples, 2))
    e[samples // 2] += gust
    u[samples // 3 :: samples // 3] += gust  # pulses of the input, which the plant follows
    for k in range(samples):
        out[k] = u[k], *(C @ x + e[k])
        x = A @ x + B * u[k] + K @ e[k]
    return Record(np.arange(float(samples)), out, CHANNELS, 1.0, "plant.csv", "0" * 64)


def _damping(result: Identification) -> tuple[float, float]:
    mode = result.modes[0]
    assert mode.damping_std is not None
    return mode.damping, mode.damping_std


def _identify(records: list[Record], **options: str) -> Identification:
    return identify_varx(records, past=25, order=2, **options)


def _without(record: Record, share: float, seed: int = 5) -> Record:
    values = record.values.copy()
    values[np.random.default_rng(seed).random(values.shape) < share] = np.nan
    return replace(record, values=values)


def _with_spikes(record: Record, size: float, count: int = 12) -> tuple[Record, NDArray[np.intp]]:
    random, values = np.random.default_rng(3), record.values.copy()
    at = random.choice(np.arange(50, len(record) - 50), count, replace=False)
    values[at, 1] += size * values[:, 1].std() * random.choice([-1.0, 1.0], count)
    return replace(record, values=values), at


def test_smoother_is_the_normal_distribution_given_the_rest() -> None:
    """The banded solution is that of the dense precision matrix, and draws scatter as it says."""
    random = np.random.default_rng(1)
    a = np.concatenate([np.eye(2)[None], 0.3 * random.standard_normal((2, 2, 2))])
    chain = Chain(a, np.array([[2.0, 0.3], [0.3, 1.0]]))
    samples = 12
    L = np.zeros((2 * (samples + 2), 2 * samples))
    for k in range(samples):
        for s in range(3):
            L[2 * (k + s) : 2 * (k + s) + 2, 2 * k : 2 * k + 2] = a[s]
    Q = L.T @ np.kron(np.eye(samples + 2), chain.W) @ L
    z, missing = random.standard_normal((samples, 2)), random.random((samples, 2)) < 0.4
    M = np.flatnonzero(missing.ravel())
    rest = np.flatnonzero(~missing.ravel())
    expected = -np.linalg.solve(Q[np.ix_(M, M)], Q[np.ix_(M, rest)] @ z.ravel()[rest])
    mean, *draws = fill(chain, z, missing, [np.zeros(len(M)), *np.eye(len(M))])
    assert mean.ravel()[M] == pytest.approx(expected, abs=1e-12)
    assert np.array_equal(mean[~missing], z[~missing])
    roots = np.array([d.ravel()[M] - expected for d in draws])
    assert roots.T @ roots == pytest.approx(np.linalg.inv(Q[np.ix_(M, M)]), abs=1e-12)


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_missing_cells_cost_little(share: float) -> None:
    """With 20 % of the cells missing no window is complete; the answer is the plant's within deviations that know."""
    errors = []
    for seed in range(4):
        _, sigma = _damping(_identify([_plant(3000, seed)]))
        result = _identify([_without(_plant(3000, seed), share, seed + 5)])
        damping, wider = _damping(result)
        errors.append((damping - TRUE) / wider)
        assert sigma < wider < 2.5 * sigma  # the cells that are gone are counted, those that are there are used
        assert result.windows < 2975
        assert f"{result.windows} windows used" in result.summary()
        assert any("missing cells" in note for note in result.notes)
    assert np.sqrt(np.mean(np.square(errors))) < 1.8  # 99 % point of the root of chi-squared with 4 degrees over 4


def test_too_few_windows_are_refused() -> None:
    """Windows that hold no missing cell by chance are no recording: fewer than 10 a parameter are refused."""
    record = _without(_plant(3000, 1), 0.06)
    with pytest.raises(NotIdentifiable, match=r"a parameter|complete windows"):
        identify_varx([record], past=25, missing="leave-out", order=12)


def test_most_of_a_channel_missing_is_refused() -> None:
    """A channel that is missing more often than not says so."""
    record = _plant(1000, 1)
    record.values[np.random.default_rng(1).random(1000) < 0.6, 1] = np.nan
    with pytest.raises(NotIdentifiable, match="'y' lacks"):
        _identify([record])


def test_long_gaps_stay_gaps() -> None:
    """A gap longer than the past window is left out and costs only its windows."""
    record = _plant(3000, 2)
    full, _ = _damping(_identify([record]))
    record.values[1000:1400, 2] = np.nan
    result = _identify([record])
    assert result.skipped == 425
    assert abs(_damping(result)[0] - full) < 3 * _damping(result)[1]


@pytest.mark.parametrize("size", [5.0, 30.0, 300.0])
def test_spikes_are_found_and_nothing_else(size: float) -> None:
    """All spikes are marked, and no other cell."""
    record, at = _with_spikes(_plant(3000, 4), size)
    cleaned = remove_spikes([record], 25)
    gone = ~np.isfinite(cleaned.records[0].values)
    assert np.array_equal(np.flatnonzero(gone[:, 1]), np.sort(at))
    assert gone.sum() == 12 and "y 12" in cleaned.note


def test_spikes_do_not_change_a_damping() -> None:
    """Twelve spikes taken for missing shift the damping by less than a tenth of what they do where they are kept."""
    record = _plant(3000, 4)
    clean, sigma = _damping(_identify([record]))
    spoilt, _ = _with_spikes(record, 30.0)
    (found, deviation), (kept, _) = _damping(_identify([spoilt])), _damping(_identify([spoilt], robust="never"))
    assert abs(found - clean) < 0.1 * abs(kept - clean)
    assert deviation < 1.2 * sigma


def test_gusts_and_pulses_stay() -> None:
    """What the plant itself does, however large, is not thrown away: a gust of 40 deviations, pulses of the input."""
    for seed in range(4):
        cleaned = remove_spikes([_plant(3000, seed, gust=40.0)], 25)
        assert cleaned.cells == 0


@pytest.mark.parametrize("kind", ["linear", "high-pass"])
def test_drift_leaves_the_poles(kind: str) -> None:
    """A drift of ten deviations makes a slow pole of its own; taken off it leaves the plant's."""
    record = _plant(3000, 6)
    clean, sigma = _damping(_identify([record]))
    record.values[:, 1] += 10 * record.values[:, 1].std() * np.linspace(-1, 1, 3000)
    assert abs(_damping(_identify([record], detrend=kind))[0] - clean) < sigma


def test_offsets_of_recordings_do_not_mix() -> None:
    """Recordings about different means are one experiment: by default each has its own."""
    records = [_plant(1000, seed) for seed in range(3)]
    clean, sigma = _damping(_identify(records))
    for i, record in enumerate(records):
        record.values[:, 1] += 50.0 * i
    assert abs(_damping(_identify(records))[0] - clean) < 0.1 * sigma
    assert detrend(records, "none", 25) == records


def test_options_that_do_not_exist() -> None:
    """Unknown words are refused by name."""
    record = _plant(500, 1)
    for option in ("missing", "detrend", "robust"):
        with pytest.raises(UsageError, match=f"{option} 'x' is none of"):
            _identify([record], **{option: "x"})
