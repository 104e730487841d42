"""Compile a model's equations; run them free and as a one-step predictor."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models.equations import TIME, Equations
from aeolid.models.filter_chains import behind_filters
from aeolid.models.input_filters import CHANGING, QUARTERS, SPLIT
from aeolid.models.integration_steps import most_steps, substeps, substeps_along
from aeolid.models.intersample import MOVING, slopes, slopes_of_quarters
from aeolid.models.machine_code import LANES, MachineCode, translate
from aeolid.models.march import (
    input_jacobian,
    march,
    outputs,
    reading_jacobian,
    settle,
    slope,
    state_jacobian,
)
from aeolid.models.ramps import added_by_ramps
from aeolid.models.rate import same_step

Array = NDArray[np.float64]
_MOST_KEPT = 16  # parameter sets whose answer to ramps is kept
_GROWTH = 8  # times as many integration steps after one run at most: states of a run that explodes ask for any number


@dataclass(frozen=True, eq=False)
class Compiled:
    """Hold a model and its machine code; the code of several lanes is made when it is first needed."""

    model: Equations
    code: MachineCode
    _kept: dict[bytes, Array] = field(default_factory=dict, repr=False)

    @cached_property
    def start(self) -> Array:
        """Return the model's initial state (n + memories,), memories NaN; shared, not to be written into."""
        return self.model.x0

    @property
    def step_s(self) -> float:
        """Return the sample time in discrete time, 0 in continuous time."""
        return self.model.sample_time_s

    @property
    def order(self) -> int:
        """Return the number of states, memories not among them."""
        return len(self.model.states)

    @property
    def flow(self) -> int:
        """Return where the function lies that gives the states' derivatives."""
        return self.code.flow

    @cached_property
    def velocities(self) -> list[int]:
        """Return the places of the states v where some dq/dt = v."""
        rates = {s.derivative.id for s in self.model.states if isinstance(s.derivative, ast.Name)}
        return [i for i, s in enumerate(self.model.states) if s.name in rates]

    @cached_property
    def looks(self) -> bool:
        """Tell whether an output, or a memory, reads at once an input that passes a filter."""
        behind = {f.channel for f in self.model.filters} | ({TIME} if self.clock is not None else set())
        own = {symbol for s, symbol in zip(self.model.inputs, self.model.symbols, strict=True) if s.name in behind}
        return bool(own & self.model.names_seen())

    @cached_property
    def places_of_filters(self) -> list[int]:
        """Return the places of the parameters on which the inputs behind their filters depend."""
        return sorted({self.model.index(name) for f in self.model.filters for name in f.parameters})

    @cached_property
    def clock(self) -> int | None:
        """Return the column of the time itself, which goes on within a sample; None where no state can follow it."""
        names = [s.name for s in self.model.inputs]
        held = self.model.sample_time_s > 0 or TIME not in names
        return None if held or any(f.channel == TIME for f in self.model.filters) else names.index(TIME)

    @cached_property
    def moving(self) -> set[str]:
        """Return the inputs that are not held, which change within a sample."""
        return {f.channel for f in self.model.filters if f.kind in MOVING}

    @cached_property
    def stepping(self) -> set[str]:
        """Return the held inputs that change within a sample all the same, behind a lag or late by part of one."""
        return {f.channel for f in self.model.filters if f.kind in CHANGING} - self.moving

    @cached_property
    def behind_steps(self) -> Equations:
        """Return the model with the filters of those inputs alone."""
        return replace(self.model, filters=tuple(f for f in self.model.filters if f.channel in self.stepping))

    @property
    def ramps(self) -> bool:
        """Tell whether the states follow such changes."""
        return bool(self.moving or self.stepping) or self.clock is not None

    def which_move(self, width: int) -> NDArray[np.bool_]:
        """Return which of `width` columns of inputs change within a sample."""
        known = [s.name in self.moving for s in self.model.inputs][:width]
        return np.array([*known, *[False] * (width - len(known))])

    @cached_property
    def wide(self) -> MachineCode:
        """Return the code that runs LANES parameter sets side by side."""
        return translate(self.model, LANES)

    def predict(
        self, U: Array, Y: Array, theta: Array, K: Array, x0: Array, step: float, count: int, stride: int,
        generate: bool,
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        """Return innovations (N, l), predictions (N, l), states (N + 1, n + memories); U as `driven` gives it."""
        return march(
            addresses(self.code), 1, self.model.sample_time_s > 0, contiguous(U), contiguous(Y), contiguous(theta),
            contiguous(K), contiguous(x0), self._parts(U), self._ramped(theta), step, count, stride, generate, True,
        )  # fmt: skip

    def innovations(
        self, U: Array, Y: Array, theta: Array, K: Array, x0: Array, step: float, count: int, stride: int
    ) -> Array:
        """Return the innovations (N, l) alone."""
        return march(
            addresses(self.code), 1, self.model.sample_time_s > 0, contiguous(U), contiguous(Y), contiguous(theta),
            contiguous(K), contiguous(x0), self._parts(U), self._ramped(theta), step, count, stride, False, False,
        )[0]  # fmt: skip

    def predict_wide(
        self, U: Array, Y: Array, theta: Array, K: Array, x0: Array, step: float, count: int, stride: int
    ) -> Array:
        """Return innovations (N, l, LANES) of as many parameter sets.

        theta (np, LANES), K (n, l, LANES), x0 (n + memories, LANES); the rest as in `predict`.
        """
        e = march(
            addresses(self.wide), LANES, self.model.sample_time_s > 0, contiguous(U), contiguous(Y), contiguous(theta),
            contiguous(K), contiguous(x0), self._parts(U), self._ramped(theta), step, count, stride, False, False,
        )[0]  # fmt: skip
        return e.reshape(*Y.shape, LANES)

    def _parts(self, U: Array) -> tuple[int, int]:
        """Return the columns from which outputs read their inputs, and from which slopes stand (0: there are none).

        U may have more columns than the model inputs, each as often as `driven` repeats it.
        """
        width = int(U.shape[1]) // (1 + self.looks + self.ramps)
        return (width if self.looks else 0), (width * (1 + self.looks) if self.ramps else 0)

    def _ramped(self, theta: Array) -> Array:
        """Return what a change of the inputs within a step adds to the states (n, r, lanes); r 0 where none changes.

        Only of a model in discrete time, linearised at its start without inputs; theta (np,) or (np, lanes). The last
        ones are kept: many recordings, or pieces of one, are run with the same values, on two threads.
        """
        n = len(self.model.states)
        if not (self.ramps and n and self.model.sample_time_s):
            return np.zeros((n, 0, 1))
        asked = theta.tobytes()
        if (known := self._kept.get(asked)) is not None:
            return known
        lanes = contiguous(theta.reshape(len(theta), -1).T)
        found = np.ascontiguousarray(np.stack([self.ramped(th) for th in lanes], axis=2))
        if len(self._kept) >= _MOST_KEPT:
            self._kept.clear()
        self._kept[asked] = found
        return found

    def ramped(self, theta: Array) -> Array:
        """Return what a change of the inputs within a step adds to the states (n, r) of a model in discrete time."""
        u, n = np.zeros(len(self.model.inputs)), len(self.model.states)
        x = self.settled(self.start, u, theta)
        A = state_jacobian(self.code.flow, n, x, u, contiguous(theta))
        return added_by_ramps(A, input_jacobian(self.code.flow, n, x, u, contiguous(theta)))

    def slope(self, x: Array, u: Array, theta: Array) -> Array:
        """Return dx/dt (n,), or the next state in discrete time; x (n + memories,), memories renewed."""
        out = np.empty(len(self.model.states))
        slope(self.code.flow, contiguous(x), contiguous(u), contiguous(theta), out)
        return out

    def read(self, x: Array, u: Array, theta: Array) -> tuple[Array, Array]:
        """Return the outputs (l,) and the sign of action of each sensor (l,); x (n + memories,), memories renewed."""
        y, s = np.empty(len(self.model.outputs)), np.empty(len(self.model.outputs))
        outputs(self.code.read, contiguous(x), contiguous(u), contiguous(theta), y, s)
        return y, s

    def settled(self, x: Array, u: Array, theta: Array, step: float = 1.0) -> Array:
        """Return x (n,) or (n + memories,) with the memories settled for it."""
        n, memories = len(self.model.states), len(self.model.memories)
        if not memories:
            return x[:n].copy()
        result = np.concatenate([x[:n], np.full(memories, np.nan)])
        settle(self.code.renew, result, contiguous(u), contiguous(theta), step)
        return result


def contiguous(values: Array) -> Array:
    """Return the values as machine code wants them: doubles in a row."""
    return np.ascontiguousarray(values, dtype=np.float64)


def addresses(code: MachineCode) -> tuple[int, int, int, int]:
    """Return where the four functions of a model lie."""
    return code.flow, code.read, code.renew, code.correct


def compile_equations(model: Equations) -> Compiled:
    """Translate the model into machine code (some ten milliseconds)."""
    model = model.pruned()
    return Compiled(model, translate(model))


def simulate(compiled: Compiled, u: Array, theta: Array, x0: Array, step: float) -> Array:
    """Run free: inputs u (N, r) held over each step of `step` seconds; returns y (N, l).

    Raises DataError where the model leaves the finite numbers, naming the sample, and where it is stiffer than a run
    may take steps.
    """
    y, count, needed = _run_free(compiled, u, theta, x0, step)
    name = f"model {compiled.model.name!r}"
    stiff = (
        f"a part of it changes {needed / count:.3g} times too fast for {count} integration steps in each sample of "
        f"{step:g} s; let that part follow at once, or give it a slower rate"
    )
    if not np.all(np.isfinite(y)):
        first = int(np.argwhere(~np.isfinite(y))[0][0])
        why = f": {stiff}" if needed > count else ""
        raise DataError(f"{name}: the free run leaves the finite numbers at sample {first + 1}{why}")
    if needed > count and not np.allclose(y, free_run(compiled, u, theta, x0, step, count // 2), *_agreeing(y)):
        raise DataError(f"{name} is too stiff to be run free: {stiff}")
    return y


def _agreeing(y: Array) -> tuple[float, Array]:
    """Return by how much two runs may differ, relatively and of each output (l,): 1 % of its deviation."""
    return 1e-9, 0.01 * np.std(y, axis=0)


def free_run(compiled: Compiled, u: Array, theta: Array, x0: Array, step: float, count: int = 0) -> Array:
    """Run free as `simulate` does, and return also what is not finite; count: integration steps a sample, 0: as needed.

    Runs whose outputs are compared to the last digits, as slopes are, take the same count (`free_steps`).
    """
    return _run_free(compiled, u, theta, x0, step, count)[0]


def free_steps(compiled: Compiled, u: Array, theta: Array, x0: Array, step: float) -> int:
    """Return the integration steps a sample that a free run takes."""
    return _run_free(compiled, u, theta, x0, step)[1]


def _run_free(
    compiled: Compiled, u: Array, theta: Array, x0: Array, step: float, given: int = 0
) -> tuple[Array, int, int]:  # fmt: skip
    """Return the outputs (N, l), the integration steps a sample, and how many the states that were passed need.

    The run is repeated with more steps until those of its states are enough, at most `most_steps`.
    """
    _check_step(compiled.model, step)
    filtered = driven(compiled, u, theta, step)
    blank = np.full((len(u), len(compiled.model.outputs)), np.nan)
    gain = np.zeros((len(compiled.model.states), blank.shape[1]))
    middle = np.median(u, axis=0) if len(u) else np.zeros(u.shape[1])
    count, most = given or substeps(compiled, middle, theta, x0, step), most_steps(len(u))
    while True:
        _, y, X = compiled.predict(filtered, blank, theta, gain, x0, step, count, 1, False)
        needed = count if given else substeps_along(compiled, X, filtered, theta, step)
        if needed <= count or count >= most:
            return y, count, needed
        count = min(needed, _GROWTH * count, most)


def numeric_jacobian(compiled: Compiled, x: Array, u: Array, theta: Array) -> Array:
    """Return ∂f/∂x (n, n) by central differences, steps 1e-6 of each state's size; memories settled."""
    x = compiled.settled(x, u, theta)
    result: Array = state_jacobian(compiled.code.flow, len(compiled.model.states), x, contiguous(u), contiguous(theta))
    return result


def output_jacobian(compiled: Compiled, x: Array, u: Array, theta: Array, step: float = 1.0) -> Array:
    """Return s ∂h/∂x (l, n) by central differences through settled memories, s undoing a folding sensor."""
    sizes = len(compiled.model.states), len(compiled.model.outputs)
    x, code = compiled.settled(x, u, theta, step), compiled.code
    result: Array = reading_jacobian(code.read, code.renew, sizes, x, contiguous(u), contiguous(theta), step)
    return result


def driven(compiled: Compiled, u: Array, theta: Array, step: float) -> Array:
    """Return the mean of what acts (N, r) in each step, all filters passed; beside it what outputs see, then slopes.

    An output is sampled as a step begins, the states follow what acts over all of it. What is seen (r columns) is there
    only where an output looks; by how much each input changes within the step (r columns) only where one does.
    """
    model, width = compiled.model, u.shape[1]
    if not model.filters and compiled.clock is None:
        return np.ascontiguousarray(u)
    result = np.empty((len(u), width * (1 + compiled.looks + compiled.ramps)))
    means = result[:, :width]
    means[:] = u
    if compiled.looks:
        seen = result[:, width : 2 * width]
        seen[:] = u
        for column, both in behind_filters(model, u, theta, step, SPLIT).items():
            first, second = both[::2], both[1::2]
            seen[:, column] = first
            means[:, column] = first + SPLIT[1] * (second - first)  # to the last digit where nothing lasts
    else:
        for column, values in behind_filters(model, u, theta, step).items():
            means[:, column] = values
    if compiled.ramps:
        result[:, -width:] = _change_within(compiled, u, means, theta, step)
    if compiled.clock is not None and len(u):
        time = u[:, compiled.clock]
        passed = np.diff(time, append=2 * time[-1] - time[-2] if len(u) > 1 else time[-1] + step)
        means[:, compiled.clock], result[:, compiled.clock - width] = time + 0.5 * passed, passed
    return result


def _change_within(compiled: Compiled, u: Array, means: Array, theta: Array, step: float) -> Array:
    """Return by how much inputs change within each step: those that are not held, and held ones behind filters."""
    found = slopes(means, compiled.which_move(means.shape[1])) if compiled.moving else np.zeros(u.shape)
    if compiled.stepping:
        for column, quarters in behind_filters(compiled.behind_steps, u, theta, step, QUARTERS).items():
            found[:, column] = slopes_of_quarters(quarters)
    return found


def _check_step(model: Equations, step: float) -> None:
    if model.sample_time_s and not same_step(model.sample_time_s, step):
        raise DataError(
            f"model {model.name!r} has a sample time of {model.sample_time_s:g} s, the recording {step:g} s;"
            " resample the recording"
        )
