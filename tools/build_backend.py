"""Build the Python package: scikit-build-core, and a source archive that carries the C library too.

The package's folder lies inside the repository whose C sources it compiles. An archive has no such surroundings, so it
takes them along in a folder `library`, and what pyproject.toml says of `../` is said of `library/` there.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import chdir
from pathlib import Path

from scikit_build_core.build import (
    build_editable,
    build_wheel,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)
from scikit_build_core.build import build_sdist as build_plain_sdist

__all__ = [
    "build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable", "get_requires_for_build_sdist",
    "get_requires_for_build_wheel", "prepare_metadata_for_build_editable", "prepare_metadata_for_build_wheel",
]  # fmt: skip

LIBRARY = ("CMakeLists.txt", "LICENSE", "README.md", "CHANGELOG.md", "include", "src", "port", "packaging",
           "tools/native", "tools/aeolid.dbc")  # fmt: skip
PACKAGE = ("build_backend.py", "src")
LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", "*.egg-info")


def build_sdist(sdist_directory: str, config_settings: Mapping[str, list[str] | str] | None = None) -> str:
    """Build the source archive from a copy that holds package and library; returns its file name."""
    package = Path.cwd()
    settings = dict(config_settings) if config_settings else None
    if (package / "library").is_dir():  # an unpacked archive, whole already
        return build_plain_sdist(sdist_directory, settings)
    target = os.path.abspath(sdist_directory)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        _copy(package, PACKAGE, copy)
        _copy(package.parent, LIBRARY, copy / "library")
        shutil.copy2(package.parent / "LICENSE", copy / "LICENSE")
        project = (package / "pyproject.toml").read_text(encoding="utf-8")
        (copy / "pyproject.toml").write_text(project.replace('"../', '"library/'), encoding="utf-8")
        with chdir(copy):
            return build_plain_sdist(target, settings)


def _copy(source: Path, names: tuple[str, ...], target: Path) -> None:
    for name in names:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name, ignore=LEFT_OUT)
        else:
            shutil.copy2(source / name, target / name)
