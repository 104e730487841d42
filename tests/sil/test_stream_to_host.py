"""Node → virtual CAN → listener, each in a process of its own: what arrives is what was sent."""

from __future__ import annotations

import json
import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness import Finished, Process, Relay, drop, garble, is_alive, listen, wait_for

from aeolid.can import Assembly, build_records, open_source, write_markov
from aeolid.filters import filter_record
from aeolid.formats import read_record
from aeolid.formats.writing import write_table
from aeolid.plants import hawt
from aeolid.record import Record, Roles

Start = Callable[..., Process]
SAMPLES = 1500
PAST = 8
ROLES = """
[recording]
sample_time_s = 0.1
time = "time_s"
""" + "".join(
    f'[[channel]]\nname = "{c.name}"\nunit = "{c.unit}"\nrole = "{c.role}"\n'
    for c in hawt.roles().channels
    if c.role in ("input", "output")
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Record]:
    """Write a turbine recording with holes in it: three samples missing, twenty in a row missing."""
    folder = tmp_path_factory.mktemp("recording")
    record = hawt.simulate_closed_loop(SAMPLES, 7)
    values = {c.name: record.column(c.name).copy() for c in record.channels if c.role != "excitation"}
    for name in values:
        values[name][[200, 201, 700]] = np.nan
        values[name][900:920] = np.nan
    values["pitch"][1100] = np.nan
    write_table(folder / "recording.csv", {"time_s": record.time_s} | values)
    (folder / "roles.toml").write_text(ROLES)
    roles = Roles.load(folder / "roles.toml")
    return folder / "recording.csv", folder / "roles.toml", read_record(folder / "recording.csv", roles)


def play(start: Start, recording: tuple[Path, Path, Record], *options: object, past: int = PAST) -> Process:
    """Start a node that plays the recording as soon as somebody listens."""
    source = ("--recording", recording[0], "--roles", recording[1], "--past", past)
    return start("node", *source, "--wait", "--speed", "max", *options)


def assert_same_theta(markov: Path, dump: Path) -> None:
    """Compare the received theta with the filter's own, bit for bit."""
    received = np.load(markov)["theta_scaled"].astype("<f4")
    assert received.ravel().view("<u4").tolist() == np.fromfile(dump, "<u4").tolist()


def health(node: Finished) -> dict[str, Any]:
    """Read the facts a node ends with."""
    return json.loads(node.out[node.out.index("{") :])


@pytest.mark.parametrize("bus", ["tcp:0", "pty"])
def test_everything_arrives_bit_for_bit(
    bus: str, start: Start, recording: tuple[Path, Path, Record], tmp_path: Path
) -> None:
    """Samples equal the recording as binary32; theta equals the node's and that of the same filter run offline."""
    node = play(start, recording, "--bus", bus, "--dump", tmp_path / "theta.f32", "--json", "-")
    options = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    ended, facts = listen(node.first_line(), tmp_path, *options)
    ended.assert_clean()
    finished = node.finish()
    finished.assert_clean()
    assert_same_theta(tmp_path / "m.npz", tmp_path / "theta.f32")
    truth = recording[2]
    received = read_record(tmp_path / "r.csv", Roles.load(tmp_path / "r.roles.toml"))
    np.testing.assert_array_equal(received.values, truth.values.astype(np.float32))
    np.testing.assert_allclose(received.time_s, truth.time_s, atol=1e-9)
    assert [(c.name, c.unit, c.role) for c in received.channels] == [(c.name, c.unit, c.role) for c in truth.channels]
    offline = filter_record(truth, past=PAST, precision="f32")
    markov = np.load(tmp_path / "m.npz")
    np.testing.assert_array_equal(markov["theta_scaled"], offline.theta_scaled)
    np.testing.assert_allclose(markov["theta"], offline.theta, rtol=1e-6)
    assert int(markov["sample_index"]) == SAMPLES - 1
    told = facts["nodes"][0]
    assert told["runs"][0]["lost_values"] == 0 and told["snapshots"]["incomplete"] == 0
    assert (facts["damaged"], facts["garbled_lines"], facts["foreign"]) == (0, 0, 0)
    counted = health(finished)
    assert (counted["samples"], counted["not_finite"], counted["dropped"]) == (SAMPLES, 24, 0)
    assert counted["gaps"] == 4 and counted["accepted"] == SAMPLES - 24
    assert counted["sent"] == facts["frames"]


def test_markov_file_is_that_of_the_filter_command(
    start: Start, recording: tuple[Path, Path, Record], tmp_path: Path
) -> None:
    """`aeolid listen --markov` writes what `aeolid filter --out` writes: the same keys, shapes and settings."""
    node = play(start, recording, "--innovations", "--share", 0)
    options = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    listen(node.first_line(), tmp_path, *options)[0].assert_clean()
    offline = start(
        "filter", recording[0], "--roles", recording[1], "--method", "rls", "--past", PAST, "--out", tmp_path / "f.npz"
    )
    offline.finish().assert_clean()
    received, expected = np.load(tmp_path / "m.npz"), np.load(tmp_path / "f.npz")
    assert set(expected) <= set(received)
    for key in ("theta", "theta_scaled", "innovation", "inputs", "outputs", "input_units", "output_units"):
        assert received[key].shape == expected[key].shape, key
    for key in ("inputs", "outputs", "input_units", "output_units"):
        assert received[key].tolist() == expected[key].tolist()
    settings, truth = json.loads(str(received["settings"])), json.loads(str(expected["settings"]))
    for key in ("method", "precision", "past", "forgetting", "regularisation", "feedthrough", "sample_time_s"):
        assert settings[key] == truth[key]
    np.testing.assert_allclose(settings["scale"], truth["scale"], rtol=1e-7)
    np.testing.assert_allclose(received["innovation"], expected["innovation"], rtol=1e-5, atol=1e-30)
    told = json.loads(str(received["counters"]))
    assert told["rejected_not_finite"] == json.loads(str(expected["counters"]))["rejected_not_finite"] == 24


@pytest.mark.parametrize("method", ["els", "fast-rls", "lattice", "rls --varmax"])
def test_every_filter_streams_what_it_finds(
    method: str, start: Start, recording: tuple[Path, Path, Record], tmp_path: Path
) -> None:
    """Description, parameters and innovations of each filter; theta is that of the same filter run offline."""
    name, *extra = method.split()
    dump = tmp_path / "theta.f32"
    node = play(start, recording, "--method", *method.split(), "--innovations", "--share", 0, "--dump", dump)
    options = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    listen(node.first_line(), tmp_path, *options)[0].assert_clean()
    node.finish().assert_clean()
    assert_same_theta(tmp_path / "m.npz", dump)
    received = np.load(tmp_path / "m.npz")
    told = json.loads(str(received["settings"]))
    varmax = name == "els" or bool(extra)
    assert (told["method"], told["model_set"]) == (name, "varmax" if varmax else "varx")
    assert received["theta"].shape == (3, PAST * (8 if varmax else 5))
    if name != "els":  # the node's VARX start is ten times the regressors, offline at most a quarter of the recording
        offline = filter_record(
            recording[2], past=PAST, method=name, model_set=told["model_set"], forgetting=told["forgetting"]
        )
        np.testing.assert_array_equal(received["theta_scaled"], offline.theta_scaled)


def test_turbine_in_the_loop(start: Start, tmp_path: Path) -> None:
    """The built-in turbine, simulated while the node runs: the samples are those of the plant."""
    node = start("node", "--turbine", "--samples", 400, "--seed", 3, "--past", 5, "--wait", "--speed", "max")
    ended, _ = listen(node.first_line(), tmp_path, "--until-end", "--record", tmp_path / "r.parquet")
    ended.assert_clean()
    node.finish().assert_clean()
    received = read_record(tmp_path / "r.parquet", Roles.load(tmp_path / "r.roles.toml"))
    truth = hawt.simulate_closed_loop(400, 3)
    np.testing.assert_array_equal(received.values, truth.matrix("input", "output").astype(np.float32))


@pytest.mark.parametrize("share", [0.01, 0.1])
def test_lost_frames_are_repaired_in_the_same_cycle(
    share: float, start: Start, recording: tuple[Path, Path, Record], tmp_path: Path
) -> None:
    """Up to a tenth of all frames lost: every snapshot is complete and exact, lost samples are NaN, the others true."""
    node = play(start, recording, "--dump", tmp_path / "theta.f32", "--json", "-")
    relay = Relay([node.first_line()], drop(share, 11))
    options = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    ended, facts = listen(relay.address, tmp_path, *options)
    ended.assert_clean()
    counted = health(node.finish())
    assert_same_theta(tmp_path / "m.npz", tmp_path / "theta.f32")
    snapshots = facts["nodes"][0]["snapshots"]
    assert (snapshots["complete"], snapshots["incomplete"]) == (counted["snapshots"], 0)
    assert snapshots["repaired"] > 0
    received = read_record(tmp_path / "r.csv", Roles.load(tmp_path / "r.roles.toml")).values
    truth = recording[2].values.astype(np.float32)[: len(received)]
    there = np.isfinite(received)
    np.testing.assert_array_equal(received[there], truth[there])
    lost = facts["nodes"][0]["runs"][0]["lost_values"]
    assert np.count_nonzero(np.isfinite(truth) & ~there) <= lost
    assert abs(lost - share * truth.size) < 6 * np.sqrt(share * truth.size)


def test_without_repair_frames_a_loss_is_told(
    start: Start, recording: tuple[Path, Path, Record], tmp_path: Path
) -> None:
    """No repair frames and losses: no complete snapshot is claimed; exit code 3 says that the file was not written."""
    node = play(start, recording, "--repair", 0)
    relay = Relay([node.first_line()], drop(0.1, 3))
    options = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    ended, facts = listen(relay.address, tmp_path, *options)
    ended.assert_clean(3)
    assert "no complete snapshot" in ended.err and not (tmp_path / "m.npz").exists()
    snapshots = facts["nodes"][0]["snapshots"]
    assert snapshots["complete"] == 0 and snapshots["incomplete"] > 3 and snapshots["missing"] > 0
    assert (tmp_path / "r.csv").exists()


def test_garbage_and_cut_frames_are_counted_not_believed(
    start: Start, recording: tuple[Path, Path, Record], tmp_path: Path
) -> None:
    """Noise, cut frames and wrong digits in every tenth frame: no false sample, no false parameter."""
    node = play(start, recording, "--dump", tmp_path / "theta.f32")
    relay = Relay([node.first_line()], garble(0.1, 5))
    options = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    ended, facts = listen(relay.address, tmp_path, *options)
    ended.assert_clean()
    assert facts["garbled_lines"] > 100 and facts["damaged"] > 50
    assert_same_theta(tmp_path / "m.npz", tmp_path / "theta.f32")
    received = read_record(tmp_path / "r.csv", Roles.load(tmp_path / "r.roles.toml")).values
    there = np.isfinite(received)
    np.testing.assert_array_equal(received[there], recording[2].values.astype(np.float32)[: len(received)][there])


def test_two_nodes_on_one_bus(start: Start, recording: tuple[Path, Path, Record], tmp_path: Path) -> None:
    """Two nodes with other filters share the identifiers' node field and do not disturb each other."""
    nodes = [
        play(start, recording, "--node-id", 3, "--dump", tmp_path / "3.f32"),
        play(start, recording, "--node-id", 9, "--dump", tmp_path / "9.f32", past=4),
    ]
    relay = Relay([n.first_line() for n in nodes])
    options = ("--until-end", "--record", tmp_path / "r.csv", "--markov", tmp_path / "m.npz")
    ended, facts = listen(relay.address, tmp_path, *options)
    ended.assert_clean()
    assert sorted(n["node"] for n in facts["nodes"]) == [3, 9]
    for number in (3, 9):
        assert_same_theta(tmp_path / f"m-node{number}.npz", tmp_path / f"{number}.f32")
        roles = Roles.load(tmp_path / f"r-node{number}.roles.toml")
        received = read_record(tmp_path / f"r-node{number}.csv", roles)
        np.testing.assert_array_equal(received.values, recording[2].values.astype(np.float32))


def test_late_joiner(start: Start, recording: tuple[Path, Path, Record], tmp_path: Path) -> None:
    """Who comes late waits for one description, then has all from its arrival on, under the true sample index."""
    source = ("--recording", recording[0], "--roles", recording[1], "--past", PAST)
    node = start("node", *source, "--wait", "--speed", 100, "--dump", tmp_path / "theta.f32")
    address = node.first_line()
    early, assembly = open_source(address), Assembly()
    while assembly.frames < 1000:
        assembly.feed(early.read(1.0))
    early.close()
    late, assembly = open_source(address), Assembly()
    while late.ended is None and not assembly.all_stopped():
        assembly.feed(late.read(1.0))
    assembly.close()
    late.close()
    node.finish().assert_clean()
    state = assembly.nodes[1]
    write_markov(tmp_path / "m.npz", state, state.latest_complete(), None, address)
    assert_same_theta(tmp_path / "m.npz", tmp_path / "theta.f32")
    ((received, lost),) = build_records(state, address)
    first = round(received.time_s[0] / 0.1)
    assert 0 < first < SAMPLES - 100
    np.testing.assert_array_equal(received.values[1:], recording[2].values.astype(np.float32)[first + 1 :])
    assert lost < len(received.channels)  # it may join within a sample


# ---- what goes wrong ----------------------------------------------------------------------------------------------


def test_node_killed_in_mid_stream(start: Start, recording: tuple[Path, Path, Record], tmp_path: Path) -> None:
    """The C process dies: both sides say so in one sentence with code 3, what had arrived is kept, nothing stays."""
    source = ("--recording", recording[0], "--roles", recording[1], "--past", PAST)
    node = start("node", *source, "--wait", "--speed", 100)
    relay, child = Relay([node.first_line()]), node.child()
    listener = start("listen", "--bus", relay.address, "--until-end", "--record", tmp_path / "r.csv", "--json", "-")
    wait_for(lambda: relay.passed > 1000)
    os.kill(child, signal.SIGKILL)
    ended = listener.finish()
    ended.assert_clean(3)
    assert "broke off" in ended.err
    told = node.finish()
    told.assert_clean(3)
    assert "killed by signal 9" in told.err
    assert not is_alive(child)
    received = read_record(tmp_path / "r.csv", Roles.load(tmp_path / "r.roles.toml"))
    assert 10 < len(received) < SAMPLES
    there = np.isfinite(received.values)
    truth = recording[2].values.astype(np.float32)[: len(received)]
    np.testing.assert_array_equal(received.values[there], truth[there])


def test_bus_cut_within_a_frame(start: Start, recording: tuple[Path, Path, Record], tmp_path: Path) -> None:
    """The connection breaks in the middle of a frame: code 3, everything before it is kept."""
    node = play(start, recording)
    relay = Relay([node.first_line()], cut_after=3000)
    ended, facts = listen(relay.address, tmp_path, "--until-end", "--record", tmp_path / "r.csv")
    ended.assert_clean(3)
    assert "broke off" in ended.err
    received = read_record(tmp_path / "r.csv", Roles.load(tmp_path / "r.roles.toml"))
    assert len(received) == facts["nodes"][0]["runs"][0]["samples"] > 50


def test_parent_killed_leaves_no_node_behind(start: Start, recording: tuple[Path, Path, Record]) -> None:
    """When `aeolid node` itself is killed, the C process sees the end of its input and ends too."""
    source = ("--recording", recording[0], "--roles", recording[1], "--past", PAST)
    node = start("node", *source, "--speed", 1)  # it lasts minutes: it cannot be through with it before it is killed
    node.first_line()
    child = node.child()
    node.signal(signal.SIGKILL)
    node.finish()
    wait_for(lambda: not is_alive(child))


def test_interrupt_ends_the_stream_properly(start: Start, recording: tuple[Path, Path, Record], tmp_path: Path) -> None:
    """Ctrl-C on the node: no further samples, a last whole snapshot, a goodbye, code 0."""
    source = ("--recording", recording[0], "--roles", recording[1], "--past", PAST)
    # at real time the recording lasts minutes: the node cannot be through with it first, however busy the machine is
    node = start("node", *source, "--wait", "--speed", 1, "--dump", tmp_path / "theta.f32", "--json", "-")
    relay, child = Relay([node.first_line()]), node.child()
    listener = start("listen", "--bus", relay.address, "--until-end", "--markov", tmp_path / "m.npz")
    wait_for(lambda: relay.passed > 200)
    node.signal(signal.SIGINT)
    finished = node.finish()
    finished.assert_clean()
    listener.finish().assert_clean()
    assert 0 < health(finished)["samples"] < SAMPLES
    assert_same_theta(tmp_path / "m.npz", tmp_path / "theta.f32")
    assert not is_alive(child)


def test_listener_that_hangs_does_not_stop_the_node(
    start: Start, recording: tuple[Path, Path, Record], tmp_path: Path
) -> None:
    """A listener that does not read costs dropped frames, not the node's time."""
    source = ("--recording", recording[0], "--roles", recording[1], "--past", PAST)
    node = start("node", *source, "--wait", "--speed", 500, "--share", 0, "--snapshot-every", 0.1, "--json", "-")
    peer = socket.socket()
    peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    peer.connect(("127.0.0.1", int(node.first_line().rsplit(":", 1)[1])))
    peer.sendall(b"O\r")  # and never reads
    finished = node.finish()
    peer.close()
    finished.assert_clean()
    told = health(finished)
    assert told["samples"] == SAMPLES and told["dropped"] + told["refused"] > 0


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("listen", "--bus", "nonsense"), 2, "interface:channel"),
        (("listen", "--bus", "nosuch:can0"), 2, "no interface"),
        (
            ("listen", "--bus", "slcan:socket://0.0.0.0:1"),
            3,
            "cannot be opened",
        ),  # no name of this machine: not waited for
        (("listen", "--bus", "slcan:/dev/nosuchtty"), 3, "cannot be opened"),
        (("listen", "--bus", "missing.blf"), 3, "no such file"),
        (("listen", "--bus", "virtual:a", "--seconds", "0.2"), 3, "nothing usable"),
        (("listen", "--bus", "virtual:a?broken"), 2, "key=value"),
        (("listen", "--bus", "virtual:a", "--record", "x.txt"), 2, ".csv"),
        (("listen", "--bus", "virtual:a", "--markov", "/nosuch/m.npz"), 2, "does not exist"),
        (("node",), 2, "exactly one"),
        (("node", "--turbine", "--past", "0"), 2, "past = 0:"),
        (("node", "--turbine", "--past", "500"), 2, "past = 500: with 2 inputs and 3 outputs"),
        (("node", "--turbine", "--bus", "can0"), 2, "pty or tcp:PORT"),
        (("node", "--turbine", "--node-id", "254"), 2, "--node-id 254"),
        (("node", "--turbine", "--share", "0.5"), 3, "nine tenths"),
        (("node", "--turbine", "--feedthrough", "wind"), 2, "the inputs are"),
        (
            ("node", "--turbine", "--dump", "/nosuch/d", "--samples", "5", "--past", "2", "--speed", "max"),
            2,
            "/nosuch/d: cannot be written (the folder /nosuch does not exist)",
        ),
        (("node", "--recording", "missing.csv", "--roles", "missing.toml"), 3, "no such file"),
    ],
)
def test_wrong_requests_end_in_one_sentence(
    arguments: tuple[str, ...], code: int, words: str, start: Start, tmp_path: Path
) -> None:
    """Each wrong request: its exit code, one sentence that names what is wrong."""
    finished = start(*arguments).finish()
    finished.assert_clean(code)
    assert words in finished.err
