"""Look at the recording itself before believing it: missing, stuck, clipped, coarse or folded channels (S0)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aeolid.diagnose.data.folded import folded_of
from aeolid.diagnose.data.held import discretise
from aeolid.diagnose.data.range_ends import rails
from aeolid.diagnose.data.standing import Baseline, stretches_of, words
from aeolid.diagnose.data.strays import codes_of, dropouts_of, strays_of, without_codes
from aeolid.diagnose.rules import in_force
from aeolid.errors import DataError
from aeolid.models.equations import Equations
from aeolid.models.state_space import StateSpace
from aeolid.record import Channel, Record
from aeolid.wording import counted

Array = NDArray[np.float64]
SWAPPED = "swapped"  # the check of two outputs under each other's name
_BESIDE = ("scheduling", "azimuth", "excitation")  # roles that a model need not have: none of their samples is a fault
_SAME = "sample by sample the same as"
_CHANGES = 20  # of which a pace is estimated
_DIGITS = 1e-4  # of the spread: what the digits that files are written with may leave between two channels
RATIOS: tuple[tuple[float, str], ...] = (
    (180 / np.pi, "degrees to a radian"),
    (30 / np.pi, "rpm to a rad/s"),
    (6.0, "deg/s to an rpm"),
    (9.80665, "m/s^2 to a g"),
    (10.0, "a decimal place"),
    (60.0, "seconds to a minute"),
    (3.6, "km/h to a m/s"),
    (100.0, "centimetres to a metre"),
    (1000.0, "a thousand"),
)


@dataclass(frozen=True)
class Finding:
    """Say what a check found on one channel; severity is info, warning or fault.

    left_out: whether the samples in question take no part in the diagnosis, which goes on without them.
    """

    check: str
    channel: str
    finding: str
    severity: str
    left_out: bool = False

    def to_json(self) -> dict[str, str]:
        """Return the row of the report's appendix."""
        return {"check": self.check, "channel": self.channel, "finding": self.finding, "severity": self.severity}


def examine(records: Sequence[Record], baseline: Baseline = None) -> tuple[Finding, ...]:
    """Check every channel that takes part, alone, in pairs and against a free run of the baseline that is a model.

    Cost O(N) a channel and pair, and one simulation.
    """
    findings: list[Finding] = []
    for record in records:
        name = record.source.rsplit("/", 1)[-1]
        for channel in record.of("input", "output", "disturbance"):
            findings += _channel(channel, record.column(channel.name), name, len(records) == 1)
        for channel in record.of(*_BESIDE):
            findings += _codes(record.column(channel.name), f"{channel.name} ({name})", None)
        findings += _pairs(record, name)
        if isinstance(baseline, StateSpace | Equations):
            findings += _against_model(baseline, record, name)
    if len(records) > 1:
        findings += [f for c in records[0].of("output") for f in _in_all(c, records)]
    return (*findings, *_standing(records, baseline))


def _in_all(channel: Channel, records: Sequence[Record]) -> list[Finding]:
    """Recognise an output that none of several recordings has: never changing, or most of it missing."""
    values = np.concatenate([r.column(channel.name) for r in records])
    good = values[np.isfinite(values)]
    where = f"{channel.name} (all recordings)"
    if len(good) < 2 or np.ptp(good) == 0:
        return [Finding("constant", where, "never changes", "fault")]
    if len(values) - len(good) > in_force().data.missing_share * len(values):
        text = f"{len(values) - len(good)} of {len(values)} samples are missing"
        return [Finding("missing", where, text, "fault")]
    return []


def _standing(records: Sequence[Record], baseline: Baseline) -> list[Finding]:
    """Say where outputs hold one value: a machine at rest, one that may stand, a sensor that is stuck."""
    rules = in_force().data
    stretches, found = stretches_of(records, baseline), []
    for channel in records[0].of("output"):
        own = [s for s in stretches if s.channel == channel.name]
        every = sum(len(r) for r in records)
        much = sum(len(s) for s in own if s.kind == "stuck") > rules.stuck_share * every
        for s in own:
            where = f"{channel.name} ({records[s.record].source.rsplit('/', 1)[-1]})"
            severity = "info" if s.kind != "stuck" else "fault" if much else "warning"
            check = "stuck" if s.kind == "stuck" else "standing"
            text = words(s, channel, records[s.record])
            found.append(Finding(check, where, text, severity, s.kind in ("rest", "stuck")))
    return found


def _channel(channel: Channel, values: Array, source: str, alone: bool) -> list[Finding]:
    rules = in_force().data
    where, found = f"{channel.name} ({source})", []
    missing = int(np.sum(~np.isfinite(values)))
    if missing:
        text = f"{missing} of {len(values)} samples are missing; they are left out"
        most = alone and missing > rules.missing_share * len(values)
        found.append(Finding("missing", where, text, "fault" if most else "warning", not most))
    v = values[np.isfinite(values)]
    if len(v) < 2 or np.ptp(v) == 0:
        if channel.role == "output" and not alone:  # said with its stretches, or of all recordings
            return found
        return [*found, Finding("constant", where, "never changes", "fault" if channel.role == "output" else "warning")]
    if channel.role == "output":
        usual = v[~(codes_of(v) | strays_of(v) | dropouts_of(v))]  # one wild value would stretch the range
        found += _rails(usual, where) if len(usual) else []
        found += _held(v, where)
        folded = folded_of(usual) if len(usual) else None
        if folded:
            found.append(Finding("folded", where, folded, "warning"))
    found += _unlikely(v, where, channel.role == "output") + _unit(channel, v, where)
    step = spacing_of(v)
    if step is not None and step > rules.coarse_spacing_share * float(np.std(v)):
        found.append(
            Finding("spacing", where, f"values are {step:.3g} apart ({step / np.std(v):.0%} of the spread)", "info")
        )
    return found


def _rails(v: Array, where: str) -> list[Finding]:
    rules, found = in_force().data, []
    words = {"high": "highest", "low": "lowest"}
    for side, rail in rails(v).items():
        share = float(np.mean(np.abs(v - rail) <= rules.pile_width * np.ptp(v)))
        end = float(v.min() if side == "low" else v.max())
        text = f"{share:.1%} of the samples sit at the {words[side]} value {rail:.4g}"
        if rail != end:  # a pile that noise has blurred
            text = f"{share:.1%} of the samples sit about {rail:.4g}, near the {words[side]} value {end:.4g}"
        found.append(Finding("rail", where, text, "warning"))
    return found


def _held(v: Array, where: str) -> list[Finding]:
    """Recognise a channel that a slower logger renews: most samples repeat the one before, at a steady pace."""
    rules = in_force().data
    moves = np.flatnonzero(np.diff(v) != 0)
    if len(moves) < _CHANGES or len(np.unique(v)) < rules.held_share * len(moves):
        return []
    pace = np.diff(moves)
    usual = int(np.median(pace))
    if usual < 2 or float(np.mean(pace == usual)) < rules.held_share:
        return []
    text = f"renewed only every {usual} samples: its logger is slower than the others"
    return [Finding("held", where, text, "warning")]


def _unlikely(v: Array, where: str, is_output: bool) -> list[Finding]:
    """Say codes for "no value" and single samples far outside everything else."""
    rules = in_force().data
    alone, dropped = strays_of(v), dropouts_of(without_codes(v))
    found = _codes(v, where, rules.missing_share)
    if is_output and np.any(dropped):
        text = (
            f"{int(dropped.sum())} samples read {v[dropped][0]:g}, far from those before and after; they are left out"
        )
        found.append(Finding("dropout", where, text, "warning", True))
    if np.any(alone):
        first = int(np.flatnonzero(alone)[0])
        far = f"{rules.stray_spreads:g} spreads off"
        text = (
            f"{counted(int(alone.sum()), 'single sample', ('lies', 'lie'))} more than {far}, the first {v[first]:.4g}"
        )
        found.append(Finding("spike", where, text + ("; left out" if is_output else ""), "warning", is_output))
    return found


def _codes(v: Array, where: str, most: float | None) -> list[Finding]:
    """Say codes for "no value" in samples (N,); a fault where they are more than the share `most`, None: never."""
    coded = codes_of(v)
    if not np.any(coded):
        return []
    fault = most is not None and float(coded.mean()) > most
    text = (
        f"{counted(int(coded.sum()), 'sample', ('reads', 'read'))} {float(v[coded][0]):g}, a usual code for a missing "
        "value; left out"
    )
    return [Finding("code", where, text, "fault" if fault else "warning", not fault)]


def _unit(channel: Channel, v: Array, where: str) -> list[Finding]:
    """Doubt an angle in radians that spans more than two turns without being a rotor angle."""
    if channel.unit.strip() != "rad" or not any(w in channel.name.lower() for w in ("pitch", "yaw", "tilt", "angle")):
        return []
    if float(np.max(np.abs(v))) <= 4 * np.pi:
        return []
    return [Finding("unit", where, f"stated in rad, yet reaches {np.max(np.abs(v)):.4g}: these are degrees", "warning")]


def _pairs(record: Record, name: str) -> list[Finding]:
    """Compare channels of one role two by two: the same samples twice, mirrored, folded, or in another unit."""
    rules = in_force().data
    found = []
    for role in ("input", "output"):
        for a, b in itertools.combinations(record.of(role), 2):
            x, y = record.column(a.name), record.column(b.name)
            both = np.isfinite(x) & np.isfinite(y)
            if both.sum() < rules.compared_rows or np.ptp(x[both]) == 0 or np.ptp(y[both]) == 0:
                continue
            text = _kinship(x[both], y[both])
            if text:
                severity = "fault" if role == "output" and text == _SAME else "info"
                found.append(Finding("pair", f"{b.name} ({name})", f"{text} {a.name}", severity))
    return found


def _kinship(x: Array, y: Array) -> str | None:
    if np.array_equal(x, y):
        return _SAME
    if np.array_equal(x, -y):
        return "the mirror image of"
    if np.array_equal(np.abs(x), y) or np.array_equal(x, np.abs(y)):
        return "the absolute value of (or the other way round)"
    ratio = float(x @ y) / float(x @ x)
    if float(np.max(np.abs(y - ratio * x))) > _DIGITS * float(np.std(y)):
        return None
    return f"{ratio:.5g} times{ratio_text(ratio)}"


def ratio_text(factor: float) -> str:
    """Say which ratio of units a factor (or one over it) is, or nothing."""
    near = in_force().data.known_ratio_distance
    for ratio, said in RATIOS:
        if abs(abs(factor) / ratio - 1) < near or abs(abs(factor) * ratio - 1) < near:
            return f" ({ratio:.4g}, {said}: check the unit)"
    return ""


def _against_model(baseline: StateSpace | Equations, record: Record, name: str) -> list[Finding]:
    """Compare each output with every simulated one: swapped channels, reversed signs and other units show there."""
    rules = in_force().data
    try:
        if isinstance(baseline, Equations):
            simulated = baseline.simulate(record)
        else:
            model = discretise(baseline, record.sample_time_s)
            simulated = model.simulate(record.columns([s.name for s in model.inputs]))
    except DataError:
        return []
    names = [o.name for o in baseline.outputs]
    measured = record.columns(names)
    rows = np.all(np.isfinite(measured), axis=1) & np.all(np.isfinite(simulated), axis=1)
    spreads = [a[rows].std(axis=0) if rows.sum() > rules.compared_rows else np.zeros(1) for a in (measured, simulated)]
    if not all(np.all(np.isfinite(s) & (s > 0)) for s in spreads):
        return []
    y, m = ((a[rows] - a[rows].mean(axis=0)) / s for a, s in zip((measured, simulated), spreads, strict=True))
    alike = y.T @ m / len(y)  # (l, l): recorded output against simulated output
    found = [_swap(names, i, j, name) for i, j in itertools.combinations(range(len(names)), 2) if _crossed(alike, i, j)]
    for i, output in enumerate(names):
        where, ratio = f"{output} ({name})", float(spreads[0][i] / spreads[1][i] * alike[i, i])
        if alike[i, i] < -rules.recognised_correlation:
            found.append(Finding("sign", where, "moves against the model's output: is the sign reversed?", "warning"))
        other_unit = not 1 / rules.unit_ratio < abs(ratio) < rules.unit_ratio
        if abs(alike[i, i]) > rules.recognised_correlation and other_unit and ratio_text(ratio):
            text = f"is {ratio:.4g} times the model's output{ratio_text(ratio)}"
            found.append(Finding("unit", where, text, "warning"))
    return found


def _crossed(alike: Array, i: int, j: int) -> bool:
    rules = in_force().data
    own = max(abs(float(alike[i, i])), abs(float(alike[j, j])))
    return min(float(alike[i, j]), float(alike[j, i])) > max(rules.recognised_correlation, own + rules.swapped_lead)


def _swap(names: Sequence[str], i: int, j: int, source: str) -> Finding:
    text = f"looks like {names[j]}, and {names[j]} like {names[i]}: the two channels are swapped"
    return Finding(SWAPPED, f"{names[i]} ({source})", text, "fault")


def grid_of(v: Array) -> float | None:
    """Return the step of which all values are whole multiples from each other, however many there are; None elsewhere.

    Numbers that were written with so many digits lie on a grid, too: a far finer one than any converter's.
    """
    distinct = np.unique(v)
    if len(distinct) < 2:
        return None
    step = float(np.min(np.diff(distinct)))
    places = (distinct - distinct[0]) / step
    return step if np.all(np.abs(places - np.rint(places)) < in_force().data.grid_miss) else None


def spacing_of(v: Array) -> float | None:
    """Return the distance of neighbouring values where there are few distinct ones; None elsewhere."""
    distinct = np.unique(v)
    if len(distinct) > in_force().data.grid_distinct_share * len(v) or len(distinct) < 2:
        return None
    return float(np.min(np.diff(distinct)))
