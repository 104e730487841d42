"""Go from the factor of a loop's windows to its plant: the steps of paper 002 in their order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.markov import estimate_markov
from aeolid.identify.ort.joint import Layout, Lq, decompose_windows
from aeolid.identify.ort.plant import connect, fit_response, join, reduce, with_better_gain
from aeolid.identify.ort.subsystems import (
    Deterministic,
    Spectra,
    Stochastic,
    find_spectra,
    realise_deterministic,
    realise_stochastic,
)
from aeolid.identify.subspace import ScaledModel, StateBasis, find_states
from aeolid.identify.windows import WindowFactor

Array = NDArray[np.float64]
RESPONSES = ("fit", "theorem")


@dataclass(frozen=True, eq=False)
class Loop:
    """Hold a decomposed window factor, from which subsystems and plants of any order follow.

    deterministic_order: n_d of the deterministic subsystem, None where it has the order n_s of the stochastic one.
    """

    factor: WindowFactor
    layout: Layout
    lq: Lq
    spectra: Spectra
    deterministic_order: int | None = None

    @classmethod
    def of(cls, factor: WindowFactor, layout: Layout, deterministic_order: int | None = None) -> Loop:
        """Decompose the factor of windows of p + f + 1 samples."""
        lq = decompose_windows(factor, layout)
        return cls(factor, layout, lq, find_spectra(lq, factor.windows), deterministic_order)

    @property
    def most(self) -> int:
        """Return the largest order of the two subsystems that the windows allow."""
        joint, q = len(self.layout.joint), len(self.layout.disturbances)
        window = min((self.layout.future - 1) * joint, self.layout.past * q, self.layout.past * joint)
        return min(self.spectra.most, window)

    @property
    def most_plant(self) -> int:
        """Return the largest order of the plant that the future window allows."""
        return min(self.most, (self.layout.future - 1) * len(self.layout.outputs))

    @cached_property
    def predictor(self) -> StateBasis:
        """Return the decomposition of PBSIDopt over the whole window, disturbances as inputs."""
        theta = estimate_markov(self.factor, self.layout.block_through, "gcv").theta
        return find_states(self.factor, theta, self.layout.future)

    def subsystems(self, order: int) -> tuple[Deterministic, Stochastic]:
        """Return the deterministic and the stochastic subsystem, n_s = order and n_d = `deterministic_order` or n_s.

        T = Γ_s^† Γ_d (n_s, n_d) joins them whichever is the larger: with n_d < n_s it puts the deterministic states
        where they belong among the stochastic ones, with n_d > n_s it drops what those do not show.
        """
        stochastic = realise_stochastic(self.spectra, self.factor, self.lq, self.layout, order)
        own = self.deterministic_order or order
        return realise_deterministic(self.spectra, self.lq, self.layout, own), stochastic

    def plant(self, joint: tuple[Deterministic, Stochastic], order: int, response: str) -> tuple[ScaledModel, Array]:
        """Return the plant of this order, scaled, and the values (n_s,) by which states were kept.

        response: "fit" fits B and D of the disturbances again, "theorem" keeps those of Theorem 5. K is the better one
        of the stochastic subsystem and of PBSIDopt.
        """
        model, values = reduce(join(*joint, self.layout), self.factor, order)
        model = fit_response(model, self.lq, self.layout) if response == "fit" else model
        return with_better_gain(model, self.predictor, self.factor, self.layout), values

    def poles(self, joint_order: int, order: int) -> NDArray[np.complex128]:
        """Return the poles (n,) of the plant; neither gain nor the fit of the response moves them."""
        model, _ = reduce(join(*self.subsystems(joint_order), self.layout), self.factor, order)
        return np.linalg.eigvals(model.A).astype(complex)


def compatibility(deterministic: Deterministic, stochastic: Stochastic) -> float:
    """Return |Γ_d − Γ_s T|/|Γ_d|: 0 where both subsystems show the same poles, Lemma 4."""
    T = connect(deterministic, stochastic)
    gap = deterministic.gamma - stochastic.gamma @ T
    return float(np.linalg.norm(gap) / np.linalg.norm(deterministic.gamma))
