"""Replay recordings through the C filters, the very code that runs in a controller."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.native import foreign_interface, load_library
from aeolid.record import Record

Array = NDArray[np.float64]

CHANNELS_MAX = 32  # AEO_REGRESSOR_CHANNELS_MAX
REGRESSORS_MAX = 1024  # AEO_REGRESSOR_LENGTH_MAX, AEO_RLS_REGRESSORS_MAX
HEALTH = {1: "forgetting withheld", 2: "variance bounded", 4: "re-initialised"}  # AEO_RLS_WITHHELD …
REGRESSOR_COUNTERS = ("samples", "rejected_not_finite", "rejected_range", "rejected_time", "gaps")
RLS_COUNTERS = ("updates", "updates_rejected", "forgetting_withheld", "variances_bounded", "reinitialised")
COUNTERS = REGRESSOR_COUNTERS + RLS_COUNTERS  # the order of aeo_replay_t.count


@dataclass(frozen=True)
class FilterSettings:
    """Say how a recording was filtered; with the same recording it gives the same bits.

    offset, scale (r + l values, inputs first) in the channels' units; feedthrough lists input indices whose present
    value is a regressor.
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


@dataclass(frozen=True, eq=False)
class FilterResult:
    """Hold what one filter made of one recording.

    theta (l, n) in the channels' units, columns in the order of paper 000 eq. (9): oldest block [u; y] first, present
    inputs of the feedthrough list last; theta_scaled (l, n) as the filter holds it; innovation and residual (N, l),
    a priori and a posteriori, NaN where no update took place; status (N,) the code of status.h for each sample;
    health the sticky flags; counters by name.
    """

    theta: Array
    theta_scaled: Array
    innovation: Array
    residual: Array
    status: NDArray[np.int8]
    health: int
    counters: dict[str, int]
    settings: FilterSettings

    def health_text(self) -> str:
        """Return the raised flags in words."""
        return ", ".join(text for flag, text in HEALTH.items() if self.health & flag) or "no flag raised"

    def to_json(self) -> dict[str, Any]:
        """Return the facts without the long arrays."""
        return {
            "settings": asdict(self.settings),
            "health": self.health,
            "health_text": self.health_text(),
            "counters": self.counters,
            "outputs": int(self.theta.shape[0]),
            "regressors": int(self.theta.shape[1]),
            "innovation_std": np.nanstd(self.innovation, axis=0).tolist(),
        }

    def summary(self) -> str:
        """Return one line for people."""
        rows, columns = self.theta.shape
        return f"{self.counters['updates']} updates, {rows} x {columns} Markov parameters, {self.health_text()}"


def replay_rls(
    u: ArrayLike,
    y: ArrayLike,
    *,
    past: int,
    sample_time_s: float = 1.0,
    forgetting: float = 1.0,
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
    """Replay samples through the C regressor and square-root RLS.

    Minimises sum λ^(k-i) |y_i - θ z_i|² + λ^(k+1) ρ |θ|² in scaled units (paper 000 section II-E); see rls.h for the
    excitation gate and the variance bound, which act for λ < 1 only.

    u (N, r), y (N, l): one row a sample, the channels' units; NaN rows are rejected and counted, the window refills.
    past: p, blocks of the window, 1 … (p (r + l) + r ≤ 1024).
    sample_time_s: above 1e-6; only its ratio to time_s matters. time_s (N,): default 0, h, 2 h …; holes are gaps.
    forgetting: λ, 0.5 … 1, default 1 (all samples count alike). regularisation: ρ, 1e-8 … 1e8, default 0.1, as if a
    tenth of a sample of unit size had been seen in each direction: on singular turbine data the smallest that single
    precision bears out (2e-4 from batch least squares). precision: "f32" (the firmware's, default) or "f64".
    feedthrough: indices of inputs whose present value is a regressor, default none, because under feedback they bias
    the result. offset, scale (r + l,): default mean and standard deviation of the samples given.
    minimum, maximum (r + l,): plausible range, default unlimited. excitation_min, growth_max: as in rls.h.

    Returns FilterResult. Raises UsageError for a setting out of range, DataError for a constant or empty channel,
    NotIdentifiable when no sample has a full past window. Cost: about 2.5 n² + 4 l n operations a sample in C.

    >>> rng = np.random.default_rng(1)
    >>> u = rng.standard_normal((500, 1))
    >>> y = np.vstack([[0.0], 0.5 * u[:-1]])
    >>> result = replay_rls(u, y, past=1)
    >>> bool(abs(result.theta[0, 0] - 0.5) < 2e-3)
    True
    """
    inputs, outputs = _as_samples(u, "u"), _as_samples(y, "y")
    if len(inputs) != len(outputs):
        raise UsageError(f"u has {len(inputs)} samples, y has {len(outputs)}; they must match")
    _check_settings(inputs.shape[1], outputs.shape[1], past, feedthrough, sample_time_s)
    tables = _tables(np.hstack([inputs, outputs]), offset, scale, minimum, maximum)
    settings = FilterSettings(
        "rls",
        precision,
        past,
        float(forgetting),
        float(regularisation),
        tuple(sorted(set(feedthrough))),
        float(excitation_min),
        float(growth_max),
        float(sample_time_s),
        tuple(tables[0].tolist()),
        tuple(tables[1].tolist()),
    )
    return _run(inputs, outputs, _microseconds(time_s, len(inputs), sample_time_s), tables, settings)


def filter_record(
    record: Record,
    *,
    past: int,
    forgetting: float = 1.0,
    regularisation: float = 0.1,
    precision: str = "f32",
    feedthrough: tuple[str, ...] = (),
) -> FilterResult:
    """Replay the input and output channels of a recording through the square-root RLS.

    feedthrough: names of inputs; the other parameters as in replay_rls. Raises also DataError that names a constant or
    empty channel, UsageError for an unknown input name or a recording without inputs or outputs.
    """
    names_u, names_y = record.names("input"), record.names("output")
    if not names_u or not names_y:
        raise UsageError(f"{record.source}: a filter needs at least one input and one output channel in the roles")
    unknown = [name for name in feedthrough if name not in names_u]
    if unknown:
        raise UsageError(f"feedthrough {unknown[0]!r} is no input; the inputs are {', '.join(names_u)}")
    u, y = record.columns(names_u), record.columns(names_y)
    for name, samples in zip(names_u + names_y, np.hstack([u, y]).T, strict=True):
        problem = _describe_dead_channel(samples)
        if problem:
            raise DataError(f"{record.source}: channel {name!r} {problem}")
    try:
        return replay_rls(
            u,
            y,
            past=past,
            sample_time_s=record.sample_time_s,
            forgetting=forgetting,
            regularisation=regularisation,
            precision=precision,
            feedthrough=tuple(names_u.index(name) for name in feedthrough),
            time_s=record.time_s,
        )
    except NotIdentifiable as error:
        raise NotIdentifiable(f"{record.source}: {error}") from None


def save_markov(target: BinaryIO, result: FilterResult, record: Record) -> None:
    """Write the content of markov.npz: theta, innovation, health, the settings, and the recording they came from."""
    np.savez_compressed(
        target,
        theta=result.theta,
        theta_scaled=result.theta_scaled,
        innovation=result.innovation,
        residual=result.residual,
        status=result.status,
        health=np.uint32(result.health),
        counters=json.dumps(result.counters),
        settings=json.dumps(asdict(result.settings)),
        inputs=np.array(record.names("input")),
        outputs=np.array(record.names("output")),
        input_units=np.array([record.unit(name) for name in record.names("input")]),
        output_units=np.array([record.unit(name) for name in record.names("output")]),
        source=record.source,
        sha256=record.sha256,
    )


def _as_samples(values: ArrayLike, name: str) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.ndim != 2 or not 1 <= array.shape[1] <= CHANNELS_MAX:
        raise UsageError(
            f"{name} has shape {array.shape}; it must be (samples, channels) with 1 to {CHANNELS_MAX} channels"
        )
    return array


def _check_settings(r: int, ny: int, past: int, feedthrough: tuple[int, ...], sample_time_s: float) -> None:
    longest = (REGRESSORS_MAX - r) // (r + ny)
    if not 1 <= past <= longest:
        raise UsageError(f"past = {past}: with {r} inputs and {ny} outputs it must be 1 to {longest}")
    for index in feedthrough:
        if not 0 <= index < r:
            raise UsageError(f"feedthrough names input {index}; there are inputs 0 to {r - 1}")
    if not 1e-6 <= sample_time_s <= 4000.0:
        raise UsageError(f"sample_time_s = {sample_time_s} is not between 1e-6 and 4000 seconds")


def _describe_dead_channel(samples: Array) -> str:
    finite = samples[np.isfinite(samples)]
    if not finite.size:
        return "holds no finite sample; take it out of the roles or repair the recording"
    if np.ptp(finite) == 0.0:
        return f"is constant ({finite[0]:g}); give it the role ignore"
    return ""


def _tables(
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
            problem = _describe_dead_channel(column)
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


def _microseconds(time_s: ArrayLike | None, samples: int, sample_time_s: float) -> NDArray[np.uint64]:
    """Turn seconds into the filter's clock, counted from the first sample."""
    if time_s is None:
        return np.round(np.arange(samples) * (sample_time_s * 1e6)).astype(np.uint64)
    time = np.asarray(time_s, dtype=np.float64)
    if time.shape != (samples,) or not np.all(np.isfinite(time)):
        raise UsageError(f"time_s must hold {samples} finite seconds; it has shape {time.shape}")
    # Times before the first sample cannot be unsigned; the filter would reject them, and so does this.
    if samples and time.min() < time[0]:
        raise DataError(f"time goes backwards at sample {int(np.argmin(time))}; sort the recording by time")
    return np.round((time - (time[0] if samples else 0.0)) * 1e6).astype(np.uint64)


def _run(
    u: Array,
    y: Array,
    time_us: NDArray[np.uint64],
    tables: tuple[Array, Array, Array, Array],
    settings: FilterSettings,
) -> FilterResult:
    (samples, r), ny = u.shape, y.shape[1]
    n = settings.past * (r + ny) + len(settings.feedthrough)
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
    replay.feedthrough = sum(1 << i for i in settings.feedthrough)
    replay.period_us = max(1, round(settings.sample_time_s * 1e6))
    for name in ("forgetting", "regularisation", "excitation_min", "growth_max"):
        setattr(replay, name, getattr(settings, name))
    _call(replay, settings)
    counters = dict(zip(COUNTERS, (int(c) for c in replay.count), strict=True))
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


def _call(replay: Any, settings: FilterSettings) -> None:
    """Run the filter in memory of its own; raises UsageError when it refuses its settings."""
    library, ffi = load_library(settings.precision), foreign_interface()
    needed = library.aeo_replay_bytes(replay)
    memory = np.zeros(needed // 8 + 1)
    code = library.aeo_replay_rls(replay, ffi.cast("void *", memory.ctypes.data), needed)
    if code != 0:
        text = ffi.string(library.aeo_replay_status_text(code)).decode()
        raise UsageError(
            f"the filter refused its settings ({text}); ranges: forgetting 0.5 to 1, regularisation 1e-8 to 1e8,"
            " excitation_min 0 to 1, growth_max 4 to 1e6 with growth_max / regularisation at most 1e10;"
            f" given {settings.forgetting:g}, {settings.regularisation:g}, {settings.excitation_min:g},"
            f" {settings.growth_max:g}, scales {min(settings.scale):g} to {max(settings.scale):g}"
        )
