"""Name the live modes of a stream, and tell harmonics of the rotor and steady sines from them.

What `identify` and `modes` do for a recording (`harmonics`), on the newest samples of a stream. How the rotor turns is
read from its azimuth or speed, in whatever channel the node sends it. Steady sines are sought where the node describes
no input, as then only the outputs can tell a periodic force from a mode.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.harmonics import is_tone
from aeolid.identify.mode_names import named
from aeolid.identify.rotor import Rotation, rotation
from aeolid.models.modes import Mode, mark_harmonics
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
VALUES = 1 << 17  # kept of a node: 1 MB, and of three outputs 43,000 samples
SAMPLES = 1 << 14  # at most: 27 minutes at 10 Hz, and a tenth of a second for each sine that is looked at


class Heard:
    """Keep the newest outputs of a node, and what it sends besides, to mark its modes by them.

    turning: how the rotor turned when it was last looked, None where no channel tells.
    """

    def __init__(self, channels: Sequence[Channel], sample_time_s: float, output_only: bool) -> None:
        """Prepare. channels: outputs, then what else is sent; output_only: the node describes no input."""
        self.turning: Rotation | None = None
        self._channels, self._step, self._alone = tuple(channels), sample_time_s, output_only
        self._tones: frozenset[int] = frozenset()
        self._parts: deque[Array] = deque()
        self._kept = 0
        self._most = min(SAMPLES, VALUES // max(len(self._channels), 1))

    def add(self, y: Array, s: Array | None) -> None:
        """Take samples y (N, l) and what else is sent (N, k), NaN where lost."""
        width = len(self._channels) - y.shape[1]
        rows = np.hstack([y, np.full((len(y), width), np.nan) if s is None else s])[-self._most :]
        self._parts.append(rows)
        self._kept += len(rows)
        while self._kept - len(self._parts[0]) >= self._most:
            self._kept -= len(self._parts.popleft())

    def skip(self) -> None:
        """Note that samples are missing here: no sine is fitted across."""
        self.add(np.full((1, len(self._channels)), np.nan), np.zeros((1, 0)))

    def look(self, modes: Sequence[tuple[int, Mode]]) -> None:
        """Find how the rotor turns, and which of these modes with their numbers are steady sines.

        Cost: a tenth of a second for each mode whose damping may be none.
        """
        if not self._parts:
            return
        values = np.concatenate(self._parts)
        time_s = np.arange(len(values), dtype=np.float64) * self._step
        record = Record(np.asarray(time_s, dtype=np.float64), values, self._channels, self._step, "stream", "")
        self.turning = rotation(record)
        self._tones = frozenset(n for n, m in modes if self._alone and _is_tone(m, record))

    def marked(self, modes: Sequence[tuple[int, Mode]], duration_s: float) -> tuple[Mode, ...]:
        """Return the modes, of these with their numbers by frequency, named and marked. duration_s: of the stream."""
        found, turning = tuple(m for _, m in modes), self.turning
        if turning is not None:
            found = mark_harmonics(found, turning.frequency_hz, turning.deviation_hz, duration_s)
        tones = [number in self._tones and m.rotor_order is None for (number, _), m in zip(modes, found, strict=True)]
        found = tuple(replace(m, tone=tone) for m, tone in zip(found, tones, strict=True))
        return named(found, None if turning is None else turning.frequency_hz)


def _is_tone(mode: Mode, record: Record) -> bool:
    """Tell whether a mode is a steady sine; not where no sine can be fitted, as to outputs that stand still."""
    try:
        return is_tone(mode, [record])
    except np.linalg.LinAlgError:
        return False
