"""The monitor beside a node that streams: a page in a real browser, browsers that stall, restarts, and how it ends."""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import flood_traffic
import numpy as np
import pytest
from harness import Process, wait_for
from monitor_browser import Browser
from rich.console import Console
from test_listen import HERE, LINE, Adapter, slcan_text

from aeolid.can import RunRecorder, open_source, source
from aeolid.can.reception import Reception
from aeolid.cli.listen_modes import ModeFollower
from aeolid.cli.main import main
from aeolid.formats import write_table
from aeolid.monitor.board import Board
from aeolid.monitor.server import PageServer
from aeolid.monitor.terminal import render

Start = Callable[..., Process]
NASTY = "<img src=x onerror=alert(1)>"  # 28 bytes; a name has 32
TABLE = "[...document.querySelectorAll('#modes-table tbody tr')].map(r => [...r.children].map(c => c.textContent))"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Start one browser for all pages."""
    made = Browser(tmp_path_factory.mktemp("browser"))
    yield made
    made.close()


def words_of(board: Board) -> str:
    """Return what the terminal prints of a board."""
    console = Console(file=io.StringIO(), width=400)
    console.print(render(board.facts))
    assert isinstance(console.file, io.StringIO)
    return " ".join(console.file.getvalue().split())


class Watched:
    """Receive a node in a thread, watched by a board that a server serves."""

    def __init__(self, address: str, reconnect: bool = False) -> None:
        self.board = Board()
        source = open_source(address, reconnect=reconnect)
        self.reception = Reception(source, RunRecorder(None), bit_rate=5e5, data_bit_rate=2e6)
        self.follower = ModeFollower(None, None, every_s=1.0, patient=True, observer=self.board)
        self.reception.watch = self.follower.look
        self.board.watch(self.reception, self.follower)
        self.server = PageServer(self.board, "127.0.0.1", 0)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        self.reception.run(lambda: False, None, True)
        self.follower.finish()

    def finish(self) -> None:
        """Wait for the end of the stream, and for the facts to be of it."""
        self._thread.join()
        self.server.renew()

    def close(self) -> None:
        """Stop serving."""
        self._thread.join()
        self.server.close()
        self.reception.source.close()


def test_the_page_shows_what_the_terminal_prints(start: Start, browser: Browser, tmp_path: Path) -> None:
    """A turbine at 500 times its pace: modes appear meanwhile; at the end every figure is the terminal's."""
    node = start("node", "--turbine", "--samples", 3000, "--past", 12, "--feedthrough", "pitch", "--wait",
                 "--speed", 500, "--share", 0, "--snapshot-every", 20)  # fmt: skip
    with closing(Watched(node.first_line())) as watched:
        browser.open(watched.server.url)
        browser.wait("document.querySelectorAll('#modes-table tbody tr').length > 1")
        watched.finish()
        text = words_of(watched.board)
        modes = watched.board.facts["nodes"][0]["modes"]
        keys = ("frequency", "frequency_95", "damping_percent", "damping_95", "mostly_in", "name")
        rows = [[str(m["mode"]), *(m[key] for key in keys)] for m in modes]
        browser.wait(
            f"JSON.stringify({TABLE}) === {json.dumps(json.dumps(rows, ensure_ascii=False, separators=(',', ':')))}"
        )
        assert "all nodes have ended" in browser.evaluate("document.body.innerText")
        for row in rows:
            assert " ".join(row) in text
        for true in (0.444, 1.6795):
            assert min(abs(m["frequency_hz"] - true) for m in modes) < 0.02
        assert all(m["frequency_95"] and m["damping_95"] for m in modes)
        seen = browser.evaluate("document.body.innerText")
        for test in watched.board.facts["nodes"][0]["innovations"]["rows"]:
            assert test["whiteness"] in seen and test["whiteness"] in text and test["ratio"] in text
        look_at_charts(browser, watched.board.series(1, {}, None)["modes"]["rows"][-1][1])
        look_around(browser, tmp_path)
        assert browser.leave() == []


def look_at_charts(browser: Browser, newest: list[list[Any]]) -> None:
    """Check that each band is 2 · 1.96 deviations high at its newest end. newest: modes as the history has them."""
    for number, _, frequency_std, _, damping_std in newest:
        for kind, std in (("frequency", frequency_std), ("damping", 100 * damping_std)):
            place = f"document.querySelector('#{kind}-{number} .plot')"
            band = browser.wait(f"{place}.data && {place}.data.filter(t => t.fill).map(t => t.y).at(-1)")
            half = len(band) // 2  # up along the lower edge, back along the upper one
            assert band[half] - band[half - 1] == pytest.approx(2 * 1.959964 * std, rel=1e-4)
            assert f"Mode {number}, {kind}" in browser.evaluate(f"{place}.getAttribute('aria-label')")
    assert browser.evaluate("document.querySelectorAll('[role=img]:not([aria-label])').length") == 0


def look_around(browser: Browser, folder: Path) -> None:
    """Look at the page wide, dark and narrow; nothing runs over its edge, and a parameter can be chosen by keyboard."""
    from matplotlib.image import imread

    mean = {}
    for name, wide, dark in (("light", 1400, False), ("dark", 1400, True), ("narrow", 420, False)):
        browser.look(wide, 1500, dark)
        browser.wait("new Promise(done => setTimeout(() => done(true), 300))")
        assert browser.evaluate("document.documentElement.scrollWidth") <= wide
        picture = imread(browser.picture(folder / f"{name}.png"))[..., :3]
        assert picture.shape[:2] == (1500, wide) and picture.std() > 0.05
        mean[name] = float(picture.mean())
    assert mean["dark"] < 0.3 < 0.7 < mean["light"]
    browser.look(1400, 1500, False)
    browser.evaluate(
        "document.getElementById('pick-lag').value = '3';"
        "document.getElementById('pick-lag').dispatchEvent(new Event('change'))"
    )
    browser.wait("document.getElementById('theta-words').textContent.includes('lag 3')")
    unnamed = "[...document.querySelectorAll('select, input')].filter(e => !e.labels.length).length"
    assert browser.evaluate(unnamed) == 0


def test_names_from_the_bus_are_text(start: Start, browser: Browser, tmp_path: Path) -> None:
    """Channels whose names and units are markup: shown letter by letter in table, chart and choice; nothing is run."""
    generator = np.random.default_rng(0)
    names, units = (NASTY, "<b>bold</b><script>", 'a" onload="1&lt;'), ("<i>V</i>", "</td>&amp;", "m")
    u, y = generator.normal(size=(1200, 2)), generator.normal(size=(1200, 1))
    y[1:, 0] += u[:-1].sum(axis=1)
    y[1:] += 0.5 * y[:-1]
    write_table(tmp_path / "n.csv", dict(zip(names, np.hstack([u, y]).T, strict=True)), {})
    roles = "[recording]\nsample_time_s = 0.1\n" + "".join(
        f"[[channel]]\nname = {json.dumps(name)}\nunit = {json.dumps(unit)}\nrole = '{role}'\n"
        for name, unit, role in zip(names, units, ("input", "input", "output"), strict=True)
    )
    (tmp_path / "n.toml").write_text(roles)
    node = start("node", "--recording", tmp_path / "n.csv", "--roles", tmp_path / "n.toml", "--past", 3, "--wait",
                 "--speed", "max", "--share", 0, "--snapshot-every", 5)  # fmt: skip
    with closing(Watched(node.first_line())) as watched:
        browser.open(watched.server.url)
        watched.finish()
        browser.wait("document.querySelectorAll('#tests-table tbody tr').length > 0")
        browser.wait("document.querySelectorAll('#map .ytick').length > 0")
        seen = browser.evaluate("document.body.innerText")
        assert NASTY in seen and names[2] in browser.evaluate("document.getElementById('tests-table').textContent")
        labels = browser.evaluate("[...document.querySelectorAll('#map .ytick text')].map(t => t.textContent)")
        assert {NASTY, names[1], names[2], f"{names[2]} from"} <= set(labels)
        bad = "document.querySelectorAll('img, i:not(.swatch), b script, [onload], [onerror], body script').length"
        assert browser.evaluate(bad) == 0
        assert browser.leave() == []


def test_a_bus_that_breaks_off_is_said_and_forgotten() -> None:
    """Unplugged in mid-stream: the facts say that it is away; plugged in again they go on, until the goodbye."""
    text = slcan_text()
    half = len(text) // LINE // 2 * LINE
    with closing(Adapter()) as adapter:
        plugging = threading.Thread(target=adapter.plug)
        plugging.start()
        with closing(Watched(adapter.address, reconnect=True)) as watched:
            plugging.join()
            adapter.send(text[:half])
            adapter.unplug()
            wait_for(lambda: any(f["what"].startswith("No bus for") for f in watched.board.facts["findings"]))
            before = watched.board.facts["bus"]["frames"]
            adapter.plug()
            adapter.send(text[half:])
            watched.finish()
            facts = watched.board.facts
    assert facts["bus"]["frames"] == len(text) // LINE > before > 0 and facts["bus"]["interruptions"] == 1
    assert facts["ended"] and not [f for f in facts["findings"] if "bus" in f["what"].lower()]
    assert "The bus is away." in [event["text"] for event in facts["events"]]


def test_a_page_outlives_the_monitor_and_wakes_with_the_next(start: Start, browser: Browser) -> None:
    """Ctrl-C ends the monitor with code 0; the page keeps its last figures, says so, and goes on with the next one."""
    node = start("node", "--turbine", "--samples", 100_000, "--past", 4, "--speed", 20, "--share", 0)
    address = node.first_line()
    first = start("monitor", "--bus", address, "--port", 0, "--no-browser")
    url = first.first_line()
    browser.open(url)
    browser.wait("Number(document.body.dataset.polls) > 1 && document.querySelectorAll('#tabs button').length == 1")
    first.signal(signal.SIGINT)
    first.finish().assert_clean()
    browser.wait("document.body.classList.contains('stale') && /wakes when/.test(document.body.innerText)")
    assert "Node 1" in browser.evaluate("document.body.innerText")
    second = start("monitor", "--bus", address, "--port", url.rstrip("/").rsplit(":", 1)[1], "--no-browser")
    assert second.first_line() == url
    browser.wait("!document.body.classList.contains('stale') && document.body.innerText.includes('receiving')")
    with urllib.request.urlopen(f"{url}state", timeout=3600) as answer:
        assert json.loads(answer.read())["process"] == browser.evaluate("state.process")
    second.signal(signal.SIGTERM)
    second.finish().assert_clean()
    assert [c for c in browser.leave() if "ERR_CONNECTION" not in c] == []  # a browser notes that nobody answered


SECONDS, RATE, STALLED = 2, 50_000, 12


def stall(port: int, path: str, times: int) -> socket.socket:
    """Ask for something again and again, and take nothing."""
    peer = socket.create_connection(("127.0.0.1", port))
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    peer.sendall(times * f"GET /{path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
    return peer


def test_browsers_that_stall_cost_no_frame(start: Start, tmp_path: Path) -> None:
    """50,000 frames/s while pages ask for all there is, again and again, and take nothing: every frame arrives."""
    sender_path, text = tmp_path / "flood", tmp_path / "flood.txt"
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler is not None
    subprocess.run([compiler, "-std=c99", "-O2", str(HERE / "flood.c"), "-o", str(sender_path)], check=True)
    sent, samples = flood_traffic.write(text, SECONDS * RATE)
    facts, target = tmp_path / "facts.json", tmp_path / "r.csv"
    sender = subprocess.Popen([str(sender_path), str(text), str(RATE)], stdout=subprocess.PIPE, text=True)
    try:
        assert sender.stdout is not None
        address = f"slcan:socket://127.0.0.1:{sender.stdout.readline().strip()}"
        files = ("--record", target, "--json", facts)
        monitor = start("monitor", "--bus", address, "--port", 0, "--no-browser", "--no-reconnect", *files)
        port = int(monitor.first_line().rstrip("/").rsplit(":", 1)[1])
        state = f"state?node={flood_traffic.NODE}"
        stalled = [stall(port, *what) for what in (("plotly.min.js", 20), (state, 500)) * (STALLED // 2)]
        answers = 0
        while sender.poll() is None:  # one page that does take its answers is served meanwhile
            page = f"http://127.0.0.1:{port}/{state}"
            with suppress(urllib.error.URLError, ConnectionError), urllib.request.urlopen(page, timeout=3600) as answer:
                answers += len(json.loads(answer.read())["facts"]["nodes"])  # not once the sender has closed
            time.sleep(0.1)
        told = sender.stdout.read().split()
    finally:
        sender.kill()
        sender.communicate()
    ended = monitor.finish()
    ended.assert_clean(3)  # nobody said goodbye
    assert len(ended.err) < 1000  # a pipe that nobody empties would have stopped it
    for peer in stalled:
        peer.close()
    result = json.loads(facts.read_text())
    assert int(told[0]) == sent == result["frames"] and answers > 0
    assert (result["damaged"], result["garbled_lines"], result["overrun"]) == (0, 0, 0)
    (run,) = result["nodes"][0]["runs"]
    assert (run["samples"], run["lost_values"]) == (samples, 0)


def test_the_terminal_and_files_as_listen_has_them(
    start: Start, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a page: the facts stand on standard error at the end, samples and modes in their files."""
    node = start("node", "--turbine", "--samples", 800, "--past", 6, "--wait", "--speed", "max", "--share", 0)
    facts = tmp_path / "facts.json"
    files = (
        "--record",
        tmp_path / "r.csv",
        "--poles",
        tmp_path / "p.csv",
        "--log",
        tmp_path / "a.log",
        "--json",
        facts,
    )
    words = ("monitor", "--terminal", "--bus", node.first_line(), "--until-end", "--for", 60, *files)
    assert main([*map(str, words)]) == 0
    ended = capsys.readouterr()
    told = json.loads(facts.read_text())["nodes"][0]
    assert told["runs"][0]["samples"] == 800 and (tmp_path / "p.csv").stat().st_size > 100
    assert "http" not in ended.out and "node 1  ended  rls, VARX, p = 6" in ended.err
    again = ["listen", "--bus", str(tmp_path / "a.log"), "--record", str(tmp_path / "again.csv"), "--no-modes"]
    assert main(again) == 0 and (tmp_path / "again.csv").read_bytes() == (tmp_path / "r.csv").read_bytes()


@pytest.mark.parametrize(
    "options, code, words",
    [
        (("--bus", "nonsense"), 2, "interface:channel or a log file"),
        (("--bus", "slcan:socket://127.0.0.1:1"), 3, "the bus cannot be opened"),
        (("--bus", "b.log", "--for", 0), 2, "--for 0.0: a time above 0"),
        (("--bus", "b.log", "--poles", "p.txt"), 2, "p.txt: the suffix is none of"),
    ],
)
def test_what_listen_refuses_is_refused(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[Any, ...],
    code: int,
    words: str,
) -> None:
    monkeypatch.setattr(source, "PATIENCE_S", 0.2)
    assert main(["monitor", "--no-browser", "--port", "0", *map(str, options)]) == code
    told = capsys.readouterr().err
    assert words in " ".join(told.split()) and told.count("aeolid: ") == 1


def test_an_open_address_is_warned_of_and_nothing_heard_is_code_3(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as bus:
        address = f"slcan:socket://127.0.0.1:{bus.getsockname()[1]}"
        options = ("--port", "0", "--no-browser", "--address", "0.0.0.0", "--for", "0.3")
        assert main(["monitor", "--bus", address, *options]) == 3
    told = capsys.readouterr()
    assert told.out.startswith("http://0.0.0.0:")
    assert "0.0.0.0 is not the loopback" in told.err and "nothing usable arrived" in told.err


@pytest.mark.parametrize("package", ["plotly", "tornado"])
def test_a_missing_package_is_one_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    monkeypatch.delitem(sys.modules, "aeolid.monitor.server")
    for name in [package, *(n for n in sys.modules if n.startswith(f"{package}."))]:
        monkeypatch.setitem(sys.modules, name, None)
    assert main(["monitor", "--bus", str(flood_traffic.STREAM), "--port", "0"]) == 2
    told = capsys.readouterr().err
    assert f"the page needs {package}, which is not installed: pip install {package}, or use --terminal" in told


def test_the_page_of_a_log_stays_until_ctrl_c(capsys: pytest.CaptureFixture[str]) -> None:
    """The log is over at once; its page still answers, several times, until the signal comes."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    seen: list[str] = []
    running = threading.Event()

    def look() -> None:
        while running.is_set() and len(seen) < 5:
            time.sleep(0.1)
            with suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/state", timeout=3600) as answer:
                seen.extend(filter(None, [json.loads(answer.read())["facts"]["over"]]))
        if running.is_set():
            os.kill(os.getpid(), signal.SIGINT)

    running.set()
    looking = threading.Thread(target=look)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job has it ignored
    looking.start()
    try:
        code = main(["monitor", "--bus", str(flood_traffic.STREAM), "--port", str(port), "--no-browser"])
    finally:
        running.clear()
        looking.join()
        signal.signal(signal.SIGINT, before)
    assert code == 0 and seen == 5 * ["The reception is over."]
    assert capsys.readouterr().out.startswith(f"http://127.0.0.1:{port}/\n")
