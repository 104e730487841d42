"""Identify a periodic plant of known Floquet exponents, and find its modes: python tests/studies/floquet.py [seeds].

Two oscillators, 0.33 Hz with 2 % and 1.0 Hz with 1.5 % of damping, coupled with the cosine and sine of the rotor's
angle at 12.3 rpm, sampled at 10 Hz (48.8 samples a revolution); white input, process noise and noise of the outputs.
Prints bias, scatter, mean deviation told and coverage of 95 % intervals for frequency and damping of each mode.
"""

from __future__ import annotations

import sys

import numpy as np

from aeolid.identify.lpv import identify_lpv
from aeolid.models.floquet import floquet_of
from aeolid.models.floquet_request import analyse
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.model_file import Signal
from aeolid.models.modes import modes_of
from aeolid.record import Channel, Record

STEP, HERTZ = 0.1, 12.3 / 60


def oscillator(hertz: float, damping: float) -> np.ndarray:
    """Return the transition (2, 2) of a mode over a sample."""
    omega = 2 * np.pi * hertz
    size, angle = np.exp(-damping * omega * STEP), omega * np.sqrt(1 - damping**2) * STEP
    return size * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def plant(coupling: float = 0.16) -> LpvStateSpace:
    """Return the plant, four states, one input, two outputs."""
    A = np.zeros((3, 4, 4))
    A[0, :2, :2], A[0, 2:, 2:] = oscillator(0.33, 0.02), oscillator(1.0, 0.015)
    A[1, 1, 2] = A[1, 3, 0] = coupling
    A[2, 1, 3] = A[2, 3, 1] = coupling
    B, C, K = np.zeros((3, 4, 1)), np.zeros((3, 2, 4)), np.zeros((3, 4, 2))
    B[0, :, 0] = [0.1, 0.4, 0.1, 0.5]
    C[0] = [[1.0, 0.0, 0.2, 0.0], [0.1, 0.0, 1.0, 0.0]]
    K[0] = [[0.3, 0.0], [0.1, 0.05], [0.0, 0.3], [0.05, 0.1]]
    names = (Signal("azimuth_cos"), Signal("azimuth_sin"))
    return LpvStateSpace(
        A, B, C, np.zeros((3, 2, 1)), K, np.zeros((3, 4)), np.zeros(4), None, STEP, (Signal("u"),),
        (Signal("tower"), Signal("blade")), tuple(Signal(f"x{i}") for i in range(4)), names,
    )  # fmt: skip


def recording(model: LpvStateSpace, samples: int, seed: int, noise: float = 0.5) -> Record:
    """Return a recording with white innovations of this deviation; the angle begins anywhere."""
    random = np.random.default_rng(seed)
    psi = random.uniform(0, 2 * np.pi) + 2 * np.pi * HERTZ * STEP * np.arange(samples)
    u, e, x = random.standard_normal(samples), noise * random.standard_normal((samples, 2)), np.zeros(4)
    y = np.empty((samples, 2))
    for k in range(samples):
        y[k] = model.C[0] @ x + e[k]
        A = model.A[0] + model.A[1] * np.cos(psi[k]) + model.A[2] * np.sin(psi[k])
        x = A @ x + model.B[0, :, 0] * u[k] + model.K[0] @ e[k]
    channels = (
        Channel("u", "", "input"), Channel("azimuth_cos", "", "scheduling"), Channel("azimuth_sin", "", "scheduling"),
        Channel("tower", "", "output"), Channel("blade", "", "output"),
    )  # fmt: skip
    values = np.column_stack([u, np.cos(psi), np.sin(psi), y])
    return Record(STEP * np.arange(samples), values, channels, STEP, f"seed {seed}", str(seed))


def found_modes(samples: int, seed: int):
    """Return the modes of an identification of one recording."""
    result = identify_lpv([recording(plant(), samples, seed)], past=4, order=4, varying=("A",))
    return analyse(result.model, result.model_json()["identification"])


def main() -> None:
    """Run the study."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    samples = int(sys.argv[2]) if len(sys.argv) > 2 else 1500
    true = floquet_of(plant(), HERTZ)
    print(*(f"true: {m.frequency_hz:.4f} Hz, {100 * m.damping:.3f} %" for m in true.modes))
    averaged = modes_of(plant().frozen(np.zeros(2)))
    print(*(f"poles of the mean matrix: {m.frequency_hz:.4f} Hz, {100 * m.damping:.3f} %" for m in averaged))
    rows = []
    for seed in range(seeds):
        modes = found_modes(samples, seed).modes
        near = [min(modes, key=lambda m, t=t: abs(m.frequency_hz - t.frequency_hz)) for t in true.modes]
        rows.append([(m.frequency_hz, m.frequency_std_hz, m.damping, m.damping_std) for m in near])
        print(seed, *(f"{m.frequency_hz:.4f} {100 * m.damping:.3f}" for m in near), flush=True)
    table = np.array(rows, dtype=float)
    for i, mode in enumerate(true.modes):
        for j, (what, value) in enumerate((("frequency", mode.frequency_hz), ("damping", mode.damping))):
            got, std = table[:, i, 2 * j], table[:, i, 2 * j + 1]
            held = np.mean(abs(got - value) < 1.96 * std)
            print(
                f"{what} {value:.5f}: bias {got.mean() - value:+.2g}, scatter {got.std(ddof=1):.2g}, told "
                f"{np.nanmean(std):.2g}, 95 % intervals hold in {100 * held:.0f} %"
            )


if __name__ == "__main__":
    main()
