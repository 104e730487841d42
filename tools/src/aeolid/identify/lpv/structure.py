"""Say which matrices of a scheduled model depend on the scheduling, and how many regressors that makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from aeolid.errors import UsageError

MATRICES = ("A", "B", "C", "D", "K")


@dataclass(frozen=True)
class Structure:
    """Hold what depends on the scheduling μ = [1, μ₂ … μ_m].

    varying: names out of A, B, C, D, K. feedthrough: for each input, whether u_k acts on y_k. constant: whether free
    constants b(μ) and c are part of the model, x⁺ = … + b(μ), y = … + c.
    """

    varying: frozenset[str]
    parameters: int
    inputs: int
    outputs: int
    feedthrough: tuple[bool, ...]
    constant: bool

    def __post_init__(self) -> None:
        unknown = sorted(self.varying - set(MATRICES))
        if unknown:
            raise UsageError(f"varying {unknown[0]!r} is none of {', '.join(MATRICES)}")
        if not self.varying:
            raise UsageError("no matrix depends on the scheduling; identify a time-invariant model (varx)")
        for matrix in ("C", "D"):
            if matrix in self.varying and "K" in self.varying:
                raise UsageError(
                    f"{matrix} and K cannot both depend on the scheduling: the predictor would hold their product, "
                    f"of second degree in it; leave K constant (varying A, B, {matrix})"
                )
        if "D" in self.varying and not any(self.feedthrough):
            raise UsageError("D depends on the scheduling but no input has feedthrough; name one with feedthrough")

    @property
    def state_varies(self) -> bool:
        """Return whether Ã = A − K C of the predictor depends on the scheduling."""
        return bool(self.varying & {"A", "C", "K"})

    @property
    def channels_vary(self) -> tuple[bool, ...]:
        """Return for each channel of z = [u; y] whether its column of [B − K D, K] depends on the scheduling."""
        gain, inner = "K" in self.varying, "D" in self.varying or "K" in self.varying
        by_input = ["B" in self.varying or (through and inner) for through in self.feedthrough]
        return (*by_input, *([gain] * self.outputs))

    @property
    def output_varies(self) -> bool:
        """Return whether C depends on the scheduling."""
        return "C" in self.varying

    @property
    def lag_width(self) -> int:
        """Return the regressors w of one lag without the factors of Ã before it."""
        varying = sum(self.channels_vary)
        rest = len(self.channels_vary) - varying
        extra = self.parameters - 1 if self.constant_per_lag else 0
        return self.parameters * varying + rest + extra

    @property
    def constant_per_lag(self) -> bool:
        """Return whether b(μ) enters lag by lag: where Ã is constant no product of past scheduling stands for it."""
        return self.constant and not self.state_varies

    def depth_width(self, lags: int) -> int:
        """Return the regressors of the last `lags` lags, q of Table 1 of paper 001 where everything varies."""
        m = self.parameters if self.state_varies else 1
        return self.lag_width * sum(int(m**j) for j in range(lags)) + (int(m**lags) if self.constant else 0)

    def regressors(self, past: int) -> int:
        """Return the columns of Z for a past window."""
        return self.depth_width(past) * (self.parameters if self.output_varies else 1)

    @property
    def feedthrough_width(self) -> int:
        """Return the columns of the inputs with feedthrough, times m where D depends on the scheduling."""
        return sum(self.feedthrough) * (self.parameters if "D" in self.varying else 1)


def parse_varying(text: str | Sequence[str]) -> frozenset[str]:
    """Return the matrices named in "A,B,K" or ("A", "B", "K").

    >>> sorted(parse_varying("A, B"))
    ['A', 'B']
    """
    parts = text.split(",") if isinstance(text, str) else list(text)
    return frozenset(part.strip() for part in parts if part.strip())
