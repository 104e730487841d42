"""Hold an innovation-form state-space model and its JSON file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models.model_file import (
    Signal,
    read_array,
    read_channels,
    read_covariance,
    read_size,
    read_states,
    read_time_step,
    require_keys,
    write_array,
    write_signals,
)
from aeolid.models.recursion import run_states
from aeolid.text_files import load_json

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StateSpace:
    """Hold x⁺ = A x + B u + K e, y = C x + D u + e (paper 000 eq. (1)); u, y are deviations from the offsets.

    A (n, n), B (n, r), C (l, n), D (l, r), K (n, l) or None where no noise model is known, x0 (n,),
    innovation_covariance (l, l) or None; sample_time_s = 0 is continuous time.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    K: Array | None
    x0: Array
    innovation_covariance: Array | None
    sample_time_s: float
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    states: tuple[Signal, ...]

    @property
    def order(self) -> int:
        """Return the number of states."""
        return int(self.A.shape[0])

    @property
    def u_offset(self) -> Array:
        """Return the operating point (r,) of the inputs."""
        return np.array([s.offset for s in self.inputs])

    @property
    def y_offset(self) -> Array:
        """Return the operating point (l,) of the outputs."""
        return np.array([s.offset for s in self.outputs])

    def simulate(self, u: Array, x0: Array | None = None) -> Array:
        """Run the model free on inputs u (N, r) in the channels' units; returns y (N, l) in theirs."""
        deviation = u - self.u_offset
        start = self.x0 if x0 is None else np.asarray(x0, float)
        states = run_states(self.A, deviation @ self.B.T, start)[:-1]  # (N, n)
        out: Array = states @ self.C.T + deviation @ self.D.T + self.y_offset
        return out

    def to_json(self) -> dict[str, Any]:
        """Return the content of model.json."""
        return {
            "kind": "state_space",
            "sample_time_s": self.sample_time_s,
            "inputs": write_signals(self.inputs),
            "outputs": write_signals(self.outputs),
            "states": write_signals(self.states),
            "A": write_array(self.A),
            "B": write_array(self.B),
            "C": write_array(self.C),
            "D": write_array(self.D),
            "K": write_array(self.K),
            "x0": write_array(self.x0),
            "innovation_covariance": write_array(self.innovation_covariance),
            "scheduling": None,
        }

    def with_noise(self, K: Array, covariance: Array) -> StateSpace:
        """Return the same model with a Kalman gain (n, l) and an innovation covariance (l, l)."""
        return replace(self, K=K, innovation_covariance=covariance)


def from_json(data: dict[str, Any], source: str) -> StateSpace:
    """Build the model from the content of model.json; raises DataError that names the key."""
    if data.get("scheduling"):
        raise DataError(f"{source}: a scheduled (LPV) model; a linear time-invariant one is needed here")
    require_keys(data, ("A", "B", "C", "inputs", "outputs", "sample_time_s"), source)
    inputs, outputs = read_channels(data, source)
    n = read_size(data["A"], "A", source)
    r, m = len(inputs), len(outputs)
    A, B, C = (read_array(data[k], shape, k, source) for k, shape in (("A", (n, n)), ("B", (n, r)), ("C", (m, n))))
    states = read_states(data.get("states"), n, source)
    D = read_array(data["D"], (m, r), "D", source) if data.get("D") is not None else np.zeros((m, r))
    K = read_array(data["K"], (n, m), "K", source) if data.get("K") is not None else None
    covariance = read_covariance(data.get("innovation_covariance"), m, "innovation_covariance", source)
    x0 = np.zeros(n) if data.get("x0") is None else read_array(data["x0"], (n,), "x0", source)
    step = read_time_step(data, source, continuous=True)
    return StateSpace(A, B, C, D, K, x0, covariance, step, inputs, outputs, states)


def load(path: str | Path) -> StateSpace:
    """Read model.json; raises DataError that names file and key."""
    return from_json(read_json(path), str(path))


def read_json(path: str | Path) -> dict[str, Any]:
    """Read a JSON object; raises DataError that names the file."""
    data = load_json(path)
    if not isinstance(data, dict):
        raise DataError(f"{path}: a JSON object is needed, found {type(data).__name__}")
    return data
