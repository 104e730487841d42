"""The wheel and the source archive stand on their own: built, installed elsewhere, run from outside the repository.

Without a network: the build uses the tools at hand, and the fresh environment borrows the installed dependencies
through a path file, which does not lend it the editable aeolid beside them.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import venv
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.slow  # its fixtures are

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "AEOLID"))} | {"MPLBACKEND": "Agg"}


def run(*words: object, folder: Path) -> str:
    done = subprocess.run(
        [str(w) for w in words], cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=3600, check=False
    )
    assert done.returncode == 0, f"{words}: {done.stdout[-2000:]}{done.stderr[-4000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the source archive."""
    out = tmp_path_factory.mktemp("archive")
    run(sys.executable, "-m", "build", "--no-isolation", "--sdist", "--outdir", out, ROOT / "tools", folder=out)
    (built,) = out.glob("*.tar.gz")
    return built


@pytest.fixture(scope="module")
def wheel(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel from the archive alone."""
    out = tmp_path_factory.mktemp("dist")
    with tarfile.open(archive) as packed:
        packed.extractall(out / "source", filter="data")
    (source,) = (out / "source").iterdir()
    run(sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", out, source, folder=out)
    (built,) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def clean(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into an environment of its own; returns its folder of commands."""
    place = tmp_path_factory.mktemp("clean")
    venv.create(place / "venv", with_pip=False)
    python = place / "venv/bin/python"
    (site,) = (place / "venv/lib").glob("python*/site-packages")
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    command = (sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", "--quiet")
    run(*command, wheel, folder=place)
    return python.parent


def test_the_archive_holds_the_library_and_nothing_else(archive: Path) -> None:
    with tarfile.open(archive) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    for wanted in ("PKG-INFO", "LICENSE", "pyproject.toml", "src/aeolid/cli/main.py",
                   "src/aeolid/py.typed", "library/CMakeLists.txt",
                   "src/aeolid/monitor/page/index.html", "library/include/aeolid/rls.h",
                   "library/src/rls.c"):  # fmt: skip
        assert wanted in names, wanted
    tops = {name.split("/")[0] for name in names}
    assert tops == {"PKG-INFO", "LICENSE", "pyproject.toml", "build_backend.py", "src", "library"}
    assert not any(part in name for name in names for part in (".venv", "__pycache__", "build/", "tests/"))


def test_the_wheel_runs_outside_the_repository(clean: Path, tmp_path: Path) -> None:
    where = run(clean / "python", "-c", "import aeolid; print(aeolid.__file__)", folder=tmp_path).strip()
    assert where.startswith(str(clean.parent)), where
    header = (ROOT / "include/aeolid/aeolid.h").read_text()
    version = ".".join(re.findall(r"#define AEO_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", header))
    assert run(clean / "aeolid", "--version", folder=tmp_path) == f"aeolid {version}\n"


def test_the_main_job_runs_from_the_wheel(clean: Path, tmp_path: Path) -> None:
    """Controller node, bus, host, C filters and model: the same bits come through, and a model comes out."""
    command = [clean / "aeolid", "node", "--turbine", "--samples", "1500", "--past", "10", "--speed", "max", "--share"]
    command += ["0", "--wait", "--dump", "theta.f32"]
    with subprocess.Popen(
        [str(c) for c in command], cwd=tmp_path, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        text=True,
    ) as node:  # fmt: skip
        assert node.stdout is not None
        bus = node.stdout.readline().strip()
        listen = ("listen", "--bus", bus, "--record", "received.csv", "--markov", "markov.npz", "--until-end")
        run(clean / "aeolid", *listen, folder=tmp_path)
        assert node.wait(3600) == 0
    with np.load(tmp_path / "markov.npz") as received:
        sent = np.fromfile(tmp_path / "theta.f32", dtype="<f4").astype(float)
        assert np.array_equal(received["theta_scaled"].reshape(-1), sent)
    identify = ("identify", "received.csv", "--roles", "received.roles.toml", "--past", "10", "--markov", "markov.npz")
    run(clean / "aeolid", *identify, "--out", "model.json", folder=tmp_path)
    assert json.loads((tmp_path / "model.json").read_text())["kind"] == "state_space"
    replay = ("filter", "received.csv", "--roles", "received.roles.toml", "--method", "lattice", "--past", "10")
    assert "Markov parameters" in run(clean / "aeolid", *replay, "--out", "replayed.npz", folder=tmp_path)
