"""Draw plants by seed on which nothing was tuned, and record them: modes, loops, noise, and the damage of recordings.

A plant has 2 to 8 modes between 0.05 and 0.8 of the Nyquist frequency with 0.3 to 20 % damping, sometimes a real pole
or an integrator, 1 to 3 inputs and outputs in units of any size, and

    x⁺ = A x + B u + G w,   y = C x + D u + v,   u = r − F c   (open loop: F = 0),

where c is y itself (then D = 0: an algebraic loop leaves D open) or its low-pass c⁺ = α c + (1 − α) y. What the data
can tell of a mode is known beforehand: the Cramér–Rao bound of its pole (`bounds`), from the spectra in the loop.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import block_diag, solve_discrete_are

from aeolid.identify.frequency import transfer

Array = Any
SHORTEST, LONGEST = 300, 100_000  # samples
LEAST_APART = 1.06  # ratio of two modes' frequencies: nearer ones are one peak
GRID, NEAR = 800, 31  # frequencies of the bound: even ones, and about each pole


@dataclass(frozen=True, eq=False)
class Plant:
    """Hold a drawn plant and its loop.

    A (n, n) … D (l, r); G (n, g) of the process noise (unit variance), v (l,) deviations of the measurement noise;
    F (r, l) feedback, lag: α of its low-pass, None where it acts within the sample; colour (r,): coefficient of the
    first-order excitation of unit variance.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    G: Array
    v: Array
    F: Array
    lag: float | None
    colour: Array
    sample_time_s: float

    def loop(self) -> tuple[Array, Array, Array, Array]:
        """Return the closed system from [r; w; v] to [u; y] as (A, B, C, D), its states of plant and controller."""
        n, r, outputs, g = len(self.A), self.B.shape[1], len(self.C), self.G.shape[1]
        eye, none = np.eye(outputs), np.zeros
        if self.lag is None:  # u = r − F (C x + v)
            A, B = self.A - self.B @ self.F @ self.C, np.hstack([self.B, self.G, -self.B @ self.F])
            C = np.vstack([-self.F @ self.C, self.C])
            return A, B, C, np.block([[np.eye(r), none((r, g)), -self.F], [none((outputs, r + g)), eye]])
        feed = 1 - self.lag
        seen = np.hstack([self.C, -self.D @ self.F])  # y of the states [x; c]
        A = np.vstack(
            [np.hstack([self.A, -self.B @ self.F]), feed * seen + np.hstack([none((outputs, n)), self.lag * eye])]
        )
        B = np.block([[self.B, self.G, none((n, outputs))], [feed * self.D, none((outputs, g)), feed * eye]])
        C = np.vstack([np.hstack([none((r, n)), -self.F]), seen])
        return A, B, C, np.block([[np.eye(r), none((r, g + outputs))], [self.D, none((outputs, g)), eye]])

    def controller(self, z: Array) -> Array:
        """Return F c/y at z (points,): (points, r, l)."""
        share = np.ones(len(z)) if self.lag is None else (1 - self.lag) / (z - self.lag)
        return share[:, None, None] * self.F


@dataclass(frozen=True, eq=False)
class Drawn:
    """Hold a plant, its recordings, and what was done to them.

    recordings: each (samples, r + l), NaN where missing; share (modes,): largest part of an output's variance that the
    motion of each pole of `poles` makes; classes: words by which results are counted.
    """

    plant: Plant
    recordings: list[Array]
    poles: Array
    share: Array
    classes: tuple[str, ...]
    samples: int
    facts: dict[str, Any] = field(default_factory=dict)


def draw(seed: int, number: int, samples: int | None = None) -> Drawn:
    """Draw plant and recordings; samples: their length in place of one from 300 to 100,000, even on the logarithm."""
    random = np.random.default_rng([seed, number])
    long = int(np.exp(random.uniform(np.log(SHORTEST), np.log(LONGEST))))
    samples = long if samples is None else samples
    plant, words = draw_plant(random)
    values, share = simulate(plant, samples, random)
    recordings, more = damage(values, plant, random)
    poles = one_of_pairs(np.linalg.eigvals(plant.A))
    return Drawn(plant, recordings, poles, share, (*words, *more, _length(samples)), samples)


def one_of_pairs(poles: Array) -> Array:
    """Return the poles with Im ≥ 0, by angle and size."""
    chosen = poles[poles.imag >= 0].astype(complex)
    return chosen[np.lexsort((abs(chosen), np.angle(chosen)))]


def draw_plant(random: np.random.Generator) -> tuple[Plant, tuple[str, ...]]:
    """Draw a plant in its loop; the words say of which classes it is."""
    r, outputs = (int(k) for k in random.integers(1, 4, 2))
    blocks, words = _blocks(random)
    A = block_diag(*blocks)
    n = len(A)
    B, C = random.standard_normal((n, r)), random.standard_normal((outputs, n))
    C = C * _sizes(blocks, A, B, random)
    C *= 10.0 ** random.uniform(-2, 3, (outputs, 1))
    size = _output_deviation(A, B, C, np.zeros((outputs, r)))
    closed, through, direct = random.random() < 0.4, random.random() < 0.35, random.random() < 0.5
    through &= not (closed and direct)
    D = random.standard_normal((outputs, r)) * size[:, None] * 10.0 ** random.uniform(-1, 0.5) * through
    G = random.standard_normal((n, 2))
    G *= (
        10.0 ** random.uniform(-2, -0.15)
        * size.max()
        / max(_output_deviation(A, G, C, np.zeros((outputs, 2))).max(), 1e-300)
    )
    v = size * 10.0 ** random.uniform(-3, -0.3, outputs)
    colour = random.uniform(0, 0.8, r) * (random.random() < 0.4)
    dt = float(10.0 ** random.uniform(-2.3, 0))
    open_loop = Plant(A, B, C, D, G, v, np.zeros((r, outputs)), 0.0, colour, dt)
    plant = close(open_loop, direct, random) if closed else open_loop
    words += ("closed loop" if plant.F.any() else "open loop",)
    words += ("feedthrough",) if through else ()
    words += ("loop within the sample",) if plant.lag is None else ()
    return plant, (*words, "coloured excitation") if colour.any() else words


def _blocks(random: np.random.Generator) -> tuple[list[Array], tuple[str, ...]]:
    """Draw the poles as real blocks: modes, then perhaps a real pole, an integrator."""
    count, angles = int(random.integers(2, 9)), []
    while len(angles) < count:
        angle = np.pi * np.exp(random.uniform(np.log(0.05), np.log(0.8)))
        if all(max(angle / a, a / angle) > LEAST_APART for a in angles):
            angles.append(angle)
    damping = np.exp(random.uniform(np.log(0.003), np.log(0.2), count))
    blocks = []
    for angle, zeta in zip(angles, damping, strict=True):
        z = np.exp(angle * (-zeta + 1j * np.sqrt(1 - zeta**2)))
        blocks.append(np.array([[z.real, z.imag], [-z.imag, z.real]]))
    words: tuple[str, ...] = ()
    if random.random() < 0.25:
        blocks.append(np.array([[np.exp(-1 / np.exp(random.uniform(np.log(3), np.log(100))))]]))
        words += ("real pole",)
    if random.random() < 0.1:
        blocks.append(np.eye(1))
        words += ("integrator",)
    return blocks, words


def _sizes(blocks: list[Array], A: Array, B: Array, random: np.random.Generator) -> Array:
    """Return factors (n,) of the columns of C by which modes have deviations of 0.1 to 1 under white inputs."""
    factors, first = np.empty(len(A)), 0
    for block in blocks:
        own = slice(first, first + len(block))
        size = _output_deviation(A[own, own], B[own], np.eye(len(block)), np.zeros((len(block), B.shape[1])))
        factors[own] = 10.0 ** random.uniform(-1, 0) / size.max()
        first += len(block)
    return factors


def _output_deviation(A: Array, B: Array, C: Array, D: Array) -> Array:
    """Return the outputs' deviations (l,) under white inputs; an integrator as if it forgot in 100 samples."""
    A = np.where(np.isclose(A, 1.0) & (np.eye(len(A)) > 0), 0.99, A)
    variance, power, P = B @ B.T, A, B @ B.T
    while abs(variance).max() > 1e-12 * max(abs(P).max(), 1e-300):
        variance = power @ P @ power.T
        P, power = P + variance, power @ power
    return np.sqrt(np.diag(C @ P @ C.T + D @ D.T))


def close(plant: Plant, direct: bool, random: np.random.Generator) -> Plant:
    """Return the plant under a random feedback that keeps it stable, as it is where twenty draws held none."""
    z = np.exp(1j * np.linspace(0.02, np.pi, 400))
    gains = np.linalg.norm(transfer(plant.A, plant.B, plant.C, plant.D, z), axis=(0, 2))  # (l,)
    for _ in range(20):
        F = random.standard_normal(plant.F.shape) / gains * 20.0 * 10.0 ** random.uniform(-0.5, 0.5)
        lag = None if direct else float(random.uniform(0, 0.9))
        for _ in range(8):
            tried = Plant(**{**plant.__dict__, "F": F, "lag": lag})
            if abs(np.linalg.eigvals(tried.loop()[0])).max() < 1 - 1e-4:
                return tried
            F = F / 2
    return plant


def simulate(plant: Plant, samples: int, random: np.random.Generator) -> tuple[Array, Array]:
    """Return [u, y] (samples, r + l) and, for each of `one_of_pairs`, its largest share of an output's variance."""
    A, B, C, D = plant.loop()
    r, g, outputs, n = plant.B.shape[1], plant.G.shape[1], len(plant.C), len(plant.A)
    settle = 300
    noise = random.standard_normal((samples + settle, r + g + outputs))
    for j, a in enumerate(plant.colour):
        noise[:, j] = _coloured(noise[:, j], float(a))
    noise[:, r + g :] *= plant.v
    push, states, x = noise @ B.T, np.empty((samples + settle, len(A))), np.zeros(len(A))
    for k in range(samples + settle):
        states[k] = x
        x = A @ x + push[k]
    states, noise = states[settle:], noise[settle:]
    values = states @ C.T + noise @ D.T
    poles, right = np.linalg.eig(plant.A)
    amplitudes = states[:, :n] @ np.linalg.inv(right).T  # (samples, n)
    power = values[:, r:].var(axis=0)
    share = []
    for pole in one_of_pairs(poles):
        i = int(np.argmin(abs(poles - pole)))
        motion = np.real(amplitudes[:, i, None] * (plant.C @ right[:, i])) * (2 if poles[i].imag else 1)
        share.append(float((motion.var(axis=0) / power).max()))
    return values, np.array(share)


def _coloured(white: Array, a: float) -> Array:
    from scipy.signal import lfilter

    return lfilter([np.sqrt(1 - a**2)], [1.0, -a], white)


def damage(values: Array, plant: Plant, random: np.random.Generator) -> tuple[list[Array], tuple[str, ...]]:
    """Cut into recordings, and add offsets, drift, spikes and holes, each now and then."""
    r, words = plant.B.shape[1], []
    pieces = [values.copy()]
    if len(values) >= 900 and random.random() < 0.3:
        pieces = [p.copy() for p in np.array_split(values, int(random.integers(2, 4)))]
        words.append("several recordings")
    deviation = values.std(axis=0)
    if random.random() < 0.6:
        words.append("offsets")
        for piece in pieces:
            piece += deviation * random.uniform(-5, 5, len(deviation))
    if random.random() < 0.12:
        words.append("drift")
        for piece in pieces:
            way = np.sin(np.linspace(0, np.pi * random.uniform(0.5, 2), len(piece)))
            piece[:, r:] += way[:, None] * deviation[r:] * random.uniform(0.3, 2)
    if random.random() < 0.15:
        words.append("spikes")
        for _ in range(int(random.integers(3, 13))):
            piece = pieces[int(random.integers(len(pieces)))]
            j = int(random.integers(r, piece.shape[1]))
            piece[int(random.integers(len(piece))), j] += random.choice([-1, 1]) * random.uniform(5, 20) * deviation[j]
    if random.random() < 0.2:
        words.append(_punch(pieces, random))
    return pieces, tuple(words or ["undamaged"])


def _punch(pieces: list[Array], random: np.random.Generator) -> str:
    """Take out single cells, or stretches of all channels; in place."""
    if random.random() < 0.5:
        share = 10.0 ** random.uniform(-2.5, -0.8)
        for piece in pieces:
            piece[random.random(piece.shape) < share] = np.nan
        return "missing cells"
    for piece in pieces:
        for _ in range(int(random.integers(1, 5))):
            start = int(random.integers(len(piece)))
            piece[start : start + max(len(piece) // 40, 3)] = np.nan
    return "missing stretches"


def _length(samples: int) -> str:
    return "N < 2,000" if samples < 2000 else "N < 20,000" if samples < 20_000 else "N ≥ 20,000"


def bounds(plant: Plant, samples: int) -> Array:
    """Return the Cramér–Rao bound of each pole of `one_of_pairs`: √ of the summed variances of both its parts.

    Of all estimators of x⁺ = A x + B u + K e, y = C x + D u + e that know order and feedthrough. With
    T = [G H] = [D I] + Σ c b/(z − λ) and χ = [u; e] of the loop the information of two parameters is
    N/π ∫ Re tr(∂T* (H Λ H*)⁻¹ ∂T Φ_χ) dω; Λ = cov e. Directions of the basis carry none: the pseudo-inverse.
    """
    K, covariance = _innovations(plant)
    r, outputs = plant.B.shape[1], len(plant.C)
    omega, weight = _frequencies(plant)
    z = np.exp(1j * omega)
    G, H = transfer(plant.A, plant.B, plant.C, plant.D, z), transfer(plant.A, K, plant.C, np.eye(outputs), z)
    root = np.linalg.cholesky(covariance)
    left = np.linalg.inv(root) @ np.linalg.inv(H)  # (points, l, l)
    right = _root_of_spectrum(plant, G, H, root, z)  # (points, r + l, r + l)
    poles, vectors = np.linalg.eig(plant.A)
    rows, drive, gradient, wanted = plant.C @ vectors, np.linalg.inv(vectors) @ np.hstack([plant.B, K]), [], []
    for pole in one_of_pairs(poles):
        i = int(np.argmin(abs(poles - pole)))
        wanted.append((len(gradient), 1 if poles[i].imag == 0 else 2))
        gradient += _of_mode(z, poles[i], rows[:, i], drive[i])
    for i, j in np.ndindex(outputs, r if plant.D.any() else 0):
        gradient.append(
            np.broadcast_to(np.outer(np.eye(outputs)[i], np.eye(r + outputs)[j]), (len(z), outputs, r + outputs))
        )
    X = np.array([((left @ d @ right) * np.sqrt(weight / np.pi)[:, None, None]).ravel() for d in gradient])
    information = np.real(X @ X.conj().T) * samples
    size = np.sqrt(np.diag(information))
    inverse = np.linalg.pinv(information / np.outer(size, size), rcond=1e-11, hermitian=True) / np.outer(size, size)
    return np.array([np.sqrt(np.diag(inverse)[at : at + parts].sum()) for at, parts in wanted])


def _of_mode(z: Array, pole: complex, c: Array, b: Array) -> list[Array]:
    """Return the derivatives of T by the real parameters of one mode: pole first, then c and b."""
    near = 1 / (z - pole)[:, None, None]
    complex_ones = [near**2 * np.outer(c, b)]
    complex_ones += [near * np.outer(e, b) for e in np.eye(len(c))] + [near * np.outer(c, e) for e in np.eye(len(b))]
    if pole.imag == 0:
        return complex_ones
    far = 1 / (z - pole.conjugate())[:, None, None]
    mirrored = [far**2 * np.outer(c, b).conj()]
    mirrored += [far * np.outer(e, b.conj()) for e in np.eye(len(c))]
    mirrored += [far * np.outer(c.conj(), e) for e in np.eye(len(b))]
    return [part for p, q in zip(complex_ones, mirrored, strict=True) for part in (p + q, 1j * (p - q))]


def _innovations(plant: Plant) -> tuple[Array, Array]:
    """Return Kalman gain (n, l) and covariance (l, l) of the innovations."""
    Q, R = plant.G @ plant.G.T, np.diag(plant.v**2)
    P = solve_discrete_are(plant.A.T, plant.C.T, Q + 1e-14 * np.trace(Q) * np.eye(len(Q)), R)
    covariance = plant.C @ P @ plant.C.T + R
    return plant.A @ P @ plant.C.T @ np.linalg.inv(covariance), covariance


def _frequencies(plant: Plant) -> tuple[Array, Array]:
    """Return ω (points,) in 0 … π, dense about the poles of plant and loop, and the weights of the integral."""
    near: Iterator[Array] = (
        np.angle(p) + max(1 - abs(p), 1e-6) * np.sinh(np.linspace(-5, 5, NEAR))
        for p in one_of_pairs(np.concatenate([np.linalg.eigvals(plant.A), np.linalg.eigvals(plant.loop()[0])]))
    )
    omega = np.unique(np.concatenate([np.linspace(1e-5, np.pi, GRID), *near]))
    omega = omega[(omega >= 1e-5) & (omega <= np.pi)]
    return omega, np.gradient(omega)


def _root_of_spectrum(plant: Plant, G: Array, H: Array, root: Array, z: Array) -> Array:
    """Return S (points, r + l, r + l) with S S* the spectrum of [u; e] in the loop."""
    r, outputs = plant.B.shape[1], len(plant.C)
    controller = plant.controller(z)
    sensitivity = np.linalg.inv(np.eye(r) + controller @ G)
    size = np.sqrt(1 - plant.colour**2) / abs(1 - plant.colour / z[:, None])  # (points, r)
    S = np.zeros((len(z), r + outputs, r + outputs), complex)
    S[:, :r, :r] = sensitivity * size[:, None, :]
    S[:, :r, r:] = -sensitivity @ controller @ H @ root
    S[:, r:, r:] = root
    return S
