"""Hold the Markov parameters of singular data: smallest and pivoted ones predict alike, held-out error chooses."""

import numpy as np
import pytest

from aeolid.errors import UsageError
from aeolid.identify.assemble import LARGEST_AUTO_ORDER
from aeolid.identify.compressed import compress
from aeolid.identify.frequency import frequency_response
from aeolid.identify.markov import estimate_markov
from aeolid.identify.settings import make_settings
from aeolid.identify.solution import better, choose_solution, with_solution
from aeolid.identify.varx import identify_varx
from aeolid.identify.windows import find_scaling
from aeolid.plants.hawt import Excitation, build_turbine, simulate_closed_loop

BOTH = ("pitch", "generator_torque")
HZ = np.geomspace(0.01, 4.9, 120)


def turbine(seed, noise=0.0, samples=10_000):
    """Return a recording whose outputs are driven by two winds only, unless there is noise."""
    return simulate_closed_loop(samples, seed, excitation=Excitation(noise=noise))


def windows_of(record, past):
    """Return windows and settings of a recording."""
    settings = make_settings("varx", [record], past, None, 7, BOTH, "none", None, 1, False)
    return compress([record], find_scaling([record]), past), with_solution(settings, "auto")


def speed_gain_error(model):
    """Return the rms error in dB of the gain from pitch to rotor speed."""
    own, true = (frequency_response(m, HZ).magnitude_db[:, 0, 0] for m in (model, build_turbine().model()))
    return float(np.sqrt(np.mean((own - true) ** 2)))


def test_both_predict_alike_and_the_pivoted_ones_lean_on_as_many_columns_as_there_are_ranks():
    windows, _ = windows_of(turbine(31, samples=2000), 20)
    small, pivoted = (estimate_markov(windows.whole, (True, True), "none", s) for s in ("smallest", "pivoted"))
    rows = windows.whole.R[:, : small.theta.shape[1]]
    apart = np.linalg.norm(rows @ (small.theta - pivoted.theta).T) / np.linalg.norm(windows.whole.y_now)
    assert apart < 1e-6 and np.linalg.norm(pivoted.theta) > np.linalg.norm(small.theta)
    assert small.rank < small.regressors == pivoted.regressors and small.columns is None
    assert np.count_nonzero(pivoted.theta.any(axis=0)) == len(pivoted.columns) < small.regressors
    unused = np.setdiff1d(np.arange(pivoted.theta.shape[1]), pivoted.columns)
    assert not pivoted.spread[unused].any() and not pivoted.theta[:, unused].any()


def test_pivoted_ones_are_nearer_in_the_gain_of_the_rotor_speed():
    """Eight recordings of 10,000, p = 50: log ratio of the errors, t below −2.36 (5 %, 7 degrees)."""
    ratios = []
    for seed in range(3101, 3109):
        record = turbine(seed)
        small, pivoted = (
            identify_varx([record], past=50, order=7, feedthrough=BOTH, solution=s, uncertainty="none").model
            for s in ("smallest", "pivoted")
        )
        ratios.append(np.log(speed_gain_error(pivoted) / speed_gain_error(small)))
    assert np.mean(ratios) / (np.std(ratios, ddof=1) / np.sqrt(len(ratios))) < -2.36


def test_pivoted_ones_are_taken_where_no_held_out_error_is_larger():
    small = np.zeros((2, 3))
    assert better(small, small - 0.01) == "pivoted"
    for place in np.ndindex(2, 3):
        other = small - 0.01
        other[place] = 0.001
        assert better(small, other) == "smallest"
    assert better(small, np.full((2, 3), np.inf)) == better(np.full((2, 3), np.inf), small) == "smallest"


def test_held_out_error_keeps_the_smallest_ones_where_pivoted_are_worse():
    """Without the torque's feedthrough a pivoted Ξ predicts a tenth to a third worse, one step ahead."""
    for seed in (3011, 3012, 3013):
        result = identify_varx([turbine(seed)], past=20, order=7, feedthrough=("pitch",), uncertainty="none")
        facts = result.extra["solution"]
        assert facts["value"] == "smallest" and facts["losses"]["smallest"] < facts["losses"]["pivoted"]


def test_data_that_tell_all_regressors_apart_have_one_solution():
    windows, settings = windows_of(turbine(32, 0.01, 2000), 10)
    same, notes, facts = choose_solution(windows, (True, True), settings, LARGEST_AUTO_ORDER)
    assert same is windows and notes == () and facts == {"solution": {"value": "smallest"}}


def test_a_bootstrap_draws_along_the_columns_that_are_used():
    record = turbine(33, samples=2000)
    options = {"past": 12, "order": 7, "feedthrough": BOTH, "solution": "pivoted"}
    plain = identify_varx([record], **options)
    drawn = identify_varx([record], uncertainty="bootstrap", bootstrap_runs=60, **options)
    assert drawn.markov.columns == plain.markov.columns
    tower = [next(m for m in r.modes if 0.4 < m.frequency_hz < 0.5) for r in (plain, drawn)]
    assert 0.3 < tower[1].frequency_std_hz / tower[0].frequency_std_hz < 3


def test_what_does_not_exist_is_refused():
    with pytest.raises(UsageError, match="'sparse' is none of auto, smallest, pivoted"):
        identify_varx([turbine(34, samples=500)], past=5, solution="sparse")
