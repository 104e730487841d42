"""Nodes and listeners on real CAN interfaces, in a kernel of their own (guests.py), one boot for all tests.

The guest makes the steps that the tests of this run ask about: by day those that nothing else has, the others by night.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aeolid.can.software_node import feed_from_record
from aeolid.formats import read_record
from aeolid.native import find_native
from aeolid.plants import hawt
from aeolid.record import Record, Roles

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "ports"))
from guests import Guest, allowed, run_first
from wiring import SHOWN, build, make_reference

pytestmark = pytest.mark.timeout(0)  # guests.py ends a guest that does not go on
HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
SAMPLES, PAST = 300, 4
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror"]


def play() -> Record:
    """Make the recording that every node plays: the built-in turbine, with three samples missing."""
    record = hawt.simulate_closed_loop(SAMPLES, 7)
    kept = [i for i, c in enumerate(record.channels) if c.role in ("input", "output")]
    values = record.values[:, kept].copy()
    values[[50, 51, 120]] = np.nan
    return replace(record, values=values, channels=tuple(record.channels[i] for i in kept))


STEPS = {
    "test_classic_frames_on_a_virtual_interface": "classic",
    "test_fd_frames_on_a_virtual_interface": "fd",
    "test_slcan_terminal_as_an_interface": "slcan",
    "test_two_nodes_on_one_interface": "two_nodes",
    "test_interface_goes_and_comes_back": "down_and_up",
    "test_listeners_say_that_the_interface_went": "down_and_up",
    "test_the_node_hears_nothing": "down_and_up",
    "test_a_full_queue_refuses_and_does_not_hold_up": "full_queue",
    "test_refusals_name_the_remedy": "refusals",
    "test_the_node_command": "command_line",
    "test_the_port_between_two_threads": "program",
    "test_the_wiring_that_is_shown": "wiring",
}


def steps_of(items: list[pytest.Item]) -> list[str]:
    """Return the steps that the chosen tests of this file ask about; the node command plays what `classic` received."""
    asked = {STEPS[item.nodeid.split("::")[1].split("[")[0]] for item in items if item.path == Path(__file__)}
    return sorted(asked | ({"classic"} if "command_line" in asked else set()))


def write_plan(out: Path, record: Record, modules: str, steps: list[str]) -> None:
    """Write samples and plan for the guest; paths are the same inside, where the host's files are the root."""
    feed = feed_from_record(record)
    np.concatenate(list(feed.rows)).astype("<f8").tofile(out / "samples.f64")
    words = ["--sample-time", repr(feed.sample_time_s), "--past", str(PAST), "--snapshot-every", "5"]
    channels = [("--input", c) for c in feed.inputs] + [("--output", c) for c in feed.outputs]
    for (option, channel), offset, scale in zip(channels, feed.offset.tolist(), feed.scale.tolist(), strict=True):
        words += [option, channel.name, channel.unit, repr(offset), repr(scale)]
    node = str(find_native("aeolid-node"))
    usage = subprocess.run([node, "--fd"], capture_output=True, text=True, check=False).stderr
    plan = {
        "node": node,
        "channels": words,
        "samples": str(out / "samples.f64"),
        "width": len(channels),
        "sample_bytes": 8 * (2 + len(channels)),
        "modules": modules,
        "steps": steps,
        "program": str(out / "threads"),
        "wiring": str(build(SHOWN, "socketcan", out)) if "wiring" in steps else "",
        "offers_fd": "--fd" not in usage,  # an unknown option is named; a known one leaves the channels to be asked for
    }
    (out / "plan.json").write_text(json.dumps(plan))


def build_program(out: Path) -> None:
    """Compile the port's own test program."""
    sources = [HERE / "threads.c", ROOT / "port/posix/socketcan.c", *sorted((ROOT / "src").glob("*.c"))]
    flags = ["-D_XOPEN_SOURCE=700", "-D_DEFAULT_SOURCE", f"-I{ROOT}/include", f"-I{ROOT}/port/posix", "-pthread"]
    command = ["gcc", "-std=c99", "-O2", *WARNINGS, *flags, *map(str, sources), "-lm", "-o", str(out / "threads")]
    subprocess.run(command, check=True)


def prepare(guest: Guest, out: Path, steps: list[str]) -> None:
    """Put what the guest's script needs into its folder."""
    write_plan(out, play(), guest.modules, steps)
    if "program" in steps:
        build_program(out)


@pytest.fixture(scope="module")
def guest(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Boot a guest once and let it run all its steps; returns the folder with what it left."""
    if not Path("/usr/sbin/ip").exists() and not Path("/sbin/ip").exists():
        pytest.skip("iproute2 is not installed")
    prepared = partial(prepare, steps=steps_of(request.session.items))
    out, reasons = run_first(allowed(), tmp_path_factory.mktemp("can"), prepared)
    if out is None:
        pytest.skip(reasons)
    assert (out / "code").read_text().strip() == "0", (out / "guest.log").read_text()[-3000:]
    return out


def facts(guest: Path, step: str) -> dict[str, Any]:
    """Read what one step left."""
    found: dict[str, Any] = json.loads((guest / "results.json").read_text())[step]
    assert "broken" not in found, found["broken"]
    return found


def assert_all_arrived(guest: Path, name: str, told: dict[str, Any], at_least: int = 2000) -> None:
    """Compare theta, samples and counters at both ends: nothing lost, every bit."""
    assert (told["node"]["code"], told["listener"]["code"]) == (0, 0), told
    assert_same_theta(guest / f"{name}.npz", guest / f"{name}.f32")
    received = read_record(guest / f"{name}.csv", Roles.load(guest / f"{name}.roles.toml"))
    np.testing.assert_array_equal(received.values, play().values.astype(np.float32))
    report, counters = json.loads((guest / f"{name}.json").read_text()), told["node"]["counters"]
    assert report["frames"] == counters["sent"] > at_least
    assert (report["damaged"], counters["refused"], counters["dropped"]) == (0, 0, 0)


def assert_same_theta(markov: Path, dump: Path) -> None:
    """Compare the received theta with the filter's own, bit for bit."""
    received = np.load(markov)["theta_scaled"].astype("<f4")
    assert received.ravel().view("<u4").tolist() == np.fromfile(dump, "<u4").tolist()


def test_classic_frames_on_a_virtual_interface(guest: Path) -> None:
    """Node → vcan0 → listener: every sample and every parameter, bit for bit."""
    told = facts(guest, "classic")
    assert told["address"] == "socketcan:vcan0"
    assert_all_arrived(guest, "classic", told)
    assert told["node"]["counters"]["interface"]["sent"] == told["node"]["counters"]["sent"]


def test_fd_frames_on_a_virtual_interface(guest: Path) -> None:
    """The same in CAN FD frames."""
    if not json.loads((guest / "plan.json").read_text())["offers_fd"]:
        pytest.skip("this node sends classic frames only")
    told = facts(guest, "fd")
    assert told["address"] == "socketcan:vcan1?fd=true"
    assert_all_arrived(guest, "fd", told, 500)


def test_slcan_terminal_as_an_interface(guest: Path) -> None:
    """Node → slcan text on a terminal → the kernel's slcan driver → slcan0 → listener."""
    told = facts(guest, "slcan")
    assert told["address"].startswith("slcan:/dev/pts/")
    assert_all_arrived(guest, "slcan", told)


def test_two_nodes_on_one_interface(guest: Path) -> None:
    """Two nodes with other filters do not disturb each other."""
    told = facts(guest, "two_nodes")
    assert [n["code"] for n in told["nodes"]] == [0, 0] and told["listener"]["code"] == 0, told
    for number in (3, 9):
        assert_same_theta(guest / f"two-node{number}.npz", guest / f"two-{number}.f32")
        received = read_record(guest / f"two-node{number}.csv", Roles.load(guest / f"two-node{number}.roles.toml"))
        np.testing.assert_array_equal(received.values, play().values.astype(np.float32))


def test_interface_goes_and_comes_back(guest: Path) -> None:
    """Down, away, in bus-off: frames are refused and counted, the node sends again; the listener says so."""
    told = facts(guest, "down_and_up")
    assert told["node"]["code"] == 0, told
    fed = 30 * len(play().channels)
    assert [told[f"frames_{when}"] for when in ("after_down", "after_away", "in_bus_off", "after_restart")] == [
        fed, fed, 0, fed
    ]  # fmt: skip
    counters = told["node"]["counters"]
    seen = counters["interface"]
    assert counters["samples"] == SAMPLES and seen["down"] > 0
    assert (seen["lost"], seen["returned"], seen["bus_off"], seen["errors"], seen["failed"]) == (3, 3, 1, 2, 0)
    assert seen["sent"] == counters["sent"] and seen["down"] == counters["refused"] + counters["dropped"]
    assert sum("refused until it is back" in line for line in told["node"]["said"]) == 3


def test_listeners_say_that_the_interface_went(guest: Path) -> None:
    """One that must not reconnect ends with a sentence; another is back with the interface, and what came is true."""
    told = facts(guest, "down_and_up")
    assert told["listener"]["code"] == 3 and "down" in told["listener"]["said"][-1].lower(), told["listener"]
    assert told["kept"]["code"] == 0, told["kept"]
    assert json.loads((guest / "kept.json").read_text())["interruptions"] >= 1
    received = read_record(guest / "kept.csv", Roles.load(guest / "kept.roles.toml"))
    first = round(float(received.time_s[0]) / received.sample_time_s)
    truth = play().values.astype(np.float32)[first : first + len(received)]
    there = np.isfinite(received.values)
    np.testing.assert_array_equal(received.values[there], truth[there])
    assert first < 60 and there[121 - first : 150 - first].all() and not there[60 - first : 120 - first].any()


def test_the_node_hears_nothing(guest: Path) -> None:
    """The only filter on the interface is the one for error frames."""
    assert facts(guest, "down_and_up")["filters"] == {"all": 0, "err": 1, "fil": 0, "inv": 0, "eff": 0, "sff": 0}


def test_a_full_queue_refuses_and_does_not_hold_up(guest: Path) -> None:
    """An adapter that takes nothing: refusals are counted; the end that could not be sent is told, with code 3."""
    told = facts(guest, "full_queue")["node"]
    assert told["code"] == 3 and "could not be sent" in " ".join(told["said"])
    assert told["counters"]["interface"]["full"] > 100 and told["counters"]["samples"] == SAMPLES


@pytest.mark.parametrize(
    ("case", "code", "words"),
    [
        ("missing", 3, "no interface vcan7; plug it in, or make a virtual one: ip link add dev vcan7 type vcan"),
        ("not_can", 3, "lo is not a CAN interface"),
        ("down", 3, "vcan9 is down; ip link set vcan9 up"),
        ("wait", 2, "--wait"),
        ("classic_only", 3, "vcan0 carries classic frames only; set it down, then ip link set vcan0 mtu 72"),
    ],
)
def test_refusals_name_the_remedy(case: str, code: int, words: str, guest: Path) -> None:
    """Each thing that cannot be: one sentence, the right code."""
    told = facts(guest, "refusals").get(case)
    if told is None:
        pytest.skip("this node sends classic frames only")
    assert told["code"] == code and len(told["said"]) == 1 and words in told["said"][0], told


def test_the_node_command(guest: Path) -> None:
    """`aeolid node --bus can:…` streams and sums up; without the interface it ends with the node's own sentence."""
    told = facts(guest, "command_line")
    assert told["done"]["code"] == 0 and told["done"]["said"][0] == "socketcan:vcan1", told
    sent = re.search(r"50 samples, .* (\d+) frames, 0 dropped", " ".join(told["done"]["said"]))
    assert sent and int(sent[1]) == told["frames"] > 250, told
    assert told["refused"]["code"] == 3 and "ip link add dev vcan7" in told["refused"]["said"][-1], told


def test_the_port_between_two_threads(guest: Path) -> None:
    """Control task and background in threads of their own, held apart by the port's mutex."""
    told = facts(guest, "program")
    assert told["code"] == 0, told


def test_the_wiring_that_is_shown(guest: Path, tmp_path: Path) -> None:
    """The block shown for SocketCAN on its can0: samples and the newest snapshot are those of README's filter."""
    told = facts(guest, "wiring")
    assert (told["code"], told["listener"]["code"]) == (0, 0), told
    samples, theta = make_reference(SHOWN, tmp_path)
    found = np.load(guest / "wiring.npz")
    assert int(found["sample_index"]) in (99, 199)
    expected = theta[int(found["sample_index"]) // 100]
    assert found["theta_scaled"].astype("<f4").ravel().view("<u4").tolist() == expected.view("<u4").tolist()
    received = read_record(guest / "wiring.csv", Roles.load(guest / "wiring.roles.toml")).values
    np.testing.assert_array_equal(received, samples[: len(received)])
    assert len(received) == 250
