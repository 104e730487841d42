"""Say how a recording is filtered, and check what was asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aeolid.errors import AeolidError, DataError, NotIdentifiable, UsageError

Array = NDArray[np.float64]

CHANNELS_MAX = 32  # AEO_REGRESSOR_CHANNELS_MAX
REGRESSORS_MAX = 1024  # AEO_REGRESSOR_LENGTH_MAX, AEO_RLS_REGRESSORS_MAX
METHODS = ("rls", "els", "fast-rls", "lattice")  # the order of chosen_method_t
MODEL_SETS = ("varx", "varmax")  # the order of aeo_model_set_t
FORGETTING = {"fast-rls": 0.999}  # the default where 1, which forgets nothing, suits short recordings only
RANGES = {
    "forgetting": (0.5, 1.0), "regularisation": (1e-8, 1e8), "excitation_min": (0.0, 1.0), "growth_max": (4.0, 1e6)
}  # fmt: skip
VARIANCE_MAX = 1e10  # of growth_max / regularisation
REGRESSORS_A_MEMORY = {"fast-rls": 3.0}  # at most so many for each sample of a memory (CROWDED_MAX of fast_rls.c)
ROUNDED = 1.00001  # what the rounding of a forgetting factor may add to that
# What forgetting must leave of a sample after p - 1 samples: lattices refuse windows longer than what they remember
# (FADED_MIN of lattice.c).
REMEMBERED = {"lattice": 1e-6}
LARGEST = {"f32": float(np.finfo(np.float32).max), "f64": float(np.finfo(np.float64).max)}
RESOLUTION = {"f32": 2.0**-23, "f64": 2.0**-52}  # of a number beside its size
REGRESSOR_COUNTERS = ("samples", "rejected_not_finite", "rejected_range", "rejected_time", "gaps")
RLS_COUNTERS = ("updates", "updates_rejected", "forgetting_withheld", "variances_bounded", "reinitialised", "released")
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
    128: "covariance released after a fault",
}  # AEO_RLS_WITHHELD …, AEO_ELS_FELL_BACK …, AEO_LATTICE_RESTARTED, AEO_RLS_RELEASED


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


def with_els_defaults(settings: FilterSettings, regressors: int, samples: int) -> FilterSettings:
    """Return the settings with what els.h recommends: a VARX start of 10 n samples, at most a quarter of the recording.

    The schedule starts at 0.99, or at λ where that is smaller, and closes a hundredth of the distance to λ a sample;
    the guard falls back to VARX when the power of innovations grows to four times that of the start.
    """
    return replace(
        settings,
        varx_samples=max(16, min(10 * regressors, samples // 4)),
        forgetting_start=min(0.99, settings.forgetting),
        forgetting_rate=0.99,
        guard_ratio=4.0,
    )


def check_sizes(r: int, ny: int, past: int, feedthrough: tuple[int, ...], sample_time_s: float, model_set: str) -> None:
    """Refuse sizes that the C library would refuse, in words."""
    longest = (REGRESSORS_MAX - r) // block_length(r, ny, model_set)
    if not 1 <= past <= longest:
        raise UsageError(f"past = {past}: with {r} inputs and {ny} outputs it must be 1 to {longest}")
    for index in feedthrough:
        if not 0 <= index < r:
            raise UsageError(
                f"feedthrough names input {index}; there are {f'inputs 0 to {r - 1}' if r else 'no inputs'}"
            )
    if not 1e-6 <= sample_time_s <= 4000.0:
        raise UsageError(f"sample_time_s = {sample_time_s} is not between 1e-6 and 4000 seconds")


def check_ranges(settings: FilterSettings, regressors: int) -> None:
    """Refuse numbers that the C library would refuse for so many regressors, by name."""
    for name, (least, most) in RANGES.items():
        value = getattr(settings, name)
        if not least <= value <= most:
            raise UsageError(f"{name} = {value:g} is not between {least:g} and {most:g}")
    if settings.growth_max / settings.regularisation > VARIANCE_MAX:
        raise UsageError(
            f"growth_max / regularisation = {settings.growth_max:g} / {settings.regularisation:g} is above "
            f"{VARIANCE_MAX:g}; take a smaller growth_max or more regularisation"
        )
    check_memory(settings.method, settings.past, settings.forgetting, regressors)


def check_memory(method: str, past: int, forgetting: float, regressors: int) -> None:
    """Refuse a past window longer than what a filter of linear cost remembers."""
    crowded = REGRESSORS_A_MEMORY.get(method)
    if crowded is not None and regressors * (1.0 - forgetting) > ROUNDED * crowded:
        raise UsageError(
            f"forgetting = {forgetting:g} remembers {1.0 / (1.0 - forgetting):.3g} samples; {method} with "
            f"{regressors} regressors needs {regressors / crowded:.3g}: take at least "
            f"{least_forgetting(regressors, crowded):.4f}, a shorter window, rls or lattice"
        )
    least, span = REMEMBERED.get(method, 0.0), past - 1
    if forgetting**span < least:
        raise UsageError(
            f"forgetting = {forgetting:g} leaves {forgetting**span:.1g} of a sample after a past window of {past}; "
            f"{method} needs {least:g}: take at least {least ** (1 / span):.4f}, a shorter window, or rls"
        )


def least_forgetting(regressors: int, crowded: float) -> float:
    """Return the least forgetting factor for so many regressors in steps of 1e-4, rounded up so that it is taken."""
    return float(np.ceil((1.0 - crowded / regressors) * 1e4 - 1e-9)) / 1e4


def find_fault(name: str, samples: Array, precision: str) -> AeolidError | None:
    """Return what makes a channel useless to a filter, None where nothing does.

    name: how the text calls it; samples (N,). A spread below what the precision shows beside the mean is no signal,
    and one beyond its largest number no scale.
    """
    finite = samples[np.isfinite(samples)]
    if not finite.size:
        return DataError(f"{name} holds no finite sample; take it out of the roles or repair the recording")
    if finite.min() == finite.max():
        return NotIdentifiable(
            f"{name} is constant ({finite[0]:g}); give it the role ignore, and in a controller excite it or leave it "
            "out of the filter"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        mean, spread = float(finite.mean()), float(finite.std())
    most = LARGEST.get(precision, LARGEST["f64"])
    if not (abs(mean) <= most and spread <= most):
        wider = (
            " or take f64" if precision == "f32" and abs(mean) <= LARGEST["f64"] and spread <= LARGEST["f64"] else ""
        )
        return DataError(
            f"{name} has values up to {np.max(np.abs(finite)):.3g}: its mean or its deviation is beyond what"
            f" {precision} holds; give it in a larger unit{wider}, or give it the role ignore"
        )
    if spread <= RESOLUTION.get(precision, 0.0) * abs(mean):
        return NotIdentifiable(
            f"{name} varies by {spread:.2g} about {mean:g}, less than {precision} shows; "
            "take the constant part off, or give it the role ignore"
        )
    return None


def fill_tables(
    samples: Array,
    precision: str,
    offset: ArrayLike | None,
    scale: ArrayLike | None,
    minimum: ArrayLike | None,
    maximum: ArrayLike | None,
) -> tuple[Array, Array, Array, Array]:
    """Fill in what the caller left open: mean, standard deviation, no limits."""
    channels = samples.shape[1]
    if offset is None or scale is None:
        for i, column in enumerate(samples.T):
            fault = find_fault(f"channel {i} (inputs first)", column, precision)
            if fault is not None:
                raise fault
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
