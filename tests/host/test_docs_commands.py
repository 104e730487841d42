"""Every command shown in README.md and docs/ runs, in the order shown, in an empty folder for each page.

A block that cannot run here says why in a comment before it: `<!-- not run: REASON -->`.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import pytest
from doc_pages import PAGES, ROOT, Block, blocks

from aeolid.cli import reference
from aeolid.models.input_filters import KINDS
from aeolid.models.state_space import load
from aeolid.plants.examples import write_examples
from aeolid.record import ROLES

SHELL = [block for page in PAGES for block in blocks(page) if block.language == "sh"]
COMMANDS = {command.name: command for command in reference.commands()}
WITHOUT = {"reference", "decisions", "explanation", "results", "howto"}  # folders whose pages may show no command
WIRED = (ROOT / "README.md", ROOT / "docs/howto/port.md")
VCAN = "needs a kernel with virtual CAN and the right to configure it; tests/sil runs it in a kernel of its own"
# What is shown and not run; a block more is a decision to be made here too.
NOT_RUN = {
    "docs/index.md": ["the demonstration and the whole suite have tests of their own"],
    "docs/howto/controller_ci.md": [VCAN],
    "docs/howto/openfast_controller.md": 3 * ["needs OpenFAST and a controller; tests/ports/test_openfast.py runs it"],
    "docs/tutorials/sil.md": [VCAN],
}


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
        return port


def script(shown: list[Block], by_day: bool = False) -> str:
    """Join the blocks of a page; each says that it begins, and ports are free ones instead of those shown.

    By day without null simulations, as long as the diagnosis each (test_diagnose_cli.py has one by day), and README's
    example has a fifth of its samples: what it prints is no matter here.
    """
    parts = ["set -eu"]
    for block in shown:
        text, port = block.text, free_port()
        text = re.sub(r"\b29536\b", str(port), text)
        if by_day:
            text = re.sub(r"--sham \d+", "--sham 0", text)
            text = re.sub(r"^aeolid example \.$", "aeolid example . --samples 600", text, flags=re.M)
        parts += [f"echo '== {block.place}' >&2", text]
    return "\n".join([*parts, "echo '== done' >&2"])


def run(text: str, folder: Path) -> tuple[int, str]:
    """Run a script in a process group of its own, of which nothing is left behind; returns exit code and messages."""
    tools = Path(sys.executable).parent
    own = {"AEOLID": str(ROOT), "PATH": f"{tools}:{os.environ['PATH']}", "COLUMNS": "100", "MPLBACKEND": "Agg"}
    if shutil.which("ninja"):
        own["CMAKE_GENERATOR"] = "Ninja"  # a machine without make is none of the reader's
    with (
        tempfile.TemporaryFile("w+") as said,  # no pipe: what a failed page leaves in the background would hold it open
        subprocess.Popen(
            ["sh", "-c", text], cwd=folder, env=os.environ | own, text=True, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT,
        ) as process,
    ):  # fmt: skip
        try:
            process.wait(timeout=3600)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
        said.seek(0)
        return process.returncode, said.read()


def runs_elsewhere(page: Path) -> bool:
    """Tell whether all that a page shows stands in the same order, line by line, on another page, which runs it."""
    texts: dict[Path, str] = {}
    for block in SHELL:
        if block.reason is None:
            texts[block.page] = texts.get(block.page, "") + block.text.strip() + "\n"
    return any(texts[page] in text for other, text in texts.items() if other != page and len(text) > len(texts[page]))


# By day the README, with a diagnosis, and the short pages; these take 15 to 25 seconds of processor each. Their options
# are looked at by day too (test_every_option_shown_exists).
AT_NIGHT = {
    "tutorials/offline.md", "tutorials/firmware.md", "tutorials/sil.md", "tutorials/diagnosis.md",
    "howto/openfast_controller.md", "howto/output_only.md", "howto/excitation.md",
    "howto/floquet.md",  # test_floquet_cli.py
}  # fmt: skip


def at_night(page: Path) -> Any:
    """Return the page as a parameter, for the nightly run where its commands take long."""
    dear = page.is_relative_to(ROOT / "docs") and page.relative_to(ROOT / "docs").as_posix() in AT_NIGHT
    return pytest.param(page, marks=pytest.mark.nightly) if dear else page


@pytest.mark.slow
@pytest.mark.parametrize("page", [at_night(p) for p in PAGES], ids=lambda p: str(p.relative_to(ROOT)))
def test_the_commands_of_a_page_run(page: Path, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    shown = [block for block in SHELL if block.page == page and block.reason is None]
    if not shown:
        assert page.parent.name in WITHOUT, "a page of commands without one"
        return
    if runs_elsewhere(page):
        return
    code, said = run(script(shown, "not nightly" in request.config.option.markexpr), tmp_path)
    assert code == 0 and "== done" in said, said[-3000:]
    assert "Traceback" not in said, said[-3000:]


def test_what_does_not_run_is_listed_with_its_reason() -> None:
    found: dict[str, list[str]] = {}
    for block in SHELL:
        if block.reason is not None:
            found.setdefault(str(block.page.relative_to(ROOT)), []).append(block.reason)
    assert found == NOT_RUN


def test_a_command_that_fails_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("text\n\n```sh\naeolid simulate none.json none.csv --roles none.toml --out s.csv\ntrue\n```\n")
    (block,) = blocks(page)
    assert block.reason is None and block.line == 3
    code, said = run(script([Block(ROOT / "README.md", 3, "sh", block.text, None)]), tmp_path)
    assert code == 3 and "no such file" in said and "== done" not in said


def test_every_option_shown_exists() -> None:
    """Also those of blocks that are not run."""
    for block in SHELL:
        for line in block.text.splitlines():
            words = shlex.split(line.removesuffix("&"), comments=True)
            if words[:1] == ["aeolid"]:
                known = {n for p in COMMANDS[words[1]].parameters for n in re.split(r"[ ,/]+", " ".join(p.names))}
                assert {w for w in words if w.startswith("--")} <= known, f"{block.place}: {line}"
    for page in PAGES:
        for name, option in re.findall(r"`aeolid (\w+)[^`]*?(--[a-z-]+)", page.read_text(encoding="utf-8")):
            parameters = COMMANDS[name].parameters
            assert any(option in re.split(r"[ ,/]+", " ".join(p.names)) for p in parameters), (page, name, option)


def test_c_shown_compiles(tmp_path: Path) -> None:
    """What the pages show of C is complete but for the headers; what is wired to a port is built by tests/ports."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler is installed")
    found = [b for page in PAGES if page not in WIRED for b in blocks(page) if b.language == "c"]
    assert found
    for block in found:
        (tmp_path / "shown.c").write_text("#include <aeolid/aeolid.h>\n" + block.text)
        flags = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{ROOT / 'include'}", "-fsyntax-only")
        done = subprocess.run([compiler, *flags, "shown.c"], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{block.place}: {done.stderr}"


def test_the_model_shown_is_read(tmp_path: Path) -> None:
    (shown,) = [b for page in PAGES for b in blocks(page) if b.language == "json"]
    (tmp_path / "model.json").write_text(shown.text)
    model = load(tmp_path / "model.json")
    assert (model.order, model.inputs[0].name, model.outputs[0].unit) == (1, "pitch", "rpm")


def test_the_page_of_files_names_every_key_that_is_read() -> None:
    text = (ROOT / "docs/reference/files.md").read_text(encoding="utf-8")
    prose = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    named = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`]+)`", prose))))
    package = ROOT / "tools/src/aeolid"
    for file in ("record.py", "models/equations_file.py", "diagnose/data/case.py"):
        for keys in re.findall(r"check_keys\([^{}]*\{([^}]*)\}", (package / file).read_text(encoding="utf-8")):
            assert set(re.findall(r'"(\w+)"', keys)) <= named, f"{file}: {keys}"
    assert set(KINDS) | {slot for kind in KINDS.values() for slot in kind.slots} <= named
    assert set(ROLES) <= named


def test_files_shown_are_those_the_example_writes(tmp_path: Path) -> None:
    """TOML shown with its file name in the first line says what the file says."""
    write_examples(tmp_path, samples=100)
    shown = 0
    for page in PAGES:
        for block in blocks(page):
            name = re.match(r"# ([\w/]+\.toml)\n", block.text)
            if block.language != "toml" or name is None:
                continue
            path = tmp_path / name[1] if (tmp_path / name[1]).exists() else tmp_path / "my_case" / name[1]
            assert tomllib.loads(block.text) == tomllib.loads(path.read_text()), block.place
            shown += 1
    assert shown >= 5


def test_a_page_that_fails_leaves_nothing_behind_and_ends(tmp_path: Path) -> None:
    """A node in the background that nobody meets any more held the test for an hour."""
    code, said = run("set -e\nsleep 3000 &\necho before\nfalse\necho after", tmp_path)
    assert (code, said) == (1, "before\n")
