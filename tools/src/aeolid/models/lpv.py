"""Hold a state-space model that depends on a measured scheduling sequence, and its JSON file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models.model_file import (
    Signal,
    read_array,
    read_channels,
    read_covariance,
    read_signals,
    read_size,
    read_states,
    read_time_step,
    require_keys,
    write_array,
    write_signals,
)
from aeolid.models.state_space import StateSpace
from aeolid.record import check_keys
from aeolid.text_files import is_short, shown

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LpvStateSpace:
    """Hold x⁺ = A(μ) x + B(μ) u + K(μ) e + b(μ), y = C x + D u + e, eq. (1)–(2) of paper 001.

    M(μ) = M⁽¹⁾ + Σ s_i M⁽ⁱ⁺¹⁾ over the scheduling channels s, in their units. A (m, n, n), B (m, n, r), C (m, l, n),
    D (m, l, r), K (m, n, l) or None, b (m, n); entries after the first are zero for what does not depend on the
    scheduling. u and y are deviations from the offsets of their signals; x0 (n,), innovation_covariance (l, l) or None.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    K: Array | None
    b: Array
    x0: Array
    innovation_covariance: Array | None
    sample_time_s: float
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    states: tuple[Signal, ...]
    scheduling: tuple[Signal, ...]

    @property
    def order(self) -> int:
        """Return the number of states."""
        return int(self.A.shape[1])

    @property
    def u_offset(self) -> Array:
        """Return the operating point (r,) of the inputs."""
        return np.array([s.offset for s in self.inputs])

    @property
    def y_offset(self) -> Array:
        """Return the operating point (l,) of the outputs."""
        return np.array([s.offset for s in self.outputs])

    def frozen(self, scheduling: Array) -> StateSpace:
        """Return the time-invariant model at one operating point, scheduling (m − 1,) in the channels' units.

        Its constant b(μ) is left out: it moves the rest, not the dynamics.
        """
        mu = np.concatenate([[1.0], np.asarray(scheduling, float)])
        A, B, C, D = (np.tensordot(mu, matrix, axes=1) for matrix in (self.A, self.B, self.C, self.D))
        K = None if self.K is None else np.tensordot(mu, self.K, axes=1)
        return StateSpace(
            A, B, C, D, K, self.x0, self.innovation_covariance, self.sample_time_s, self.inputs, self.outputs,
            self.states,
        )  # fmt: skip

    def simulate(self, u: Array, scheduling: Array, x0: Array | None = None) -> Array:
        """Run the model free on inputs u (N, r) and scheduling (N, m − 1), in the channels' units; returns y (N, l)."""
        mu, deviation = with_one(scheduling), u - self.u_offset
        forced = apply_at(self.B, mu, deviation) + mu @ self.b
        states = run_scheduled(self.A, mu, forced, self.x0 if x0 is None else np.asarray(x0, float))[:-1]
        out: Array = apply_at(self.C, mu, states) + apply_at(self.D, mu, deviation) + self.y_offset
        return out

    def to_json(self) -> dict[str, Any]:
        """Return the content of model.json: A, B, K as lists of matrices, C and D too where they are scheduled."""
        return {
            "kind": "state_space",
            "sample_time_s": self.sample_time_s,
            "inputs": write_signals(self.inputs),
            "outputs": write_signals(self.outputs),
            "states": write_signals(self.states),
            "A": self.A.tolist(),
            "B": self.B.tolist(),
            "C": (self.C if self.C[1:].any() else self.C[0]).tolist(),
            "D": (self.D if self.D[1:].any() else self.D[0]).tolist(),
            "K": write_array(self.K),
            "state_constant": self.b.tolist() if self.b.any() else None,
            "x0": self.x0.tolist(),
            "innovation_covariance": write_array(self.innovation_covariance),
            "scheduling": {
                "channels": [s.name for s in self.scheduling],
                "units": [s.unit for s in self.scheduling],
                "first_is_one": True,
            },
        }


def with_one(scheduling: Array) -> Array:
    """Return μ = [1, s] (N, m) from scheduling samples (N, m − 1)."""
    return np.hstack([np.ones((len(scheduling), 1)), scheduling])


def apply_at(matrices: Array, mu: Array, values: Array) -> Array:
    """Return M(μ_k) v_k for each sample: matrices (m, a, b), mu (N, m), values (N, b); returns (N, a)."""
    out = values @ matrices[0].T * mu[:, :1]
    for i in range(1, len(matrices)):
        if matrices[i].any():
            out += values @ matrices[i].T * mu[:, i : i + 1]
    return np.asarray(out)


def run_scheduled(A: Array, mu: Array, forced: Array, x0: Array) -> Array:
    """Return the states x_0 … x_N of x⁺ = A(μ_k) x + f_k: A (m, n, n), mu (N, m), forced (N, n); (N + 1, n).

    An unstable sequence grows as it does; the result may then hold infinities.
    """
    states = np.empty((len(forced) + 1, len(x0)))
    states[0] = x0
    step = 1 << 14  # bounds the memory of the matrices of each sample
    for start in range(0, len(forced), step):
        transition = np.tensordot(mu[start : start + step], A, axes=1)  # (step, n, n)
        for k, matrix in enumerate(transition, start):
            states[k + 1] = matrix @ states[k] + forced[k]
    return states


def from_json(data: dict[str, Any], source: str) -> LpvStateSpace:
    """Build the model from the content of model.json; raises DataError that names the key."""
    require_keys(data, ("A", "B", "C", "inputs", "outputs", "sample_time_s", "scheduling"), source)
    scheduling = _scheduling(data["scheduling"], source)
    inputs, outputs = read_channels(data, source)
    m, r, l_ = 1 + len(scheduling), len(inputs), len(outputs)
    stack = data["A"]
    n = read_size(stack[0] if isinstance(stack, list) and stack else None, "A", source)
    A = _stacked(data, "A", m, (n, n), source)
    states = read_states(data.get("states"), n, source)
    D = _stacked(data, "D", m, (l_, r), source) if data.get("D") is not None else np.zeros((m, l_, r))
    K = _stacked(data, "K", m, (n, l_), source) if data.get("K") is not None else None
    covariance = read_covariance(data.get("innovation_covariance"), l_, "innovation_covariance", source)
    x0 = np.zeros(n) if data.get("x0") is None else read_array(data["x0"], (n,), "x0", source)
    b = data.get("state_constant")
    return LpvStateSpace(
        A, _stacked(data, "B", m, (n, r), source), _stacked(data, "C", m, (l_, n), source), D, K,
        np.zeros((m, n)) if b is None else read_array(b, (m, n), "state_constant", source), x0,
        covariance,
        read_time_step(data, source, continuous=False), inputs, outputs, states, scheduling,
    )  # fmt: skip


def _scheduling(entry: Any, source: str) -> tuple[Signal, ...]:
    check_keys(entry, {"channels", "units", "first_is_one"}, f"{source} scheduling")
    if entry.get("first_is_one") is not True:
        raise DataError(f"{source}: scheduling.first_is_one is {shown(entry.get('first_is_one'))}, true is needed")
    channels = entry.get("channels")
    if not isinstance(channels, list) or not channels:
        raise DataError(f"{source}: scheduling.channels is not a list of channel names")
    units = [""] * len(channels) if entry.get("units") in (None, []) else entry["units"]
    if not isinstance(units, list) or len(units) != len(channels) or not all(map(is_short, units)):
        raise DataError(f"{source}: scheduling.units does not name a unit for each of {len(channels)} channels")
    signals = read_signals(channels, "scheduling.channels", source)
    return tuple(Signal(s.name, s.unit or u) for s, u in zip(signals, units, strict=True))


def _stacked(data: dict[str, Any], key: str, m: int, shape: tuple[int, int], source: str) -> Array:
    """Read a list of m matrices; a single matrix is one that does not depend on the scheduling."""
    value = data[key]
    depth = 0
    while isinstance(value, list) and value:
        value, depth = value[0], depth + 1
    if depth == 2 and 0 not in shape:
        out = np.zeros((m, *shape))
        out[0] = read_array(data[key], shape, key, source)
        return out
    return read_array(data[key], (m, *shape), key, source)
