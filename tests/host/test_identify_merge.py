"""Hold the merging of recordings to its laws, and refuse what cannot be merged or told, for every method."""

from dataclasses import replace

import numpy as np
import pytest

from aeolid.cli.main import main
from aeolid.errors import DataError, NotIdentifiable
from aeolid.identify.fir import identify_fir
from aeolid.identify.lpv import identify_lpv
from aeolid.identify.ort import identify_ort
from aeolid.identify.subspace import spectral_radius
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import factorise, find_scaling
from aeolid.plants.lti import simulate_fourth_order
from aeolid.record import Channel, Record

NAMES = (
    ("u1", "input"),
    ("u2", "input"),
    ("r", "disturbance"),
    ("s", "scheduling"),
    ("y1", "output"),
    ("y2", "output"),
)
PAST = 5


def simulate(samples, seed, kind="", growth=0.7):
    """Simulate a plant of order two with two inputs, a disturbance, a scheduling that does nothing, and noise."""
    random = np.random.default_rng(seed)
    u, r, noise = random.standard_normal((samples, 2)), random.standard_normal(samples), None
    s = np.sin(0.05 * np.arange(samples)) + 0.3 * random.standard_normal(samples)
    if kind == "sine":
        u[:, 0] = np.sin(0.4 * np.arange(samples))
    if kind == "collinear":
        u[:, 1] = 2 * u[:, 0]
    if kind == "late":
        u[1:, 1] = u[:-1, 0]
        u[0, 1] = 0.0
    if kind == "still":
        s[:] = 7.0
    A, B = np.array([[growth, 0.5], [-0.4, 0.6]]), np.array([[1.0, 0.3, 0.4], [-0.5, 0.8, 0.2]])
    if growth > 1:
        A[:] = [[growth, 0.0], [0.1, 0.5]]
    C, x, y = np.array([[1.0, 0.2], [-0.3, 0.9]]), np.zeros(2), np.empty((samples, 2))
    noise = 0.1 * random.standard_normal((samples, 2))
    for k in range(samples):
        y[k] = C @ x + noise[k]
        if kind == "loop":
            u[k] -= [0.5 * y[k, 0], 0.1 * y[k, 1]]
        x = A @ x + B @ np.array([*u[k], r[k]])
    return np.column_stack([u, r, s, y])


def record_of(values, source="a.csv", roles=NAMES, step=0.1):
    channels = tuple(Channel(name, "V", role) for name, role in roles)
    return Record(np.arange(len(values)) * step, values, channels, step, source, "")


def fourth(samples, seed, source="a.csv"):
    return replace(simulate_fourth_order(samples, seed, feedback=0.25), source=source)


def same_poles(a, b, tolerance):
    np.testing.assert_allclose(np.sort_complex(a.eigenvalues), np.sort_complex(b.eigenvalues), atol=tolerance)


@pytest.mark.parametrize("method", [identify_varx, identify_varmax])
def test_recordings_merge_as_one_recording_with_missing_samples_between(method):
    """Windows, moments, states and fit are those of one file in which the recordings lie behind a hole."""
    parts = [fourth(900, 1), fourth(350, 2), fourth(140, 3)]
    hole = np.full((1, 4), np.nan)
    values = np.vstack([parts[0].values, hole, parts[1].values, hole, parts[2].values])
    one = replace(parts[0], values=values, time_s=np.arange(len(values), dtype=float))
    options = {"past": PAST, "order": 4, "feedthrough": ("u1",), "missing": "leave-out", "detrend": "none"}
    apart, together = method(parts, **options), method([one], **options)
    lead = PAST if method is identify_varx else 2 * PAST  # e is known from the p samples before
    assert apart.windows == together.windows == 900 + 350 + 140 - 3 * lead
    same_poles(apart, together, 1e-8)
    np.testing.assert_allclose(apart.model.D, together.model.D, atol=1e-8)
    assert apart.fit.one_step.vaf["y1"] == pytest.approx(together.fit.one_step.vaf["y1"], abs=1e-6)
    assert not apart.model.D[:, 1].any() and apart.model.D[:, 0].any()


def test_channels_may_stand_in_another_order_and_the_order_of_recordings_does_not_matter():
    parts = [fourth(600, 1), fourth(300, 2, "b.csv")]
    other = replace(parts[1], values=parts[1].values[:, [3, 0, 2, 1]],
                    channels=tuple(parts[1].channels[i] for i in (3, 0, 2, 1)))  # fmt: skip
    base = identify_varx(parts, past=PAST, order=4)
    for again in ([parts[0], other], parts[::-1]):
        same_poles(identify_varx(again, past=PAST, order=4), base, 1e-9)
    scaling = find_scaling([parts[0], other])
    np.testing.assert_allclose(scaling.scale, find_scaling(parts).scale, rtol=1e-12)
    R = [factorise(p, scaling, PAST).full for p in (parts, [parts[0], other])]
    np.testing.assert_allclose(R[0].T @ R[0], R[1].T @ R[1], atol=1e-8)


def test_a_short_recording_without_a_window_changes_nothing_but_the_scaling():
    """Its samples count for mean and deviation, which weigh the outputs against each other in the choice of states."""
    long, short = fourth(900, 1), fourth(4, 2)
    options = {"past": PAST, "order": 4, "regularization": "none"}
    alone, both = identify_varx([long], **options), identify_varx([long, short], **options)
    assert both.windows == alone.windows and len(both.data) == 2
    same_poles(both, alone, 1e-4)


def test_merged_models_are_stable_on_request():
    parts = [record_of(simulate(400, seed, "loop", growth=1.02)) for seed in (1, 2)]
    result = identify_varx(parts, past=PAST, order=2)
    assert spectral_radius(result.model.A) == pytest.approx(1.02, abs=0.02) and spectral_radius(result.model.A) > 1
    assert any("outside the unit circle" in note for note in result.notes)
    for refined in (False, True):
        stable = identify_varx(parts, past=PAST, order=2, stable=True, refined=refined).model
        assert spectral_radius(stable.A) < 1 and spectral_radius(stable.A - stable.K @ stable.C) < 1


def without(name):
    return [i for i, (n, _) in enumerate(NAMES) if n != name]


def other_record(kind):
    values, roles, step = simulate(300, 9), list(NAMES), 0.1
    if kind == "missing":
        keep = without("y1")
        values, roles = values[:, keep], [roles[i] for i in keep]
    if kind == "more":
        values, roles = np.hstack([values, values[:, :1]]), [*roles, ("y3", "output")]
    if kind == "role":
        roles[1] = ("u2", "ignore")
    if kind == "clock":
        step = 0.2
    record = record_of(values, "b.csv", roles, step)
    if kind == "unit":
        channels = tuple(replace(c, unit="mV") if c.name == "u1" else c for c in record.channels)
        record = replace(record, channels=channels)
    return record


RUN = {
    "varx": lambda r: identify_varx(r, past=PAST),
    "varmax": lambda r: identify_varmax(r, past=PAST),
    "fir": lambda r: identify_fir(r, past=PAST),
    "lpv": lambda r: identify_lpv(r, past=2, refined=False),
    "lpv-kernel": lambda r: identify_lpv(r, past=PAST, method="lpv-kernel", refined=False),
    "ort": lambda r: identify_ort(r, past=PAST, future=5),
}


TOLD = ("varx", "varmax", "fir", "lpv", "lpv-kernel")


@pytest.mark.parametrize("method", RUN)
@pytest.mark.parametrize(
    "kind, words",
    [
        ("missing", "channel 'y1' is missing"),
        ("more", "channel 'y3' is not in the other"),
        ("unit", "channel 'u1' has the unit 'mV', there 'V'"),
        ("role", "channel 'u2' has the role 'ignore', there 'input'"),
        ("clock", "sample time 0.2 s differs from 0.1 s"),
    ],
)
def test_recordings_that_do_not_belong_together_are_refused_by_channel(method, kind, words):
    with pytest.raises(DataError, match=words) as raised:
        RUN[method]([record_of(simulate(300, 1)), other_record(kind)])
    assert str(raised.value).startswith("b.csv: ") and "a.csv" in str(raised.value)


@pytest.mark.parametrize(
    "method, kind, words",
    [
        ("varx", "sine", r"input 'u1' is not persistently exciting: .* spans 2 of 6 directions, order \d+ needs"),
        ("varmax", "sine", r"input 'u1' is not persistently exciting: .* spans 2 of 6 directions, order \d+ needs"),
        ("lpv-kernel", "sine", "input 'u1' is not persistently exciting: .* spans 2 of 6 directions, half"),
        ("ort", "sine", r"u1, u2 must move by more than the disturbance"),
        *((m, kind, "input 'u[12]' is a fixed combination of u[12]") for m in TOLD for kind in ("collinear", "late")),
        ("ort", "collinear", "has rank 15 in a past window of 5 samples, 20 is needed"),
        ("lpv", "still", "scheduling channel 's' is constant at 7 V"),
        ("lpv-kernel", "still", "scheduling channel 's' is constant at 7 V"),
    ],
)  # fmt: skip
def test_inputs_that_tell_nothing_are_refused(method, kind, words):
    with pytest.raises(NotIdentifiable, match=words):
        RUN[method]([record_of(simulate(400, 1, kind))])


@pytest.mark.parametrize("method", ["varx", "varmax"])
def test_a_feedback_to_which_nothing_is_added_is_refused(method):
    """u1 = −0.3 y1 + 0.1 y2 in every sample; with the least dither the plant is found."""
    for dither in (0.0, 0.1):
        random = np.random.default_rng(3)
        A, B = np.array([[0.7, 0.5], [-0.4, 0.6]]), np.array([[1.0, 0.3], [-0.5, 0.8]])
        x, values = np.zeros(2), np.empty((4000, 4))
        for k in range(4000):
            y = x + 0.3 * random.standard_normal(2)
            u = [-0.3 * y[0] + 0.1 * y[1] + dither * random.standard_normal(), random.standard_normal()]
            values[k] = *u, *y
            x = A @ x + B @ u
        record = record_of(values, roles=[n for n in NAMES if n[1] in ("input", "output")])
        if dither:
            found = RUN[method]([record])
            assert np.sort_complex(found.eigenvalues) == pytest.approx(np.sort_complex(np.linalg.eigvals(A)), abs=0.05)
            continue
        for given in (record, replace(record, values=(values + 20).astype(np.float32).astype(float))):
            with pytest.raises(NotIdentifiable, match="'u1' is a fixed combination of outputs and other inputs of the"):
                RUN[method]([given])


def test_a_sine_serves_an_order_that_needs_no_more():
    record = record_of(simulate(400, 1, "sine"))
    assert identify_varx([record], past=PAST, order=2).order == 2
    with pytest.raises(NotIdentifiable, match="order 2 needs 3"):
        identify_varx([record], past=PAST, order=2, feedthrough=("u1",))
    with pytest.raises(NotIdentifiable, match="spans 2 of 6 directions, order 3 needs 3"):
        identify_fir([record], past=PAST, order=3)


def write_toml(path, method):
    """Give the disturbance and the scheduling their roles where the method takes them."""
    taken = {"r": "ort", "s": "lpv"}
    roles = [(n, role if n not in taken or method.startswith(taken[n]) else "ignore") for n, role in NAMES]
    text = "".join(f'[[channel]]\nname = "{n}"\nunit = "V"\nrole = "{role}"\n' for n, role in roles)
    path.write_text("[recording]\nsample_time_s = 0.1\n" + text)


def run_command(folder, method, values, *options):
    write_toml(folder / "roles.toml", method)
    np.savetxt(folder / "a.csv", values, delimiter=",", header=",".join(n for n, _ in NAMES), comments="", fmt="%.17g")
    past = "2" if method == "lpv" else str(PAST)
    return main(["identify", str(folder / "a.csv"), "--roles", str(folder / "roles.toml"), "--method", method, "--past",
                 past, "--out", str(folder / "m.json"), *options])  # fmt: skip


@pytest.mark.parametrize("method", RUN)
def test_the_command_refuses_in_one_sentence(method, tmp_path, capsys):
    """What carries no answer is code 4, an order beyond the window 2 or 4; an unstable plant gives no traceback."""
    for values, options, codes in (
        (simulate(300, 1, "collinear"), (), {4}),
        (simulate(12, 1), (), {4}),
        (simulate(300, 1), ("--order", "99"), {2, 4}),
        (simulate(300, 1, growth=1.04), (), {0, 4}),
        (1e6 + 0 * simulate(300, 1), (), {4}),
    ):
        assert run_command(tmp_path, method, values, *options) in codes
        said = capsys.readouterr().err
        assert "Traceback" not in said and said.count("aeolid: ") <= 1
        (tmp_path / "m.json").unlink(missing_ok=True)
