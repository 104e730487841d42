"""Show the main job on the built-in turbine: node, virtual CAN, listen, identify, diagnose, one page.

Every step is the command a user would type; it is printed before it runs.
"""

from __future__ import annotations

import argparse
import json
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from aeolid import output
from aeolid.children import python_command
from aeolid.cli import guard
from aeolid.cli.common import SafeConsole
from aeolid.errors import DataError, UsageError

console = SafeConsole(highlight=False, soft_wrap=True)
SAMPLES = 10_000  # the length of the published study: 1000 s at 10 Hz
PAST = 30
ORDER = 7
CONCEALED_LAG_S = 0.3
MADE = (
    "theta.f32", "received.csv", "received.roles.toml", "markov.npz", "stream.json", "model.json", "case", "diagnosis",
    "report.html",
)  # fmt: skip


class Clock:
    """Print the time since the start in front of each step."""

    def __init__(self) -> None:
        self._begun = time.monotonic()

    def elapsed(self) -> float:
        """Return seconds since the start."""
        return time.monotonic() - self._begun

    def step(self, text: str) -> None:
        """Announce a step."""
        console.print(f"\n[bold]\\[{self.elapsed():5.1f} s] {text}[/bold]")


def main(arguments: list[str] | None = None) -> int:
    """Run the demonstration; returns the exit code."""
    parser = argparse.ArgumentParser(prog="tools/demo", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("build/demo"), help="folder for everything it writes")
    parser.add_argument("--speed", default="100", help="multiple of real time the controller runs at, or max")
    parser.add_argument("--seed", type=int, default=0, help="seed of wind, excitation and noise")
    options = parser.parse_args(arguments)
    with guard.standard_streams() as stream, guard.interrupts():
        try:
            run(options.out, options.speed, options.seed)
            code = 0
        except (Exception, KeyboardInterrupt) as error:
            code = guard.explain(error, "demo")
        finally:
            output.finished()
        return guard.end_of(stream, code)


def run(out: Path, speed: str, seed: int) -> None:
    """Do all steps; everything is written under `out`."""
    clock = Clock()
    output.declare("demo", force=False, folders={"--out": out}, claimed=True)
    for left in (out / name for name in MADE):  # of an earlier run, whose mark the folder bears
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left)
        else:
            left.unlink(missing_ok=True)
    clock.step(f"1  A controller node filters {SAMPLES} samples of a closed-loop turbine and streams on virtual CAN")
    stream = stream_and_listen(out, speed, seed)
    clock.step("2  The host identifies a model from what it received")
    identification = identify(out, stream)
    clock.step("3  Another recording of that turbine holds an effect that the model lacks; what is it?")
    diagnosis, evidence = diagnose(out, seed)
    clock.step("4  One page shows both")
    page = out / "report.html"
    write_page(page, identification, diagnosis, evidence)
    console.print(f"   {page}")
    summary(clock.elapsed(), identification, diagnosis, page)


def stream_and_listen(out: Path, speed: str, seed: int) -> dict[str, Any]:
    """Run node and listener as two processes on a virtual bus; returns facts about the stream."""
    node = ["node", "--turbine", "--samples", str(SAMPLES), "--past", str(PAST), "--seed", str(seed), "--speed", speed]
    node += [
        "--regularize",
        "0.01",
        "--feedthrough",
        "pitch",
        "--share",
        "0",
        "--wait",
        "--dump",
        str(out / "theta.f32"),
    ]
    with start(node) as controller:
        assert controller.stdout is not None
        address = controller.stdout.readline().strip()
        if not address:
            raise DataError(f"the node ended before it opened a bus (exit code {controller.wait()})")
        listen = ["listen", "--bus", address, "--record", str(out / "received.csv")]
        call([*listen, "--markov", str(out / "markov.npz"), "--until-end", "--json", str(out / "stream.json")])
        if controller.wait(60) != 0:
            raise DataError(f"the node ended with exit code {controller.returncode}")
    facts: dict[str, Any] = json.loads((out / "stream.json").read_text())
    sent = np.fromfile(out / "theta.f32", dtype="<f4").astype(float)
    with np.load(out / "markov.npz") as received:
        equal = int(np.count_nonzero(received["theta_scaled"].reshape(-1) == sent))
    console.print(f"   Markov parameters received: {equal} of {len(sent)} equal those in the C filter bit for bit")
    heard = facts["nodes"][0]
    return {
        "frames": facts["frames"],
        "frames per second": facts["frames_per_s"],
        "samples received": sum(r["samples"] for r in heard["runs"]),
        "values lost": sum(r["lost_values"] for r in heard["runs"]),
        "complete snapshots": heard["snapshots"]["complete"],
        "parameters equal to the C filter's, bit for bit": f"{equal} of {len(sent)}",
    }


def identify(out: Path, stream: dict[str, Any]) -> dict[str, Any]:
    """Identify from the received samples and Markov parameters; returns the page's facts, prints the comparison."""
    from aeolid.plants.hawt import build_turbine
    from aeolid.report import identification_facts

    model = out / "model.json"
    command = ["identify", str(out / "received.csv"), "--roles", str(out / "received.roles.toml")]
    command += ["--past", str(PAST), "--order", str(ORDER), "--feedthrough", "pitch"]
    command += ["--markov", str(out / "markov.npz"), "--out", str(model)]
    call(command, quiet=True)
    facts = identification_facts(
        json.loads(model.read_text()), command=text_of(command), stream=stream,
        true_model=build_turbine().model().to_json(),
        true_names={0: "rotor speed", 1: "tower side-side", 2: "tower fore-aft", 3: "drive train"},
        title="Built-in turbine: identified over CAN, then diagnosed",
    )  # fmt: skip
    facts["introduction"] = (
        "A software controller filtered the closed-loop turbine sample by sample and streamed Markov parameters and"
        " samples on a virtual CAN bus. The host identified a model from what it received. Then a recording of the same"
        " turbine with a concealed effect was compared with the turbine's true model."
    )
    facts["notes"] = [
        *facts["notes"],
        "the torque excitation of the study, 1 kN m, makes up less than 0.02 % of the power of any output: these data"
        " do not determine the responses to torque. Pitch may act within the sample, since its controller has a delay"
        " of one sample.",
    ]
    print_modes(facts)
    return facts


def print_modes(facts: dict[str, Any]) -> None:
    """Print identified against true modes."""
    from aeolid.report.identification import paired

    table = Table("mode", "identified Hz", "true Hz", "identified damping", "true damping", box=None, pad_edge=False)
    for mode, true in paired(facts["modes"], facts["true_modes"]):
        true = true or {}
        columns = (mode.get("frequency_hz"), true.get("frequency_hz"), mode.get("damping"), true.get("damping"))
        table.add_row(true.get("name", ""), *("" if v is None else f"{v:.4f}" for v in columns))
    console.print(table)


def diagnose(out: Path, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Write a case with a concealed effect, diagnose it; returns diagnosis and evidence."""
    from aeolid.plants.concealed import write_case

    case = write_case(out / "case", lag_s=CONCEALED_LAG_S, seed=seed + 7)
    call(["diagnose", str(case), "--out", str(out / "diagnosis"), "--sham", "5"])
    read = [json.loads((out / "diagnosis" / name).read_text()) for name in ("diagnosis.json", "evidence.json")]
    console.print(f"   The concealed effect was: a pitch drive with a first-order lag of {CONCEALED_LAG_S} s.")
    return read[0], read[1]


def write_page(page: Path, facts: dict[str, Any], diagnosis: dict[str, Any], evidence: dict[str, Any]) -> None:
    """Write the page that shows identification and diagnosis."""
    from aeolid.report import render_demo

    render_demo(facts, diagnosis, evidence, page)


def summary(seconds: float, facts: dict[str, Any], diagnosis: dict[str, Any], page: Path) -> None:
    """Print the result in a few lines."""
    from aeolid.report.identification import poles_apart

    console.print(f"\n[bold]Done in {seconds:.0f} s[/bold]")
    console.print(f"   stream      {facts['stream']['frames']} frames, {facts['stream']['values lost']} values lost")
    console.print(f"   identified  order {facts['order']}, poles within {poles_apart(facts):.4f} of the true ones")
    sealed = diagnosis["sealed"]
    console.print(f"   diagnosed   {diagnosis['verdict']}: {diagnosis.get('statement', '')}")
    for name, before in sealed["nrmse_before"].items():
        console.print(f"               {name}: error {before:.3f} before, {sealed['nrmse_after'][name]:.3f} after")
    console.print(f"   report      {page}")


def text_of(arguments: list[str]) -> str:
    """Write a command as a user would type it."""
    return shlex.join(["aeolid", *arguments])


def start(arguments: list[str]) -> subprocess.Popen[str]:
    """Start a sub-command in a process of its own."""
    console.print(f"   $ {text_of(arguments)} &", markup=False)
    command = python_command("-m", "aeolid.cli.main", *arguments)
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def call(arguments: list[str], *, quiet: bool = False) -> None:
    """Run a sub-command to its end; raises DataError where it fails."""
    console.print(f"   $ {text_of(arguments)}", markup=False)
    done = subprocess.run(
        python_command("-m", "aeolid.cli.main", *arguments), stdout=subprocess.PIPE, text=True, check=False
    )
    if not quiet:
        for line in done.stdout.splitlines():
            console.print(f"   {line}", markup=False)
    if done.returncode == 2:
        raise UsageError(f"aeolid {arguments[0]} refused its options")
    if done.returncode != 0:
        raise DataError(f"aeolid {arguments[0]} ended with exit code {done.returncode}")


if __name__ == "__main__":
    sys.exit(main())
