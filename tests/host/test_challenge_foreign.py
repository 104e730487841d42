"""Rigs of the foreign engine: their laws, their baselines, the measurement chain, and files without a hint."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from aeolid.challenge import engine
from aeolid.challenge.chain import NONE, Chain, anti_alias, convert, draw_chain, drive_signal, instants, kept, sample
from aeolid.challenge.engine import FINE
from aeolid.challenge.families import FAMILIES
from aeolid.challenge.foreign import MATTERS, Case, draw_cases, moves, record, sorts
from aeolid.challenge.march import levels
from aeolid.challenge.rig_menu import effects, outside
from aeolid.challenge.rigs import RIGS, Rig, Values
from aeolid.challenge.rigs_static import ALL, STATIC
from aeolid.challenge.write import ANSWERS, make, open_answers
from aeolid.cli.main import main
from aeolid.diagnose.hypotheses.catalogue import ENTRIES
from aeolid.errors import DataError, UsageError

pytest.importorskip("mujoco", reason="the extra challenge is not installed")
Array = NDArray[np.float64]
RIG = pytest.mark.parametrize("rig", RIGS.values(), ids=list(RIGS))
SAMPLES = 300


def test_signal(rig: Rig, samples: int = SAMPLES) -> Array:
    """Return steps as the rig is driven with, a value a sample."""
    return rig.rest(rig.values) + rig.swing * levels(np.random.default_rng(1), samples, rig.dwell, True)


test_signal.__test__ = False  # type: ignore[attr-defined]


def run(rig: Rig, values: Values, commands: Array, start: tuple[float, ...] | None = None) -> Array:
    """Return all outputs at every step of the engine under held commands."""
    held = np.repeat(commands, FINE)
    begin = np.array(rig.start(values) if start is None else start)
    drives = np.column_stack([held, np.zeros_like(held)])
    return engine.simulate(rig.write(values), begin, drives, np.array([rig.rest(values)]))


def solve(text: str, commands: Array, name: str, step_s: float) -> Array:
    """Solve model.toml by scipy's eighth-order rule: neither the engine's nor the product's."""
    told = tomllib.loads(text)
    constants = {k: v["value"] for k, v in told["parameters"].items()} | {"sin": np.sin}
    names = [s["name"] for s in told["state"]]
    rates = [compile(s["derivative"], "rate", "eval") for s in told["state"]]
    shown = [compile(o["equation"], "output", "eval") for o in told["output"]]
    x, found = [s["initial"]["value"] for s in told["state"]], []
    for u in commands:
        known = constants | {name: u}
        found.append([eval(s, known | dict(zip(names, x, strict=True))) for s in shown])

        def flow(t: float, x: Array, known: dict[str, Any] = known) -> list[float]:
            return [eval(r, known | dict(zip(names, x, strict=True))) for r in rates]

        x = solve_ivp(flow, (0.0, step_s), x, method="DOP853", rtol=1e-7, atol=1e-9).y[:, -1]
    return np.array(found)


@RIG
def test_without_an_effect_the_engine_and_the_written_model_agree(rig: Rig) -> None:
    """The engine's rule is of first order: force to speed and speed to position may each be off by one of its steps."""
    u = test_signal(rig, 120)
    fine = run(rig, rig.values, u)
    most = 2 * np.max(np.abs(np.diff(fine, axis=0)), axis=0)
    away = np.abs(solve(rig.model(rig.values, {}, {}), u, rig.drive.name, rig.step_s) - fine[::FINE])
    assert np.all(away.max(axis=0) <= most)


@pytest.mark.parametrize("rig", STATIC.values(), ids=list(STATIC))
def test_forces_of_imposed_motions_are_in_balance(rig: Rig) -> None:
    """What the servo gives is the written law; the damper's law has no inertia, and its rod and piston are 0.3 kg."""
    case = Case("null", rig, (), (), NONE, 7)
    seen = record(case, 400)
    told = tomllib.loads(rig.model(rig.values, {}, {}))
    law = {k: v["value"] for k, v in told["parameters"].items()} | {"sin": np.sin} | seen
    output = told["output"][0]
    rest = seen[output["name"]] - eval(output["equation"], {}, law)
    inertia = rig.values["mass"] * np.gradient(seen["speed"], rig.step_s) if rig.name == "damper" else 0.0
    noise = np.std([o.noise for o in rig.outputs if o.role == "output"]) + rig.outputs[2].noise
    assert not told.get("state") and np.std(rest - inertia) < 0.02 * np.std(seen[output["name"]]) + 3 * noise
    held = {**rig.values, "dry": 0.1 * float(np.std(seen[output["name"]]))}
    motion = np.linspace(0.0, 0.5 * rig.swing, 200 * FINE)[:, None]
    up = engine.simulate(rig.write(held), np.zeros(1), motion) - engine.simulate(
        rig.write(rig.values), np.zeros(1), motion
    )
    assert np.mean(up[100 * FINE :, 2]) == pytest.approx(held["dry"], rel=0.02)


def test_a_rig_that_runs_away_is_refused_and_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rig = STATIC["damper"]
    with pytest.raises(DataError, match="runs away"):
        engine.simulate(rig.write({**rig.values, "mass": 1e-4}), np.zeros(1), np.full((500, 1), 0.01))
    assert not list(tmp_path.iterdir())


@RIG
def test_the_linear_model_is_that_of_the_equations(rig: Rig) -> None:
    """State space and engine are one discrete system: what remains is rounding of the differences (1e-6 a state)."""
    if not rig.linear:
        pytest.skip(f"{rig.title}: gravity is not linear")
    u, model = test_signal(rig), Case("null", rig, (), (), NONE, 1, "state_space").state_space()
    A, B, C = (np.array(model[k]) for k in "ABC")
    x, found = np.zeros(len(A)), []
    for value in u:
        found.append(C @ x + [o["offset"] for o in model["outputs"]])
        x = A @ x + B[:, 0] * (value - model["inputs"][0]["offset"])
    seen = run(rig, rig.values, u)[::FINE]
    assert np.max(np.abs(np.array(found) - seen) / np.std(seen, axis=0)) < 1e-4
    assert np.all(np.abs(np.linalg.eigvals(A)) < 1)


def test_a_stiff_pair_of_teeth_without_play_is_one_body() -> None:
    """The gear as two bodies and a spring, with hardly any play, is the gear as one reflected inertia."""
    rig = RIGS["gears"]
    u = test_signal(rig)
    one, two = run(rig, rig.values, u), None
    values = {**rig.values, "gap": 1e-9}
    two = engine.simulate(
        rig.write(values), np.zeros(2), np.column_stack([np.repeat(u, FINE), np.zeros(len(u) * FINE)])
    )
    ratio = np.std(one - two, axis=0) / np.std(one, axis=0)
    assert ratio[0] < 0.01  # the teeth's own mode is at 3000 N m/rad, 280 times the servo's stiffness


@pytest.mark.parametrize(("name", "at"), [("pendulum", (1.0,)), ("cart", (0.3,)), ("arm", (0.8, 0.0))])
def test_energy_only_falls_without_a_drive(name: str, at: tuple[float, ...]) -> None:
    rig = RIGS[name]
    for dry in (0.0, rig.weak):
        v = {**rig.values, "dry": dry}
        seen = run(rig, v, np.zeros(SAMPLES), at)
        if name == "pendulum":
            energy = 0.5 * (v["inertia"] + v["mass"] * v["arm"] ** 2) * seen[:, 1] ** 2
            energy += 9.81 * v["mass"] * v["arm"] * (1 - np.cos(seen[:, 0]))
        elif name == "cart":
            energy = 0.5 * v["mass"] * seen[:, 1] ** 2 + 0.5 * v["k"] * seen[:, 0] ** 2
        else:  # link and joint are not seen: turning points of the motor only
            energy = np.maximum.accumulate(np.abs(seen[::-1, 0]))[::-1]
        # a first-order rule may lift the sum within a step by the square of the step, never over a sample
        assert np.all(np.diff(energy[::FINE]) <= 1e-4 * energy[0])
        assert energy[-1] < 0.7 * energy[0]


@pytest.mark.parametrize("name", ["pendulum", "cart", "gears", "cable", "masses", "arm"])
def test_dry_friction_stops_at_the_declared_force(name: str) -> None:
    """Just below the declared force nothing moves that friction holds; just above it does."""
    rig, dry = RIGS[name], 0.2
    v, moved = {**rig.values, "dry": dry}, []
    for share in (0.95, 1.05):
        force = np.zeros((40 * FINE, 2))
        force[:, 0], force[:, 1] = rig.rest(v), share * dry
        seen = engine.simulate(rig.write(v), np.array(rig.start(v)), force)
        moved.append(np.max(np.abs(seen[:, 0] - seen[0, 0])))
    assert moved[0] < 0.05 * moved[1]


def test_an_end_stop_holds_and_a_limit_clips() -> None:
    rig = RIGS["cart"]
    u = test_signal(rig, 1000)
    free = run(rig, rig.values, u)
    stopped = run(rig, {**rig.values, "stop": 0.2}, u)
    reach = np.max(np.abs(stopped[:, 0]))
    assert np.max(np.abs(free[:, 0])) > 0.3 and 0.2 < reach < 0.23
    limited = run(rig, {**rig.values, "most": 1.0}, u)
    np.testing.assert_array_equal(limited, run(rig, rig.values, np.clip(u, -1.0, 1.0)))


def test_a_dead_time_is_as_long_as_it_says_and_a_lag_has_its_moment() -> None:
    rig = RIGS["cart"]
    u = test_signal(rig)
    plain = run(rig, rig.values, u)
    late = run(rig, {**rig.values, "late": 2 * rig.step_s}, u)
    np.testing.assert_allclose(late[2 * FINE :], plain[: -2 * FINE], atol=1e-12)
    step = np.ones(1500)
    slow, quick = (run(rig, {**rig.values, "lag": x}, step)[:, 0] for x in (0.06, 0.0))
    moment = np.sum(quick - slow) * rig.step_s / FINE / quick[-1]
    assert moment == pytest.approx(0.06, abs=rig.step_s / FINE)


def test_rigs_and_effects_are_as_promised() -> None:
    known = {i for ids in FAMILIES.values() for i in ids}
    listed = effects()
    assert {e.plant for e in listed} == set(ALL) and len(RIGS) == 6
    assert {i for e in listed for i in e.accepted} <= known and all(not e.accepted for e in outside())
    for cases in (12, 20, 60):
        drawn = sorts(cases, np.random.default_rng(0))
        assert drawn.count("null") * 3 >= cases and {"parameter", "double", "outside"} <= set(drawn)
        assert drawn.count("single") >= 0.3 * cases


def test_sizes_bear_the_labels_of_the_catalogue() -> None:
    """A size under another label would never be compared; of turning joints a friction is told as a torque."""
    labels = {entry.id: {q.symbol for q in entry.quantities} | {"torque_N_m"} for entry in ENTRIES}
    for effect in effects():
        assert not effect.label or effect.label in labels[effect.accepted[0]], (effect.what, effect.plant)


def test_every_effect_moves_its_rig() -> None:
    """By more than the noise of the sensors, with the sizes as they are drawn; nothing runs away."""
    for case in draw_cases(12, 5, 1000):
        if case.hidden:
            assert case.moved is not None and 0.02 < case.moved < 2.0, case.hidden
            assert moves(case, 500) > 0


def test_a_chain_delays_by_less_than_a_sample() -> None:
    """A ramp comes back late by the filter and the offset, together within one sample, by whatever chain."""
    every, ramp = FINE, np.arange(200.0 * FINE)[:, None] / FINE
    for seed in range(20):
        rng = np.random.default_rng(seed)
        chain = draw_chain(rng)
        shown = sample(anti_alias(chain, ramp, every), instants(chain, 200, rng), every)
        assert np.all(np.abs(shown[20:190, 0] - np.arange(20, 190)) < 1.0)


def test_the_chain_does_each_of_its_things() -> None:
    rng = np.random.default_rng(2)
    x = rng.standard_normal((500, 2))
    np.testing.assert_array_equal(drive_signal(NONE, x, 4), np.repeat(x, 4, axis=0))
    np.testing.assert_array_equal(anti_alias(NONE, x, 4), x)
    np.testing.assert_array_equal(convert(NONE, x), x)
    np.testing.assert_array_equal(sample(x, instants(NONE, 125, rng), 4), x[::4])
    steps = np.unique(np.round(np.diff(np.unique(convert(Chain(bits=8), x)[:, 0])), 9))
    assert np.allclose(steps / steps[0], np.round(steps / steps[0])) and steps[0] >= 2 * np.max(np.abs(x)) / 2**8
    assert kept(Chain(lost=5), 500, rng).sum() == 495
    still = drive_signal(Chain(still=(0.2, 0.4)), x, 1)
    assert not np.any(still[100:200]) and np.any(still[:100])
    smooth = drive_signal(Chain(analogue=True), np.repeat(x, 10, axis=0), FINE)
    spectrum = np.abs(np.fft.rfft(smooth[:, 0] * np.hanning(len(smooth)))) ** 2
    band = np.fft.rfftfreq(len(smooth), 1 / FINE)
    assert spectrum[band > 0.5].sum() < 1e-2 * spectrum.sum()  # beyond half the rate there is nothing to alias


@pytest.fixture(scope="module")
def challenge(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("foreign") / "rigs"
    make(folder, cases=12, seed=3, samples=1000, physics="foreign")
    return folder


def test_the_same_seed_makes_the_same_bytes(challenge: Path, tmp_path: Path) -> None:
    make(tmp_path / "again", cases=12, seed=3, samples=1000, physics="foreign")
    ours, again = ({p.relative_to(f): p.read_bytes() for p in f.rglob("*") if p.is_file()}
                   for f in (challenge, tmp_path / "again"))  # fmt: skip
    assert ours == again


def test_cases_tell_nothing_and_answers_tell_all(challenge: Path) -> None:
    found = open_answers(challenge)
    assert found["settings"]["physics"] == "foreign" and (challenge / ANSWERS).exists()
    words = {e.what for e in (*effects(), *outside())} | {i for ids in FAMILIES.values() for i in ids}
    for name, answer in found["answers"].items():
        told = "".join(p.read_text() for p in (challenge / name).iterdir() if p.suffix != ".csv")
        assert not [w for w in words if w in told]
        assert not re.search(r"hidden|effect|seed|strength|truth|mujoco", told)
        assert bool(answer["matters"]) == (answer["class"] != "null")
        assert answer["imperfections"]["dry"] > 0 and answer["imperfections"]["declared"]
        rows = [p.read_text().count("\n") for p in (challenge / name).glob("recording*.csv")]
        assert len(rows) == answer["recordings"] and sum(rows) < 1001  # some are lost
        off = np.abs(np.array(list(answer["imperfections"]["declared"].values())) - 1)
        assert np.all((off >= 0.01) & (off <= 0.03))


@RIG
def test_the_friction_that_every_rig_has_does_not_matter(rig: Rig) -> None:
    """It moves a free run by less than the least that an effect does."""
    u = test_signal(rig, 1000)
    clean, weak = (run(rig, {**rig.values, "dry": dry}, u) for dry in (0.0, rig.weak))
    assert np.max(np.std(clean - weak, axis=0) / np.std(clean, axis=0)) < 0.5 * MATTERS[0]


def test_without_the_engine_one_sentence_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(engine.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UsageError, match=r"pip install 'aeolid\[challenge\]'"):
        engine.require_engine()
    assert main(["challenge", "make", str(tmp_path / "x"), "--physics", "foreign"]) == 2
    assert "MuJoCo, which is not installed" in re.sub(r"\s+", " ", capsys.readouterr().err)
    assert not (tmp_path / "x").exists()
    assert main(["challenge", "make", str(tmp_path / "x"), "--physics", "other"]) == 2


def test_recordings_of_one_case_are_alike_and_yet_not_the_same() -> None:
    case = next(c for c in draw_cases(6, 2, 1000) if c.sort == "null")
    first, second = record(case, 300, 0), record(case, 300, 1)
    assert first.keys() == second.keys() and len(first["time_s"]) < 300
    assert not np.array_equal(first[case.rig.outputs[1].name][:50], second[case.rig.outputs[1].name][:50])
