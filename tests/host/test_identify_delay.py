"""Check delays of inputs: found on plants that nobody chose, none where there is none, carried by the model."""

import json

import numpy as np
import pytest
from random_plants import STEP, draw_plant, recorded, respond, response_error, run_plant
from scipy.signal import lfilter
from small_cases import write_case

from aeolid.cli.main import main
from aeolid.errors import UsageError
from aeolid.identify.delay import _delay_of, estimate_delays, find_delays, read_delays
from aeolid.identify.delay_states import delayed, without_delays
from aeolid.identify.fir import identify_fir
from aeolid.identify.fit import measure_fit
from aeolid.identify.varmax import identify_varmax
from aeolid.identify.varx import identify_varx


def late_recording(seed, samples, delays, noise=0.3, smooth=0.5, gain=0.0):
    """Return a drawn plant of as many inputs as delays, and its recording; gain: of a proportional feedback."""
    rng = np.random.default_rng(seed)
    plant = draw_plant(rng, int(rng.integers(2, 5)), len(delays), int(rng.integers(1, 3)))
    added = lfilter([1 - smooth], [1, -smooth], rng.standard_normal((samples, len(delays))), axis=0)
    controller = (
        np.zeros((len(plant.C), len(plant.C))), np.eye(len(plant.C)), gain * np.ones((len(delays), len(plant.C)))
    )  # fmt: skip
    return plant, recorded(*run_plant(rng, plant, added, noise, controller, tuple(delays)))


@pytest.mark.parametrize("gain", [0.0, 0.03])
def test_delays_are_found_in_open_and_closed_loop_never_where_there_are_none(gain):
    """A delay may come out shorter by chance; it is never a quarter longer."""
    rng = np.random.default_rng(17)
    exact = 0
    for seed in range(6):
        true = tuple(int(d) for d in rng.choice([0, 6, 15, 25], 2))
        _, record = late_recording(seed, 2000, true, gain=gain)
        found = estimate_delays([record], 20, (False, False))
        told = tuple(found.get(f"u{i}", 0) for i in range(2))
        assert all(t == 0 if d == 0 else t <= 1.25 * d for d, t in zip(true, told, strict=True)), (seed, true, told)
        exact += told == true
        _, record = late_recording(100 + seed, 2000, (0, 0), gain=gain)
        assert estimate_delays([record], 20, (False, False)) == {}, seed
    assert exact >= 3


def test_a_delay_is_found_whatever_chance_adds_to_its_lags_and_none_in_a_gentle_start():
    """Wald's statistics as they are drawn: 40 zero lags of one output, then a response; and responses like t, t² or t³.

    A single prefix tested at 5 % misses one delay in twenty, since chance makes it end early.
    """
    random, found, none = np.random.default_rng(0), [], []
    for _ in range(300):
        added = random.standard_normal(70)
        added[40:] += 20.0 * 0.9 ** np.arange(30)
        found.append(_delay_of(np.cumsum(added**2), 1))
        for power in (0, 1, 2, 3):
            rise = random.uniform(0.01, 10) * np.arange(1, 71) ** power
            none.append(_delay_of(np.cumsum((rise + random.standard_normal(70)) ** 2), 1))
    assert np.mean(np.array(found) == 40) > 0.97 and min(found) > 30 and max(found) == 40
    assert np.count_nonzero(none) <= 0.01 * len(none)


@pytest.mark.parametrize("identify", [identify_varx, identify_varmax, identify_fir])
def test_a_delay_beyond_the_window_no_longer_spoils_the_model(identify):
    """15 samples late, past window 12: without a delay nothing of the response is in the window."""
    for seed in (3, 8):
        plant, record = late_recording(seed, 1500, (15,), noise=0.1)
        true = plant.response((15,))
        bare = identify([record], past=12, order=len(plant.A))
        result = identify([record], past=12, order=len(plant.A), delays="auto")
        assert dict(result.settings.delays) == {"u0": 15}
        assert response_error(true, result.model) < 0.5 * response_error(true, bare.model)
        assert any("'u0' acts 15 samples (1.5 s) late" in note for note in result.notes)
        assert result.to_json()["settings"]["delays"] == {"u0": 15}
        assert len(result.modes) <= len(plant.A)  # the chain has no modes


def test_a_chain_of_states_is_the_delay_and_the_band_turns_with_it():
    plant, record = late_recording(5, 1500, (9, 4))
    result = identify_varx([record], past=15, order=len(plant.A), delays={"u0": 9, "u1": 4})
    core = identify_varx(without_delays([record], {"u0": 9, "u1": 4}), past=15, order=len(plant.A))
    late = respond(core.model.A, core.model.B, core.model.C, core.model.D, (9, 4))
    whole = respond(result.model.A, result.model.B, result.model.C, result.model.D)
    assert np.allclose(late, whole, atol=1e-9 * abs(late).max())
    z = np.exp(2j * np.pi * result.band.frequency_hz * STEP)[:, None, None]
    M = result.model
    at = M.C @ np.linalg.solve(z * np.eye(M.order) - M.A, M.B.astype(complex)) + M.D
    assert np.allclose(result.band.response, at, atol=1e-8 * abs(at).max())
    turned, plain = (np.trace(one.band.covariance, axis1=-2, axis2=-1) for one in (result, core))
    assert np.allclose(turned, plain)
    fit = measure_fit(result.model, [record])
    assert fit.one_step.vaf["y0"] == pytest.approx(core.fit.one_step.vaf["y0"], abs=0.5)
    assert np.array_equal(delayed(core.model, {}).A, core.model.A)


def test_inputs_moved_later_hold_no_future_and_short_recordings_end_in_a_sentence():
    _, record = late_recording(1, 50, (0, 0))
    (moved,) = without_delays([record], {"u1": 7})
    assert len(moved) == 43 and np.array_equal(moved.column("u1"), record.column("u1")[:43])
    assert np.array_equal(moved.column("u0"), record.column("u0")[7:])
    (nothing,) = without_delays([record], {"u1": 70})
    assert len(nothing) == 0
    assert estimate_delays([record], 20, (False, False)) == {}


def test_what_cannot_be_a_delay_is_refused():
    _, record = late_recording(1, 100, (0,))
    assert read_delays(None) is None and read_delays(["none"]) is None and read_delays(["auto"]) == "auto"
    assert read_delays(["a=b=3", "u0=0"]) == {"a=b": 3, "u0": 0}
    for texts in (
        ["u0"],
        ["u0=-1"],
        ["=3"],
        ["u0=1.5"],
        ["u0=1", "u0=2"],
        ["auto", "u0=1"],
    ):
        with pytest.raises(UsageError, match="--delay"):
            read_delays(texts)
    for asked, word in (
        ({"y0": 3}, "no such input"),
        ({"u0": 10_001}, "not within"),
        ("often", "neither"),
    ):
        with pytest.raises(UsageError, match=word):
            find_delays([record], 10, (), asked)


def test_command_finds_the_delay_and_simulates_with_it(tmp_path, capsys):
    _, record = late_recording(3, 1500, (15,), noise=0.1)
    channels = tuple((c.name, "", c.role) for c in record.channels)
    write_case(tmp_path, "", STEP, channels, record.values)
    base = [str(tmp_path / "recording.csv"), "--roles", str(tmp_path / "roles.toml")]
    model = str(tmp_path / "m.json")
    assert main(["identify", *base, "--past", "12", "--order", "3", "--out", model]) == 0
    assert "acts 15 samples" in " ".join(capsys.readouterr().out.split())
    assert main(["validate", model, *base, "--json", str(tmp_path / "v.json")]) == 0
    told = json.loads((tmp_path / "v.json").read_text())
    assert min(told["free_run"]["vaf"].values()) > 80
    assert main(["identify", *base, "--past", "12", "--out", model, "--delay", "u9=3"]) == 2
    assert (
        main(
            [
                "identify",
                *base,
                "--past",
                "12",
                "--method",
                "lpv",
                "--out",
                model,
                "--delay",
                "auto",
            ]
        )
        == 2
    )
