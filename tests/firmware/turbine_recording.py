"""Write the recording that port/mps2/turbine_node.c plays: the built-in turbine in closed loop, as constants in C.

python turbine_recording.py OUT.h [SAMPLES]. The seed is fixed, so everybody gets the same numbers; values are rounded
to binary32 first, so that offset and scale are those of what the node sends.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from aeolid.can.software_node import feed_from_record
from aeolid.plants import hawt
from aeolid.record import Record

SAMPLES, SEED, PAST, NOISE = 3000, 20091130, 10, 0.1
PLAUSIBLE = 100  # standard deviations: beyond them a number is a sensor's fault and not a sample


def make_recording(samples: int = SAMPLES) -> Record:
    """Return the recording, binary32 values: pitch and torque, generator speed and tower velocities."""
    record = hawt.simulate_closed_loop(samples, SEED, excitation=hawt.Excitation(noise=NOISE))
    return replace(record, values=record.values.astype(np.float32).astype(np.float64))


def _list(values: ArrayLike) -> str:
    """Return binary32 values as a C initialiser, hexadecimal so that no digit is lost."""
    return "{" + ", ".join(f"{float(v).hex()}f" for v in np.asarray(values, np.float32)) + "}"


def write_header(record: Record, path: Path) -> None:
    """Write the header that the node includes."""
    feed = feed_from_record(record)
    channels = feed.inputs + feed.outputs
    offset, scale = feed.offset.astype(np.float32), feed.scale.astype(np.float32)
    described = [
        f'    {{"{c.name}", "{c.unit}", {_list([o, s, o - PLAUSIBLE * s, o + PLAUSIBLE * s])[1:-1]}}},'
        for c, o, s in zip(channels, offset, scale, strict=True)
    ]
    rows = [f"    {_list(row)}," for row in record.columns([c.name for c in channels])]
    lines = [
        f"/* Made by {Path(__file__).name}: {record.source}. */",
        f"enum {{ TURBINE_SAMPLES = {len(record)}, TURBINE_INPUTS = {len(feed.inputs)}, TURBINE_PAST = {PAST},",
        f"       TURBINE_OUTPUTS = {len(feed.outputs)}, TURBINE_PERIOD_US = {round(record.sample_time_s * 1e6)} }};",
        "static const aeo_channel_t turbine_channels[] = {",
        *described,
        "};",
        f"static const aeo_real_t turbine_values[][{len(channels)}] = {{",
        *rows,
        "};",
    ]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    write_header(make_recording(int(sys.argv[2]) if len(sys.argv) > 2 else SAMPLES), Path(sys.argv[1]))
