"""What lies before a plant: every kind of filter against an integration a thousand times finer, and its null."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.filter_chains import behind_filters
from aeolid.models.input_filters import KINDS, SPLIT, WHOLE
from aeolid.models.integrate import compile_equations, driven, simulate

Array = NDArray[np.float64]
FINE = 1000
SEEN = float(SPLIT[0])
STEP = 0.05
SMOOTH = np.convolve(np.random.default_rng(3).standard_normal(140), np.hanning(9) / 4, "same")[:120]
JUMPS = np.repeat(np.random.default_rng(4).normal(0.2, 1.0, 24), 5)
SIGNALS = {"smooth": SMOOTH, "jumps": JUMPS, "constant": np.full(50, 1.3)}


def apply(kind: str, u: Array, *values: float, part: float = 1.0) -> Array:
    """Return the mean over the first part of each step; the second of two pieces must make the mean of the whole."""
    whole = KINDS[kind].rule(np.ascontiguousarray(u), np.array(values), STEP, WHOLE)
    if part == 1:
        return whole
    both = KINDS[kind].rule(np.repeat(u, 2), np.array(values), STEP, SPLIT).reshape(-1, 2)
    np.testing.assert_allclose(both @ SPLIT, whole, rtol=1e-10, atol=1e-10)
    return both[:, 0]


def means(fine: Array, part: float = 1.0) -> Array:
    """Return the mean over the first part of each step."""
    result: Array = fine.reshape(-1, FINE)[:, : round(part * FINE)].mean(axis=1)
    return result


def held(u: Array) -> Array:
    """Return the command at the middle of each fine step."""
    return np.repeat(u, FINE)


def second_order(u: Array, inverse: float, zeta: float, part: float) -> Array:
    """Reference: the transfer function, held input, 1000 points a sample; trapezoidal mean."""
    w = 1 / inverse
    system = signal.cont2discrete(([w * w], [1, 2 * zeta * w, w * w]), STEP / FINE, method="zoh")
    b, a = system[0].ravel(), system[1]
    y = signal.lfilter(b, a, held(u) - u[0])
    after = np.concatenate([y[1:], [y[-1]]])  # y[n] answers to the command up to n − 1: it stands at the start of n
    return means(0.5 * (y + after), part) + u[0]


@pytest.mark.parametrize("part", [1.0, SEEN])
@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize(("omega", "zeta"), [(5.0, 0.5), (12.0, 0.9), (60.0, 0.25), (0.7, 0.7)])
def test_a_second_order_drive_equals_its_transfer_function(name: str, omega: float, zeta: float, part: float) -> None:
    """Tolerance: the last sample lacks one fine point (1e-3 of a step), the trapezoid (omega h/1000)²/12."""
    u = SIGNALS[name]
    found = apply("actuator_second_order", u, 1 / omega, zeta, part=part)
    np.testing.assert_allclose(found[:-1], second_order(u, 1 / omega, zeta, part)[:-1], atol=2e-5)


@pytest.mark.parametrize("part", [1.0, SEEN])
@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize(("tau", "gain"), [(0.6, -0.5), (0.2, -0.3), (2.5, -0.7)])
def test_shed_vorticity_follows_the_two_terms_of_jones(name: str, tau: float, gain: float, part: float) -> None:
    """Reference: each term's differential equation, 1000 points a sample, trapezoidal means; weights as printed.

    0.165 and 0.335 are 0.33 and 0.67 of the half that lags; the fast term has the weight 0.335.
    """
    u = SIGNALS[name]
    lagging = np.zeros(len(u))
    for weight, time in ((0.335, tau * 0.0455 / 0.3), (0.165, tau)):
        keep = np.exp(-STEP / FINE / time)
        slow = signal.lfilter([0.0, 1 - keep], [1.0, -keep], held(u) - u[0]) + u[0]
        after = np.concatenate([slow[1:], slow[-1:]])
        lagging += weight / 0.5 * means(held(u) - 0.5 * (slow + after), part)
    found = apply("indicial", u, tau, gain, part=part)
    np.testing.assert_allclose(found[:-1], (u + gain * lagging)[:-1], atol=1e-6)


@pytest.mark.parametrize("part", [1.0, SEEN])
@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize("rate", [0.3, 2.0, 9.0, 80.0])
def test_a_limited_rate_equals_a_small_stepped_follower(name: str, rate: float, part: float) -> None:
    u = SIGNALS[name]
    x, most = u[0], rate * STEP / FINE
    path = np.empty(len(u) * FINE)
    for k, command in enumerate(held(u)):
        move = min(max(command - x, -most), most)
        path[k] = x + 0.5 * move
        x += move
    np.testing.assert_allclose(apply("rate_limit", u, rate, 1.0, part=part), means(path, part), atol=2 * most)


def play(u: Array, width: float) -> Array:
    """Reference: a stop carried between two walls, told by cases."""
    x, path = u[0], []
    for command in u:
        if command - x > width / 2:
            x = command - width / 2
        elif x - command > width / 2:
            x = command + width / 2
        path.append(x)
    return np.array(path)


def hold(u: Array, width: float) -> Array:
    path = [u[0]]
    for command in u[1:]:
        path.append(command if abs(command - path[-1]) > width else path[-1])
    return np.array(path)


STATIC = {
    "input_saturation": ((-0.4, 0.7), lambda u: np.clip(u, -0.4, 0.7)),
    "dead_zone": ((0.5,), lambda u: np.where(u > 0.5, u - 0.5, np.where(u < -0.5, u + 0.5, 0.0))),
    "backlash": ((0.6,), lambda u: play(u, 0.6)),
    "deadband": ((0.6,), lambda u: hold(u, 0.6)),
    "input_quantisation": ((0.25,), lambda u: np.rint(u / 0.25) * 0.25),
    "input_mid_rise": ((0.25,), lambda u: 0.25 * np.rint(u / 0.25 - 0.5) + 0.125),
    "input_floor": ((0.25,), lambda u: u - np.mod(u, 0.25)),
    "input_truncation": ((0.25,), lambda u: np.copysign(np.abs(u) // 0.25 * 0.25, u)),
}


@pytest.mark.parametrize("part", [1.0, SEEN])
@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize("kind", STATIC)
def test_what_has_no_dynamics_equals_its_definition(kind: str, name: str, part: float) -> None:
    values, reference = STATIC[kind]
    u = SIGNALS[name]
    np.testing.assert_allclose(apply(kind, u, *values, 1.0, part=part), reference(u), atol=1e-12)


@pytest.mark.parametrize("kind", [*STATIC, "rate_limit"])
def test_a_share_blends_in_a_straight_line(kind: str) -> None:
    values = STATIC[kind][0] if kind in STATIC else (0.8,)
    none, half, all_of_it = (apply(kind, SMOOTH, *values, s) for s in (0.0, 0.5, 1.0))
    np.testing.assert_array_equal(none, SMOOTH)
    np.testing.assert_allclose(half, 0.5 * (none + all_of_it), atol=1e-15)
    assert np.max(np.abs(all_of_it - none)) > 0.05


@pytest.mark.parametrize("part", [1.0, SEEN])
def test_a_lead_is_the_input_and_what_is_left_of_its_changes(part: float) -> None:
    """u + g (u − lag): the lag by the exact recursion at 1000 points a sample."""
    decay = np.exp(-STEP / FINE / 0.3)
    slow = signal.lfilter([1 - decay], [1, -decay], held(SMOOTH), zi=[decay * SMOOTH[0]])[0]
    before = np.concatenate([[SMOOTH[0]], slow[:-1]])
    expected = SMOOTH + 0.7 * (SMOOTH - means(0.5 * (before + slow), part))
    np.testing.assert_allclose(apply("lead_lag", SMOOTH, 0.3, 0.7, part=part), expected, atol=1e-5)


def test_a_factor_is_a_factor() -> None:
    np.testing.assert_array_equal(apply("input_scale", SMOOTH, 9.0, 0.0), SMOOTH)
    np.testing.assert_allclose(apply("input_scale", SMOOTH, -57.3, 1.0), -57.3 * SMOOTH, rtol=1e-14)
    np.testing.assert_allclose(apply("input_scale", SMOOTH, -1.0, 0.25), 0.5 * SMOOTH, rtol=1e-14)


@pytest.mark.parametrize("part", [1.0, SEEN])
@pytest.mark.parametrize("delay", [-3.7, -1.0, -0.25, 0.0, 0.04, 0.4, 2.0])
def test_a_shift_goes_either_way(delay: float, part: float) -> None:
    """Samples before the first and after the last hold the end values."""
    fine = held(SMOOTH)
    where = np.clip(np.arange(len(fine)) - round(delay * FINE), 0, len(fine) - 1)
    found = apply("transport_delay", SMOOTH, delay * STEP, part=part)
    np.testing.assert_allclose(found, means(fine[where], part), atol=1e-9)


@pytest.mark.parametrize("delay", [*np.random.default_rng(2).uniform(-9e4, 9e4, 40).tolist(), 65536.1, 12345.1, 1e15])
def test_the_longest_dead_time_ends(delay: float) -> None:
    """However coarse the numbers are out there: pieces once were counted from a start that no step could reach."""
    u = np.repeat(SMOOTH, 2)
    found = KINDS["transport_delay"].rule(u, np.array([delay * STEP]), STEP, SPLIT)
    np.testing.assert_allclose(found, u[0] if delay > 0 else u[-1], rtol=1e-9)
    for nothing in (np.nan, np.inf, -np.inf):
        assert np.all(np.isnan(KINDS["transport_delay"].rule(u, np.array([nothing]), STEP, SPLIT)))


def test_a_drive_at_rest_stays_at_rest() -> None:
    """Every kind leaves a command that never moves alone, from the first sample on (dead zone and levels aside)."""
    u = SIGNALS["constant"]
    for kind, values in {"actuator_lag": (0.4,), "transport_delay": (0.4,), "actuator_second_order": (0.4, 0.5),
                         "rate_limit": (0.1, 1.0), "deadband": (0.3, 1.0), "backlash": (0.5, 1.0),
                         "lead_lag": (0.3, 2.0)}.items():  # fmt: skip
        np.testing.assert_allclose(apply(kind, u, *values), u, rtol=1e-12, err_msg=kind)


def test_infinitely_mild_is_no_change() -> None:
    """Values at which each kind does nothing; a second-order drive tends to it like a delay of 2 zeta/omega."""
    for kind, values in {"actuator_second_order": (0.0, 0.7), "rate_limit": (1e9, 1.0), "deadband": (0.0, 1.0),
                         "dead_zone": (0.0, 1.0), "backlash": (0.0, 1.0), "input_quantisation": (0.0, 1.0),
                         "input_saturation": (-9.0, 9.0, 1.0), "lead_lag": (0.3, 0.0)}.items():  # fmt: skip
        np.testing.assert_allclose(apply(kind, JUMPS, *values), JUMPS, atol=1e-6, err_msg=kind)
    fast = 1e-4 * STEP
    slope = (apply("actuator_second_order", JUMPS, fast, 0.7) - JUMPS) / fast
    expected = -2 * 0.7 * np.concatenate([[0.0], np.diff(JUMPS)]) / STEP
    np.testing.assert_allclose(slope, expected, rtol=1e-6, atol=1e-6)


LIMITS = {"rate_limit": (6.0,), "input_saturation": (-0.4, 0.6), "deadband": (0.5,), "dead_zone": (0.3,),
          "backlash": (0.7,), "input_quantisation": (0.4,), "input_mid_rise": (0.4,), "input_floor": (0.4,),
          "input_truncation": (0.4,)}  # fmt: skip


def chained(folder: Path, late: dict[str, float], kind: str, values: tuple[float, ...]) -> Equations:
    """Return a model whose input is read late, as the file has it first, and passes a limit."""
    slots = dict(zip(KINDS[kind].slots, (*values, 1.0), strict=True))
    lines = ["[parameters]", *(f"{n} = {v}" for n, v in (late | slots).items())]
    lines += ['[[output]]\nname = "y"\nequation = "u"']
    lines += ['[[input_filter]]\ninput = "u"\nkind = "intersample_%s"' % ("zoh" if len(late) == 1 else "filtered")]
    lines += [*(f'{n} = "{n}"' for n in late), f'[[input_filter]]\ninput = "u"\nkind = "{kind}"']
    lines += [f'{n} = "{n}"' for n in slots]
    (folder / "model.toml").write_text("\n".join(lines))
    return equations_file.load(folder / "model.toml")


@pytest.mark.parametrize("kind", LIMITS)
def test_a_limit_acts_on_the_command_as_it_was_given_however_late_that_is(kind: str, tmp_path: Path) -> None:
    """Reference: the limit at a thousand points a sample, then 0.6 samples later; a ramp within a sample is its mean.

    What is read late by a part of a sample has means that nobody commanded: behind these a drive of 0.4 V/s was told as
    0.33, and one of 2.5 deg/s as 1.97.
    """
    values, offset = LIMITS[kind], 0.6
    model = chained(tmp_path, {"offset_s": offset * STEP}, kind, values)
    found = behind_filters(model, JUMPS[:, None], model.theta, STEP)[0]
    fine = KINDS[kind].rule(held(JUMPS), np.array([*values, 1.0]), STEP / FINE, WHOLE)
    far = round(offset * FINE)
    expected = means(np.concatenate([np.full(far, fine[0]), fine])[: len(fine)])
    tolerance = 0.25 * values[0] * STEP if kind == "rate_limit" else 1e-9  # of a ramp half of what it moves in a sample
    np.testing.assert_allclose(found, expected, atol=tolerance)
    if kind == "rate_limit":
        behind = KINDS[kind].rule(KINDS["intersample_zoh"].rule(JUMPS, model.theta[:1], STEP, WHOLE),
                                  np.array([*values, 1.0]), STEP, WHOLE)  # fmt: skip
        error, other = (float(np.sqrt(np.mean((x - expected) ** 2))) for x in (found, behind))
        assert error < 0.1 * values[0] * STEP < 0.5 * other


@pytest.mark.parametrize("kind", LIMITS)
def test_behind_a_limit_the_filter_of_all_outputs_sees_the_mean_of_each_sample(kind: str, tmp_path: Path) -> None:
    """In one piece and in two the same means; of a limit that is blended out, bit for bit the filter alone."""
    late = {"offset_s": 0.3 * STEP, "delay_s": 0.4 * STEP}
    model = chained(tmp_path, late, kind, LIMITS[kind])
    whole = behind_filters(model, JUMPS[:, None], model.theta, STEP)[0]
    both = behind_filters(model, JUMPS[:, None], model.theta, STEP, SPLIT)[0].reshape(-1, 2)
    np.testing.assert_allclose(both @ SPLIT, whole, atol=1e-9)
    limited = KINDS[kind].rule(JUMPS, np.array([*LIMITS[kind], 1.0]), STEP, WHOLE)
    expected = KINDS["intersample_filtered"].rule(limited, np.array(list(late.values())), STEP, WHOLE)
    np.testing.assert_allclose(whole, expected, atol=1e-12)
    theta = model.theta
    theta[model.index("share")] = 0.0
    bare = KINDS["intersample_filtered"].rule(JUMPS, np.array(list(late.values())), STEP, WHOLE)
    np.testing.assert_array_equal(behind_filters(model, JUMPS[:, None], theta, STEP)[0], bare)


FILTERS: dict[str, dict[str, float]] = {
    "transport_delay": {"delay_s": 2.3 * STEP}, "actuator_lag": {"tau_s": 1.7 * STEP},
    "rate_limit": {"rate_per_s": 8.0, "share": 1.0}, "backlash": {"width": 0.4, "share": 1.0},
}  # fmt: skip
CHAINS = [(a, b) for a in FILTERS for b in FILTERS if a != b]


@pytest.mark.parametrize("chain", CHAINS, ids="-".join)
def test_filters_one_behind_another_are_each_as_exact_as_alone(chain: tuple[str, str], tmp_path: Path) -> None:
    """Reference: each at a thousand points a sample. A rate limit behind a delay was off by half of the input's spread.

    Two that only shift, or neither of which has a limit, may change places.
    """
    names = {f"{slot}_{i}": v for i, kind in enumerate(chain) for slot, v in FILTERS[kind].items()}
    lines = ["[parameters]", *(f"{n} = {v}" for n, v in names.items()), '[[output]]\nname = "y"\nequation = "u"']
    for i, kind in enumerate(chain):
        lines += [f'[[input_filter]]\ninput = "u"\nkind = "{kind}"', *(f'{s} = "{s}_{i}"' for s in FILTERS[kind])]
    (tmp_path / "model.toml").write_text("\n".join(lines))
    model = equations_file.load(tmp_path / "model.toml")
    found = behind_filters(model, JUMPS[:, None], model.theta, STEP)[0]
    fine = held(JUMPS)
    for kind in chain:
        fine = KINDS[kind].rule(fine, np.array(list(FILTERS[kind].values())), STEP / FINE, WHOLE)
    error = float(np.sqrt(np.mean((found - means(fine)) ** 2)))
    assert error < 0.01 * np.std(JUMPS)  # what eight parts of a sample leave of what changes within it


@pytest.mark.parametrize("zeta", [0.0, 0.01, 1.0, 1.5, 8.0])
def test_a_drive_of_any_damping_is_the_one_that_was_given(zeta: float) -> None:
    """Undamped, critical, and two lags one behind the other: beyond 0.05 to 0.999 it was another number."""
    expected = second_order(JUMPS, 2 * STEP, zeta, 1.0)
    np.testing.assert_allclose(apply("actuator_second_order", JUMPS, 2 * STEP, zeta), expected, atol=2e-5)


@pytest.mark.parametrize(
    ("kind", "values", "text"),
    [
        ("rate_limit", {"rate_per_s": -2.0, "share": 1.0}, "rate_per_s = -2 lies outside 0"),
        ("actuator_lag", {"tau_s": -0.1}, "tau_s = -0.1 lies outside 0"),
        ("backlash", {"width": -0.1, "share": 1.0}, "width = -0.1 lies outside 0"),
        ("backlash", {"width": 0.1, "share": 5.0}, "share = 5 lies outside 0 … 1"),
        ("actuator_second_order", {"inverse_omega_s": 0.1, "damping": -0.5}, "damping = -0.5 lies outside 0"),
        ("input_saturation", {"low": 1.0, "high": -1.0, "share": 1.0}, "low = 1 lies above high = -1"),
        ("input_quantisation", {"spacing": -1.0, "share": 1.0}, "spacing = -1 lies outside 0"),
    ],
)
def test_values_that_a_filter_cannot_have_are_refused(
    kind: str, values: dict[str, float], text: str, tmp_path: Path
) -> None:
    """By kind, name and range; they were taken, and meant one thing to a free run and another to exported C."""
    lines = ["[parameters]", *(f"{n} = {v}" for n, v in values.items()), '[[output]]\nname = "y"\nequation = "u"']
    lines += [f'[[input_filter]]\ninput = "u"\nkind = "{kind}"', *(f'{n} = "{n}"' for n in values)]
    (tmp_path / "model.toml").write_text("\n".join(lines))
    with pytest.raises(DataError, match=text):
        equations_file.load(tmp_path / "model.toml")


def test_a_model_file_may_name_every_kind(tmp_path: Path) -> None:
    """Written as model.toml and read again: the plant gets exactly what the rule gives; a run is made of the last."""
    values = {"tau_s": 0.2, "delay_s": -0.1, "inverse_omega_s": 0.1, "damping": 0.6, "rate_per_s": 2.0, "share": 1.0,
              "low": -0.5, "high": 0.6, "width": 0.3, "spacing": 0.2, "factor": 2.5, "gain": 0.5,
              "offset_s": 0.0}  # fmt: skip
    for kind, rule in KINDS.items():
        lines = ["[parameters]", *(f"{s} = {values[s]}" for s in rule.slots)]
        lines += ['[[output]]\nname = "y"\nequation = "u"', f'[[input_filter]]\ninput = "u"\nkind = "{kind}"']
        lines += [f'{s} = "{s}"' for s in rule.slots]
        (tmp_path / "model.toml").write_text("\n".join(lines))
        model = equations_file.load(tmp_path / "model.toml")
        (tmp_path / "again.toml").write_text(equations_file.to_toml(model))
        again = equations_file.load(tmp_path / "again.toml")
        u = SMOOTH[:, None]
        expected = apply(kind, SMOOTH, *(values[s] for s in rule.slots))
        for m in (model, again):
            np.testing.assert_allclose(behind_filters(m, u, m.theta, STEP)[0], expected, rtol=1e-12, atol=1e-12)
    y = simulate(compile_equations(again), u, again.theta, again.x0, STEP)
    expected = apply(kind, SMOOTH, *(values[s] for s in rule.slots), part=SEEN)  # an output is a sample, no mean
    np.testing.assert_allclose(y[:, 0], expected, rtol=1e-12, atol=1e-12)


CART = """
[parameters]
tau = 0.0
[[state]]
name = "v"
derivative = "u - v"
[[output]]
name = "speed"
equation = "v"
[[output]]
name = "push"
equation = "2*u"
[[input_filter]]
input = "u"
kind = "actuator_lag"
tau_s = "tau"
"""


@pytest.mark.parametrize("tau", [0.02, 0.3])
def test_states_follow_what_acts_and_outputs_see_a_sample(tau: float, tmp_path: Path) -> None:
    """Against 1000 points a sample: the speed as before, the push as it is when the step begins; none at tau 0."""
    (tmp_path / "model.toml").write_text(CART)
    model = equations_file.load(tmp_path / "model.toml")
    compiled, u = compile_equations(model), JUMPS[:, None]
    assert compiled.looks
    keep, forget = np.exp(-STEP / FINE / tau), np.exp(-STEP / FINE)
    slow = signal.lfilter([0.0, 1 - keep], [1.0, -keep], held(JUMPS) - JUMPS[0]) + JUMPS[0]
    after = np.concatenate([slow[1:], slow[-1:]])
    speed = signal.lfilter([0.0, 1 - forget], [1.0, -forget], 0.5 * (slow + after))[::FINE]
    y = simulate(compiled, u, np.array([tau]), model.x0, STEP)
    np.testing.assert_allclose(y[:, 0], speed, atol=1e-3 * np.ptp(JUMPS))  # mean for course: h²/8; a sample, 7e-3
    np.testing.assert_allclose(y[:, 1], 2 * means(0.5 * (slow + after), SEEN), atol=1e-4)
    np.testing.assert_array_equal(simulate(compiled, u, np.array([0.0]), model.x0, STEP)[:, 1], 2 * JUMPS)


@pytest.mark.parametrize("kind", ["actuator_lag", None])
def test_columns_that_a_model_does_not_use_change_nothing(kind: str | None, tmp_path: Path) -> None:
    """A recording's further channels stand behind the inputs; outputs once read them in place of what was seen."""
    text = CART if kind else CART[: CART.index("[[input_filter]]")]
    (tmp_path / "model.toml").write_text(text)
    model = equations_file.load(tmp_path / "model.toml")
    compiled, theta = compile_equations(model), np.array([0.02])
    found = []
    for u in (JUMPS[:, None], np.column_stack([JUMPS, SMOOTH, 9 * SMOOTH])):
        blank, gain = np.full((len(u), 2), np.nan), np.zeros((1, 2))
        found.append(
            compiled.predict(driven(compiled, u, theta, STEP), blank, theta, gain, model.x0, STEP, 1, 1, False)[1]
        )
    np.testing.assert_array_equal(found[0], found[1])
    assert compiled.looks is (kind is not None)


def test_what_begins_to_lag_has_the_slope_of_the_whole_step() -> None:
    """A sample of a dead time of 1 % of a step is another signal already; a score at none must not take that for it."""
    for kind in ("actuator_lag", "transport_delay", "actuator_second_order"):
        values = (1e-6 * STEP, 0.7)[: len(KINDS[kind].slots)]
        np.testing.assert_allclose(apply(kind, JUMPS, *values, part=SEEN), apply(kind, JUMPS, *values), rtol=1e-14)


@pytest.mark.parametrize("delay", [0.24, 0.05, 1.4])
def test_one_behind_another_sees_what_the_first_lets_through(delay: float) -> None:
    """A lead behind a dead time passes each jump when it comes, and a lag of nothing changes nothing.

    Reference: 1000 points a sample. A lead that is told the means of the dead time alone sees jumps before they come.
    """
    u = np.repeat(JUMPS, 2)
    late = KINDS["transport_delay"].rule(u, np.array([delay * STEP]), STEP, SPLIT)
    for kind, values in {
        "actuator_lag": (0.0,),
        "transport_delay": (0.0,),
        "actuator_second_order": (0.0, 0.7),
    }.items():
        np.testing.assert_array_equal(KINDS[kind].rule(late, np.array(values), STEP, SPLIT), late)
    found = KINDS["lead_lag"].rule(late, np.array([0.3, 0.7]), STEP, SPLIT)[::2]
    fine = np.concatenate([np.full(round(delay * FINE), JUMPS[0]), held(JUMPS)])[: len(JUMPS) * FINE]
    decay = np.exp(-STEP / FINE / 0.3)
    slow = signal.lfilter([1 - decay], [1, -decay], fine, zi=[decay * fine[0]])[0]
    before = np.concatenate([[fine[0]], slow[:-1]])
    np.testing.assert_allclose(found, means(fine + 0.7 * (fine - 0.5 * (before + slow)), SEEN), atol=0.02)
