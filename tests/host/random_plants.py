"""Draw linear plants that nobody chose, and run them under inputs, noise and a controller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP = 0.1


@dataclass(frozen=True)
class Drawn:
    """Hold A, B, C and K of x⁺ = A x + B u + K e, y = C x + e."""

    A: Array
    B: Array
    C: Array
    K: Array

    def response(self, delays: tuple[int, ...] = (), points: int = 100) -> NDArray[np.complex128]:
        """Return the frequency response (points, l, r), each input late by its delay."""
        return respond(
            self.A,
            self.B,
            self.C,
            np.zeros((len(self.C), self.B.shape[1])),
            delays,
            points,
        )


def respond(
    A: Array,
    B: Array,
    C: Array,
    D: Array,
    delays: tuple[int, ...] = (),
    points: int = 100,
):
    """Return the frequency response (points, l, r) from 0.02 to 3 rad a sample."""
    z = np.exp(1j * np.linspace(0.02, 3.0, points))[:, None, None]
    late = np.array(delays or (0,) * B.shape[1])
    return (C @ np.linalg.solve(z * np.eye(len(A)) - A, B.astype(complex)) + D) * z ** (-late)


def response_error(true, model) -> float:
    """Return the rms difference of a model's response from the true one (points, l, r), relative to it."""
    found = respond(model.A, model.B, model.C, model.D, points=len(true))
    return float(np.sqrt((abs(found - true) ** 2).sum() / (abs(true) ** 2).sum()))


def draw_plant(rng: np.random.Generator, order: int, inputs: int, outputs: int) -> Drawn:
    """Draw poles of 0.75 to 0.97 at 0.1 to 1.5 rad, or real ones, and a predictor that forgets."""
    while True:
        A, i = np.zeros((order, order)), 0
        while i < order:
            if order - i >= 2 and rng.random() < 0.7:
                r, w = rng.uniform(0.75, 0.97), rng.uniform(0.1, 1.5)
                A[i : i + 2, i : i + 2] = r * np.array([[np.cos(w), np.sin(w)], [-np.sin(w), np.cos(w)]])
                i += 2
            else:
                A[i, i] = rng.uniform(0.3, 0.95)
                i += 1
        turn = np.linalg.qr(rng.standard_normal((order, order)))[0]
        B, C = (
            rng.standard_normal((order, inputs)),
            rng.standard_normal((outputs, order)),
        )
        plant = Drawn(turn @ A @ turn.T, B, C, 0.3 * rng.standard_normal((order, outputs)))
        if abs(np.linalg.eigvals(plant.A - plant.K @ C)).max() < 0.95:
            return plant


def regulator(plant: Drawn) -> tuple[Array, Array, Array]:
    """Return Ac, Bc, Cc of a controller of the plant's order: x_c⁺ = Ac x_c + Bc y, u = Cc x_c."""
    A, B, C = plant.A, plant.B, plant.C
    P = solve_discrete_are(A, B, np.eye(len(A)), np.eye(B.shape[1]))
    L = np.linalg.solve(B.T @ P @ B + np.eye(B.shape[1]), B.T @ P @ A)
    S = solve_discrete_are(A.T, C.T, np.eye(len(A)), np.eye(len(C)))
    F = A @ S @ C.T @ np.linalg.inv(C @ S @ C.T + np.eye(len(C)))
    return A - B @ L - F @ C, F, -L


def run_plant(
    rng: np.random.Generator,
    plant: Drawn,
    added: Array,
    noise: float,
    controller=None,
    delays: tuple[int, ...] = (),
) -> tuple[Array, Array]:
    """Return u and y of the plant under added (N, r), which reaches it late, and a controller, default none."""
    n, (samples, inputs) = len(plant.A), added.shape
    Ac, Bc, Cc = controller or (
        np.zeros((1, 1)),
        np.zeros((1, len(plant.C))),
        np.zeros((inputs, 1)),
    )
    late = delays or (0,) * inputs
    e = noise * rng.standard_normal((samples, len(plant.C)))
    u, y, x, xc = (
        np.zeros((samples, inputs)),
        np.zeros((samples, len(plant.C))),
        np.zeros(n),
        np.zeros(len(Ac)),
    )
    for k in range(samples):
        y[k] = plant.C @ x + e[k]
        u[k] = added[k] + Cc @ xc
        acts = np.array([u[k - d, i] if k >= d else 0.0 for i, d in enumerate(late)])
        x, xc = plant.A @ x + plant.B @ acts + plant.K @ e[k], Ac @ xc + Bc @ y[k]
    return u, y


def recorded(u: Array, y: Array) -> Record:
    """Return a recording of inputs u0, u1, … and outputs y0, y1, …"""
    channels = [Channel(f"u{i}", "", "input") for i in range(u.shape[1])]
    channels += [Channel(f"y{i}", "", "output") for i in range(y.shape[1])]
    return Record(
        STEP * np.arange(len(u)),
        np.hstack([u, y]),
        tuple(channels),
        STEP,
        "drawn.csv",
        "0" * 64,
    )
