"""Clients of the page that stall, lie, flood or speak something else: few at a time, one answer each, not for long."""

from __future__ import annotations

import json
import resource
import socket
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from types import SimpleNamespace

import pytest
from test_monitor import fill

from aeolid.monitor import door, server
from aeolid.monitor.board import Board
from aeolid.monitor.server import PageServer

HEAD = b"GET /state?node=3 HTTP/1.1\r\nHost: localhost\r\n"
ASK = HEAD + b"\r\n"
HOSTILE: dict[str, bytes] = {
    "says nothing": b"",
    "a header without end": HEAD + b"X: ",
    "a huge header": HEAD + b"X: " + 100_000 * b"x" + b"\r\n\r\n",
    "a hundred headers": HEAD + 2000 * b"X: y\r\n" + b"\r\n",
    "a body that does not come": b"POST /state HTTP/1.1\r\nHost: localhost\r\nContent-Length: 60000\r\n\r\nx",
    "a body with a question": HEAD + b"Content-Length: 5\r\n\r\nhello",
    "a body in pieces": HEAD + b"Transfer-Encoding: chunked\r\n\r\n5\r\nhel",
    "a body of one endless piece": HEAD + b"Transfer-Encoding: chunked\r\n\r\nFFFFFFFF\r\n" + 1000 * b"x",
    "a body that waits for leave": HEAD + b"Content-Length: 9\r\nExpect: 100-continue\r\n\r\n",
    "TLS": bytes.fromhex("16030100c8010000c40303") + 150 * b"\x55",
    "a WebSocket": HEAD + b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: eA==\r\n\r\n",
    "HTTP/1.0": b"GET /state?node=3 HTTP/1.0\r\nHost: localhost\r\nConnection: keep-alive\r\n\r\n",
    "HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "forty at once": 40 * ASK,
    "a path without end": b"GET /" + 60_000 * b"a" + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
    "no HTTP": b"hello\r\n\r\n",
}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait for clients a tenth of what is usual."""
    monkeypatch.setattr(door, "QUESTION_S", 0.5)
    monkeypatch.setattr(door, "BODY_S", 0.1)


@pytest.fixture
def served(quick: None) -> Iterator[PageServer]:
    """Serve a filled board."""
    made = filled()
    yield made
    made.close()


def filled() -> PageServer:
    board = Board()
    fill(board)
    return PageServer(board, "127.0.0.1", 0)


def connect(page: PageServer, said: bytes = b"") -> socket.socket:
    peer = socket.create_connection(("127.0.0.1", page.port), timeout=3600)
    with suppress(OSError):  # thrown out while it spoke
        peer.sendall(said)
    return peer


def hear(peer: socket.socket) -> bytes:
    """Return all that comes until the page closes the connection; it does, or the test ends at the socket's limit."""
    told = b""
    while True:
        try:
            part = peer.recv(65536)
        except ConnectionResetError:
            return told
        if not part:
            return told
        told += part


def ask(page: PageServer, path: str = "state?node=3") -> bytes:
    with urllib.request.urlopen(page.url + path, timeout=3600) as answer:
        return bytes(answer.read())


@pytest.mark.parametrize("said", HOSTILE.values(), ids=HOSTILE)
def test_one_answer_and_no_more(served: PageServer, said: bytes) -> None:
    """Whatever is said, the page closes the connection itself after one answer at most, and the next is served."""
    with connect(served, said) as peer:
        told = hear(peer)
    assert told.count(b"HTTP/1.1 ") - told.count(b"100 (Continue)") <= 1
    assert told.count(b'"facts"') <= 1 and b"Traceback" not in told
    assert json.loads(ask(served))["facts"]["nodes"]


def test_a_client_that_has_hung_up_is_answered_all_the_same(served: PageServer) -> None:
    """Half of the connection is closed: the other half may still carry the answer; either way it is over."""
    with connect(served, ASK) as peer:
        peer.shutdown(socket.SHUT_WR)
        assert hear(peer).count(b"HTTP/1.1 ") <= 1
    ask(served)


def held(peers: list[socket.socket]) -> int:
    """Count the connections that the page has not closed."""
    count = 0
    for peer in peers:
        peer.setblocking(False)
        try:
            count += peer.recv(1) != b""
        except BlockingIOError:
            count += 1
        except ConnectionResetError:
            pass
    return count


def wait_until(true: Callable[[], bool]) -> None:
    over = time.monotonic() + 60.0
    while not true() and time.monotonic() < over:
        time.sleep(0.02)
    assert true()


def test_a_crowd_is_kept_small_and_the_oldest_go(monkeypatch: pytest.MonkeyPatch) -> None:
    """200 that say nothing: as many as one address may have are held, the newest; another question is answered."""
    monkeypatch.setattr(door, "QUESTION_S", 600.0)
    monkeypatch.setattr(door, "SHARE", 1e6)  # of this test's own pace
    board = Board()
    fill(board)
    page = PageServer(board, "127.0.0.1", 0)
    with ExitStack() as stack:
        peers = [stack.enter_context(connect(page)) for _ in range(200)]
        wait_until(lambda: held(peers) <= door.PER_ADDRESS)
        assert json.loads(ask(page))["facts"]["nodes"]
        assert held(peers[: -door.PER_ADDRESS]) == 0 and held(peers) >= door.PER_ADDRESS - 2
        page.close()  # at once, whoever is there
        assert held(peers) == 0


def test_the_same_question_costs_once(served: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Until there is something new; and answers to ever other questions are not kept beyond a bound."""
    asked: list[int] = []
    series = served.board.series
    monkeypatch.setattr(served.board, "series", lambda *have: (asked.append(1), series(*have))[1])
    served._closing.set()  # no tick in between
    served._ticker.join()
    first = served.answer(3, {"bus": 0}, None)
    assert served.answer(3, {"bus": 0}, None) is first and len(asked) == 1
    monkeypatch.setattr(server, "CACHED_BYTES", 10 * len(first))
    for count in range(100):
        served.answer(3, {"bus": count}, None)
    assert sum(map(len, served.answers.values())) <= server.CACHED_BYTES
    served.renew()
    assert served.answer(3, {"bus": 0}, None) is not first


def test_answers_that_nobody_takes_are_bounded(served: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond the bound a client is told to come again, and costs no memory."""
    served.untaken = server.UNTAKEN_BYTES
    with connect(served, ASK) as peer:
        assert hear(peer).startswith(b"HTTP/1.1 503 ")
    served.untaken = 0
    ask(served)


def test_a_page_that_costs_too_much_waits(quick: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """With no processor time to spare nothing is accepted for a while; what waits in the kernel is served then."""
    monkeypatch.setattr(door, "SAVED_S", 1e-4)
    board = Board()
    fill(board)
    page = PageServer(board, "127.0.0.1", 0)
    try:
        for _ in range(5):
            assert json.loads(ask(page))["facts"]["nodes"]
    finally:
        page.close()


def test_descriptors_are_left_to_the_reception(monkeypatch: pytest.MonkeyPatch) -> None:
    """The soft limit is raised to the hard one first; where that is low, fewer connections are let in."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        if limits[1] >= 512:
            resource.setrlimit(resource.RLIMIT_NOFILE, (256, limits[1]))
            assert door.affordable() == door.CONNECTIONS
            assert resource.getrlimit(resource.RLIMIT_NOFILE) == (min(door.WANTED, limits[1]), limits[1])
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    monkeypatch.setattr(resource, "getrlimit", lambda what: (150, 150))
    assert 4 <= door.affordable() <= 22
    monkeypatch.setattr(resource, "getrlimit", lambda what: (64, 64))
    assert door.affordable() == 4


def test_a_system_without_descriptors_is_no_loop(served: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """accept() fails for want of descriptors: the page rests instead of asking for ever, and comes back."""
    monkeypatch.setattr(door, "REST_S", 0.2)
    failed = []
    accept = socket.socket.accept

    def refuse(self: socket.socket) -> tuple[socket.socket, object]:
        if len(failed) < 3:
            failed.append(1)
            raise OSError(24, "Too many open files")
        return accept(self)

    monkeypatch.setattr(socket.socket, "accept", refuse)
    assert json.loads(ask(served))["facts"]["nodes"] and len(failed) == 3


class Stuck:
    """Be a thread that does not end, and note for how long others wait for it."""

    def __init__(self, clock: list[float]) -> None:
        self.clock = clock

    def join(self, timeout: float) -> None:
        """Wait to no avail."""
        self.clock[0] += timeout


@pytest.mark.parametrize("before", [0.0, 0.5, 60.0])
def test_the_end_waits_for_pages_and_threads_no_longer_than_said(
    monkeypatch: pytest.MonkeyPatch, before: float
) -> None:
    """Neither a page that stays away nor threads that hang add up, and files are closed meanwhile."""
    page, clock = filled(), [1000.0]
    threads = page._thread, page._ticker
    page._thread = page._ticker = Stuck(clock)  # type: ignore[assignment]
    pause = lambda seconds: clock.__setitem__(0, clock[0] + seconds)  # noqa: E731
    monkeypatch.setattr(server, "time", SimpleNamespace(monotonic=lambda: clock[0], sleep=pause))
    page.asked = over = clock[0]
    page.farewell("The reception is over.")
    assert clock[0] == over, "the announcement waits for nobody"
    assert b"The reception is over." in page.answer(-1, {}, None)
    pause(before)  # files are closed
    page.close()
    most = server.FAREWELL_S + server.CLOSE_S
    assert clock[0] - over <= max(most, before + server.CLOSE_S) + 0.02, "one step"
    assert most < 2.0
    for thread in threads:
        thread.join(3600)
        assert not thread.is_alive()


def test_a_page_that_has_heard_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """One answer after the end is enough."""
    page = filled()
    page.asked = time.monotonic()
    page.farewell("The reception is over.")
    assert b"The reception is over." in ask(page)
    wait_until(lambda: page.told > page._over)
    waits: list[float] = []
    monkeypatch.setattr(server, "time", SimpleNamespace(monotonic=time.monotonic, sleep=waits.append))
    page.close()
    assert waits == []
