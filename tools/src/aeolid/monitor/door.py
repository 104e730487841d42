"""Admit connections to the page so that they never cost the reception a frame: descriptors, memory and time.

A connection has one question and one answer, then it is closed: nothing can be queued on it and none is kept for later.
Their number is bounded and so is the life of each; where there are too many, the oldest of the address that has most of
them goes. The thread of the page may use a share of one core; while it has used more, connections wait in the kernel.
"""

from __future__ import annotations

import asyncio
import os
import socket
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import tornado.httpserver
import tornado.iostream
import tornado.netutil
import tornado.web

CONNECTIONS = 64  # at a time; a browser has six
PER_ADDRESS = 48  # of them from one address, so that another one is let in without a contest
RESERVED = 128  # descriptors left to the reception: bus, files and one for each run under way
WANTED = 4096  # descriptors; select() of a serial bus knows none above 1023, but those are opened before the page
QUESTION_S = 5.0  # within which a client has to say what it wants
BODY_S = 1.0  # no question has a body; one that is announced in pieces is not waited for
LIFE_S = 120.0  # of a connection; Plotly's 4.5 MB at 0.3 Mbit/s
HEAD_BYTES = 1 << 14  # of a question
SHARE = 0.25  # of one core for the thread of the page
SAVED_S = 0.5  # of processor time that a quiet page may save up: a browser that opens it asks for six files at once
REST_S = 1.0  # without accepting where the system refuses to (no descriptors, no memory)


@dataclass(frozen=True)
class Guest:
    """Hold a connection: since when (monotonic s), from which address."""

    since: float
    address: str
    stream: tornado.iostream.IOStream


class Door:
    """Accept connections for an application, in the event loop of the calling thread, until `close`."""

    def __init__(self, application: tornado.web.Application, sockets: Sequence[socket.socket], most: int) -> None:
        """Open. sockets: bound and listening; most: connections at a time."""
        self._loop = asyncio.get_event_loop()
        self._server = tornado.httpserver.HTTPServer(
            application, no_keep_alive=True, idle_connection_timeout=QUESTION_S, body_timeout=BODY_S, max_body_size=0,
            max_buffer_size=1 << 16, max_header_size=HEAD_BYTES,
        )  # fmt: skip
        self._sockets, self._most = list(sockets), most
        self._guests: list[Guest] = []
        self._stop_accepting: list[Callable[[], None]] = []
        self._allowance = SAVED_S  # processor time left, s
        self._looked = (time.monotonic(), time.thread_time())
        self._closed = False
        self._loop.set_exception_handler(self._fail)
        self._accept()
        self._sweep()

    def _accept(self) -> None:
        if not self._closed and not self._stop_accepting:
            self._stop_accepting = [tornado.netutil.add_accept_handler(s, self._admit) for s in self._sockets]

    def _rest(self, seconds: float) -> None:
        """Leave new connections to the kernel for a while."""
        if self._stop_accepting and not self._closed:
            for stop in self._stop_accepting:
                stop()
            self._stop_accepting = []
            self._loop.call_later(seconds, self._accept)

    def _fail(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Rest where accept has failed: the connection stays, and would be offered again at once and for ever."""
        if isinstance(context.get("exception"), OSError):
            self._rest(REST_S)

    def _admit(self, connection: socket.socket, address: tuple[str, int]) -> None:
        """Take a connection in, at the cost of the oldest one where the place is needed."""
        self._guests = [guest for guest in self._guests if not guest.stream.closed()]
        here = str(address[0]) if address else ""
        held = Counter(guest.address for guest in self._guests)
        if held[here] >= PER_ADDRESS:
            self._turn_out(here)
        elif len(self._guests) >= self._most:
            self._turn_out(held.most_common(1)[0][0])
        stream = tornado.iostream.IOStream(connection, max_buffer_size=1 << 16)
        self._guests.append(Guest(time.monotonic(), here, stream))
        self._server.handle_stream(stream, address)
        if (left := self._spare()) < 0.0:
            self._rest(-left / SHARE)

    def _turn_out(self, address: str) -> None:
        next(guest for guest in self._guests if guest.address == address).stream.close()

    def _spare(self) -> float:
        """Return the processor time, s, that this thread may still use; below 0 it has used too much."""
        (then, used), (now, use) = self._looked, (time.monotonic(), time.thread_time())
        self._looked = now, use
        self._allowance = min(SAVED_S, self._allowance + SHARE * (now - then)) - (use - used)
        return self._allowance

    def _sweep(self) -> None:
        """Close what has lasted too long; once a second."""
        if self._closed:
            return
        over = time.monotonic() - LIFE_S
        for guest in self._guests:
            if guest.since < over:
                guest.stream.close()
        self._guests = [guest for guest in self._guests if not guest.stream.closed()]
        self._loop.call_later(1.0, self._sweep)

    def close(self) -> None:
        """Close everything at once, whatever is under way."""
        self._closed = True
        for stop in self._stop_accepting:
            stop()
        for listening in self._sockets:
            listening.close()
        for guest in self._guests:
            guest.stream.close()


def affordable() -> int:
    """Return how many connections leave the reception the descriptors it may need, 4 to CONNECTIONS.

    Raises this process's limit first, as far as the system lets it without asking.
    """
    try:
        import resource
    except ImportError:  # no such limit here
        return CONNECTIONS
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = WANTED if hard == resource.RLIM_INFINITY else min(WANTED, hard)
    if soft != resource.RLIM_INFINITY and soft < most:
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
        soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if soft == resource.RLIM_INFINITY:
        return CONNECTIONS
    try:
        used = len(os.listdir("/proc/self/fd"))
    except OSError:
        used = RESERVED
    return max(4, min(CONNECTIONS, soft - used - RESERVED))
