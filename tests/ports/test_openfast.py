"""The wrapper inside OpenFAST with ROSCO behind it, by the commands of docs/howto/openfast_controller.md.

Programs and turbine come from ../shared/openfast; where that is absent the tests are skipped.
"""

from __future__ import annotations

import importlib.util
import json
import math
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from aeolid.formats import read_table

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "openfast"
PAGE = (ROOT / "docs/howto/openfast_controller.md").read_text(encoding="utf-8")
STEP_S, QUIET_S, EXCITED_S = 0.0125, 20.0, 120.0
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (SHARED / "run.py").exists(), reason="../shared/openfast is absent"),
    pytest.mark.skipif(not shutil.which("cmake") or not shutil.which("cc"), reason="no cmake or no C compiler"),
]


def cut(language: str, starts: str) -> list[str]:
    """Return the page's blocks of a language that begin so."""
    found = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.S | re.M)
    return [block for block in found if block.startswith(starts)]


SETTINGS, ROLES = cut("ini", "# libaeolid_discon.cfg")[0], cut("toml", "# outb.toml")[0]
BUILD, RUN, LISTEN, COMPARE = (cut("sh", s)[0] for s in ("cmake", "sed", "aeolid listen", "aeolid identify turbine"))
WITHOUT_EXCITATION = SETTINGS[: SETTINGS.index("[pitch excitation]")]


@pytest.fixture(scope="module")
def kit() -> ModuleType:
    """Return the kit's own script, which unpacks the programs, changes input files and makes wind."""
    spec = importlib.util.spec_from_file_location("openfast_kit", SHARED / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def simulation(kit: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a maker of folders as the page has them: the turbine at 18 m/s, ROSCO, 10 % turbulence."""
    programs = Path(kit.prepare())

    def make(name: str, seconds: float, output_step_s: float, seed: int = 1) -> Path:
        folder = tmp_path_factory.mktemp(name)
        shutil.copytree(SHARED / "deck", folder, dirs_exist_ok=True)
        for path in folder.rglob("*"):
            path.chmod(0o755)
        for library in programs.glob("lib*.so*"):
            shutil.copy(library, folder)
        kit.uniform_wind(str(folder / "wind.wnd"), 18.0, 10.0, 0.14, seconds + 30, seed)
        changes: list[tuple[str, str, Any]] = [
            ("turbine.fst", "TMax", seconds), ("turbine.fst", "DT", STEP_S), ("turbine.fst", "DT_Out", output_step_s),
            ("turbine.fst", "OutFileFmt", 4), ("turbine.fst", "Echo", "False"), ("turbine.fst", "SumPrint", "False"),
            ("InflowWind.dat", "WindType", 2), ("InflowWind.dat", "Filename_Uni", '"wind.wnd"'),
            ("ServoDyn.dat", "DLL_FileName", '"./libdiscon.so"'),
        ]  # fmt: skip
        changes += [("ElastoDyn.dat", f"BlPitch({b})", 14.9) for b in (1, 2, 3)]
        for file, key, value in changes:
            kit.change(str(folder / file), key, value)
        return folder

    return make


def shell(text: str, folder: Path, programs: Path) -> subprocess.CompletedProcess[str]:
    """Run a block of the page."""
    tools = f"{Path(sys.executable).parent}:{programs}:{os.environ['PATH']}"
    own = {"AEOLID": str(ROOT), "PATH": tools, "LD_LIBRARY_PATH": str(folder), "OMP_NUM_THREADS": "1", "COLUMNS": "200"}
    done = subprocess.run(
        ["sh", "-euc", text],
        cwd=folder,
        env=os.environ | own,
        capture_output=True,
        text=True,
        timeout=3600,
        check=False,
    )
    assert done.returncode == 0, f"{text}\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done


@pytest.fixture(scope="module")
def wrapper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wrapper as the page says."""
    folder = tmp_path_factory.mktemp("build")
    shell(BUILD, folder, folder)
    return folder / "libaeolid_discon.so"


def test_without_excitation_every_output_is_that_of_the_controller_alone(
    kit: ModuleType, simulation: Callable[..., Path], wrapper: Path
) -> None:
    """All channels of OpenFAST, doubles, at every step."""
    programs = Path(kit.prepare())
    alone, wrapped = (simulation(name, QUIET_S, STEP_S) for name in ("alone", "wrapped"))
    shell("openfast turbine.fst", alone, programs)
    shutil.copy(wrapper, wrapped)
    (wrapped / "libaeolid_discon.cfg").write_text(WITHOUT_EXCITATION)
    said = shell(RUN, wrapped, programs)
    assert f": end: {QUIET_S / (4 * STEP_S) + 1:.0f} samples filtered, 0 refused" in said.stdout
    a, b = (read_table(folder / "turbine.outb") for folder in (alone, wrapped))
    assert a.names == b.names and len(a.names) > 20 and a.samples == round(QUIET_S / STEP_S) + 1
    for name in a.names:
        np.testing.assert_array_equal(a.columns[name], b.columns[name], err_msg=name)
    assert np.ptp(b.columns["BldPitch1"]) > 0.1  # the controller acted


def nearest(facts: dict[str, Any], frequency_hz: float, most_damping: float) -> dict[str, Any]:
    """Return the mode next to a frequency."""
    modes = [m for m in facts["modes"] if abs(m["damping"]) < most_damping]
    mode: dict[str, Any] = min(modes, key=lambda m: abs(m["frequency_hz"] - frequency_hz))
    return mode


@pytest.mark.nightly  # a minute of a simulator
def test_stream_and_simulators_output_have_the_same_modes(
    kit: ModuleType, simulation: Callable[..., Path], wrapper: Path
) -> None:
    """Tower (0.33 Hz) and drive train (1.7 Hz) through the bus and from the .outb, within three deviations."""
    programs = Path(kit.prepare())
    folder = simulation("excited", EXCITED_S, 4 * STEP_S)
    shutil.copy(wrapper, folder)
    (folder / "libaeolid_discon.cfg").write_text(SETTINGS)
    (folder / "outb.toml").write_text(ROLES)
    said = shell(RUN, folder, programs)
    assert said.stdout.count("aeolid-discon: turbine 1: ") == 2, said.stdout
    assert "aeolid-discon" not in said.stderr, said.stderr
    heard = shell(LISTEN, folder, programs)
    told = shell(COMPARE, folder, programs)
    stream, outb = (json.loads((folder / f"{name}_facts.json").read_text()) for name in ("stream", "outb"))
    assert "would fit" not in heard.stdout
    assert "output = generator_speed offset 12" in told.stdout
    for frequency_hz, most_damping in ((0.33, 0.2), (1.68, 0.1)):
        a, b = (nearest(facts, frequency_hz, most_damping) for facts in (stream, outb))
        assert a["frequency_std_hz"] < 0.1 * frequency_hz, "a band that says nothing"
        for value, deviation in (("frequency_hz", "frequency_std_hz"), ("damping", "damping_std")):
            assert abs(a[value] - b[value]) < 3 * math.hypot(a[deviation], b[deviation]), (value, a, b)
        assert abs(a["frequency_hz"] - frequency_hz) < 0.1 * frequency_hz, a
