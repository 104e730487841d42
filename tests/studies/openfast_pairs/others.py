"""Runs and pairs of other turbines: a source of cases on which nothing of the diagnosis was made.

Every effect is one run of 500 s at 16 m/s, the wind the same over the disc; two runs of each turbine as it is are the
other sides. Sizes are those that are plain on the corpus' turbine. Where the name of a truth is open, as in the corpus.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from openfast_pairs import decks, making
from openfast_pairs.design import Pair
from openfast_pairs.effects import EFFECTS, Values

SECONDS, WIND, PART = 500.0, 16.0, "others"
_PLAIN = {"iea15": {"n1": 11, "n2": 12}, "nrel28": {"n1": 21, "n2": 22}}  # seeds of runs of the turbine as it is
_CHANNELS = {
    "generator_speed": "GenSpeed", "tower_acc_fore_aft": "YawBrTAxp", "tower_acc_side_side": "YawBrTAyp",
    "flap_moment_1": "RootMyb1", "flap_moment_2": "RootMyb2", "flap_moment_3": "RootMyb3",
    "nacelle_wind": "Wind1VelX", "azimuth": "Azimuth", "blade_angle_1": "BldPitch1",
}  # fmt: skip
_LOG = ("pitch_demand", "torque_demand", "pitch_excitation", "torque_excitation")  # columns 1 to 4 of the wrapper's log


@dataclass(frozen=True)
class Change:
    """Describe what a run has that the turbine as it is has not.

    drive: settings of the controller's wrapper; settings: file of the deck, key, value; heavy: factor on the mass of
    the second blade; shear: exponent of the wind's profile; values: true ones, as a diagnosis names them.
    """

    effect: str
    seed: int
    drive: Mapping[str, float] = field(default_factory=dict)
    settings: tuple[decks.Setting, ...] = ()
    heavy: float | None = None
    shear: float = 0.14
    values: Values = field(default_factory=dict)


def _off(effect: str, seed: int, *modes: str) -> Change:
    return Change(effect, seed, settings=tuple(("elastic", m, "False") for m in modes))


_TURN = math.pi / 180
CHANGES: dict[str, tuple[Change, ...]] = {
    "iea15": (
        Change("unsteady", 13, settings=(("aero", "UA_Mod", 0),)), _off("mode_flap", 14, "FlapDOF1"),
        Change("inflow", 15, settings=(("aero", "DBEMT_Mod", 0),)),
        Change("lag", 16, {"lag": 0.3}, values={"tau_s": (0.3, "s")}), _off("mode_tower", 17, "TwFADOF1"),
        Change("imbalance_mass", 18, heavy=1.02),
        Change("density", 19, settings=(("main", "AirDens", 1.127),),
               values={"factor": (0.92, "1"), "density_change": (-0.08, "1")}),
        Change("backlash", 20, {"backlash": 0.3 * _TURN}, values={"width": (0.3, "deg")}),
        Change("yaw", 31, settings=(("inflow", "PropagationDir", 10),)),
        Change("stiffness_tower", 33, settings=(("tower", "AdjFASt", 0.85),)),
    ),
    "nrel28": (
        Change("unsteady", 23, settings=(("aero", "UA_Mod", 0),)), _off("mode_flap", 24, "FlapDOF1"),
        Change("inflow", 25, settings=(("aero", "DBEMT_Mod", 0),)), _off("mode_shaft", 26, "DrTrDOF"),
        Change("shear", 27, shear=0.28),
        Change("second_order", 28, {"w2": 5.0, "z2": 0.7}, values={"omega_rad_s": (5.0, "rad/s"), "zeta": (0.7, "1")}),
        Change("imbalance_aero", 29, {"off1": 0.8 * _TURN}, values={"offset": (0.8, "deg")}),
        Change("mass", 30, settings=(("elastic", "NacMass", 147_533),)),
        Change("delay", 32, {"delay": 0.2}, values={"delay_s": (0.2, "s")}), _off("mode_edge", 34, "EdgeDOF"),
    ),
}  # fmt: skip
_KNOWN = {e.key: e for e in EFFECTS}


def all_runs() -> list[tuple[str, str, Change]]:
    """Return turbine, name and change of every run, those that most pairs need first."""
    plain = [(t, f"{t}-{n}", Change("null", seed)) for t, of in _PLAIN.items() for n, seed in of.items()]
    return plain + [(t, f"{t}-{c.effect}", c) for t, made in CHANGES.items() for c in made]


def all_pairs() -> list[tuple[str, Pair]]:
    """Return turbine and pair: two nulls of each, and its effects on the side that has them."""
    found = []
    for turbine, made in CHANGES.items():
        plain = [f"{turbine}-{n}" for n in _PLAIN[turbine]]
        for a, b in ((0, 1), (1, 0)):
            name = f"{turbine}-null-{a + 1}x{b + 1}"
            found.append((turbine, Pair(name, "null", "null", "u16", plain[a], plain[b], SECONDS)))
        for change in made:
            found.append((turbine, _pair(turbine, change)))
    return found


def _pair(turbine: str, change: Change) -> Pair:
    known, own = _KNOWN[change.effect], f"{turbine}-{change.effect}"
    sides = (f"{turbine}-n1", own) if known.simulated else (own, f"{turbine}-n1")
    return Pair(own, change.effect, "large", "u16", *sides, SECONDS, known.ids, known.accepted, known.families,
                known.place, change.values)  # fmt: skip


def make(folder: Path, kit: ModuleType, say: Callable[[str], None]) -> bool:
    """Make what is missing of runs and cases, one run after the other; returns whether all is there."""
    with making.alone(folder):
        package = decks.fetch(folder / "decks")
        for turbine, name, change in all_runs():
            if not (folder / "runs" / name).is_dir():
                wrong = _one(folder, kit, package, decks.DECKS[turbine], name, change)
                say(f"{name}: {wrong or 'made'}")
        there = write_cases(folder)
        say(f"{folder}: {there} of {2 * len(all_pairs())} cases")
    return there == 2 * len(all_pairs())


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
        _write(made / "run.csv.gz", kit, written, home / "effects.bin")
        (made / "run.json").write_text(json.dumps({"name": name, "package": decks.PACKAGE}) + "\n", encoding="utf-8")
        made.rename(folder / "runs" / name)
    return ""


def _set(
    kit: ModuleType, deck: decks.Deck, files: Mapping[str, str], change: Change, programs: str, package: Path
) -> None:  # fmt: skip
    """Write wind, controller's wrapper and what is changed into the deck."""
    home, total = Path(files["main"]).parent, SECONDS + kit.SETTLE
    kit.uniform_wind(str(home / "wind.wnd"), WIND, 10.0, change.shear, total + 30, change.seed)
    angle = deck.pitch_deg[round(WIND)]
    settings: list[decks.Setting] = [
        ("inflow", "WindType", 2), ("inflow", "Filename_Uni", f'"{home / "wind.wnd"}"'), ("main", "TMax", total),
        ("main", "DT_Out", kit.STEP), ("servo", "DLL_FileName", f'"{programs}/libeffects.so"'),
        *(("elastic", f"BlPitch({b})", angle) for b in (1, 2, 3)), *change.settings,
    ]  # fmt: skip
    for key, parameter, value in settings:
        kit.change(files[key], parameter, value)
    if change.heavy is not None:
        decks.heavier(deck, files, change.heavy, kit.change)
    told: dict[str, Any] = {
        "amp_pitch": 0.5 * _TURN, "hold_pitch": 0.7, "amp_torque": deck.torque_N_m, "hold_torque": 0.4, "start": 5,
        **change.drive, "seed": change.seed, "library": decks.controller(package), "log": "effects.bin",
    }  # fmt: skip
    (home / "effects.txt").write_text("".join(f"{k} {v}\n" for k, v in told.items()), encoding="utf-8")


def _write(target: Path, kit: ModuleType, written: Path, log: Path) -> None:
    """Write the channels of the corpus after the settling. Raises ValueError where they are not numbers."""
    t, said = kit.read_outb(str(written))
    channels = {k.lower(): v for k, v in said.items()}
    rows = np.fromfile(log).reshape(-1, 8)
    first = round(kit.SETTLE / kit.STEP)
    columns = {"time_s": t - t[first]}
    for k, name in enumerate(_LOG, start=1):
        scale = 1 / _TURN if name.startswith("pitch") else 1e-3
        columns[name] = scale * np.interp(t, rows[:, 0], rows[:, k])
    columns |= {name: channels[k.lower()] for name, k in _CHANNELS.items()}
    table = np.column_stack(list(columns.values()))[first:]
    if not np.isfinite(table).all():
        raise ValueError(f"{written}: values that are not numbers")
    np.savetxt(target, table, fmt="%.6g", delimiter=",", header=",".join(columns), comments="")


def write_cases(folder: Path) -> int:
    """Write every case whose runs are there; returns how many cases are."""
    (folder / PART).mkdir(exist_ok=True)
    (folder / "scratch").mkdir(exist_ok=True)
    there = 0
    for turbine, pair in all_pairs():
        if not all((folder / "runs" / n).is_dir() for n in (pair.recording, pair.simulation)):
            continue
        deck = decks.DECKS[turbine]
        for outputs in making.OUTPUTS:
            there += 1
            if not (folder / PART / making.case_name(pair, outputs)).is_dir():
                making.write_case(folder, pair, outputs, PART, (deck.title, deck.rated_rad_s, deck.ratio))
    return there
