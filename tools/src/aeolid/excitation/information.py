"""Compute the asymptotic information of an experiment on the poles, and from it the Cramér–Rao bound.

For Gaussian innovations the information of N samples on the parameters θ of the predictor is
    N M,   M = E ψ Λ⁻¹ ψᵀ,   ψ = −(dε/dθ)ᵀ        (Ljung, System Identification, 1999, eq. (9.17), (9.31), (13.24)),
with the process noise in y exciting the predictor as the signal does. For the innovation form a change Θ of the
matrices, Θ = [δA δB δK; δC δD 0], changes the errors by ε = −P(z) Θ s, s = [x; u; e], P = [C (zI − A + K C)⁻¹,
I − C (zI − A + K C)⁻¹ K], so that with the spectrum Φ of s
    M = 1/2π ∫ Φ(ω)ᵀ ⊗ (Pᴴ Λ⁻¹ P)(ω) dω      of θ = vec Θ,
which is singular along the n² changes of basis: δA = T A − A T, δB = T B, δK = T K, δC = −C T. The poles do not move
along those; on what is left M is inverted. Φ is that of the signal's answer, by its DFT, and of the noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aeolid.excitation.expected import PoleSpread
from aeolid.excitation.experiment import Experiment
from aeolid.identify.subspace import ScaledModel

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
CHUNK = 2048  # frequencies at a time
LONGEST = 32768  # samples of one transform; longer signals are cut, which what the predictor remembers does not notice
RANK = 1e-12  # of the largest eigenvalue of the information, each parameter in units of its own: below, nothing is told


def information(plant: ScaledModel, experiment: Experiment, answer: Array, feedthrough: tuple[bool, ...]) -> Array:
    """Return N M (f, f), f = (n + l)(n + r + l), over Θ column by column; rows of what is held fixed are zero.

    plant: in the scale of the experiment. answer (N, n + r + l): [x, u, y] that the signal alone causes. feedthrough:
    inputs whose column of D is free. Cost: O(N (n + l)² (n + r + l)²) over chunks of frequencies.
    """
    n, outputs, r = len(plant.A), len(plant.C), plant.B.shape[1]
    size, count = n + r + outputs, -(-len(answer) // LONGEST)
    length = len(answer) // count
    s = np.zeros((count, length, size))  # the errors of the true model hold nothing of the signal
    s[..., : n + r] = answer[: count * length, : n + r].reshape(count, length, n + r)
    lines = np.fft.rfft(s, axis=1) / np.sqrt(length)  # (count, lines, size)
    weight = np.full(lines.shape[1], 2.0)
    weight[0] = 1.0
    if length % 2 == 0:
        weight[-1] = 1.0
    total = np.zeros((size * size, (n + outputs) ** 2))
    for first in range(0, len(weight), CHUNK):
        z = np.exp(2j * np.pi * np.arange(first, min(first + CHUNK, len(weight))) / length)
        here = lines[:, first : first + CHUNK]
        spectrum = count * _noise_spectrum(experiment, z, n + r)
        spectrum += np.einsum("bka,bkc->kac", here, here.conj())
        gain = _gain(plant, z)
        left = (spectrum.conj() * weight[first : first + CHUNK, None, None]).reshape(len(z), -1)
        total += (left.T @ gain.reshape(len(z), -1)).real
    parts = total.reshape(size, size, n + outputs, n + outputs).transpose(0, 2, 1, 3)  # θ: column of Θ, then row
    M: Array = parts.reshape(size * (n + outputs), size * (n + outputs))
    free = _free(n, r, outputs, feedthrough)
    M[~free], M[:, ~free] = 0.0, 0.0
    return M


def _noise_spectrum(experiment: Experiment, z: ComplexArray, channels: int) -> ComplexArray:
    """Return the spectrum (points, n + r + l, ·) of [x; u; e] by the noise alone."""
    F, S = experiment.F, experiment.covariance
    states = np.linalg.solve(z[:, None, None] * np.eye(len(F)) - F, experiment.L[None].astype(complex))
    T = np.concatenate([experiment.H[:channels] @ states + experiment.M[:channels],
                        np.broadcast_to(np.eye(len(S)), (len(z), len(S), len(S)))], axis=1)  # fmt: skip
    out: ComplexArray = T @ S @ T.conj().transpose(0, 2, 1)
    return out


def _gain(plant: ScaledModel, z: ComplexArray) -> ComplexArray:
    """Return Pᴴ Λ⁻¹ P (points, n + l, n + l)."""
    n, outputs = len(plant.A), len(plant.C)
    closed = plant.A - plant.K @ plant.C
    shifted = (z[:, None, None] * np.eye(n) - closed).transpose(0, 2, 1)
    turned = np.linalg.solve(shifted, plant.C.T[None].astype(complex))
    C = turned.transpose(0, 2, 1)  # C (zI − A + K C)⁻¹ (points, l, n)
    P = np.concatenate([C, np.eye(outputs) - C @ plant.K], axis=2)
    out: ComplexArray = P.conj().transpose(0, 2, 1) @ np.linalg.solve(plant.covariance, P)
    return out


def _free(n: int, r: int, outputs: int, feedthrough: tuple[bool, ...]) -> NDArray[np.bool_]:
    """Return which entries of Θ, column by column, are parameters."""
    free = np.ones((n + r + outputs, n + outputs), dtype=bool)
    free[n + r :, n:] = False
    for i, through in enumerate(feedthrough):
        free[n + i, n:] = through
    return free.ravel()


def least_covariance(plant: ScaledModel, M: Array, feedthrough: tuple[bool, ...]) -> PoleSpread:
    """Return the least covariance of the poles that any unbiased estimate has, by the information M.

    Infinite for a pole along whose direction the experiment tells nothing; NaN where A has no eigenvectors.
    """
    n, outputs, r = len(plant.A), len(plant.C), plant.B.shape[1]
    values, right = np.linalg.eig(plant.A.astype(complex))
    covariance = np.full((n, 2, 2), np.nan)
    try:
        left = np.linalg.inv(right)
    except np.linalg.LinAlgError:
        return PoleSpread(values, covariance)
    keep = np.flatnonzero(_free(n, r, outputs, feedthrough))
    size = np.sqrt(np.maximum(M.diagonal()[keep], 0.0))
    size = np.where(size > 0, size, 1.0)
    basis = np.linalg.qr(_basis_changes(plant)[keep] * size[:, None])[0]
    within = np.linalg.qr(np.hstack([basis, np.eye(len(keep))]))[0][:, basis.shape[1] : len(keep)]
    eigenvalues, vectors = np.linalg.eigh(within.T @ (M[np.ix_(keep, keep)] / size[:, None] / size) @ within)
    told = eigenvalues > RANK * eigenvalues[-1]
    for i in range(n):
        gradient = np.zeros((n + r + outputs, n + outputs), dtype=complex)
        gradient[:n, :n] = np.outer(right[:, i], left[i])
        g = within.T @ (gradient.ravel()[keep] / size)
        parts = vectors.T @ np.stack([g.real, g.imag], axis=1)
        lost = float(np.sqrt((parts[~told] ** 2).sum() / (parts**2).sum()))
        scaled = parts[told] / np.sqrt(eigenvalues[told])[:, None]
        covariance[i] = scaled.T @ scaled if lost < 1e-6 else np.diag([np.inf, np.inf])
    return PoleSpread(values, covariance)


def _basis_changes(plant: ScaledModel) -> Array:
    """Return the directions (f, n²) of Θ along which only the basis of the states changes."""
    n, outputs, r = len(plant.A), len(plant.C), plant.B.shape[1]
    out = np.zeros((n * n, n + r + outputs, n + outputs))
    for k in range(n * n):
        T = np.zeros((n, n))
        T.flat[k] = 1.0
        theta = np.zeros((n + outputs, n + r + outputs))
        theta[:n] = np.hstack([T @ plant.A - plant.A @ T, T @ plant.B, T @ plant.K])
        theta[n:, :n] = -plant.C @ T
        out[k] = theta.T
    return out.reshape(n * n, -1).T
