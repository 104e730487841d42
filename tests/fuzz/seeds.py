"""Write the sound files that are damaged: small, each with every part that its format has."""

from __future__ import annotations

import io
import json
import struct
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from aeolid.can.wire import Frames

ROOT = Path(__file__).resolve().parents[2]
TIME = np.round(0.1 * np.arange(40), 9)
PITCH, SPEED = np.sin(TIME), 12.0 + np.cos(3 * TIME)
CHANNELS = {"time_s": TIME, "pitch": PITCH, "speed": SPEED}
ROLES = (
    '[recording]\nsample_time_s = 0.1\ntime = "time_s"\n'
    '[[channel]]\nname = "pitch"\nunit = "deg"\nrole = "input"\n'
    '[[channel]]\nname = "rate"\ncolumn = "speed"\nunit = "rpm"\nrole = "output"\n'
    '[[channel]]\nname = "note"\nunit = ""\nrole = "ignore"\n'
)
CASE = (
    '[case]\ntitle = "bench"\n[recordings]\nfiles = ["a.csv"]\nroles = "roles.toml"\n'
    '[baseline]\nkind = "equations"\nfile = "model.toml"\nsame_inputs = false\n'
    '[context]\nmachine = "rig"\nblades = 3\nrated_speed_rad_s = 1.267\n'
)
EQUATIONS = (
    '[model]\nname = "a lag"\ntime = "continuous"\n'
    '[parameters]\nk = { value = 4.0, unit = "1/s", min = 0.1, max = 9.0, free = true, prior_std = 0.5 }\n'
    '[[input]]\nname = "pitch"\nunit = "deg"\n'
    '[[auxiliary]]\nname = "e"\nequation = "pitch - q"\n'
    '[[state]]\nname = "q"\nderivative = "k*tanh(e)"\nunit = "rpm"\ninitial = { value = 0.0, free = true }\n'
    '[[output]]\nname = "rate"\nequation = "q + 12"\nunit = "rpm"\n'
)
LINEAR = {
    "kind": "state_space", "sample_time_s": 0.1, "inputs": [{"name": "pitch", "unit": "deg"}],
    "outputs": [{"name": "rate", "unit": "rpm"}], "states": ["a", "b"], "A": [[0.5, 0.1], [0.0, 0.3]],
    "B": [[1.0], [0.5]], "C": [[1.0, 0.0]], "D": [[0.0]], "K": [[0.1], [0.2]], "x0": [0.0, 0.1],
    "innovation_covariance": [[0.01]], "scheduling": None,
}  # fmt: skip


def table(suffix: str) -> bytes:
    """Return the three channels as a file of one format."""
    from aeolid.formats import write_table

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        if suffix == ".parquet":  # as others write it: pages without checksums, so that damage gets through
            import pyarrow as pa
            from pyarrow import parquet

            parquet.write_table(pa.table({**CHANNELS, "note": list("12345") * 8}), path, compression="none")
        elif suffix in (".csv", ".csv.gz"):
            write_table(path, CHANNELS, {"pitch": "deg", "speed": "rpm"})
        elif suffix == ".npz":
            np.savez(path, **CHANNELS, y=np.column_stack([PITCH, SPEED]), note=np.arange(40).astype(str))
        elif suffix == ".mat":
            from scipy.io import savemat

            savemat(path, {**CHANNELS, "log": {"y": np.column_stack([PITCH, SPEED])}, "n": np.array(["a"], object)})
        elif suffix == ".mf4":
            _mf4(path)
        elif suffix == ".out":
            rows = "".join(
                f"{t:.4f} {p!r} {s!r}\n" for t, p, s in zip(*(v.tolist() for v in CHANNELS.values()), strict=True)
            )
            path.write_text("\n" * 6 + "Time pitch speed\n(s) (deg) (rpm)\n" + rows)
        elif suffix == ".outb":
            path.write_bytes(_outb())
        content = path.read_bytes()
        return content if suffix != ".mat" else b"MATLAB 5.0 MAT-file".ljust(116) + content[116:]  # without the date


def _mf4(path: Path) -> None:
    """Write channels with every numeric conversion, two groups, packed blocks, a text channel."""
    from asammdf import MDF, Signal
    from asammdf.blocks.conversion_utils import from_dict

    kinds = [
        None, {"a": 2.0, "b": 1.0}, {"P1": 0.0, "P2": 1.0, "P3": 1.0, "P4": 0.0, "P5": 0.5, "P6": 3.0},
        {"formula": "2*X + sin(X1)"}, {"raw_0": 0.0, "phys_0": 1.0, "raw_1": 9.0, "phys_1": 3.0, "interpolation": True},
        {"val_0": 1, "text_0": "on", "val_1": 0, "text_1": "off"},
    ]  # fmt: skip
    with MDF(version="4.10") as file:
        base = [
            Signal(PITCH, TIME, name="pitch", unit="deg"),
            Signal(SPEED.astype("f4"), TIME, name="speed", unit="rpm"),
        ]
        for i, kind in enumerate(kinds[1:]):
            conversion = from_dict(kind) if kind else None
            base.append(Signal((TIME * 10).astype("<i4"), TIME, name=f"c{i}", unit="V", conversion=conversion))
        file.append(base, comment="first", common_timebase=True)
        file.append([Signal(PITCH, TIME + 0.05, name="late", unit="deg")], comment="second")
        file.header.start_time = datetime.fromtimestamp(1.7e9, UTC)
        file.save(path, overwrite=True, compression=2)


def _outb() -> bytes:
    """Write the packed kind with time increments."""
    target = io.BytesIO()
    target.write(struct.pack("<hiidd", 2, 2, len(TIME), 0.0, 0.1))
    target.write(np.array([3000.0, 2000.0, 0.0, -24000.0], "<f4").tobytes())
    target.write(struct.pack("<i", 4) + b"test")
    target.writelines(t.ljust(10).encode() for t in ("Time", "pitch", "speed", "(s)", "(deg)", "(rpm)"))
    target.write(np.column_stack([PITCH * 3000, SPEED * 2000 - 24000]).astype("<i2").tobytes())
    return target.getvalue()


def log(suffix: str) -> bytes:
    """Return a short stream of a node as a raw CAN log."""
    from aeolid.can.messages import unpack_messages
    from aeolid.can.raw_log import open_raw_log

    lines = (ROOT / "tests/vectors/wire_v1/stream.log").read_bytes().splitlines(keepends=True)[:300]
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "a.log", Path(folder) / f"b{suffix}"
        source.write_bytes(b"".join(lines))
        if suffix == ".log":
            return source.read_bytes()
        frames = _frames(source)
        if suffix == ".trc":
            import can

            with can.TRCWriter(target) as writer:
                for message in unpack_messages(frames):
                    writer(message)
        else:
            writing = open_raw_log(target)
            writing.write(frames)
            writing.close()
        return target.read_bytes()


def _frames(path: Path) -> Frames:
    from aeolid.can.logs import open_log
    from aeolid.can.wire import join_frames

    source, parts = open_log(str(path)), []
    while source.ended is None:
        parts.append(source.read(0.0))
    return join_frames(parts)


def markov() -> bytes:
    """Return what `aeolid filter` writes, by hand."""
    target = io.BytesIO()
    settings = {
        "past": 4, "model_set": "varx", "feedthrough": [0], "sample_time_s": 0.1, "forgetting": 0.999,
        "regularisation": 1e-3, "offset": [0.0, 12.0], "scale": [1.0, 0.7], "growth_max": 10.0,
    }  # fmt: skip
    np.savez(
        target, theta=np.ones((1, 9)), innovation=np.ones((40, 1)), residual=np.ones((40, 1)),
        settings=np.array(json.dumps(settings)), inputs=np.array(["pitch"]), outputs=np.array(["rate"]),
        input_units=np.array(["deg"]), output_units=np.array(["rpm"]), sha256=np.array("0" * 64),
    )  # fmt: skip
    return target.getvalue()
