"""Plants that nobody chose, with their true linear model, as cases of one recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from random_plants import STEP, draw_plant
from scipy.signal import lfilter

from aeolid.diagnose.data.case import Case
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
SAMPLES, NOISE = 1500, 0.2  # innovations over the spread that the inputs give
UNITS = ("deg", "kN m"), ("rpm", "m/s^2")


def draw_case(seed: int, *, lag: float = 0.0, mean: float = 0.0) -> tuple[Case, Array, Array]:
    """Draw a plant of two inputs and outputs, its true model, and a recording in which input 1 may come behind a lag.

    lag: samples; mean: about which the inputs move, in their spreads.
    """
    rng = np.random.default_rng(seed)
    plant = draw_plant(rng, 4, 2, 2)
    u = np.cumsum(rng.standard_normal((SAMPLES, 2)), axis=0)
    u = u - np.asarray(lfilter([0.02], [1, -0.98], u, axis=0)) + mean
    acting = u.copy()
    if lag:
        keep = np.exp(-1 / lag)
        acting[:, 0] = u[0, 0] + np.asarray(lfilter([1 - keep], [1, -keep], u[:, 0] - u[0, 0]))
    model = StateSpace(
        plant.A, plant.B, plant.C, np.zeros((2, 2)), None, np.zeros(4), None, STEP,
        tuple(Signal(f"u{j}", UNITS[0][j]) for j in range(2)), tuple(Signal(f"y{j}", UNITS[1][j]) for j in range(2)),
        tuple(Signal(f"x{j}") for j in range(4)),
    )  # fmt: skip
    clean = model.simulate(acting)
    e = NOISE * clean.std(axis=0) * rng.standard_normal((SAMPLES, 2))
    noisy = replace(model, B=plant.K).simulate(e)
    return as_case(model, u, clean + noisy + e), u, clean + noisy + e


def as_case(model: StateSpace, u: Array, y: Array) -> Case:
    """Return a case of one recording."""
    channels = tuple(
        Channel(s.name, s.unit, role)
        for role, signals in (("input", model.inputs), ("output", model.outputs))
        for s in signals
    )
    record = Record(STEP * np.arange(len(u)), np.hstack([u, y]), channels, STEP, "drawn.csv", "0" * 64)
    return Case("drawn", (record,), "state_space", model, "model.json", "0" * 64, {}, Path())
