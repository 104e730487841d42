"""Replay samples and recordings through the C filters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.filters.result import FilterResult
from aeolid.filters.settings import (
    CHANNELS_MAX,
    COUNTERS,
    FORGETTING,
    METHODS,
    MODEL_SETS,
    OWN_COUNTERS,
    FilterSettings,
    check_ranges,
    check_sizes,
    choose_model_set,
    fill_tables,
    find_fault,
    with_els_defaults,
)
from aeolid.native import foreign_interface, load_library
from aeolid.record import Record

Array = NDArray[np.float64]


def replay_filter(
    u: ArrayLike,
    y: ArrayLike,
    *,
    past: int,
    method: str = "rls",
    model_set: str | None = None,
    sample_time_s: float = 1.0,
    forgetting: float | None = None,
    regularisation: float = 0.1,
    precision: str = "f32",
    feedthrough: tuple[int, ...] = (),
    offset: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    minimum: ArrayLike | None = None,
    maximum: ArrayLike | None = None,
    time_s: ArrayLike | None = None,
    excitation_min: float = 0.05,
    growth_max: float = 10.0,
) -> FilterResult:
    """Replay samples through the C regressor and one of the C filters.

    Minimises sum λ^(k-i) |y_i - θ z_i|² + λ^(k+1) ρ |θ|² in scaled units (paper 000 section II-E); the filters' headers
    say what each does beyond that: rls and els weigh all of θ alike, the fast ones older blocks less.

    u (N, r), y (N, l): one row a sample, the channels' units; NaN rows are rejected and counted, the window refills.
    r = 0 makes an autoregression of the outputs.
    past: p ≥ 1, blocks of the window, p m + r ≤ 1024 with m = r + l (VARX) or r + 2 l (VARMAX).
    method: "rls" (square-root least squares, default), "els" (extended: VARMAX), "fast-rls" or "lattice" (cost linear
    in p). model_set: "varx" or "varmax", default what the method is for; VARMAX feeds the residual back.
    sample_time_s: 1e-6 … 4000; only its ratio to time_s matters. time_s (N,): default 0, h, 2 h …; holes are gaps.
    forgetting: λ, 0.5 … 1, default 1 (all samples count alike), for fast-rls, whose long runs need λ < 1, 0.999. The
    linear ones refuse a window longer than their memory: λ^p ≥ 1e-3 (fast-rls), λ^(p−1) ≥ 1e-6 (lattice).
    regularisation: ρ, 1e-8 … 1e8, default 0.1, as if a tenth of a sample of unit size had been seen in each direction:
    on singular turbine data the smallest that single precision bears out (2e-4 from batch least squares).
    precision: "f32" (the firmware's, default) or "f64".
    feedthrough: indices of inputs whose present value is a regressor, default none, because under feedback they bias
    the result. offset, scale (r + l,): default mean and standard deviation of the samples given.
    minimum, maximum (r + l,): plausible range, default unlimited. excitation_min, growth_max: as in rls.h.

    Returns FilterResult. Raises UsageError for a setting out of range, DataError for an empty channel, times that go
    back or parameters that left single precision, NotIdentifiable for a constant channel or when no sample has a full
    past window. Cost, operations a sample in C: about 2.5 n² + 4 l n (rls, els), linear in n (fast-rls, lattice).

    >>> rng = np.random.default_rng(1)
    >>> u = rng.standard_normal((500, 1))
    >>> y = np.vstack([[0.0], 0.5 * u[:-1]])
    >>> result = replay_filter(u, y, past=1)
    >>> bool(abs(result.theta[0, 0] - 0.5) < 2e-3)
    True
    """
    inputs, outputs = _as_samples(u, "u", least=0), _as_samples(y, "y")
    if len(inputs) != len(outputs):
        raise UsageError(f"u has {len(inputs)} samples, y has {len(outputs)}; they must match")
    chosen = choose_model_set(method, model_set)
    check_sizes(inputs.shape[1], outputs.shape[1], past, feedthrough, sample_time_s, chosen)
    tables = fill_tables(np.hstack([inputs, outputs]), precision, offset, scale, minimum, maximum)
    through = tuple(sorted(set(feedthrough)))
    lambda_end = FORGETTING.get(method, 1.0) if forgetting is None else float(forgetting)
    settings = FilterSettings(
        method, precision, past, lambda_end, float(regularisation), through, float(excitation_min), float(growth_max),
        float(sample_time_s), tuple(tables[0].tolist()), tuple(tables[1].tolist()), chosen,
    )  # fmt: skip
    regressors = settings.regressors(inputs.shape[1], outputs.shape[1])
    check_ranges(settings, regressors)
    if method == "els":
        settings = with_els_defaults(settings, regressors, len(inputs))
    return _run(inputs, outputs, _microseconds(time_s, len(inputs), sample_time_s), tables, settings)


def filter_record(
    record: Record,
    *,
    past: int,
    method: str = "rls",
    model_set: str | None = None,
    forgetting: float | None = None,
    regularisation: float = 0.1,
    precision: str = "f32",
    feedthrough: tuple[str, ...] = (),
) -> FilterResult:
    """Replay the input and output channels of a recording through one of the C filters.

    feedthrough: names of inputs; the other parameters as in replay_filter. Without inputs the filter is an
    autoregression of the outputs. Raises as replay_filter, naming recording and channel, and UsageError for an unknown
    input name or a recording without outputs.
    """
    names_u, names_y = record.names("input"), record.names("output")
    if not names_y:
        raise UsageError(f"{record.source}: a filter needs at least one output channel in the roles")
    unknown = [name for name in feedthrough if name not in names_u]
    if unknown:
        raise UsageError(f"feedthrough {unknown[0]!r} is no input; the inputs are {', '.join(names_u) or 'none'}")
    u, y = record.columns(names_u), record.columns(names_y)
    for name, samples in zip(names_u + names_y, np.hstack([u, y]).T, strict=True):
        fault = find_fault(f"{record.source}: channel {name!r}", samples, precision)
        if fault is not None:
            raise fault
    try:
        return replay_filter(
            u,
            y,
            past=past,
            method=method,
            model_set=model_set,
            sample_time_s=record.sample_time_s,
            forgetting=forgetting,
            regularisation=regularisation,
            precision=precision,
            feedthrough=tuple(names_u.index(name) for name in feedthrough),
            time_s=record.time_s,
        )
    except NotIdentifiable as error:
        raise NotIdentifiable(f"{record.source}: {error}") from None


def _as_samples(values: ArrayLike, name: str, least: int = 1) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.ndim != 2 or not least <= array.shape[1] <= CHANNELS_MAX:
        raise UsageError(
            f"{name} has shape {array.shape}; it must be (samples, channels) with {least} to {CHANNELS_MAX} channels"
        )
    return array


def _microseconds(time_s: ArrayLike | None, samples: int, sample_time_s: float) -> NDArray[np.uint64]:
    """Turn seconds into the filter's clock, counted from the first sample."""
    if time_s is None:
        return np.round(np.arange(samples) * (sample_time_s * 1e6)).astype(np.uint64)
    time = np.asarray(time_s, dtype=np.float64)
    if time.shape != (samples,) or not np.all(np.isfinite(time)):
        raise UsageError(f"time_s must hold {samples} finite seconds; it has shape {time.shape}")
    # Times before the first sample cannot be unsigned; the filter would reject them, and so does this.
    if samples and time.min() < time[0]:
        raise DataError(f"time goes backwards at sample {int(np.argmin(time)) + 1}; sort the recording by time")
    return np.round((time - (time[0] if samples else 0.0)) * 1e6).astype(np.uint64)


def _run(
    u: Array,
    y: Array,
    time_us: NDArray[np.uint64],
    tables: tuple[Array, Array, Array, Array],
    settings: FilterSettings,
) -> FilterResult:
    (samples, r), ny = u.shape, y.shape[1]
    n = settings.regressors(r, ny)
    arrays = dict(zip(("offset", "scale", "minimum", "maximum"), tables, strict=True))
    arrays |= {"u": u, "y": y, "theta": np.zeros((ny, n)), "theta_scaled": np.zeros((ny, n))}
    arrays |= {name: np.full((samples, ny), np.nan) for name in ("innovation", "residual")}
    status = np.zeros(samples, dtype=np.int8)
    ffi = foreign_interface()
    replay = ffi.new("aeo_replay_t *")
    for name, array in arrays.items():  # each array outlives the call below
        setattr(replay, name, ffi.cast("double *", array.ctypes.data))
    replay.time_us = ffi.cast("uint64_t *", time_us.ctypes.data)
    replay.status = ffi.cast("int8_t *", status.ctypes.data)
    replay.samples, replay.inputs, replay.outputs, replay.past = samples, r, ny, settings.past
    _fill(replay, settings)
    _call(replay, settings)
    counters = _counters(replay, settings.method)
    if counters["updates"] == 0:
        raise NotIdentifiable(
            f"no sample has a full past window: {samples} samples given, {counters['samples']} accepted,"
            f" {counters['gaps']} gaps; {settings.past + 1} good ones in a row are needed"
        )
    return FilterResult(
        theta=arrays["theta"],
        theta_scaled=arrays["theta_scaled"],
        innovation=arrays["innovation"],
        residual=arrays["residual"],
        status=status,
        health=int(replay.health),
        counters=counters,
        settings=settings,
    )


def _fill(replay: Any, settings: FilterSettings) -> None:
    """Write the settings into the C structure."""
    replay.method, replay.model_set = METHODS.index(settings.method), MODEL_SETS.index(settings.model_set)
    replay.feedthrough = sum(1 << i for i in settings.feedthrough)
    replay.period_us = max(1, round(settings.sample_time_s * 1e6))
    for name in ("forgetting", "regularisation", "excitation_min", "growth_max"):
        setattr(replay, name, getattr(settings, name))
    if settings.varx_samples is not None:
        for name in ("varx_samples", "forgetting_start", "forgetting_rate", "guard_ratio"):
            setattr(replay, name, getattr(settings, name))


def _counters(replay: Any, method: str) -> dict[str, int]:
    """Return the counters every filter has, and those of this one."""
    counted = [int(c) for c in replay.count]
    counters = dict(zip(COUNTERS, counted, strict=False))
    for (name, owners), value in zip(OWN_COUNTERS.items(), counted[len(COUNTERS) :], strict=True):
        if method in owners:
            counters[name] = value
    return counters


def _call(replay: Any, settings: FilterSettings) -> None:
    """Run the filter in memory of its own; raises UsageError when it refuses its settings."""
    library, ffi = load_library(settings.precision), foreign_interface()
    needed = library.aeo_replay_bytes(replay)
    memory = np.zeros(needed // 8 + 1)
    code = library.aeo_replay_run(replay, ffi.cast("void *", memory.ctypes.data), needed)
    if code == 0:
        return
    text = ffi.string(library.aeo_replay_status_text(code)).decode()
    if replay.regressors == 0 and code == -4:  # AEO_E_RANGE from the read-out; set-up knows no such code
        raise DataError(f"{settings.method} holds no finite parameters ({text}); filter with rls, or in f64")
    raise UsageError(
        f"{settings.method} refused its settings ({text}); channels have scales of {min(settings.scale):g} to"
        f" {max(settings.scale):g}: {settings.precision} may not hold them, change the units or take f64"
    )
