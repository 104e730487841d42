"""Hold a first-principles model written as text: model.toml."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.models import expressions as ex
from aeolid.models.model_file import Signal
from aeolid.record import Record

Array = NDArray[np.float64]
STEP = "step_s"  # how a memory calls the time between two of its updates
TIME = "time_s"  # the input that every recording has


@dataclass(frozen=True)
class Parameter:
    """Hold a declared parameter: start value, physical range, whether it may be re-fitted, datasheet spread."""

    name: str
    value: float
    unit: str = ""
    minimum: float = -math.inf
    maximum: float = math.inf
    free: bool = False
    prior_std: float | None = None


@dataclass(frozen=True, eq=False)
class State:
    """Hold a state: its derivative (continuous time) or next value (discrete time), and where it starts."""

    name: str
    unit: str
    derivative: ast.expr
    initial: float
    initial_free: bool = False


@dataclass(frozen=True, eq=False)
class Output:
    """Hold an output equation; `slope` is its sign of action where a sensor folds the signal (1 elsewhere)."""

    name: str
    unit: str
    equation: ast.expr
    slope: ast.expr | None = None


@dataclass(frozen=True, eq=False)
class Auxiliary:
    """Hold an intermediate quantity that several equations share; it may use those before it."""

    name: str
    equation: ast.expr


@dataclass(frozen=True, eq=False)
class Memory:
    """Hold a quantity that is renewed once a sample, from its last value, the states and the inputs of that sample.

    `next` may use its own name for the last value, and `step_s` for the time between two samples; `settled` is the
    value it starts from. What a filtering sensor or a mechanism with play remembers.
    """

    name: str
    unit: str
    next: ast.expr
    settled: ast.expr


@dataclass(frozen=True)
class InputFilter:
    """Say what happens to an input before it acts: kind and the names of the parameters it uses."""

    channel: str
    kind: str
    parameters: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Equations:
    """Hold dx/dt = f(x, u, θ) or x⁺ = f(x, u, θ), y = h(x, u, θ), all as checked expressions.

    inputs are the channels the equations use, `symbols` how the equations call them; sample_time_s is 0 for
    continuous time. Cost of a simulation: N · substeps · 4 evaluations of f.
    """

    name: str
    sample_time_s: float
    parameters: tuple[Parameter, ...]
    states: tuple[State, ...]
    outputs: tuple[Output, ...]
    inputs: tuple[Signal, ...]
    symbols: tuple[str, ...]
    filters: tuple[InputFilter, ...] = ()
    auxiliaries: tuple[Auxiliary, ...] = ()
    memories: tuple[Memory, ...] = ()

    @property
    def theta(self) -> Array:
        """Return the parameter values (np,) in the order of `parameters`."""
        return np.array([p.value for p in self.parameters])

    @property
    def x0(self) -> Array:
        """Return the initial state (n + memories,); memories are NaN: they start settled."""
        return np.array([s.initial for s in self.states] + [math.nan] * len(self.memories))

    def index(self, parameter: str) -> int:
        """Return the place of a parameter in `theta`; KeyError where there is none."""
        return self._places[parameter]

    @cached_property
    def _places(self) -> dict[str, int]:
        return {p.name: i for i, p in enumerate(self.parameters)}

    def simulate(self, record: Record) -> Array:
        """Run free on the recorded inputs, read as their roles say; returns y (N, l) in the outputs' units."""
        from aeolid.models.integrate import compile_equations, simulate
        from aeolid.models.rate import read_as_declared

        model, u = read_as_declared(self, record), self.inputs_of(record)
        if not np.all(np.isfinite(u)):
            row, column = np.argwhere(~np.isfinite(u))[0]
            raise DataError(f"{record.source}: input {self.inputs[column].name} is missing at sample {row + 1}")
        return simulate(compile_equations(model), u, model.theta, model.x0, record.sample_time_s)

    def inputs_of(self, record: Record) -> Array:
        """Return the inputs (N, r) from a recording; one called time_s that is no channel is the time itself."""
        known = {c.name for c in record.channels}
        columns = [
            record.time_s if s.name == TIME and TIME not in known else record.column(s.name) for s in self.inputs
        ]
        return np.column_stack(columns) if columns else np.zeros((len(record), 0))

    def pruned(self) -> Equations:
        """Return the model without intermediates that no equation uses."""
        used = self.names_used()
        return replace(self, auxiliaries=tuple(a for a in self.auxiliaries if a.name in used))

    def names_used(self) -> set[str]:
        """Return every name that a state, output or memory depends on, through intermediates too."""
        return self._used(self.roots())

    def names_seen(self) -> set[str]:
        """Return every name that an output or memory depends on, through intermediates too."""
        states = {id(s.derivative) for s in self.states}
        return self._used([tree for tree in self.roots() if id(tree) not in states])

    def _used(self, trees: Iterable[ast.expr]) -> set[str]:
        used = set().union(*(ex.names_in(tree) for tree in trees))
        for a in reversed(self.auxiliaries):
            if a.name in used:
                used |= ex.names_in(a.equation)
        return used

    def intermediates_of_memories(self, trees: Iterable[ast.expr]) -> tuple[Auxiliary, ...]:
        """Return the intermediates behind these expressions that depend on a memory, in their order."""
        used, following = self._used(trees), {m.name for m in self.memories}
        result = []
        for a in self.auxiliaries:
            if a.name in used and ex.names_in(a.equation) & following:
                following.add(a.name)
                result.append(a)
        return tuple(result)

    def roots(self) -> list[ast.expr]:
        """List the expressions of states, outputs and memories, which intermediates serve."""
        trees = [s.derivative for s in self.states] + [o.equation for o in self.outputs]
        trees += [o.slope for o in self.outputs if o.slope is not None]
        return trees + [tree for m in self.memories for tree in (m.next, m.settled)]
