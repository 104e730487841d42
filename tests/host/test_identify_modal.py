"""Check modal analysis of outputs alone: stabilisation, clusters, deviations, command, page and Python."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aeolid as ae
from aeolid.cli.main import main
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.formats import write_table
from aeolid.identify.clusters import Cluster, Criteria, _hand_out, _judge
from aeolid.identify.compressed import compress
from aeolid.identify.decimate import decimate
from aeolid.identify.diagram import Pole
from aeolid.identify.markov import estimate_markov
from aeolid.identify.modal import find_modal, shrunk_phases
from aeolid.identify.pole_spread import Spreader
from aeolid.identify.shape_spread import shape_covariance
from aeolid.identify.subspace import find_states, regressed_matrices
from aeolid.identify.uncertainty import matrix_spread, pole_covariance
from aeolid.identify.windows import find_scaling
from aeolid.models.angles import turn_of
from aeolid.models.shapes import assurance
from aeolid.plants.structure import Harmonics, Structure, shaken, shear_building
from aeolid.record import Channel, Record

KNOWN = Path(__file__).resolve().parents[2].parent / "shared" / "cases" / "known" / "openfast_reference"
STEP = 0.1
BUILDING = shear_building()
ONE = shaken(BUILDING, 2000, STEP, 1)
BUILDING_CHANNEL = ONE.channels[0]
LINES = Harmonics(0.31, (1, 3, 6), (0.6, 0.6, 0.3))


@pytest.fixture(scope="module")
def record():
    return shaken(BUILDING, 6000, STEP, 3)


@pytest.fixture(scope="module")
def found(record):
    return find_modal([record])


@pytest.mark.parametrize("order", [8, 11])
def test_deviations_straight_from_the_markov_parameters_are_those_by_way_of_the_matrices(record, order):
    factor = compress([record], find_scaling([record]), 10).whole
    estimate = estimate_markov(factor, (), "gcv")
    basis = find_states(factor, estimate.theta, 10)
    model = regressed_matrices(factor, basis.state_map(order), ())
    spread = matrix_spread(factor, basis, model, estimate, ())
    straight = Spreader(factor, basis, model, estimate)
    poles, up = straight.poles(), np.linalg.eigvals(model.A).imag > 0
    np.testing.assert_allclose(poles.covariance, pole_covariance(model.A, spread)[up], rtol=1e-8)
    by_matrices = shape_covariance(model, spread, 1)[up]
    for value, expected in zip(poles.values, by_matrices, strict=True):
        np.testing.assert_allclose(straight.shape_covariance(value, 1), expected, rtol=1e-7, atol=1e-12)


def test_states_of_a_smaller_order_are_the_first_of_a_larger_one(record):
    factor = compress([record], find_scaling([record]), 10).whole
    basis = find_states(factor, estimate_markov(factor, (), "gcv").theta, 10)
    whole = basis.state_map(12)
    # A product of more rows may be summed in another order: some roundings of the largest entry.
    np.testing.assert_allclose(whole[:7], basis.state_map(7), rtol=0, atol=1e-13 * np.abs(whole).max())


def test_modes_are_those_of_the_structure_and_all_else_is_spurious(found):
    hertz, damping, shapes = BUILDING.modes()
    assert len(found.modes) == 4 and found.listed == found.modes
    for mode, f, d, true in zip(found.modes, hertz, damping, shapes.T, strict=True):
        assert abs(mode.frequency_hz - f) < 4 * mode.frequency_std_hz < 0.03 * f
        assert abs(mode.damping - d) < 4 * mode.damping_std
        shape = np.array([mode.shape.values[n] for n in BUILDING.names])
        assert assurance(shape[:, None], true[:, None])[0, 0] > 0.99
    assert all(c.share > 0.9 for c in found.stability) and len(found.spurious) > 0
    taken = {id(p) for c in found.stability for p in c.poles}
    assert not any(id(p) in taken for c in found.spurious for p in c.poles)


def test_a_cluster_has_one_pole_of_a_model_at_most(found):
    for c in (*found.stability, *found.spurious):
        models = [(p.past, p.order) for p in c.poles]
        assert len(models) == len(set(models))


@pytest.mark.parametrize("azimuth", [True, False])
def test_no_harmonic_is_listed_as_a_mode(azimuth):
    result = find_modal([shaken(BUILDING, 6000, STEP, 5, harmonics=LINES, colour_hz=0.5, azimuth=azimuth)])
    assert [m.frequency_hz for m in result.listed] == pytest.approx(list(BUILDING.modes()[0]), rel=0.03)
    lines = [m for m in result.modes if m not in result.listed]
    assert [m.frequency_hz / 0.31 for m in lines] == pytest.approx([1, 3, 6], rel=2e-3)
    assert [m.rotor_order for m in lines] == ([1, 3, 6] if azimuth else [None] * 3)
    assert len(result.to_json()["harmonics"]) == 3


def test_another_unit_or_order_of_channels_changes_nothing_else(found, record):
    swapped = record.channels[::-1]
    values = record.values[:, ::-1] * np.array([1.0, 1.0, 1.0, 50.0])
    other = find_modal([replace(record, channels=swapped, values=values)])
    assert other.diagram.windows == found.diagram.windows
    for one, two in zip(found.modes, other.modes, strict=True):
        assert two.frequency_hz == pytest.approx(one.frequency_hz, rel=1e-6)
        assert two.damping_std == pytest.approx(one.damping_std, rel=1e-4)
        unit = 50.0 if one.shape.reference == "floor_1" else 1.0
        assert two.shape.values["floor_1"] == pytest.approx(50.0 / unit * one.shape.values["floor_1"], rel=1e-4)


def test_two_recordings_tell_more_than_one(found, record):
    more = find_modal([record, *(shaken(BUILDING, 6000, STEP, s) for s in (31, 32, 33))])
    ratios = [b.frequency_std_hz / a.frequency_std_hz for a, b in zip(found.modes, more.modes, strict=True)]
    assert np.median(ratios) == pytest.approx(0.5, rel=0.3)


def pole(order, hertz, damping=0.01, shape=(1.0, 0.5), past=10, deviation=0.001):
    return Pole(past, order, 0j, hertz, damping, deviation * hertz, deviation, np.array(shape, dtype=complex))


def test_poles_join_by_frequency_damping_and_shape():
    clusters, criteria = [], Criteria()
    _hand_out([pole(4, 1.0), pole(4, 2.0)], clusters, criteria)
    _hand_out([pole(5, 1.005), pole(5, 2.2)], clusters, criteria)  # too far in frequency
    _hand_out([pole(6, 1.0, damping=0.05), pole(6, 1.0, shape=(1.0, -2.0))], clusters, criteria)  # damping, shape
    _hand_out([pole(7, 1.001), pole(7, 1.004)], clusters, criteria)  # one of each model, the nearer one
    assert [len(c.poles) for c in clusters] == [3, 1, 1, 1, 1, 1]
    assert [p.order for p in clusters[0].poles] == [4, 5, 7]


def test_what_is_in_too_few_models_or_one_window_alone_is_spurious():
    models = frozenset((w, n) for w in (10, 20) for n in range(10, 20))
    everywhere = Cluster([pole(n, 1.0, past=w) for w in (10, 20) for n in range(10, 20)])
    one_window = Cluster([pole(n, 1.0, past=10) for n in range(10, 20)])
    below = Cluster([pole(n, 1.0, past=w) for w in (10, 20) for n in range(2, 10)])
    for c in (everywhere, one_window, below):
        _judge(c, models, (10, 20), Criteria())
    assert everywhere.physical and everywhere.share == 1.0
    assert not one_window.physical and one_window.by_window == {10: 1.0, 20: 0.0}
    assert not below.physical and below.counted == []


def test_a_wide_band_is_one_of_noise():
    criteria, alone = Criteria(), np.sqrt(0.01 / (2 * np.pi * 600))  # a mode of 1 Hz and 1 % in 600 s
    assert criteria.admits(pole(4, 1.0, deviation=3.9 * alone), 600.0)
    assert not criteria.admits(pole(4, 1.0, deviation=4.1 * alone), 600.0)
    assert not criteria.admits(pole(4, 1.0, damping=0.4), 600.0)
    assert not criteria.admits(pole(4, 1.0, deviation=np.nan), 600.0)
    assert criteria.admits(pole(4, 1.0, damping=0.0, deviation=1e-4), 600.0)  # a line has a band, if a narrow one


def test_settings_that_cannot_be_are_refused(record):
    with pytest.raises(UsageError, match="past window 1"):
        find_modal([record], past=1)
    with pytest.raises(UsageError, match="largest order 1"):
        find_modal([record], largest=1)
    with pytest.raises(NotIdentifiable, match=r"record longer|needs at least"):
        find_modal([record.slice(0, 40)], past=30)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("modal")
    record = shaken(BUILDING, 3000, STEP, 3, harmonics=LINES)
    columns = {"time_s": record.time_s} | {c.name: record.column(c.name) for c in record.channels}
    write_table(where / "shaken.csv", columns, {"time_s": "s"})
    roles = ['[recording]\ntime = "time_s"']
    roles += [
        f'[[channel]]\nname = "{c.name}"\nunit = "{c.unit}"\nrole = "{c.role}"' for c in record.channels
    ]  # fmt: skip
    (where / "roles.toml").write_text("\n".join(roles))
    return where


def test_the_command_writes_facts_page_and_picture_as_python_does(folder, capsys):
    base = [str(folder / "shaken.csv"), "--roles", str(folder / "roles.toml")]
    files = {name: folder / name for name in ("facts.json", "page.html", "diagram.svg")}
    own = ["--json", files["facts.json"], "--report", files["page.html"], "--picture", files["diagram.svg"]]
    assert main(["modes", *base, *map(str, own), "--reference", "floor_2"]) == 0
    shown = capsys.readouterr().out
    assert "shapes (amplitude beside the reference" in shown and "on multiples of the rotor's speed" in shown
    facts, page = json.loads(files["facts.json"].read_text()), files["page.html"].read_text()
    assert {m["rotor_order"] for m in facts["harmonics"]} == {1, 3, 6}
    assert all(m["shape"]["reference"] == "floor_2" for m in facts["modes"])
    assert "<script" not in page and page.count('type="checkbox" id=') == 3 + len(facts["windows"])
    assert page.count("<circle") == sum(p is not None for p in facts["poles"]["mode_hz"]) + page.count('r="2"')
    assert "<svg" in files["diagram.svg"].read_text()
    same = ae.modes(ae.read(folder / "shaken.csv", roles=folder / "roles.toml"), reference="floor_2")
    assert [m.frequency_hz for m in same.modes] == [m["frequency_hz"] for m in facts["modes"]]
    assert len(same.harmonics) == 3 and same.plot().get_xlabel() == "frequency (Hz)"
    assert main(["modes", *base, "--picture", str(folder / "diagram.gif")]) == 2
    assert "a picture is written as" in " ".join(capsys.readouterr().err.split())


@pytest.mark.nightly
def test_a_simulated_turbine_without_its_inputs():
    """Truth: the simulator's linearisation; of the loop, by a model driven by the injected excitation alone."""
    if not KNOWN.exists():
        pytest.skip("openfast_reference is not there")
    record = ae.read(KNOWN / "recording.csv.gz", roles=KNOWN / "roles.toml")
    modes = {m.name: m for m in ae.modes(record, decimate=2).modes}
    tower, side, shaft = (modes[n] for n in ("tower fore-aft", "tower side-side", "drive train"))
    assert tower.frequency_hz == pytest.approx(0.335, rel=0.03) and tower.damping == pytest.approx(0.084, rel=0.25)
    assert shaft.frequency_hz == pytest.approx(1.674, rel=0.03)
    for mode, loop in ((tower, 0.3446), (side, 0.3221), (shaft, 1.6631)):
        assert abs(mode.frequency_hz - loop) < 1.96 * mode.frequency_std_hz


def test_signals_without_modes_have_none_and_singular_ones_have_theirs():
    random, t = np.random.default_rng(0), np.arange(2000) * STEP
    one = shaken(BUILDING, 2000, STEP, 1).values[:, 2]

    def modes(*columns):
        values = np.column_stack(columns)
        channels = tuple(replace(BUILDING_CHANNEL, name=f"y{i}") for i in range(values.shape[1]))
        return find_modal([replace(ONE, time_s=t, values=values, channels=channels)]).modes

    assert modes(random.standard_normal(2000)) == () == modes(np.cumsum(random.standard_normal(2000)))
    (sine,) = modes(np.sin(np.pi * t))
    assert sine.tone and sine.frequency_hz == pytest.approx(0.5, rel=1e-9)
    twice, alone = modes(one, one), modes(one)
    for found in (twice, alone):  # a copy of a channel changes nothing to speak of
        hertz = [m.frequency_hz for m in found]
        assert len(hertz) >= 2 and max(min(abs(BUILDING.modes()[0] / f - 1)) for f in hertz) < 0.02


def test_phases_that_chance_explains_are_shrunk_towards_a_real_shape():
    """Of four sensors' phases about none a thirtieth of the squared error is left, of sure phases nothing goes.

    With ν = 3 the mean of max(0, 1 − 2ν/χ²)² χ² is 0.0943 by the integral over the density of χ², beside 3 unshrunk;
    its deviation over 3,000 draws is 0.0094.
    """
    random = np.random.default_rng(2)
    root = np.vstack([np.zeros((1, 3)), np.linalg.cholesky(np.array([[1.0, 0.5, 0], [0.5, 2.0, 0.3], [0, 0.3, 0.5]]))])
    shape, inverse = np.array([1.0, -0.4, 2.0, 0.7]), np.linalg.inv(root[1:] @ root[1:].T)
    left = []
    for _ in range(3000):
        drawn = shape + 1j * root @ random.standard_normal(3)
        kept = shrunk_phases(drawn, root)
        np.testing.assert_array_equal(kept.real, drawn.real)
        left.append(kept.imag[1:] @ inverse @ kept.imag[1:])
    assert np.mean(left) == pytest.approx(0.0943, abs=0.04)
    sure = shape + 1j * np.array([0.0, 30.0, -20.0, 10.0])
    np.testing.assert_allclose(shrunk_phases(sure, root), sure, rtol=0.01)
    np.testing.assert_array_equal(shrunk_phases(sure, np.zeros((4, 3))), sure)
    np.testing.assert_array_equal(shrunk_phases(sure, np.full((4, 3), np.nan)), sure)


def test_what_folds_down_from_beyond_half_of_the_lowered_rate_is_told():
    """At 20 Hz a mode of 3.5 Hz; thinned fourfold it is listed at 5 − 3.5 = 1.5 Hz, and said to be its image."""
    hertz, damping = 2 * np.pi * np.array([0.4, 1.1, 3.5]), 0.01
    shapes = np.array([[1.0, 0.5, 0.4], [0.3, 1.0, -0.8]])
    tower = Structure(
        np.eye(3), np.diag(2 * damping * hertz), np.diag(hertz**2), np.diag(hertz), shapes, ("tower_top", "tower_mid")
    )
    fast = shaken(tower, 16000, 0.05, 1)
    found = find_modal([fast], past=20, decimation=4)
    assert [m.frequency_hz for m in found.modes] == pytest.approx([0.4, 1.1, 1.5], rel=0.01)
    assert [m.folded_from_hz for m in found.modes[:2]] == [None, None]
    assert found.modes[2].folded_from_hz == pytest.approx(3.5, rel=0.02)
    assert any("images of what lies beyond" in note for note in found.notes)
    plain = find_modal([fast], past=40)
    assert plain.modes[-1].frequency_hz == pytest.approx(3.5, rel=0.01) and not plain.notes


@pytest.mark.parametrize("unit", ["deg", "°", "degrees", "rad", "rev", "turn"])
def test_an_angle_is_thinned_on_the_circle_in_every_unit(unit):
    """A rotor at 12 rpm, read every 0.05 s for 60 s: thinned by 5 the angle goes on by 18° a row."""
    time = np.arange(1200) * 0.05
    turns = np.mod(0.2 * time, 1.0)
    angle = Channel("azimuth", unit, role="azimuth")
    record = Record(time, (turns * turn_of(unit))[:, None], (angle,), 0.05, "rotor", "")
    slow = decimate(record, 5)
    steps = np.diff(np.unwrap(slow.values[:, 0] / turn_of(unit) * 2 * np.pi))
    np.testing.assert_allclose(steps, 2 * np.pi * 0.2 * 0.25, atol=1e-6)
    assert slow.values.max() <= turn_of(unit) and slow.values.max() > 0.9 * turn_of(unit)


def two_speeds(role, unit="rpm"):
    """Return two recordings at 11 and 12.5 rpm, the speed a channel of this role in this unit."""
    found = []
    for k, rpm in enumerate((11.0, 12.5)):
        made = shaken(BUILDING, 4000, STEP, k, harmonics=Harmonics(rpm / 60, (1, 3), (1.0, 0.7), 0.002))
        steps = np.gradient(np.unwrap(np.radians(made.column("azimuth"))), STEP) * 60 / (2 * np.pi)
        kept = [c for c in made.channels if c.role == "output"]
        values = np.column_stack([*(made.column(c.name) for c in kept), steps])
        found.append(replace(made, values=values, channels=(*kept, Channel("rotor_speed", unit, role=role))))
    return found


@pytest.mark.parametrize("role", ["scheduling", "output"])
def test_the_rotor_turns_as_recorded_whatever_role_its_speed_has(role):
    """Taken off its mean over both recordings the speed was that of none, and 1P was listed as a mode."""
    found = find_modal(two_speeds(role), past=20)
    assert found.turning is not None and found.turning.frequency_hz == pytest.approx(11 / 60, rel=0.01)


@pytest.mark.parametrize(("unit", "known"), [("U/min", True), ("r/min", True), ("min^-1", True), ("pu", False)])
def test_a_speed_in_a_unit_of_none_is_told(unit, known):
    found = find_modal(two_speeds("scheduling", unit)[:1], past=20)
    assert (found.turning is not None) is known
    assert any("harmonics of the rotor are not marked" in note for note in found.notes) is not known
