"""Publish on an MQTT broker: version 3.1.1, quality of service 0, nothing is ever subscribed to."""

from __future__ import annotations

import secrets
import socket
import ssl
import struct
from types import TracebackType

from aeolid.errors import UsageError

KEEP_ALIVE_S = 0  # the broker waits for the next message however long that takes (section 3.1.2.10)
ANSWER_S = 5.0  # for the broker to take a connection
_REFUSALS = {
    1: "another version of MQTT", 2: "a rejected name", 3: "the server is unavailable", 4: "a wrong user or password",
    5: "no right to connect",
}  # fmt: skip
_MOST_TEXT = 0xFFFF


class MqttRefused(OSError):
    """Report a broker that does not take the connection."""


def _text(value: str) -> bytes:
    data = value.encode()
    if len(data) > _MOST_TEXT or "\0" in value:
        raise UsageError(f"{value[:40]!r} is no text that MQTT can carry")
    return struct.pack(">H", len(data)) + data


def packet(kind: int, body: bytes) -> bytes:
    """Return a control packet: its first byte, the length in groups of 7 bits (section 2.2.3), its body."""
    length, size = bytearray(), len(body)
    while True:
        size, digit = divmod(size, 128)
        length.append(digit | (0x80 if size else 0))
        if not size:
            break
    return bytes([kind]) + bytes(length) + body


class MqttClient:
    """Hold a connection to a broker until `close`."""

    def __init__(
        self, host: str, port: int, *, user: str | None = None, password: str | None = None, tls: bool = False
    ) -> None:
        """Connect. Raises OSError where nobody answers, MqttRefused with the reason where the broker refuses."""
        plain = socket.create_connection((host, port), timeout=ANSWER_S)
        try:
            self._socket = ssl.create_default_context().wrap_socket(plain, server_hostname=host) if tls else plain
            flags = 0x02 | (0x80 if user is not None else 0) | (0x40 if password is not None else 0)  # a clean session
            body = _text("MQTT") + bytes([4, flags]) + struct.pack(">H", KEEP_ALIVE_S)
            body += _text(f"aeolid-{secrets.token_hex(6)}")
            body += b"".join(_text(t) for t in (user, password) if t is not None)
            self._socket.sendall(packet(0x10, body))
            answer = self._exactly(4)
            if answer[0] != 0x20 or answer[1] != 2:
                raise MqttRefused("it does not speak MQTT")
            if answer[3]:
                raise MqttRefused(_REFUSALS.get(answer[3], f"reason {answer[3]}"))
        except BaseException:
            plain.close()
            raise

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            part = self._socket.recv(count - len(data))
            if not part:
                raise MqttRefused("it closed the connection")
            data += part
        return data

    def publish(self, topic: str, payload: bytes, *, retain: bool = False) -> None:
        """Send one message; retain: who subscribes later gets it too. Raises OSError where the connection broke off."""
        self._socket.sendall(packet(0x31 if retain else 0x30, _text(topic) + payload))

    def ping(self) -> None:
        """Show that the connection is alive and read what the broker sends; raises OSError where it has gone."""
        self._socket.sendall(b"\xc0\x00")
        if self._exactly(2) != b"\xd0\x00":
            raise MqttRefused("it does not answer a ping")

    def close(self) -> None:
        """Say goodbye and close."""
        try:
            self._socket.sendall(b"\xe0\x00")
        except OSError:
            pass
        finally:
            self._socket.close()

    def __enter__(self) -> MqttClient:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()
