"""Runs and pairs of other turbines: a source of cases on which nothing of the diagnosis was made.

Every effect is one run of 500 s; two runs of each turbine as it is, in wind of the same kind, are the other sides. What
is made is a set of `crossings.py`. Where the name of a truth is open, as in the corpus.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from openfast_pairs import crossings, decks, making
from openfast_pairs.crossings import TURN, Change
from openfast_pairs.design import Pair
from openfast_pairs.effects import EFFECTS

SECONDS, PART = 500.0, "others"
_CHANNELS = {
    "generator_speed": "GenSpeed", "tower_acc_fore_aft": "YawBrTAxp", "tower_acc_side_side": "YawBrTAyp",
    "flap_moment_1": "RootMyb1", "flap_moment_2": "RootMyb2", "flap_moment_3": "RootMyb3",
    "nacelle_wind": "Wind1VelX", "azimuth": "Azimuth", "blade_angle_1": "BldPitch1",
}  # fmt: skip
_LOG = ("pitch_demand", "torque_demand", "pitch_excitation", "torque_excitation")  # columns 1 to 4 of the wrapper's log


_KNOWN = {e.key: e for e in EFFECTS}
_OUTSIDE = ("rougher_sea",)  # what differs acts on the turbine from outside: no physics was left out


def _plain(of: str) -> list[tuple[str, str, Change]]:
    """Return turbine, name and change of the two runs of each turbine as it is that a set holds its effects against."""
    kinds = dict.fromkeys((turbine, c.wind) for turbine, made in crossings.SETS[of].items() for c in made)
    return [
        (turbine, _named(turbine, f"n{k}", wind), Change("null", seed, wind=wind))
        for turbine, wind in kinds
        for k, seed in enumerate(crossings.PLAIN[turbine, wind], start=1)
    ]


def _named(turbine: str, what: str, wind: str) -> str:
    return f"{turbine}-{what}" if wind == "u16" else f"{turbine}-{what}-{wind}"


def all_runs(of: str) -> list[tuple[str, str, Change]]:
    """Return turbine, name and change of every run of a set, those that most pairs need first."""
    return _plain(of) + [(t, _named(t, c.effect, c.wind), c) for t, made in crossings.SETS[of].items() for c in made]


def all_pairs(of: str) -> list[tuple[str, Pair]]:
    """Return turbine and pair of a set: two nulls of each turbine and wind, and effects on the side that has them."""
    found = []
    for (turbine, first, change), (_, second, _) in zip(*[iter(_plain(of))] * 2, strict=True):
        for name, a, b in (("null-1x2", first, second), ("null-2x1", second, first)):
            named = _named(turbine, name, change.wind)
            found.append((turbine, Pair(named, "null", "null", change.wind, a, b, SECONDS)))
    for turbine, made in crossings.SETS[of].items():
        found += [(turbine, _pair(turbine, c)) for c in made]
    return found


def _pair(turbine: str, change: Change) -> Pair:
    own, plain = _named(turbine, change.effect, change.wind), _named(turbine, "n1", change.wind)
    if change.effect in _OUTSIDE:
        return Pair(own, "null", "null", change.wind, own, plain, SECONDS)
    known = _KNOWN[change.effect]
    sides = (plain, own) if known.simulated else (own, plain)
    return Pair(own, change.effect, "large", change.wind, *sides, SECONDS, known.ids, known.accepted, known.families,
                known.place, change.values)  # fmt: skip


def make(folder: Path, kit: ModuleType, of: str, say: Callable[[str], None]) -> bool:
    """Make what is missing of runs and cases of a set, one run after the other; returns whether all is there."""
    with making.alone(folder):
        package = decks.fetch(folder / "decks")
        for turbine, name, change in all_runs(of):
            if not (folder / "runs" / name).is_dir():
                wrong = _one(folder, kit, package, decks.DECKS[turbine], name, change)
                say(f"{name}: {wrong or 'made'}")
                write_cases(folder, of)
        there = write_cases(folder, of)
        say(f"{folder}: {there} of {2 * len(all_pairs(of))} cases")
    return there == 2 * len(all_pairs(of))


def _one(folder: Path, kit: ModuleType, package: Path, deck: decks.Deck, name: str, change: Change) -> str:
    """Make a run beside its place and move it there when it is whole; returns what went wrong."""
    with tempfile.TemporaryDirectory(prefix="other-turbine-") as scratch:
        work = Path(scratch) / "deck"
        files = decks.lay(deck, package, work, kit.change)
        programs = kit.prepare()
        _set(kit, deck, files, change, programs, package)
        home = Path(files["main"]).parent
        environment = {"EFFECTS": "effects.txt", "LD_LIBRARY_PATH": programs, "OMP_NUM_THREADS": "1"}
        done = subprocess.run(
            [f"{programs}/openfast", Path(files["main"]).name], cwd=home, check=False, capture_output=True, text=True,
            env={**os.environ, **environment},
        )  # fmt: skip
        written = Path(files["main"]).with_suffix(".outb")
        if done.returncode or not written.is_file():
            return f"exit code {done.returncode}: {done.stdout[-600:]}"
        made = folder / "runs" / f".{name}"
        shutil.rmtree(made, ignore_errors=True)
        made.mkdir(parents=True)
        _write(made / "run.csv.gz", kit, written, home / "effects.bin", round(deck.settle_s / kit.STEP))
        (made / "run.json").write_text(json.dumps({"name": name, "package": decks.PACKAGE}) + "\n", encoding="utf-8")
        made.rename(folder / "runs" / name)
    return ""


def _set(
    kit: ModuleType, deck: decks.Deck, files: Mapping[str, str], change: Change, programs: str, package: Path
) -> None:  # fmt: skip
    """Write wind, controller's wrapper and what is changed into the deck."""
    home, total = Path(files["main"]).parent, SECONDS + deck.settle_s
    speed = int(change.wind[1:])
    angle = deck.pitch_deg[speed]
    settings: list[decks.Setting] = [
        *_blow(kit, deck, home, change, programs, total + 30), *_waves(files, change.seed), ("main", "TMax", total),
        ("main", "DT_Out", kit.STEP), ("servo", "DLL_FileName", f'"{programs}/libeffects.so"'),
        *(("elastic", f"BlPitch({b})", angle) for b in (1, 2, 3)), *change.settings,
    ]  # fmt: skip
    for key, parameter, value in settings:
        kit.change(files[key], parameter, value)
    if change.heavy is not None:
        decks.heavier(deck, files, change.heavy, kit.change)
    if change.twisted_deg:
        decks.twisted(files, change.twisted_deg)
    told: dict[str, Any] = {
        "amp_pitch": 0.5 * TURN, "hold_pitch": 0.7, "amp_torque": deck.torque_N_m, "hold_torque": 0.4, "start": 5,
        **change.drive, "seed": change.seed, "library": decks.controller(package), "log": "effects.bin",
    }  # fmt: skip
    (home / "effects.txt").write_text("".join(f"{k} {v}\n" for k, v in told.items()), encoding="utf-8")


def _waves(files: Mapping[str, str], seed: int) -> list[decks.Setting]:
    """Return the seed of a run's waves, another one than that of any other run."""
    return [("sea", "WaveSeed(1)", 7919 * seed)] if "sea" in files else []


def _blow(
    kit: ModuleType, deck: decks.Deck, home: Path, change: Change, programs: str, seconds: float
) -> list[decks.Setting]:  # fmt: skip
    """Write the wind, the same over the disc (u) or a full field (f); returns the settings that name it."""
    speed = float(change.wind[1:])
    if change.wind[0] == "u":
        kit.uniform_wind(str(home / "wind.wnd"), speed, 10.0, change.shear, seconds, change.seed)
        return [("inflow", "WindType", 2), ("inflow", "Filename_Uni", f'"{home / "wind.wnd"}"')]
    decks.full_field(kit, deck, home, programs, (speed, seconds), change.seed)
    return [("inflow", "WindType", 3), ("inflow", "FileName_BTS", f'"{home / "wind.bts"}"')]


def _write(target: Path, kit: ModuleType, written: Path, log: Path, first: int) -> None:
    """Write the channels of the corpus from the row after the settling on. Raises ValueError where they are not
    numbers."""
    t, said = kit.read_outb(str(written))
    channels = {k.lower(): v for k, v in said.items()}
    rows = np.fromfile(log).reshape(-1, 8)
    columns = {"time_s": t - t[first]}
    for k, name in enumerate(_LOG, start=1):
        scale = 1 / TURN if name.startswith("pitch") else 1e-3
        columns[name] = scale * np.interp(t, rows[:, 0], rows[:, k])
    columns |= {name: channels[k.lower()] for name, k in _CHANNELS.items()}
    table = np.column_stack(list(columns.values()))[first:]
    if not np.isfinite(table).all():
        raise ValueError(f"{written}: values that are not numbers")
    np.savetxt(target, table, fmt="%.6g", delimiter=",", header=",".join(columns), comments="")


def write_cases(folder: Path, of: str) -> int:
    """Write every case of a set whose runs are there; returns how many cases are."""
    (folder / PART).mkdir(exist_ok=True)
    (folder / "scratch").mkdir(exist_ok=True)
    there = 0
    for turbine, pair in all_pairs(of):
        if not all((folder / "runs" / n).is_dir() for n in (pair.recording, pair.simulation)):
            continue
        deck = decks.DECKS[turbine]
        for outputs in making.OUTPUTS:
            there += 1
            if not (folder / PART / making.case_name(pair, outputs)).is_dir():
                making.write_case(folder, pair, outputs, PART, (deck.title, deck.rated_rad_s, deck.ratio))
    return there
