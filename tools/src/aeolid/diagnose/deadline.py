"""Keep to a limit of time: an object that every long loop asks, handed down from the command to the fits."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

# Share of the limit at which each step's fits end; what a step leaves, the next ones have. The search has the most.
# The proof, the corrected model and the files must have their share, or there is nothing to hand over.
PHASES = {
    "forensics": 0.45, "baseline predictor": 0.45, "score bank": 0.55, "full fits": 0.65, "second effect": 0.75,
    "sealed proof": 0.84, "evidence": 0.87, "sham runs": 0.94, "writing": 1.0,
}  # fmt: skip


class Deadline:
    """Tell whether the time of a step, or of the whole run, is over, and keep a list of what was left out for it.

    One object serves a whole run and is handed to all that takes long; there is none besides. The clock gives
    seconds, growing; a test may count its calls instead.
    """

    def __init__(
        self, limit_s: float = math.inf, clock: Callable[[], float] = time.monotonic,
        notice: Callable[[str], None] = lambda what: None,
    ) -> None:  # fmt: skip
        """Start the run's time: limit_s seconds from now, above 0, without end by default.

        notice: is told what is being done, where a step does several things one after the other.
        """
        self.limit_s, self._clock, self._notice = limit_s, clock, notice
        self._begun = clock()
        self._end, self._share = self._begun + limit_s, 0.0
        self._left_out: dict[str, int] = {}
        self.cut_search = False

    def enter(self, step: str) -> None:
        """Begin a step: from now on `passed` speaks of its share of the time, never of less than before."""
        self._share = max(self._share, PHASES.get(step, self._share))
        self._end = self._begun + self._share * self.limit_s

    def doing(self, what: str) -> None:
        """Say what is done next, for whoever watches."""
        self._notice(what)

    @property
    def passed(self) -> bool:
        """Tell whether the time of the present step is over."""
        return self._clock() >= self._end

    def skips(self, what: str) -> bool:
        """Tell whether the time of the present step is over, and if so note what is therefore left out."""
        if not self.passed:
            return False
        self._left_out[what] = self._left_out.get(what, 0) + 1
        self.cut_search = self.cut_search or self._share < PHASES["sealed proof"]
        return True

    @property
    def reached(self) -> bool:
        """Tell whether anything was left out."""
        return bool(self._left_out)

    @property
    def not_tried(self) -> tuple[str, ...]:
        """Return what was left out, in the order in which it came up, with how many times where more than once."""
        return tuple(what if n == 1 else f"{what} ({n} times)" for what, n in self._left_out.items())

    def text(self) -> str:
        """Return one sentence on what was left out, empty where nothing was."""
        if not self.reached:
            return ""
        return (
            f"The time limit of {self.limit_s:g} s was reached, so this is the best answer so far. Not tried, or not to"
            f" the end: {'; '.join(self.not_tried)}."
        )

    def to_json(self) -> dict[str, Any] | None:
        """Return the facts for machines, None without a limit."""
        if math.isinf(self.limit_s):
            return None
        return {"limit_s": self.limit_s, "reached": self.reached, "not_tried": list(self.not_tried)}


def unlimited() -> Deadline:
    """Return a deadline that never passes."""
    return Deadline()
