"""Open a bus or a log file by one text and read frames from it in batches."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from aeolid.can.log_frames import reason_of
from aeolid.can.logs import is_log, open_log
from aeolid.can.messages import pack_messages
from aeolid.can.wire import Frames, no_frames
from aeolid.errors import DataError, UsageError

BATCH = 4096
PATIENCE_S = 20.0  # for a port of this machine that nobody serves yet: its program may be starting
STRANGE_S = 3600.0  # a stamp farther from the host's clock counts from somewhere else: from when the adapter started


class _NotServed(DataError):
    """Say that nobody serves the port of this machine that a bus names."""


class Source(Protocol):
    """Deliver frames until `ended` says why there are no more.

    Batches hold every frame that the interface delivered: split_errors of messages.py leaves the data frames of them.
    interruptions: how often the bus broke off and was opened again.
    """

    name: str
    is_log: bool
    ended: str | None
    interruptions: int

    @property
    def status(self) -> str:
        """Say what an operator should know now, such as a bus that is away; empty when all is well."""

    def read(self, timeout: float) -> Frames:
        """Return what has arrived, waiting up to `timeout` seconds; empty when nothing came or the source ended."""

    def close(self) -> None:
        """Let go of bus or file."""


_TABLES = (".csv", ".out", ".outb", ".mat", ".npz", ".xlsx", ".h5", ".tdms", ".sel")


def open_source(text: str, *, reconnect: bool = False, notice: Callable[[str], None] | None = None) -> Source:
    """Open `interface:channel[?key=value&…]` of python-can, or a CAN log by its path.

    Examples: slcan:socket://127.0.0.1:29536, slcan:/dev/pts/3, socketcan:can0?bitrate=500000, recording.blf.
    reconnect: a bus that breaks off is opened again until it works; the first time it must. A port of this machine may
    be served late, by a node that was started just before: it is tried for 20 s, and `notice` told so.
    Raises UsageError for a text that names no interface, DataError when bus or file cannot be opened.
    """
    if Path(text).suffix.lower() in _TABLES or text.lower().endswith(".csv.gz"):
        raise UsageError(
            f"--bus {text}: a table of samples, which no bus can send; read it with aeolid identify, or give a bus"
            " (interface:channel) or a log of raw frames (.blf, .asc, .log, .mf4, .parquet)"
        )
    if is_log(text) or Path(text).is_file():
        return open_log(text)
    found = re.fullmatch(r"([A-Za-z_]\w*):([^?]*)(?:\?(.*))?", text)
    if not found:
        raise UsageError(f"--bus {text}: interface:channel or a log file (.blf, .asc, .log, .mf4, .parquet) is needed")
    interface, channel, options = found[1], found[2], _options(text, found[3])
    first = BusSource(text, _open_patiently(text, interface, channel, options, notice))
    if not reconnect:
        return first
    from aeolid.can.reconnect import ReconnectingSource

    ready = [first]
    return ReconnectingSource(
        text, lambda: ready.pop() if ready else BusSource(text, _open_bus(text, interface, channel, options))
    )


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


def _open_patiently(
    text: str, interface: str, channel: str, options: dict[str, Any], notice: Callable[[str], None] | None
) -> Any:
    """Open a bus; a port of this machine that nobody serves yet is tried again for a while."""
    until, told = time.monotonic() + PATIENCE_S, False
    while True:
        try:
            return _open_bus(text, interface, channel, options)
        except _NotServed:
            if time.monotonic() > until:
                raise
            if notice is not None and not told:
                notice(f"{text}: nobody serves this port yet; tried again for {PATIENCE_S:g} s")
            told = True
            time.sleep(0.1)


def _was_refused(error: BaseException | None) -> bool:
    """Tell whether an error comes of a port that nobody serves."""
    while error is not None and not isinstance(error, ConnectionRefusedError):
        error = error.__context__
    return error is not None


def _open_bus(text: str, interface: str, channel: str, options: dict[str, Any]) -> Any:
    import can

    if interface not in can.VALID_INTERFACES:
        known = ", ".join(sorted(can.VALID_INTERFACES))
        raise UsageError(f"--bus {text}: python-can has no interface {interface!r}; it has {known}")
    try:
        if interface == "slcan":
            from aeolid.can.slcan import BulkSlcanBus

            return BulkSlcanBus(channel, **options)
        if interface == "socketcan":
            from aeolid.can.socketcan import BulkSocketcanBus

            return BulkSocketcanBus(channel, **options)
        return can.Bus(interface=interface, channel=channel, **options)
    except Exception as error:  # each interface raises its own kinds
        ours = re.search(r"//(localhost|127\.[\d.]+|\[::1\])[:/]", channel)
        kind = _NotServed if ours and _was_refused(error) else DataError
        raise kind(f"{text}: the bus cannot be opened: {reason_of(error)}") from None


class BusSource:
    """Read a python-can bus; one that can read in bulk is read so."""

    is_log = False
    interruptions = 0

    def __init__(self, name: str, bus: Any) -> None:
        self.name = name
        self.ended: str | None = None
        self.status = ""
        self._bus = bus
        self._ahead: float | None = None  # host clock less the interface's, where that is none of the day

    def read(self, timeout: float) -> Frames:
        """Return what has arrived, waiting up to `timeout` seconds."""
        if self.ended is not None:
            return no_frames()
        try:
            if hasattr(self._bus, "read_frames"):
                return _dated(self._bus.read_frames(timeout))
            return self._stamped(self._collect(timeout))
        except Exception as error:  # interfaces raise can.CanError, OSError, serial.SerialException …
            self.ended = reason_of(error)
            return no_frames()

    @property
    def overrun(self) -> int:
        """Return how many frames the interface says it has dropped."""
        return int(getattr(self._bus, "overrun", 0))

    def _collect(self, timeout: float) -> list[Any]:
        messages = []
        message = self._bus.recv(timeout)
        while message is not None:
            messages.append(message)
            if len(messages) >= BATCH:
                break
            try:
                message = self._bus.recv(0)
            except Exception as error:  # the bus broke off: what came before it is delivered
                self.ended = reason_of(error)
                break
        return messages

    def _stamped(self, messages: list[Any]) -> Frames:
        """Put the stamps of an adapter with a clock of its own on the host's."""
        frames = pack_messages(messages)
        if not messages:
            return frames
        now = time.time()
        if self._ahead is None:
            away = now - float(frames.time_s[-1])
            self._ahead = away if abs(away) > STRANGE_S else 0.0
        stamps = np.where(frames.time_s > 0, frames.time_s + self._ahead, now)
        return replace(frames, time_s=stamps)

    def close(self) -> None:
        """Close the bus; a peer that has gone already is no failure here."""
        with suppress(Exception):
            self._bus.shutdown()


def _dated(frames: Frames) -> Frames:
    """Date frames that came without a time: now."""
    unknown = np.isnan(frames.time_s)
    return replace(frames, time_s=np.where(unknown, time.time(), frames.time_s)) if unknown.any() else frames
