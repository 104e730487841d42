"""Streams without inputs: what may be described, what filters estimate, which live modes are told from harmonics."""

from __future__ import annotations

import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from can_frames import bits, receive, row
from shaken_plant import DRIVE_TRAIN, ROTOR_RPM, STEP_S, THRICE_HZ, TOWER, UNITS, shake

from aeolid.can import Assembly, wire
from aeolid.can.run import channels_of
from aeolid.can.software_node import feed_from_record
from aeolid.cli import listen_rules
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.filters import filter_record, replay_filter
from aeolid.formats import write_table
from aeolid.identify.live import LiveModes, LiveSettings
from aeolid.record import Channel, Record

OUTPUTS = tuple(Channel(name, unit, "output") for name, unit in UNITS.items())


def record_of(y: np.ndarray, channels: tuple[Channel, ...] = OUTPUTS) -> Record:
    return Record(STEP_S * np.arange(len(y)), y, channels, STEP_S, "shaken", "")


# ---- what a node may describe


def described(
    r: int, outputs: int, past: int, *, s: int = 0, parameters: int | None = None, mask: int = 0,
    names: tuple[str, ...] = (),
) -> Assembly:  # fmt: skip
    """Feed the description of a node of these sizes, built by hand."""
    parts = {(1, 0): r | outputs << 8 | s << 16 | 1 << 24, (3, 1): bits(0.1), (4, 0): bits(1.0), (5, 0): bits(0.1)}
    parts |= {(2, past): outputs * past * (r + outputs) if parameters is None else parameters, (6, 0): mask}
    for i in range(min(r + outputs + s, 64)):
        parts |= {(7, i): bits(0.0), (8, i): bits(1.0)}
    for i, name in enumerate(names):
        for k in range(0, len(name), 4):
            parts[9, i | k // 4 << 8] = int.from_bytes(name[k : k + 4].encode().ljust(4, b"\0"), "little")
    words = np.array([(tag | index << 16, value) for (tag, index), value in sorted(parts.items())], "<u4")
    rows = [row(1, wire.DESCRIPTION, 0, 2, zlib.crc32(words.tobytes()))]
    rows += [row(1, wire.DESCRIPTION, tag, index, value) for (tag, index), value in sorted(parts.items())]
    return receive(rows)


def test_outputs_alone_may_be_described() -> None:
    node = described(0, 2, 5, names=("tower_fore_aft",)).nodes[1]
    assert node.problem is None and node.now is not None
    d = node.now.description
    assert (d.inputs, d.outputs, d.regressors, d.feedthrough) == (0, 2, 10, ())
    assert d.names == ("tower_fore_aft", "y2") and listen_rules.find_problem(node.now) == ""
    assert [c.role for c in channels_of(node.now)] == ["output", "output"]


@pytest.mark.parametrize(
    "sizes, why",
    [
        ({"r": 0, "outputs": 0, "past": 5, "parameters": 10}, "0 outputs and 0 channels"),
        ({"r": 0, "outputs": 0, "past": 5, "s": 3, "parameters": 10}, "0 outputs and 3 channels"),
        ({"r": 0, "outputs": 0, "past": 0}, "0 outputs"),
        ({"r": 0, "outputs": 0, "past": 65535, "parameters": 0xFFFFFFFF}, "0 outputs"),
        ({"r": 0, "outputs": 2, "past": 0}, "0 parameters"),
        ({"r": 0, "outputs": 2, "past": 5, "parameters": 22}, "11 regressors where past window and channels make 10"),
        ({"r": 0, "outputs": 2, "past": 5, "parameters": 22, "mask": 1}, "11 regressors"),
        ({"r": 0, "outputs": 2, "past": 5, "parameters": 0xFFFFFFFE}, "4294967294 parameters"),
        ({"r": 0, "outputs": 65, "past": 1}, "65 channels"),
    ],
)
def test_descriptions_that_cannot_be_are_refused(sizes: dict[str, int], why: str) -> None:
    """A forged one may hold anything: none is believed, each is told in words."""
    node = described(**sizes).nodes[1]
    assert node.now is None and node.problem is not None and why in node.problem


def test_what_is_called_azimuth_and_is_an_angle_tells_the_rotor() -> None:
    for name, role in (("azimuth", "scheduling"), ("wind", "scheduling")):
        now = described(0, 1, 4, s=1, names=("a", name)).nodes[1].now
        assert now is not None and channels_of(now)[1].role == role  # without a unit nothing is an angle
        d = now.description
        now = replace(now, description=replace(d, units=("", "rad")))
        assert channels_of(now)[1].role == ("azimuth" if name == "azimuth" else "scheduling")


# ---- what a filter estimates


@pytest.mark.parametrize("method", ["rls", "lattice", "fast-rls"])
def test_the_filter_is_least_squares_of_the_autoregression(method: str) -> None:
    """In double and with a ridge of 1e-6 of the samples' power the two agree to that share."""
    y, p = shake(1500, 3), 6
    y[:p] = 0.0  # the linear filters count what came before the first window as 0
    found = replay_filter(
        np.zeros((len(y), 0)), y, past=p, method=method, precision="f64", forgetting=1.0, regularisation=1e-3,
        offset=np.zeros(2), scale=np.ones(2),
    )  # fmt: skip
    z = np.hstack([y[p - lag : len(y) - lag] for lag in range(p, 0, -1)])
    expected = np.linalg.lstsq(z, y[p:], rcond=None)[0].T
    assert found.theta.shape == (2, 2 * p)  # no column of an input
    np.testing.assert_allclose(found.theta, expected, atol=3e-3)


def test_a_recording_of_outputs_is_filtered_and_fed() -> None:
    record = record_of(shake(300, 1))
    assert filter_record(record, past=4).theta.shape == (2, 8)
    feed = feed_from_record(record)
    assert not feed.inputs and next(iter(feed.rows)).shape == (256, 4)
    with pytest.raises(UsageError, match="the inputs are none"):
        filter_record(record, past=4, feedthrough=("tower_fore_aft",))
    nothing = replace(record, channels=tuple(replace(c, role="ignore") for c in OUTPUTS))
    with pytest.raises(UsageError, match="at least one output"):
        filter_record(nothing, past=4)
    with pytest.raises(DataError, match="at least one output"):
        feed_from_record(nothing)
    with pytest.raises(UsageError, match="there are no inputs"):
        replay_filter(np.zeros((300, 0)), record.values, past=4, feedthrough=(0,))


# ---- live modes


def follow(y: np.ndarray, others: tuple[Channel, ...] = (), s: np.ndarray | None = None, past: int = 25) -> LiveModes:
    """Follow a stream to its end, with a snapshot in the middle and one at the end; theta from the filter in double."""
    scale = y.std(axis=0)
    live = LiveModes(
        LiveSettings((), tuple(UNITS), past, STEP_S, 1.0, 0.1, (), "varx", y.mean(axis=0), scale, None, others)
    )
    for stop in (len(y) // 2, len(y)):
        for k in range(live.samples, stop, 100):
            part = slice(k, min(k + 100, stop))
            index = np.arange(part.start, part.stop)
            live.add(index, np.zeros((len(index), 0)), y[part], None, None if s is None else s[part])
        found = replay_filter(
            np.zeros((stop, 0)), y[:stop], past=past, precision="f64", offset=y.mean(axis=0), scale=scale,
            sample_time_s=STEP_S,
        )  # fmt: skip
        live.snapshot(found.theta, stop - 1)
    return live


def test_modes_come_with_bands_and_names() -> None:
    """Ten minutes: both within 3 %, the truth within 3 deviations; frequencies of a light mode to a percent or two."""
    modes = [m for m in follow(shake(6000, 2)).modes() if m.is_shown]
    for name, (hertz, damping) in {"tower fore-aft": TOWER, "drive train": DRIVE_TRAIN}.items():
        (found,) = [m.mode for m in modes if m.mode.name == name]
        assert found.frequency_std_hz is not None and found.damping_std is not None
        assert found.frequency_hz == pytest.approx(hertz, rel=0.03)
        assert abs(found.frequency_hz - hertz) < 3 * found.frequency_std_hz < 0.05 * hertz
        assert abs(found.damping - damping) < 3 * found.damping_std < damping


@pytest.mark.parametrize("told", ["azimuth", "rotor_speed", ""])
def test_a_force_three_times_a_turn_is_no_mode(told: str) -> None:
    """By the azimuth or the speed that is sent besides it is 3P; where neither is, a steady sine. The modes stay."""
    y = shake(6000, 4, force=1.0)
    turns = ROTOR_RPM / 60 * STEP_S * np.arange(len(y))
    sent = {
        "azimuth": ((Channel("azimuth", "rad", "azimuth"),), (2 * np.pi * turns)[:, None] % (2 * np.pi)),
        "rotor_speed": ((Channel("rotor_speed", "rpm", "scheduling"),), np.full((len(y), 1), ROTOR_RPM)),
        "": ((), None),
    }[told]
    modes = follow(y, *sent).modes()
    lines = [m.mode for m in modes if m.is_harmonic]
    assert len(lines) == 1 and lines[0].frequency_hz == pytest.approx(THRICE_HZ, rel=0.01)
    assert (lines[0].rotor_order, lines[0].name, lines[0].tone) == ((3, "3P", False) if told else (None, "", True))
    shown = [m.mode.frequency_hz for m in modes if m.is_shown]
    for hertz, _ in (TOWER, DRIVE_TRAIN):
        assert min(abs(f - hertz) for f in shown) < 0.03 * hertz


# ---- a first recording


def test_init_of_outputs_alone_leads_to_their_modes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    y = shake(400, 5)
    columns = {"time": STEP_S * np.arange(len(y)), "Nacelle acceleration X": y[:, 0], "Gen speed": 1200 + y[:, 1]}
    write_table(tmp_path / "a.csv", columns)
    assert main(["init", str(tmp_path / "a.csv")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "No input was recognised: modes come from the outputs alone" in told and "aeolid modes" in told
