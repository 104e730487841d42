"""Campbell diagrams: recordings that the test makes, a crossing, what is refused; by night OpenFAST's own turbine."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rotor_rig import DRIVE_TRAIN, FORE_AFT, SIDE_SIDE, STEP, blade_hz, rotor, without

import aeolid as ae
from aeolid.begin.rotor_roles import rotor_outputs, rotor_roles
from aeolid.cli.main import main
from aeolid.errors import DataError, NotIdentifiable, UsageError
from aeolid.fleet import campbell
from aeolid.fleet.campbell import Campbell, Run, find_campbell, followed
from aeolid.formats import write_table
from aeolid.identify.rotor import Rotation
from aeolid.models.modes import Mode, with_whirl
from aeolid.models.shapes import Shape
from aeolid.record import Record

SPEEDS = (7.0, 9.5, 12.0)  # rpm; at 9.5 rpm 3P lies on nothing, 2P beside the tower
WINDS = (6.0, 8.0, 14.0)
SHARED = Path(__file__).resolve().parents[2].parent / "shared" / "openfast"


@cache
def records() -> tuple[Record, ...]:
    """Return recordings at three speeds, not in order."""
    made = [rotor(i + 1, rpm, uneven=0.01, wind=w) for i, (rpm, w) in enumerate(zip(SPEEDS, WINDS, strict=True))]
    return made[1], made[2], made[0]


@cache
def found() -> Campbell:
    return find_campbell(records(), blades="auto", past=16, largest=24, decimation=2)


def expected() -> dict[str, tuple[float, ...]]:
    """Return the frequencies in Hz of the rig's modes at the three speeds, as the tower sees them."""
    p = [rpm / 60 for rpm in SPEEDS]
    return {
        "tower fore-aft": 3 * (FORE_AFT[0],), "tower side-side": 3 * (SIDE_SIDE[0],),
        "blade edgewise, backward": tuple(blade_hz(v) - v for v in p),
        "blade edgewise, forward": tuple(blade_hz(v) + v for v in p),
    }  # fmt: skip


def test_modes_are_followed_over_the_speed_and_are_those_of_the_rig() -> None:
    """Each within four of its own deviations, and those are small."""
    assert [r.wind_m_s for r in found().runs] == sorted(r.wind_m_s for r in found().runs)
    named = {t.name: t for t in found().tracks}
    for name, hertz in expected().items():
        for mode, f in zip(named[name].modes, hertz, strict=True):
            assert mode is not None and abs(mode.frequency_hz - f) < 4 * (mode.frequency_std_hz or 0.0) < 0.07 * f, name
    assert any(
        all(m is not None and abs(m.frequency_hz / DRIVE_TRAIN[0] - 1) < 0.02 for m in t.modes) for t in found().tracks
    )


def test_a_window_in_seconds_is_that_long_in_every_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two recordings at 0.1 and 0.05 s, thinned twofold, 3.2 s are 16 and 32 samples, in either order."""
    asked: dict[str, int] = {}

    def modal(records: Sequence[Record], **settings: Any) -> Any:
        asked[records[0].source] = settings["past"]
        if len(asked) == 2:
            raise NotIdentifiable("asked")
        return found().runs[0].modal

    slow, _ = records()[0], found()
    fast = replace(slow, sample_time_s=slow.sample_time_s / 2, time_s=slow.time_s / 2, source="fast")
    monkeypatch.setattr(campbell, "find_modal", modal)
    for pair in ((slow, fast), (fast, slow)):
        asked.clear()
        with pytest.raises(NotIdentifiable, match="asked"):
            find_campbell(pair, blades="auto", past="3.2s", decimation=2)
        assert asked == {slow.source: round(1.6 / slow.sample_time_s), "fast": round(3.2 / slow.sample_time_s)}


def test_harmonics_are_never_among_the_modes() -> None:
    for k, run in enumerate(found().runs):
        for track in (*found().tracks, *found().single):
            mode = track.modes[k]
            for order in (1, 3, 6):
                line = order * run.turning.frequency_hz
                assert mode is None or abs(mode.frequency_hz / line - 1) > 0.01, (track.name, order)


def test_the_answer_does_not_depend_on_the_order_of_the_recordings() -> None:
    again = find_campbell(records()[::-1], blades="auto", past=16, largest=24, decimation=2)
    assert again.to_json() == found().to_json()


STEPS = 5


def made(kind: str, hertz: float) -> Mode:
    """Return a mode of the tower, or of blades that whirl forward."""
    s = 2 * np.pi * hertz * complex(-0.01, np.sqrt(1 - 0.01**2))
    shapes = {
        "tower": {"tower_acc_side_side": 1.0, "edge_moment_cosine": 0.1, "edge_moment_sine": 0.1},
        "forward": {"tower_acc_side_side": 0.1, "edge_moment_cosine": 1.0, "edge_moment_sine": -0.4j},
        "backward": {"tower_acc_side_side": 0.1, "edge_moment_cosine": 1.0, "edge_moment_sine": 0.4j},
    }  # fmt: skip
    values = {n: complex(v) for n, v in shapes[kind].items()}
    shares = {n: abs(v) / sum(map(abs, values.values())) for n, v in values.items()}
    shape = Shape(max(shares, key=lambda n: shares[n]), values)
    return Mode(hertz, 0.01, complex(np.exp(s * STEP)), 0.001, 0.001, shares, name=kind, shape=shape)


def run_of(speed_hz: float, modes: list[Mode]) -> Run:
    outputs = ("tower_acc_side_side", "edge_moment_cosine", "edge_moment_sine")
    scaling = SimpleNamespace(outputs=outputs, scale=np.ones(3))
    every = with_whirl(modes, speed_hz)
    modal: Any = SimpleNamespace(
        notes=(),
        listed=tuple(m for m in every if not m.rotor_order), modes=every,
        diagram=SimpleNamespace(scaling=scaling, sample_time_s=STEP, outputs=outputs, past=8, order=8),
        sources=({"source": str(speed_hz)},),
    )  # fmt: skip
    return Run(f"{speed_hz}", modal, Rotation(speed_hz, 0.0), None)


def test_tracks_keep_their_modes_through_a_crossing() -> None:
    """Forward whirl rises through a tower mode, a backward one falls through it: shapes and senses tell them apart."""
    speeds = np.linspace(0.1, 0.3, STEPS)
    runs = []
    for v in speeds:
        now = [made("tower", 1.0 + 0.02 * v), made("forward", 0.8 + v), made("backward", 1.2 - v)]
        runs.append(run_of(float(v), sorted(now, key=lambda m: m.frequency_hz)))
    tracks = {t.name: [m.frequency_hz for m in t.found] for t in followed(runs).tracks}
    assert set(tracks) == {"tower", "forward", "backward"}
    np.testing.assert_allclose(tracks["forward"], 0.8 + speeds)
    np.testing.assert_allclose(tracks["backward"], 1.2 - speeds)
    np.testing.assert_allclose(tracks["tower"], 1.0 + 0.02 * speeds)


def test_senses_are_never_mixed_though_shapes_are_alike() -> None:
    """The shapes of both whirls have an assurance of 0.5 here, and the frequencies change places."""
    runs = [
        run_of(0.10, [made("forward", 0.90), made("backward", 0.95)]),
        run_of(0.12, [made("backward", 0.90), made("forward", 0.95)]),
    ]  # fmt: skip
    tracks = {t.name: [m.frequency_hz for m in t.found] for t in followed(runs).tracks}
    assert tracks == {"forward": [0.90, 0.95], "backward": [0.95, 0.90]}
    alone = followed([run_of(0.10, [made("forward", 0.93)]), run_of(0.11, [made("backward", 0.93)])])
    assert alone.tracks == () and len(alone.single) == 2


def test_a_whirl_is_followed_on_the_blade_over_a_wide_step_of_the_speed() -> None:
    """From the tower it moves by 57 %, on the blade not at all; a tower's mode that moves so far is another one."""
    runs = [run_of(v, [made("forward", 0.6 + v), made("tower", 1.0 + 2 * v)]) for v in (0.1, 0.5)]
    told = followed(runs)
    assert [t.name for t in told.tracks] == ["forward"] and [t.name for t in told.single] == ["tower", "tower"]


def test_other_shapes_are_other_modes_and_harmonics_none() -> None:
    harmonic = replace(made("tower", 0.8), rotor_order=4)
    runs = [run_of(0.20, [made("tower", 1.1), harmonic]), run_of(0.21, [made("forward", 1.1), harmonic])]
    told = followed(runs)
    assert told.tracks == () and told.lines == () and {t.name for t in told.single} == {"tower", "forward"}
    assert [m["frequency_hz"] for m in told.to_json()["runs"][0]["harmonics"]] == [0.8]


def test_a_mode_that_is_lost_in_one_run_goes_on_in_the_next() -> None:
    runs = [run_of(v, [made("tower", 0.9)] if v != 0.2 else []) for v in (0.1, 0.2, 0.3)]
    (track,) = followed(runs).tracks
    assert [m is None for m in track.modes] == [False, True, False]


def test_what_stays_on_a_line_is_the_line_and_what_crosses_it_is_a_mode() -> None:
    speeds = (0.18, 0.2, 0.22)
    runs = [run_of(v, [made("tower", 0.6), made("backward", 6.05 * v)]) for v in speeds]  # 0.6 Hz: 3P at 0.2 Hz
    told = followed(runs)
    assert [t.name for t in told.tracks] == ["tower"] and len(told.tracks[0].found) == 3
    assert [t.name for t in told.lines] == ["6P"]


def test_a_mode_of_one_run_is_told_apart() -> None:
    runs = [run_of(0.1, [made("tower", 0.9)]), run_of(0.2, [made("tower", 0.9), made("forward", 1.4)])]
    told = followed(runs)
    assert [t.name for t in told.tracks] == ["tower"] and [t.name for t in told.single] == ["forward"]
    assert "found in one recording only: forward near 1.4 Hz" in told.summary()


def test_the_command_writes_table_picture_page_and_facts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Channels are known by their headings: no roles file is needed."""
    names = []
    for i, record in enumerate(records()):
        columns = {"time_s": record.time_s} | {c.name: record.column(c.name) for c in record.channels}
        write_table(tmp_path / f"{i}.csv", columns)
        names.append(str(tmp_path / f"{i}.csv"))
    files = [tmp_path / n for n in ("c.svg", "c.png", "c.html", "c.json")]
    given = [part for f in files[:3] for part in ("--out", str(f))]
    options = ["--past", "16", "--largest-order", "24"]
    assert main(["campbell", *names, *options, *given, "--json", str(files[3])]) == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("tower fore-aft", "blade edgewise, forward", "1P", "6 m/s"))
    facts = json.loads(files[3].read_text(encoding="utf-8"))
    assert [r["source"] for r in facts["runs"]] == [names[2], names[0], names[1]]
    named = {t["name"]: t for t in facts["tracks"]}
    for name, hertz in expected().items():
        for mode, f in zip(named[name]["modes"], hertz, strict=True):
            assert abs(mode["frequency_hz"] - f) < 4 * mode["frequency_std_hz"] < 0.07 * f, name
    whirl = named["blade edgewise, backward"]["modes"][0]["whirl"]
    assert whirl["blade_frequency_hz"] == pytest.approx(blade_hz(SPEEDS[0] / 60), rel=0.01)
    assert "<svg" in files[0].read_text(encoding="utf-8") and files[1].read_bytes()[:4] == b"\x89PNG"
    page, words = files[2].read_text(encoding="utf-8"), ("rotor speed (rpm)", "wind speed (m/s)", "On the blades")
    assert all(word in page for word in ("blade edgewise, backward", *words))


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["a.csv"], 2, "takes two runs or more"),
        (["a.csv", "b.csv", "--out", "c.txt"], 2, "a diagram is written as"),
        (["a.csv", "b.csv", "--blades", "edge_moment_1..4"], 2, "no channel 'edge_moment_4'"),
        (["a.csv", "b.csv", "--blades", "edge_moment_1"], 2, "1 blade"),
        (["a.csv", "b.csv", "--decimate", "0", "--past", "8s"], 2, "correct decimate"),
        (["a.csv", "b.csv", "--decimate", "0"], 2, "decimation factor 0"),
        (["a.csv", "still.csv"], 3, "neither its azimuth nor its speed"),
        (["a.csv", "unknown.csv"], 3, "--roles"),
    ],
)
def test_what_is_no_diagram_is_refused(
    arguments: list[str], code: int, text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    record = rotor(1, 12.0, 300)
    still = without(record, "azimuth", "rotor_speed")
    for name, r in (("a", record), ("b", record), ("still", still)):
        write_table(f"{name}.csv", {"time_s": r.time_s} | {c.name: r.column(c.name) for c in r.channels})
    write_table("unknown.csv", {"time_s": record.time_s, "thing": record.values[:, 0]})
    assert main(["campbell", *arguments]) == code
    assert text in " ".join(capsys.readouterr().err.split())


# Hz by the simulator's own linearisation without its controller (tests/studies/campbell_openfast.py), azimuths averaged
# in multi-blade coordinates.
LINEARISED = {
    8: {
        "tower side-side": 0.3211, "tower fore-aft": 0.3340, "blade edgewise, backward": 0.9396,
        "blade edgewise, forward": 1.2418, "drive train": 1.6964,
    },
    15: {
        "tower side-side": 0.3212, "tower fore-aft": 0.3364, "blade edgewise, backward": 0.8849,
        "blade edgewise, forward": 1.2916, "drive train": 1.6857,
    },
}  # fmt: skip


@pytest.mark.nightly
@pytest.mark.skipif(not (SHARED / "run.py").exists(), reason="../shared/openfast is absent")
def test_openfast_shows_the_modes_of_its_own_linearisation(tmp_path: Path) -> None:
    """Within 3 %: what the controller, dynamic inflow and ten minutes of turbulence move them by."""
    names = []
    for wind in (8, 15):
        place = tmp_path / f"wind{wind}"
        command = [sys.executable, str(SHARED / "run.py"), str(place), "--seed", str(wind), "--wind", str(wind)]
        subprocess.run([*command, "--full-field", "--seconds", "600", "--set", "turbine.fst:TStart=100"], check=True)
        names.append(f"{place}.outb")
    assert main(["campbell", *names, "--json", str(tmp_path / "c.json")]) == 0
    facts = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    named = {t["name"]: t["modes"] for t in facts["tracks"]}
    for k, wind in enumerate((8, 15)):
        for name, hertz in LINEARISED[wind].items():
            assert named[name][k]["frequency_hz"] == pytest.approx(hertz, rel=0.03), (wind, name)


def test_headings_of_openfast_are_known_and_keep_their_names(tmp_path: Path) -> None:
    t = STEP * np.arange(50)
    headings = ["GenSpeed", "RotSpeed", "YawBrTAxp", "YawBrTAyp", "TTDspFA", "Azimuth", "Wind1VelX", "BldPitch1"]
    headings += [f"Root{m}b{b}" for m in ("Mx", "My") for b in (1, 2, 3)]
    write_table(tmp_path / "run.csv", {"time_s": t} | {h: np.sin(t + i) for i, h in enumerate(headings)})
    roles = rotor_roles(tmp_path / "run.csv")
    told = {c.name: (c.role, c.blade) for c in roles.channels}
    assert told["RootMxb2"] == ("output", 2) and told["Azimuth"] == ("azimuth", 0) and "TTDspFA" not in told
    assert told["RotSpeed"] == told["Wind1VelX"] == ("scheduling", 0) and "BldPitch1" not in told
    edgewise = ["RootMxb_collective", "RootMxb_cosine", "RootMxb_sine"]
    assert rotor_outputs(roles) == ["GenSpeed", "YawBrTAxp", "YawBrTAyp", "RootMyb_collective", *edgewise]
    write_table(tmp_path / "b.csv", {"time_s": t, "Blade 1 root edgewise moment": t, "Blade 2 root edgewise moment": t,
                                     "Blade 3 root edgewise moment": t})  # fmt: skip
    assert [c.name for c in rotor_roles(tmp_path / "b.csv").channels] == [f"edge_moment_{b}" for b in (1, 2, 3)]


def test_from_python(tmp_path: Path) -> None:
    mine = [ae.Record.of_core(r) for r in records()]
    with pytest.raises(UsageError, match="two recordings or more"):
        ae.campbell(mine[:1])
    with pytest.raises(DataError, match="a Campbell diagram is over its speed"):
        ae.campbell([ae.Record.of_core(without(r, "azimuth", "rotor_speed")) for r in records()])
    diagram = ae.campbell(mine, blades="auto", past=16, largest_order=24, decimate=2)
    assert diagram.to_json() == found().to_json() and "campbelldiagram" in repr(diagram).lower()
    frame = diagram.to_frame()
    whirling = frame[frame.whirl == "forward"]
    assert {"name", "wind_m_s", "rotor_hz", "frequency_hz", "damping"} <= set(frame.columns) and len(whirling)
    import matplotlib

    matplotlib.use("Agg")
    panels = diagram.plot()
    assert len(panels) == 2 and panels[0].get_xlabel() == "rotor speed (rpm)"
    diagram.report(tmp_path / "page.html")
    assert (tmp_path / "page.html").is_file()
