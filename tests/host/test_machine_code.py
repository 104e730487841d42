"""Machine code of models: IEEE rules, memories, and that lanes side by side are the single runs, bit for bit."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.models import equations_file
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Memory, Output, Parameter
from aeolid.models.integrate import Compiled, compile_equations
from aeolid.models.machine_code import LANES, translate

Array = NDArray[np.float64]
RICH = """
[parameters]
a = 0.7
b = 1.3
c = 0.2
[[state]]
name = "p"
derivative = "q*tanh(b) - p - sin(p)*min(abs(q), 1)**1.5*c"
initial = 0.4
[[state]]
name = "q"
derivative = "-b*sqrt(p**2 + 1)*p - a*q*exp(-q**2) + max(u, tanh(p), -c)*cos(v) - 2*q + sign(q)*c*log(2 + p**4)"
[[output]]
name = "first"
equation = "tan(0.3*p) + min(q, a)"
[[output]]
name = "second"
equation = "q**3/(1 + q**2) + kept"
[[input]]
name = "u"
[[input]]
name = "v"
"""
MEMORIES = (
    Memory("kept", "", ex.parse("kept + a*(p - kept)*step_s", "kept"), ex.parse("2*p", "kept")),
    Memory("later", "", ex.parse("kept*b", "later"), ex.parse("kept - p", "later")),
)


def rich(*, discrete: bool) -> Compiled:
    text = RICH.replace(" + kept", "")
    model = equations_file.from_toml(tomllib.loads(text), text, "model.toml")
    second = Output("second", "", ex.parse("q**3/(1 + q**2) + kept - later", "second"))
    states = model.states
    if discrete:
        states = tuple(replace(s, derivative=ex.parse(f"0.3*tanh({ex.to_text(s.derivative)})", s.name)) for s in states)
    return compile_equations(
        replace(
            model, states=states, outputs=(model.outputs[0], second), memories=MEMORIES,
            sample_time_s=0.1 if discrete else 0.0,
        )
    )  # fmt: skip


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("stride", [1, 2])
def test_lanes_are_the_single_runs_bit_for_bit(discrete: bool, stride: int) -> None:
    """Other parameters, gains and starts in each lane, gaps in y, memories that settle or are given."""
    compiled, rng, rows = rich(discrete=discrete), np.random.default_rng(3), 120
    n = 2
    U = rng.standard_normal((rows * stride, 2))
    Y = rng.standard_normal((rows, 2))
    Y[[5, 40], [0, 1]] = np.nan
    theta = compiled.model.theta[:, None] * (1 + 0.2 * rng.random((3, LANES)))
    K, x0 = 0.05 * rng.standard_normal((n, 2, LANES)), 0.3 * rng.standard_normal((n + 2, LANES))
    x0[n:, ::2] = np.nan
    wide = compiled.predict_wide(U, Y, theta, K, x0, 0.1, 2, stride)
    assert wide.shape == (rows, 2, LANES) and np.isfinite(wide).sum() == (2 * rows - 2) * LANES
    for lane in range(LANES):
        own = U, Y, theta[:, lane], K[:, :, lane], x0[:, lane], 0.1, 2, stride
        np.testing.assert_array_equal(wide[:, :, lane], compiled.predict(*own, False)[0])
        np.testing.assert_array_equal(wide[:, :, lane], compiled.innovations(*own))  # which keeps no states
    assert len({wide[-1, 0, lane] for lane in range(LANES)}) == LANES


def test_a_run_equals_a_plain_loop_over_the_text() -> None:
    """Python's own reading of the equations, one discrete step after another, with gaps: equal to rounding (1e-12)."""
    compiled, rng = rich(discrete=True), np.random.default_rng(4)
    model, K = compiled.model, 0.2 * rng.standard_normal((2, 2))
    U, Y = rng.standard_normal((80, 2)), rng.standard_normal((80, 2))
    Y[[5, 9, 20, 20], [0, 1, 0, 1]] = np.nan
    E, P, X = compiled.predict(U, Y, model.theta, K, model.x0, 0.1, 1, 1, False)
    sign, scope = np.sign, {f: getattr(np, f) for f in ("sqrt", "exp", "log", "sin", "cos", "tan", "tanh")}
    scope |= {"abs": abs, "sign": sign, "min": min, "max": max}
    constants = {p.name: p.value for p in model.parameters}
    at = {s.name: s.initial for s in model.states}
    kept, later = 2 * at["p"], 2 * at["p"] - at["p"]
    for k in range(80):
        now = {**constants, **at, "u": U[k, 0], "v": U[k, 1]}
        kept = kept + constants["a"] * (at["p"] - kept) * 0.1
        later = kept * constants["b"]
        y = [eval(ex.to_text(o.equation), dict(scope), {**now, "kept": kept, "later": later}) for o in model.outputs]
        np.testing.assert_allclose(P[k], y, rtol=1e-12, atol=1e-12)
        following = {s.name: eval(ex.to_text(s.derivative), dict(scope), now) for s in model.states}
        at = {n: v + float(K[i] @ np.nan_to_num(Y[k] - y)) for i, (n, v) in enumerate(following.items())}
        np.testing.assert_allclose(X[k + 1, :2], [at["p"], at["q"]], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(E, Y - P)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("sqrt(a)", np.nan), ("b/zero", np.inf), ("a/zero", -np.inf), ("zero/zero", np.nan), ("sign(zero)", 0.0),
        ("sign(zero/zero)", np.nan), ("log(zero)", -np.inf), ("log(a)", np.nan), ("zero**zero", 1.0), ("a**2", 4.0),
        ("a**-1", -0.5), ("a**3", -8.0), ("b**0.5", np.sqrt(3.0)), ("exp(1000*b)", np.inf), ("a**0.5", np.nan),
        ("b**5", 243.0), ("--a", -2.0), ("+b", 3.0), ("min(b, a, zero)", -2.0), ("max(a, zero, b)", 3.0),
        ("-zero*b", -0.0), ("pi", np.pi),
    ],
)  # fmt: skip
def test_arithmetic_follows_ieee_rules_in_every_width(text: str, value: float) -> None:
    parameters = (Parameter("a", -2.0), Parameter("b", 3.0), Parameter("zero", 0.0))
    model = Equations("rules", 0.0, parameters, (), (Output("y", "", ex.parse(text, "y")),), (), ())
    compiled = compile_equations(model)
    one = compiled.read(np.zeros(0), np.zeros(0), model.theta)[0][0]
    lanes = np.repeat(model.theta[:, None], LANES, axis=1)
    blank = np.zeros((1, 1))
    many = -compiled.predict_wide(
        np.zeros((1, 0)), blank, lanes, np.zeros((0, 1, LANES)), np.zeros((0, LANES)), 1, 1, 1
    )
    np.testing.assert_allclose(one, value, rtol=1e-15)
    np.testing.assert_array_equal(many.ravel(), np.full(LANES, one))


def test_code_lives_as_long_as_its_model() -> None:
    """Many translations, each dropped at once: the one that is kept still answers."""
    kept = rich(discrete=False)
    theta, u = kept.model.theta, np.zeros(2)
    at = kept.settled(np.array([0.1, 0.2]), u, theta)
    before = kept.slope(at, u, theta)
    for _ in range(20):
        translate(kept.model, LANES)
    np.testing.assert_array_equal(before, kept.slope(at, u, theta))
