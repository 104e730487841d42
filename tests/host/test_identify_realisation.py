"""Check the realisation of several set-ups (PreGER): exact where models are, and its spread against differences."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm, logm

import aeolid as ae
from aeolid.cli.main import main
from aeolid.errors import NotIdentifiable, UsageError
from aeolid.formats import write_table
from aeolid.identify.global_basis import Part, join, spreads
from aeolid.identify.modal import find_modal
from aeolid.identify.setup_realisation import realise
from aeolid.identify.setup_states import balanced, restricted
from aeolid.models.shapes import assurance
from aeolid.plants.structure import mass_chain

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "studies"))
import setups as study

CHAIN = mass_chain()
HERTZ, DAMPING, SHAPES = CHAIN.modes()
REFERENCES, ROAMING = study.REFERENCES, study.ROAMING
SENSORS = [CHAIN.names.index(n) for n in (*REFERENCES, *(n for names in ROAMING for n in names))]
STATES, BLOCKS = 2 * len(HERTZ), 20
SMALL = 1e-9  # of the entries of a spread: differences are of its size


def exact_part(random, i, own=0, power=1.0):
    """Return the exact model of set-up i in a basis, under an excitation and with a level of its own.

    own: poles of its own beside those of the structure, as noise and coloured forces leave them; power: of its A.
    """
    A, _, C = CHAIN.state_space()
    n = STATES + own
    wide = np.zeros((n, n))
    wide[:STATES, :STATES] = expm(A * study.STEP)
    wide[STATES:, STATES:] = np.diag(random.uniform(0.2, 0.8, own))
    wide = logm(wide).real if power != 1 else wide
    wide = expm(wide * power) if power != 1 else wide
    rows = [CHAIN.names.index(s) for s in (*REFERENCES, *ROAMING[i])]
    outputs = np.hstack([C[rows], random.standard_normal((len(rows), own))])
    Q = np.eye(n) + 0.2 * random.standard_normal((n, n)) / np.sqrt(n)
    S = random.uniform(0.1, 10) * random.standard_normal((n, n)) / np.sqrt(n)
    return Part(Q @ wide @ np.linalg.inv(Q), outputs @ np.linalg.inv(Q), S)


def pairs(joint):
    """Return continuous poles above the real axis and their shapes in the order of the sensors, by frequency."""
    values, right = np.linalg.eig(joint.A)
    up = np.flatnonzero(values.imag > 0)
    up = up[np.argsort(abs(np.log(values[up])))]
    return np.log(values[up]) / study.STEP, (joint.C @ right)[:, up]


def eigenvalues(power=1.0):
    s = 2 * np.pi * HERTZ * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    return list(np.exp(s * study.STEP * power))


def require_exact(joint):
    s, shapes = pairs(joint)
    true = np.log(eigenvalues()) / study.STEP
    np.testing.assert_allclose(s, true, rtol=1e-8)
    exact = SHAPES[SENSORS]
    np.testing.assert_allclose(shapes / shapes[0], exact / exact[0], rtol=1e-8, atol=1e-8)


def test_exact_models_in_bases_of_their_own_make_the_exact_modes_of_all_sensors():
    """Without noise nothing but rounding is between them: condition numbers of some 1e4 on 1e-16."""
    random = np.random.default_rng(1)
    require_exact(join([exact_part(random, i) for i in range(3)], 2, STATES, BLOCKS))


def test_poles_of_one_set_up_alone_have_no_part_in_it():
    random = np.random.default_rng(2)
    parts = [restricted(exact_part(random, i, own), eigenvalues()) for i, own in enumerate((0, 3, 6))]
    assert [len(p.A) for p in parts] == [STATES] * 3
    require_exact(join(parts, 2, STATES, BLOCKS))


def test_models_of_other_sample_times_are_brought_to_one():
    random = np.random.default_rng(3)
    faster = restricted(exact_part(random, 1, 2, 0.5), eigenvalues(0.5), 2.0)
    require_exact(join([exact_part(random, 0), faster, exact_part(random, 2)], 2, STATES, BLOCKS))


def test_a_mode_that_one_set_up_lacks_leaves_the_others_exact():
    random = np.random.default_rng(4)
    lacking = restricted(exact_part(random, 1), [z for k, z in enumerate(eigenvalues()) if k != 2])
    joint = join([exact_part(random, 0), lacking, exact_part(random, 2)], 2, STATES, BLOCKS)
    s, shapes = pairs(joint)
    np.testing.assert_allclose(s, np.log(eigenvalues()) / study.STEP, rtol=1e-8)
    keep = [k for k in range(len(HERTZ)) if k != 2]
    exact = SHAPES[SENSORS]
    np.testing.assert_allclose((shapes / shapes[0])[:, keep], (exact / exact[0])[:, keep], rtol=1e-8, atol=1e-8)


def test_references_at_a_node_of_a_mode_are_refused():
    random = np.random.default_rng(5)

    def blind(part):
        """Return a part whose references do not see the first mode, of which they lose what its eigenvectors show."""
        values, right = np.linalg.eig(part.A)
        near = [int(np.argmin(abs(values - z))) for z in (eigenvalues()[0], np.conj(eigenvalues()[0]))]
        seen = (part.C[:2] @ right[:, near] @ np.linalg.inv(right)[near]).real
        return replace(part, C=np.vstack([part.C[:2] - seen, part.C[2:]]))

    with pytest.raises(NotIdentifiable, match=r"references observe 12 states .* 14 are needed"):
        join([blind(exact_part(random, i)) for i in range(3)], 2, STATES, BLOCKS)


def spread_about(random, part, off=0.0):
    """Return a part off its model by a little, with a spread of 3 rows."""
    n, outputs = len(part.A), len(part.C)
    change = off * random.standard_normal((n + outputs, n))
    root = SMALL * random.standard_normal((3, n + outputs, n))
    return replace(part, A=part.A + change[:n], C=part.C + change[n:], root=root)


def moved(part, by):
    """Return a part moved by one row of its spread."""
    dA, dC = np.split(by, [len(part.A)])
    return replace(part, A=part.A + dA, C=part.C + dC, root=None)


def require_differences(parts, reduced):
    """Compare the spread with central differences: off by the square of what poles move by, some 1e-5, and rounding."""
    small = [reduced(p) for p in parts]
    joint = join(small, 2, STATES, BLOCKS)
    given = np.concatenate([s.root for s in spreads(small, joint)]).reshape(3, 3, STATES + len(SENSORS), STATES)
    for j, part in enumerate(parts):
        for k, row in enumerate(part.root):
            sides = []
            for by in (row, -row):
                other = replace(reduced(moved(part, by)), S=small[j].S)
                sides.append(join([*small[:j], other, *small[j + 1 :]], 2, STATES, BLOCKS))
            (up, above), (down, below) = map(pairs, sides)
            want = (up - down) / 2, (above / above[0] - below / below[0]) / 2
            for a, b in zip(first_order(joint, *np.split(given[j, k], [STATES])), want, strict=True):
                assert abs(a - b).max() < 1e-4 * abs(b).max()


def test_the_spread_of_set_ups_that_disagree_is_what_differences_say():
    random = np.random.default_rng(6)
    require_differences([spread_about(random, exact_part(random, i), 1e-6) for i in range(3)], lambda p: p)


def test_the_spread_of_a_restricted_model_is_what_differences_say():
    """Of models that agree, as the weights S then do not matter, which are held fixed."""
    random = np.random.default_rng(8)
    parts = [spread_about(random, exact_part(random, i, 4)) for i in range(3)]
    require_differences(parts, lambda p: balanced(restricted(p, eigenvalues()), range(1, 8), 2, BLOCKS))


def first_order(joint, dA, dC):
    """Return what continuous poles and shapes beside the first reference move by, as `pairs` has them."""
    step = 1e-5 / max(abs(dA).max(), abs(dC).max())
    sides = [replace(joint, A=joint.A + sign * step * dA, C=joint.C + sign * step * dC) for sign in (1, -1)]
    (up, above), (down, below) = map(pairs, sides)
    return (up - down) / (2 * step), (above / above[0] - below / below[0]) / (2 * step)


def test_a_change_of_basis_moves_nothing():
    """ΔA = X A − A X, ΔC = −C X is the same model, whatever X; 1e-6 is rounding, of some 1e-12, over the step 1e-5."""
    random = np.random.default_rng(7)
    wide = [exact_part(random, i, 4) for i in range(3)]
    X = random.standard_normal((STATES + 4, STATES + 4)) / 10
    wide[1] = replace(wide[1], root=np.concatenate([X @ wide[1].A - wide[1].A @ X, -wide[1].C @ X])[None])
    parts = [restricted(p, eigenvalues()) for p in wide]
    joint = join(parts, 2, STATES, BLOCKS)
    given = next(iter(spreads(parts, joint))).root[0].reshape(-1, STATES)
    for change, size in zip(first_order(joint, *np.split(given, [STATES])), pairs(joint), strict=True):
        assert abs(change).max() < 1e-6 * abs(size).max()


@pytest.fixture(scope="module")
def modals():
    parts = zip(ROAMING, study.LEVELS, strict=True)
    return [find_modal([study.setup(CHAIN, roaming, i, level)]) for i, (roaming, level) in enumerate(parts)]


@pytest.fixture(scope="module")
def found(modals):
    return realise(modals, REFERENCES)


def test_realised_modes_are_those_of_the_whole_structure(found):
    """Errors below 4 deviations, the whole shape as the exact one; no pole of noise is listed."""
    assert found.by == "preger" and found.order == STATES and len(found.modes) == len(HERTZ)
    for merged, f, d, true in zip(found.modes, HERTZ, DAMPING, SHAPES.T, strict=True):
        mode = merged.mode
        assert set(mode.shape.values) == set(CHAIN.names) and not merged.notes
        assert abs(mode.frequency_hz - f) < 4 * mode.frequency_std_hz < 0.01 * f
        assert abs(mode.damping - d) < 4 * mode.damping_std < d
        psi = np.array([mode.shape.values[n] for n in CHAIN.names])
        assert assurance(psi[:, None], true[:, None])[0, 0] > 0.99


def test_neither_level_nor_the_order_of_set_ups_matters(found, modals):
    roaming = study.setup(CHAIN, ROAMING[1], 1, study.LEVELS[1])
    louder = find_modal([replace(roaming, values=100 * roaming.values)])
    other = realise([modals[2], modals[0], louder], REFERENCES[::-1], "level_4")
    for a, b in zip(found.modes, other.modes, strict=True):
        assert a.mode.frequency_hz == pytest.approx(b.mode.frequency_hz, rel=1e-8)
        assert a.mode.damping_std == pytest.approx(b.mode.damping_std, rel=1e-5)
        factor = a.mode.shape.values["level_4"]
        for name, value in b.mode.shape.values.items():
            assert abs(a.mode.shape.values[name] / factor - value) < 1e-6 * max(abs(value), 1)


def without(modal, gone):
    keep = [k for k in range(len(modal.modes)) if k not in gone]
    return replace(
        modal, modes=tuple(modal.modes[k] for k in keep), stability=tuple(modal.stability[k] for k in keep)
    )  # fmt: skip


def test_what_a_set_up_lacks_is_said_and_left_out(modals, found):
    other = realise([modals[0], without(modals[1], {2}), without(modals[2], {5, 6})], REFERENCES)
    assert len(other.modes) == len(HERTZ)
    assert set(other.modes[2].mode.shape.values) == {*REFERENCES, "level_1", "level_3", "level_7"}
    assert sum(other.modes[2].mode.shares.values()) == pytest.approx(1)
    assert "level_7" not in other.modes[5].mode.shape.values
    assert any("not found in set-up 2" in n and "without level_4, level_5" in n for n in other.modes[2].notes)
    for a, b in zip(found.modes, other.modes, strict=True):
        assert abs(a.mode.frequency_hz - b.mode.frequency_hz) < 3 * b.mode.frequency_std_hz


def test_a_mode_of_a_single_set_up_is_not_listed(modals):
    other = realise([modals[0], without(modals[1], {2}), without(modals[2], {2})], REFERENCES)
    assert len(other.modes) == len(HERTZ) - 1 and other.order == STATES - 2


def test_set_ups_that_disagree_widen_the_band_and_are_named(modals, found):
    shifted = tuple(replace(m, frequency_hz=1.02 * m.frequency_hz) for m in modals[1].modes)
    merged = realise([modals[0], replace(modals[1], modes=shifted), modals[2]], REFERENCES).modes[2]
    assert any("differ in frequency by more than their deviations explain" in n for n in merged.notes)
    assert merged.mode.frequency_std_hz > 2 * found.modes[2].mode.frequency_std_hz


def test_set_ups_without_a_common_mode_have_no_common_order(modals):
    parts = [without(m, set(range(7)) - {i}) for i, m in enumerate(modals)]
    with pytest.raises(NotIdentifiable, match="no two set-ups show the same mode"):
        realise(parts, REFERENCES)


def files(folder):
    """Write three short tables and one roles file of all sensors."""
    paths = []
    for i, roaming in enumerate(ROAMING):
        r = study.setup(CHAIN, roaming, i, study.LEVELS[i], 3000)
        paths.append(str(folder / f"part{i}.csv"))
        write_table(paths[-1], {"time_s": r.time_s} | {c.name: r.values[:, j] for j, c in enumerate(r.channels)})
    entries = "".join(f'[[channel]]\nname = "{n}"\nunit = "m"\nrole = "output"\n' for n in CHAIN.names)
    (folder / "roles.toml").write_text(entries)
    return paths


def test_command_page_and_python_say_the_same(tmp_path, capsys):
    paths, roles, page = files(tmp_path), str(tmp_path / "roles.toml"), tmp_path / "tower.html"
    call = ["modes", *paths, "--roles", roles, "--references", ",".join(REFERENCES), "--past", "2s"]
    facts = tmp_path / "tower.json"
    assert main([*call, "--merge-by", "preger", "--report", str(page), "--json", str(facts)]) == 0
    told = json.loads(facts.read_text())
    assert told["merged_by"] == "preger" and told["order"] == 2 * len(told["modes"])
    assert f"one realisation of {told['order']} states (PreGER)" in capsys.readouterr().out
    assert "(PreGER)" in page.read_text()
    records = [
        ae.read(p, {n: ("output", "m") for n in CHAIN.names if n in (*REFERENCES, *names)})
        for p, names in zip(paths, ROAMING, strict=True)
    ]
    again = ae.merge_setups(records, REFERENCES, past="2s", by="preger")
    assert again.to_json()["modes"] == told["modes"]
    with pytest.raises(UsageError, match="poser or preger"):
        ae.merge_setups(records, REFERENCES, by="global")


@pytest.mark.parametrize(
    ("more", "text"),
    [
        (["--merge-by", "preger"], "--merge-by preger is of set-ups"),
        (["--merge-by", "sum", "--references", "level_6"], "poser or preger"),
        (["--merge-by", "preger", "--references", "level_7"], "no such output"),
    ],
)  # fmt: skip
def test_calls_that_cannot_be_are_refused(tmp_path, capsys, more, text):
    assert main(["modes", *files(tmp_path), "--roles", str(tmp_path / "roles.toml"), *more]) == 2
    assert text in " ".join(capsys.readouterr().err.split())


@pytest.mark.nightly
def test_bands_hold_over_forty_draws():
    """As of PoSER: 2 % beyond the standard error of 280 modes, 1.3 %, on either side of 95 %."""
    rows = [row for seed in range(40) for row in study.compare(CHAIN, study.draw(CHAIN, seed)["preger"])]
    for key in ("z", "damping_z"):
        assert 0.91 < np.mean([abs(r[key]) <= study.NORMAL for r in rows]) < 0.99
    assert 0.91 < sum(r["inside"] for r in rows) / sum(r["entries"] for r in rows) < 0.995
    assert min(r["alike"] for r in rows if r["alike"] is not None) > 0.99
