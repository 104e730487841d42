"""The lock of the streamer: what two threads share is only touched under it, and it is held for one frame at a time."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("budget", "crc", "describe", "frame", "spread", "status", "stream", "stream_send", "stream_values")
WRAPPED = ("aeo_spread_repair", "aeo_describe", "aeo_float_bits", "aeo_frame_crc32")


def build(folder: Path, *flags: str) -> Path:
    """Return the program of two threads, or skip by name where it cannot be built or started here."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    program = folder / "stream_threads"
    sources = [ROOT / "tests/host/stream_threads.c", *(ROOT / f"src/{name}.c" for name in SOURCES)]
    wrap = [f"-Wl,--wrap={name}" for name in WRAPPED]
    command = ["gcc", "-std=gnu11", "-O1", "-g", "-pthread", "-Wall", "-Wextra", "-Werror", f"-I{ROOT / 'include'}"]
    subprocess.run([*command, *flags, *wrap, *map(str, sources), "-o", str(program)], check=True, timeout=3600)
    return program


@pytest.mark.parametrize("form", ["classic", "fd"])
def test_the_lock_is_held_for_one_frame(tmp_path: Path, form: str) -> None:
    """Neither a repair, nor the copy of a snapshot, nor the empty slots of a description are made under the lock."""
    done = subprocess.run([build(tmp_path), form], capture_output=True, text=True, timeout=3600, check=True)
    repairs, described, copied, sums = map(int, done.stdout.split())
    values, own = (14, 16) if form == "fd" else (1, 0)  # of one frame; words under its own CRC-32
    assert (repairs, described) == (0, 1)
    assert copied <= values and sums <= values + own


@pytest.mark.parametrize("form", ["classic", "fd"])
def test_two_threads_share_nothing_but_under_the_lock(tmp_path: Path, form: str) -> None:
    """ThreadSanitizer sees no race between sample, snapshot, health and finish here, step and pending there."""
    probe = tmp_path / "probe.c"
    probe.write_text("int main(void) { return 0; }\n")
    built = subprocess.run(["gcc", "-fsanitize=thread", probe, "-o", tmp_path / "probe"], capture_output=True)
    if built.returncode or subprocess.run([tmp_path / "probe"], capture_output=True).returncode:
        pytest.skip("ThreadSanitizer is not installed or does not start here")
    program = build(tmp_path, "-fsanitize=thread")
    done = subprocess.run([program, form], capture_output=True, text=True, timeout=3600)
    assert "WARNING: ThreadSanitizer" not in done.stderr, done.stderr[:3000]
    assert done.returncode == 0, done.stderr
