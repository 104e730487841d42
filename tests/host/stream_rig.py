"""Drive the streamer of the library from Python: what it sends comes back as frames of the host's receiver."""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.can.wire import Frames

ROOT = Path(__file__).resolve().parents[2]
FRAME = np.dtype({"names": ["id", "length", "flags", "data"], "formats": ["<u4", "u1", "u1", ("u1", 64)],
                  "offsets": [0, 4, 5, 6], "itemsize": 72})  # fmt: skip
FRAMES_MAX = 1 << 18  # kept between two calls of `take`


class Settings(ctypes.Structure):
    """Mirror rig_settings_t."""

    _fields_ = (
        [(name, ctypes.c_uint8) for name in ("node", "inputs", "outputs", "scheduling", "innovations", "seal", "fd",
                                             "fd_ratio", "repair_percent", "burst")]
        + [(name, ctypes.c_uint16) for name in ("sample_every", "health_every", "describe_every")]
        + [(name, ctypes.c_uint32) for name in ("parameters", "bits_per_s")] + [("sample_time_s", ctypes.c_float)]
    )  # fmt: skip


@functools.lru_cache(maxsize=1)
def library() -> Any:
    """Compile streamer and rig."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    target = Path(tempfile.mkdtemp(prefix="aeolid-rig-")) / "rig.so"
    names = ("budget", "crc", "frame", "spread", "describe", "stream", "stream_send", "stream_values")
    sources = [ROOT / "src" / f"{name}.c" for name in names] + [ROOT / "tests/host/stream_rig.c"]
    include = [f"-I{ROOT}/include", f"-I{ROOT}/src"]
    subprocess.run([compiler, "-std=c99", "-O2", "-shared", "-fPIC", *include, "-o", target, *sources], check=True)
    loaded = ctypes.CDLL(str(target))
    shutil.rmtree(target.parent)
    loaded.rig_start.restype = ctypes.c_void_p
    loaded.rig_take.restype = ctypes.c_size_t
    return loaded


@dataclass(eq=False)
class Rig:
    """Own one streamer."""

    settings: Settings

    def __post_init__(self) -> None:
        self._self = ctypes.c_void_p(library().rig_start(ctypes.byref(self.settings), ctypes.c_size_t(FRAMES_MAX)))
        assert self._self.value, "the streamer refuses the settings"
        self._buffer = np.zeros(FRAMES_MAX, FRAME)

    def __del__(self) -> None:
        if self._self.value:
            library().rig_free(self._self)

    def run(self, first: int, values: NDArray[np.float32], innovations: NDArray[np.float32]) -> None:
        """Send samples (n, channels) and innovations (n, outputs) from index `first` on, a step after each."""
        pointers = [np.ascontiguousarray(a, np.float32) for a in (values, innovations)]
        arguments = [a.ctypes.data_as(ctypes.c_void_p) for a in pointers]
        library().rig_run(self._self, ctypes.c_uint32(first), len(values), *arguments)

    def snapshot(self, index: int, theta: NDArray[np.float32]) -> int:
        """Begin to send theta (N,)."""
        words = np.ascontiguousarray(theta, np.float32)
        return int(library().rig_snapshot(self._self, ctypes.c_uint32(index), words.ctypes.data_as(ctypes.c_void_p)))

    def pending(self) -> bool:
        """Tell whether something is under way."""
        return bool(library().rig_pending(self._self))

    def finish(self) -> None:
        """Send all that is under way and say goodbye."""
        assert library().rig_finish(self._self) == 0

    def take(self) -> Frames:
        """Return what has been sent since the last call."""
        count = library().rig_take(self._self, self._buffer.ctypes.data_as(ctypes.c_void_p))
        assert count < FRAMES_MAX
        return as_frames(self._buffer[:count])

    def counters(self) -> dict[str, int]:
        """Return the streamer's own counters."""
        words = (ctypes.c_uint32 * 5)()
        library().rig_counters(self._self, words)
        return dict(zip(("Sent", "Refused", "Dropped", "Snapshots", "Busy"), words, strict=True))


def as_frames(kept: NDArray[Any]) -> Frames:
    """Convert frames as C holds them."""
    width = 64 if (kept["length"] > 8).any() else 8
    return Frames(
        kept["id"].astype(np.uint32), kept["flags"].copy(), kept["length"].copy(), kept["data"][:, :width].copy(),
        np.full(len(kept), np.nan),
    )  # fmt: skip


def settings(**changed: int | float) -> Settings:
    """Return settings of a small node: two inputs, one output, no limit of the bus."""
    usual: dict[str, int | float] = {
        "node": 1, "inputs": 2, "outputs": 1, "scheduling": 0, "innovations": 0, "seal": 1, "fd": 0, "fd_ratio": 4,
        "repair_percent": 25, "burst": 255, "sample_every": 1, "health_every": 10, "describe_every": 600,
        "parameters": 30, "bits_per_s": 0, "sample_time_s": 0.1,
    }  # fmt: skip
    return Settings(**(usual | changed))
