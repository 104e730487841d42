"""Spread and null of projected residuals by blocks: laws on white noise, bursts, and changing variance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import sqrtm

from aeolid.diagnose.stats.blocks import Array, Blocks, blocks_of, redrawn, shares_of, standardiser


def directions(rows: int, inside: slice, count: int, seed: int) -> Array:
    """Return orthonormal columns (rows, count) that live in a part of the rows only."""
    H = np.zeros((rows, count))
    H[inside] = np.random.default_rng(seed).standard_normal((len(range(rows)[inside]), count))
    return np.linalg.qr(H)[0]


def test_blocks_hold_whole_samples_and_each_prior_row_alone() -> None:
    blocks = blocks_of(1000, 3, 2, seed=1, draws=7)
    assert blocks.weights.shape == (7, len(blocks.starts))
    assert blocks.starts[0] == 0 and list(blocks.starts[-2:]) == [3000, 3001]
    assert set(np.diff(blocks.starts[:-2])) == {30}  # ten samples of three outputs


def test_shares_are_those_of_the_residuals_own_algebra() -> None:
    """Hᵦᵀ (I − Hᵦ Hᵦᵀ)^(−1/2) wᵦ in the space of the rows is what the code solves in the space of the directions."""
    H, r = directions(240, slice(20, 75), 3, 2), np.random.default_rng(3).standard_normal(240)
    blocks = blocks_of(120, 2, 0, seed=1, draws=1)
    w, ends = r - H @ (H.T @ r), [*blocks.starts[1:], 240]
    expected = []
    for a, b in zip(blocks.starts, ends, strict=True):
        h = H[a:b]
        expected.append(h.T @ np.linalg.solve(np.real(sqrtm(np.eye(b - a) - h @ h.T)), w[a:b]))
    np.testing.assert_allclose(shares_of(H, r, blocks), expected, atol=1e-9)


@pytest.mark.parametrize("inside", [slice(None), slice(100, 130), slice(100, 400)])
def test_the_spread_of_white_noise_is_one_however_few_blocks_a_direction_lives_in(inside: slice) -> None:
    """The mean of 2000 covariances is I within four of its own deviations; without the root it is far below."""
    H, rng, blocks = directions(1000, inside, 2, 4), np.random.default_rng(5), blocks_of(1000, 1, 0, 1, 1)
    found = np.array([(s := shares_of(H, rng.standard_normal(1000), blocks)).T @ s for _ in range(2000)])
    mean, error = found.mean(axis=0), found.std(axis=0) / np.sqrt(len(found))
    assert np.all(np.abs(mean - np.eye(2)) < 4 * error), (mean, error)


def test_a_direction_within_one_block_has_the_spread_of_white_noise() -> None:
    """Its one block says nothing of its spread: nothing is divided by zero, and nothing stands out for it."""
    H, r = directions(1000, slice(100, 108), 1, 6), np.random.default_rng(7).standard_normal(1000)
    blocks = blocks_of(1000, 1, 0, 1, 1)
    shares = shares_of(H, r, blocks)
    assert np.all(np.isfinite(shares))
    np.testing.assert_allclose(np.abs(standardiser(shares.T @ shares)), 1.0)


def test_noise_that_rises_with_an_effect_does_not_speak_for_it() -> None:
    """Gusts: residuals five times as large where the direction is. |p|² alone passes its 1 % point in most draws."""
    rng, blocks = np.random.default_rng(8), blocks_of(4000, 1, 0, 1, 1)
    envelope = np.where((np.arange(4000) // 200) % 4 == 0, 5.0, 1.0)
    H = directions(4000, slice(None), 1, 9) * envelope[:, None]
    H /= np.linalg.norm(H)
    plain, fair = [], []
    for _ in range(400):
        r = envelope * rng.standard_normal(4000)
        p = float((H.T @ r)[0])
        plain.append(p**2)
        shares = shares_of(H, r, blocks)
        fair.append(float((p * standardiser(shares.T @ shares)[0, 0]) ** 2))
    limit = 6.635  # 99 % point of chi² with one degree
    assert np.mean(np.array(plain) > limit) > 0.4
    assert np.mean(np.array(fair) > limit) < 0.035  # 1 % and 4.6 deviations of 400 draws; few blocks cost a little


@pytest.mark.parametrize("size", [0.1, 1.0, 3.0])
def test_weights_give_back_the_spread(size: float) -> None:
    """The null's covariance over many draws of weights is that of the shares, standardised: I, at any size."""
    H, r = directions(3000, slice(None), 2, 10), np.random.default_rng(11).standard_normal(3000) * size
    blocks = blocks_of(3000, 1, 0, 1, 20000)
    shares = shares_of(H, r, blocks)
    null = redrawn(shares, blocks)
    np.testing.assert_allclose(np.cov(null.T), np.eye(2), atol=0.05)


def test_scores_never_grow_by_a_spread_below_white_noise() -> None:
    small = Blocks(np.array([0, 50]), np.ones((1, 2)), np.ones((1, 2)))
    H = directions(100, slice(None), 1, 12)
    shares = shares_of(H, 1e-3 * np.random.default_rng(13).standard_normal(100), small)
    assert float(np.abs(standardiser(shares.T @ shares)[0, 0])) == 1.0
