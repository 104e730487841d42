"""What the pages and the notebook show of Python runs."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path
from typing import Any

import matplotlib
import pytest
from doc_pages import ROOT, blocks

matplotlib.use("Agg")
from aeolid.plants.examples import write_examples

NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


def test_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All blocks of the page in order, on the recordings that its command writes."""
    import matplotlib.pyplot as plt

    write_examples(tmp_path)
    monkeypatch.chdir(tmp_path)
    shown = [b for b in blocks(ROOT / "docs/howto/python.md") if b.language == "python" and b.reason is None]
    names: dict[str, Any] = {}
    for block in shown:
        exec(compile(block.text, block.place, "exec"), names)
    plt.close("all")
    assert len(shown) >= 5 and (tmp_path / "model.json").is_file()
    assert names["same"].channels == tuple(_without_column(c) for c in names["monday"].channels)


def test_the_readme_shows_what_python_prints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first lines of its Python example, on the recording that its first command writes."""
    import aeolid as ae

    write_examples(tmp_path)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert 'ae.read("monday.csv", roles="roles.toml")' in text and "ae.identify(rec, past=30)" in text
    model = ae.identify(ae.read("monday.csv", roles="roles.toml"), past=30)
    assert f"# {model!r}\n" in text


def test_the_floquet_page_explains_a_line_of_its_answer() -> None:
    text = (ROOT / "docs/howto/floquet.md").read_text(encoding="utf-8")
    answer = text.split("```text\n")[1].split("```")[0]
    shown = re.findall(r"`([+−]\d+P \d+ % at [\d.]+ Hz)`", text)
    assert shown and [line for line in shown if line not in answer] == []


def _without_column(channel: Any) -> Any:
    from dataclasses import replace

    return replace(channel, column=None)


@pytest.mark.diagnosis
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda p: p.name)
def test_a_notebook_runs(notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a kernel of its own: no cell fails, tables and pictures come out, and a bar was shown and is gone."""
    import nbformat
    from nbclient import NotebookClient

    shutil.copy(notebook, tmp_path)
    for name in [n for n in os.environ if n.endswith("_NUM_THREADS")]:
        monkeypatch.delenv(name)  # as a user's kernel
    monkeypatch.delenv("MPLBACKEND", raising=False)
    monkeypatch.setenv("PYDEVD_DISABLE_FILE_VALIDATION", "1")
    book = nbformat.read(tmp_path / notebook.name, as_version=4)
    assert all(not cell.get("outputs") for cell in book.cells), "outputs are not kept in the repository"
    NotebookClient(book, timeout=3600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in book.cells for output in cell.get("outputs", ())]
    kinds = {kind for output in outputs for kind in output.get("data", ())}
    assert {"text/html", "image/png", "text/plain"} <= kinds
    said = "".join(output.get("text", "") for output in outputs)
    before, after = (float(word) for word in said.split("before")[0].split()[-1:] + said.split(", ")[1].split()[:1])
    assert after < 0.7 * before and (tmp_path / "out" / "report.html").is_file()
    assert not any(output.output_type == "stream" and output.name == "stderr" for output in outputs), said
    assert not any("<progress" in str(output.get("data", {}).get("text/html", "")) for output in outputs)
