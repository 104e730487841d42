"""The challenge's plants: without effects they are their users' models, and every form of an effect keeps its law."""

from __future__ import annotations

import ast
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import aeolid.challenge
from aeolid.challenge import draw
from aeolid.challenge.bench import LOOP, STATES, Bench, loss_force, spring_force
from aeolid.challenge.chain import Chain
from aeolid.challenge.draw import build, place
from aeolid.challenge.families import FAMILIES
from aeolid.challenge.menu_turbine import outside, singles
from aeolid.challenge.models import PLANTS
from aeolid.challenge.paths import RING, Drive, Sensor, drive, read
from aeolid.challenge.plants import Setup, simulate
from aeolid.challenge.worth import Predictor, Whitening, Worth, worth
from aeolid.challenge.write import state_space
from aeolid.diagnose.hypotheses.catalogue import ENTRIES
from aeolid.errors import DataError
from aeolid.models import equations_file
from aeolid.models.exchange.files import read_state_space
from aeolid.record import Channel, Record

MODULES = sorted(Path(aeolid.challenge.__file__).parent.glob("*.py"))


PLUMBING = {
    "children",
    "compiled",
    "decompositions",
    "display",
    "errors",
    "inputs",
    "output",
    "text_files",
}  # no physics


def test_the_generator_shares_nothing_with_the_diagnosis() -> None:
    """No physics, no integrator, no vocabulary: what is proven must not prove itself."""
    for path in MODULES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        names += [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
        used = {n.split(".")[1] for n in names if n.startswith("aeolid.")}
        assert used <= {"challenge", "fleet", "report"} | PLUMBING, path.name


def test_the_vocabulary_is_that_of_the_catalogue() -> None:
    assert {i: f for f, ids in FAMILIES.items() for i in ids} == {e.id: e.family for e in ENTRIES}


def test_every_accepted_name_is_in_the_vocabulary_and_most_families_are_hidden() -> None:
    known = {i for ids in FAMILIES.values() for i in ids}
    hidden = {i for item in singles() for i in item.accepted[:1]}
    assert hidden <= known
    assert not any(i.accepted for i in outside())
    missing = [f for f, ids in FAMILIES.items() if not hidden & set(ids)]
    assert missing == ["parameter"]  # a wrong declared value is a class of its own


def still(name: str, curve: float = 1.0) -> Setup:
    """Return a plant without effect, wind and noise."""
    plant = PLANTS[name]
    quiet = replace(plant, outputs=tuple(replace(c, noise=0.0) for c in plant.outputs))
    physics = plant.physics._replace(curve=curve) if name == "turbine" else plant.physics
    outputs = tuple(c.name for c in plant.outputs if c.role == "output")
    return Setup(quiet, physics, physics, outputs=outputs, gusts=0.0)


def record_of(setup: Setup, columns: dict[str, np.ndarray]) -> Record:
    channels = [*(Channel(c.name, c.unit, "input") for c in setup.plant.inputs)]
    channels += [Channel(c.name, c.unit, "output") for c in setup.plant.outputs if c.name in setup.outputs]
    values = np.column_stack([columns[c.name] for c in channels])
    return Record(columns["time_s"], values, tuple(channels), setup.plant.step_s, "challenge", "")


@pytest.mark.slow
@pytest.mark.parametrize("name", list(PLANTS))
def test_a_plant_without_effect_is_its_users_model(name: str, tmp_path: Path) -> None:
    """Two integrators, two texts of one physics: within 2e-3 of each spread, half of it the model's own rule's."""
    setup = still(name)
    columns = simulate(setup, 600, 3)
    (tmp_path / "model.toml").write_text(setup.plant.model(setup.base, setup.outputs, {}, 1.0))
    model = equations_file.load(tmp_path / "model.toml")
    found = model.simulate(record_of(setup, columns))
    for i, output in enumerate(o.name for o in model.outputs):
        true = columns[output]
        assert np.sqrt(np.mean((found[:, i] - true) ** 2)) < 2e-3 * true.std(), output


@pytest.mark.parametrize("name", ["spring", "shaft", "heater", "turbine"])
def test_a_linear_plant_is_its_state_space_model(name: str, tmp_path: Path) -> None:
    """Exactly discretised, so what differs is the challenge's own integrator."""
    setup = still(name, curve=0.0)
    setup = replace(setup, outputs=tuple(o for o in setup.outputs if o != "power"))  # a product of input and state
    columns = simulate(setup, 600, 3)
    (tmp_path / "model.json").write_text(json.dumps(state_space(setup)))
    model = read_state_space(tmp_path / "model.json")
    found = model.simulate(np.column_stack([columns[s.name] for s in model.inputs]))
    for i, signal in enumerate(model.outputs):
        true = columns[signal.name]
        assert np.sqrt(np.mean((found[:, i] - true) ** 2)) < 1e-5 * true.std(), signal.name


def stepped(kind: str, form: int, a: float, b: float = 0.0, n: int = 40_000, dt: float = 1e-3) -> np.ndarray:
    """Return what a drive does with a unit step."""
    row, state, ring = Drive(0, kind, form, a, b).packed(), np.zeros(3), np.zeros(RING)
    return np.array([drive(row, state, ring, k, 1.0, dt, 0.0) for k in range(n)])


@pytest.mark.parametrize("form", [0, 1])
@pytest.mark.parametrize(("kind", "late"), [("lag", 0.4), ("delay", 0.4)])
def test_both_forms_of_a_late_drive_are_late_by_the_same_mean(kind: str, late: float, form: int) -> None:
    """∫(1 − step response) dt is the first moment of the impulse response."""
    y = stepped(kind, form, late)
    assert y[-1] == pytest.approx(1.0, abs=1e-9)
    assert np.sum(1 - y) * 1e-3 == pytest.approx(late, rel=0.01)


@pytest.mark.parametrize(
    ("kind", "a", "b", "late"),
    [("lag", 0.03, 0.0, 0.03), ("second_order", 40.0, 0.7, 2 * 0.7 / 40), ("delay", 0.0234, 0.0, 0.0234)],
)
def test_the_told_size_of_a_late_drive_is_that_of_its_mean(kind: str, a: float, b: float, late: float) -> None:
    """Whatever the fine step, ∫(1 − step response) dt is τ, 2ζ/ω, the dead time: half a step is 17 % of this lag."""
    for dt in (0.01, 0.005, 1e-4):
        y = stepped(kind, 0, a, b, n=round(4.0 / dt), dt=dt)
        assert np.sum(1 - y) * dt == pytest.approx(late, rel=0.005)


@pytest.mark.parametrize("dt", [0.01, 1e-4])
def test_the_told_rate_of_a_drive_is_its_rate(dt: float) -> None:
    """A step of 1 at a rate r misses the area 1/(2r), however long the fine step is."""
    y = stepped("rate", 0, 30.0, n=round(1.0 / dt), dt=dt)
    assert np.sum(1 - y) * dt == pytest.approx(1 / 60, rel=0.01)


@pytest.mark.parametrize("form", [0, 1])
def test_drives_with_limits_keep_them(form: int) -> None:
    dt = 1e-3
    rate = np.diff(stepped("rate", form, 0.5, n=3000)) / dt
    assert rate.max() == pytest.approx(0.5, rel=0.01) and stepped("rate", form, 0.5, n=4000)[-1] > 0.99
    row, state, ring = Drive(0, "saturation", form, 0.6).packed(), np.zeros(3), np.zeros(RING)
    assert abs(drive(row, state, ring, 0, -9.0, dt, 0.0) + 0.6) < 1e-3
    wave = 2 * np.sin(np.arange(20_000) * 2e-3)
    row, state = Drive(0, "backlash", form, 0.5, 1e-3).packed(), np.zeros(3)
    acts = np.array([drive(row, state, ring, k, u, dt, 0.0) for k, u in enumerate(wave)])
    assert np.abs(wave - acts).max() == pytest.approx(0.25, rel=0.05)


@pytest.mark.parametrize("other", [0.0, 1.0])
@pytest.mark.parametrize("effect", [{"dry": 1.0}, {"dry": 0.5, "excess": 0.5}, {"loop": 1.0}, {"slider": 20.0},
                                    {"drag": 1.0}, {"damper": 1.0}, {"relax": 5.0}])  # fmt: skip
def test_losses_take_energy_out_of_every_cycle(effect: dict[str, float], other: float) -> None:
    """∮ F dq < 0 once the memory has settled, at two amplitudes."""
    e, h = Bench(other=other, at=1e-9, **effect), 2e-4
    for size in (0.1, 0.3):
        s, ds, work = np.zeros(STATES), np.zeros(STATES), 0.0
        for k in range(20_000):  # 4 s: four cycles, the last is counted
            q, v = size * np.sin(2 * np.pi * k * h), 2 * np.pi * size * np.cos(2 * np.pi * k * h)
            ds[:] = 0.0
            force = loss_force(e, q, v, 1.0, s, ds)
            s += h * ds
            work += force * v * h if k >= 15_000 else 0.0
        assert work < -1e-3 * size**2, (effect, size)
    assert abs(s[LOOP]) <= 1.01 * e.loop_at


@pytest.mark.parametrize("other", [0.0, 1.0])
def test_both_forms_of_a_spring_agree_for_small_strokes(other: float) -> None:
    cubic, square = Bench(cubic=50.0, other=other), Bench(square=20.0, other=other)
    q = 0.05
    assert spring_force(cubic, q, 0.0, 0.0) == pytest.approx(-50 * q**3, rel=0.01)
    assert spring_force(square, q, 0.0, 0.0) == pytest.approx(-20 * q**2, rel=0.02)
    gap = Bench(gap=0.02, other=other)
    assert spring_force(gap, 0.4, 0.0, 0.0) == pytest.approx(gap.k * 0.02, rel=1e-3)
    assert spring_force(Bench(stop=50.0, stop_at=0.3, other=other), 0.29, 0.0, 0.0) == 0.0


def test_sensors_do_what_they_are_said_to() -> None:
    t = np.arange(20_000) * 1e-3
    fine, jitter = np.column_stack([np.sin(2 * t), np.cos(3 * t)]), np.zeros((1000, 2))

    def seen(*sensors: Sensor) -> np.ndarray:
        return read(sensors, fine, jitter, 20, 1e-3)

    clean = seen()
    assert np.array_equal(clean, fine[::20])
    assert np.array_equal(seen(Sensor(0, "rectified"))[:, 0], abs(clean[:, 0]))
    assert np.allclose(seen(Sensor(0, "offset", 0, 0.1))[100:, 0], np.sin(2 * (t[::20] - 0.1))[100:], atol=1e-12)
    gain = np.abs(np.mean(seen(Sensor(0, "lag", 0, 0.5))[:, 0] * np.exp(-2j * t[::20]))) * 2
    assert gain == pytest.approx(1 / np.hypot(1, 2 * 0.5), rel=0.05)  # |1/(1 + iωτ)|
    assert np.allclose(seen(Sensor(0, "offset", 0, 0.1005))[100:, 0], np.sin(2 * (t[::20] - 0.1005))[100:], atol=1e-6)
    swapped = seen(Sensor(0, "swap", b=1.0))
    assert np.array_equal(swapped, clean[:, ::-1])
    assert len(np.unique(np.diff(seen(Sensor(1, "stuck", a=0.4, b=0.3))[410:690, 1]))) == 1
    levels = seen(Sensor(0, "levels", 0, 0.25))[:, 0]
    assert np.abs(levels - clean[:, 0]).max() <= 0.125 + 1e-12


@pytest.mark.parametrize(("kind", "a", "late"), [("lag", 7e-3, 7e-3), ("second_order", 200.0, 2 * 0.7 / 200)])
def test_the_told_size_of_a_late_sensor_is_that_of_its_mean(kind: str, a: float, late: float) -> None:
    ramp = np.arange(4000.0)[:, None] * 1e-3
    seen = read((Sensor(0, kind, 0, a, 0.7),), ramp, np.zeros((200, 1)), 20, 1e-3)
    assert ramp[::20][-1, 0] - seen[-1, 0] == pytest.approx(late, rel=1e-3)


def test_a_clock_offset_is_told_by_the_sign_of_the_catalogue() -> None:
    """An output logged late belongs to inputs that were stamped early, which counts as positive."""
    (entry,) = (e for e in ENTRIES if e.id == "data_time_offset")
    assert entry.quantities[0].meaning.startswith("delay of the outputs")
    for item in (i for i in singles() if i.what == "clock offset"):
        setup = item.put(Setup(PLANTS[item.plant], None, None), 1.0, 0)
        dt, every = 1e-3, 20_000
        rows = np.arange(4 * every) * dt
        (sensor,) = setup.sensors
        logged = read((sensor,), rows[:, None], np.zeros((4, 1)), every, dt)[1:, 0]
        late = np.arange(1, 4) * every * dt - logged
        assert item.quantity is not None and late == pytest.approx(item.quantity[1](setup), abs=dt)


def test_what_is_not_there_is_worth_nothing_and_more_is_worth_more() -> None:
    plant = PLANTS["spring"]
    setup = Setup(plant, plant.physics, plant.physics, outputs=("position", "speed"))
    bare = simulate(setup, 2000, 5)
    assert worth(setup, bare, bare).nats == 0.0
    nats = []
    for tau in (0.005, 0.01, 0.02):
        late = replace(setup, drive=Drive(0, "lag", 0, tau))
        nats.append(worth(late, simulate(late, 2000, 5), bare).nats)
    assert 3.0 < nats[1] / nats[0] < 5.0 and 3.0 < nats[2] / nats[1] < 5.0  # with the square of a small effect


def test_noise_is_whitened_in_time_and_over_outputs() -> None:
    """Behind x[k] = 0.9 x[k-1] + w, a constant is worth (1 - 0.9)² of what it is behind w alone: Whittle's likelihood.

    Of two outputs whose noises are alike, their difference tells more than their sum.
    """
    rng = np.random.default_rng(3)
    w = rng.standard_normal((20000, 2)) @ np.array([[1.0, 0.8], [0.0, 0.6]])
    whiten = Whitening(lfilter([1.0], [1.0, -0.9], w, axis=0))
    constant = np.ones((400, 1)) * np.array([[1.0, 0.0], [1.0, 1.0], [1.0, -1.0]])[:, None]
    found = [float(np.sum(whiten(d)[100:] ** 2)) / 300 for d in constant]
    inverse = np.linalg.inv(np.array([[1.0, 0.8], [0.8, 1.0]]))
    expected = [0.01 * float(v @ inverse @ v) for v in constant[:, 0]]
    assert found == pytest.approx(expected, rel=0.15)  # (1 - 0.9)² from 20,000 samples: deviation 6 %
    white = whiten(lfilter([1.0], [1.0, -0.9], w, axis=0))[100:]
    assert np.cov(white.T) == pytest.approx(np.eye(2), abs=0.03)


def test_what_a_converter_rounds_otherwise_is_no_signature() -> None:
    """Air that moves a heater by less than a step of the converter was worth 77 nats, of which 4 remain."""
    plant = PLANTS["heater"]
    outputs = tuple(c.name for c in plant.outputs)
    item = next(i for i in singles() if i.plant == "heater" and i.what == "air_temperature acts")
    values = []
    for bits in (0, 12):
        setup = Setup(plant, plant.physics, plant.physics, outputs=outputs, chain=Chain(bits=bits))
        drawn = draw.Draw("single", (item,), setup, 0, "state_space", 5, (), None)
        value = draw.measure(drawn, [0.1], 3000)
        assert value is not None
        values.append(value.nats)
    assert 0.3 * values[0] < values[1] < values[0]  # coarse steps are noise, too


def test_what_a_free_value_can_imitate_is_taken_off() -> None:
    """A spring of another stiffness is worth nothing beyond what the free stiffness takes."""
    plant = PLANTS["spring"]
    base = Setup(plant, plant.physics, plant.physics, outputs=("position", "speed"))
    softer = replace(base, truth=plant.physics._replace(k=0.99 * plant.physics.k))
    hidden, bare = simulate(softer, 3000, 6), simulate(base, 3000, 6)
    held = replace(base, plant=replace(plant, free=("c",)))
    assert worth(base, hidden, bare).nats < 0.02 * worth(held, hidden, bare).nats


def test_the_predictor_of_the_bare_plant_leaves_white_innovations() -> None:
    for name in ("spring", "shaft", "heater"):
        plant = PLANTS[name]
        outputs = tuple(c.name for c in plant.outputs)
        setup = Setup(plant, plant.physics, plant.physics, outputs=outputs)
        e = Predictor(setup).innovations(simulate(setup, 4000, 7))[200:]
        for column in e.T:
            assert abs(np.corrcoef(column[1:], column[:-1])[0, 1]) < 4 / np.sqrt(len(column)), name


@pytest.mark.slow
def test_of_a_blades_lift_no_more_than_half_comes_late() -> None:
    """Half of a change of lift is there at once (Wagner 1925): what lags as a whole is a drive, and rightly called so.

    The strength that makes an effect worth finding stopped at eight times the usual, which was a share of 0.88.
    """
    (lift,) = (i for i in singles() if i.accepted == ("unsteady_aero",))
    drawn = [build("single", (lift,), seed, 3000) for seed in range(6)]
    shares = [place(d, d.strength).truth.lift for d in drawn]
    assert max(shares) == pytest.approx(0.5, rel=0.01), shares  # some want more to be found


def test_a_recording_that_runs_away_is_drawn_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """A case whose plant ran away was written with nine tenths of its recording missing, and counted."""
    (item,) = (i for i in singles() if i.accepted == ("stiction",) and i.plant == "shaft")
    whole = draw.measure
    asked: list[draw.Draw] = []

    def runs_away(drawn: draw.Draw, strength: object, samples: int) -> Worth:
        asked.append(drawn)
        return Worth(np.inf, np.inf, -np.inf)

    def at_first(drawn: draw.Draw, strength: list[float], samples: int) -> Worth | None:
        first = not asked or drawn.setup == asked[0].setup
        return runs_away(drawn, strength, samples) if first else whole(drawn, strength, samples)

    monkeypatch.setattr(draw, "measure", at_first)
    again = build("single", (item,), 3, 2000)
    assert again.value is not None and np.isfinite(again.value.nats)
    assert again.setup != asked[0].setup
    assert again.items == (item,) and again.seed == 3
    monkeypatch.setattr(draw, "measure", runs_away)
    with pytest.raises(DataError, match="runs away in each of 10 draws; make the challenge with another --seed"):
        build("single", (item,), 3, 2000)
