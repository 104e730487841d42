"""The pieces of work a fleet run hands out: file to factor, factors to a period, period to model.

Each reads and writes files of the cache and returns a few facts, so that no array travels between processes and what
is finished stays finished. A piece that fails returns its reason; it never ends the run.
"""

from __future__ import annotations

import hashlib
import os
import time
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aeolid.errors import AeolidError
from aeolid.fleet.keep import kept
from aeolid.fleet.modelling import choose_common_order, model_summary
from aeolid.fleet.plan import Plan
from aeolid.fleet.summary import Summary, load, merge_all, save, summarise
from aeolid.formats import read_record
from aeolid.formats.recording import recording_sha256
from aeolid.output import make_folder

BROKEN = (OSError, ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile)  # what a damaged cache file may raise

STALE_S = 3600.0  # age of a half-written file after which nobody writes it any more
MOST_PERIODS = 24  # that choose the order of a turbine, spread evenly over time: bounds time and memory


@dataclass(frozen=True)
class FileDone:
    """Hold what became of one recording: `factor` names its file in the cache, `reason` says why there is none."""

    path: str
    reason: str | None = None
    sha256: str = ""
    factor: str = ""
    start_s: float = 0.0
    sample_time_s: float = 0.0
    windows: int = 0
    reused: bool = False


@dataclass(frozen=True)
class Period:
    """Name the factors of one turbine and period; `order` is set before the model is made."""

    turbine: str
    label: str
    start_s: float
    factors: tuple[str, ...]
    order: int | None = None
    middle_s: float = 0.0  # mean start of its recordings

    @property
    def merged(self) -> str:
        """Return the name of the merged factor: that of its members, whatever their order."""
        return hashlib.sha256("".join(self.factors).encode()).hexdigest()


def prepare_cache(cache: Path) -> None:
    """Make the folders of the cache and clear what a killed run left half written; raises OSError."""
    for name in ("factors", "periods"):
        make_folder(cache / name)
        for left in (cache / name).glob("*.part"):
            if time.time() - left.stat().st_mtime > STALE_S:  # a younger one may be another run's
                left.unlink(missing_ok=True)


def compress_file(path: str, plan: Plan, cache: str) -> FileDone:
    """Compress one recording into the cache, or find it there."""
    try:
        digest = recording_sha256(path)
        name = plan.cache_key(digest)
        target = Path(cache) / "factors" / f"{name}.npz"
        summary, reused = _cached(target), True
        if summary is None:
            summary, reused = summarise(kept(read_record(path, plan.roles), plan.keep), plan.past), False
            save(summary, target)
    except Exception as error:  # whatever one file does, the others go on; the table of reasons names it
        return FileDone(path, reason_of(error))
    done = FileDone(path, None, digest, name, summary.start_s, summary.sample_time_s)
    return FileDone(**done.__dict__ | {"windows": sum(summary.windows), "reused": reused})


def merge_period(period: Period, cache: str) -> str | None:
    """Merge the factors of a period into the cache, or find the result there; returns a reason, None when done."""
    target = Path(cache) / "periods" / f"{period.merged}.npz"
    try:
        if _cached(target) is None:
            save(merge_all(load(Path(cache) / "factors" / f"{name}.npz") for name in period.factors), target)
    except Exception as error:
        return reason_of(error)
    return None


def order_of(periods: Sequence[Period], plan: Plan, cache: str) -> tuple[int, str] | str:
    """Return the order for all periods of a turbine and why, or only a reason why there is none."""
    try:
        folder = Path(cache) / "periods"
        count = min(len(periods), MOST_PERIODS)
        chosen = [periods[i * len(periods) // count] for i in range(count)]
        return choose_common_order([load(folder / f"{period.merged}.npz") for period in chosen], plan)
    except Exception as error:
        return reason_of(error)


def model_period(period: Period, plan: Plan, cache: str) -> dict[str, Any] | str:
    """Return the facts of the model of a period, or a reason why there is none."""
    try:
        summary = load(Path(cache) / "periods" / f"{period.merged}.npz")
        assert period.order is not None
        return model_summary(summary, plan, period.order, f"{period.turbine}, period {period.label}")
    except Exception as error:
        return reason_of(error)


def reason_of(error: BaseException) -> str:
    """Say in one sentence why a piece of work failed."""
    if isinstance(error, AeolidError):
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or 'file'}: {error.strerror or error}"
    return f"unexpected {type(error).__name__}: {' '.join(str(error).split())[:200]}"


def _cached(path: Path) -> Summary | None:
    """Return a summary from the cache, None where there is none or a damaged one (which is removed)."""
    if not path.exists():
        return None
    try:
        return load(path)
    except BROKEN:
        if path.exists():
            os.unlink(path)
        return None
