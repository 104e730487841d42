"""The kernel's frames, converted in bulk, are those that python-can's own code makes and reads, one by one."""

from __future__ import annotations

import errno
import random
import socket
from collections import deque

import can
import numpy as np
import pytest
from can.interfaces.socketcan.socketcan import build_can_frame

from aeolid.can import open_source
from aeolid.can.messages import pack_messages
from aeolid.can.socketcan import BUFFER, SO_RCVBUFFORCE, BulkSocketcanBus, unpack
from aeolid.errors import DataError

LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


def draw(seed: int, fd: bool, count: int = 400) -> list[can.Message]:
    """Draw messages of every kind: 11 and 29 bits, remote, error and, with fd, CAN FD frames of every length."""
    rng = random.Random(seed)
    messages = []
    for k in range(count):
        extended, kind = rng.random() < 0.5, rng.random()
        identifier = rng.choice([0, 0x7FF, rng.randrange(0x800)])
        identifier = rng.choice([identifier, 0x1FFFFFFF, rng.randrange(1 << 29)]) if extended else identifier
        common = {"arbitration_id": identifier, "is_extended_id": extended, "timestamp": 1e9 + k / 8}
        if kind < 0.1:
            messages.append(can.Message(is_error_frame=True, dlc=8, data=rng.randbytes(8), **common))
        elif kind < 0.2:  # in logs a remote frame of the highest identifier has a meaning of its own
            common["arbitration_id"] = min(identifier, 0x1FFFFFFE)
            messages.append(can.Message(is_remote_frame=True, **common))
        elif fd and kind < 0.6:
            more = {"bitrate_switch": rng.random() < 0.5, "error_state_indicator": rng.random() < 0.5}
            messages.append(can.Message(is_fd=True, data=rng.randbytes(rng.choice(LENGTHS)), **common, **more))
        else:
            messages.append(can.Message(data=rng.randbytes(rng.randrange(9)), **common))
    return messages


@pytest.mark.parametrize("fd", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_bulk_conversion_equals_one_by_one(seed: int, fd: bool) -> None:
    messages = draw(seed, fd)
    expected = pack_messages(messages)
    found = unpack([build_can_frame(m) for m in messages], [m.timestamp for m in messages])
    wrong = expected.flags == 32  # of an error frame only the fact is kept
    for name in ("flags", "time_s"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)
    for name in ("id", "length", "data"):
        np.testing.assert_array_equal(getattr(found, name)[~wrong], getattr(expected, name)[~wrong], err_msg=name)
        assert not getattr(found, name)[wrong].any()


def test_padding_behind_the_length_is_not_believed() -> None:
    raw = build_can_frame(can.Message(arbitration_id=5, is_extended_id=False, data=b"\1\2"))[:10] + b"rubbish"[:6]
    found = unpack([raw], [0.0])
    assert found.length.tolist() == [2] and found.data.tolist() == [[1, 2, 0, 0, 0, 0, 0, 0]]


def test_nothing_received_is_an_empty_batch() -> None:
    assert len(unpack([], [])) == 0


def test_the_buffer_is_large_before_the_first_frame_can_come(monkeypatch: pytest.MonkeyPatch) -> None:
    """What arrives between the bind and a later, larger buffer would overrun the kernel's own: lost on a slow host."""
    told: list[str] = []

    class Recorder:
        def setsockopt(self, level: int, option: int, value: object) -> None:
            told.append(f"buffer {value}" if (level, option) == (socket.SOL_SOCKET, SO_RCVBUFFORCE) else "option")

    def create() -> Recorder:
        return Recorder()

    def bind(made: Recorder, channel: str) -> None:
        told.append(f"bind {channel}")

    monkeypatch.setattr("can.interfaces.socketcan.socketcan.create_socket", create)
    monkeypatch.setattr("can.interfaces.socketcan.socketcan.bind_socket", bind)
    monkeypatch.setattr(BulkSocketcanBus, "shutdown", lambda self: None)
    bus = BulkSocketcanBus("can0")
    assert told.index(f"buffer {BUFFER}") < told.index("bind can0")
    assert isinstance(bus.socket, Recorder)


class _GoneDown:
    """Stand in for a socket whose interface went down: the kernel gives the error first and the waiting frames after.

    What arrives goes through a pair of real sockets, so that waiting works.
    """

    def __init__(self, frames: list[bytes]) -> None:
        self.reading, self._writing = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.reading.setblocking(False)
        self._error: OSError | None = OSError(errno.ENETDOWN, "Network is down")
        for frame in frames:
            self._writing.send(frame)

    def fileno(self) -> int:
        return self.reading.fileno()

    def recvmsg(self, *sizes: int) -> tuple[bytes, list[tuple[int, int, bytes]], int, None]:
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        return *self.reading.recvmsg(*sizes)[:3], None

    def close(self) -> None:
        self.reading.close()
        self._writing.close()


def open_gone_down(frames: list[bytes]) -> BulkSocketcanBus:
    """Return a bus on an interface that went down after these frames had come."""
    bus = BulkSocketcanBus.__new__(BulkSocketcanBus)
    bus.overrun, bus._fault, bus._pending = 0, None, deque()
    bus._socket = _GoneDown(frames)  # type: ignore[assignment]
    return bus


def test_what_came_before_the_interface_went_down_is_delivered() -> None:
    """A listener that had not yet read when the interface went lost everything that waited in its socket."""
    sent = draw(1, False, 30)
    bus = open_gone_down([build_can_frame(m) for m in sent])
    try:
        received = bus.read_frames(1.0)
        np.testing.assert_array_equal(received.id, unpack([build_can_frame(m) for m in sent], [0.0] * 30).id)
        with pytest.raises(can.CanOperationError, match="down"):
            bus.read_frames(1.0)
    finally:
        bus._socket.close()


def test_an_interface_that_is_not_there_is_named() -> None:
    with pytest.raises(DataError, match="cannot be opened") as told:
        open_source("socketcan:nosuchcan0")
    assert "nosuchcan0" in str(told.value) or not hasattr(socket, "AF_CAN")
