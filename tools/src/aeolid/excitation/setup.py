"""Turn a model, bounds and a request into an experiment that signals can be tried on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.excitation.expected import Method
from aeolid.excitation.experiment import Experiment, experiment_on
from aeolid.excitation.quantities import Bound
from aeolid.identify.subspace import spectral_radius
from aeolid.models.modes import Mode, modes_of
from aeolid.models.state_space import StateSpace
from aeolid.text_files import is_number
from aeolid.units import factor

Array = NDArray[np.float64]
MOST_STATES = 120
MOST_WINDOW = 1200  # numbers in a window of p + 1 samples: some seconds a signal
MOST_ROWS = 1_000_000
HELD = 20.0  # a real pole slower than the duration over this is taken as held at that time constant,
PERIODS = 5.0  # not one that is faster than so many periods of the slowest mode that swings
FAST = 0.45  # of the sample rate: modes above are not designed for


@dataclass(frozen=True, eq=False)
class Setup:
    """Hold a plant of the inputs that move, the experiment on it, and how the recording will be identified.

    chosen: which of the plant's inputs are excited, in the order of the bounds; modes: those that are foretold; rows a
    sample of the model has (row_parts), or samples of the model a row has (row_samples): one of them is 1.
    """

    plant: StateSpace
    controller: StateSpace | None
    experiment: Experiment
    chosen: tuple[int, ...]
    bounds: tuple[Bound, ...]
    modes: tuple[Mode, ...]
    method: Method
    step_s: float
    row_parts: int
    row_samples: int
    notes: tuple[str, ...]

    def samples_of(self, values: Array) -> Array:
        """Return what the plant's inputs (N, r) see of a signal (rows, chosen), at the model's samples."""
        seen = np.repeat(values, self.row_samples, axis=0)
        if self.row_parts > 1:
            whole = len(seen) // self.row_parts * self.row_parts
            seen = seen[:whole].reshape(-1, self.row_parts, values.shape[1]).mean(axis=1)
        out = np.zeros((len(seen), len(self.plant.inputs)))
        out[:, list(self.chosen)] = seen
        return out


def require_plant(model: StateSpace) -> None:
    """Refuse a model that no experiment can be foretold with; raises UsageError or NotIdentifiable."""
    if not model.inputs:
        raise UsageError("the model has no input, so nothing can be excited; identify one with inputs")
    if model.sample_time_s <= 0:
        raise UsageError("a model of continuous time; a sampled one is needed, as aeolid identify writes it")
    if model.K is None or model.innovation_covariance is None:
        raise UsageError(
            "the model has no noise (K and innovation_covariance), so no deviation can be foretold; take one that "
            "aeolid identify has written"
        )
    if model.order == 0 or model.order > MOST_STATES:
        raise UsageError(f"the model has {model.order} states; 1 to {MOST_STATES} are taken")
    if float(np.linalg.eigvalsh(model.innovation_covariance)[0]) <= 0:
        raise NotIdentifiable(
            "the innovation covariance of the model is singular: outputs hang together without noise, and no deviation "
            "can be foretold; leave one of them out"
        )
    if spectral_radius(model.A - model.K @ model.C) >= 1:
        raise NotIdentifiable("the model's predictor A − K C is unstable; identify again with a longer past window")


def read_step(model: StateSpace, wanted: float | None) -> tuple[float, int, int]:
    """Return the seconds a row, rows a sample and samples a row; raises UsageError where neither is whole."""
    h = model.sample_time_s
    if wanted is None:
        return h, 1, 1
    if not (isinstance(wanted, int | float) and 1e-6 <= wanted <= 1e6):
        raise UsageError(f"--sample-time {wanted}: a time in seconds above 0 is needed")
    parts, samples = round(h / wanted), round(wanted / h)
    if samples >= 1 and abs(wanted / h - samples) < 1e-6 * samples:
        return samples * h, 1, samples
    if parts >= 1 and abs(h / wanted - parts) < 1e-6 * parts:
        return h / parts, parts, 1
    raise UsageError(f"--sample-time {wanted:g}: neither a multiple nor a whole part of the model's, {h:g} s")


def set_up(
    model: StateSpace, bounds: tuple[Bound, ...], controller: StateSpace | None, stated: Sequence[Mode],
    facts: Mapping[str, Any] | None, past: int | None, step: tuple[float, int, int], duration_s: float,
) -> Setup:  # fmt: skip
    """Return the set-up of an experiment of about this duration; stated: modes with names, facts: of identification.

    Raises UsageError, DataError or NotIdentifiable where the model or the loop is of no use.
    """
    names = [s.name for s in model.inputs]
    chosen = [names.index(b.name) for b in bounds]
    moved = set(chosen)
    if controller is not None:
        controller = _matched(controller, model)
        moved |= {i for i in range(len(names)) if controller.C[i].any() or controller.D[i].any()}
    keep = sorted(moved)
    plant = replace(
        model, B=model.B[:, keep], D=model.D[:, keep], inputs=tuple(model.inputs[i] for i in keep),
        x0=np.zeros(model.order),
    )  # fmt: skip
    notes = []
    still = [n for i, n in enumerate(names) if i not in moved]
    if still:
        notes.append(f"inputs without a bound are taken as held still: {', '.join(still)}")
    if controller is None:
        slow = min((m.frequency_hz for m in swinging(_modes(model, stated), model.sample_time_s)), default=np.inf)
        plant, held = hold_integrators(plant, max(duration_s / HELD, PERIODS / slow))
        notes += [held] if held else []
    else:
        controller = replace(controller, C=controller.C[keep], D=controller.D[keep])
    try:
        experiment = experiment_on(plant, controller)
    except ValueError as error:
        raise UsageError(f"--controller: {error}; its feedthrough or the model's is too much") from None
    if experiment.radius >= 1:
        raise NotIdentifiable(
            "the model is unstable in open loop; --controller names the linear controller that holds it"
            if controller is None
            else f"the loop of model and controller is unstable (largest pole {experiment.radius:.4f}); its sign, its "
            "units or its sample time do not fit"
        )
    modes = _modes(model, stated)
    through = _feedthrough(facts, plant)
    method = _method(facts, plant, past, through, modes)
    return Setup(plant, controller, experiment, tuple(keep.index(i) for i in chosen), bounds, modes, method, *step,
                 tuple(notes))  # fmt: skip


def hold_integrators(plant: StateSpace, constant_s: float) -> tuple[StateSpace, str]:
    """Return the plant with real poles slower than a time constant moved to it, and what is said.

    Such a pole, a rotor's speed above all, is held by a controller; in open loop it would drift, and its outputs with
    it. The poles that swing stay where they are (on the diagonal of the real Schur form).
    """
    most = math.exp(-plant.sample_time_s / constant_s)
    T, Q = schur(plant.A, output="real")
    alone = [i for i in range(len(T)) if (i == 0 or T[i, i - 1] == 0) and (i == len(T) - 1 or T[i + 1, i] == 0)]
    slow = [i for i in alone if T[i, i] > most]
    if not slow:
        return plant, ""
    T[slow, slow] = most
    A = Q @ T @ Q.T
    held = replace(plant, A=A)
    assert held.K is not None
    if spectral_radius(A - held.K @ held.C) >= 1:
        raise NotIdentifiable("a pole on the unit circle is in the way; identify with --stable, or give --controller")
    count = "a real pole" if len(slow) == 1 else f"{len(slow)} real poles"
    return held, (
        f"{count} slower than {constant_s:.3g} s (an integrator, such as a rotor's speed) is taken as held by a loop "
        "with that time constant; --controller says what the loop really is"
    )


def _matched(controller: StateSpace, model: StateSpace) -> StateSpace:
    """Return the controller from all outputs to all inputs of the model, in its units; raises DataError."""
    h = model.sample_time_s
    if abs(controller.sample_time_s - h) > 1e-6 * h:
        raise DataError(f"controller: its sample time is {controller.sample_time_s:g} s, that of the model {h:g} s")
    y, u = [s.name for s in model.outputs], [s.name for s in model.inputs]
    B, C = np.zeros((controller.order, len(y))), np.zeros((len(u), controller.order))
    D = np.zeros((len(u), len(y)))
    into = [_place("input", s.name, s.unit, y, [o.unit for o in model.outputs]) for s in controller.inputs]
    out = [_place("output", s.name, s.unit, u, [i.unit for i in model.inputs]) for s in controller.outputs]
    for j, (at, ratio) in enumerate(into):
        B[:, at] = controller.B[:, j] / ratio
    for i, (at, ratio) in enumerate(out):
        C[at] = controller.C[i] * ratio
        for j, (source, per) in enumerate(into):
            D[at, source] = controller.D[i, j] * ratio / per
    return replace(controller, B=B, C=C, D=D, inputs=model.outputs, outputs=model.inputs)


def _place(what: str, name: str, unit: str, names: list[str], units: list[str]) -> tuple[int, float]:
    """Return where a controller's channel is among the model's, and the controller's unit over the model's."""
    if name not in names:
        other = "outputs" if what == "input" else "inputs"
        raise DataError(f"controller: its {what} {name!r} is none of the model's {other} {', '.join(names)}")
    at = names.index(name)
    ratio = 1.0 if not unit or not units[at] else factor(unit, units[at])
    if ratio is None:
        raise DataError(f"controller: {name} is in {unit}, the model has it in {units[at]}")
    return at, ratio


def _modes(model: StateSpace, stated: Sequence[Mode]) -> tuple[Mode, ...]:
    """Return the modes below Nyquist, a name given where the file states one near the pole."""
    out = []
    for mode in modes_of(model):
        if abs(mode.eigenvalue) < 1e-6 or mode.is_beyond(model.sample_time_s):
            continue
        near = min(stated, key=lambda m: abs(m.eigenvalue - mode.eigenvalue), default=mode)
        same = abs(near.eigenvalue - mode.eigenvalue) < 1e-6
        out.append(replace(mode, name=near.name, rotor_order=near.rotor_order, tone=near.tone) if same else mode)
    return tuple(out)


def swinging(modes: Sequence[Mode], step_s: float) -> list[Mode]:
    """Return the modes that an experiment is for: neither real, nor the rotor's harmonics, nor close to Nyquist."""
    return [m for m in modes if not (m.is_real or m.rotor_order or m.tone) and m.frequency_hz < FAST / step_s]


def _feedthrough(facts: Mapping[str, Any] | None, plant: StateSpace) -> tuple[bool, ...]:
    settings = (facts or {}).get("settings")
    stated = settings.get("feedthrough") if isinstance(settings, dict) else None
    if isinstance(stated, list):
        return tuple(s.name in stated for s in plant.inputs)
    return tuple(bool(column.any()) for column in plant.D.T)


def _method(
    facts: Mapping[str, Any] | None, plant: StateSpace, past: int | None, through: tuple[bool, ...],
    modes: Sequence[Mode],
) -> Method:  # fmt: skip
    settings = (facts or {}).get("settings")
    stated = settings.get("past") if isinstance(settings, dict) else None
    channels = plant.B.shape[1] + len(plant.C)
    if past is None and is_number(stated) and 1 <= stated <= 1000 and float(stated).is_integer():
        past = int(stated)
    if past is None:
        slowest = min((m.frequency_hz for m in swinging(modes, plant.sample_time_s)), default=0.0)
        period = 1 / (slowest * plant.sample_time_s) if slowest > 0 else 20.0
        past = int(min(max(math.ceil(period), 10, plant.order), max(400 // channels, 10)))
    if not 1 <= past <= 1000 or (past + 1) * channels > MOST_WINDOW:
        raise UsageError(
            f"--past {past}: with {channels} channels 1 to {MOST_WINDOW // channels - 1} samples are taken"
        )
    return Method(past, past, plant.order, through)
