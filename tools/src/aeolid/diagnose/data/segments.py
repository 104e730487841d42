"""Hold the gap-free stretches of recordings that everything is computed on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Segment:
    """Hold a gap-free stretch of one recording; the first `burn` rows settle the state and are not scored.

    y (N, l) one row every `step` seconds; u (N · stride, r) at the recording's own rate. `before` (M, r) holds the
    inputs of the rows that end where the stretch begins: what lies in front of the plant remembers them. least_steps:
    Runge–Kutta steps that a row of u takes at least, as the states that the baseline passes need them.
    """

    u: Array
    y: Array
    step: float
    source: str
    start_s: float
    burn: int
    stride: int = 1
    before: Array | None = None
    least_steps: int = 1

    @cached_property
    def history(self) -> Array:
        """Return u behind the rows before it (M + N · stride, r), which filters of inputs run through."""
        return self.u if self.before is None else np.vstack([self.before, self.u])

    @property
    def fine_step(self) -> float:
        """Return the sample time of u in seconds."""
        return self.step / self.stride

    @cached_property
    def middle(self) -> Array:
        """Return the typical input (r,)."""
        return np.median(self.u, axis=0) if len(self.u) else np.zeros(self.u.shape[1])

    @property
    def stop_s(self) -> float:
        """Return where the stretch ends, in seconds."""
        return self.start_s + len(self.y) * self.step

    @property
    def scored_s(self) -> Array:
        """Return the times (n,) in seconds of the rows of y that are scored."""
        return self.start_s + self.step * np.arange(self.burn, len(self.y), dtype=np.float64)

    def head(self, rows: int) -> Segment:
        """Return the first rows, all scored."""
        return replace(self, u=self.u[: rows * self.stride], y=self.y[:rows], burn=0)
