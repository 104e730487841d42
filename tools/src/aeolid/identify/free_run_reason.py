"""Say why a free run explains little of an output: forces that nobody recorded, or a model that is wrong.

A free run hears the recorded inputs alone. What is left of an output then is the disturbance of the innovation form,
x⁺ = A x + K e, d = C x + e, cov(e) = R, whose variance the model states itself: C P Cᵀ + R with P = A P Aᵀ + K R Kᵀ.
Where the error of the free run has about that variance, the model is as good as its inputs allow; where it is much
larger, the model's slow dynamics or gains are wrong.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from aeolid.identify.fit import Fit
from aeolid.models.state_space import StateSpace

LITTLE, MUCH = 30.0, 60.0  # VAF in percent: of a free run that asks for a word, of a prediction that is good
_LARGER = 3.0  # times the stated variance; that of a slow disturbance is known to about a factor of 2 in a recording
_CONSTANTS = 5.0  # time constants that a recording must hold
_SLOWEST = 1 - 1e-6  # spectral radius beyond which a disturbance has no variance to speak of


def disturbance_variance(model: StateSpace, samples: float = np.inf) -> np.ndarray | None:
    """Return the variance (l,) of each output by disturbances alone; None where the model states none.

    samples: of the recording; poles whose time constants are beyond a fifth of it have no variance within it.
    """
    if model.K is None or model.innovation_covariance is None:
        return None
    if model.order and np.max(abs(np.linalg.eigvals(model.A))) > min(_SLOWEST, np.exp(-_CONSTANTS / samples)):
        return None
    R = np.asarray(model.innovation_covariance)
    P = solve_discrete_lyapunov(model.A, model.K @ R @ model.K.T) if model.order else np.zeros((0, 0))
    variance: np.ndarray = np.diag(model.C @ P @ model.C.T + R)
    return variance


def free_run_reason(model: StateSpace, fit: Fit, inputs: tuple[str, ...]) -> list[str]:
    """Return a sentence or two on the outputs whose free run explains little while their prediction is good."""
    if not inputs:
        return []
    stated = disturbance_variance(model, fit.samples)
    names = [s.name for s in model.outputs]
    free, ahead = fit.free_run, fit.one_step
    poor = [n for n in names if free.vaf[n] < LITTLE and ahead.vaf[n] > MUCH and not free.diverges(n)]
    if not poor or stated is None:
        return []
    expected: list[str] = []
    wrong: list[str] = []
    for name in poor:
        i = names.index(name)
        share, nrmse, step = free.vaf[name], free.nrmse[name], ahead.nrmse[name]
        own = model.innovation_covariance[i][i] if model.innovation_covariance is not None else 0.0
        scale = own / step**2 if step > 0 else np.inf  # variance of the output, by its innovation's share of it
        ratio = nrmse**2 * scale / stated[i] if stated[i] > 0 else np.inf
        text = f"{name} ({share:.0f} %)"
        (wrong if not ratio <= _LARGER else expected).append(text)
    lines = []
    if expected:
        lines.append(
            f"A free run explains little of {', '.join(expected)}: it uses only {_both(inputs)}, and most of what moves"
            " these outputs is none of the inputs (wind? a wrong role?). It errs by as much as the model's own"
            " disturbances, so the model is not wrong by this: judge it by one-step prediction, the deviations of its"
            " modes and aeolid validate. A measured wind as input, where there is one, would explain more."
        )
    if wrong:
        lines.append(
            f"A free run explains little of {', '.join(wrong)}, and errs by more than the model's own disturbances: its"
            " slow dynamics or gains are not determined. Record longer or with a stronger test signal, raise --past, or"
            " ask for --refine."
        )
    return lines


def _both(names: tuple[str, ...]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)
