"""The command line's face: what help, errors and completion say, held against stored text.

python tests/host/test_cli_help.py        writes tests/host/golden anew; read the difference before it is kept
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import aeolid
from aeolid.cli import reference
from aeolid.cli.main import main
from aeolid.plants.examples import write_examples

GOLDEN = Path(__file__).resolve().parent / "golden"
REGENERATE = "python tests/host/test_cli_help.py writes it anew"
COMMANDS = {command.name: command for command in reference.commands()}
SCRIPT = Path(sys.executable).parent / "aeolid"

ERRORS = """
aeolid identify none.csv --roles roles.toml --past 30 --out model.json
aeolid identify monday.csv --roles none.toml --past 30 --out model.json
aeolid identify monday.csv --roles roles.toml --past 30 --method rls --out model.json
aeolid identify monday.csv --roles roles.toml --past 30 --method arx --out model.json
aeolid identify monday.csv --roles roles.toml --past 30 --order many --out model.json
aeolid identify monday.csv --roles roles.toml --past 900 --out model.json
aeolid identify stage/recording.csv --roles roles.toml --past 30 --out model.json
aeolid filter monday.csv --roles roles.toml --method kalman --past 10 --out m.npz
aeolid filter monday.csv --roles roles.toml --method rls --past 10 --out none/m.npz
aeolid simulate my_case/model.json stage/recording.csv --roles stage/roles.toml --out simulated.csv
aeolid simulate roles.toml monday.csv --roles roles.toml --out simulated.csv
aeolid validate my_case/model.json monday.csv --roles roles.toml --metric both
aeolid diagnose . --out diagnosis
aeolid convert my_case/model.json model.xml
aeolid node
aeolid node --turbine --base 0x1CFF4100
aeolid listen --bus nonsense
aeolid listen --bus none.blf
aeolid fleet none --roles roles.toml --past 10 --out trends
aeolid example roles.toml
aeolid completion tcsh
""".strip().splitlines()


def write_errors(folder: Path) -> str:
    """Run each wrong command in `folder`, which has the examples; returns commands, exit codes and sentences."""
    write_examples(folder, samples=400)
    parts = []
    with contextlib.chdir(folder):
        for command in ERRORS:
            said = io.StringIO()
            with contextlib.redirect_stderr(said):
                code = main(shlex.split(command)[1:])
            sentence = said.getvalue().strip().splitlines()[-1].replace(str(folder), "FOLDER")
            parts.append(f"$ {command}\n{sentence}\n[{code}]\n")
    return "\n".join(parts)


def run(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        words, env=os.environ | environment, capture_output=True, text=True, timeout=3600, check=False
    )


def test_help_is_as_stored() -> None:
    assert reference.text() == (GOLDEN / "help.txt").read_text(encoding="utf-8"), REGENERATE


def test_errors_are_as_stored(tmp_path: Path) -> None:
    stored = (GOLDEN / "errors.txt").read_text(encoding="utf-8")
    assert write_errors(tmp_path) == stored, REGENERATE
    assert set(re.findall(r"^\[(\d+)\]$", stored, re.M)) == {"2", "3", "4"}
    for line in stored.splitlines():
        assert line.startswith(("$ aeolid ", "aeolid: ", "[")) or not line, line


@pytest.mark.parametrize("name", COMMANDS)
def test_the_terminal_shows_what_the_reference_says(name: str) -> None:
    """Boxes, types and line ends are the library's; the words, their order apart, are ours."""
    done = run(str(SCRIPT), name, "--help", COLUMNS="100", NO_COLOR="1", TERM="dumb")
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 100
    shown = " ".join(re.sub(r"[│╭╮╰╯─]", " ", done.stdout).split())
    command = COMMANDS[name]
    for text in [*command.paragraphs, *command.examples]:
        assert " ".join(text.split()) in shown
    shown = shown.replace(" ", "")  # long words are broken where the column ends
    for parameter in command.parameters:
        for word in [*" ".join(parameter.names).replace("/", " ").split(), *parameter.help.split()]:
            assert word in shown, (parameter.head, word)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_examples_that_it_would_take(name: str) -> None:
    command = COMMANDS[name]
    assert command.examples, f"{name}: EXAMPLES beside its register() is empty or missing"
    known = {n for p in command.parameters for n in " ".join(p.names).replace("/", " ").replace(",", " ").split()}
    needed = {p.names[0] for p in command.parameters if p.names and p.required}
    for example in command.examples:
        if not example.startswith("aeolid "):
            continue
        words = shlex.split(example, comments=True)
        options = {w for w in words if w.startswith("--")}
        assert words[1] == name and needed <= options <= known, example


def test_every_command_that_finds_facts_writes_them_as_json() -> None:
    without = {name for name, c in COMMANDS.items() if not any("--json" in p.names for p in c.parameters)}
    assert without == {"completion"}


def test_standard_output_is_json_alone_when_asked_for(tmp_path: Path) -> None:
    done = run(str(SCRIPT), "example", str(tmp_path), "--samples", "200", "--json", "-")
    assert len(json.loads(done.stdout)["files"]) == 12


FACTS = {
    "identify": "monday.csv --roles roles.toml --past 10 --order 4 --out model.json",
    "simulate": "my_case/model.json monday.csv --roles roles.toml --out simulated.csv",
    "validate": "my_case/model.json monday.csv --roles roles.toml",
    "filter": "monday.csv --roles roles.toml --method rls --past 5 --out markov.npz",
    "convert": "my_case/model.json model.mat",
    "catalogue": "",
    "diagnose": "stage --out diagnosis",
}


def test_standard_output_of_other_commands_is_json_alone_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_examples(tmp_path, samples=800)
    head, *rows = (tmp_path / "stage/recording.csv").read_text().splitlines()
    stuck = [f"{row.rpartition(',')[0]},0.25" for row in rows]  # a dead sensor ends a diagnosis at once
    (tmp_path / "stage/recording.csv").write_text("\n".join([head, *stuck]) + "\n")
    for name, words in FACTS.items():
        assert main([name, *words.split(), "--json", "-"]) == 0, name
        assert json.loads(capsys.readouterr().out), name


def test_the_version_is_that_of_the_header() -> None:
    header = (Path(__file__).resolve().parents[2] / "include/aeolid/aeolid.h").read_text()
    version = ".".join(re.findall(r"#define AEO_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", header))
    assert aeolid.__version__ == version, "the package was built from another version: sh tools/setup"
    assert run(str(SCRIPT), "--version").stdout == f"aeolid {version}\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("aeolid id", ["identify"]),
        ("aeolid identify --method v", ["varx", "varmax"]),
        ("aeolid filter --precision f", ["f32", "f64"]),
        ("aeolid diagnose --sh", ["--sham"]),
        ("aeolid completion z", ["zsh"]),
    ],
)
def test_bash_completes(words: str, expected: list[str]) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    script = f"""eval "$(aeolid completion bash)" && complete -p aeolid >/dev/null
COMP_WORDS=({words}) COMP_CWORD={len(words.split()) - 1}; _aeolid_completion aeolid; echo "${{COMPREPLY[*]}}" """
    done = run(bash, "-c", script, PATH=f"{SCRIPT.parent}:{os.environ['PATH']}")
    assert done.stdout.split() == expected, done.stderr


def test_other_shells_get_a_script() -> None:
    assert run(str(SCRIPT), "completion", "zsh").stdout.lstrip().startswith("#compdef aeolid")
    assert "complete --command aeolid" in run(str(SCRIPT), "completion", "fish").stdout


if __name__ == "__main__":
    (GOLDEN / "help.txt").write_text(reference.text(), encoding="utf-8")
    with tempfile.TemporaryDirectory() as place:
        (GOLDEN / "errors.txt").write_text(write_errors(Path(place)), encoding="utf-8")
