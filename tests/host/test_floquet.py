"""Floquet modes of models that are periodic in an angle: laws, and systems whose answer is known otherwise."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, expm

from aeolid.errors import AeolidError, DataError, NotIdentifiable, UsageError
from aeolid.models.floquet import floquet_of
from aeolid.models.hill import _solutions, backward_errors, monodromy, solve_families
from aeolid.models.lpv import LpvStateSpace
from aeolid.models.model_file import Signal
from aeolid.models.modes import modes_of
from aeolid.models.periodic import Covariance, scaled_weights, weights_of
from aeolid.models.rotor_speed import read_rotor_speed

PARTS = ("azimuth_cos", "azimuth_sin")


def model_of(A, C, step=0.1, names=PARTS, innovation=None):
    """Return a scheduled model of matrices A (m, n, n) and one C (l, n) or several."""
    A, C = np.array(A, float), np.array(C, float)
    m, n = len(A), A.shape[1]
    if C.ndim == 2:
        C = np.concatenate([C[None], np.zeros((m - 1, *C.shape))])
    outputs = C.shape[1]
    signals = [tuple(Signal(f"{c}{i + 1}") for i in range(k)) for c, k in (("u", 1), ("y", outputs), ("x", n))]
    return LpvStateSpace(
        A, np.zeros((m, n, 1)), C, np.zeros((m, outputs, 1)), None, np.zeros((m, n)), np.zeros(n), innovation, step,
        *signals, tuple(map(Signal, names)),
    )  # fmt: skip


def swing(hertz, damping, step=0.1):
    omega = 2 * np.pi * hertz
    return expm(step * np.array([[0, 1], [-(omega**2), -2 * damping * omega]]))


def periodic(seed=0, size=0.04):
    """Return a stable model of four states with 2 %, 4 % of damping that changes with cosine and sine."""
    random = np.random.default_rng(seed)
    blocks = [block_diag(swing(0.33, 0.02), swing(1.1, 0.04)), *(size * random.standard_normal((2, 4, 4)))]
    balance = np.diag([1, 1 / 2.1, 1, 1 / 6.9])  # velocities in the size of displacements
    return model_of([balance @ M @ np.linalg.inv(balance) for M in blocks], random.standard_normal((2, 4)))


def numbers(found):
    return np.array([(m.frequency_hz, m.damping) for m in found.modes])


SWINGS = 0.33 * np.sqrt(1 - 0.02**2)  # Hz, of the damped motion


@pytest.mark.parametrize("hertz", [0.2, 0.1234, SWINGS / 2, 2 * SWINGS, 2 * SWINGS / 3, -0.2, 0.02, 10 / 3.5])
def test_what_does_not_change_has_its_own_poles_and_no_harmonics(hertz):
    """Also where a mode lies on a multiple of half the rotor's speed, where the multipliers of a pair coincide."""
    A = block_diag(swing(0.33, 0.02), swing(1.1, 0.04), [[0.8]])
    model = model_of([A, 0 * A, 0 * A], np.ones((2, 5)))
    found = floquet_of(model, hertz)
    expected = [(m.frequency_hz, m.damping) for m in modes_of(model.frozen(np.zeros(2)))]
    np.testing.assert_allclose(numbers(found), expected, rtol=1e-9)
    for mode in found.modes:
        assert [h.order for h in mode.harmonics] == [0]
        assert mode.harmonics[0].participation == pytest.approx({"y1": 1.0, "y2": 1.0})


def test_vectors_of_one_eigenvalue_are_taken_apart_by_their_harmonics():
    """A matrix whose solver cannot know: eigenvalue 1 thrice, of harmonics −4, 3 and 5, in a basis that mixes them."""
    random = np.random.default_rng(4)
    orders = np.repeat(np.arange(-5, 6), 2)
    pure = np.zeros((22, 3), complex)
    for j, n in enumerate((-4, 3, 5)):
        pure[orders == n, j] = random.standard_normal(2) + 1j * random.standard_normal(2)
    pure /= np.linalg.norm(pure, axis=0)
    mixed = pure @ random.standard_normal((3, 3))
    # I on their span, 0.5 on what is orthogonal to it, made by the mixture so that no entry is exactly zero
    span = np.linalg.qr(mixed)[0]
    values, right, left = _solutions(0.5 * np.eye(22) + 0.5 * span @ span.conj().T, orders, True)
    ours = np.flatnonzero(abs(values - 1) < 1e-9)
    assert len(ours) == 3
    assert abs(abs(right[:, ours].conj().T @ pure) - np.eye(3)).max() < 1e-9
    assert abs(left[:, ours].conj().T @ right[:, ours] - np.eye(3)).max() < 1e-9


def test_modes_that_coincide_are_each_a_mode():
    """Two equal blades that nothing joins, seen in a basis that mixes them."""
    T = np.random.default_rng(8).standard_normal((4, 4))
    A = T @ block_diag(swing(0.33, 0.02), swing(0.33, 0.02)) @ np.linalg.inv(T)
    found = floquet_of(model_of([A, 0 * A, 0 * A], np.eye(4)), 0.1234)
    np.testing.assert_allclose(numbers(found), [(0.33, 0.02)] * 2, rtol=1e-9)
    assert all([h.order for h in m.harmonics] == [0] for m in found.modes)


@pytest.mark.parametrize("ratio", [2.0, 1.5, 2.3])
def test_a_swing_on_a_turning_frame_is_seen_at_two_frequencies(ratio):
    """x = R(ψ) z with z of 0.33 Hz: f ± 1P alone, also where 2 f is a multiple of 1P and −f ± nP are the same lines."""
    hertz, A = SWINGS / ratio, swing(0.33, 0.02)
    balance = np.diag([1, 1 / 2.1])
    A = balance @ A @ np.linalg.inv(balance)
    theta = 2 * np.pi * hertz * 0.1

    def turned(psi):
        return np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])

    grid = 2 * np.pi * np.arange(8) / 8
    series = np.fft.fft([turned(p + theta) @ A @ turned(p).T for p in grid], axis=0) / 8
    model = model_of([series[0].real, 2 * series[2].real, -2 * series[2].imag], np.eye(2))
    (mode,) = floquet_of(model, hertz, multiples={"azimuth": 2}).modes
    orders = [h.order for h in mode.harmonics]
    assert orders in ([-2, 0], [0, 2])
    gaps = [abs(abs(h.frequency_hz) - abs(SWINGS + s * hertz)) for h, s in zip(mode.harmonics, (-1, 1), strict=True)]
    assert max(gaps) < 1e-9 and abs(mode.multiplier) == pytest.approx(abs(np.linalg.eigvals(A)[0]) ** (10 / hertz))


@pytest.mark.parametrize("samples", [50, 7, 51, 400])
def test_multipliers_are_those_of_the_matrix_of_a_revolution(samples):
    model = periodic()
    found = floquet_of(model, 1 / (0.1 * samples))
    product = np.eye(4)
    for psi in 2 * np.pi * np.arange(samples) / samples:
        product = (model.A[0] + model.A[1] * np.cos(psi) + model.A[2] * np.sin(psi)) @ product
    true = np.linalg.eigvals(product)
    ours = np.array([m.multiplier for m in found.modes])
    both = np.concatenate([ours, ours[abs(ours.imag) > 1e-12].conj()])
    # the pair of a mode is one row; each true multiplier is among them. 1e-5: 100 times the backward error allowed,
    # times the samples of a revolution is far below what a wrong harmonic would make
    gaps = abs(true[:, None] - both).min(axis=1)
    assert gaps.max() < 1e-5 * abs(true).max() and found.monodromy_difference < 1e-5
    assert found.growth == pytest.approx(abs(true).max(), rel=1e-5)


def test_a_solution_marches_as_the_system_does_where_no_revolution_is_whole():
    """x_k = λᵏ p(ψ_k) by 300 steps of the recursion itself: 37.3 samples a revolution."""
    model, theta = periodic(1), 2 * np.pi / 37.3
    A = np.array([(model.A[1] + 1j * model.A[2]) / 2, model.A[0], (model.A[1] - 1j * model.A[2]) / 2])
    found = solve_families(A, theta)
    assert len(found.values) == 4 and found.missing == 0
    for value, vector in zip(found.values, found.vectors, strict=True):
        x = vector.sum(axis=0)
        for k in range(300):
            psi = theta * k
            x = (model.A[0] + model.A[1] * np.cos(psi) + model.A[2] * np.sin(psi)) @ x
            x /= value
        p = np.exp(1j * theta * 300 * found.orders) @ vector
        # backward errors of at most 1e-6 a step may grow with the condition of the modes; they are 1e-12 here
        np.testing.assert_allclose(x, p, atol=1e-6 * abs(p).max())


def test_a_basis_and_a_start_of_the_angle_change_nothing():
    model, random = periodic(2), np.random.default_rng(5)
    first = floquet_of(model, 0.1234)
    T = random.standard_normal((4, 4))
    other = model_of(T @ model.A @ np.linalg.inv(T), model.C @ np.linalg.inv(T))
    turn = 0.7  # the angle counted from elsewhere
    c, s = np.cos(turn), np.sin(turn)
    started = model_of([model.A[0], c * model.A[1] + s * model.A[2], c * model.A[2] - s * model.A[1]], model.C)
    for again in (floquet_of(other, 0.1234), floquet_of(started, 0.1234)):
        np.testing.assert_allclose(numbers(again), numbers(first), rtol=1e-6)
        for mode, like in zip(again.modes, first.modes, strict=True):
            known = {h.order: h.participation for h in like.harmonics}
            for h in mode.harmonics:
                for name, share in h.participation.items():
                    assert share == pytest.approx(known.get(h.order, {}).get(name, 0.0), abs=3e-6)


def test_participations_add_up_and_frequencies_are_multiples_apart():
    found = floquet_of(periodic(), 0.1234)
    for mode in found.modes:
        for name in found.outputs:
            # what is below 1e-6 is left out
            assert sum(h.participation[name] for h in mode.harmonics) == pytest.approx(1, abs=1e-4)
        base = next(h for h in mode.harmonics if h.order == 0)
        for h in mode.harmonics:
            apart = (h.frequency_hz - base.frequency_hz - 0.1234 * h.order + 5) % 10 - 5  # samples at 10 Hz
            assert apart == pytest.approx(0, abs=1e-9)
        assert max(h.participation["y1"] + h.participation["y2"] for h in mode.harmonics) == pytest.approx(
            base.participation["y1"] + base.participation["y2"]
        )


# An isotropic rotor: blades are oscillators q_i, the hub moves as (x, y) in its plane, and blade i feels and pushes the
# hub along its own direction (−sin ψ_i, cos ψ_i), velocities coupled with velocities:
#   q_i'' + 2 ζ_b ω_b q_i' + ω_b² q_i + g (−x' sin ψ_i + y' cos ψ_i) = 0
#   x''   + 2 ζ_t ω_t x'   + ω_t² x   + h Σ −q_i' sin ψ_i = 0,   y likewise with cos ψ_i and another frequency
BLADE, DAMP, TOWER, G, H = 2 * np.pi * 1.0, 0.01, 2 * np.pi * np.array([0.35, 0.45]), 0.35, 0.25


def rotor_matrix(psi):
    """Return the matrix (10, 10) of continuous time, states [q1 q2 q3 x y] and their rates."""
    angles = psi + 2 * np.pi * np.arange(3) / 3
    along = np.column_stack([-np.sin(angles), np.cos(angles)])  # (3, 2)
    rates = np.block([
        [-2 * DAMP * BLADE * np.eye(3), -G * along], [-H * along.T, -2 * DAMP * np.diag(TOWER)],
    ])  # fmt: skip
    stiffness = -np.diag([BLADE**2] * 3 + list(TOWER**2))
    return np.block([[np.zeros((5, 5)), np.eye(5)], [stiffness, rates]])


def coleman_poles(omega):
    """Return the poles of the rotor in multi-blade coordinates, written down by hand: time-invariant.

    q_i = a_0 + a_c cos ψ_i + a_s sin ψ_i, so q' has rates (a_c' + Ω a_s) and (a_s' − Ω a_c); Σ sin² = 3/2.
    """
    W = np.array([[0, omega], [-omega, 0]])  # what turning adds to the rate of (a_c, a_s)
    one, zero = np.eye(2), np.zeros((2, 2))
    J = np.array([[0.0, 1.0], [-1.0, 0.0]])  # (x', y') on (cos, sin): −x' sin + y' cos
    d = 2 * DAMP * BLADE
    # z = (a_c, a_s), p = (x, y): z'' + 2 W z' + W² z + d (z' + W z) + ω² z + G J p' = 0, rate of q: r = z' + W z
    # p'' + 2 ζ ω_t p' + ω_t² p + 3/2 H Jᵀ r = 0
    stiff, damp = W @ W + d * W + BLADE**2 * one, 2 * W + d * one
    M = np.block([
        [zero, zero, one, zero], [zero, zero, zero, one],
        [-stiff, zero, -damp, -G * J],
        [-1.5 * H * J.T @ W, -np.diag(TOWER**2), -1.5 * H * J.T, -2 * DAMP * np.diag(TOWER)],
    ])  # fmt: skip
    return np.linalg.eigvals(M)


def sampled_rotor(omega, step, outputs):
    """Return the rotor as a scheduled model: exact over a sample by its own matrix in coordinates that turn.

    In the frame that does not turn the matrix Φ over a sample is constant; in that of the blades it is
    T(ψ + θ) Φ T(ψ)⁻¹, with T linear in cosine and sine: a series up to the second harmonic, azimuth2 = 2 ψ.
    """
    count = 16
    grid = 2 * np.pi * np.arange(count) / count
    matrices = np.array([transition(psi, omega, step) for psi in grid])
    series = np.fft.fft(matrices, axis=0) / count  # A_h at index h
    A = [series[0].real, 2 * series[1].real, -2 * series[1].imag, 2 * series[2].real, -2 * series[2].imag]
    assert abs(series[3:-2]).max() < 1e-9  # nothing above
    C = np.diag([1.0, 1, 1, 100, 100, 1, 1, 1, 1, 1])[outputs]  # the hub counts more when modes are named
    return model_of(A, C, step, ("azimuth_cos", "azimuth_sin", "twice_cos", "twice_sin"))


def transition(psi, omega, step):
    """Return the matrix over a sample from the angle psi, by integration of the periodic equations."""
    found = solve_ivp(
        lambda t, x: (rotor_matrix(psi + omega * t) @ x.reshape(10, 10)).ravel(), (0, step), np.eye(10).ravel(),
        method="DOP853", rtol=1e-11, atol=1e-12,
    )  # fmt: skip
    return found.y[:, -1].reshape(10, 10)


def test_an_isotropic_rotor_has_the_modes_of_its_coleman_transform():
    omega, step = 2 * np.pi * 0.2, 0.1
    model = sampled_rotor(omega, step, [0, 3, 4])  # blade 1 and the hub
    found = floquet_of(model, 0.2, multiples={"azimuth": 1, "twice": 2})
    poles = coleman_poles(omega)
    poles = np.append(poles[poles.imag > 0], BLADE * (-DAMP + 1j * np.sqrt(1 - DAMP**2)))  # and all blades at once
    assert len(found.modes) == 5
    exponents = np.array([m.exponent for m in found.modes])
    for pole in poles:
        # the same family: the difference is a multiple of iΩ, for the mode or its conjugate. 1e-6 of |s|: integration
        # of 1e-11, backward error below 1e-6
        gaps = [
            min(abs(e - pole - 1j * omega * n) for e in (s, s.conjugate()) for n in range(-12, 13)) for s in exponents
        ]
        assert min(gaps) < 1e-6 * abs(pole)
    hub = [m for m in found.modes if abs(m.frequency_hz - 0.4) < 0.1]
    assert len(hub) == 2
    for mode in hub:  # named by what the hub does, and seen on the blade one multiple to either side, nowhere else
        blade = {h.order: h.participation["y1"] for h in mode.harmonics if h.participation["y1"] > 1e-5}
        assert set(blade) == {-1, 1} and sum(blade.values()) == pytest.approx(1, abs=1e-4)
        assert {h.order for h in mode.harmonics if h.participation["y2"] + h.participation["y3"] > 1e-5} == {0}
    whirls = [m for m in found.modes if m.frequency_hz > 0.6]  # backward and forward at 1 ∓ 0.2 Hz, and collective
    assert [round(m.frequency_hz, 1) for m in whirls] == [0.8, 1.0, 1.2]
    for mode, order in zip(whirls, (1, 0, -1), strict=True):
        assert max(mode.harmonics, key=lambda h: h.participation["y1"]).order == order  # at 1 Hz on the blade


def mathieu(a, q, samples=40):
    """Return x'' + (a − 2 q cos 2t) x = 0 over steps of π/samples as a series in ψ = 2t, up to cos 8ψ."""
    step, count = np.pi / samples, 32
    matrices = []
    for start in np.pi * np.arange(count) / count:
        found = solve_ivp(
            lambda t, x: np.array([[0, 1], [-(a - 2 * q * np.cos(2 * t)), 0]]).dot(x.reshape(2, 2)).ravel(),
            (start, start + step), np.eye(2).ravel(), method="DOP853", rtol=1e-12, atol=1e-13,
        )  # fmt: skip
        matrices.append(found.y[:, -1].reshape(2, 2))
    series = np.fft.fft(np.array(matrices), axis=0) / count
    A, names, multiples = [series[0].real], [], {}
    for h in range(1, 9):
        A += [2 * series[h].real, -2 * series[h].imag]
        names += [f"a{h}_cos", f"a{h}_sin"]
        multiples[f"a{h}"] = h
    return model_of(A, [[1.0, 0.0]], step, names), 1 / np.pi, multiples


# Characteristic values at q = 1 (Abramowitz and Stegun 1964, table 20.1): a_0, b_1, a_1, b_2, a_2
EDGES = (-0.4551386, -0.1102488, 1.8591081, 3.9170248, 4.3713010)


@pytest.mark.parametrize(("low", "high", "stable"), [
    (EDGES[0], EDGES[1], True), (EDGES[1], EDGES[2], False), (EDGES[2], EDGES[3], True), (EDGES[3], EDGES[4], False),
])  # fmt: skip
def test_mathieus_equation_is_stable_between_its_characteristic_values(low, high, stable):
    for a in (low + 0.02, high - 0.02):
        model, hertz, multiples = mathieu(a, 1.0)
        found = floquet_of(model, hertz, multiples=multiples)
        # at the edge itself the growth is 1 and its root; 0.02 inside an unstable region it is above 1.1
        assert (found.growth < 1 + 1e-5) == stable, a
        brute = solve_ivp(
            lambda t, x, a=a: np.array([[0, 1], [-(a - 2 * np.cos(2 * t)), 0]]).dot(x.reshape(2, 2)).ravel(),
            (0, np.pi), np.eye(2).ravel(), method="DOP853", rtol=1e-11, atol=1e-12,
        )  # fmt: skip
        true = abs(np.linalg.eigvals(brute.y[:, -1].reshape(2, 2))).max()
        assert found.growth == pytest.approx(true, rel=1e-5)


def test_a_mode_of_half_the_rotors_speed_is_one_mode():
    """In the first unstable region multipliers are real and below 0: half the frequency of the change."""
    model, hertz, multiples = mathieu(0.9, 1.0)
    found = floquet_of(model, hertz, multiples=multiples)
    assert len(found.modes) == 2 and not found.stable
    for mode in found.modes:
        assert mode.multiplier.real < 0 and abs(mode.multiplier.imag) < 1e-6
        assert abs(mode.exponent.imag) / (2 * np.pi) == pytest.approx(hertz / 2, rel=1e-6)


def test_deviations_are_those_of_a_small_change_of_the_matrices():
    """A covariance rrᵀ of one direction r has the deviations |df/dr|, here by differences."""
    model, random = periodic(), np.random.default_rng(3)
    offset, scale = np.array([0.02, -0.01]), np.array([9.0, 11.0])
    weights = scaled_weights(weights_of(model, {}, {}), offset, scale)
    for _ in range(3):
        r = 1e-5 * random.standard_normal(48)
        told = floquet_of(model, 0.1234, covariance=Covariance(np.outer(r, r), weights)).modes
        change = r.reshape(4, 3, 4).transpose(1, 0, 2)  # of A over the scaled scheduling
        slope = change[1:] / scale[:, None, None]
        dA = np.concatenate([[change[0] - np.tensordot(offset, slope, axes=1)], slope])
        up, down = (numbers(floquet_of(model_of(model.A + s * dA, model.C[0]), 0.1234)) for s in (1, -1))
        expected = [(m.frequency_std_hz, m.damping_std) for m in told]
        # differences of 1e-5 are exact to their square, beside rounding of 1e-10 of the values
        np.testing.assert_allclose(abs(up - down) / 2, expected, rtol=1e-3, atol=1e-9)


def test_growth_is_told_and_beyond_any_size_does_not_end_in_a_defect():
    model = periodic()
    grown = model_of(np.concatenate([[1.2 * model.A[0]], model.A[1:]]), model.C)
    found = floquet_of(grown, 0.2)
    assert not found.stable and min(m.damping for m in found.modes) < 0
    wild = model_of([50 * np.eye(2), 0 * np.eye(2), 0 * np.eye(2)], np.eye(2))
    facts = floquet_of(wild, 0.001).to_json()
    assert facts["growth_per_revolution"] is None and not facts["stable"]
    assert all(m["multiplier"] is None for m in facts["modes"])


def test_delays_are_no_modes():
    shift = np.diag(np.ones(3), 1)
    A = block_diag(swing(0.33, 0.02), shift)
    found = floquet_of(model_of([A, 0 * A, 0 * A], np.ones((1, 6))), 0.1234)
    assert len(found.modes) == 1 and "delays" in found.notes[0]


@pytest.mark.parametrize(("change", "hertz", "options", "error", "said"), [
    ({"names": ("wind", "pitch")}, 0.2, {}, UsageError, "not periodic"),
    ({}, 5.0, {}, UsageError, "more than two"),
    ({}, -7.0, {}, UsageError, "more than two"),
    ({}, 0.2, {"harmonics": 0}, UsageError, "limits"),
    ({}, 0.2, {"harmonics": 10**9}, UsageError, "limits"),
    ({}, 0.2, {"multiples": {"azimuth": 10**6}}, UsageError, "turns 1"),
    ({}, 0.2, {"multiples": {"wind": 1}}, UsageError, "no angle"),
    ({}, 0.2, {"at": {"azimuth_cos": 1.0}}, UsageError, "stands still"),
    ({"names": ("azimuth_cos", "wind")}, 0.2, {}, UsageError, "wind=…"),
    ({"names": ("azimuth_cos", "wind")}, 0.2, {"at": {"wind": np.nan}}, UsageError, "wind=…"),
    ({"names": ("azimuth_cos", "yaw_sin")}, 0.2, {}, UsageError, "how often each turns"),
    ({"scale": 1e200}, 0.2, {}, DataError, "entries of at most"),
    ({"states": 300}, 0.2, {}, UsageError, "too large"),
])  # fmt: skip
def test_what_cannot_be_is_refused_in_a_sentence(change, hertz, options, error, said):
    base = np.zeros((3, 300, 300)) if "states" in change else change.get("scale", 1.0) * periodic().A
    model = model_of(base, np.ones((1, base.shape[1])), names=change.get("names", PARTS))
    with pytest.raises(error, match=said):
        floquet_of(model, hertz, **options)


def test_few_harmonics_are_told_and_what_none_describe_is_refused():
    few = floquet_of(periodic(size=0.1), 0.02, harmonics=1)
    assert any("too few" in n for n in few.notes)
    swinging = model_of([np.zeros((1, 1)), np.ones((1, 1)), np.zeros((1, 1))], [[1.0]])
    with pytest.raises(NotIdentifiable, match="changes too much"):  # passes through 0 twice a revolution
        floquet_of(swinging, 0.1234 / np.sqrt(2))


@pytest.mark.parametrize("text", ["0rpm", "", "fast", "nan", "inf", "1e400rpm", "12knots", "--5", "1" * 100, "٣rpm"])
def test_a_speed_that_is_none_is_refused(text):
    with pytest.raises(AeolidError, match="rotor speed"):
        read_rotor_speed(text)


def test_speeds_are_read_in_the_units_of_the_field():
    for text in ("12rpm", "0.2Hz", "72deg/s", "1.2566370614rad/s", " 12 RPM ", 12, "12"):
        assert read_rotor_speed(text) == pytest.approx(0.2)
    assert read_rotor_speed("-12rpm") == pytest.approx(-0.2)


def test_the_backward_error_sees_what_the_mean_over_the_period_hides():
    """A vector that solves nothing where it is small: its error is told there."""
    A = np.array([[[0.25]], [[1.0]], [[0.25]]], complex)
    found = solve_families(A, 0.3)
    assert found.errors.max() < 1e-6
    spoiled = found.vectors + 1e-3 * np.exp(1j * np.arange(found.vectors.size).reshape(found.vectors.shape))
    assert backward_errors(A, 0.3, found.values, spoiled, found.orders)[0] > 1e-4
    assert monodromy(1e200 * A, 400) is None
