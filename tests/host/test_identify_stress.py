"""Hold the judge of the stress test against answers whose faults are known, and its bound against what fits achieve."""

import copy
import json

import numpy as np
import pytest
from study_modules import load_study

from aeolid.identify.frequency import transfer
from aeolid.identify.varx import identify_varx
from aeolid.models.modes import continuous_poles, frequency_and_damping
from aeolid.record import Channel, Record

stress = load_study("identify_stress")
from stress_judge import SHOWN, excited, judge, match, silent, worst  # noqa: E402  # the study names its folder
from stress_plants import Drawn, Plant, bounds, draw, one_of_pairs, simulate  # noqa: E402

SPREAD = 1e-3


def perfect(drawn):
    """Return the facts of an answer that is the truth, with deviations of a thousandth."""
    plant, h = drawn.plant, drawn.plant.sample_time_s
    modes = []
    for z, s in zip(drawn.poles, continuous_poles(drawn.poles, h), strict=True):
        hz, damping = frequency_and_damping(complex(s))
        modes.append({"frequency_hz": hz, "damping": damping, "eigenvalue": [z.real, z.imag],
                      "frequency_std_hz": SPREAD * hz, "damping_std": SPREAD})  # fmt: skip
    hz = np.sort(np.angle(drawn.poles[drawn.poles.imag > 0])) / (2 * np.pi * h)
    response = abs(transfer(plant.A, plant.B, plant.C, plant.D, np.exp(2j * np.pi * hz * h)))
    pairs = [
        {"output": f"y{i + 1}", "input": f"u{j + 1}", "gain": response[:, i, j].tolist(),
         "gain_std": (SPREAD * response[:, i, j]).tolist()}
        for i, j in np.ndindex(*response.shape[1:])
    ]  # fmt: skip
    return {"modes": modes, "order": len(plant.A), "settings": {"past": 20}, "notes": [],
            "frequency_response": {"frequency_hz": hz.tolist(), "pairs": pairs}}  # fmt: skip


@pytest.fixture(scope="module", params=[0, 2, 5])
def drawn(request):
    """Return a drawn plant with excited modes."""
    return draw(5, request.param, 3000)


def first_excited(drawn):
    """Return the number of an excited mode that swings."""
    return int(np.flatnonzero(excited(drawn) & (drawn.poles.imag > 0))[0])


def test_the_truth_is_held(drawn):
    row = judge(drawn, 0, perfect(drawn))
    assert row["excited"] == len(row["modes"]) > 0 and not row["marked"]
    assert worst(row) < 1e-6 and not silent(row)


@pytest.mark.parametrize("fault", ["frequency_hz", "damping", "peak", "pole gone"])
def test_a_planted_fault_is_found_and_a_word_ends_the_silence(drawn, fault):
    facts, i = perfect(drawn), first_excited(drawn)
    if fault == "pole gone":
        del facts["modes"][i]
    elif fault == "peak":
        for pair in facts["frequency_response"]["pairs"]:
            pair["gain"] = [1.006 * g for g in pair["gain"]]
    else:
        facts["modes"][i][fault] += 6 * facts["modes"][i][{"damping": "damping_std"}.get(fault, "frequency_std_hz")]
    row = judge(drawn, 0, facts)
    assert silent(row)
    assert (worst(row) == np.inf) == (fault == "pole gone")
    for word in ({"bands_hold": False}, {"notes": ["WARNING: past window 20 is too short"]}):
        assert not silent(judge(drawn, 0, facts | word))
    assert silent(judge(drawn, 0, facts | {"bands_hold": True, "notes": ["12 windows were left out"]}))
    assert not silent(judge(drawn, 4, facts)) and judge(drawn, 4, None)["outcome"] == "refused"
    assert judge(drawn, 70, None)["outcome"] == "failed"


def test_the_table_counts_what_the_judge_found(drawn):
    good, facts = judge(drawn, 0, perfect(drawn)), perfect(drawn)
    del facts["modes"][first_excited(drawn)]
    rows = [r | {"seed": 5, "number": n} for n, r in enumerate([good, judge(drawn, 0, facts), judge(drawn, 4, None)])]
    line = stress.table(rows).splitlines()[2]
    assert line.startswith("| all | 3 | 1/3 33.3 % | 0/3") and line.endswith("| 1/3 33.3 % |")
    assert "5/1 " in stress.table(rows) and "missed" in stress.table(rows)


def test_neighbours_are_matched_by_assignment_and_only_nearby():
    true = np.array([1j, 1.1j, -0.5])
    assert match(true, np.array([1.08j, 0.97j, -0.6])) == [1, 0, 2]
    assert match(true, np.array([1.3j, 0.97j, -1.1])) == [1, 0, None]
    assert match(true, np.array([0.97j])) == [0, None, None]


def test_a_found_pole_that_belongs_to_none_does_not_push_the_others_on():
    """The sum of distances is less where each takes its neighbour's: 1 + 1/2 + 2 for 8."""
    assert match(np.array([1j, 2j, 3j]), np.array([2j, 3j, 9j])) == [None, 0, 1]


def record_of(values):
    """Return a recording of one input and one output."""
    channels = (Channel("u1", "", "input"), Channel("y1", "", "output"))
    return Record(np.arange(len(values)) * 1.0, values, channels, 1.0, "one mode", "0")


def oscillator(gain=1.0):
    """Return one mode in open loop whose output is `gain` of it beside noise of unit size."""
    z = 0.97 * np.exp(0.6j)
    A = np.array([[z.real, z.imag], [-z.imag, z.real]])
    B, C, G, none = (
        np.array([[1.0], [0.5]]),
        gain * np.array([[0.3, 0.1]]),
        np.array([[0.05], [0.02]]),
        np.zeros((1, 1)),
    )
    return Plant(A, B, C, none, G, np.array([0.3]), none, 0.0, np.zeros(1), 1.0)


def test_the_bound_is_what_an_efficient_fit_reaches():
    """Errors of prediction-error fits over 24 recordings have the bound's size: χ² of 48 degrees, 0.1 %."""
    plant, errors = oscillator(), []
    for seed in range(24):
        values, _ = simulate(plant, 2000, np.random.default_rng(seed))
        model = identify_varx([record_of(values)], past=15, order=2, refined=True).model
        errors.append(one_of_pairs(np.linalg.eigvals(model.A))[0] - one_of_pairs(np.linalg.eigvals(plant.A))[0])
    size = np.sqrt(np.mean(np.abs(errors) ** 2)) / bounds(plant, 2000)[0]
    assert 0.68 < size < 1.35
    assert bounds(plant, 8000)[0] == pytest.approx(bounds(plant, 2000)[0] / 2)


def test_what_does_not_show_or_is_not_told_is_not_excited():
    """A mode that fills its output is, one of a twentieth its size is not; nor are 60 samples, 1.8 time constants."""

    def told(gain, samples):
        plant = oscillator(gain)
        values, share = simulate(plant, samples, np.random.default_rng(1))
        drawn = Drawn(plant, [values], one_of_pairs(np.linalg.eigvals(plant.A)), share, (), samples)
        return bool(excited(drawn)[0]), share[0]

    assert told(1.0, 4000)[0] and told(1.0, 4000)[1] > 0.5
    assert not told(0.05, 4000)[0] and told(0.05, 4000)[1] < SHOWN
    assert not told(1.0, 60)[0] and told(1.0, 60)[1] > SHOWN


def test_the_command_answers_and_a_run_goes_on_where_it_stopped(tmp_path, capsys):
    short = ["--seed", "9", "--jobs", "1", "--longest", "400", "--out", str(tmp_path)]
    assert stress.main([*short, "--plants", "2"]) == 0
    before = (tmp_path / "stress.jsonl").read_text()
    assert stress.main([*short, "--plants", "3"]) == 0
    after = (tmp_path / "stress.jsonl").read_text()
    assert after.startswith(before) and len(after.splitlines()) == 3
    rows = [json.loads(line) for line in after.splitlines()]
    assert {r["outcome"] for r in rows} <= {"answered", "refused"} and "| all | 3 |" in capsys.readouterr().out
    again = stress.one(9, 2, 400)
    assert {**again, "seconds": 0} == {**copy.deepcopy(rows[2]), "seconds": 0}
