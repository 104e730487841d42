"""Serve the page of a board on one address of this machine, in a thread of its own.

A page asks once a second for what is new; nothing is pushed and nothing queued, so a browser that stalls has one answer
under way and no more, and the reception never waits for any (aeolid.monitor.door says who is let in, and how many).
Everything the page needs is in this package or in that of plotly.py; its security policy forbids the browser to ask
anybody else.
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import logging
import math
import socket
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import plotly
import tornado.iostream
import tornado.netutil
import tornado.web

from aeolid.errors import UsageError
from aeolid.monitor.board import Board
from aeolid.monitor.door import Door, affordable
from aeolid.publish.rows import prometheus_text, rows_of_monitor

PAGE = Path(__file__).resolve().parent / "page"
PLOTLY = Path(plotly.__file__).resolve().parent / "package_data"
TICK_S = 1.0
ANSWER_S = 20.0  # within which a browser has to take an answer
FAREWELL_S = 1.2  # for pages, which ask once a second, to hear that it is over
CLOSE_S = 0.4  # for answers under way to break off, and for the threads to end
CACHED_BYTES = 1 << 23  # of answers kept until there is something new
UNTAKEN_BYTES = 1 << 24  # of answers that clients have not taken yet; whoever asks meanwhile is told to come again
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self';"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)  # Plotly sets styles on its drawings
HEADERS = {
    "Content-Security-Policy": POLICY, "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin", "Cross-Origin-Opener-Policy": "same-origin",
}  # fmt: skip


class PageServer:
    """Serve a board until `close`. address, port: as bound; url: what a browser on this machine opens."""

    def __init__(self, board: Board, address: str, port: int) -> None:
        """Bind and start; port 0 takes any free one. Raises UsageError where the address cannot be had."""
        try:
            self._sockets = tornado.netutil.bind_sockets(port, address)
        except (OSError, UnicodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise UsageError(
                f"--port {port}: {address} cannot be served on it ({why}); --port 0 takes any free one"
            ) from None
        self.board, self.address = board, address
        self.port = int(self._sockets[0].getsockname()[1])
        self.url = f"http://{f'[{address}]' if ':' in address else address}:{self.port}/"
        self.identity = uuid.uuid4().hex
        self.answers: dict[Any, bytes] = {}  # by what was asked for, of the facts as they are now
        self.untaken = 0  # bytes of answers
        self.asked = self.told = -math.inf  # when a page last asked, and last heard of the present facts
        self._over = -math.inf  # when the reception ended
        self._loop = asyncio.new_event_loop()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._ticker = threading.Thread(target=self._tick, name="tick", daemon=True)
        self.facts_json = json.dumps(board.facts, allow_nan=False)
        for name in ("tornado", "asyncio"):  # what browsers do must not fill the operator's terminal, or a pipe for it
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        self._thread.start()
        self._ticker.start()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        door = Door(_application(self), self._sockets, affordable())
        self._loop.run_forever()
        door.close()
        for task in (tasks := asyncio.all_tasks(self._loop)):
            task.cancel()
        if tasks:
            self._loop.run_until_complete(asyncio.wait(tasks, timeout=CLOSE_S / 2))
        self._loop.close()

    def _tick(self) -> None:
        while not self._closing.wait(TICK_S):
            self.renew()

    def renew(self) -> None:
        """Look at the reception and spell its facts once for all browsers."""
        self._show(self.board.tick)

    def _show(self, look: Callable[[], None]) -> None:
        """Look and spell the facts; whatever becomes of the display, the reception goes on."""
        known = self.board.facts
        try:
            look()
            spelt = json.dumps(self.board.facts, allow_nan=False)
        except Exception as error:
            what = f"The display has stopped: {type(error).__name__}: {error}."
            remedy = "Reception and recording go on; start the monitor again when it suits."
            trouble = {"node": None, "level": "alarm", "what": what, "remedy": remedy}
            self.board.facts = known | {"findings": [trouble]}
            spelt = json.dumps(json.loads(self.facts_json) | {"findings": [trouble]})
        self.facts_json, self.answers = spelt, {}

    def answer(self, node: int, have: dict[str, int], entry: tuple[int, int, int] | None) -> bytes:
        """Return the answer to a page that has so much; the same question costs once until there is something new."""
        answers, asked = self.answers, (node, *have.values(), entry)
        if (known := answers.get(asked)) is not None:
            return known
        series = json.dumps(self.board.series(node, have, entry), allow_nan=False, separators=(",", ":"))
        made = f'{{"process":"{self.identity}","facts":{self.facts_json},"series":{series}}}'.encode()
        if sum(map(len, answers.values())) + len(made) <= CACHED_BYTES:
            answers[asked] = made
        return made

    def farewell(self, reason: str) -> None:
        """Let pages that are open hear, until `close` has waited for one of them, that the reception is over."""
        self._closing.set()
        self._show(lambda: self.board.end(reason))
        self._over = time.monotonic()

    def close(self) -> None:
        """Stop serving: connections are closed. Takes at most FAREWELL_S since `farewell`, and CLOSE_S."""
        self._closing.set()
        while self._is_heard_of_soon():
            time.sleep(0.02)
        self._loop.call_soon_threadsafe(self._loop.stop)
        until = time.monotonic() + CLOSE_S
        for thread in (self._thread, self._ticker):
            thread.join(max(0.0, until - time.monotonic()))  # both are daemons: neither holds up the end

    def _is_heard_of_soon(self) -> bool:
        """Tell whether a page that is open may still ask and hear of the end; somebody looks at it who asked lately."""
        over = self._over
        return self.asked > over - 3 * TICK_S and self.told <= over and time.monotonic() < over + FAREWELL_S


def _application(server: PageServer) -> tornado.web.Application:
    own = [(f"/({name})", _File, {"path": PAGE}) for name in ("monitor.css", "monitor.js", "charts.js", "icon.svg")]
    routes: list[Any] = [
        (r"/()", _File, {"path": PAGE, "default_filename": "index.html"}), *own,
        (r"/(plotly\.min\.js)", _File, {"path": PLOTLY}), (r"/state", _State, {"server": server}),
        (r"/metrics", _Metrics, {"server": server}),
    ]  # fmt: skip
    return tornado.web.Application(routes, default_handler_class=_Nothing, log_function=lambda _: None)


def is_own_name(host: str) -> bool:
    """Tell whether a browser that asks for this host means this machine: an address, localhost, or its name.

    A foreign page may point a name of its own to this address and would then be let in by the browser; an address or
    our own name it cannot have.
    """
    try:
        ipaddress.ip_address(host)
        return True
    except ValueError:
        return host.lower() in ("localhost", socket.gethostname().lower())


class _Guarded(tornado.web.RequestHandler):
    """Answer only who asks for this machine, with headers that keep the page to itself."""

    def set_default_headers(self) -> None:
        """Set what every answer has."""
        self.clear_header("Server")
        for name, value in HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        """Refuse a page of another name."""
        if not is_own_name(_host_of(self.request.headers.get("Host", ""))):
            raise tornado.web.HTTPError(421, reason="Misdirected")

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """Say the reason and nothing else."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}: {self._reason}\n")


def _host_of(text: str) -> str:
    """Return the name or address in a Host header."""
    return text[1:].partition("]")[0] if text.startswith("[") else text.partition(":")[0]


class _Nothing(_Guarded):
    """Answer what is not there."""

    def prepare(self) -> None:
        """Refuse."""
        super().prepare()
        raise tornado.web.HTTPError(404)


class _File(_Guarded, tornado.web.StaticFileHandler):
    """Serve one file; browsers ask each time whether it is still the same."""

    def set_extra_headers(self, path: str) -> None:
        """Have it checked: another version may be started on the same port."""
        self.set_header("Cache-Control", "no-cache")


class _Metrics(_Guarded):
    """Tell the facts as Prometheus scrapes them."""

    def initialize(self, server: PageServer) -> None:
        """Keep the server."""
        self.server = server

    def get(self) -> None:
        """Answer in the text exposition format."""
        self.set_header("Content-Type", "text/plain; version=0.0.4; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.finish(prometheus_text(rows_of_monitor(self.server.board.facts)))


class _State(_Guarded):
    """Tell the facts, and what came to one node's histories since the counts that the page names."""

    def initialize(self, server: PageServer) -> None:
        """Keep the server."""
        self.server = server

    async def get(self) -> None:
        """Answer with JSON."""
        server = self.server
        began = server.asked = time.monotonic()
        have = {name: self._number(name) for name in ("bus", "modes", "tests", "thetas", "matrix")}
        if self.get_query_argument("process", "") != server.identity:
            have = dict.fromkeys(have, 0)
        answer = server.answer(self._number("node", -1), have, self._entry())
        if server.untaken + len(answer) > UNTAKEN_BYTES:
            raise tornado.web.HTTPError(503, reason="Too many answers wait to be taken")
        self.set_header("Content-Type", "application/json")
        self.set_header("Cache-Control", "no-store")
        self.write(answer)
        server.untaken += len(answer)
        try:
            await asyncio.wait_for(self.flush(), ANSWER_S)
        except tornado.iostream.StreamClosedError:  # the browser has gone
            return
        except TimeoutError:  # a browser that takes nothing has no claim to memory
            self.request.connection.stream.close()  # type: ignore[union-attr]
            return
        finally:
            server.untaken -= len(answer)
        server.told = began

    def _number(self, name: str, default: int = 0) -> int:
        try:
            return int(self.get_query_argument(name, str(default)))
        except ValueError:
            raise tornado.web.HTTPError(400, reason=f"{name} is no number") from None

    def _entry(self) -> tuple[int, int, int] | None:
        text = self.get_query_argument("entry", "")
        try:
            output, channel, lag = (int(part) for part in text.split(","))
        except ValueError:
            return None
        return output, channel, lag
