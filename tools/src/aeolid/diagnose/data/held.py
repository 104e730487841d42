"""Bring a linear model in continuous time to the sample time of a recording whose inputs are held."""

from __future__ import annotations

from dataclasses import replace

from scipy.signal import cont2discrete

from aeolid.models.state_space import StateSpace


def discretise(model: StateSpace, step: float) -> StateSpace:
    """Return the zero-order-hold equivalent of a continuous-time model; its noise model does not carry over."""
    if model.sample_time_s:
        return model
    A, B, C, D, _ = cont2discrete((model.A, model.B, model.C, model.D), step, method="zoh")
    return replace(model, A=A, B=B, C=C, D=D, K=None, innovation_covariance=None, sample_time_s=step)
