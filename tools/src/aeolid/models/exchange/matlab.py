"""Read and write linear models as MATLAB files up to version 7.

Names are those of MATLAB's own ss and idss properties: A, B, C, D, K, Ts, InputName, InputUnit, OutputName, OutputUnit,
StateName, StateUnit, X0, NoiseVariance, InputOffset, OutputOffset; as variables of the file or as fields of its one
structure. Properties that would make another system of the same matrices (E, delays, another unit of time) are refused.
In MATLAB: m = load('model.mat'); s = ss(m.A, m.B, m.C, m.D, m.Ts, 'InputName', m.InputName). Objects of
classes are opaque outside MATLAB and are refused.

The reader of scipy can crash the process on a damaged file, so it runs confined.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from aeolid import output
from aeolid.confined import Failure, Limits, call
from aeolid.confined.limits import MIB
from aeolid.errors import DataError, UsageError
from aeolid.inputs import open_regular, regular_size
from aeolid.models import state_space
from aeolid.models.exchange.matlab_child import DELAYS
from aeolid.models.state_space import StateSpace

_CHILD = "aeolid.models.exchange.matlab_child:read"
_MOST_BYTES = 64 << 20  # MOST_STATES states and as many inputs and outputs, not compressed, take half
_LIMITS = Limits(memory=512 * MIB, cpu_s=60, patience_s=120.0, result=128 * MIB)


def write_mat(path: str | Path, model: StateSpace) -> None:
    """Write a model; its Kalman gain, noise and start only where it has them. Raises UsageError when it cannot."""
    from scipy.io import savemat

    content: dict[str, Any] = {k: getattr(model, k) for k in "ABCD"}
    content |= {"Ts": model.sample_time_s, "X0": model.x0[:, None]}
    content |= {"InputOffset": model.u_offset[:, None], "OutputOffset": model.y_offset[:, None]}
    if model.K is not None:
        content["K"] = model.K
    if model.innovation_covariance is not None:
        content["NoiseVariance"] = model.innovation_covariance
    for kind, signals in (("Input", model.inputs), ("Output", model.outputs), ("State", model.states)):
        content[f"{kind}Name"] = _cells([s.name for s in signals])
        content[f"{kind}Unit"] = _cells([s.unit for s in signals])
    with output.replacing(path) as handle:
        savemat(handle, content, do_compression=True, oned_as="column")


def read_mat_model(path: str | Path, sample_time_s: float | None = None) -> StateSpace:
    """Read a model; sample_time_s where the file has no Ts (MATLAB's −1 is none). Raises DataError naming the entry."""
    content = _content(path)
    for name in ("A", "B", "C"):
        if name not in content:
            raise DataError(f"{path}: no matrix {name}; a model needs A, B, C and Ts as variables or in one structure")
    _refuse_other_systems(path, content)
    # MATLAB has no vectors: a row or column, an empty matrix and a number all are matrices
    n, r, m = np.shape(content["A"])[0], np.shape(content["B"])[-1], np.shape(content["C"])[0]
    data: dict[str, Any] = {"kind": "state_space", "sample_time_s": _sample_time(path, content, sample_time_s)}
    data |= {k: np.asarray(content[k]).tolist() if k in content else None for k in "ABCDK"}
    for key, kind, letter, size in (
        ("inputs", "Input", "u", r),
        ("outputs", "Output", "y", m),
        ("states", "State", "x", n),
    ):
        data[key] = _signals(path, content, kind, letter, size)
    for key, name in (("x0", "X0"), ("innovation_covariance", "NoiseVariance")):
        if np.size(content.get(name, [])):
            data[key] = (np.ravel(content[name]) if key == "x0" else np.asarray(content[name])).tolist()
    data |= {k: None for k in "DK" if np.size(content.get(k, [])) == 0}  # [] is none
    return state_space.from_json(data, str(path))


def _content(path: str | Path) -> dict[str, Any]:
    with open_regular(path) as handle:
        head = handle.read(10)
    if head == b"MATLAB 7.3":
        raise DataError(f"{path}: MATLAB version 7.3; save it with save(..., '-v7')")
    size = regular_size(path)
    if size > _MOST_BYTES:
        raise DataError(f"{path}: {size} bytes, more than the {_MOST_BYTES} that a model may have")
    try:
        facts, matrices = call(_CHILD, {"path": str(Path(path).resolve())}, _LIMITS)
    except (Failure, DataError) as error:
        raise DataError(f"{path}: not a readable MATLAB file: {error}") from None
    for name in facts["strange"]:
        raise DataError(f"{path}: {name} is not a matrix of real numbers")
    return {**facts["texts"], **matrices}


def _refuse_other_systems(path: str | Path, content: dict[str, Any]) -> None:
    """Refuse what `get` of a MATLAB system says beyond A, B, C, D, K and Ts and no model here can hold."""
    E = content.get("E", np.zeros((0, 0)))
    if E.size and (E.shape[0] != E.shape[1] or (np.eye(len(E)) != E).any()):
        raise DataError(f"{path}: a descriptor model, E is not the unit matrix; take ss(sys, 'explicit') of it")
    late = next((name for name in DELAYS if np.any(content.get(name, 0.0))), None)
    if late is not None:
        raise DataError(f"{path}: {late} is not zero; put delays into the states: absorbDelay, or pade for continuous")
    units = [text for text in content.get("TimeUnit", []) if text]
    if units and units[0] != "seconds":
        raise DataError(f"{path}: TimeUnit is {units[0]!r}; take chgTimeUnit(sys, 'seconds') of it")


def _sample_time(path: str | Path, content: dict[str, Any], given: float | None) -> float:
    value = np.ravel(content.get("Ts", []))
    if value.size == 1 and value[0] >= 0:
        if given and value[0] > 0 and abs(given - value[0]) > 1e-9 * given:
            raise UsageError(f"{path}: sample time {given:g} s was asked for, the file's Ts is {value[0]:g} s")
        return float(value[0])
    if given is None:
        raise DataError(f"{path}: no sample time Ts (0: continuous time); add it to the file or give --sample-time")
    return given


def _signals(path: str | Path, content: dict[str, Any], kind: str, letter: str, size: int) -> list[dict[str, Any]]:
    names = content.get(f"{kind}Name") or []
    units = content.get(f"{kind}Unit") or []
    offsets = np.ravel(content.get(f"{kind}Offset", [])).tolist() or [0.0] * size
    for entry, values in (("Name", names), ("Unit", units), ("Offset", offsets)):
        if values and len(values) != size:
            raise DataError(f"{path}: {kind}{entry} has {len(values)} entries, the matrices have {size}")
    labels = [name or f"{letter}{i + 1}" for i, name in enumerate(names or [""] * size)]  # MATLAB: '' is unnamed
    triples = zip(labels, units or [""] * size, offsets, strict=True)
    return [{"name": name, "unit": unit, "offset": offset} for name, unit, offset in triples]


def _cells(texts: list[str]) -> Any:
    """Return a cell array (k, 1) of texts."""
    cells = np.empty((len(texts), 1), dtype=object)
    cells[:, 0] = texts
    return cells
