"""Frequency responses from spectra: true ones within their deviations, coherence, gaps, inputs that are one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

import aeolid as ae
from aeolid.identify.spectral import SpectralEstimate, estimate_spectra
from aeolid.record import Channel, Record

H = 0.05  # s
B, A = (0.0, 0.3, 0.1), (1.0, -1.4, 0.65)  # a mode near 1.6 Hz with a damping of a quarter


def recorded(seed: int, count: int = 4000, noise: float = 0.3, gain: float = 0.5) -> Record:
    """Return two inputs, the second through a gain alone, and an output with coloured noise."""
    rng = np.random.default_rng(seed)
    u, v, e = (rng.normal(size=count) for _ in range(3))
    y = lfilter(B, A, u) + gain * v + noise * lfilter([1.0], [1.0, -0.8], e)
    channels = tuple(Channel(n, "1", r) for n, r in (("u", "input"), ("v", "input"), ("y", "output")))
    return Record(np.arange(count) * H, np.column_stack([u, v, y]), channels, H, "", "")


def true_response(frequency_hz: np.ndarray) -> np.ndarray:
    return np.asarray(freqz(B, A, frequency_hz, fs=1 / H)[1])


def estimated(*records: Record) -> SpectralEstimate:
    found = estimate_spectra(records)
    assert found is not None
    return found


def test_the_true_response_lies_within_its_deviations_as_often_as_they_say() -> None:
    """Gain and phase of both inputs, over 60 recordings; smoothing over a tenth of the frequency is within the rest."""
    held: list[np.ndarray] = []
    for seed in range(60):
        found = estimated(recorded(seed))
        at = slice(None, None, 12)  # averages that share no values
        for column, true in ((0, true_response(found.frequency_hz)), (1, np.full(len(found.frequency_hz), 0.5))):
            g, std = found.response[:, 0, column], found.std[:, 0, column]
            held.append(np.abs(np.abs(g) - np.abs(true))[at] < 1.96 * std[at])
            turn = np.abs(np.angle(g / true))[at]
            held.append(turn < 1.96 * (std / np.abs(g))[at])
    assert 0.92 < np.mean(held) < 0.97


def test_coherence_is_the_share_that_inputs_explain() -> None:
    """Without noise all of it but for how the response turns within an average, near the mode."""
    assert np.all(estimated(recorded(1, noise=0.0)).coherence > 0.9)
    alone = estimated(recorded(1, noise=50.0, gain=0.0))
    assert np.mean(alone.coherence) < 0.3


def test_several_recordings_and_gaps_are_one_estimate() -> None:
    """A gap costs what is missing, and recordings add their values."""
    first, second = recorded(1), recorded(2)
    values = first.values.copy()
    values[1990:2010, 2] = np.nan
    values[100, 2] = np.nan  # what lies in front of it is too short to tell of slow motion
    gap = replace(first, values=values)
    both, broken, whole = estimated(first, second), estimated(gap), estimated(first)
    for found in (both, broken):
        at = found.frequency_hz
        off = np.abs(found.response[:, 0, 0] - true_response(at)) / np.maximum(found.std[:, 0, 0], 1e-12)
        assert np.median(off) < 2.5
    middle = len(whole.averages) // 2
    assert np.interp(1.0, both.frequency_hz, both.averages) > 1.8 * np.interp(1.0, whole.frequency_hz, whole.averages)
    assert np.interp(1.0, broken.frequency_hz, broken.averages) == pytest.approx(
        np.interp(1.0, whole.frequency_hz, whole.averages), rel=0.2
    )
    assert whole.averages[middle] >= 10
    assert broken.frequency_hz[0] < 2.5 * whole.frequency_hz[0]


def test_long_recordings_are_looked_at_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = estimated(recorded(1))
    monkeypatch.setattr("aeolid.identify.spectral._LONGEST", 1500)
    pieces = estimated(recorded(1))
    assert np.interp(2.0, pieces.frequency_hz, pieces.averages) == pytest.approx(
        np.interp(2.0, whole.frequency_hz, whole.averages), rel=0.05
    )
    off = np.abs(pieces.response[:, 0, 0] - true_response(pieces.frequency_hz)) / pieces.std[:, 0, 0]
    assert np.median(off) < 2


@pytest.mark.parametrize("change", ["same", "still"])
def test_inputs_that_cannot_be_told_apart_give_none(change: str) -> None:
    record = recorded(1)
    values = record.values.copy()
    values[:, 1] = 2 * values[:, 0] if change == "same" else 0.0
    assert estimate_spectra([replace(record, values=values)]) is None


def test_short_stretches_and_no_inputs_give_none() -> None:
    record = recorded(1, count=60)
    assert estimate_spectra([record]) is None
    outputs = tuple(Channel(c.name, c.unit, "output") for c in record.channels)
    assert estimate_spectra([replace(record, channels=outputs)]) is None


def test_an_identification_shows_it_beside_its_own() -> None:
    model = ae.identify(recorded(3), past=20)
    told = model.facts["spectral"]
    at, pair = np.array(told["frequency_hz"]), told["pairs"][0]
    assert (pair["input"], pair["output"]) == ("u", "y")
    band = (at > 0.5) & (at < 4)
    assert np.array(pair["gain"])[band] == pytest.approx(np.abs(true_response(at[band])), rel=0.35)
    axes = model.plot_bode()
    assert any(line.get_marker() == "o" for line in axes[0, 0].lines)
