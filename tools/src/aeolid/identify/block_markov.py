"""Estimate the Markov parameters of a whole recording by the block recursions of paper 003, as a filter's file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import UsageError
from aeolid.identify.extended import collect, innovations
from aeolid.identify.lattice import estimate_by_covariance, estimate_by_prediction_error
from aeolid.identify.settings import check_feedthrough
from aeolid.identify.streamed import theta_in_units
from aeolid.identify.windows import find_scaling
from aeolid.record import Record

Array = NDArray[np.float64]
BLOCK_METHODS = {"levinson": estimate_by_covariance, "block-lattice": estimate_by_prediction_error}


@dataclass(frozen=True, eq=False)
class BlockMarkov:
    """Hold what a block recursion made of one recording.

    theta (l, p m + d) in the channels' units, oldest block [u; y] first, present inputs with feedthrough last;
    innovation (N, l) in the outputs' units, NaN where a sample has no complete past window.
    """

    theta: Array
    innovation: Array
    settings: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Return the facts without the long arrays."""
        return {
            "settings": self.settings,
            "outputs": int(self.theta.shape[0]),
            "regressors": int(self.theta.shape[1]),
            "innovation_std": np.nanstd(self.innovation, axis=0).tolist(),
        }

    def summary(self) -> str:
        """Return one line for people."""
        rows, columns = self.theta.shape
        known = int(np.isfinite(self.innovation).all(axis=1).sum())
        return f"{known} samples, {rows} x {columns} Markov parameters by {self.settings['method']}"


def estimate_block(record: Record, *, past: int, method: str, feedthrough: Sequence[str] = ()) -> BlockMarkov:
    """Estimate Ξ of eq. (9) of paper 000 without a regressor matrix: paper 003.

    record: one recording, scaled by its means and deviations, parted at missing samples. past: p ≥ 1. method:
    "levinson", covariances and the recursion of eq. (14) to (21), samples beyond a stretch counted as 0; or
    "block-lattice", forward and backward residuals, eq. (22), sharper on short records and narrow resonances.
    feedthrough: names of inputs whose present value is a regressor.
    Raises UsageError on bad options, NotIdentifiable on constant channels or too few samples.
    Cost: N p m² operations (three times that with "block-lattice"), where least squares takes N p² m².
    """
    if method not in BLOCK_METHODS:
        raise UsageError(f"method {method!r} is none of {', '.join(BLOCK_METHODS)}")
    names = check_feedthrough([record], feedthrough)
    scaling = find_scaling([record], driven=True)
    through = [name in names for name in scaling.inputs]
    theta = BLOCK_METHODS[method]([record], scaling, past, through).theta
    r, outputs = len(scaling.inputs), len(scaling.outputs)
    samples = collect([record], scaling, past)
    width = past * scaling.channels
    blocks = theta[:, :width].reshape(outputs, past, -1)
    padded = np.concatenate([blocks, np.zeros((outputs, past, outputs))], axis=2).reshape(outputs, -1)
    start = np.zeros((len(record), outputs))
    # the predictor of eq. (9) is that of eq. (14) without columns of e
    e = innovations(
        samples, past, np.hstack([padded, theta[:, width:]]), np.zeros(outputs), start, feed_back=False, limit=np.inf
    )
    e = np.where(samples.used(past)[:, None], e * scaling.scale[r : r + outputs], np.nan)
    keep = [*range(width), *(width + i for i in range(r) if through[i])]
    settings = {
        "method": method, "past": past, "model_set": "varx", "sample_time_s": record.sample_time_s,
        "feedthrough": [i for i in range(r) if through[i]],
    }  # fmt: skip
    return BlockMarkov(theta_in_units(theta, scaling, past)[:, keep], e, settings)


def save_block_markov(target: BinaryIO, result: BlockMarkov, record: Record) -> None:
    """Write the content of markov.npz as the filters do, for `identify --markov`."""
    np.savez_compressed(
        target,
        theta=result.theta,
        innovation=result.innovation,
        health=np.uint32(0),
        settings=json.dumps(result.settings),
        inputs=np.array(record.names("input")),
        outputs=np.array(record.names("output")),
        input_units=np.array([record.unit(name) for name in record.names("input")]),
        output_units=np.array([record.unit(name) for name in record.names("output")]),
        source=record.source,
        sha256=record.sha256,
    )
