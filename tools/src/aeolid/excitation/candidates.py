"""Choose signals to try: the three kinds, each with a few clock periods or bands around the modes that matter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from aeolid.errors import UsageError
from aeolid.excitation.setup import FAST, Setup, swinging
from aeolid.excitation.signals import KINDS, PHASES, Shape, lines_of
from aeolid.models.modes import Mode

LINES = 64  # of an input, as many as the wrapper for controllers plays
MOST_LINES = 20_000
MOST_COSINES = 300_000_000  # rows by lines of an input: some ten seconds
WIDTHS = (1.5, 3.0, 6.0)  # over the fastest mode: where the spectrum of a sequence has lost 3 dB
MARGINS = (1.4, 2.5, 6.0)  # by which a band is wider than from the slowest to the fastest mode, at either end
HALF_POWER = 0.443  # of the clock rate: where the spectrum of a sequence has lost 3 dB


@dataclass(frozen=True)
class Wanted:
    """Hold what is asked of the signals; None: not said. playable: by the wrapper for controllers."""

    signal: str | None = None
    clock_s: float | None = None
    band_hz: tuple[float, float] | None = None
    lines: int | None = None
    phases: str | None = None
    playable: bool = False

    def check(self) -> None:
        """Refuse what cannot be or does not go together; raises UsageError."""
        if self.signal not in (None, *KINDS):
            raise UsageError(f"--signal {self.signal!r} is none of auto, {', '.join(KINDS)}")
        if self.phases not in (None, *PHASES):
            raise UsageError(f"--phases {self.phases!r} is none of {', '.join(PHASES)}")
        if self.lines is not None and not 1 <= self.lines <= MOST_LINES:
            raise UsageError(f"--lines {self.lines}: 1 to {MOST_LINES} are taken")
        if self.clock_s is not None and self.signal not in (None, "prbs"):
            raise UsageError(f"--clock is of prbs; leave it out with --signal {self.signal}")
        if self.band_hz is not None and self.signal == "prbs":
            raise UsageError("--band is of multisine and filtered; prbs has --clock")
        if (self.lines or self.phases) and self.signal not in (None, "multisine"):
            raise UsageError(f"--lines and --phases are of multisine; leave them out with --signal {self.signal}")


def read_goal(modes: Sequence[Mode], step_s: float, goal: float | str | None) -> tuple[Mode, ...]:
    """Return the mode that is to be known best, all that swing where nothing is said; raises UsageError.

    goal: its name, or a frequency in Hz, of which the nearest mode is taken, within a fifth.
    """
    known = swinging(modes, step_s)
    told = ", ".join(f"{m.name} {m.frequency_hz:.4g} Hz".strip() for m in known)
    if not known:
        raise UsageError("the model has no mode that swings below Nyquist, for which an excitation could be designed")
    if goal is None:
        return tuple(known)
    named = [m for m in known if m.name and m.name == str(goal).strip()]
    if named:
        return (named[0],)
    try:
        frequency = float(str(goal).strip().removesuffix("Hz"))
    except ValueError:
        raise UsageError(f"--goal {goal!r} is neither the name of a mode nor a frequency in Hz: {told}") from None
    if math.isfinite(frequency):
        near = min(known, key=lambda m: abs(m.frequency_hz - frequency))
        if abs(near.frequency_hz - frequency) <= 0.2 * near.frequency_hz:
            return (near,)
    raise UsageError(f"--goal {goal}: no mode within a fifth of it; the modes are {told}")


def within_reach(goals: Sequence[Mode], step_s: float, wanted: Wanted) -> tuple[tuple[Mode, ...], str]:
    """Return the goals that a signal with a value every step_s reaches, and a note on those that it does not.

    All are kept where the band or the clock of the signal is asked for: what it tells of each is foretold. Raises
    UsageError where none is left.
    """
    reach = FAST / step_s
    beyond = [m for m in goals if m.frequency_hz >= reach]
    if not beyond or wanted.band_hz is not None or wanted.clock_s is not None or wanted.signal == "prbs":
        return tuple(goals), ""
    told = ", ".join(f"{m.name} {m.frequency_hz:.4g} Hz".strip() for m in beyond)
    what = f"a value every {step_s:g} s reaches up to {reach:.3g} Hz"
    if len(beyond) == len(goals):
        needed = FAST / max(m.frequency_hz for m in beyond)
        raise UsageError(f"--sample-time {step_s:g}: {what}, not to {told}; give less than {needed:.3g} s")
    return tuple(m for m in goals if m not in beyond), f"{what}; nothing is designed for {told}"


def candidates(setup: Setup, goals: Sequence[Mode], wanted: Wanted, rows: int) -> list[Shape]:
    """Return the shapes to try, each once; raises UsageError where what is asked for does not fit."""
    out: list[Shape] = []
    slow, fast = min(m.frequency_hz for m in goals), max(m.frequency_hz for m in goals)
    bands = [_clipped(slow / k, fast * k, setup.step_s) for k in MARGINS] if wanted.band_hz is None else [
        _checked_band(wanted.band_hz, setup.step_s)]  # fmt: skip
    of_band = wanted.band_hz is not None or wanted.lines is not None or wanted.phases is not None
    if wanted.signal == "prbs" or (wanted.signal is None and not (of_band and wanted.clock_s is None)):
        out += [Shape("prbs", c) for c in _clocks(setup, fast, wanted.clock_s, rows)]
    if wanted.signal == "multisine" or (wanted.signal is None and wanted.clock_s is None):
        for band in bands:
            try:
                out.append(_multisine(band, wanted, len(setup.bounds), rows, setup.step_s))
            except UsageError:
                if wanted.signal is not None or of_band:
                    raise  # nobody asked for one: other signals may fit
    if wanted.signal == "filtered" or (
        wanted.signal is None and wanted.clock_s is None and not (wanted.lines or wanted.phases or wanted.playable)
    ):
        out += [Shape("filtered", low_hz=low, high_hz=high) for low, high in bands]
    return list(dict.fromkeys(out))


def _clocks(setup: Setup, fast_hz: float, clock_s: float | None, rows: int) -> list[int]:
    """Return clock periods in rows."""
    if clock_s is None:
        found = [max(round(HALF_POWER / (k * fast_hz) / setup.step_s), 1) for k in WIDTHS]
        return sorted({min(c, max(rows // 31, 1)) for c in found})
    clock = round(clock_s / setup.step_s) if 0 < clock_s < 1e6 else 0
    if clock < 1 or abs(clock * setup.step_s - clock_s) > 1e-6 * clock_s:
        raise UsageError(f"--clock {clock_s:g}: whole multiples of the sample time {setup.step_s:g} s are taken")
    if clock * 31 > rows:
        raise UsageError(f"--clock {clock_s:g}: the duration holds fewer than 31 bits, the shortest sequence")
    return [clock]


def _clipped(low_hz: float, high_hz: float, step_s: float) -> tuple[float, float]:
    return low_hz, min(high_hz, FAST / step_s)


def _checked_band(band: tuple[float, float], step_s: float) -> tuple[float, float]:
    low, high = band
    if not 0 < low < high <= 0.49 / step_s:
        raise UsageError(
            f"--band {low:g},{high:g}: two frequencies in Hz are needed, the lower first, at most {0.49 / step_s:.4g} "
            f"(the signal has a value every {step_s:g} s)"
        )
    return low, high


def _multisine(band: tuple[float, float], wanted: Wanted, inputs: int, rows: int, step_s: float) -> Shape:
    """Return a multisine whose lines lie on multiples of a whole part of the duration, LINES an input at the most."""
    (low, high), duration_s = band, rows * step_s
    most = (wanted.lines or LINES) * inputs
    spacing = max(math.ceil((high - low) * duration_s / most - 1e-9), 1) / duration_s
    shape = Shape("multisine", 0, low, high, spacing, wanted.phases or "schroeder")
    counts = [len(lines_of(shape, i, inputs)) for i in range(inputs)]
    if min(counts) < 2:
        raise UsageError(
            f"--band {low:.4g},{high:.4g}: {duration_s:g} s hold no two lines an input in it; widen it or record longer"
        )
    if max(counts) * rows > MOST_COSINES:
        raise UsageError(f"--lines: {max(counts)} cosines at {rows} instants are too many; ask for fewer")
    return shape
