"""Turbines beside the simulator's own: decks that the ROSCO package brings, as OpenFAST 5.0 reads them.

The package comes from the package index (`pip download rosco`), Apache 2.0; nothing of it is kept in the repository.
The 15 MW turbine stands on a fixed base, on its monopile in waves, or floats; the floater's moorings are those of
MAP++, and loads of the waves on the monopile are formed every 5 m, or a run would take ten times as long.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

PACKAGE = "rosco==2.10.6"
_DECKS, _LIBRARIES = "Examples/Test_Cases/", ("rosco/lib/", "rosco.libs/")
_CONTROLLER = Path("rosco/lib/libdiscon.so")
_STEP_S = 0.01
_SECTIONS = 2  # every second blade section of the aerodynamics: half the time, the same loads within 0.1 %
Change = Callable[[str, str, object], None]  # file, key, value: the simulator's script has it
Setting = tuple[str, str, object]  # file of the deck, key, value


@dataclass(frozen=True)
class Deck:
    """Describe a turbine.

    folder: of the package's test cases; main: its folder with the .fst file; files: names from there by what they hold
    (main, elastic, servo, aero, inflow, controller, tower, blade, sections; sea and water of those that stand in it);
    torque_N_m: size of the test signal; hub_m, disc_m: height of the hub, side of the grid of full-field wind;
    pitch_deg: to start with, by wind in m/s; settle_s: time that is not kept, for a floater finds its place slowly.
    """

    title: str
    folder: str
    main: str
    files: Mapping[str, str]
    hub_m: float
    disc_m: float
    torque_N_m: float
    rated_rad_s: float
    speed_rpm: float
    ratio: float
    pitch_deg: Mapping[int, float]
    settings: tuple[Setting, ...] = ()
    settle_s: float = 100.0


_FIXED = ("PtfmSgDOF", "PtfmSwDOF", "PtfmHvDOF", "PtfmRDOF", "PtfmPDOF", "PtfmYDOF", "YawDOF")
_ON = ("TwFADOF1", "TwFADOF2", "TwSSDOF1", "TwSSDOF2", "DrTrDOF")


def _names(stem: str, shared: str, controller: str) -> dict[str, str]:
    return {
        "main": f"{stem}.fst", "elastic": f"{stem}_ElastoDyn.dat", "servo": f"{stem}_ServoDyn.dat",
        "aero": f"{stem}_AeroDyn15.dat", "inflow": f"{shared}_InflowFile.dat", "controller": controller,
        "tower": f"{stem}_ElastoDyn_tower.dat", "blade": f"{shared}_ElastoDyn_blade.dat",
        "sections": f"{shared}_AeroDyn15_blade.dat",
    }  # fmt: skip


def _in_the_sea(stem: str) -> dict[str, str]:
    shared = "../IEA-15-240-RWT/IEA-15-240-RWT"
    return _names(stem, shared, f"{stem}_DISCON.IN") | {"sea": f"{stem}_SeaState.dat", "water": f"{stem}_HydroDyn.dat"}


_NEWER = (  # file, key, line after it: what OpenFAST 5.0 reads and the monopile's deck has not yet
    ("sea", "WaveStMod", "0 WvCrntMod"), ("water", "PtfmCOByt", "0 NAddDOF"), ("water", "AMMod", "1 HstMod"),
)  # fmt: skip
_PITCH_15 = {12: 7.5, 14: 10.5, 16: 13.0, 18: 15.3, 20: 17.4}
_WAVES: tuple[Setting, ...] = (  # and coupled tightly: loosely, water and tower part after 40 s
    ("main", "ModCoupling", 3), ("main", "RhoInf", 0.9), ("main", "ConvTol", 1e-3), ("main", "MaxConvIter", 12),
    ("main", "DT_UJac", 2.0),
    ("sea", "WaveTMax", 900), ("sea", "WaveHs", 3.0), ("sea", "WaveTp", 9.0), ("sea", "WvDiffQTF", "False"),
    ("sea", "WvSumQTF", "False"),
)  # fmt: skip
DECKS = {
    "iea15": Deck(
        "15 MW turbine, direct drive", "IEA-15-240-RWT", "IEA-15-240-RWT-Monopile",
        _names("IEA-15-240-RWT-Monopile", "../IEA-15-240-RWT/IEA-15-240-RWT", "IEA-15-240-RWT-Monopile_DISCON.IN"),
        150.0, 280.0, 3.5e5, 0.79168, 7.56, 1.0, _PITCH_15,
        (("main", "CompSub", 0), ("main", "CompHydro", 0), ("main", "CompSeaSt", 0),
         *(("elastic", k, "False") for k in _FIXED)),
    ),
    "pile15": Deck(
        "15 MW turbine on a monopile in the sea", "IEA-15-240-RWT", "IEA-15-240-RWT-Monopile",
        _in_the_sea("IEA-15-240-RWT-Monopile"), 150.0, 280.0, 3.5e5, 0.79168, 7.56, 1.0, _PITCH_15,
        (("main", "CompSub", 1), ("main", "CompHydro", 1), ("main", "CompSeaSt", 1), *_WAVES),
    ),
    "float15": Deck(
        "15 MW turbine on a floater", "IEA-15-240-RWT", "IEA-15-240-RWT-UMaineSemi",
        _in_the_sea("IEA-15-240-RWT-UMaineSemi"), 150.0, 280.0, 3.5e5, 0.79168, 7.56, 1.0, _PITCH_15,
        (("main", "CompMooring", 1), ("main", "MooringFile", '"IEA-15-240-RWT-UMaineSemi_MAP.dat"'),
         ("elastic", "PtfmSurge", 12.0), ("elastic", "PtfmPitch", 2.6), *_WAVES),
        settle_s=300.0,
    ),
    "nrel28": Deck(
        "2.8 MW turbine", "NREL_2p8_127", ".", _names("NREL-2p8-127", "NREL-2p8-127", "NREL-2p8-127_DISCON.IN"),
        87.6, 145.0, 600.0, 1.267, 12.1, 97.0, {12: 6.0, 14: 10.0, 16: 13.0, 18: 15.5, 20: 17.5},
        tuple(("elastic", k, "True") for k in _ON),
    ),
    "bar": Deck(
        "5 MW turbine with slender blades", "BAR_10", ".", _names("BAR_10", "BAR_10", "BAR_10_DISCON.IN"),
        140.0, 240.0, 1400.0, 0.825, 7.88, 96.76, {12: 9.9, 14: 12.8, 16: 15.4, 18: 17.8, 20: 20.0},
        (("main", "CompElast", 1),),
    ),
}  # fmt: skip


def fetch(folder: Path) -> Path:
    """Bring the package's decks and controller into a folder, once; returns it."""
    if (folder / _CONTROLLER).is_file():
        return folder
    command = [sys.executable, "-m", "pip", "download", PACKAGE, "--no-deps", "--only-binary", ":all:", "--quiet"]
    subprocess.run([*command, "--dest", str(folder / "package")], check=True)
    wheel = next((folder / "package").glob("*.whl"))
    with zipfile.ZipFile(wheel) as packed:
        for name in packed.namelist():
            if name.startswith((_DECKS, *_LIBRARIES)):
                packed.extract(name, folder)
    return folder


def controller(folder: Path) -> Path:
    """Return the controller's library of a folder that `fetch` filled."""
    return (folder / _CONTROLLER).resolve()


def lay(deck: Deck, package: Path, work: Path, change: Change) -> dict[str, str]:
    """Copy a deck into a working folder, ready for runs; returns its files by what they hold.

    No individual pitch control and no flaps, as the wrapper gives all blades one angle; half of the blades' sections;
    one point of wind at the hub; the channels of the corpus as outputs.
    """
    shutil.copytree(package / _DECKS / deck.folder, work, dirs_exist_ok=True)
    files = {k: os.path.normpath(work / deck.main / v) for k, v in deck.files.items()}
    _rewrite(files["controller"], r"(?m)^\s*\d+(\s*! (?:IPC_ControlMode|Flp_Mode))", r"0\1")
    _thin(files["sections"])
    for key, before, line in _NEWER:
        if key in files:
            _insert(files[key], before, line)
    if "water" in files:  # loads of the waves every 5 m of a member
        _rewrite(files["water"], r"(?m)^((?:\s+\d+){7}\s+)0\.5000(?=\s)", r"\g<1>5.0")
    _outputs(files["elastic"], ("GenSpeed", "Azimuth", "BldPitch1", "YawBrTAxp", "YawBrTAyp", "RootMyb1", "RootMyb2",
                                "RootMyb3"))  # fmt: skip
    for key, names in (("servo", "GenTq"), ("inflow", "Wind1VelX"), ("aero", "RtAeroFxh")):
        _outputs(files[key], (names,))
    settings: list[Setting] = [
        ("main", "DT", _STEP_S), ("main", "OutFileFmt", 2), ("main", "SttsTime", 100), ("aero", "NBlOuts", 0),
        ("servo", "PCMode", 5), ("servo", "VSContrl", 5), ("servo", "DLL_DT", '"default"'),
        ("servo", "DLL_InFile", f'"{deck.files["controller"]}"'), ("elastic", "RotSpeed", deck.speed_rpm),
        ("inflow", "PropagationDir", 0), ("inflow", "NWindVel", 1), ("inflow", "WindVxiList", 0),
        ("inflow", "WindVyiList", 0), ("inflow", "WindVziList", deck.hub_m), ("inflow", "RefHt_Uni", deck.hub_m),
        ("inflow", "RefLength", 2 * deck.hub_m), *deck.settings,
    ]  # fmt: skip
    for key, name, value in settings:
        change(files[key], name, value)
    return files


def full_field(kit: ModuleType, deck: Deck, home: Path, programs: str, wind: tuple[float, float], seed: int) -> None:
    """Write wind.bts into a folder: turbulence of 10 % over the deck's disc; wind: mean in m/s, seconds.

    The simulator's script writes the input of its own turbine first; heights and sides are changed in that.
    """
    speed, seconds = wind
    kit.full_field(programs, str(home), speed, 10.0, 0.14, 10.0, seed)
    (home / "wind.bts").unlink()
    for key, value in (("HubHt", deck.hub_m), ("RefHt", deck.hub_m), ("GridHeight", deck.disc_m),
                       ("GridWidth", deck.disc_m), ("AnalysisTime", seconds)):  # fmt: skip
        kit.change(str(home / "wind.inp"), key, value)
    subprocess.run([f"{programs}/turbsim", "wind.inp"], cwd=home, check=True, capture_output=True)
    if not (home / "wind.bts").is_file():
        raise ValueError(f"{home}: the program for turbulent wind wrote no wind.bts")


def heavier(deck: Deck, files: Mapping[str, str], factor: float, change: Change) -> None:
    """Give the second blade another mass."""
    blade = Path(files["main"]).parent / "blade_2.dat"
    shutil.copy(files["blade"], blade)
    found = re.search(r"(?m)^\s*(\S+)\s+AdjBlMs\b", blade.read_text(encoding="utf-8", errors="replace"))
    if found is None:
        raise ValueError(f"{deck.title}: its blade has no AdjBlMs")
    change(str(blade), "AdjBlMs", float(found[1]) * factor)
    _rewrite(files["elastic"], r'(?m)^"[^"]*"(\s+BldFile\(?2\)?\s)', r'"blade_2.dat"\1')


def twisted(files: Mapping[str, str], angle_deg: float) -> None:
    """Twist the second blade's sections by an angle, as a blade that is pitched otherwise: controllers that move all
    blades as one take no angle of a single one."""
    blade = Path(files["main"]).parent / "sections_2.dat"
    lines = Path(files["sections"]).read_text(encoding="utf-8", errors="replace").split("\n")
    head = next(k for k, line in enumerate(lines) if "BlTwist" in line)
    column = lines[head].split().index("BlTwist")
    for k in range(head + 2, head + 2 + int(lines[head - 1].split()[0])):
        words = lines[k].split()
        words[column] = f"{float(words[column]) + angle_deg:.9e}"
        lines[k] = " ".join(words)
    blade.write_text("\n".join(lines), encoding="utf-8")
    _rewrite(files["aero"], r'(?m)^"[^"]*"(\s+ADBlFile\(2\))', rf'"{blade.name}"\1')


def _rewrite(path: str, pattern: str, by: str) -> None:
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    Path(path).write_text(re.sub(pattern, by, text), encoding="utf-8")


def _insert(path: str, after: str, line: str) -> None:
    """Write a line after that of a key, where the file does not have its key yet."""
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    if not re.search(rf"(?m)^\s*\S+\s+{line.split()[1]}\b", text):
        Path(path).write_text(re.sub(rf"(?m)^(\s*\S+\s+{after}\b.*)$", rf"\1\n{line}", text), encoding="utf-8")


def _thin(path: str) -> None:
    lines = Path(path).read_text(encoding="utf-8", errors="replace").split("\n")
    head = next(k for k, line in enumerate(lines) if "NumBlNds" in line)
    count = int(lines[head].split()[0])
    rows = lines[head + 3 : head + 3 + count]
    kept = [rows[k] for k in sorted({*range(0, count, _SECTIONS), count - 1})]
    lines[head] = f"{len(kept)} NumBlNds"
    Path(path).write_text("\n".join([*lines[: head + 3], *kept, *lines[head + 3 + count :]]), encoding="utf-8")


def _outputs(path: str, names: tuple[str, ...]) -> None:
    lines = Path(path).read_text(encoding="utf-8", errors="replace").split("\n")
    first = next(k for k, line in enumerate(lines) if re.match(r"\s*OutList\b", line))
    last = next(k for k in range(first, len(lines)) if lines[k].lstrip().upper().startswith("END"))
    lines[first + 1 : last] = [f'"{n}"' for n in names]
    Path(path).write_text("\n".join(lines), encoding="utf-8")
