"""The wrapper to the host: what the listener records is what passed between simulator and controller.

Run by ctest, which names wrapper and controller in AEOLID_TEST_WRAPPER and AEOLID_TEST_CONTROLLER.
"""

from __future__ import annotations

import ctypes
import json
import os
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.filters import replay_filter
from aeolid.formats import read_record
from aeolid.record import Record, Roles

WRAPPER = os.environ.get("AEOLID_TEST_WRAPPER", "")
CONTROLLER = os.environ.get("AEOLID_TEST_CONTROLLER", "")
pytestmark = [
    pytest.mark.skipif(not WRAPPER, reason="ctest names the wrapper; run ctest -R discon_host"),
]
EXAMPLE = Path(__file__).resolve().parents[2] / "port/discon/example.cfg"
RECORDS, MESSAGE = 168, 300
DECIMATION, STEP_S = 10, 0.01
SCALES = {
    "pitch_command": (0.15, 0.05), "torque_command": (4e4, 2e3), "generator_speed": (122.0, 5.0),
    "tower_fore_aft": (0.0, 0.3), "odd": (0.0, 1.0),
}  # fmt: skip
SETTINGS = """
controller = {controller}
input = pitch_command offset 0.15 scale 0.05
input = torque_command offset 4e4 scale 2e3
output = generator_speed offset 122 scale 5
output = tower_fore_aft scale 0.3
output = record:90 name odd unit x scale 1
scheduling = wind
records = 168
decimation = 10
past = 12
snapshot_every = 20
share = 50
{more}
"""


class Turbine:
    """A turbine in a loop with the controller behind the wrapper; keeps what a tap must have seen."""

    def __init__(self, folder: Path, more: str, text: str = SETTINGS) -> None:
        settings = folder / "wrapper.cfg"
        settings.write_text(text.format(controller=CONTROLLER, more=more))
        os.environ["AEOLID_DISCON"] = str(settings)
        self.procedure = ctypes.CDLL(WRAPPER).DISCON
        self.swap = np.zeros(RECORDS, np.float32)
        self.message = ctypes.create_string_buffer(MESSAGE)
        self.names = ctypes.create_string_buffer(b"run", 200)
        self.fail = ctypes.c_int(0)
        self.random = np.random.default_rng(5)
        self.speed, self.tower = 122.0, np.zeros(2)
        self.speed_of_rotor = 0.0
        self.tapped: list[np.ndarray] = []

    def call(self, status: float, time_s: float, tap: bool) -> None:
        """Call the controller; remember the records of a sample that is due."""
        s = self.swap
        s[0], s[1], s[2] = status, time_s, STEP_S
        s[19], s[26], s[52], s[48] = self.speed, 14 + self.random.normal(), self.tower[1], MESSAGE
        s[50 - 1], s[51 - 1], s[61 - 1] = 10, 200, 3
        s[20] = self.speed_of_rotor + 0.01 * np.sin(time_s) if self.speed_of_rotor else 0.0
        measured = s[[19, 52, 89, 26]].copy()
        pointer = s.ctypes.data_as(ctypes.POINTER(ctypes.c_float))
        self.procedure(pointer, ctypes.byref(self.fail), b"DISCON.IN", self.names, self.message)
        assert self.fail.value == 0, self.message.value
        if tap:
            self.tapped.append(np.concatenate([s[[44, 46]], measured]))

    def step(self) -> None:
        """Let tower and rotor answer."""
        push = self.random.normal() - 8.0 * (float(self.swap[44]) - 0.15)
        self.speed += STEP_S * (2 * push - 0.05 * (self.speed - 122.0))
        self.tower[1] += STEP_S * (push - 4 * self.tower[0] - 0.2 * self.tower[1])
        self.tower[0] += STEP_S * self.tower[1]
        self.swap[89] = self.random.normal()

    def run(self, seconds: float, odd: Callable[[int], bool] = lambda k: False) -> None:
        """Run from the first call to the last; one for which `odd` holds comes twice, after the one before."""
        for k in range(round(seconds / STEP_S) + 1):
            if odd(k):
                self.call(1, (k - 1) * STEP_S, False)
            self.call(0 if k == 0 else 1, k * STEP_S, k % DECIMATION == 0)
            if odd(k):
                self.call(1, k * STEP_S, False)
            self.step()
        self.call(-1, seconds, False)


@pytest.fixture(autouse=True)
def keep_environment() -> Iterator[None]:
    """Take the settings' name back."""
    before = os.environ.copy()
    yield
    os.environ.clear()
    os.environ.update(before)


def listen(bus: str, folder: Path, *options: str) -> None:
    """Let the listener record a bus to its end, in this process."""
    words = ["listen", "--bus", bus, "--record", str(folder / "r.csv"), "--markov", str(folder / "m.npz"), *options]
    assert main(words) == 0


def received(folder: Path) -> Record:
    """Read what the listener recorded."""
    return read_record(folder / "r.csv", Roles.load(folder / "r.roles.toml"))


def assert_same_estimate(record: Record, folder: Path) -> None:
    """Compare the last snapshot, bit for bit, with the same filter run over the received samples."""
    names = [c.name for c in record.of("input") + record.of("output")]
    offset, scale = zip(*(SCALES[n] for n in names), strict=True)
    u, y = (record.columns([c.name for c in record.of(role)]) for role in ("input", "output"))
    replayed = replay_filter(u, y, past=12, sample_time_s=0.1, offset=offset, scale=scale, precision="f32")
    snapshot = np.load(folder / "m.npz")["theta_scaled"].astype(np.float32)
    assert np.abs(snapshot).max() > 0.01
    np.testing.assert_array_equal(snapshot, np.asarray(replayed.theta_scaled, np.float32))


@pytest.mark.parametrize("more", ["", "seal = no\ninnovations = yes", "fd = yes\nfd_ratio = 4"])
def test_a_frame_log_holds_the_records_bit_for_bit(tmp_path: Path, more: str) -> None:
    """Samples equal the records at every tenth step, repeated and repaired steps or not; theta equals a host replay."""
    turbine = Turbine(tmp_path, f"bus = file:frames.log\n{more}")
    turbine.run(60, odd=lambda k: k % 13 == 5)
    listen(str(tmp_path / "frames.log"), tmp_path)
    record = received(tmp_path)
    assert [c.name for c in record.channels] == [*SCALES, "wind"]
    assert [c.unit for c in record.channels] == ["rad", "N m", "rad/s", "m/s^2", "x", "m/s"]
    np.testing.assert_array_equal(record.values.astype(np.float32), np.array(turbine.tapped))
    np.testing.assert_allclose(record.time_s, 0.1 * np.arange(601), atol=1e-9)
    assert_same_estimate(record, tmp_path)


def test_stamps_are_the_start_of_the_run_and_simulated_seconds(tmp_path: Path) -> None:
    """The log is dated by the host's clock at the first call; the reader finds the date and a clock that keeps time."""
    before = time.time()
    Turbine(tmp_path, "bus = file:frames.log").run(60)
    after = time.time()
    stamps = [float(line[1:18]) for line in (tmp_path / "frames.log").read_text().splitlines()]
    assert before - 1e-3 < stamps[0] < after and 59.9 < stamps[-1] - stamps[0] < 75  # the end waits for the bus's share
    listen(str(tmp_path / "frames.log"), tmp_path, "--json", str(tmp_path / "facts.json"))
    (run,) = json.loads((tmp_path / "facts.json").read_text())["nodes"][0]["runs"]
    zero = datetime.fromisoformat(run["clock"]["utc_of_sample_0"]).replace(tzinfo=UTC).timestamp()
    assert before - 0.01 < zero < after + 0.01 and run["clock"]["real_time"] is True


@pytest.mark.parametrize(("period_s", "sent"), [("0.01", range(2, 1000)), ("0", range(1, 2))])
def test_a_snapshot_period_below_a_sample_is_not_none(tmp_path: Path, period_s: str, sent: range) -> None:
    """Parameters follow as fast as the share allows; with 0 only the last ones are sent, at the end."""
    text = SETTINGS.replace("snapshot_every = 20", f"snapshot_every = {period_s}")
    Turbine(tmp_path, "bus = file:frames.log", text).run(60)
    assert (tmp_path / "frames.log").read_text().count(" 1CFF4401#") in sent  # begin, of node 1


def test_holes_and_jumps_are_missing_samples(tmp_path: Path) -> None:
    """NaN measurements, steps that never come and a jump of the clock: holes; the replay still gives the same bits."""
    turbine = Turbine(tmp_path, "bus = file:frames.log")
    time_s, samples = 0.0, []
    for k in range(6000):
        if k == 2000:
            time_s -= 12.0  # a simulator that starts again without saying so
        if 3000 <= k < 3040:
            turbine.step()
        elif k == 4000:
            turbine.swap[89] = np.nan
            turbine.call(1, time_s, True)
        else:
            turbine.call(0 if k == 0 else 1, time_s, k % DECIMATION == 0)
        if k % DECIMATION == 0:
            samples.append(np.full(6, np.nan) if 3000 <= k < 3040 else turbine.tapped[-1])
        if k == 1990:
            samples.append(np.full(6, np.nan))  # the index left out at the jump
        turbine.step()
        time_s += STEP_S
    turbine.call(-1, time_s, False)
    listen(str(tmp_path / "frames.log"), tmp_path)
    record = received(tmp_path)
    np.testing.assert_array_equal(record.values.astype(np.float32), np.array(samples, np.float32))
    assert_same_estimate(record, tmp_path)


def test_the_listener_names_a_channel_that_the_filter_hardly_sees(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A direct drive's speed with a gearbox's scale: wrapper, listener and identify say what would fit, and it does."""
    lines = "output = rotor_speed offset 122 scale 5\n{more}"
    text = SETTINGS.replace("{more}", lines).replace("speed offset 122 scale 5\n", "speed offset 122 scale 0.5\n", 1)
    turbine = Turbine(tmp_path, "bus = file:frames.log", text)
    turbine.speed_of_rotor = 0.79
    turbine.run(100)
    said = capfd.readouterr()
    assert "rotor_speed: its mean lies -24.2 scales" in said.err and "1 channel to look at" in said.out
    listen(str(tmp_path / "frames.log"), tmp_path, "--json", str(tmp_path / "facts.json"))
    (problem,) = json.loads((tmp_path / "facts.json").read_text())["nodes"][0]["runs"][0]["scale_problems"]
    assert problem in capfd.readouterr().out.replace("\n", "")
    found = re.search(r"offset (0\.7[89]\d*) scale (\S+) would fit", problem)
    assert found is not None and float(found[2]) == pytest.approx(0.01 / np.sqrt(2), rel=0.2)
    assert f"scale {found[2]}` would fit" in said.err


def test_the_excitation_is_a_channel(tmp_path: Path) -> None:
    """Demand and excitation arrive; the controller's own demand, their difference, is what it would have asked for."""
    section = "[torque excitation]\nsignal = multisine\nlow = 0.2\nhigh = 2\namplitude = 500\nrate = 5000\nstart = 5\n"
    turbine = Turbine(tmp_path, f"bus = file:frames.log\n{section}stop = 25\nminimum = 0\nmaximum = 6e4\n")
    turbine.run(40)
    listen(str(tmp_path / "frames.log"), tmp_path)
    record = received(tmp_path)
    added = record.column("excitation_torque")
    own = record.column("torque_command") - added
    quiet = (record.time_s < 5) | (record.time_s > 25.2)
    assert np.all(added[quiet] == 0) and np.abs(added).max() <= 500 and np.std(added[~quiet]) > 100
    np.testing.assert_allclose(own, 340.0 * record.column("generator_speed"), rtol=3e-7)


def test_the_example_streams_what_it_names(tmp_path: Path) -> None:
    """example.cfg as it stands, but for controller and bus: its channels arrive, and its excitation at its times."""
    text = EXAMPLE.read_text().replace("libdiscon.so ", "{controller} ").replace("tcp:29536 ", "file:frames.log ")
    turbine = Turbine(tmp_path, "", text)
    turbine.run(70)
    listen(str(tmp_path / "frames.log"), tmp_path)
    record = received(tmp_path)
    names = ["pitch_command", "torque_command", "generator_speed", "tower_fore_aft", "tower_side_side"]
    assert [c.name for c in record.channels] == [*names, "excitation_pitch"]
    added = np.abs(record.column("excitation_pitch"))
    assert added.max() > 0.004 and np.all(added[record.time_s < 60] == 0)


def free_port() -> int:
    """Find a port nobody has."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def test_a_listener_on_tcp_gets_the_same(tmp_path: Path) -> None:
    """A listener that comes within `wait` gets every sample, the last parameters and the end of the stream."""
    port = free_port()
    turbine = Turbine(tmp_path, f"bus = tcp:{port}\nwait = 3600")
    simulator = threading.Thread(target=turbine.run, args=(20,))
    simulator.start()
    end = time.monotonic() + 3600
    while time.monotonic() < end:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port)):
            break
        time.sleep(0.05)
    listen(f"slcan:socket://127.0.0.1:{port}", tmp_path, "--until-end")
    simulator.join()
    record = received(tmp_path)
    np.testing.assert_array_equal(record.values.astype(np.float32), np.array(turbine.tapped))
    assert_same_estimate(record, tmp_path)
