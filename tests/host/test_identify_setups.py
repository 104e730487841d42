"""Check the merging of set-ups with reference sensors against the exact modes of a chain of masses."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aeolid as ae
from aeolid.cli.main import main
from aeolid.errors import DataError, UsageError
from aeolid.formats import write_table
from aeolid.identify.clusters import Cluster
from aeolid.identify.modal import find_modal
from aeolid.identify.setup_realisation import realise
from aeolid.identify.setup_request import outputs_of
from aeolid.identify.setup_shapes import PartShape, _whole, joined
from aeolid.identify.setups import merge
from aeolid.models.shapes import assurance
from aeolid.plants.structure import mass_chain, shaken

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "studies"))
import setups as study

CHAIN = mass_chain()
REFERENCES = study.REFERENCES
RECORDS = [
    study.setup(CHAIN, roaming, i, level)
    for i, (roaming, level) in enumerate(zip(study.ROAMING, study.LEVELS, strict=True))
]


@pytest.fixture(scope="module")
def modals():
    return [find_modal([r]) for r in RECORDS]


@pytest.fixture(scope="module")
def found(modals):
    return merge(modals, REFERENCES)


def test_merged_modes_are_those_of_the_whole_structure(found):
    """Each draw on its own: errors below 4 deviations, the whole shape as the exact one."""
    hertz, damping, shapes = CHAIN.modes()
    assert len(found.modes) == len(hertz)
    for merged, f, d, true in zip(found.modes, hertz, damping, shapes.T, strict=True):
        mode = merged.mode
        assert len(merged.seen) == 3 and set(mode.shape.values) == set(CHAIN.names)
        assert abs(mode.frequency_hz - f) < 4 * mode.frequency_std_hz < 0.01 * f
        assert abs(mode.damping - d) < 4 * mode.damping_std < d
        psi = np.array([mode.shape.values[n] for n in CHAIN.names])
        assert assurance(psi[:, None], true[:, None])[0, 0] > 0.99
        # three set-ups know a mode better than the best of them by itself
        assert mode.frequency_std_hz < min(s.mode.frequency_std_hz for s in merged.seen)
        assert not merged.notes


def test_levels_are_those_of_the_excitation_and_leave_the_shapes_alone(found, modals):
    np.testing.assert_allclose([s.level for s in found.setups], study.LEVELS, rtol=0.3)  # random excitation of 10 min
    louder = replace(RECORDS[1], values=100 * RECORDS[1].values)
    other = merge([modals[0], find_modal([louder]), modals[2]], REFERENCES)
    for a, b in zip(found.modes, other.modes, strict=True):
        for name, value in a.mode.shape.values.items():
            factor = a.mode.shape.values[b.mode.shape.reference]
            assert abs(value / factor - b.mode.shape.values[name]) < 1e-6 * max(abs(value / factor), 1)


def test_the_order_of_set_ups_does_not_matter(found, modals):
    turned = merge([modals[i] for i in (2, 0, 1)], REFERENCES[::-1])
    for a, b in zip(found.modes, turned.modes, strict=True):
        assert a.mode.frequency_hz == pytest.approx(b.mode.frequency_hz, rel=1e-12)
        factor = a.mode.shape.values[b.mode.shape.reference]
        for name, value in b.mode.shape.values.items():
            assert abs(a.mode.shape.values[name] / factor - value) < 1e-9 * max(abs(value), 1)


@pytest.mark.nightly
def test_bands_hold_over_forty_draws():
    """2 % beyond the standard error of 280 modes, 1.3 %, on either side of 95 %; shapes are as many entries of few."""
    rows = [row for seed in range(40) for row in study.compare(CHAIN, study.draw(CHAIN, seed)["poser"])]
    for key in ("z", "damping_z"):
        assert 0.91 < np.mean([abs(r[key]) <= study.NORMAL for r in rows]) < 0.99
    assert 0.91 < sum(r["inside"] for r in rows) / sum(r["entries"] for r in rows) < 0.995
    assert min(r["alike"] for r in rows if r["alike"] is not None) > 0.99


def part(values, references, size=1e-4):
    values = np.array(values, dtype=complex)
    return PartShape(values / values[np.argmax(abs(values))], size**2 * np.eye(2 * len(values)), references)


def test_exact_parts_join_to_the_exact_shape():
    psi = np.array([1, -0.4 + 0.1j, 0.3, 2j, 0.7])
    parts = [part(psi[[0, 1, 2]], 2), part((3 - 1j) * psi[[0, 1, 3, 4]], 2)]
    values, _, at = joined(parts, None)
    assert at == 3
    np.testing.assert_allclose(values, psi / psi[3], atol=1e-12)


def test_references_count_as_moving_by_their_deviations():
    """Five deviations of both parts of two entries, 5 x 2 x 0.02 = 0.2: below it a least-squares factor shrinks."""
    assert part([0.16, 0.16, 1], 2, 0.02).shows
    assert not part([0.12, 0.12, 1], 2, 0.02).shows
    assert part([0.12, 0.12, 1], 2, 0.002).shows


def test_the_spread_of_a_joined_shape_is_what_many_draws_have():
    """Linear propagation against 4000 draws: their variances are known to 2 %, and 10 % is far from a wrong formula."""
    random, psi = np.random.default_rng(3), np.array([1, -0.4 + 0.1j, 0.3, 0.9j, 0.7])
    means = [part(psi[[0, 1, 2]], 2, 0.01), part(psi[[0, 1, 3, 4]], 2, 0.02)]
    around = joined(means, 0)[1]
    weights, drawn = np.array([p.clearness**2 for p in means]), []
    for _ in range(4000):
        moved = []
        for p in means:
            noise = np.sqrt(p.covariance[0, 0]) * random.standard_normal((2, len(p.values)))
            moved.append(p.values + noise[0] + 1j * noise[1])
        whole = _whole(moved, 2, weights)
        drawn.append(whole / whole[0])
    off = np.array(drawn) - joined(means, 0)[0]
    for i in range(1, 5):
        np.testing.assert_allclose(off[:, i].real.var(), around[i, 0, 0], rtol=0.1)
        np.testing.assert_allclose(off[:, i].imag.var(), around[i, 1, 1], rtol=0.1)


def without(modal, i):
    """Return a modal analysis without its i-th mode."""
    keep = [k for k in range(len(modal.modes)) if k != i]
    return replace(
        modal, modes=tuple(modal.modes[k] for k in keep), stability=tuple(modal.stability[k] for k in keep)
    )  # fmt: skip


def test_a_mode_that_a_set_up_lacks_is_merged_of_the_others_and_said(modals):
    found = merge([modals[0], without(modals[1], 2), modals[2]], REFERENCES)
    assert len(found.modes) == 7
    merged = found.modes[2]
    assert [s.setup.number for s in merged.seen] == [1, 3]
    assert set(merged.mode.shape.values) == {*REFERENCES, "level_1", "level_3", "level_7"}
    (note,) = merged.notes
    assert "not found in set-up 2" in note and "without level_4, level_5" in note
    assert note in found.summary()


def test_set_ups_that_disagree_widen_the_band_and_are_named(modals):
    """A structure that became stiffer by 2 % of frequency between two set-ups: ten deviations of each."""
    moved = tuple(replace(m, frequency_hz=1.02 * m.frequency_hz) for m in modals[1].modes)
    found, plain = merge([modals[0], replace(modals[1], modes=moved), modals[2]], REFERENCES), merge(modals, REFERENCES)
    merged, before = found.modes[2], plain.modes[2]
    assert len(merged.seen) == 3
    (note,) = merged.notes
    assert "differ in frequency by more than their deviations explain" in note
    seen = [s.mode.frequency_hz for s in merged.seen]
    assert merged.mode.frequency_std_hz > 3 * before.mode.frequency_std_hz
    # the widened band of the mean reaches some way to the value of each
    assert merged.mode.frequency_std_hz > 0.3 * np.std(seen)


def test_references_at_a_node_join_nothing_and_divide_by_nothing(modals):
    """Poles of set-up 2 whose references stand still but for their noise: no shape of its sensors, and no blow-up."""
    target, count = modals[1], 2
    names = target.diagram.outputs
    still = np.array([n in REFERENCES for n in names])

    def quiet(cluster):
        def of(pole):
            shape = np.where(still, 1e-9 * pole.shape, pole.shape)
            return replace(pole, shape=shape / shape[np.argmax(abs(shape))])

        poles = {id(p): of(p) for p in cluster.poles}
        return Cluster([poles[id(p)] for p in cluster.poles], [poles[id(p)] for p in cluster.counted], cluster.share,
                       cluster.by_window, cluster.physical)  # fmt: skip

    stability = tuple(quiet(c) if i == count else c for i, c in enumerate(target.stability))
    found = merge([modals[0], replace(target, stability=stability), modals[2]], REFERENCES)
    merged = found.modes[count]
    assert len(merged.seen) == 3  # by its frequency
    assert set(merged.mode.shape.values) == {*REFERENCES, "level_1", "level_3", "level_7"}
    assert all(abs(v) < 10 for v in merged.mode.shape.values.values())
    assert any("the references hardly move in set-up 2" in note for note in merged.notes)


def test_modes_of_one_frequency_are_told_apart_by_the_references(modals):
    """A shape turned on the references is another mode, however near its frequency."""
    target = modals[1]
    flip = np.array([-1.0 if n == REFERENCES[0] else 1.0 for n in target.diagram.outputs])

    def turned(cluster):
        poles = {id(p): replace(p, shape=p.shape * flip) for p in cluster.poles}
        return Cluster([poles[id(p)] for p in cluster.poles], [poles[id(p)] for p in cluster.counted], cluster.share,
                       cluster.by_window, cluster.physical)  # fmt: skip

    other = replace(target, stability=(turned(target.stability[0]), *target.stability[1:]))
    found = merge([modals[0], other, modals[2]], REFERENCES)
    numbers = [[s.setup.number for s in m.seen] for m in found.modes[:2]]
    assert sorted(numbers) == [[1, 3], [2]]


@pytest.mark.parametrize(
    ("setups", "references", "outputs", "error", "text"),
    [
        (RECORDS[:1], REFERENCES, None, UsageError, "1 set-ups"),
        (RECORDS, (), None, UsageError, "no reference"),
        (RECORDS, ("level_6", "level_6"), None, UsageError, "twice"),
        (RECORDS, ("level_6", "level_1"), None, UsageError, "set-up 2 .* no such output.*all have level_2, level_6"),
        (RECORDS, ("level_6",), None, UsageError, "'level_2' is in set-ups 1 and 2 and 3 and no.*--references"),
        (RECORDS, REFERENCES, ["level_8"], UsageError, "--outputs level_8"),
        ([RECORDS[0], RECORDS[0]], REFERENCES, None, UsageError, "give each place a name of its own"),
    ],
)  # fmt: skip
def test_set_ups_that_cannot_be_merged_are_refused(setups, references, outputs, error, text):
    with pytest.raises(error, match=text):
        outputs_of([[r] for r in setups], references, outputs)


def test_a_reference_in_other_units_is_refused():
    channels = tuple(replace(c, unit="mm") if c.name == REFERENCES[1] else c for c in RECORDS[1].channels)
    with pytest.raises(DataError, match="in m in set-up 1 and in mm in set-up 2"):
        outputs_of([[RECORDS[0]], [replace(RECORDS[1], channels=channels)]], REFERENCES, None)


def measured(modals, place, factors):
    """Return the modal analyses with one set-up recorded again by references that have other factors."""
    record = RECORDS[place]
    values = record.values * [factors.get(c.name, 1.0) for c in record.channels]
    return [*modals[:place], find_modal([replace(record, values=values)]), *modals[place + 1 :]]


@pytest.mark.parametrize("way", [merge, realise])
@pytest.mark.parametrize(
    ("place", "factors", "text"),
    [
        (1, {"level_2": -1.0}, r"'level_2' has another sign in set-up 2 \(.* it is -1 times .* by -1;"),
        (0, {"level_2": 3.0}, r"'level_2' has another gain in set-up 1 \(.* it is 3\.?\d* times .* by 0\.33\d*;"),
        (2, {"level_6": -2.0}, r"'level_2' has another sign and gain in set-up 3 \(.* or 'level_6' has.* by -(2|1\.9)"),
    ],
)  # fmt: skip
def test_a_reference_of_another_sign_or_gain_in_one_set_up_is_refused_by_name(modals, way, place, factors, text):
    """The set-up that is not as the two others; of two references either may be the wrong one."""
    with pytest.raises(DataError, match=text) as refusal:
        way(measured(modals, place, factors), REFERENCES)
    assert "leave it out of the references" in str(refusal.value) and str(refusal.value).count("set-up 2") <= 1


def test_a_gain_that_is_a_little_other_is_said_and_what_references_cannot_tell_is_not(found, modals):
    """Of a sign and gain that all references have nothing is known."""
    assert found.notes == ()
    (note,) = merge(measured(modals, 1, {"level_2": 1.15}), REFERENCES).notes
    assert "'level_2' has another gain in set-up 2" in note and "1.1" in note
    assert merge(measured(modals, 1, {"level_2": -2.0, "level_6": -2.0}), REFERENCES).notes == ()


def test_of_three_references_the_one_that_is_other_is_named():
    """Sensors at levels 2, 4 and 6 stay: two of them agree, and the third is named without doubt."""
    references = ("level_2", "level_4", "level_6")
    records = [study.setup(CHAIN, (moved,), 60 + i, 1.0, references=references)
               for i, moved in enumerate(("level_1", "level_7"))]  # fmt: skip
    turned = records[1].values * [-1.0 if c.name == "level_4" else 1.0 for c in records[1].channels]
    first, other = (find_modal([r]) for r in (records[0], replace(records[1], values=turned)))
    with pytest.raises(
        DataError, match=r"^reference 'level_4' has another sign in set-up 2 .* than in set-up 1 .*: beside"
    ):
        merge([first, other], references)


def test_sample_times_may_differ():
    """Set-up 2 at 20 Hz, the same structure: poles are compared in Hz, not in the z-plane."""
    whole = shaken(CHAIN, 8000, 0.05, 77)
    keep = [i for i, c in enumerate(whole.channels) if c.name in (*REFERENCES, "level_4", "level_5")]
    fast = replace(whole, values=whole.values[:, keep], channels=tuple(whole.channels[i] for i in keep))
    found = ae.merge_setups([RECORDS[0], fast], list(REFERENCES), past="2s", largest_order=24)
    true = CHAIN.modes()[0]
    both = [m for m in found.result.modes if len(m.seen) == 2]
    assert len(both) >= 6
    for m in both:
        assert np.min(abs(true - m.mode.frequency_hz) / true) < 0.01
        z = m.mode.eigenvalue
        assert abs(np.log(z)) / (2 * np.pi * 0.05) == pytest.approx(m.mode.frequency_hz)


def files(folder, records):
    """Write three tables, each with its own columns, and one roles file of all sensors."""
    for i, r in enumerate(records):
        table = {"time_s": r.time_s} | {c.name: r.values[:, j] for j, c in enumerate(r.channels)}
        write_table(folder / f"part{i}.csv", table)
    entries = "".join(f'[[channel]]\nname = "{n}"\nunit = "m"\nrole = "output"\n' for n in CHAIN.names)
    (folder / "roles.toml").write_text(entries)
    return [str(folder / f"part{i}.csv") for i in range(len(records))]


def test_command_page_picture_and_python_say_the_same(tmp_path, capsys):
    short = [replace(r, time_s=r.time_s[:3000], values=r.values[:3000]) for r in RECORDS]
    paths, roles = files(tmp_path, short), str(tmp_path / "roles.toml")
    page, picture, facts = (tmp_path / n for n in ("tower.html", "tower.svg", "tower.json"))
    call = ["modes", *paths, "--roles", roles, "--references", ",".join(REFERENCES), "--past", "2s"]
    code = main([*call, "--report", str(page), "--picture", str(picture), "--json", str(facts)])
    text = capsys.readouterr().out
    assert code == 0 and "3 set-ups, 7 sensors, references level_6, level_2" in text
    told = json.loads(facts.read_text())
    assert len(told["modes"]) >= 5 and len(told["setups"]) == 3 and len(told["modes"][0]["shape"]["outputs"]) == 7
    html = page.read_text()
    assert "not determined" not in html  # of phases near zero
    assert "What each set-up says" in html and "level_7" in html and html.count("<svg") == 3
    ids = [part.split('"')[0] for part in html.split('type="checkbox" id="')[1:]]
    assert len(ids) == len(set(ids))
    assert picture.stat().st_size > 10_000
    found = ae.merge_setups(
        [ae.read(p, roles=str(own)) for p, own in zip(paths, own_roles(tmp_path), strict=True)], REFERENCES, past="2s"
    )
    assert found.to_json()["modes"] == told["modes"]
    assert "3 set-ups" in repr(found) and len(found.to_frame()) == len(told["modes"])
    assert len(found.plot()) == 3


def own_roles(folder):
    """Write a roles file for each set-up."""
    for i, r in enumerate(RECORDS):
        entries = "".join(f'[[channel]]\nname = "{c.name}"\nunit = "m"\nrole = "output"\n' for c in r.channels)
        (folder / f"own{i}.toml").write_text(entries)
        yield folder / f"own{i}.toml"


@pytest.mark.parametrize(
    ("more", "text"),
    [
        (["--references", "level_6,level_9"], "no such output"),
        (["--references", "level_6,"], "of no letters"),
        (["--references", "level_6", "--blades", "auto"], "--blades does not go"),
        (["--references", "level_6", "--roles", "other.toml"], "2 --roles for 3 set-ups"),
        (["--roles", "other.toml"], "name what they share, --references"),
    ],
)
def test_calls_that_cannot_be_are_refused(tmp_path, monkeypatch, capsys, more, text):
    monkeypatch.chdir(tmp_path)
    short = [replace(r, time_s=r.time_s[:100], values=r.values[:100]) for r in RECORDS]
    paths = files(tmp_path, short)
    (tmp_path / "other.toml").write_text((tmp_path / "roles.toml").read_text())
    assert main(["modes", *paths, "--roles", "roles.toml", *more]) == 2
    assert text in " ".join(capsys.readouterr().err.split())


def test_a_name_that_no_set_up_has_is_mistyped(tmp_path, capsys):
    paths = files(tmp_path, [replace(r, time_s=r.time_s[:100], values=r.values[:100]) for r in RECORDS])
    roles = tmp_path / "roles.toml"
    roles.write_text(roles.read_text().replace('"level_7"', '"levle_7"'))
    assert main(["modes", *paths, "--roles", str(roles), "--references", "level_6"]) == 3
    assert "levle_7" in capsys.readouterr().err


def test_a_set_up_without_modes_is_said(modals):
    nothing = replace(modals[1], modes=(), stability=())
    found = merge([modals[0], nothing, modals[2]], REFERENCES)
    assert any("set-up 2" in note and "shows no mode" in note for note in found.notes)
    assert merge([nothing, nothing], REFERENCES).modes == ()
