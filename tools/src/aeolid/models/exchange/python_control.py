"""Hand models to python-control and take them from it. The package is optional: pip install 'aeolid[control]'."""

from __future__ import annotations

from typing import Any

import numpy as np

from aeolid.errors import DataError, UsageError
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace


def to_control(model: StateSpace, *, innovations: bool = False) -> Any:
    """Return a control.StateSpace with the same matrices, names and sample time.

    With `innovations` the innovations are further inputs e_<output>, entering by K and the unit matrix. Units and
    operating points have no place there: signals are deviations. Raises UsageError where python-control is absent or
    the model has no Kalman gain to show.
    """
    try:
        import control
    except ImportError:
        raise UsageError("python-control is not installed; install it with: pip install 'aeolid[control]'") from None
    B, D = model.B, model.D
    inputs = [s.name for s in model.inputs]
    if innovations:
        if model.K is None:
            raise UsageError("the model has no Kalman gain, so it has no innovations to show as inputs")
        B, D = np.hstack([B, model.K]), np.hstack([D, np.eye(len(model.outputs))])
        inputs += [f"e_{s.name}" for s in model.outputs]
    return control.StateSpace(
        model.A, B, model.C, D, model.sample_time_s, inputs=inputs,
        outputs=[s.name for s in model.outputs], states=[s.name for s in model.states],
        remove_useless_states=False,
    )  # fmt: skip


def from_control(system: Any, *, sample_time_s: float | None = None) -> StateSpace:
    """Take the matrices, names and time base of a control.StateSpace; without units, noise model and offsets.

    sample_time_s is needed where the system's own time base is unspecified (None) or of unknown step (True). Raises
    DataError where the object is no state space or its numbers are not finite, UsageError where times contradict.
    """
    if not all(hasattr(system, name) for name in ("A", "B", "C", "D", "dt", "input_labels")):
        raise DataError(f"a control.StateSpace is needed, found {type(system).__name__}; control.ss(…) converts it")
    A, B, C, D = (np.asarray(getattr(system, name), dtype=float) for name in "ABCD")
    for name, matrix in zip("ABCD", (A, B, C, D), strict=True):
        if not np.isfinite(matrix).all():
            raise DataError(f"matrix {name} of the control system holds a value that is not finite")
    inputs, outputs, states = (
        tuple(Signal(str(label)) for label in labels)
        for labels in (system.input_labels, system.output_labels, system.state_labels)
    )
    step = _sample_time(system.dt, sample_time_s)
    return StateSpace(A, B, C, D, None, np.zeros(len(A)), None, step, inputs, outputs, states)


def _sample_time(own: float | bool | None, given: float | None) -> float:
    if given is not None and not 0 <= given < 1e6:
        raise UsageError(f"sample_time_s = {given:g} is not a time in seconds (0: continuous time)")
    if own is None or own is True:
        if given is None:
            raise UsageError("the control system does not say its sample time; give sample_time_s (0: continuous time)")
        return float(given)
    if given is not None and given != own:
        raise UsageError(f"sample_time_s = {given:g} contradicts the control system's own {own:g} s")
    return float(own)
