"""Make recordings from tables and arrays, and give them back."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aeolid import record as core
from aeolid.api import markup
from aeolid.api.clock import clock_of, placed
from aeolid.api.session import public
from aeolid.errors import DataError, UsageError
from aeolid.formats.headings import fault_of_name
from aeolid.formats.table import to_numbers

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

Array = NDArray[np.float64]


class Record(core.Record):
    """Hold one recording; time runs along the first axis and missing samples are NaN.

    Made by `ae.read`, `Record.from_pandas` or `Record.from_arrays`.

    Attributes
    ----------
    time_s : ndarray, shape (N,)
        Time in seconds, uniform.
    values : ndarray, shape (N, channels)
        Samples in the units of the channels.
    channels : tuple of aeolid.record.Channel
        Name, unit and role of each column of `values`.
    sample_time_s : float
        Sample time in seconds.
    source, sha256 : str
        Where the recording came from, and the hash of its bytes.
    begins : str, optional
        Date and time of the first sample, where the file has them.
    geometry : aeolid.geometry.Geometry, optional
        Where sensors are and which way they point, where the roles file says it.
    """

    @classmethod
    def of_core(cls, record: core.Record) -> Record:
        """Return a recording of the readers as one of this class.

        Parameters
        ----------
        record : aeolid.record.Record
            What `aeolid.formats.read_record` returns.
        """
        return cls(
            record.time_s, record.values, record.channels, record.sample_time_s, record.source, record.sha256,
            record.begins, record.geometry,
        )  # fmt: skip

    @classmethod
    @public
    def from_pandas(
        cls, frame: pd.DataFrame, *, inputs: Sequence[str] = (), outputs: Sequence[str] = (),
        roles: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None,
        sample_time: float | None = None, source: str = "DataFrame",
    ) -> Record:  # fmt: skip
        """Take columns of a table, one row a sample.

        Parameters
        ----------
        frame : pandas.DataFrame
            One row a sample, a missing sample is NaN. The time is its index: a DatetimeIndex, a TimedeltaIndex, numbers
            under the name of a time ("time", "time [ms]"), or seconds with a fraction; whole samples that the time
            leaves out become NaN. An index that counts rows is no time: give `sample_time`.
        inputs : sequence of str
            Columns that drive the plant.
        outputs : sequence of str
            Columns that are measured.
        roles : mapping of str to str, optional
            Roles of further columns: disturbance, scheduling, azimuth, excitation, input or output.
        units : mapping of str to str, optional
            Unit of each column; a column without one is taken as it is.
        sample_time : float, optional
            Sample time in seconds; default that of the index, with which it must agree.
        source : str
            What messages call the recording.

        Returns
        -------
        Record

        Raises
        ------
        UsageError
            Where the arguments contradict each other or `frame` is no DataFrame.
        DataError
            Where a column is missing, is no number, is infinite, or holds no value; or where the clock is not uniform.
        """
        if not hasattr(frame, "columns") or not hasattr(frame, "index"):
            raise UsageError(
                f"frame is a {type(frame).__name__}; a pandas.DataFrame is needed, Record.from_arrays takes arrays"
            )
        wanted = _roles(inputs, outputs, roles)
        have = [str(name) for name in frame.columns]
        for name in wanted:
            if have.count(name) != 1:
                fault = "stands there twice; rename one" if name in have else f"is missing; it has {', '.join(have)}"
                raise DataError(f"{source}: column {name!r} {fault}")
        columns = {name: frame.iloc[:, have.index(name)].to_numpy() for name in wanted}
        time = clock_of(frame.index, source, sample_time)
        return cls._made(columns, wanted, units, time, sample_time, source)

    @classmethod
    @public
    def from_arrays(
        cls, columns: Mapping[str, ArrayLike], *, inputs: Sequence[str] = (), outputs: Sequence[str] = (),
        roles: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None,
        sample_time: float | None = None, time: ArrayLike | None = None, source: str = "arrays",
    ) -> Record:  # fmt: skip
        """Take arrays by name, all of one length.

        Parameters
        ----------
        columns : mapping of str to array, shape (N,)
            Samples of each channel, a missing sample is NaN.
        inputs : sequence of str
            Channels that drive the plant.
        outputs : sequence of str
            Channels that are measured.
        roles : mapping of str to str, optional
            Roles of further channels: disturbance, scheduling, azimuth, excitation, input or output.
        units : mapping of str to str, optional
            Unit of each channel; a channel without one is taken as it is.
        sample_time : float, optional
            Sample time in seconds; needed where `time` is not given.
        time : array, shape (N,), optional
            Time in seconds; whole samples that it leaves out become NaN.
        source : str
            What messages call the recording.

        Returns
        -------
        Record

        Raises
        ------
        UsageError
            Where the arguments contradict each other or an array has another shape.
        DataError
            Where a channel is missing, is no number, is infinite, or holds no value; or where the clock is not uniform.
        """
        if not isinstance(columns, Mapping):
            raise UsageError(f"columns is a {type(columns).__name__}; a mapping of names to arrays (N,) is needed")
        wanted = _roles(inputs, outputs, roles)
        missing = [name for name in wanted if name not in columns]
        if missing:
            raise DataError(f"{source}: channel {missing[0]!r} is missing; there are {', '.join(columns)}")
        if time is None and sample_time is None:
            raise UsageError("sample_time or time is needed: seconds between samples, or the time of each")
        arrays = {name: np.asarray(columns[name]) for name in wanted}
        clock = None if time is None else to_numbers(source, "time", np.asarray(time))
        for name, array in [*arrays.items(), *([] if clock is None else [("time", clock)])]:
            if array.ndim != 1 or len(array) != len(next(iter(arrays.values()))):
                raise UsageError(f"{name!r} has the shape {array.shape}; every array is (N,), all of one length")
        return cls._made(arrays, wanted, units, clock, sample_time, source)

    @classmethod
    def _made(
        cls, columns: Mapping[str, Any], roles: Mapping[str, str], units: Mapping[str, str] | None,
        time: Array | None, sample_time: float | None, source: str,
    ) -> Record:  # fmt: skip
        units = dict(units or {})
        stray = [name for name in units if name not in roles]
        if stray:
            raise UsageError(f"units names {stray[0]!r}, which has no role; add it to inputs, outputs or roles")
        values = {name: to_numbers(source, name, column) for name, column in columns.items()}
        for name in values:
            fault = fault_of_name(name, units.get(name, ""))
            if fault:
                raise DataError(f"{source}: the name {name!r} {fault}; rename it")
            core.check_spelling(units.get(name, ""), name, source)
        grid, matrix = placed(values, time, sample_time, source)
        channels = tuple(core.Channel(name, units.get(name, ""), role) for name, role in roles.items())
        digest = hashlib.sha256(np.ascontiguousarray(matrix).tobytes()).hexdigest()
        return cls(grid.times(), matrix, channels, grid.sample_time_s, source, digest)

    @public
    def to_pandas(self) -> pd.DataFrame:
        """Return the samples as a pandas.DataFrame, its index the time in seconds, its columns the channels."""
        import pandas as pd

        index = pd.Index(self.time_s, name="time_s")
        frame = pd.DataFrame(self.values, index=index, columns=[c.name for c in self.channels])
        frame.attrs.update(units={c.name: c.unit for c in self.channels}, roles={c.name: c.role for c in self.channels})
        return frame

    def to_frame(self) -> pd.DataFrame:
        """Return `to_pandas()`: every result has this name."""
        return self.to_pandas()

    @public
    def to_xarray(self) -> xr.Dataset:
        """Return the samples as an xarray.Dataset over time_s, each with unit and role; xarray is optional.

        Raises
        ------
        UsageError
            Where xarray is not installed.
        """
        try:
            import xarray as xr
        except ImportError:
            raise UsageError("xarray is not installed; install it with: pip install xarray") from None
        variables = {
            c.name: ("time_s", self.values[:, i], {"units": c.unit, "role": c.role})
            for i, c in enumerate(self.channels)
        }
        facts = {"source": self.source, "sha256": self.sha256, "sample_time_s": self.sample_time_s}
        return xr.Dataset(variables, {"time_s": self.time_s}, facts)

    @public
    def plot(self, axes: Any = None, *, channels: Sequence[str] | None = None) -> Any:
        """Draw the channels over time, one below the other.

        Parameters
        ----------
        axes : array of matplotlib.axes.Axes, optional
            One for each channel; default those of a new figure.
        channels : sequence of str, optional
            What to draw; default all.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (channels,)
        """
        from aeolid.api import axes as places

        chosen = [channels] if isinstance(channels, str) else channels
        names = [c.name for c in self.channels] if chosen is None else list(chosen)
        if not names:
            raise UsageError("channels is empty; name at least one, or leave it out to draw all")
        found = places.grid(axes, len(names), 1, size=(7.0, 1.5), sharex=True)[:, 0]
        for place, name in zip(found, names, strict=True):
            place.plot(self.time_s, self.column(name), linewidth=0.9)
            place.set_ylabel(places.label(f"{name}\n({self.unit(name) or '1'})"))
        found[-1].set_xlabel("time (s)")
        return found

    def __repr__(self) -> str:
        counts = [markup.count(len(self.of(role)), role) for role in core.ROLES if self.of(role)]
        return (
            f"<Record: {markup.count(len(self), 'sample')}, {self.sample_time_s:g} s, {', '.join(counts)},"
            f" {markup.title(self.source)}>"
        )

    def _repr_html_(self) -> str:
        from aeolid.api.table import Table

        rows = []
        for i, channel in enumerate(self.channels):
            known = self.values[np.isfinite(self.values[:, i]), i]
            rows.append((channel, known, len(self) - len(known)))
        table = Table(
            "channels", rows,
            lambda r: {"channel": r[0].name, "unit": r[0].unit, "role": r[0].role,
                       "mean": np.mean(r[1]) if len(r[1]) else None,
                       "deviation": np.std(r[1]) if len(r[1]) else None, "missing": r[2]},
        )  # fmt: skip
        return markup.shown(repr(self)[1:-1], table._repr_html_())


def _roles(
    inputs: Sequence[str], outputs: Sequence[str], others: Mapping[str, str] | None
) -> dict[str, str]:  # fmt: skip
    """Return the role of each channel, in the order inputs, outputs, others; raises UsageError."""
    found: dict[str, str] = {}
    for what, given in (("inputs", inputs), ("outputs", outputs)):
        if isinstance(given, str):
            raise UsageError(f"{what} is a text; give a list of names: [{given!r}]")
        for name in given:
            if name in found:
                raise UsageError(f"{name!r} is named twice among inputs and outputs; it is one of them")
            found[name] = what.removesuffix("s")
    for name, role in (others or {}).items():
        if role not in core.ROLES:
            raise UsageError(f"roles: {name!r} has the role {role!r}, which is none of {', '.join(core.ROLES)}")
        if name in found:
            raise UsageError(f"roles names {name!r}, which is among inputs and outputs; leave it out of one of them")
        if role != "ignore":
            found[name] = role
    if not found:
        raise UsageError("no channel is named; give inputs and outputs, each a list of names")
    return found
