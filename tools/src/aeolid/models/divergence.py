"""Say where a free run leaves what was recorded, and whether its model must: nobody is to mistake it for a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aeolid.models.state_space import StateSpace
from aeolid.record import Record

Array = NDArray[np.float64]
# Recorded ranges outside the recorded range that no use of a model bears: an integrator's drift, a wrong gain or
# operating point end at one to three. The same factor within the recording makes growth of a mode a divergence, so
# that an eigenvalue estimated a little outside the unit circle, as every second one of an integrator is, is none.
FAR = 10.0
_LAST = 0.1  # of the run: what is far outside there has not come back


class Named(Protocol):
    """Say what is told of an output."""

    @property
    def name(self) -> str:
        """Return the name of the channel."""
        ...

    @property
    def unit(self) -> str:
        """Return its unit, empty where the model does not say."""
        ...


@dataclass(frozen=True)
class Leaving:
    """Hold where an output of a free run leaves: sample (from 1), time_s, its largest finite value, whether it stays.

    ranges: by how many recorded ranges that value lies outside; None where nothing was recorded. finite: whether all
    values are. stays: whether it is outside at the end, too.
    """

    output: str
    unit: str
    sample: int
    time_s: float
    largest: float
    ranges: float | None
    finite: bool
    stays: bool

    def text(self) -> str:
        """Return what happens as a clause."""
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        where = f"at sample {self.sample} ({self.time_s:g} s)"
        if not self.finite:
            return f"{self.output} leaves the finite numbers after {self.largest:.3g}{unit}; it is lost {where}"
        on = "and does not come back" if self.stays else "for a while"
        return (
            f"{self.output} leaves {FAR:g} times its recorded range {where} {on} (it reaches {self.largest:.3g}{unit},"
            f" {self.ranges:.3g} ranges outside)"
        )


@dataclass(frozen=True)
class Divergence:
    """Hold how a free run diverges: the outputs that leave, and the eigenvalue that makes them, where it is known.

    tenfold: samples in which the mode of that eigenvalue grows tenfold.
    """

    leaving: tuple[Leaving, ...]
    eigenvalue: complex | None = None
    tenfold: float | None = None

    def text(self) -> str:
        """Return one sentence on what happens and what it means."""
        parts = [leaving.text() for leaving in self.leaving]
        if self.eigenvalue is not None:
            parts.append(
                f"the model is unstable: an eigenvalue of size {abs(self.eigenvalue):.6g} grows tenfold in"
                f" {self.tenfold:.4g} samples"
            )
        lost = any(leaving.stays or not leaving.finite for leaving in self.leaving) or self.eigenvalue is not None
        meaning = (
            "the free run diverges and says nothing of the machine from there on" if lost else "its start is wrong"
        )
        return f"{'; '.join(parts)}: {meaning}."

    def to_json(self) -> dict[str, Any]:
        """Return the facts for machines."""
        outputs = [
            {"output": leaving.output, "unit": leaving.unit, "sample": leaving.sample, "time_s": leaving.time_s,
             "largest": leaving.largest, "ranges_outside": leaving.ranges, "finite": leaving.finite,
             "stays": leaving.stays}
            for leaving in self.leaving
        ]  # fmt: skip
        pole = None if self.eigenvalue is None else [self.eigenvalue.real, self.eigenvalue.imag]
        return {"text": self.text(), "outputs": outputs, "eigenvalue": pole, "tenfold_samples": self.tenfold}


def divergence_of(
    y: Array, record: Record, outputs: Sequence[Named], linear: StateSpace | None = None
) -> Divergence | None:
    """Return how a free run y (N, l) on a recording diverges; None where it does not.

    linear: the model, in discrete time at the recording's sample time, where its eigenvalues are to be looked at.
    An output that was not recorded, or never moves there, is only tested for finite values.
    """
    known = {c.name for c in record.channels}
    leaving = [
        found
        for j, o in enumerate(outputs)
        if (found := _leaving(y[:, j], record, o, record.column(o.name) if o.name in known else None)) is not None
    ]
    pole, tenfold = (None, None) if linear is None else growing(linear.A, len(y))
    return Divergence(tuple(leaving), pole, tenfold) if leaving or pole is not None else None


def growing(A: Array, samples: int) -> tuple[complex | None, float | None]:
    """Return the largest eigenvalue of A (n, n), and the samples in which its mode grows FAR-fold; None where longer.

    Longer, that is, than the `samples` of the run: |z|^samples < FAR is no divergence of this run.
    """
    values = np.linalg.eigvals(A).astype(complex)
    worst = complex(values[np.argmax(abs(values))]) if len(values) else 0j
    tenfold = float(np.log(FAR) / np.log(abs(worst))) if abs(worst) > 1 else np.inf
    return (worst, tenfold) if tenfold < samples else (None, None)


def _leaving(y: Array, record: Record, output: Named, recorded: Array | None) -> Leaving | None:
    finite = np.isfinite(y)
    low, high = (-np.inf, np.inf) if recorded is None else _range(recorded)
    reach = FAR * (high - low) if np.isfinite(high - low) else 0.0
    with np.errstate(invalid="ignore"):
        outside = ~finite | (y > high + reach) | (y < low - reach)
    if not outside.any():
        return None
    first = int(np.flatnonzero(outside)[0])
    good = y[finite]
    largest = float(good[np.argmax(abs(good))]) if len(good) else 0.0
    beyond = max(largest - high, low - largest) / (high - low) if reach else None
    last = max(1, int(_LAST * len(y)))
    return Leaving(
        output.name, output.unit, first + 1, float(record.time_s[first]), largest, beyond, bool(finite.all()),
        bool(outside[-last:].any()),
    )  # fmt: skip


def _range(recorded: Array) -> tuple[float, float]:
    """Return the recorded range; none where nothing was recorded or nothing moved."""
    good = recorded[np.isfinite(recorded)]
    low, high = (float(good.min()), float(good.max())) if len(good) else (0.0, 0.0)
    return (low, high) if high > low else (-np.inf, np.inf)
