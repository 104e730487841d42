"""Gate: for small sizes no state, sample or saved array makes a filter leave its memory or compute what C leaves open.

Proven by CBMC over tests/proof/proof.c, for all values at once. python proof.py ROOT [FILTER STEP ...]: by default what
takes seconds; `all` instead adds what takes a minute. STEP is update or restore. Exit code 77 where CBMC is missing;
sh tests/proof/fetch brings it.
"""

import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import gate

TESTS = Path(__file__).resolve().parents[1]
QUICK = [(name, step) for name in ("rls", "els", "fast_rls", "lattice") for step in ("update", "restore")]
# Minutes of processor: `sh tests/run nightly`. The steps of els are those of rls on a longer regressor. By day
# restoring rls is proven, and fuzzing restores every filter.
SLOW = [("rls", "update"), ("els", "update"), ("els", "restore"), ("fast_rls", "update"), ("lattice", "update")]
SLOW += [("fast_rls", "restore"), ("lattice", "restore")]
CHECKS = ["bounds", "pointer", "pointer-overflow", "signed-overflow", "div-by-zero", "conversion", "undefined-shift"]
STREAMING = ("budget", "crc", "describe", "frame", "spread", "stream", "status", "markov")


def find_cbmc() -> str:
    """Return the prover's path, empty when there is none."""
    fetched = TESTS.parent / "build/cbmc/cbmc"
    return shutil.which("cbmc") or (str(fetched) if fetched.exists() else "")


def prove(cbmc: str, name: str, step: str) -> tuple[list[str], str]:
    """Return what could not be proven of one step of one filter, and how much was."""
    sources = [str(path) for path in gate.SOURCES if path.stem not in STREAMING]
    include = [f"-I{path}" for path in (TESTS / "proof/bare", gate.ROOT / "include", gate.ROOT / "src")]
    command = [
        cbmc,
        f"-DPROVE_{name.upper()}",
        f"-DPROVE_{step.upper()}",
        "-DAEO_NO_VECTORS",
        *include,
        str(TESTS / "proof/proof.c"),
        *sources,
    ]
    command += ["--unwind", "120", "--unwinding-assertions", "--drop-unused-functions"]
    command += ["--object-bits", "12"]  # 8 by default: the lattice's loops, unwound, address more than 256 objects
    command += [f"--{check}-check" for check in CHECKS]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    findings = [f"{name} {step}: {line}" for line in lines if line.endswith(": FAILURE")]
    if done.returncode and not findings:
        findings = [f"{name} {step}: {' '.join((lines + done.stderr.splitlines())[-4:])}"]
    proven = next((line for line in lines if line.startswith("** 0 of")), "nothing")
    return findings, f"{name} {step} {proven.removeprefix('** 0 of ').split()[0]}"


def main() -> None:
    cbmc = find_cbmc()
    if not cbmc:
        print("skipped: cbmc is not installed (sh tests/proof/fetch)")
        sys.exit(77)
    words = sys.argv[2:]
    wanted = QUICK if words == ["all"] else [pair for pair in QUICK if pair not in SLOW]
    if len(words) > 1:
        wanted = list(zip(words[::2], words[1::2], strict=True))
    findings, figures = [], []
    for name, step in wanted:
        wrong, figure = prove(cbmc, name, step)
        findings += wrong
        figures.append(figure)
    gate.finish(findings, "properties proven: " + ", ".join(figures))


if __name__ == "__main__":
    main()
