"""Take Markov parameters that a controller streamed, in place of those estimated on the host."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.identify.markov import MarkovEstimate, with_theta
from aeolid.identify.windows import Scaling, WindowFactor

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StreamedMarkov:
    """Hold Ξ (l, p m + d) in the channels' units as `filter` and `listen` write it, order of paper 000 eq. (9) or (14).

    innovation (N, l): what the filter took for e, NaN where it made no update; None where the file has none.
    """

    theta: Array
    source: str
    innovation: Array | None = None

    @classmethod
    def load(cls, path: str | Path) -> StreamedMarkov:
        """Read the key `theta` of a markov.npz; raises DataError that names the file."""
        try:
            with np.load(path, allow_pickle=False) as archive:
                if "theta" not in archive:
                    raise DataError(f"{path}: no array 'theta'; it holds {', '.join(archive.files) or 'nothing'}")
                theta = np.asarray(archive["theta"], dtype=np.float64)
                # e is the a posteriori residual where the file has it; a stream carries the innovation only
                kinds = [np.asarray(archive[k], np.float64) for k in ("residual", "innovation") if k in archive]
                innovation = next((e for e in kinds if np.isfinite(e).any()), None)
        except FileNotFoundError:
            raise DataError(f"{path}: no such file") from None
        except (OSError, ValueError, zipfile.BadZipFile, EOFError) as error:
            raise DataError(f"{path}: not a readable .npz of Markov parameters: {error}") from None
        if theta.ndim != 2:
            raise DataError(f"{path}: theta has shape {theta.shape}, a matrix (outputs x regressors) is needed")
        if not np.isfinite(theta).all():
            row, column = np.argwhere(~np.isfinite(theta))[0]
            raise DataError(f"{path}: theta[{row}, {column}] is not finite; the snapshot is incomplete, listen longer")
        return cls(theta, str(path), innovation)

    def replace_in(
        self, estimate: MarkovEstimate, factor: WindowFactor, scaling: Scaling, past: int, through: tuple[bool, ...]
    ) -> MarkovEstimate:
        """Return the estimate with Ξ from the stream, scaled as the samples; the residuals are computed anew."""
        return with_theta(estimate, self.scaled(scaling, past, through), factor)

    def scaled(self, scaling: Scaling, past: int, through: tuple[bool, ...]) -> Array:
        """Return Ξ (l, p m + r) in the scaled units of the windows; raises DataError when its size does not fit."""
        outputs, m, r = len(scaling.outputs), scaling.channels, len(scaling.inputs)
        present = [i for i in range(r) if through[i]]
        expected = (outputs, past * m + len(present))
        if self.theta.shape != expected:
            other = {
                (outputs, past * (m + outputs) + len(present)): "; it is of a VARMAX filter: --method varmax",
                (outputs, past * (m - outputs) + len(present)): "; it is of a VARX filter: --method varx",
            }
            raise DataError(
                f"{self.source}: theta is {self.theta.shape[0]}x{self.theta.shape[1]}; past window {past} with {r} "
                f"inputs, {outputs} outputs and feedthrough of {len(present)} needs {expected[0]}x{expected[1]}"
                + other.get(self.theta.shape, "")
            )
        keep = [*range(past * m), *(past * m + i for i in present)]
        columns = np.concatenate([np.tile(scaling.scale, past), scaling.scale[:r][present]])
        theta = np.zeros((outputs, past * m + r))
        theta[:, keep] = self.theta * columns / scaling.scale[r : r + outputs, None]
        return theta
