"""Say what a catalogue entry is and where it may attach to a model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.exogenous import Exogenous
from aeolid.diagnose.hypotheses.parts.settings import Setting
from aeolid.diagnose.structure.anatomy import Motion
from aeolid.models.equations import Equations
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel

Array = NDArray[np.float64]
Z90 = 1.6449  # deviations to either end of a 90 % band


@dataclass(frozen=True)
class Quantity:
    """Describe a parameter of an entry for the catalogue page: symbol, unit, physical range, null value."""

    symbol: str
    unit: str
    low: float
    high: float
    null: float
    meaning: str


@dataclass(frozen=True, eq=False)
class Site:
    """Hold what an entry may look at to decide where it attaches.

    step is the sample time of u (N, r) in s, row_step the time between the rows of y that correct the model; symbols
    are what the model's equations call its inputs; exogenous are channels (N, k) that the model has no use for.
    rails: of each output the ends ("low", "high") at which the values of all recordings pile up; what y shows where it
    is empty. bodies: those whose speeds a linear model's outputs show, where a force on one meets modes and all.
    smooth: by name of a channel whose errors of reading are smoothed away, its text in a model and its samples (N,).
    channels: of the recordings, with their units and roles.
    """

    model: Equations
    linear: StateSpace | None
    motions: tuple[Motion, ...]
    step: float
    row_step: float
    u: Array
    y: Array
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    symbols: tuple[str, ...]
    exogenous: tuple[Exogenous, ...]
    extra: Array
    context: Mapping[str, Any]
    rails: tuple[Mapping[str, float], ...] = ()
    bodies: tuple[Motion, ...] = ()
    smooth: Mapping[str, tuple[str, Array]] = field(default_factory=dict)
    channels: tuple[Channel, ...] = ()


@dataclass(frozen=True)
class Slot:
    """Hold one parameter of an attachment inside the extended model.

    `name` in the model, `label` and `unit` in the report (None hides it), null value, physical range, typical size;
    `local` says that its score at the null exists; `show` turns the model's value into the reported one. change: of a
    moment, the name of the size that comes then, and the seconds a row. idle: of a limit, where it never acts. jumps:
    the model's answer depends on it in jumps, and is looked at closely around where a fit ends.
    """

    name: str
    label: str | None
    unit: str
    null: float
    low: float
    high: float
    size: float
    local: bool = True
    show: Callable[[float], float] = float
    change: tuple[str, float] | None = None
    idle: float | None = None
    jumps: bool = False

    def reported(self, value: float, std: float) -> tuple[float, float]:
        """Return value and deviation as the report has them: its 90 % band reaches the farther end of the model's.

        A band of 1/omega is lopsided in omega: 7 ± 1.8 ms are 142 rad/s, from 100 to 246. Infinite where the band
        reaches what is shown as infinite: a natural frequency whose inverse may be none.
        """
        if self.show is float or not (np.isfinite(std) and std > 0):
            return self.show(value), std
        here = self.show(value)
        ends = [self.show(float(np.clip(value + s * Z90 * std, self.low, self.high))) for s in (-1.0, 1.0)]
        far = max(abs(end - here) for end in ends) / Z90
        return here, far if np.isfinite(far) else np.inf


@dataclass(frozen=True, eq=False)
class Attachment:
    """Hold one hypothesis: an entry at one place of this model.

    edit puts the effect, at its null, into the model; gain_states are states it brings whose noise gain is free;
    start_states are states it brings that no noise drives and whose start is free, around the model's own null;
    fixed are parameters set when it is active; grid are values of the non-local parameters to scan;
    starts are values to begin a full fit from; what they leave out comes from the score's estimate.
    always_fit: there is no score, fit it whatever the bank says. stepped: free parameters may absorb it so well that
    its score at the null vanishes, fit it from finite steps whenever anything is found.
    shown: the recorded values themselves show its signature: fit it whatever the bank says, which takes what comes in a
    few bursts for chance (a sensor's range, reached in 3 of 100 samples: z = 11, where chance reached 14).
    rugged: one step ahead its fit has many optima; where it is worth it, the fit starts from the simulation, too.
    share: name of a local slot that blends the effect in from 0 to 1 where its own parameters have no null to start
    from; its value is 1 when the effect is active (put it in `fixed`); grid is then ordered from mild to strong.
    noise_driven: noise alone may drive the states it brings, for their frequency band is known from elsewhere.
    essential: names of slots of which one must differ from none, or it is another effect; without any, one of all.
    credible: returns why reported values cannot be this effect, though each lies in its range; "" where they can.
    beside: least sizes, by slot name, from which it is worth a name beside another effect.
    drives: names of slots by which inputs drive states that noise drives, too; without any, all that have no label.
    """

    entry: str
    key: str
    location: Mapping[str, Any]
    edit: Callable[[Equations], Equations]
    slots: tuple[Slot, ...]
    gain_states: tuple[str, ...] = ()
    start_states: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    grid: tuple[Mapping[str, float], ...] = ({},)
    starts: tuple[Mapping[str, float], ...] = ({},)
    equation: str = ""
    statement: Callable[[Mapping[str, float]], str] = lambda values: ""
    always_fit: bool = False
    stepped: bool = False
    shown: bool = False
    rugged: bool = False
    share: str | None = None
    noise_driven: bool = False
    credible: Callable[[Mapping[str, float]], str] = lambda values: ""
    essential: tuple[str, ...] = ()
    beside: Mapping[str, float] = field(default_factory=dict)
    drives: tuple[str, ...] = ()

    @property
    def is_switch(self) -> bool:
        """Tell whether the effect has no size, only is or is not: a reversed sign, swapped channels."""
        return bool(self.slots) and all(s.name in self.fixed for s in self.slots)


@dataclass(frozen=True, eq=False)
class Entry:
    """Hold one physical effect: what it is, where it can sit, what it looks like, what else looks alike.

    rank: place in the catalogue, simplest first; of candidates that nothing tells apart the earlier one is told.
    verdict: what a diagnosis ends with that names it alone; "named", but for what misses no physics.
    turns: it turns the phase, sign, size or place of what a free gain was fitted to; bends: so does it where it passes
    a load on later (stepped attachments). without_ringing: id of the entry that it is when nothing in it rings.
    at_least: symbols of quantities, each with the id of the entry that it is where that one is as small as can be.
    settings: where simulators have it.
    """

    id: str
    family: str
    name: str
    equation: str
    source: str
    quantities: tuple[Quantity, ...]
    attaches_to: str
    signature: str
    confused_with: tuple[tuple[str, str], ...]
    attach: Callable[[Site], list[Attachment]]
    rank: int = 10_000
    verdict: str = "named"
    turns: bool = False
    bends: bool = False
    without_ringing: str = ""
    at_least: tuple[tuple[str, str], ...] = ()
    settings: tuple[Setting, ...] = ()


def location(entry: str, *, outputs: tuple[str, ...] = (), inputs: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return a location as the diagnosis file holds it, unknown parts as None."""
    return {
        "entry": entry, "outputs": list(outputs), "inputs": list(inputs), "frequency_hz": None,
        "azimuth_order": None, "region": None, "time_s": None,
    }  # fmt: skip


def told_apart(attachments: Sequence[Attachment]) -> tuple[Attachment, ...]:
    """Return attachments with keys of their own: models and values are kept by key, those of one are not another's."""
    seen: Counter[str] = Counter()
    found = []
    for a in attachments:
        seen[a.key] += 1
        found.append(a if seen[a.key] == 1 else replace(a, key=f"{a.key} ({seen[a.key]})"))
    return tuple(found)
