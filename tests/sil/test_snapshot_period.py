"""How often the node sends its parameters, where the period asked for is shorter or far longer than a sample."""

import json
import struct
import subprocess

import pytest

from aeolid.native import find_native

SAMPLES = 40


@pytest.mark.parametrize(
    ("sample_time_s", "every_s", "expected"),
    [
        (1.0, 0.01, SAMPLES),  # shorter than a sample: with every sample
        (2e-5, (2**32 + 1) * 2e-5, 0),  # a count of samples beyond 32 bits does not come round again
        (1.0, 0, 0),  # none
        (1.0, 10, SAMPLES // 10),
    ],
)
def test_a_period_is_never_less_than_a_sample_nor_comes_round(
    sample_time_s: float, every_s: float, expected: int
) -> None:
    """Each snapshot asked for is sent or refused because the one before is under way; one more says goodbye."""
    words = [str(find_native("aeolid-node")), "--input", "u", "-", "0", "1", "--output", "y", "-", "0", "1"]
    words += ["--past", "1", "--bus", "tcp:0", "--speed", "max", "--share", "0"]
    words += ["--sample-time", repr(sample_time_s), "--snapshot-every", repr(every_s)]
    samples = b"".join(struct.pack("<4d", k, k * sample_time_s, k % 3, k % 5) for k in range(SAMPLES))
    done = subprocess.run(words, input=samples, capture_output=True, timeout=3600)
    assert done.returncode == 0, done.stderr
    health = json.loads(done.stderr.decode().split("health ", 1)[1])
    assert health["samples"] == SAMPLES
    assert health["snapshots"] + health["busy"] == expected + 1
