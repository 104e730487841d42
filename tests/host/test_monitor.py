"""What a monitor remembers is bounded by a law, its tests keep their level, its server answers this machine only."""

from __future__ import annotations

import io
import json
import re
import socket
import threading
import tracemalloc
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console
from scipy.stats import binom, chi2, f

from aeolid.can.description import Description
from aeolid.can.node import Configuration, Node
from aeolid.can.reception import Reception
from aeolid.can.runs import RunRecorder
from aeolid.can.samples import SampleStore
from aeolid.can.snapshots import MarkovSnapshot, SnapshotStore
from aeolid.can.wire import Frames, no_frames
from aeolid.errors import UsageError
from aeolid.identify.live import LiveMode
from aeolid.models.modes import Mode
from aeolid.monitor.board import Board
from aeolid.monitor.history import History
from aeolid.monitor.innovations import BEFORE, BLOCK, LAGS, LEVEL, Block, InnovationTest, whiteness
from aeolid.monitor.remedies import findings
from aeolid.monitor.server import PAGE, PageServer, is_own_name
from aeolid.monitor.terminal import render
from aeolid.monitor.track import RECENT, VALUES, WHOLE, Track, column_of, lag_table

NASTY = "<img src=x onerror=alert(1)>"


def describe(
    past: int = 2, inputs: int = 1, outputs: int = 2, model_set: str = "varx", feedthrough: tuple[int, ...] = (),
    names: tuple[str, ...] | None = None,
) -> Description:  # fmt: skip
    m = inputs + outputs
    n = past * (m + (outputs if model_set == "varmax" else 0)) + len(feedthrough)
    generator = np.random.default_rng(1)
    return Description(
        2, 1234, model_set, inputs, outputs, 0, past, n * outputs, 1, 0.1, 1.0, 0.1, feedthrough,
        generator.normal(size=m), np.ones(m), names or tuple(f"c{i}" for i in range(m)), ("",) * m,
    )  # fmt: skip


def configure(d: Description) -> Configuration:
    return Configuration(d, SampleStore(d.channels), SampleStore(d.outputs), SnapshotStore(d))


def snapshot_of(d: Description, theta: np.ndarray, index: int | None) -> MarkovSnapshot:
    return MarkovSnapshot(theta.astype(np.float32), theta, d, True, (), index, 0)


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


# innovations --------------------------------------------------------------------------------------------------------


def simulate(d: Description, theta: np.ndarray, samples: int, e: np.ndarray, seed: int = 0) -> tuple[Any, Any]:
    """Run the predictor as a system, sample by sample and term by term: y = Ξ z + e, all about the offsets."""
    u = np.random.default_rng(seed).normal(size=(samples, d.inputs))
    y = np.zeros((samples, d.outputs))
    blank = np.zeros(d.inputs + d.outputs * (2 if d.model_set == "varmax" else 1))
    blocks = [blank] * d.past
    for k in range(samples):
        z = [x for block in blocks[-d.past :] for x in block] + [u[k, i] for i in d.feedthrough]
        y[k] = [sum(a * b for a, b in zip(row, z, strict=True)) for row in theta] + e[k]
        blocks.append(np.concatenate([u[k], y[k], *([e[k]] if d.model_set == "varmax" else [])]))
    return u + d.offset[: d.inputs], y + d.offset[d.inputs : d.inputs + d.outputs]


def small_theta(d: Description, size: float = 0.3) -> np.ndarray:
    return size * np.random.default_rng(7).uniform(-1, 1, (d.outputs, d.regressors)) / d.past


def judged(d: Description, theta: np.ndarray, u: Any, y: Any, e: Any = None, batch: int = 97) -> list[Block]:
    """Let the test see samples in batches, the right parameters from before the first of them."""
    test = InnovationTest(d)
    test.snapshot(theta, 10**6)
    index = np.arange(len(u))
    found: list[Block] = []
    for start in range(0, len(u), batch):
        part = slice(start, start + batch)
        found += test.add(index[part], u[part], y[part], None if e is None else e[part])
    return found


@pytest.mark.parametrize("model_set, feedthrough", [("varx", ()), ("varx", (0,)), ("varmax", ()), ("varmax", (0,))])
def test_innovations_are_those_of_the_system(model_set: str, feedthrough: tuple[int, ...]) -> None:
    """Q, F and size of each block are those of the noise that went in, by a spelled-out Ljung–Box and numpy."""
    d = describe(3, model_set=model_set, feedthrough=feedthrough)
    e = np.random.default_rng(3).normal(size=(5 * BLOCK + 40, 2))
    theta = small_theta(d)
    blocks = judged(d, theta, *simulate(d, theta, len(e), e))
    assert len(blocks) == 5
    first = blocks[0].index - BLOCK + 1
    assert d.past <= first <= 3 * d.past
    variances = []
    for i, block in enumerate(blocks):
        mine = e[first + i * BLOCK : first + (i + 1) * BLOCK]
        tolerance = 1e-9 if model_set == "varx" else 1e-2  # the first innovations of a recursion hold its start
        np.testing.assert_allclose(block.deviation, mine.std(axis=0, ddof=1), rtol=tolerance)
        x = mine - mine.mean(axis=0)
        q = sum(
            BLOCK * (BLOCK + 2) / (BLOCK - t) * ((x[t:] * x[:-t]).sum(axis=0) / (x * x).sum(axis=0)) ** 2
            for t in range(1, LAGS + 1)
        )
        np.testing.assert_allclose(block.whiteness, q, rtol=100 * tolerance)
        if variances:
            np.testing.assert_allclose(block.ratio, block.deviation**2 / np.mean(variances, axis=0), rtol=1e-9)
            assert block.high == pytest.approx(f.ppf(1 - LEVEL / 2, BLOCK - 1, i * (BLOCK - 1)))
        variances.append(block.deviation**2)
    assert np.isnan(blocks[0].ratio).all() and blocks[0].bound == pytest.approx(chi2.ppf(1 - LEVEL, LAGS))


def test_sent_innovations_are_used_in_a_varmax_window() -> None:
    """With the node's own e in the window a wrong start of the recursion is of no account."""
    d = describe(3, model_set="varmax")
    e = np.random.default_rng(3).normal(size=(BLOCK + 40, 2))
    theta = small_theta(d, 1.0)
    u, y = simulate(d, theta, len(e), e)
    (block,) = judged(d, theta, u[20:], y[20:], e[20:])
    mine = e[20 + block.index - BLOCK + 1 : 21 + block.index]
    alone = judged(d, theta, u[20:], y[20:])
    np.testing.assert_allclose(block.deviation, mine.std(axis=0, ddof=1), rtol=1e-9)
    assert abs(alone[0].deviation / block.deviation - 1).max() > 1e-6


@pytest.mark.parametrize("lost", [0.0, 0.04])
def test_the_level_is_kept_and_lost_samples_do_not_change_it(lost: float) -> None:
    """1,000 blocks of an exact model: alarms as often as LEVEL says, within what chance allows (1e-4)."""
    d = describe(1, outputs=4)
    samples = 250 * BLOCK if not lost else 340 * BLOCK
    generator = np.random.default_rng(11)
    e = generator.normal(size=(samples, 4))
    theta = small_theta(d)
    u = generator.normal(size=(samples, 1))
    y = e.copy()
    for k in range(1, samples):
        y[k] += theta @ np.concatenate([u[k - 1], y[k - 1]])
    u, y = u + d.offset[:1], y + d.offset[1:]
    y[generator.random(samples) < lost] = np.nan
    blocks = judged(d, theta, u, y, batch=5000)
    assert len(blocks) >= 240
    outside = np.sum([b.outside() for b in blocks], axis=0).sum(axis=1)
    tests = 4 * len(blocks)
    # 1.7 % for Q at n = 256: its distribution is χ² for long blocks only
    assert binom.ppf(1e-4, tests, LEVEL) <= outside[0] <= binom.ppf(1 - 1e-4, tests, 1.8 * LEVEL), outside
    assert binom.ppf(1e-4, tests, LEVEL) <= outside[1] <= binom.ppf(1 - 1e-4, tests, LEVEL), outside


def test_colour_and_size_are_found() -> None:
    """Noise with one echo of 0.7, then noise a third larger: each is found in nearly every block, by its own test."""
    d = describe(1)
    theta = small_theta(d)
    e = np.random.default_rng(5).normal(size=(BLOCK * (BEFORE + 10) + 5, 2))
    coloured = e.copy()
    coloured[1:, 0] += 0.7 * e[:-1, 0]
    blocks = judged(d, theta, *simulate(d, theta, len(e), coloured))
    q, size = np.mean([b.outside() for b in blocks], axis=0)
    assert q[0] > 0.95 and q[1] < 0.2 and size.max() < 0.2
    e[BLOCK * BEFORE :, 1] *= 1.33
    later = judged(d, theta, *simulate(d, theta, len(e), e))[BEFORE + 1 : BEFORE + 5]
    assert all(b.outside()[1, 1] for b in later) and not any(b.outside()[1, 0] for b in later)


def test_a_parameter_that_moved_colours_the_innovations() -> None:
    d = describe(2, feedthrough=(0,))
    theta = small_theta(d)
    e = np.random.default_rng(5).normal(size=(6 * BLOCK, 2))
    u, y = simulate(d, theta + np.eye(2, d.regressors, 1) * 0.5, len(e), e)
    assert np.mean([b.whiteness > b.bound for b in judged(d, theta, u, y)], axis=0).max() > 0.9


def test_young_parameters_and_short_memories_are_not_judged() -> None:
    d = describe(2)
    test = InnovationTest(d)
    test.snapshot(small_theta(d), 20 * d.regressors - 1)
    assert "waiting for a snapshot that has seen" in test.waiting and test.caution == ""
    test.snapshot(small_theta(d), None)
    assert "unknown" in test.waiting
    test.add(np.arange(3), np.zeros((3, 1)), np.zeros((3, 2)), None)
    short = Description(**{**d.__dict__, "forgetting": 0.98})
    assert "remembers 50 samples" in InnovationTest(short).caution


def test_an_output_that_stands_still_is_no_finding() -> None:
    e = np.random.default_rng(0).normal(size=(BLOCK, 2))
    e[:, 1] = 0.0
    q = whiteness(e)
    assert q[0] > 0 and np.isnan(q[1])


# parameters ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model_set", ["varx", "varmax"])
@pytest.mark.parametrize("feedthrough", [(), (1,), (0, 1)])
def test_every_parameter_has_one_place(model_set: str, feedthrough: tuple[int, ...]) -> None:
    """Numbered as z is built, oldest block first: each number stands once in the table, where column_of says."""
    d = describe(3, 2, 2, model_set, feedthrough)
    now = configure(d)
    values = np.arange(d.parameters, dtype=np.float32).reshape(d.outputs, -1)
    table = lag_table(values, now)
    found = [x for row in table for lags in row for x in lags if x is not None]
    assert sorted(found) == list(range(d.parameters))
    width = len(table[0])
    for output in range(2):
        for channel in range(width):
            for lag in range(d.past + 1):
                at = column_of(channel, lag, now)
                assert table[output][channel][lag] == (None if at is None else values[output, at])
    assert table[0][1][3] == 1 and table[1][0][1] == d.regressors + (d.past - 1) * width
    assert column_of(width, 1, now) is None and column_of(0, 4, now) is None


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
        "node": 1, "problem": "", "described": True, "lost_share": 0.0, "left_out": 0, "state": "running", "flags": 0,
        "snapshots": {"complete": 50, "incomplete": 0, "age_s": 3.0, "every_s": 10.0}, "modes": [1], "modes_note": "",
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
        ({"described": False}, "Waiting for its description", "note"),
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
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.headers, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read().decode()


def test_every_answer_keeps_the_page_to_itself(served: PageServer) -> None:
    for path, status in (("", 200), ("monitor.js", 200), ("charts.js", 200), ("monitor.css", 200), ("icon.svg", 200),
                         ("plotly.min.js", 200), ("state", 200), ("nothing", 404), ("index.html", 404),
                         ("../server.py", 404), ("state?modes=x", 400)):  # fmt: skip
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
