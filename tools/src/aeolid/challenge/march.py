"""Run a plant in its loop: a third-order Runge–Kutta rule at many steps a sample, commands held over a sample.

The rule is Kutta's (1901): k₁ = f(s), k₂ = f(s + h k₁/2), k₃ = f(s − h k₁ + 2 h k₂), s' = s + h (k₁ + 4 k₂ + k₃)/6.
Disturbances are held over a fine step. Nothing here is shared with the integrators that models are simulated with.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from aeolid.challenge.paths import RING, drive
from aeolid.compiled import njit

Array = NDArray[np.float64]


@lru_cache
def make_march(flow: Any, see: Any, control: Any) -> Callable[..., tuple[Array, Array]]:
    """Compile the loop of one plant.

    flow(e, t, s, u, w, ds) writes ds/dt; see(e, s, u, w, y) writes the outputs; control(e, y, aim, c, u, dt) writes
    the commands of a sample, c being what the controller remembers.
    """

    @njit
    def march(
        e: Any, row: Array, start: Array, rest: Array, test: Array, between: Array, aim: Array, w: Array, jitter: Array,
        every: int, step: float, closed: bool,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return commands (N, m), outputs at every fine step (N·every, l); between: how commands move in a sample."""
        N, h, n = len(test), step / every, len(start)
        u, y = np.empty(test.shape), np.empty((N * every, jitter.shape[1]))
        s, k, c, now = start.copy(), np.zeros((3, n)), np.zeros(4), np.zeros(jitter.shape[1])
        acting, state, ring = rest.copy(), np.full(3, rest[int(row[0])]), np.full(RING, rest[int(row[0])])
        which = int(row[0])
        if int(row[1]) == 9:
            state[:] = 0.0
        elif int(row[1]) == 2:
            state[1] = 0.0
        for i in range(N):
            see(e, s, acting, w[i * every], now)
            u[i] = rest
            if closed:
                control(e, now + jitter[i], aim[i], c, u[i], step)
            u[i] += test[i]
            for j in range(i * every, (i + 1) * every):
                acting[:] = u[i] + between[j]
                acting[which] = drive(row, state, ring, j, u[i, which] + between[j, which], h, rest[which])
                see(e, s, acting, w[j], y[j])
                t = j * h
                flow(e, t, s, acting, w[j], k[0])
                flow(e, t + 0.5 * h, s + 0.5 * h * k[0], acting, w[j], k[1])
                flow(e, t + h, s - h * k[0] + 2 * h * k[1], acting, w[j], k[2])
                s += h / 6 * (k[0] + 4 * k[1] + k[2])
        return u, y

    return march  # type: ignore[no-any-return]


def wander(rng: np.random.Generator, n: int, memory_s: float, step: float) -> Array:
    """Return n samples of a first-order Gauss–Markov process of spread 1."""
    keep = math.exp(-step / memory_s)
    kicks = rng.standard_normal(n)
    kicks[1:] *= math.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], kicks))


def levels(rng: np.random.Generator, n: int, dwell: int, jump: bool = False) -> Array:
    """Return n samples of steps held for `dwell` samples: −1 and 1, or anything between (`jump`)."""
    count = n // dwell + 1
    values = rng.uniform(-1, 1, count) if jump else rng.choice([-1.0, 1.0], count)
    return np.repeat(values, dwell)[:n]
