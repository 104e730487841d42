"""Open a bus or a log file by one text and read frames from it in batches."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from aeolid.can.wire import Frames, no_frames, pack_frames
from aeolid.errors import DataError, UsageError

LOG_SUFFIXES = (".blf", ".asc", ".log", ".mf4", ".trc", ".csv.gz")
BATCH = 4096


class Source(Protocol):
    """Deliver frames until `ended` says why there are no more."""

    name: str
    is_log: bool
    ended: str | None

    def read(self, timeout: float) -> Frames:
        """Return what has arrived, waiting up to `timeout` seconds; empty when nothing came or the source ended."""

    def close(self) -> None:
        """Let go of bus or file."""


def open_source(text: str) -> Source:
    """Open `interface:channel[?key=value&…]` of python-can, or a CAN log by its path.

    Examples: slcan:socket://127.0.0.1:29536, slcan:/dev/pts/3, socketcan:can0?bitrate=500000, recording.blf.
    Raises UsageError for a text that names no interface, DataError when bus or file cannot be opened.
    """
    if text.lower().endswith(LOG_SUFFIXES) or Path(text).is_file():
        return LogSource(text)
    found = re.fullmatch(r"([A-Za-z_]\w*):([^?]*)(?:\?(.*))?", text)
    if not found:
        raise UsageError(f"--bus {text}: interface:channel or a log file (.blf, .asc, .log) is needed")
    interface, channel, options = found[1], found[2], _options(text, found[3])
    return BusSource(text, _open_bus(text, interface, channel, options))


def _options(text: str, part: str | None) -> dict[str, Any]:
    options: dict[str, Any] = {}
    for item in (part or "").split("&") if part else []:
        key, equals, value = item.partition("=")
        if not key or not equals:
            raise UsageError(f"--bus {text}: options are key=value, joined by &; found {item!r}")
        lowered = value.lower()
        if lowered in ("true", "false"):
            options[key] = lowered == "true"
        else:
            options[key] = int(value, 0) if re.fullmatch(r"-?\d+|0x[0-9a-fA-F]+", value) else value
    return options


def _open_bus(text: str, interface: str, channel: str, options: dict[str, Any]) -> Any:
    import can

    if interface not in can.VALID_INTERFACES:
        known = ", ".join(sorted(can.VALID_INTERFACES))
        raise UsageError(f"--bus {text}: python-can has no interface {interface!r}; it has {known}")
    try:
        if interface == "slcan":
            from aeolid.can.slcan import BulkSlcanBus

            return BulkSlcanBus(channel, **options)
        return can.Bus(interface=interface, channel=channel, **options)
    except Exception as error:  # each interface raises its own kinds
        raise DataError(f"{text}: the bus cannot be opened: {_reason(error)}") from None


class BusSource:
    """Read a python-can bus; one that can read in bulk is read so."""

    is_log = False

    def __init__(self, name: str, bus: Any) -> None:
        self.name = name
        self.ended: str | None = None
        self._bus = bus

    def read(self, timeout: float) -> Frames:
        """Return what has arrived, waiting up to `timeout` seconds."""
        if self.ended is not None:
            return no_frames()
        try:
            if hasattr(self._bus, "read_frames"):
                frames: Frames = self._bus.read_frames(timeout)
                return frames
            return self._collect(timeout)
        except Exception as error:  # interfaces raise can.CanError, OSError, serial.SerialException …
            self.ended = _reason(error)
            return no_frames()

    def _collect(self, timeout: float) -> Frames:
        rows = []
        message = self._bus.recv(timeout)
        while message is not None:
            row = _row(message)
            if row is not None:
                rows.append(row)
            if len(rows) >= BATCH:
                break
            message = self._bus.recv(0)
        return pack_frames(rows)

    def close(self) -> None:
        """Close the bus; a peer that has gone already is no failure here."""
        with suppress(Exception):
            self._bus.shutdown()


class LogSource:
    """Read a log file through python-can's readers."""

    is_log = True

    def __init__(self, path: str) -> None:
        import can

        self.name = path
        self.ended: str | None = None
        try:
            if Path(path).stat().st_size == 0:
                raise DataError(f"{path}: the file is empty (0 bytes); copy or export it again")
            self._reader: Any = can.LogReader(path)
            self._messages: Iterator[Any] = iter(self._reader)
        except FileNotFoundError:
            raise DataError(f"{path}: no such file") from None
        except DataError:
            raise
        except Exception as error:  # each reader raises its own kinds
            raise DataError(f"{path}: not a CAN log that python-can reads: {_reason(error)}") from None

    def read(self, timeout: float) -> Frames:
        """Return the next batch."""
        rows = []
        try:
            for message in self._messages:
                row = _row(message)
                if row is not None:
                    rows.append(row)
                if len(rows) >= BATCH:
                    return pack_frames(rows)
            self.ended = "end of file"
        except Exception as error:  # a log cut short: keep what came before
            self.ended = f"damaged: {_reason(error)}"
        return pack_frames(rows)

    def close(self) -> None:
        """Close the file."""
        with suppress(Exception):
            self._reader.stop()


def _row(message: Any) -> tuple[int, bool, bytes] | None:
    if message.is_error_frame or message.is_remote_frame:
        return None
    return int(message.arbitration_id), bool(message.is_extended_id), bytes(message.data)


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text[:200]
