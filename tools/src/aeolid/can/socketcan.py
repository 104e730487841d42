"""Read a CAN interface of Linux in bulk: the stock reader makes an object a frame and has the kernel's small buffer."""

from __future__ import annotations

import select
import struct
import sys
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from socket import MSG_DONTWAIT, SO_RCVBUF, SOL_SOCKET
from socket import socket as Socket
from typing import Any

import can
import numpy as np
from can.interfaces.socketcan import SocketcanBus
from numpy.typing import NDArray

from aeolid.can.messages import PASSIVE, unpack_messages
from aeolid.can.wire import ERROR, EXTENDED, FAST, FD, REMOTE, Frames, no_frames

BATCH = 4096
BUFFER = 1 << 23  # bytes; the kernel's own, 208 kB, holds 0.1 s of a busy classic bus
# Numbers of asm-generic/socket.h that Python does not name.
SO_TIMESTAMPNS, SO_RCVBUFFORCE, SO_RXQ_OVFL = 35, 33, 40
_CLASSIC, _LONG = 16, 72  # sizes of struct can_frame and canfd_frame
_STAMP = struct.Struct("@ll")
_Bytes = NDArray[np.uint8]


class BulkSocketcanBus(SocketcanBus):
    """Offer the socketcan interface of python-can with a large buffer and a reader that takes all that has arrived."""

    def __init__(self, channel: str, **options: Any) -> None:
        """Open the interface; options as those of SocketcanBus.

        overrun: frames that the kernel has dropped because this process did not read in time.
        """
        self.overrun = 0
        self._fault: OSError | None = None
        self._pending: deque[can.Message] = deque()
        super().__init__(channel, **options)

    @property
    def socket(self) -> Socket:
        """Return the socket."""
        return self._socket

    @socket.setter
    def socket(self, made: Socket) -> None:
        """Enlarge the buffer of the socket that python-can has made: it binds it next, and then frames arrive."""
        try:
            made.setsockopt(SOL_SOCKET, SO_RCVBUFFORCE, BUFFER)
        except OSError:  # not root: as much as net.core.rmem_max allows
            made.setsockopt(SOL_SOCKET, SO_RCVBUF, BUFFER)
        with suppress(OSError):
            made.setsockopt(SOL_SOCKET, SO_RXQ_OVFL, 1)
        self._socket = made

    def read_frames(self, timeout: float) -> Frames:
        """Return all frames that have arrived, after waiting up to `timeout` seconds for the first.

        Raises can.CanOperationError when the interface is down or gone. Cost: about 3 µs a frame.
        """
        try:
            if self._fault is None and not select.select([self.socket], [], [], timeout)[0]:
                return no_frames()
            raw, stamps = self._receive()
        except (OSError, ValueError) as error:
            raise can.CanOperationError(getattr(error, "strerror", None) or str(error)) from None
        return unpack(raw, stamps)

    def _receive(self) -> tuple[list[bytes], list[float]]:
        raw: list[bytes] = []
        stamps: list[float] = []
        receive = self.socket.recvmsg
        while len(raw) < BATCH:
            try:
                data, extra, _, _ = receive(_LONG, 64, MSG_DONTWAIT)
            except BlockingIOError:
                break
            except OSError as error:  # the interface went down: the kernel says so before what had come until then
                if self._fault is not None:
                    break
                self._fault = error
                continue
            stamp = float("nan")
            for _, kind, value in extra:
                if kind == SO_TIMESTAMPNS:
                    seconds, nanoseconds = _STAMP.unpack_from(value)
                    stamp = seconds + nanoseconds * 1e-9
                elif kind == SO_RXQ_OVFL:  # told with a frame only once some have been dropped
                    self.overrun = int.from_bytes(value, sys.byteorder)
            raw.append(data)
            stamps.append(stamp)
        if self._fault is not None and not raw:
            raise self._fault
        return raw, stamps

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._pending:
            self._pending.extend(unpack_messages(self.read_frames(3600.0 if timeout is None else timeout)))
        return (self._pending.popleft() if self._pending else None), False


def unpack(raw: Sequence[bytes], stamps: Sequence[float]) -> Frames:
    """Convert frames as the kernel gives them, struct can_frame or canfd_frame, and their times in s.

    Error frames come with identifier 0 and no data.
    """
    count = len(raw)
    is_long = np.fromiter((len(r) == _LONG for r in raw), bool, count)
    size = _LONG if is_long.any() else _CLASSIC
    table = np.frombuffer(b"".join(r.ljust(size, b"\0") for r in raw), np.uint8).reshape(count, size)
    head = np.ascontiguousarray(table[:, :4]).view(np.uint32)[:, 0]
    length, fd_flags = table[:, 4], np.where(is_long, table[:, 5], 0)
    is_error = head & 0x20000000 != 0
    flags = EXTENDED * (head >> 31) + REMOTE * (head >> 30 & 1) + FD * is_long
    flags = flags + FAST * (fd_flags & 1) + PASSIVE * (fd_flags >> 1 & 1)
    mask = np.where(head >> 31, np.uint32(0x1FFFFFFF), np.uint32(0x7FF))
    data: _Bytes = np.where((np.arange(size - 8) < length[:, None]) & ~is_error[:, None], table[:, 8:], 0)
    return Frames(
        np.where(is_error, 0, head & mask).astype(np.uint32),
        np.where(is_error, ERROR, flags).astype(np.uint8),
        np.where(is_error, 0, length).astype(np.uint8),
        data.astype(np.uint8, copy=False),
        np.fromiter(stamps, np.float64, count),
    )
