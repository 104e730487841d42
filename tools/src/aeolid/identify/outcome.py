"""Say what every identification says alike: poles in one order, modes and fit as text, the common JSON facts."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aeolid.identify.fit import Fit
from aeolid.identify.order import OrderChoice
from aeolid.models.modes import Mode

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class _Facts(Protocol):
    def to_json(self) -> dict[str, Any]: ...


class _Model(_Facts, Protocol):
    @property
    def sample_time_s(self) -> float: ...


class Outcome(Protocol):
    """Describe what the results of all methods have in common."""

    @property
    def model(self) -> _Model:
        """Return the model."""

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Return its modes."""

    @property
    def singular_values(self) -> Array:
        """Return what the order was judged by."""

    @property
    def order(self) -> int:
        """Return the number of states."""

    @property
    def eigenvalues(self) -> ComplexArray:
        """Return the poles."""

    @property
    def order_choice(self) -> OrderChoice:
        """Return the order and why."""

    @property
    def fit(self) -> Fit:
        """Return the fit on the recordings."""

    @property
    def settings(self) -> _Facts:
        """Return what was asked for."""

    @property
    def data(self) -> tuple[dict[str, Any], ...]:
        """Return source, SHA-256 and length of each recording."""

    @property
    def windows(self) -> int:
        """Return the number of complete windows."""

    @property
    def skipped(self) -> int:
        """Return the number of windows left out."""

    @property
    def gain_method(self) -> str:
        """Return how K was found."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Return the warnings."""

    @property
    def version(self) -> str:
        """Return the version that identified."""

    def to_json(self) -> dict[str, Any]:
        """Return the facts."""


def poles_of(A: Array) -> ComplexArray:
    """Return the eigenvalues (n,) of A, largest magnitude first."""
    values = np.linalg.eigvals(A).astype(complex)
    return values[np.argsort(-abs(values), kind="stable")]


def nearest(poles: ComplexArray, others: ComplexArray) -> NDArray[np.intp]:
    """Return for each pole (n,) the index of its own among as many others, so that all distances add up to least."""
    from scipy.optimize import linear_sum_assignment  # half a second to load

    return np.asarray(linear_sum_assignment(abs(poles[:, None] - others[None]))[1], dtype=np.intp)


def pole_facts(values: Iterable[complex]) -> list[list[float]]:
    """Return poles as [real, imaginary]."""
    return [[float(z.real), float(z.imag)] for z in values]


def common_facts(result: Outcome) -> dict[str, Any]:
    """Return the JSON facts that stand in the result of every method."""
    settings = result.settings.to_json()
    return {
        "method": settings["method"],
        "version": result.version,
        "settings": settings,
        "data": list(result.data),
        "sample_time_s": result.model.sample_time_s,
        "windows": result.windows,
        "windows_skipped": result.skipped,
        "singular_values": result.singular_values.tolist(),
        "order": result.order,
        "order_reason": result.order_choice.reason,
        "eigenvalues": pole_facts(result.eigenvalues),
        "modes": [m.to_json() for m in result.modes],
        "gain": result.gain_method,
        "fit": result.fit.to_json(),
        "notes": list(result.notes),
    }


def model_facts(result: Outcome) -> dict[str, Any]:
    """Return the content of model.json: the model, how its inputs go on within a sample, how it came about."""
    held = "mean" if result.settings.to_json()["decimation"] > 1 else "held"
    return result.model.to_json() | {"intersample": held, "identification": result.to_json()}


def fit_lines(fit: Fit) -> list[str]:
    """Return a line an output: one step and, where the model has inputs, free run."""
    if not fit.driven:
        return [f"{n}: one step {fit.one_step.text(n)}" for n in fit.one_step.vaf]
    return [f"{n}: one step {fit.one_step.text(n)}, free run {fit.free_run.text(n)}" for n in fit.one_step.vaf]
