"""What the gates share about linking: the text that the linker takes from the library for one of its parts."""

import subprocess
import tempfile
from pathlib import Path

import gate

RECEIVING = [f"aeo_regressor_{call}" for call in ("init", "push", "z", "y")]
KEEPING = ["aeo_regressor_save", "aeo_regressor_restore"]


def calls(name: str, *others: str) -> list[str]:
    """Return what a program of a filter calls, with others of the filter's functions."""
    return [f"aeo_{name}_{call}" for call in ("init", "update", "innovation", "health", "clear_health", *others)]


# What a program of each part calls; the linker adds what these call, function by function.
PARTS = {
    "rls": [*RECEIVING, *calls("rls", "theta")],
    "rls_with_saving": [*RECEIVING, *KEEPING, *calls("rls", "theta", "save", "restore")],
    "els": [
        *RECEIVING,
        *KEEPING,
        "aeo_regressor_set_innovation",
        *calls("els", "theta", "feedback", "save", "restore"),
    ],
    "fast_rls": [*RECEIVING, *calls("fast_rls", "theta")],
    "fast_rls_with_saving": [*RECEIVING, *KEEPING, *calls("fast_rls", "theta", "save", "restore")],
    "lattice": [*RECEIVING, *calls("lattice", "read")],
    "lattice_with_saving": [*RECEIVING, *KEEPING, *calls("lattice", "read", "save", "restore")],
    "stream": [
        f"aeo_stream_{call}" for call in ("init", "sample", "innovation", "snapshot", "health", "step", "finish")
    ],
    # rls by one description
    "estimator": [
        f"aeo_estimator_{call}"
        for call in ("rls", "init", "take", "theta", "innovation", "health", "clear_health", "save", "restore")
    ],
}


def link(objects: list[Path], wanted: list[str]) -> int:
    """Return the bytes of text, tables included, that the linker takes for a program that calls `wanted`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "program"
        roots = [word for symbol in wanted for word in ("-u", symbol)]
        # what the C library brings (memcpy, memset) is not this library's
        command = ["arm-none-eabi-ld", "--gc-sections", "--unresolved-symbols=ignore-all", "-e", wanted[0], *roots]
        subprocess.run([*command, *map(str, objects), "-o", str(path)], check=True, capture_output=True)
        lines = gate.output("arm-none-eabi-nm", path).splitlines()
        missing = [symbol for symbol in wanted if not any(line.split()[-2:] == ["T", symbol] for line in lines)]
        if missing:
            gate.finish([f"the library has no {symbol}" for symbol in missing], "")
        return int(gate.output("arm-none-eabi-size", path).splitlines()[1].split()[0])


def add_text(objects: list[Path]) -> dict[str, int]:
    """Return the text of each part as linked."""
    return {part: link(objects, wanted) for part, wanted in PARTS.items()}
