"""Hold an innovation-form state-space model and its JSON file."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models.recursion import run_states
from aeolid.record import check_keys

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signal:
    """Name a model's input, output or state; `offset` is the operating point the model is a deviation from."""

    name: str
    unit: str = ""
    offset: float = 0.0


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

        def rows(m: Array | None) -> Any:
            return None if m is None else m.tolist()

        def named(signals: tuple[Signal, ...]) -> list[dict[str, Any]]:
            return [{"name": s.name, "unit": s.unit} | ({"offset": s.offset} if s.offset else {}) for s in signals]

        return {
            "kind": "state_space",
            "sample_time_s": self.sample_time_s,
            "inputs": named(self.inputs),
            "outputs": named(self.outputs),
            "states": named(self.states),
            "A": rows(self.A),
            "B": rows(self.B),
            "C": rows(self.C),
            "D": rows(self.D),
            "K": rows(self.K),
            "x0": rows(self.x0),
            "innovation_covariance": rows(self.innovation_covariance),
            "scheduling": None,
        }

    def with_noise(self, K: Array, covariance: Array) -> StateSpace:
        """Return the same model with a Kalman gain (n, l) and an innovation covariance (l, l)."""
        return replace(self, K=K, innovation_covariance=covariance)


def from_json(data: dict[str, Any], source: str) -> StateSpace:
    """Build the model from the content of model.json; raises DataError that names the key."""
    if data.get("kind") != "state_space":
        raise DataError(f"{source}: kind is {data.get('kind')!r}, 'state_space' is needed")
    if data.get("scheduling"):
        raise DataError(f"{source}: a scheduled (LPV) model; a linear time-invariant one is needed here")
    for key in ("A", "B", "C", "inputs", "outputs", "sample_time_s"):
        if key not in data:
            raise DataError(f"{source}: key {key!r} is missing")
    inputs, outputs = (_signals(data[k], k, source) for k in ("inputs", "outputs"))
    n = len(data["A"]) if isinstance(data["A"], list) else -1
    r, m = len(inputs), len(outputs)
    A = _matrix(data, "A", (n, n), source)
    states = _signals(data.get("states") or [{"name": f"x{i + 1}", "unit": ""} for i in range(n)], "states", source)
    if len(states) != n:
        raise DataError(f"{source}: {len(states)} states are named, A has {n}")
    D = _matrix(data, "D", (m, r), source) if data.get("D") is not None else np.zeros((m, r))
    K = _matrix(data, "K", (n, m), source) if data.get("K") is not None else None
    S = data.get("innovation_covariance")
    covariance = _matrix(data, "innovation_covariance", (m, m), source) if S is not None else None
    x0 = _matrix({"x0": [[v] for v in data["x0"]]}, "x0", (n, 1), source)[:, 0] if data.get("x0") else np.zeros(n)
    sample_time = data["sample_time_s"]
    if not isinstance(sample_time, int | float) or not 0 <= sample_time < 1e6:
        raise DataError(f"{source}: sample_time_s = {sample_time!r} is not a time in seconds (0 for continuous time)")
    return StateSpace(
        A, _matrix(data, "B", (n, r), source), _matrix(data, "C", (m, n), source), D, K, x0, covariance,
        float(sample_time), inputs, outputs, states,
    )  # fmt: skip


def load(path: str | Path) -> StateSpace:
    """Read model.json; raises DataError that names file and key."""
    return from_json(read_json(path), str(path))


def read_json(path: str | Path) -> dict[str, Any]:
    """Read a JSON object; raises DataError that names the file."""
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise DataError(f"{path}: not valid JSON: {error}") from None
    if not isinstance(data, dict):
        raise DataError(f"{path}: a JSON object is needed, found {type(data).__name__}")
    return data


def _signals(entries: Any, key: str, source: str) -> tuple[Signal, ...]:
    if not isinstance(entries, list):
        raise DataError(f"{source}: {key} is not a list")
    result = []
    for i, entry in enumerate(entries):
        entry = {"name": entry} if isinstance(entry, str) else entry
        check_keys(entry, {"name", "unit", "offset"}, f"{source} {key}[{i}]")
        if not isinstance(entry.get("name"), str):
            raise DataError(f"{source}: {key}[{i}] has no name")
        result.append(Signal(entry["name"], str(entry.get("unit", "")), float(entry.get("offset", 0.0))))
    return tuple(result)


def _matrix(data: dict[str, Any], key: str, shape: tuple[int, int], source: str) -> Array:
    try:
        value = np.array(data[key], dtype=float)
    except (ValueError, TypeError):
        raise DataError(f"{source}: {key} is not a matrix of numbers") from None
    if value.size == 0 and 0 in shape:
        value = np.zeros(shape)
    if value.shape != shape:
        raise DataError(f"{source}: {key} is {'x'.join(map(str, value.shape))}, needed is {shape[0]}x{shape[1]}")
    if not np.all(np.isfinite(value)):
        raise DataError(f"{source}: {key} holds a value that is not finite")
    return value
