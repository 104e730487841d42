"""The current folder may hold anything: no module, configuration or cache of it has a say."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from aeolid.compiled import cache_folder, private_folder
from aeolid.plants.examples import write_examples

PACKAGE = Path(__file__).resolve().parents[2] / "tools" / "src" / "aeolid"
AEOLID = Path(sys.executable).with_name("aeolid")
# What the commands below import themselves, or what children and their workers import first.
MODULES = ("scipy", "numpy", "multiprocessing", "json", "yaml", "encodings", "typing", "pickle", "dask", "distributed",
           "numba", "llvmlite", "matplotlib", "pandas", "pyarrow", "matplotlibrc", "sitecustomize")  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder of recordings with modules that leave a mark when they are imported, and a numba_config."""
    write_examples(tmp_path, samples=300)
    for name in MODULES:
        (tmp_path / f"{name}.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'a').write({name!r} + ' ')\n")
    (tmp_path / ".numba_config.yaml").write_text(f"cache_dir: {tmp_path / 'planted'}\n")
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n")
    (tmp_path / "parts").mkdir()
    table = np.genfromtxt(tmp_path / "monday.csv", delimiter=",", names=True)
    savemat(tmp_path / "monday.mat", {n: table[n] for n in table.dtype.names})
    for k in (1, 2):
        (tmp_path / "parts" / f"{k}.csv").write_bytes((tmp_path / "monday.csv").read_bytes())
    return tmp_path


def run(folder: Path, *command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    unset = {"PYTHONSAFEPATH", "NUMBA_CACHE_DIR"}
    inherited = {k: v for k, v in os.environ.items() if k not in unset}
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, env={**inherited, **environment}
    )


@pytest.mark.parametrize(
    "arguments",
    [
        (
            "identify",
            "monday.mat",
            "--roles",
            "roles.toml",
            "--past",
            "10",
            "--out",
            "model.json",
            "--report",
            "r.html",
        ),
        ("fleet", "parts", "--roles", "roles.toml", "--past", "10", "--workers", "2", "--out", "trends"),
        ("simulate", "stage/model.toml", "stage/recording.csv", "--roles", "stage/roles.toml", "--out", "s.csv"),
    ],
    ids=lambda a: a[0],
)
def test_no_command_imports_or_is_configured_from_the_current_folder(arguments: tuple[str, ...], folder: Path) -> None:
    done = run(folder, str(AEOLID), *arguments)
    assert not (folder / "mark").exists(), (folder / "mark").read_text()
    assert done.returncode == 0, done.stderr
    assert not (folder / "planted").exists()


@pytest.mark.parametrize("start", [(str(AEOLID),), (sys.executable, "-m", "aeolid.cli.main")], ids=["script", "-m"])
def test_what_python_itself_puts_on_the_path_is_taken_off_again(start: tuple[str, ...], folder: Path) -> None:
    """An empty entry of PYTHONPATH, and `python -m`, mean the current folder; what comes after the start is guarded."""
    for name in set(MODULES) - {"scipy", "llvmlite", "dask", "distributed"}:
        (folder / f"{name}.py").unlink()
    options = ("monday.mat", "--roles", "roles.toml", "--past", "10", "--out", "model.json")
    done = run(folder, *start, "identify", *options, PYTHONPATH=":")
    assert not (folder / "mark").exists(), (folder / "mark").read_text()
    assert done.returncode == 0, done.stderr


def test_the_planted_modules_would_be_imported_without_the_guard(folder: Path) -> None:
    run(folder, sys.executable, "-c", "import scipy")
    assert "scipy" in (folder / "mark").read_text()


def test_numba_takes_neither_configuration_nor_cache_of_the_current_folder(folder: Path) -> None:
    asked = "import os, aeolid.compiled as c, numba; print(numba.config.CACHE_DIR); print(numba.config._HAVE_YAML)"
    done = run(folder, sys.executable, "-P", "-c", asked, XDG_CACHE_HOME=str(folder / "own"))
    lines = done.stdout.splitlines()
    assert not done.stderr, "a file that is not read is not spoken of either"
    assert lines == [str(folder / "own" / "aeolid" / "numba"), "False"]
    assert (folder / "own" / "aeolid" / "numba").stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("fault", ["writable", "writable above", "link", "no folder", "relative"])
def test_a_cache_that_others_could_write_is_not_used(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = tmp_path / "above" / "cache"
    chosen.parent.mkdir(mode=0o700)
    if fault == "writable":
        chosen.mkdir()
        chosen.chmod(0o777)
    elif fault == "writable above":
        chosen.parent.chmod(0o777)
    elif fault == "link":
        (tmp_path / "elsewhere").mkdir(mode=0o700)
        chosen.symlink_to(tmp_path / "elsewhere")
    elif fault == "no folder":
        chosen.write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "cache" if fault == "relative" else str(chosen))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert cache_folder() == tmp_path / "home" / "aeolid" / "numba"
    (tmp_path / "home").chmod(0o777)
    alone = cache_folder()
    assert alone.name.startswith("aeolid-numba-") and alone.stat().st_mode & 0o077 == 0


def test_a_folder_that_others_may_read_is_closed(tmp_path: Path) -> None:
    (tmp_path / "cache").mkdir(mode=0o755)
    assert private_folder(tmp_path / "cache")
    assert (tmp_path / "cache").stat().st_mode & 0o777 == 0o700


def test_every_python_process_is_started_guarded_and_numba_is_imported_in_one_place() -> None:
    found, telling = [], ("numba", "executable", "PYTHONSAFEPATH", "PYTHONPATH")
    for path in PACKAGE.rglob("*.py"):
        text, part = path.read_text(encoding="utf-8"), str(path.relative_to(PACKAGE))
        if not any(word in text for word in telling):
            continue  # nothing of what is looked for: not worth the parsing
        for node in ast.walk(ast.parse(text)):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if part != "compiled.py" and any(n.split(".")[0] == "numba" for n in names):
                found.append(f"{part}: imports numba itself")
            own = part == "children.py" or part.startswith("confined")  # the box has a command of its own, isolated
            if isinstance(node, ast.Attribute) and node.attr == "executable" and not own:
                found.append(f"{part}: sys.executable without children.python_command")
            value = node.value if isinstance(node, ast.Constant) else None
            if value in ("PYTHONSAFEPATH", "PYTHONPATH") and not own:
                found.append(f"{part}: guards imports itself; children.guarded_children does")
    assert found == []


def test_workers_of_a_pool_are_guarded_by_the_same_rule(folder: Path) -> None:
    """Without a command around it, too; the caller's path and environment are as before."""
    code = """if True:
        import os, sys
        from aeolid.fleet.workers import open_pool
        before = list(sys.path), dict(os.environ)
        with open_pool(2) as pool:
            told = [x for _, x in pool.run(eval, ["(__import__('scipy').__file__, __import__('sys').path)"] * 2)]
        assert (list(sys.path), dict(os.environ)) == before
        assert '' in sys.path
        print(*(str(os.getcwd() in path) for _, path in told))
        """
    for name in set(MODULES) - {"scipy"}:  # this process imports those
        (folder / f"{name}.py").unlink()
    (folder / "scipy.py").write_text(f"open({str(folder / 'mark')!r}, 'a').write('scipy ')\n")
    start = (sys.executable, "-c", code)
    done = run(folder, *start)
    assert done.stdout.split() == ["False", "False"] and not (folder / "mark").exists(), done.stderr
    (folder / "scipy.py").unlink()
    assert run(folder, *start, PYTHONPATH=str(folder)).stdout.split() == ["True", "True"], "as it was asked for"
