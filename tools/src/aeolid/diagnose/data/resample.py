"""Choose how far ahead one prediction looks when the recording is heavily oversampled (S1)."""

from __future__ import annotations

_STEP = 0.1  # of the model's fastest time constant
_FEWEST = 600  # samples that must remain
_WORTH = 4  # smaller factors lose more in samples than they gain


def factor_for(fastest_rate: float, step: float, samples: int) -> int:
    """Return how many samples one prediction spans: a tenth of the model's fastest time constant.

    The model still runs on every input sample; only the corrections by the outputs are this far apart.

    One-step prediction of a heavily oversampled signal is dominated by quantisation and persistence: missing forces
    are corrected away before they show (measured on the positioning stage at 1 kHz: 12.8 N of 20.4 N recovered;
    at 20 Hz 20.7 N). Recordings that are not oversampled keep their rate.
    """
    if fastest_rate <= 0:
        return 1
    factor = min(int(_STEP / (fastest_rate * step)), samples // _FEWEST)
    return factor if factor >= _WORTH else 1


def finer(factor: int) -> int:
    """Return the next smaller factor to look with: a quarter, or the recording's own rate."""
    return factor // 4 if factor // 4 >= _WORTH else 1
