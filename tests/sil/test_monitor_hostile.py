"""A monitor whose page is besieged by hundreds of clients: the recording is complete, and SIGTERM ends it."""

from __future__ import annotations

import json
import resource
import signal
import socket
import urllib.request
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from harness import Process
from test_listen import LINE, Adapter, slcan_text

DESCRIPTORS = 160  # of the monitor: 300 clients are far more
CLIENTS = 60  # of each kind
HEAD = b"GET /state?node=7 HTTP/1.1\r\nHost: localhost\r\n"
KINDS = (
    b"", HEAD + b"X: ", HEAD + b"Content-Length: 60000\r\n\r\nx", HEAD + b"Transfer-Encoding: chunked\r\n\r\n5\r\nhel",
    40 * (HEAD + b"\r\n"),
)  # fmt: skip


def besiege(port: int) -> list[socket.socket]:
    """Open hundreds of connections that say something, take nothing and stay."""
    peers = []
    for said in KINDS * CLIENTS:
        peer = socket.socket()
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        peer.settimeout(60)
        peer.connect(("127.0.0.1", port))
        peers.append(peer)
        try:
            peer.sendall(said)
        except OSError:  # already thrown out
            continue
    return peers


def hear(peer: socket.socket) -> bytes:
    told = b""
    while True:
        try:
            part = peer.recv(65536)
        except ConnectionResetError:
            return told
        if not part:
            return told
        told += part


def test_a_siege_costs_no_frame_and_holds_nothing_up(start: Callable[..., Process], tmp_path: Path) -> None:
    """Before, while and after a stream arrives; a page that asks meanwhile is answered, and the end comes at once."""
    text, facts, target = slcan_text(), tmp_path / "facts.json", tmp_path / "r.csv"
    with closing(Adapter()) as adapter:
        monitor = start("monitor", "--bus", adapter.address, "--port", 0, "--no-browser", "--record", target,
                        "--json", facts)  # fmt: skip
        url = monitor.first_line()
        port = int(url.rstrip("/").rsplit(":", 1)[1])
        resource.prlimit(monitor.process.pid, resource.RLIMIT_NOFILE, (DESCRIPTORS, DESCRIPTORS))
        adapter.plug()
        peers = besiege(port)
        adapter.send(text)
        with urllib.request.urlopen(f"{url}state?node=7", timeout=3600) as answer:
            assert "facts" in json.loads(answer.read())
        peers += besiege(port)
        seen = 0
        while seen < len(text) // LINE:
            with urllib.request.urlopen(f"{url}state?node=7", timeout=3600) as answer:
                seen = json.loads(answer.read())["facts"]["bus"]["frames"]
        peers += besiege(port)
        monitor.signal(signal.SIGTERM)
        monitor.finish().assert_clean()
        answers = [hear(peer).count(b"HTTP/1.1 200") for peer in peers]
        for peer in peers:
            peer.close()
    told = json.loads(facts.read_text())
    assert told["ended_by"] == "stopped" and told["frames"] == len(text) // LINE
    assert (told["damaged"], told["garbled_lines"], told["overrun"], told["interruptions"]) == (0, 0, 0, 0)
    (run,) = told["nodes"][0]["runs"]
    assert run["lost_values"] == 0 and run["samples"] > 0 and target.stat().st_size > 0
    assert max(answers) <= 1, "one question a connection, whatever is sent at once"
