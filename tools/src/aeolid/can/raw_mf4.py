"""Write raw CAN logs as MDF4 bus logging; python-can's own writer adds frame by frame, 31,000 a second."""

from __future__ import annotations

import os
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aeolid.can.chunks import ChunkedLog
from aeolid.can.messages import MARK_CHANNEL, MARKER, PASSIVE, TRUE_CHANNEL
from aeolid.can.wire import ERROR, EXTENDED, FAST, FD, GARBLED, REMOTE, Frames
from aeolid.output import create

_KINDS = ("CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame")  # ASAM MDF bus logging 1.0
_FIELDS = (("BusChannel", "<u1"), ("ID", "<u4"), ("IDE", "<u1"), ("DLC", "<u1"), ("DataLength", "<u1"),
           ("DataBytes", "(64,)u1"), ("Dir", "<u1"), ("EDL", "<u1"), ("BRS", "<u1"), ("ESI", "<u1"))  # fmt: skip
_CODES = {n: code for code, n in enumerate((*range(9), 12, 16, 20, 24, 32, 48, 64))}  # length -> DLC
_DLC = np.array([_CODES.get(n, 0) for n in range(65)], np.uint8)


class Mf4Log(ChunkedLog):
    """Write MDF4 bus logging with asammdf, from the spool, when the log is closed.

    asammdf keeps what it is given, compressed, in a hidden folder beside the target meanwhile.
    """

    def _open(self) -> None:
        from asammdf import MDF, Signal
        from asammdf.blocks import v4_constants
        from asammdf.blocks.v4_blocks import SourceInformation

        os.close(create(self.path))
        self._folder = tempfile.TemporaryDirectory(dir=self.path.parent, prefix=f".{self.path.name}.")
        self._mdf: Any = MDF(version="4.10", temporary_folder=self._folder.name)
        self._begin: float | None = None
        self._latest = 0.0
        source = SourceInformation(source_type=v4_constants.SOURCE_BUS, bus_type=v4_constants.BUS_TYPE_CAN)
        for kind in _KINDS:
            none: NDArray[Any] = np.zeros(0, _layout(kind))
            self._mdf.append(Signal(name=kind, samples=none, timestamps=np.zeros(0), source=source))

    def _put(self, frames: Frames) -> None:
        # the clock of an MDF4 group never goes back
        stamps = np.maximum.accumulate(np.maximum(np.nan_to_num(frames.time_s), self._latest))
        if self._begin is None:
            self._begin = float(stamps[0])
            self._mdf.header.start_time = datetime.fromtimestamp(self._begin, UTC)
            self._begin = self._mdf.header.start_time.timestamp()  # as it is rounded there
        self._latest = float(stamps[-1])
        kinds = np.where(frames.flags & ERROR, 1, np.where(frames.flags & (REMOTE | GARBLED), 2, 0))
        for group in range(len(_KINDS)):
            mine = np.flatnonzero(kinds == group)
            if len(mine):
                records = _records(_KINDS[group], frames.take(mine))
                self._mdf.extend(group, [(stamps[mine] - self._begin, None), (records, None)])

    def _finish(self) -> None:
        try:
            whole = Path(self._folder.name) / "whole.mf4"
            self._mdf.save(whole, overwrite=True, compression=2)
            os.replace(whole, self.path)
        finally:
            self._mdf.close()
            self._folder.cleanup()


def _layout(kind: str) -> np.dtype[Any]:
    return np.dtype([(f"{kind}.{name}", form) for name, form in _FIELDS])


def _records(kind: str, frames: Frames) -> NDArray[Any]:
    records: NDArray[Any] = np.zeros(len(frames), _layout(kind))
    length = np.minimum(frames.length, 64)
    garbled = frames.flags & GARBLED > 0
    alike = (frames.flags & REMOTE > 0) & (frames.flags & EXTENDED > 0) & (frames.id == MARKER)
    records[f"{kind}.BusChannel"] = np.where(garbled, MARK_CHANNEL, np.where(alike, TRUE_CHANNEL, 0))
    records[f"{kind}.ID"] = np.where(garbled, MARKER, frames.id)
    records[f"{kind}.IDE"] = (frames.flags & EXTENDED > 0) | garbled
    records[f"{kind}.DLC"] = _DLC[length]
    records[f"{kind}.DataLength"] = length
    records[f"{kind}.DataBytes"][:, : frames.data.shape[1]] = frames.data
    for name, flag in (("EDL", FD), ("BRS", FAST), ("ESI", PASSIVE)):
        records[f"{kind}.{name}"] = frames.flags & flag > 0
    return records
