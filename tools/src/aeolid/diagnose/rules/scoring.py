"""When a score stands out from what chance shows."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import LEVEL, rule


@dataclass(frozen=True)
class ScoringRules:
    """Hold the numbers of this section; each says what it means."""

    plain_level: float = rule(0.01, "chance", "family-wise false-alarm level of the bank's plain z", LEVEL)
    fair_level: float = rule(0.01, "chance", "family-wise false-alarm level of the bank's fair z", LEVEL)
    line_level: float = rule(0.01, "chance", "chance that noise shows any line at all", LEVEL)
    absorbed_share: float = rule(
        1e-3, "share", "part of a direction outside the baseline's own below which it says nothing of its own"
    )
    felt_deviations: float = rule(
        1e-3,
        "deviations",
        "deviations that all of a value's range must move the innovations together: less is rounding",
    )

    @property
    def levels(self) -> tuple[float, float]:
        """Return the false-alarm levels of the bank: of the plain z, of the fair one."""
        return self.plain_level, self.fair_level
