"""Keep what a fleet is to be judged by: an operating state, a range of wind or power; the rest counts as missing."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aeolid.errors import DataError, UsageError
from aeolid.record import Record, Roles

_NUMBER = r"[-+]?[0-9]*\.?[0-9]+(?:e[-+]?[0-9]+)?"
_RULE = re.compile(rf"(?P<channel>[^=]+)=(?:(?P<low>{_NUMBER})?\.\.(?P<high>{_NUMBER})?|(?P<value>{_NUMBER}))")


@dataclass(frozen=True)
class Keep:
    """Hold one rule: samples in which a channel is from low to high, ends included, are kept."""

    channel: str
    low: float
    high: float

    def text(self) -> str:
        """Return the rule as the option has it."""
        if self.low == self.high:
            return f"{self.channel}={_exact(self.low)}"
        low, high = ("" if math.isinf(v) else _exact(v) for v in (self.low, self.high))
        return f"{self.channel}={low}..{high}"


def _exact(value: float) -> str:
    """Return a number by which it reads back: a factor in the cache is named by it."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def parse_keep(text: str, roles: Roles) -> Keep:
    """Read wind=8..12, power=100.. or status=1; raises UsageError on anything else and on channels that are not read.

    >>> from aeolid.record import Channel
    >>> parse_keep("wind=8..", Roles((Channel("wind", "m/s", "scheduling"),), 0.1, None, "r")).text()
    'wind=8..'
    """
    found = _RULE.fullmatch(text.strip())
    if found is None or text.strip().endswith("=.."):
        raise UsageError(f"--keep {text!r}: not understood; give wind=8..12, power=100.. or status=1")
    channel = found["channel"].strip()
    names = [c.name for c in roles.channels if c.role != "ignore"]
    if channel not in names:
        hint = "a status that is nothing else may have the role scheduling"
        raise UsageError(f"--keep {text!r}: no channel {channel!r} in {roles.source}; {hint}: {', '.join(names)}")
    if found["value"] is not None:
        return Keep(channel, float(found["value"]), float(found["value"]))
    low = -math.inf if found["low"] is None else float(found["low"])
    high = math.inf if found["high"] is None else float(found["high"])
    if not low <= high:
        raise UsageError(f"--keep {text!r}: its lower end is above its upper one")
    return Keep(channel, low, high)


def kept(record: Record, rules: Sequence[Keep]) -> Record:
    """Return a recording whose samples outside of any rule are missing, so that no window reaches across them.

    Raises DataError where nothing is left. A sample whose state is missing is left out too.
    """
    if not rules:
        return record
    inside = np.ones(len(record), dtype=bool)
    for rule in rules:
        values = record.column(rule.channel)
        inside &= (values >= rule.low) & (values <= rule.high)  # false of NaN
    if not inside.any():
        raise DataError(f"{record.source}: no sample with {', '.join(r.text() for r in rules)}")
    return replace(record, values=np.where(inside[:, None], record.values, np.nan))
