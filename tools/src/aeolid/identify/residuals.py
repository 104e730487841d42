"""Test whether the innovations of a predictor are white and free of the inputs' past."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from aeolid.identify.correlation import Spaced, explained_share, free_of_spectrum, whiten
from aeolid.identify.feedthrough import LOOP_LEVEL, lag_zero, loop_p_value
from aeolid.wording import counted

Array = NDArray[np.float64]
AT_ONCE = 0.2  # of an innovation's variance: less may be a loop within the sample that its past does not show
LEVEL = 0.01  # chance that any of the tests alarms on an exact model
MATERIAL = 0.01  # part of an innovation's variance; below it a finding is true but does not matter
LONG = 5  # times lags and order: a first state fitted in a stretch then takes less of its innovations than MATERIAL
VERDICTS = ("fail", "undecided", "immaterial")  # the worst first, before "pass"
EXACT = 1e-6  # of an output's deviation; innovations below it are the rounding of files, whatever they follow


@dataclass(frozen=True)
class ResidualTest:
    """Hold one test: which innovation against which past signal.

    p_value is corrected for the number of tests (Holm); predictable is the part of the innovation's variance that the
    other signal's past explains beyond chance; verdict is "pass", "immaterial" (significant, but below 1 %, or of an
    innovation that is itself at rounding), "fail", or "undecided" where it does not fail over too few samples to.
    """

    output: str
    against: str
    kind: str
    statistic: float
    p_value: float
    predictable: float
    verdict: str

    def to_json(self) -> dict[str, Any]:
        """Return the test as JSON facts."""
        return dict(self.__dict__)


@dataclass(frozen=True)
class ResidualReport:
    """Hold all tests of one validation; level is the chance of any alarm on an exact model.

    samples: that were tested, pairs of a sample and one before it where some are missing; needed: below so many, LONG
    times lags and order, a test that does not fail is undecided. Of white noise through a first-order lag that explains
    half of the variance the tests find 46 % over 40 samples, 82 % over 60 and all over 100, of a quarter of the
    variance 13 %, 39 % and 70 %; over 19 none.
    diverging: outputs whose innovations grow beyond all numbers, since the predictor is unstable; there are no tests
    then, and the verdict is "fail".
    """

    tests: tuple[ResidualTest, ...]
    lags: int
    level: float
    diverging: tuple[str, ...] = ()
    samples: int = 0
    needed: int = 0

    @property
    def verdict(self) -> str:
        """Return the worst verdict of all tests: fail, undecided, immaterial or pass."""
        found = {t.verdict for t in self.tests} | ({"fail"} if self.diverging else set())
        return next((word for word in VERDICTS if word in found), "pass")

    def text(self) -> str:
        """Return the verdict as one line."""
        if self.verdict == "undecided":
            few = f"too few samples: {self.samples}, of {self.needed} that are needed"
            return f"innovations: not decided ({few} for tests over {self.lags} lags)"
        return f"innovations: {self.verdict} ({counted(len(self.tests), 'test')}, level 1 % together)"

    def to_json(self) -> dict[str, Any]:
        """Return the report as JSON facts."""
        tests = [t.to_json() for t in self.tests]
        facts = {"verdict": self.verdict, "lags": self.lags, "level": self.level, "tests": tests}
        facts |= {"samples": self.samples, "needed": self.needed}
        return facts | ({"diverging": list(self.diverging)} if self.diverging else {})


def run_residual_tests(
    innovations: Array, u: Array, outputs: tuple[str, ...], inputs: tuple[str, ...], lags: int = 20,
    nrmse: Mapping[str, float] | None = None, lengths: Sequence[int] = (), order: int = 0, estimated: float = 0.0,
) -> ResidualReport:  # fmt: skip
    """Correlate each innovation with the past of all innovations and of all inputs.

    innovations (N, l), not a number where missing, u (N, r) of stretches of these lengths, default one: of several
    those count that are much longer than lags and the order of the model, whose first states take a part of the
    innovations that looks like memory; no lag joins two of them. lags: 1 … 20 samples back. Only the past counts, so
    feedback from y to u is no alarm. Inputs are whitened by an autoregression first, and what that leaves is
    taken into account (`free_of_spectrum`), so that the statistic is χ² whatever the input's spectrum. Level 1 % over
    all tests together (Holm). nrmse: rms of each innovation over its output's deviation, default: none is at rounding.
    estimated: part of an innovation's variance that errors of estimated parameters add on fresh samples, 0 of an exact
    model: it is taken off what is predictable, and statistics are taken down by what it adds to their mean. Where fewer
    than LONG times lags and order samples are known a test that does not fail decides nothing.
    """
    needed = LONG * (lags + order)
    innovations, u, lengths = _long_enough(innovations, u, lengths, lags + order)
    N = len(innovations)
    with np.errstate(all="ignore"):
        grown = ~np.isfinite(np.nansum(innovations**2, axis=0) * N)
    if grown.any():
        return ResidualReport((), lags, LEVEL, tuple(name for name, g in zip(outputs, grown, strict=True) if g))
    white = np.column_stack([whiten(x, lengths=lengths) for x in u.T]) if u.shape[1] else np.zeros((N, 0))
    columns = [Spaced.of(x, lengths, lags) for x in (*innovations.T, *white.T)]
    e, v = columns[: len(outputs)], columns[len(outputs) :]
    sources = {name: x.own() for name, x in zip((*outputs, *inputs), columns, strict=True)}
    found = []
    for i, output in enumerate(outputs):
        for j, other in enumerate(outputs):
            found.append((output, other, "whiteness", *e[i].after(e[j], lags)))
        for j, name in enumerate(inputs):
            found.append((output, name, "input", *e[i].after(v[j], lags)))
    statistics, degrees = np.array([_statistic(*f, sources) for f in found]).T
    pairs = np.array([known.mean() for *_, known in found])
    p_values = _holm(chdtrc(degrees, statistics / (1.0 + pairs * estimated / degrees)))
    part = _longest(lengths)
    at_mean = np.where(np.isfinite(innovations), innovations, np.nanmean(innovations, axis=0))
    tests = _within_the_sample(at_mean[part], u[part], white[part], outputs, inputs, nrmse)
    for (output, other, kind, rho, known), statistic, p in zip(found, statistics, p_values, strict=True):
        predictable = max(explained_share(rho, sources[other]) - lags / known.mean() - estimated, 0.0)
        material = predictable > MATERIAL and (nrmse is None or not nrmse[output] < EXACT)
        verdict = "pass" if p > LEVEL else "fail" if material else "immaterial"
        verdict = "undecided" if verdict != "fail" and known.mean() < needed else verdict
        tests.append(ResidualTest(output, other, kind, float(statistic), float(p), predictable, verdict))
    samples = int(min(known.mean() for *_, known in found))
    return ResidualReport(tuple(tests), lags, LEVEL, samples=samples, needed=needed)


def _statistic(
    _: str, other: str, kind: str, rho: Array, known: Array, sources: Mapping[str, Array]
) -> tuple[float, int]:  # fmt: skip
    """Return what is χ² on an exact model, and its degrees of freedom."""
    if kind == "whiteness":
        return float(np.sum(known * rho**2)), len(rho)
    size, degrees = free_of_spectrum(rho, sources[other])
    return float(known.mean()) * size, degrees


def _long_enough(e: Array, u: Array, lengths: Sequence[int], least: int) -> tuple[Array, Array, tuple[int, ...]]:
    """Return what lies in stretches of at least LONG times `least` samples, in the longest where there are none."""
    lengths = tuple(lengths) or (len(e),)
    if len(lengths) == 1:
        return e, u, lengths
    taken = [n >= LONG * least for n in lengths]
    if not any(taken):
        taken[int(np.argmax(lengths))] = True
    rows = np.repeat(taken, lengths)
    return e[rows], u[rows], tuple(n for n, t in zip(lengths, taken, strict=True) if t)


def _longest(lengths: Sequence[int]) -> slice:
    """Return the rows of the longest stretch."""
    i = int(np.argmax(lengths))
    return slice(sum(lengths[:i]), sum(lengths[: i + 1]))


def _within_the_sample(
    e: Array, u: Array, white: Array, outputs: tuple[str, ...], inputs: tuple[str, ...],
    nrmse: Mapping[str, float] | None,
) -> list[ResidualTest]:  # fmt: skip
    """Test for inputs that act on an output within the sample and have no feedthrough, or a wrong one.

    An input that past innovations move is in a loop, which may compute it from the outputs of the sample: it is left
    out, and so is one that explains less than a fifth, since a loop whose past does not show may explain as much. One
    test an input, level 1 % over all (Bonferroni); the output that shows it most is named.
    """
    if not inputs or len(e) < 10 * (len(outputs) + len(inputs)):
        return []
    p_values, most = lag_zero(e, white)
    found = []
    for j, name in enumerate(inputs):
        p = min(1.0, float(p_values[j]) * len(inputs))
        if p > LEVEL or loop_p_value(e, u[:, j]) < LOOP_LEVEL:
            continue
        output = outputs[most[j]]
        rho = float(np.corrcoef(e[:, most[j]], white[:, j])[0, 1])
        predictable = max(rho**2 - 1 / len(e), 0.0)
        if predictable < AT_ONCE:
            continue
        verdict = "immaterial" if nrmse is not None and nrmse[output] < EXACT else "fail"
        found.append(ResidualTest(output, name, "feedthrough", rho**2 * len(e), p, predictable, verdict))
    return found


def _holm(p: Array) -> Array:
    """Return the p-values corrected for their number: the family-wise error is at most the level."""
    order = np.argsort(p)
    count = len(p)
    corrected = np.maximum.accumulate(p[order] * (count - np.arange(count)))
    out = np.empty(count)
    out[order] = np.minimum(corrected, 1.0)
    return out
