"""Made-up nodes for the monitor's tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from aeolid.can.description import Description
from aeolid.can.node import Configuration
from aeolid.can.samples import SampleStore
from aeolid.can.snapshots import MarkovSnapshot, SnapshotStore


def describe(
    past: int = 2, inputs: int = 1, outputs: int = 2, model_set: str = "varx", feedthrough: tuple[int, ...] = (),
    names: tuple[str, ...] | None = None,
) -> Description:  # fmt: skip
    m = inputs + outputs
    n = past * (m + (outputs if model_set == "varmax" else 0)) + len(feedthrough)
    generator = np.random.default_rng(1)
    return Description(
        2, 1234, model_set, inputs, outputs, 0, past, n * outputs, 1, 0.1, 1.0, 0.1, feedthrough,
        generator.normal(size=m), np.ones(m), names or tuple(f"c{i}" for i in range(m)), ("",) * m,
    )  # fmt: skip


def configure(d: Description) -> Configuration:
    return Configuration(d, SampleStore(d.channels), SampleStore(d.outputs), SnapshotStore(d))


def snapshot_of(d: Description, theta: np.ndarray, index: int | None) -> MarkovSnapshot:
    return MarkovSnapshot(theta.astype(np.float32), theta, d, True, (), index, 0)


def simulate(d: Description, theta: np.ndarray, samples: int, e: np.ndarray, seed: int = 0) -> tuple[Any, Any]:
    """Run the predictor as a system, sample by sample and term by term: y = Ξ z + e, all about the offsets."""
    u = np.random.default_rng(seed).normal(size=(samples, d.inputs))
    y = np.zeros((samples, d.outputs))
    blank = np.zeros(d.inputs + d.outputs * (2 if d.model_set == "varmax" else 1))
    blocks = [blank] * d.past
    for k in range(samples):
        z = [x for block in blocks[-d.past :] for x in block] + [u[k, i] for i in d.feedthrough]
        y[k] = [sum(a * b for a, b in zip(row, z, strict=True)) for row in theta] + e[k]
        blocks.append(np.concatenate([u[k], y[k], *([e[k]] if d.model_set == "varmax" else [])]))
    return u + d.offset[: d.inputs], y + d.offset[d.inputs : d.inputs + d.outputs]


def small_theta(d: Description, size: float = 0.3) -> np.ndarray:
    return size * np.random.default_rng(7).uniform(-1, 1, (d.outputs, d.regressors)) / d.past
