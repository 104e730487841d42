"""Say how a recording is filtered, and check what was asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aeolid.errors import DataError, UsageError

Array = NDArray[np.float64]

CHANNELS_MAX = 32  # AEO_REGRESSOR_CHANNELS_MAX
REGRESSORS_MAX = 1024  # AEO_REGRESSOR_LENGTH_MAX, AEO_RLS_REGRESSORS_MAX
METHODS = ("rls", "els", "fast-rls", "lattice")  # the order of chosen_method_t
FAST = ("fast-rls", "lattice")  # cost linear in p
MODEL_SETS = ("varx", "varmax")  # the order of aeo_model_set_t
FORGETTING = {"fast-rls": 0.999}  # the default where 1, which forgets nothing, suits short recordings only
REGRESSOR_COUNTERS = ("samples", "rejected_not_finite", "rejected_range", "rejected_time", "gaps")
RLS_COUNTERS = ("updates", "updates_rejected", "forgetting_withheld", "variances_bounded", "reinitialised")
COUNTERS = REGRESSOR_COUNTERS + RLS_COUNTERS  # the order of aeo_replay_t.count, first those that every filter has
OWN_COUNTERS = {"fell_back": ("els",), "feedback_limited": ("els",), "windows_restarted": ("fast-rls", "lattice")}
HEALTH = {
    1: "forgetting withheld",
    2: "variance bounded",
    4: "re-initialised",
    8: "fell back to VARX",
    16: "window restarted",
    32: "feedback limited",
    64: "residual not fed back",
}  # AEO_RLS_WITHHELD …, AEO_ELS_FELL_BACK …, AEO_LATTICE_RESTARTED


@dataclass(frozen=True)
class FilterSettings:
    """Say how a recording was filtered; with the same recording it gives the same bits.

    offset, scale (r + l values, inputs first) in the channels' units; feedthrough lists input indices whose present
    value is a regressor. model_set: "varx" or "varmax". varx_samples … guard_ratio: of extended least squares (els.h),
    None for the other filters.
    """

    method: str
    precision: str
    past: int
    forgetting: float
    regularisation: float
    feedthrough: tuple[int, ...]
    excitation_min: float
    growth_max: float
    sample_time_s: float
    offset: tuple[float, ...]
    scale: tuple[float, ...]
    model_set: str = "varx"
    varx_samples: int | None = None
    forgetting_start: float | None = None
    forgetting_rate: float | None = None
    guard_ratio: float | None = None

    def regressors(self, inputs: int, outputs: int) -> int:
        """Return n for so many inputs and outputs."""
        return self.past * block_length(inputs, outputs, self.model_set) + len(self.feedthrough)


def block_length(inputs: int, outputs: int, model_set: str) -> int:
    """Return m: r + l, or r + 2 l for VARMAX."""
    return inputs + outputs * (2 if model_set == "varmax" else 1)


def choose_model_set(method: str, model_set: str | None) -> str:
    """Return the model set of a method: VARMAX for els, VARX for the others where nothing was asked for."""
    if method not in METHODS:
        raise UsageError(f"method {method!r} is none of {', '.join(METHODS)}")
    if model_set is None:
        return "varmax" if method == "els" else "varx"
    if model_set not in MODEL_SETS:
        raise UsageError(f"model set {model_set!r} is none of {', '.join(MODEL_SETS)}")
    if method == "els" and model_set == "varx":
        raise UsageError("method els estimates a VARMAX predictor; for VARX take rls")
    return model_set


def els_settings(method: str, regressors: int, samples: int, forgetting: float) -> dict[str, float]:
    """Return the settings els.h recommends: a VARX start of 10 n samples, at most a quarter of the recording.

    The schedule starts at λ = 0.99 (or below λ, where that is smaller) and moves towards λ by a hundredth a sample; the
    guard falls back to VARX when innovations grow to twice those of the start.
    """
    if method != "els":
        return {}
    start = max(16, min(10 * regressors, samples // 4))
    return {
        "varx_samples": start, "forgetting_start": min(0.99, forgetting), "forgetting_rate": 0.99, "guard_ratio": 4.0
    }  # fmt: skip


def check_sizes(r: int, ny: int, past: int, feedthrough: tuple[int, ...], sample_time_s: float, model_set: str) -> None:
    """Refuse sizes that the C library would refuse, in words."""
    longest = (REGRESSORS_MAX - r) // block_length(r, ny, model_set)
    if not 1 <= past <= longest:
        raise UsageError(f"past = {past}: with {r} inputs and {ny} outputs it must be 1 to {longest}")
    for index in feedthrough:
        if not 0 <= index < r:
            raise UsageError(f"feedthrough names input {index}; there are inputs 0 to {r - 1}")
    if not 1e-6 <= sample_time_s <= 4000.0:
        raise UsageError(f"sample_time_s = {sample_time_s} is not between 1e-6 and 4000 seconds")


def describe_dead_channel(samples: Array) -> str:
    """Say what makes a channel useless; empty where nothing does."""
    finite = samples[np.isfinite(samples)]
    if not finite.size:
        return "holds no finite sample; take it out of the roles or repair the recording"
    if np.ptp(finite) == 0.0:
        return f"is constant ({finite[0]:g}); give it the role ignore"
    return ""


def fill_tables(
    samples: Array,
    offset: ArrayLike | None,
    scale: ArrayLike | None,
    minimum: ArrayLike | None,
    maximum: ArrayLike | None,
) -> tuple[Array, Array, Array, Array]:
    """Fill in what the caller left open: mean, standard deviation, no limits."""
    channels = samples.shape[1]
    if offset is None or scale is None:
        for i, column in enumerate(samples.T):
            problem = describe_dead_channel(column)
            if problem:
                raise DataError(f"channel {i} (inputs first) {problem}")
    finite = np.where(np.isfinite(samples), samples, np.nan)
    far = float(np.finfo(np.float32).max)
    return (
        _table(np.nanmean(finite, axis=0) if offset is None else offset, channels, "offset"),
        _table(np.nanstd(finite, axis=0) if scale is None else scale, channels, "scale"),
        _table(np.full(channels, -far) if minimum is None else minimum, channels, "minimum"),
        _table(np.full(channels, far) if maximum is None else maximum, channels, "maximum"),
    )


def _table(values: ArrayLike, channels: int, name: str) -> Array:
    table = np.ascontiguousarray(values, dtype=np.float64)
    if table.shape != (channels,) or not np.all(np.isfinite(table)):
        raise UsageError(f"{name} must hold {channels} finite values, inputs first; it has shape {table.shape}")
    if name == "scale" and np.any(table <= 0.0):
        raise UsageError(f"scale must be above 0; entry {int(np.argmin(table))} is {table.min():g}")
    return table
