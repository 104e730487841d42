"""Check loops that show no plant, refinements that make a model worse, and where varx does the work of ort."""

import numpy as np
import pytest
from random_plants import draw_plant, recorded, regulator, run_plant

from aeolid.errors import NotIdentifiable
from aeolid.identify import keep_better as keeping
from aeolid.identify.fit import measure_fit
from aeolid.identify.ort import identify_ort
from aeolid.identify.ort.compare import compare_with_varx
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx
from aeolid.record import Channel, Record


def loop(seed, inputs, outputs, added, samples=2000):
    """Return the recording of a drawn plant of order 3 under a controller of order 3."""
    rng = np.random.default_rng(seed)
    plant = draw_plant(rng, 3, inputs, outputs)
    return recorded(*run_plant(rng, plant, added(rng, samples, inputs), 1.0, regulator(plant)))


@pytest.mark.parametrize("sizes", [(1, 1), (1, 2), (2, 2)])
@pytest.mark.parametrize("digits", [None, 6])
def test_a_controller_of_third_order_to_which_nothing_is_added_shows_no_plant(sizes, digits):
    """Also where the samples were written with six digits, which no rank in double precision tells."""
    for seed in range(3):
        record = loop(seed, *sizes, lambda rng, n, r: np.zeros((n, r)))
        if digits:
            rounded = np.array([float(f"{v:.{digits}g}") for v in record.values.ravel()]).reshape(record.values.shape)
            record = Record(
                record.time_s,
                rounded,
                record.channels,
                record.sample_time_s,
                "loop.csv",
                "0" * 64,
            )
        with pytest.raises(
            NotIdentifiable,
            match=r"csv: .*(too little is added|directions|fixed combination)",
        ):
            identify_varx([record], past=15, order=3)
    with pytest.raises(NotIdentifiable, match="csv"):
        identify_varmax([record], past=10, order=3)


@pytest.mark.parametrize("sizes", [(1, 1), (2, 2)])
def test_a_dither_of_the_size_of_the_noise_or_a_sum_of_sines_is_enough(sizes):
    for seed in range(3):
        identify_varx(
            [loop(seed, *sizes, lambda rng, n, r: 2.0 * rng.standard_normal((n, r)))],
            past=15,
            order=3,
        )

    def sines(rng, n, r):
        k, rates = np.arange(n)[:, None, None], np.linspace(0.07, 2.5, 12)
        return 3.0 * np.sin(k * rates + rng.uniform(0, 6, (1, r, 12))).sum(axis=2)

    identify_varx([loop(5, *sizes, sines)], past=15, order=3)


def test_refinement_keeps_no_predictor_that_remembers_longer_than_the_recording():
    """Drawn plants with an almost integrating pole and few samples: own and fresh errors never multiply."""
    worst = 1.0
    for seed in range(8):
        rng = np.random.default_rng(300 + seed)
        plant = draw_plant(rng, 4, 1, 2)
        slow = type(plant)(
            plant.A * 0.998 / abs(np.linalg.eigvals(plant.A)).max(),
            plant.B,
            plant.C,
            plant.K,
        )
        u, y = run_plant(rng, slow, rng.standard_normal((600, 1)), 2.0)
        record, fresh = recorded(u[:300], y[:300]), recorded(u[300:], y[300:])
        for past in (12, 20):
            plain = identify_varx([record], past=past, order=6)
            done = identify_varx([record], past=past, order=6, refined=True)
            facts = done.to_json()["refinement"]
            if facts["steps"]:
                before = identify_spectral(plain.model)
                assert identify_spectral(done.model) <= max(np.exp(-3 / 300), before) + 1e-9
                assert facts["held_out_error_after"] < facts["held_out_error_before"]
                assert "before" in done.summary() and "after" in done.summary()
            ratio = [measure_fit(r.model, [fresh]).one_step.nrmse["y0"] for r in (done, plain)]
            worst = max(worst, ratio[0] / ratio[1])
    assert worst < 1.5, worst


def identify_spectral(model):
    """Return the largest magnitude of a pole of the predictor."""
    return abs(np.linalg.eigvals(model.A - model.K @ model.C)).max()


def test_the_model_before_the_steps_is_kept_where_they_fit_the_recordings_worse(
    monkeypatch,
):
    rng = np.random.default_rng(3)
    plant = draw_plant(rng, 3, 1, 1)
    record = recorded(*run_plant(rng, plant, rng.standard_normal((800, 1)), 0.5))
    plain = identify_varx([record], past=10, order=3)
    assert identify_varx([record], past=10, order=3, refined=True).to_json()["refinement"]["steps"] > 0
    monkeypatch.setattr(keeping, "WORSE_ONE_STEP", 0.5)  # what the steps cannot reach
    kept = identify_varx([record], past=10, order=3, refined=True)
    assert kept.to_json()["refinement"]["steps"] == 0 and "the model before them is kept" in kept.summary()
    assert np.array_equal(kept.model.A, plain.model.A) and np.array_equal(kept.model.K, plain.model.K)


def test_ort_says_where_varx_with_the_disturbance_as_an_input_does_better():
    """Two inputs and outputs, a dither on each input: VARX has the smaller error on held-out samples in most loops."""
    named = 0
    for seed in range(3):
        rng = np.random.default_rng(40 + seed)
        plant = draw_plant(rng, 3, 3, 2)  # the third input is the disturbance
        Ac, Bc, Cc = regulator(plant)
        Cc = np.vstack([Cc[:2], np.zeros((1, len(Ac)))])
        while abs(np.linalg.eigvals(np.block([[plant.A, plant.B @ Cc], [Bc @ plant.C, Ac]]))).max() > 0.98:
            Cc = Cc / 2
        added = np.hstack([0.3 * rng.standard_normal((1200, 2)), rng.standard_normal((1200, 1))])
        record = recorded(*run_plant(rng, plant, added, 1.0, (Ac, Bc, Cc)))
        roles = ("input", "input", "disturbance", "output", "output")
        channels = tuple(Channel(c.name, "", r) for c, r in zip(record.channels, roles, strict=True))
        record = Record(
            record.time_s,
            record.values,
            channels,
            record.sample_time_s,
            "loop.csv",
            "0" * 64,
        )
        said = compare_with_varx([record], identify_ort([record], past=10, order=3))
        assert "free-run error of ort" in said, said
        named += "use --method varx" in said
    assert named >= 1
