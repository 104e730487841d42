"""Hold a Campbell diagram of OpenFAST runs against the simulator's own linearisation.

    python tests/studies/campbell_openfast.py linearise FOLDER --wind 15 --rpm 12.1 --pitch 10.45 --torque 43093.55
    python tests/studies/campbell_openfast.py modes FOLDER
    python tests/studies/campbell_openfast.py hold CAMPBELL.json FOLDER FOLDER …

`linearise` lets the NREL 5 MW turbine of ../shared/openfast come to its periodic steady state at one wind without
controller (constant torque, in N m on the generator; the pitch is trimmed to the rotor's speed) and with a frozen wake,
and keeps its .lin files of several azimuths; some ten minutes of a core. Lift comes late as in the simulated turbine,
by the model that has a linear form (UA_Mod 4), or at once (--airfoils steady). `modes` brings the states
of the blades into the frame that does not turn, averages over the azimuths and lists the modes: with x = T(ψ) z and
x' = A x, z' = T⁻¹(A T − Ω dT/dψ) z (Bir 2008). `hold` compares, each recording with the linearisation of its wind.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from aeolid.models.exchange.openfast import read_lin
from aeolid.models.multiblade import blade_angles

SIMULATOR = Path(__file__).resolve().parents[2].parent / "shared" / "openfast"
AIRFOILS = {"unsteady": 4, "steady": 0}  # UA_Mod
AZIMUTHS, GAIN = 6, 2e-4  # of the trim; a larger one runs away below 15 m/s
Modes = list[tuple[float, float, str]]  # Hz, damping, what moves most


def load_kit(folder: Path) -> ModuleType:
    """Return the simulator's run.py as a module."""
    spec = importlib.util.spec_from_file_location("openfast_kit", folder / "run.py")
    assert spec is not None and spec.loader is not None
    kit = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(kit)
    return kit


def linearise(out: Path, wind: float, rpm: float, pitch: float, torque: float, airfoils: str) -> None:
    """Run one linearisation; the .lin files are in `out`."""
    kit = load_kit(SIMULATOR)
    programs = kit.prepare()
    work = Path(tempfile.mkdtemp(prefix="openfast-linearise-"))
    shutil.copytree(SIMULATOR / "deck", work, dirs_exist_ok=True)
    for path in work.rglob("*"):
        path.chmod(path.stat().st_mode | 0o200)
    settings: dict[str, dict[str, Any]] = {
        "turbine.fst": {"TMax": 2000, "DT": 0.0125, "OutFileFmt": 2, "Echo": "False", "SumPrint": "False",
                        "Linearize": "True", "CalcSteady": "True", "TrimCase": 3, "TrimGain": GAIN,
                        "NLinTimes": AZIMUTHS, "LinInputs": 0},
        "InflowWind.dat": {"WindType": 1, "HWindSpeed": wind, "PLexp": 0.0},
        "ElastoDyn.dat": {**{f"BlPitch({b})": pitch for b in (1, 2, 3)}, "RotSpeed": rpm, "OoPDefl": 4.0,
                          "TTDspFA": 0.35},
        "ServoDyn.dat": {"PCMode": 0, "VSContrl": 1, "VS_RtGnSp": 1.0, "VS_RtTq": torque, "VS_Rgn2K": 1e-3,
                         "VS_SlPc": 1.0, "HSSBrMode": 0, "YCMode": 0},
        "AeroDyn.dat": {"UA_Mod": AIRFOILS[airfoils], "DBEMT_Mod": -1},
    }  # fmt: skip
    for name, values in settings.items():
        for key, value in values.items():
            kit.change(str(work / name), key, value)
    environment = {**os.environ, "LD_LIBRARY_PATH": programs, "OMP_NUM_THREADS": "1"}
    subprocess.run([f"{programs}/openfast", "turbine.fst"], cwd=work, env=environment, check=True, capture_output=True)
    out.mkdir(parents=True, exist_ok=True)
    for path in work.glob("*.lin"):
        shutil.copy(path, out)
    shutil.rmtree(work)


def modes_of(folder: Path) -> tuple[float, float, Modes]:
    """Return wind in m/s, rotor speed in Hz, and the modes averaged over the azimuths, by frequency."""
    files = [read_lin(p) for p in sorted(folder.glob("*.lin"))]
    names = [re.sub(r"\(internal.*", "", s.name).strip() for s in files[0].model.states]
    sets = [
        [names.index(name.replace("blade 1", f"blade {b}")) for b in (1, 2, 3)] for name in names if "blade 1" in name
    ]  # fmt: skip
    total = np.zeros((len(names), len(names)))
    for lin in files:
        psi = blade_angles(np.array([lin.azimuth_rad]), 3)[0]
        T, turning = np.eye(len(names)), np.zeros((len(names), len(names)))
        for places in sets:
            T[np.ix_(places, places)] = np.column_stack([np.ones(3), np.cos(psi), np.sin(psi)])
            turning[np.ix_(places, places)] = np.column_stack([np.zeros(3), -np.sin(psi), np.cos(psi)])
        total += np.linalg.solve(T, lin.model.A @ T - lin.rotor_speed_rad_s * turning) / len(files)
    values, vectors = np.linalg.eig(total)
    found = [
        (float(abs(s) / (2 * np.pi)), float(-s.real / abs(s)), names[int(np.argmax(abs(v)))])
        for s, v in zip(values, vectors.T, strict=True) if s.imag > 1e-3
    ]  # fmt: skip
    return files[0].wind_speed_m_s, files[0].rotor_speed_rad_s / (2 * np.pi), sorted(found)


def hold(facts: dict[str, Any], folders: list[Path]) -> list[str]:
    """Return a line for each mode of each recording whose wind was linearised: both frequencies and dampings."""
    known = [modes_of(folder) for folder in folders]
    lines = []
    for k, run in enumerate(facts["runs"]):
        wind, _, reference = min(known, key=lambda m: abs(m[0] - run["wind_m_s"]))
        for track in facts["tracks"]:
            mode = track["modes"][k]
            if mode is None or abs(wind - run["wind_m_s"]) > 0.5:
                continue
            hertz, damping = _nearest(mode, reference)
            lines.append(
                f"{run['wind_m_s']:5.1f} m/s  {track['name']:26s} {mode['frequency_hz']:.4f} ± "
                f"{mode['frequency_std_hz']:.4f} Hz, linearised {hertz:.4f} ({mode['frequency_hz'] / hertz - 1:+.1%}); "
                f"damping {mode['damping']:.2%} ± {mode['damping_std']:.2%}, {damping:.2%}"
            )
    return lines


def _nearest(mode: dict[str, Any], reference: Modes) -> tuple[float, float]:
    """Return the mode of the linearisation that is nearest in frequency and damping among those that swing."""
    swinging = [(f, d) for f, d, _ in reference if d < 0.3]
    return min(swinging, key=lambda m: abs(m[0] / mode["frequency_hz"] - 1) + abs(m[1] - mode["damping"]))


def main(arguments: list[str] | None = None) -> int:
    """Run one part of the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = parser.add_subparsers(dest="part", required=True)
    one = parts.add_parser("linearise")
    one.add_argument("folder", type=Path)
    for name in ("--wind", "--rpm", "--pitch", "--torque"):
        one.add_argument(name, type=float, required=True)
    one.add_argument("--airfoils", choices=AIRFOILS, default="unsteady")
    parts.add_parser("modes").add_argument("folder", type=Path)
    held = parts.add_parser("hold")
    held.add_argument("campbell", type=Path)
    held.add_argument("folders", type=Path, nargs="+")
    options = parser.parse_args(arguments)
    if options.part == "linearise":
        if not (SIMULATOR / "run.py").is_file():
            print(f"{SIMULATOR}: no simulator here", file=sys.stderr)
            return 2
        linearise(options.folder, options.wind, options.rpm, options.pitch, options.torque, options.airfoils)
    elif options.part == "modes":
        wind, rotor, found = modes_of(options.folder)
        print(f"{wind:g} m/s, rotor {rotor:.4f} Hz")
        print("\n".join(f"{f:8.4f} Hz {d:8.2%}  {name}" for f, d, name in found))
    else:
        print("\n".join(hold(json.loads(options.campbell.read_text(encoding="utf-8")), options.folders)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
