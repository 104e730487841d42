"""Send rows to what a URL names, in a thread of its own: the reception never waits for a broker or a database."""

from __future__ import annotations

import http.client
import json
import os
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Sequence
from typing import Any, Protocol
from urllib.parse import SplitResult, unquote, urlsplit

from aeolid.errors import UsageError
from aeolid.publish.mqtt import MqttClient
from aeolid.publish.rows import Row, line_protocol

EVERY_S = 10.0
_CLOSE_S = 3.0  # for the last message to leave
_HTTP_S = 10.0
_FORMS = "mqtt://HOST[:PORT]/TOPIC (mqtts://…), or a database's line protocol, http(s)://HOST:PORT/write?db=…"
TOKEN, USER, PASSWORD = "AEOLID_PUBLISH_TOKEN", "AEOLID_PUBLISH_USER", "AEOLID_PUBLISH_PASSWORD"


class Target(Protocol):
    """Take rows."""

    def send(self, rows: Sequence[Row], now_s: float) -> None:
        """Send rows; raises OSError where they did not arrive."""

    def close(self) -> None:
        """Let go."""


def target_of(url: str) -> Target:
    """Return what a URL names, without connecting. Raises UsageError where it names nothing."""
    if any(not c.isprintable() or (c.isspace() and not url.startswith("mqtt")) for c in url):
        raise UsageError(f"--publish {url!r}: an address holds no blanks or control characters; write %20 for a blank")
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        raise UsageError(f"--publish {url}: no address; give {_FORMS}") from None
    if not parts.hostname or parts.scheme not in ("mqtt", "mqtts", "http", "https"):
        raise UsageError(f"--publish {url}: not understood; give {_FORMS}")
    if parts.username is not None or parts.password is not None:
        raise UsageError(f"--publish: a password in an address is seen by others; set {USER} and {PASSWORD}")
    if parts.scheme.startswith("mqtt"):
        return _Mqtt(parts, port)
    return _Lines(url)


class _Mqtt:
    """Publish each row as JSON under TOPIC/measurement/tags, retained: who comes later sees the newest."""

    def __init__(self, parts: SplitResult, port: int | None) -> None:
        self._topic = unquote(parts.path).strip("/") or "aeolid"
        if any(c in self._topic for c in "+#"):
            raise UsageError(f"--publish: the topic {self._topic!r} has + or #, which are for those who subscribe")
        self._host, self._tls = str(parts.hostname), parts.scheme == "mqtts"
        self._port = port or (8883 if self._tls else 1883)
        self._client: MqttClient | None = None

    def send(self, rows: Sequence[Row], now_s: float) -> None:
        """Connect where that is needed, and publish; where a connection of before has gone, again on a fresh one."""
        for client in [*([self._client] if self._client is not None else []), None]:
            try:
                self._publish(client, rows, now_s)
                return
            except OSError:
                self.close()
                if client is None:
                    raise

    def _publish(self, client: MqttClient | None, rows: Sequence[Row], now_s: float) -> None:
        if client is None:
            user, password = os.environ.get(USER), os.environ.get(PASSWORD)
            client = MqttClient(self._host, self._port, user=user, password=password, tls=self._tls)
        self._client = client
        for row in rows:
            client.publish(self._of(row), _json(row, now_s), retain=True)
        client.ping()

    def _of(self, row: Row) -> str:
        levels = [row.measurement, *(v for _, v in sorted(row.tags.items()) if v)]
        return "/".join([self._topic, *(_level(level) for level in levels)])

    def close(self) -> None:
        """Let go."""
        if self._client is not None:
            self._client.close()
        self._client = None


def _level(text: str) -> str:
    """Return one level of a topic: what separates or stands for levels is none."""
    return "".join("_" if c in "/+#\0" or not c.isprintable() else c for c in text)[:200]


def _json(row: Row, now_s: float) -> bytes:
    at = now_s if row.time_s is None else row.time_s
    return json.dumps({"time_s": round(at, 3), **row.tags, **row.values}).encode()


class _Lines:
    """Post rows in the line protocol to a database that speaks InfluxDB's write interface, version 1 or 2."""

    def __init__(self, url: str) -> None:
        self._url = url

    def send(self, rows: Sequence[Row], now_s: float) -> None:
        """Post all rows at once."""
        request = urllib.request.Request(self._url, data=line_protocol(rows, now_s).encode(), method="POST")
        request.add_header("Content-Type", "text/plain; charset=utf-8")
        if token := os.environ.get(TOKEN):
            request.add_header("Authorization", f"Token {token}")
        opener = urllib.request.build_opener(_Straight)
        try:
            with opener.open(request, timeout=_HTTP_S):
                return
        except urllib.error.HTTPError as error:
            raise OSError(f"the server answers {error.code} {error.reason}") from None
        except http.client.HTTPException as error:
            raise OSError(f"the answer is no HTTP ({type(error).__name__})") from None

    def close(self) -> None:
        """Do nothing: every message has a connection of its own."""


class _Straight(urllib.request.HTTPRedirectHandler):
    """Follow no redirection: the token is for the server that was named."""

    def redirect_request(self, *args: Any, **more: Any) -> None:
        """Refuse."""
        return None


class Publisher:
    """Send the newest rows every so many seconds until `close`; what cannot be sent is dropped and counted."""

    def __init__(
        self, targets: Sequence[tuple[str, Target]], rows: Callable[[], Sequence[Row]], say: Callable[[str], None],
        every_s: float = EVERY_S,
    ) -> None:  # fmt: skip
        """Start. rows: what there is to send now; say: tell the user of a target that does not answer, once."""
        self._targets, self._rows, self._say, self._every = targets, rows, say, every_s
        self.sent, self.failed = dict.fromkeys((n for n, _ in targets), 0), dict.fromkeys((n for n, _ in targets), 0)
        self._trouble: dict[str, str] = {}
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="publish", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.wait(self._every):
            self.turn()
        self.turn()  # the last state
        for _, target in self._targets:
            target.close()

    def turn(self) -> None:
        """Send once to every target."""
        try:
            rows, now = self._rows(), time.time()
        except Exception:  # the facts are being made anew; the next turn has them
            return
        for name, target in self._targets if rows else ():
            try:
                target.send(rows, now)
            except (
                Exception
            ) as error:  # whatever becomes of a target, the others and the next turn are not kept from it
                self.failed[name] += 1
                why = str(error) or type(error).__name__
                if self._trouble.get(name) != why:
                    self._trouble[name] = why
                    self._say(f"--publish {name}: not sent ({why}); reception goes on, and so does the attempt")
                continue
            self.sent[name] += 1
            if self._trouble.pop(name, None) is not None:
                self._say(f"--publish {name}: arrives again")

    def close(self) -> None:
        """Send the last state and stop; waits no longer than 3 s for it."""
        self._end.set()
        self._thread.join(_CLOSE_S)
