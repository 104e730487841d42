"""Read and run a functional mock-up unit: what is called in a confined process of its own, and nowhere else.

A unit is a native library of somebody else's; its description is XML. Both get here only what they need.
"""

from __future__ import annotations

import ctypes.util
import importlib
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.confined import Reply
from aeolid.errors import NotIdentifiable

Array = NDArray[np.float64]


def describe(folder: str) -> Reply:
    """Return the variables of an unpacked unit: names, units, causalities, in the order of its description."""
    variables = _description(folder).modelVariables
    facts = [[str(v.name), str(v.unit or ""), str(v.causality or "local")] for v in variables]
    return {"variables": facts}, {}


def simulate(folder: str, inputs: list[str], outputs: list[str], step: float, arrays: dict[str, NDArray[Any]]) -> Reply:
    """Run an unpacked unit from rest; arrays: `u` (N, r), held over each step. Returns `y` (at most N rows, l).

    Raises NotIdentifiable where the unit reports a fault.
    """
    fmpy = _reader()
    u = arrays["u"]
    table = np.zeros(len(u), dtype=[("time", float), *((n, float) for n in inputs)])
    table["time"] = step * np.arange(len(u))
    for name, values in zip(inputs, u.T, strict=True):
        table[name] = values
    try:
        result = fmpy.simulate_fmu(
            folder, model_description=_holding(_description(folder), inputs), input=table, output=outputs,
            start_time=0.0, stop_time=float(table["time"][-1]), output_interval=step, step_size=step,
            record_events=False, validate=False, logger=lambda *_: None,
        )  # fmt: skip
    except Exception as error:  # whatever the unit or its loader reports
        raise NotIdentifiable(f"the unit stopped: {' '.join(str(error).split())[:200]}") from None
    return {}, {"y": np.column_stack([np.asarray(result[name], float) for name in outputs])[: len(u)]}


def _description(folder: str) -> Any:
    return _reader().read_model_description(folder, validate=False)


def _reader() -> Any:
    """Import fmpy without its search for the C library: that writes a file and starts a linker, both forbidden here.

    Without a name it takes the library that this process has loaded, the same one.
    """
    vars(ctypes.util)["find_library"] = lambda name: None
    return importlib.import_module("fmpy")


def _holding(description: Any, inputs: list[str]) -> Any:
    """Return the description with which inputs are held over a step.

    In model exchange the reader draws lines between the samples of what is declared continuous; declared discrete it
    holds them, each change an event. A step of a co-simulation holds them by itself.
    """
    if description.coSimulation is not None:
        return description
    description.modelVariables = [copy(v) for v in description.modelVariables]
    for variable in description.modelVariables:
        if variable.name in inputs:
            variable.variability = "discrete"
    return description
