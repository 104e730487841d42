"""What the node takes on its command line: whole numbers, ranges of channels, and filters that it can run."""

import json
import struct
import subprocess
from typing import Any

import pytest

from aeolid.native import find_native

SAMPLES = 30
WHOLE = [
    ("--past", 2), ("--feedthrough", 0), ("--bit-rate", 10_000), ("--node-id", 3), ("--sample-every", 0),
    ("--repair", 25), ("--varx-samples", 16), ("--fd-ratio", 1), ("--base", 0x680),
]  # fmt: skip


def run(*options: str, channel: tuple[str, str] = ("0", "1"), value: float = 0.0) -> tuple[int, str, dict[str, Any]]:
    """Feed the node with two channels, the output at value + k % 5; returns exit code, what it said, and its health."""
    words = [str(find_native("aeolid-node")), "--input", "u", "-", "0", "1", "--output", "y", "-", *channel]
    words += ["--sample-time", "0.1", "--past", "2", "--speed", "max", "--share", "0", *options]
    samples = b"".join(struct.pack("<4d", k, 0.1 * k, k % 3, value + k % 5) for k in range(SAMPLES))
    done = subprocess.run(words, input=samples, capture_output=True, timeout=3600)
    said = done.stderr.decode()
    health = json.loads(said.split("health ", 1)[1]) if "health " in said else {}
    return done.returncode, said, health


@pytest.mark.parametrize(("option", "value"), WHOLE)
def test_fractions_of_whole_numbers_are_refused(option: str, value: int) -> None:
    """A number between two that are taken is refused by its option, and nothing is run; the two are taken."""
    for fraction in (value + 0.5, value + 0.99):
        code, said, _ = run(option, repr(fraction))
        assert code == 2
        assert said.startswith(f"aeolid-node: {option} {fraction!r}: a whole number ") and said.count("\n") == 1
    others = [value] if option == "--base" else [value, value + 1]
    for whole in others:
        code, said, health = run(option, f"{whole:e}")
        assert code == 0, said
        assert health["samples"] == SAMPLES


def test_a_port_is_a_whole_number() -> None:
    """A port with a fraction is no port."""
    code, said, _ = run("--bus", "tcp:0.5")
    assert code == 2 and "a whole number 0 ... 65535" in said


def test_other_numbers_keep_their_fractions() -> None:
    """Shares, times and factors are no whole numbers."""
    code, said, _ = run("--share", "12.5", "--forget", "0.9875", "--regularize", "0.5", "--snapshot-every", "0.25")
    assert code == 0, said


@pytest.mark.parametrize(
    ("offset", "scale", "value", "refused"),
    [
        ("0", "0.5", 48.5, 3 * SAMPLES // 5),  # beyond 50: three of the values 48.5, 49.5 to 52.5
        ("0", "1", 1000.0, 0),  # not scaled: no range
        ("1000", "1", 1000.0, 0),
        ("1000", "1", 899.5, SAMPLES // 5),  # 899.5 lies below 900
    ],
)
def test_a_channel_has_the_range_that_the_header_says(offset: str, scale: str, value: float, refused: int) -> None:
    """Beyond offset -+ 100 scale a sample is counted as out of range and not filtered."""
    code, said, health = run(channel=(offset, scale), value=value)
    assert code == 0, said
    assert health["range"] == refused
    assert health["accepted"] == SAMPLES - refused


def test_a_range_without_width_is_refused() -> None:
    """A scale far below what single precision shows of the offset would refuse every sample."""
    code, said, _ = run(channel=("1e9", "1e-6"))
    assert code == 2 and said.startswith("aeolid-node: --output y: a scale ")


def test_a_filter_that_cannot_be_is_refused_by_its_setting() -> None:
    """The sentence names what the filter refuses and what it would take; with that the node runs."""
    few = ("--method", "fast-rls", "--past", "30")
    code, said, _ = run(*few, "--forget", "0.6")
    assert code == 3 and "filter: forget = 0.6: a memory of 2.5 samples is shorter than the " in said
    assert "fast-rls needs for 60 regressors; raise forget to " in said and "or take rls or lattice" in said
    code, said, _ = run(*few, "--forget", said.split("raise forget to ", 1)[1].split(" ", 1)[0])
    assert code == 0, said
    code, said, _ = run("--past", "512")
    assert code == 3 and "filter: past = 512: with 1 inputs and 1 outputs it must be 1 ... 511" in said
    code, said, _ = run("--feedthrough", "2")
    assert code == 3 and "filter: feedthrough names an input that does not exist; there are 1" in said
