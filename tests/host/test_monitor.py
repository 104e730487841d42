"""What a monitor remembers is bounded by a law, its words name the remedy, its server answers this machine only."""

from __future__ import annotations

import io
import json
import re
import socket
import threading
import time
import tracemalloc
import urllib.error
import urllib.request
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import can_frames
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from monitor_nodes import configure, describe, simulate, small_theta, snapshot_of
from rich.console import Console

from aeolid.can.description import Description
from aeolid.can.node import Node
from aeolid.can.reception import Reception
from aeolid.can.runs import RunRecorder
from aeolid.can.wire import Frames, no_frames, pack_frames
from aeolid.errors import UsageError
from aeolid.identify.live import LiveMode
from aeolid.models.modes import Mode
from aeolid.monitor.board import Board
from aeolid.monitor.history import History
from aeolid.monitor.innovations import BLOCK
from aeolid.monitor.remedies import findings
from aeolid.monitor.server import PAGE, PageServer, is_own_name
from aeolid.monitor.terminal import render
from aeolid.monitor.track import RECENT, VALUES, WHOLE, Track
from aeolid.publish.rows import prometheus_text, rows_of_monitor

NASTY = "<img src=x onerror=alert(1)>"


def mode_of(number: int, frequency: float) -> LiveMode:
    return LiveMode(number, Mode(frequency, 0.01, 0.9 + 0.1j, 0.002, None, {"c1": 0.7, "c2": 0.3}))


# history ------------------------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 3000), st.integers(1, 40), st.integers(1, 20).map(lambda k: 2 * k))
def test_a_history_is_bounded_and_even(count: int, recent: int, whole: int) -> None:
    """Any number of rows: at most recent + whole + 1 are held, in order; the stride follows from the count alone."""
    history: History[tuple[int, float]] = History(recent, whole, lambda a, b: (b[0], max(a[1], b[1])))
    values = np.random.default_rng(count).normal(size=count)
    for k, value in enumerate(values):
        history.push((k, float(value)))
        assert len(history) <= recent + whole + 1
    stride = 1
    while count // stride >= whole:
        stride *= 2
    assert history.stride == stride
    rows = history.rows()
    times = [row[0] for row in rows]
    assert times == sorted(set(times)) and times[max(len(rows) - recent, 0) :] == list(range(count))[-recent:]
    old = rows[: max(len(rows) - recent, 0)]
    assert all(
        row == (stride * i + stride - 1, values[stride * i : stride * (i + 1)].max()) for i, row in enumerate(old)
    )
    assert count - min(recent, count) - len(old) * stride < stride  # nothing older than a stride is left out


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 30), max_size=30))
def test_pages_that_ask_now_and_then_miss_nothing(steps: list[int]) -> None:
    history: History[int] = History(16, 8)
    have, seen = 0, list[int]()
    for step in steps:
        for _ in range(step):
            history.push(history.count)
        fresh, rows = history.since(have)
        seen = rows if fresh else seen + rows
        have = history.count
        assert seen[-16:] == list(range(history.count))[-16:] and seen == sorted(set(seen))
    assert history.since(have + 5) == (True, history.rows())  # of another monitor


def test_memory_of_a_node_does_not_grow_with_time() -> None:
    """Rows 8,000 … 12,000 need no more than 2,000 … 8,000 (before, both halves share rows); any size has its bound."""
    d = describe(past=10, outputs=3)
    track = Track(configure(d))
    theta = np.zeros((3, d.regressors))
    sizes = []
    tracemalloc.start()
    try:
        for k in range(12_000):
            track.take_modes(float(k), tuple(mode_of(j, 1.0 + j) for j in range(12)))
            track.tests.push((float(k), np.zeros((2, 3), np.float32)))
            if k % 4 == 0:
                track.take_snapshot(snapshot_of(d, theta, None))
            if k % 100 == 99:
                sizes.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert max(sizes[80:]) < 1.02 * max(sizes[20:80]), sizes
    assert len(track.modes) <= RECENT + WHOLE + 1
    for outputs, past in ((1, 1), (3, 40), (32, 30), (64, 15)):
        large = Track(configure(describe(past, 1, outputs)))
        for _ in range(3):
            large.thetas.push((0.0, np.zeros(1, np.float32)))
        most = large.thetas._most + (large.thetas._recent.maxlen or 0)
        assert most * large.now.description.parameters <= max(2 * VALUES, 16 * large.now.description.parameters)


# words --------------------------------------------------------------------------------------------------------------


class Silent:
    """A source without frames."""

    name, is_log, status, interruptions, ended = "bus:0", False, "", 0, None

    def read(self, timeout: float) -> Frames:
        """Return nothing."""
        return no_frames()

    def close(self) -> None:
        """Do nothing."""


def fill(board: Board, names: tuple[str, ...] | None = None) -> Reception:
    """Let a board watch a node with a nasty name, modes, parameters and tests."""
    reception = Reception(Silent(), RunRecorder(None), bit_rate=5e5, data_bit_rate=2e6)
    d = describe(2, names=names)
    now = configure(d)
    node = reception.assembly.nodes[3] = Node(3)
    node.now = now
    theta = small_theta(d)
    e = np.random.default_rng(2).normal(size=(4 * BLOCK, 2))
    u, y = simulate(d, theta, len(e), e)
    board.snapshot(3, 0, now, snapshot_of(d, theta, 10**6))
    board.samples(3, 0, now, np.arange(len(e)), (u, y, None))
    for k in range(20):
        board.modes(3, 0, float(k), (mode_of(1, 0.3), mode_of(4, np.nan)))

    class Modes:
        def view(self) -> Any:
            return {3: ("", (mode_of(1, 0.33482), mode_of(2, 1.5)))}

        def facts(self, number: int) -> Any:
            return {"left_out": 0, "order": 4}

    board.watch(reception, Modes())
    return reception


def test_a_node_that_cannot_be_followed_still_shows_its_parameters() -> None:
    """Every second sample only: no modes, no tests, and why; the snapshots are taken from the reception itself."""
    reception = Reception(Silent(), RunRecorder(None), bit_rate=5e5, data_bit_rate=2e6)
    node = reception.assembly.nodes[3] = Node(3)
    d = Description(**{**describe().__dict__, "sample_every": 2})
    node.now = configure(d)

    class Modes:
        def view(self) -> Any:
            return {3: ("the node sends one sample in 2; modes need every one", ())}

        def facts(self, number: int) -> Any:
            return None

    board = Board()
    board.watch(reception, Modes())
    for index in (100, 200):
        node.now.snapshots.complete = snapshot_of(d, index * small_theta(d), index)
        for _ in range(2):
            board.tick()
    told = board.series(3, {}, (1, 0, 1))
    assert [row[0] for row in told["thetas"]["rows"]] == [10.0, 20.0] and told["modes"]["rows"] == []
    (facts,) = board.facts["nodes"]
    assert facts["innovations"]["waiting"] == facts["modes_waiting"] != ""
    assert any("Send every sample" in f["remedy"] for f in board.facts["findings"])


def terminal_text(facts: dict[str, Any]) -> str:
    console = Console(file=io.StringIO(), width=300)
    console.print(render(facts))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_the_terminal_says_what_is_known_and_obeys_no_markup() -> None:
    board = Board()
    fill(board, ("pitch", "[red]y[/]", NASTY))
    text = terminal_text(board.facts)
    for part in ("0.3348 ± 0.0020", "0.3309 … 0.3387", "Ljung–Box Q (< 37.6)", NASTY, "[red]y[/]", "node 3  running",
                 "values lost 0", "no flag raised"):  # fmt: skip
        assert part in text, part


def calm(**changes: Any) -> dict[str, Any]:
    """Return the facts of a node with which all is well, with changes: bus_… of the bus, others of the node."""
    bus = {"status": "", "frames": 10, "seconds": 60.0, "silent_s": 0.0, "overrun": 0, "damaged": 0, "garbled": 0,
           "errors": 0, "load": 0.1}  # fmt: skip
    node: dict[str, Any] = {
        "node": 1, "problem": "", "contested": "", "refused": "", "described": True, "lost_share": 0.0, "left_out": 0,
        "state": "running", "flags": 0, "modes": [1], "modes_note": "",
        "snapshots": {"complete": 50, "incomplete": 0, "age_s": 3.0, "every_s": 10.0},
        "modes_waiting": "", "health": {str(1 << i): "flag" for i in range(7)},
        "innovations": {"waiting": "", "caution": "", "blocks": 20, "rows": [{"output": "y", "outside": [1, 1]}]},
    }  # fmt: skip
    nodes = [] if changes.pop("no_node", False) else [node]
    over = changes.pop("over", "")
    ended = changes.pop("ended", False)
    for key, value in changes.items():
        target, key = (bus, key[4:]) if key.startswith("bus_") else (node, key)
        target[key] = {**target[key], **value} if isinstance(value, dict) else value
    return {"bus": bus, "nodes": nodes, "over": over, "ended": ended}


@pytest.mark.parametrize(
    "changes, words, level",
    [
        ({"bus_status": "no bus for 3 s"}, "No bus for 3 s", "alarm"),
        ({"bus_status": "no bus", "ended": True}, "All nodes have ended", "note"),
        ({"bus_frames": 0, "no_node": True}, "Not one frame", "alarm"),
        ({"bus_silent_s": 30.0}, "No frame for 30 s", "alarm"),
        ({"no_node": True}, "none of them from a node", "alarm"),
        ({"bus_overrun": 3}, "has dropped 3", "alarm"),
        ({"bus_garbled": 3}, "3 lines garbled", "note"),
        ({"bus_errors": 3}, "3 error frames", "note"),
        ({"bus_load": 0.8}, "80% full", "alarm"),
        ({"problem": "speaks wire version 9"}, "wire version 9", "alarm"),
        ({"contested": "the sample indices told go to and fro"}, "Two nodes seem to bear this number", "alarm"),
        ({"refused": "described itself anew more than 64 times"}, "Not followed any more: it described", "alarm"),
        ({"described": False}, "Waiting for its description", "note"),
        ({"state": "silent", "silent_s": 30.0}, "Nothing has come of it for 30 s", "alarm"),
        ({"lost_share": 0.02}, "2.0% of the samples", "alarm"),
        ({"left_out": 5}, "without 5 samples", "alarm"),
        ({"snapshots": {"incomplete": 9}}, "9 snapshots incomplete", "alarm"),
        ({"snapshots": {"age_s": 90.0}}, "No complete snapshot for 90 s", "alarm"),
        ({"modes_waiting": "waiting for samples: 3 of 9 windows"}, "No modes yet", "note"),
        ({"modes_waiting": "the node sends one sample in 2; modes need every one"}, "No modes yet", "note"),
        ({"modes_note": "12% was heard"}, "No deviations", "note"),
        ({"flags": 1 << 3}, "Health flag", "note"),
        ({"innovations": {"rows": [{"output": "y", "outside": [4, 0]}]}}, "are not white", "alarm"),
        ({"innovations": {"rows": [{"output": "y", "outside": [0, 4]}]}}, "size of the innovations", "note"),
    ],
)
def test_what_is_missing_is_said_with_a_remedy(changes: dict[str, Any], words: str, level: str) -> None:
    assert findings(calm()) == []
    (found,) = findings(calm(**changes))
    assert words in found["what"] and found["level"] == level and found["remedy"].endswith((".", "?"))
    assert not findings(calm(**changes, over="done")) or "silent" not in words


def test_after_the_end_silence_is_no_finding() -> None:
    assert findings(calm(bus_silent_s=30.0, ended=True)) == []
    assert findings(calm(state="silent", silent_s=30.0, over="done")) == []
    assert len(findings(calm(state="silent", silent_s=30.0, bus_silent_s=30.0))) == 1  # of the bus
    cautious = {"rows": [{"output": "y", "outside": [9, 9]}], "caution": "short memory"}
    assert findings(calm(innovations=cautious)) == []


# server -------------------------------------------------------------------------------------------------------------


def contrast(one: str, other: str) -> float:
    """Return the contrast of two colours #rrggbb (WCAG 2)."""
    light = []
    for colour in (one, other):
        parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        light.append(0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2])
    return (max(light) + 0.05) / (min(light) + 0.05)


@pytest.mark.parametrize("scheme", [0, 1])
def test_text_and_lines_stand_out(scheme: int) -> None:
    """Light and dark: text 4.5 to 1 against all it stands on, lines 3 to 1 (WCAG 2 AA)."""
    style = (PAGE / "monitor.css").read_text(encoding="utf-8")
    colours = dict(re.findall(r"--([\w-]+): (#\w+)", style.split(":root")[scheme + 1]))
    colours = {k: v if len(v) == 7 else "#" + "".join(2 * c for c in v[1:]) for k, v in colours.items()}
    for text in ("ink", "soft", "alarm", "good", "accent"):
        for ground in ("ground", "panel"):
            assert contrast(colours[text], colours[ground]) >= 4.5, (text, ground)
    assert contrast(colours["ink"], colours["alarm-tint"]) >= 4.5
    for line in ("s0", "s1", "s2", "s3", "s4", "s5", "low", "high"):
        assert contrast(colours[line], colours["panel"]) >= 3, line


@pytest.fixture
def served() -> Iterator[PageServer]:
    """Serve a filled board."""
    board = Board()
    fill(board)
    server = PageServer(board, "127.0.0.1", 0)
    yield server
    server.close()


def get(server: PageServer, path: str, host: str | None = None, method: str = "GET") -> tuple[int, Any, str]:
    request = urllib.request.Request(server.url + path, method=method)
    if host is not None:
        request.add_header("Host", host)
    try:
        with urllib.request.urlopen(request, timeout=3600) as answer:
            return answer.status, answer.headers, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read().decode()


def test_every_answer_keeps_the_page_to_itself(served: PageServer) -> None:
    for path, status in (("", 200), ("monitor.js", 200), ("charts.js", 200), ("monitor.css", 200), ("icon.svg", 200),
                         ("plotly.min.js", 200), ("state", 200), ("metrics", 200), ("nothing", 404),
                         ("index.html", 404), ("../server.py", 404), ("state?modes=x", 400)):  # fmt: skip
        code, headers, _ = get(served, path)
        assert code == status, path
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "http" not in policy and "unsafe-eval" not in policy
        assert "script-src 'self';" in policy and headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Access-Control-Allow-Origin"] is None and headers["Server"] is None
    assert get(served, "state", method="POST")[0] == 405


def test_a_foreign_name_for_this_address_is_refused(served: PageServer) -> None:
    """A page elsewhere may have its name point here; the browser would then take our answers for its own."""
    for host in ("evil.example", "evil.example:8536", "127.0.0.1.evil.example", "[evil]", ""):
        code, _, text = get(served, "state", host)
        assert code in (400, 421) and "facts" not in text, host
    for host in ("127.0.0.1", f"localhost:{served.port}", "[::1]:80"):
        assert get(served, "state", host)[0] == 200, host
    assert is_own_name(socket.gethostname()) and not is_own_name("")


class Witness:
    """A lock that remembers which threads took it."""

    def __init__(self) -> None:
        self.takers: set[str] = set()
        self._lock = threading.Lock()

    def __enter__(self) -> None:
        self._lock.acquire()
        self.takers.add(threading.current_thread().name)

    def __exit__(self, *_: object) -> None:
        self._lock.release()


def test_no_answer_waits_for_the_reception_or_keeps_it_waiting() -> None:
    """Pages that ask, and one that takes nothing: the thread that serves them never takes the reception's lock."""
    board = Board()
    reception = fill(board)
    reception.lock = witness = Witness()  # type: ignore[assignment]
    server = PageServer(board, "127.0.0.1", 0)
    try:
        with socket.create_connection(("127.0.0.1", server.port)) as stalled:
            stalled.sendall(400 * b"GET /state?node=3 HTTP/1.1\r\nHost: localhost\r\n\r\n")
            with reception.lock:  # a reception that is busy keeps no page waiting either
                assert all(get(server, "state?node=3")[0] == 200 for _ in range(5))
            server.renew()
    finally:
        server.close()
    assert witness.takers <= {"MainThread", "tick"} and "MainThread" in witness.takers


def test_pages_are_told_what_is_new_to_each(served: PageServer) -> None:
    def ask(**have: Any) -> Any:
        query = "&".join(f"{k}={v}" for k, v in have.items())
        return json.loads(get(served, f"state?{query}")[2], parse_constant=pytest.fail)

    first = ask(node=3)
    process, series = first["process"], first["series"]
    assert len(series["modes"]["rows"]) == 20 and series["modes"]["rows"][0][1][1][1] is None  # NaN
    assert len(series["tests"]["rows"]) == 3 and series["matrix"]["count"] == 1 and series["thetas"]["fresh"]
    have = {"process": process, "node": 3, "modes": 20, "tests": 3, "matrix": 1, "thetas": 1}
    again = ask(**have, entry="1,0,2")["series"]
    assert again["modes"] == {"fresh": False, "count": 20, "rows": []} and "matrix" not in again
    assert again["entry"] == [1, 0, 2] and ask(**have, entry="9,9,9")["series"]["entry"] != [9, 9, 9]
    assert ask(**(have | {"process": "another"}))["series"]["modes"]["fresh"]
    assert ask(node=77)["series"]["node"] is None
    assert first["facts"]["nodes"][0]["modes"][0]["frequency"] == "0.3348 ± 0.0020"


def test_a_port_in_use_is_one_sentence(served: PageServer) -> None:
    with pytest.raises(UsageError, match=rf"--port {served.port}: 127.0.0.1 cannot be served on it .* --port 0 takes"):
        PageServer(Board(), "127.0.0.1", served.port)


def test_another_run_is_put_behind_the_one_before() -> None:
    d = describe()
    track = Track(configure(d))
    part = (np.zeros((10, 1)), np.zeros((10, 2)), None)
    track.enter(0)
    track.take_samples(np.arange(10), part)
    track.take_modes(0.9, (mode_of(1, 1.0),))
    track.enter(1)
    track.take_samples(np.arange(10), part)
    track.take_modes(0.5, (mode_of(1, 1.0),))
    times = [row[0] for row in track.modes.rows()]
    assert times == pytest.approx([0.9, 1.0 + 0.5]) and track.starts == pytest.approx([0.0, 1.0])


@pytest.mark.parametrize("modes_first", [True, False])
def test_another_run_begins_behind_the_newest_that_was_seen(modes_first: bool) -> None:
    """Modes are of a snapshot, which may be older than the samples that have come since."""
    d = describe(3)
    track, index = Track(configure(d)), np.arange(512)
    steps = [
        lambda: track.take_modes(40.0, ()),
        lambda: track.take_samples(index, (np.zeros((512, 1)), np.zeros((512, 2)), None)),
    ]
    for step in steps if modes_first else steps[::-1]:
        step()
    newest = 511 * d.sample_time_s
    assert track.last_s == pytest.approx(newest) and [t for t, _ in track.modes.rows()] == [40.0]
    track.enter(1)
    assert track.start == pytest.approx(newest + d.sample_time_s)
    track.take_modes(3.0, ())
    assert track.last_s == pytest.approx(track.start + 3.0)


def test_every_flag_of_a_filter_has_a_remedy() -> None:
    from aeolid.filters.settings import HEALTH as FLAGS
    from aeolid.monitor.remedies import HEALTH as REMEDIES

    assert REMEDIES.keys() == FLAGS.keys()


def test_a_node_that_falls_silent_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two nodes, one of which loses its power: its state, an alarm, an event and the published row say so."""
    ahead = 0.0
    monkeypatch.setattr("aeolid.monitor.board.time", SimpleNamespace(monotonic=lambda: time.monotonic() + ahead))
    reception = Reception(Silent(), RunRecorder(None), bit_rate=5e5, data_bit_rate=2e6)
    board = Board()
    board.watch(reception, None)

    def hear(rows: list[can_frames.Row]) -> None:
        reception._take(pack_frames(rows))
        board.tick()

    hear([r for node in (1, 2) for r in [*can_frames.describe(node), *can_frames.samples(0, 30, node)]])
    assert [n["state"] for n in board.facts["nodes"]] == ["running", "running"]
    for k in range(1, 4):
        ahead += 5.0
        hear(can_frames.samples(30 * k, 30, 1))
    assert [n["state"] for n in board.facts["nodes"]] == ["running", "silent"]
    (found,) = [f for f in board.facts["findings"] if f["level"] == "alarm"]
    assert found["node"] == 2 and "for 15 s" in found["what"]
    assert board.facts["events"][-1]["text"] == "Node 2 has fallen silent."
    told = prometheus_text(rows_of_monitor(board.facts))
    assert 'aeolid_node_running{node="2"} 0' in told and 'aeolid_node_silent_s{node="2"} 15' in told
    hear(can_frames.samples(30, 30, 2))
    assert board.facts["nodes"][1]["state"] == "running"


@pytest.mark.parametrize("fails", ["tick", "end"])
def test_facts_that_cannot_be_spelt_stop_neither_page_nor_end(fails: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A number that JSON does not know costs the display, which says so; the thread and the farewell go on."""
    board = Board()
    fill(board)
    server = PageServer(board, "127.0.0.1", 0)

    def spoil(*_: Any) -> None:
        board.facts = board.facts | {"odd": float("nan")}

    monkeypatch.setattr(board, fails, spoil)
    server.renew()
    server.farewell("done")
    told = json.loads(server.facts_json)
    assert "The display has stopped" in told["findings"][0]["what"]
    server.close()


def test_settings_of_a_node_that_are_no_numbers_are_told_as_none() -> None:
    """What a page gets can be spelt whatever a description or a mode holds."""
    d = Description(**{**describe().__dict__, "forgetting": np.nan, "regularisation": np.inf})
    board = Board()
    reception = fill(board)
    reception.assembly.nodes[3].now = configure(d)
    board.tick()
    (facts,) = board.facts["nodes"]
    assert facts["forgetting"] is None and facts["regularisation"] is None
    json.dumps(board.facts, allow_nan=False)
