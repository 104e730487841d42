"""Who is not told apart from the winner, and who outdoes it though it may not have the name."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aeolid.diagnose import pipeline
from aeolid.diagnose.candidates.moved import Moved
from aeolid.diagnose.selection.rivals import (
    are_kin,
    late_ahead,
    leading,
    leads,
    leaves_open,
    left_wrong,
    one_of_each,
    outdone_by,
    rivals_of,
    stands_for,
    tells_apart,
    weights_of,
)
from aeolid.models.equations import Parameter

NOISE = np.random.default_rng(4).standard_normal((2, 400))


def candidate(
    fit_gain: float, select_gain: float, *, at_end: bool = False, name: str = "sensor_lag", **more: Any
) -> Any:
    """A candidate whose gains come evenly from its samples, up to noise that all share."""
    parts = {"fit": NOISE[0] + fit_gain / 400, "select": select_gain / 400 + np.zeros(400)}
    usual = {
        "plausible": not at_end,
        "complete": True,
        "unlisted": name == "unlisted",
        "handicap": 0.0,
        "parameters": 1,
        "moved": (),
        "low_ends": [],
        "undriven": False,
    }
    return SimpleNamespace(
        fit_density=parts["fit"], select_difference=parts["select"], fit_gain=fit_gain,
        attachments=(SimpleNamespace(entry=name),), select_gain=select_gain, score=fit_gain + select_gain - 1,
        at_end=at_end, **(usual | more),
    )  # fmt: skip


WINNER = candidate(60.0, 20.0, name="structural_mode")


@pytest.mark.parametrize(
    ("other", "outdoes"),
    [
        (candidate(137.0, 45.0, at_end=True), True),
        (candidate(137.0, 45.0, at_end=True, complete=False), False),
        (candidate(137.0, 15.0, at_end=True), False),
        (candidate(64.0, 22.0, at_end=True), False),
        (candidate(137.0, 45.0, plausible=False), False),
        (candidate(137.0, 45.0, at_end=True, name="blade_flap"), False),
        (candidate(137.0, 45.0, name="unlisted"), True),
        (candidate(137.0, 45.0, name="unlisted", plausible=False), False),
        (candidate(64.0, 22.0, name="unlisted"), False),
        (candidate(137.0, 45.0, name="sensor_lag"), False),
    ],
    ids=[
        "far ahead, at its range's end",
        "left behind",
        "not on selection data",
        "hardly ahead",
        "refused otherwise",
        "of the same family",
        "a form outside the catalogue",
        "such a form, refused",
        "such a form, hardly ahead",
        "one that may be named itself",
    ],
)
def test_a_refused_explanation_far_ahead_takes_the_name(other: Any, outdoes: bool) -> None:
    """A sensor 4 ms late, refused as shorter than half a sample, gained twice what a mode gained that got its name."""
    assert (outdone_by([WINNER, other], WINNER) is other) is outdoes


@pytest.mark.parametrize(
    ("entry", "label", "outdoes"),
    [("play_hysteresis", "half_width", False), ("bouc_wen_hysteresis", "yield_length", False),
     ("play_hysteresis", "stiffness", True), ("sensor_lag", "tau_s", True)],
)  # fmt: skip
def test_what_ends_as_the_effect_named_does_not_outdo_it(entry: str, label: str, outdoes: bool) -> None:
    """A slider whose spring yields at once is dry friction: 57 nats ahead, at its range's end, it took the name."""
    friction = candidate(60.0, 20.0, name="coulomb_friction")
    other = candidate(137.0, 45.0, at_end=True, name=entry)
    other.low_ends = [(other.attachments[0], label)]
    assert (outdone_by([friction, other], friction) is other) is outdoes


@pytest.mark.parametrize(
    ("tau_s", "select_gain", "plausible", "takes"),
    [(0.02, 45.0, False, True), (0.07, 45.0, False, False), (0.02, 15.0, False, False), (0.02, 45.0, True, False)],
    ids=["a fifth of a row", "more than a habit", "not on selection data", "one that may be named itself"],
)
def test_a_channel_late_by_part_of_a_row_is_no_mode(
    tau_s: float, select_gain: float, plausible: bool, takes: bool
) -> None:
    """A filtered speed beside a position: the filter gained 334 nats, refused as a logger's habit, a mode 210."""
    other = candidate(137.0, select_gain, plausible=plausible)
    other.attachments[0].key, other.values = "lag", {"lag": {"tau_s": (tau_s, 0.001)}}
    assert (late_ahead([WINNER, other], WINNER, 0.1) is other) is takes


def test_where_the_lead_is_scattered_nobody_is_outdone() -> None:
    """Ahead by 60 nats in sum, but by turns: two models that the data do not tell apart."""
    other = candidate(100.0, 40.0, at_end=True)
    other.fit_density = other.fit_density + 3 * np.repeat(NOISE[1, :20], 20)
    assert outdone_by([WINNER, other], WINNER) is None


def test_rivals_are_those_that_samples_do_not_tell_apart() -> None:
    equal, behind, refused = candidate(60.2, 20.1), candidate(20.0, 5.0), candidate(60.1, 20.0, at_end=True)
    assert rivals_of([WINNER, equal, behind, refused], WINNER) == [equal]


def test_one_that_is_ahead_is_a_rival_though_the_selection_data_do_not_speak_for_it() -> None:
    """A gain that grows with the wind, beside one that jumps and that alone was allowed a name."""
    jumps, grows, weaker = candidate(35.0, 0.4), scattered(15.0), candidate(34.9, 0.2)
    for other, select in ((grows, -2.0), (weaker, -0.1)):
        other.select_gain, other.select_difference = select, select / 400 + np.zeros(400)
        other.score = other.fit_gain + select - 1
    assert rivals_of([jumps, grows, weaker], jumps) == [grows]


def test_what_gains_nothing_is_no_rival() -> None:
    """Where a few samples bring all of a gain Vuong's z stays small: a rival must have odds of 20 to 1 over nothing."""
    burst = np.zeros(400)
    burst[:2] = 17.0
    switch = candidate(34.0, 9.0, name="operating_region_switch")
    switch.fit_density = NOISE[0] + burst
    idle, little = candidate(0.5, 0.03, name="sensor_rectified"), candidate(4.0, 1.0, name="sensor_scale")
    assert not tells_apart(switch, idle)
    assert rivals_of([switch, idle, little], switch) == [little]


def scattered(gain: float, **more: Any) -> Any:
    """A candidate ahead by turns: by `gain` nats in sum, with a deviation of 8."""
    other = candidate(60.0 + gain, 20.0, **more)
    turns = np.repeat(NOISE[1, :20] - NOISE[1, :20].mean(), 20)
    other.fit_density = other.fit_density + 8 * turns / np.sqrt(np.sum(np.add.reduceat(turns, range(0, 400, 20)) ** 2))
    return other


def test_more_parameters_must_gain_what_they_cost() -> None:
    """A mode of six values stood beside one wrong declared value, 5 nats behind it with five values more."""
    behind = scattered(-5.0)
    assert not tells_apart(WINNER, behind)
    behind.handicap = 20.0
    assert tells_apart(WINNER, behind)
    costly = candidate(60.0, 20.0, handicap=20.0)
    assert not tells_apart(costly, scattered(-5.0))  # nor does one that costs more lose its simpler rival


def test_equal_models_are_not_told_apart_whatever_they_cost() -> None:
    """A lag, and a second-order filter of which the data leave the damping open."""
    assert not tells_apart(WINNER, candidate(60.3, 20.0, handicap=4.0))
    assert tells_apart(WINNER, candidate(57.0, 20.0, handicap=4.0))


def test_odds_of_20_to_1_tell_apart_however_evenly_they_come() -> None:
    """Near-equal models differ by little everywhere, so that the deviation of their difference says nothing."""
    assert not tells_apart(WINNER, candidate(60.0 - 2.9, 20.0)) and tells_apart(WINNER, candidate(60.0 - 3.1, 20.0))


@pytest.mark.parametrize(("damping", "output", "first"), [(0.28, "moment", "blade_flap"), (0.7, "moment", "sensor"),
                                                          (0.28, "speed", "sensor")])  # fmt: skip
def test_a_filter_that_rings_where_a_blade_bends_is_the_blade(damping: float, output: str, first: str) -> None:
    """One model by two names; filters are damped by half and more."""
    values = {"own": {"omega_rad_s": (4.1, 0.04), "damping": (damping, 0.01)}}
    sensor = candidate(60.4, 20.0, name="sensor_second_order", values=values)
    bending = candidate(60.0, 20.0, name="blade_flap", parameters=2)  # one more, so that only the odds speak for it
    for c, where in ((sensor, output), (bending, "moment")):
        c.attachments[0].key, c.attachments[0].location = "own", {"outputs": [where]}
    assert leading([sensor, bending]).attachments[0].entry.startswith(first)


@pytest.mark.parametrize(
    ("damping", "ahead", "first"),
    [
        ((0.97, 0.27), 1.5, "actuator_lag"),  # it may be damped critically, and three nats are no odds of 20 to 1
        ((0.6, 0.1), 1.5, "actuator_second_order"),  # it rings
        ((0.97, 0.27), 30.0, "actuator_second_order"),  # two lags in a row, which one does not do
    ],
)  # fmt: skip
def test_a_drive_that_shows_no_more_than_a_lag_is_one(damping: Any, ahead: float, first: str) -> None:
    def drive(entry: str, gain: float, **more: Any) -> Any:
        own = SimpleNamespace(entry=entry, key=entry, location={"entry": "input:u", "outputs": ()})
        facts = {"attachments": (own,), "values": {entry: {"damping": damping}}}
        return SimpleNamespace(**vars(candidate(gain, 10.0)) | facts | more)

    lag = drive("actuator_lag", 60.0)
    drives = [drive("actuator_second_order", 60.0 + ahead, parameters=2), lag]
    assert leading(drives).attachments[0].entry == first


def test_the_colour_of_noise_outdoes_nobody() -> None:
    """A mode that no input drives, broad to the end of its range, stood 74 nats ahead of a drive train's loss."""
    broad = candidate(140.0, 45.0, at_end=True)
    assert outdone_by([broad], WINNER) is broad
    broad.undriven = True
    assert outdone_by([broad], WINNER) is None


def test_leading_takes_ten_nats_and_some_on_the_selection_data() -> None:
    assert leads(candidate(80.0, 25.0), WINNER) and not leads(candidate(66.0, 21.0), WINNER)
    assert not leads(candidate(90.0, 15.0), WINNER)


def test_kin_share_family_and_place() -> None:
    def at(name: str, place: str, *outputs: str) -> Any:
        return SimpleNamespace(entry=name, location={"entry": place, "outputs": list(outputs)})

    lag = at("sensor_lag", "output:speed", "speed")
    assert are_kin(lag, at("sensor_second_order", "output:speed", "speed"))
    assert are_kin(at("mass_imbalance", "rotor", "x", "y"), at("aero_imbalance", "output:y", "y"))
    assert not are_kin(lag, at("sensor_lag", "output:level", "level"))
    assert not are_kin(lag, at("sensor_scale", "output:speed", "speed"))


def test_weights_are_odds() -> None:
    weights = weights_of([candidate(60.0, 20.0), candidate(60.0 - np.log(3), 20.0)])
    assert weights == pytest.approx([0.75, 0.25])


def test_a_constant_is_more_often_wrong_than_a_calibrated_sensor() -> None:
    """A mass and the factor of the accelerometer that alone shows it are one model; ten to one for the mass."""
    mass, factor = candidate(60.0, 20.0, name="parameter_error"), candidate(60.0, 20.0, name="sensor_scale")
    other = candidate(60.0, 20.0, name="backlash")
    assert weights_of([factor, mass]) == pytest.approx([1 / 11, 10 / 11])
    assert weights_of([factor, other]) == pytest.approx([0.5, 0.5])
    assert leading([factor, mass]) is mass and leading([factor, other]) is other
    far = candidate(64.0, 20.0, name="sensor_scale")
    assert leading([far, mass]) is far
    assert not leaves_open(mass, factor, 1 / 11) and leaves_open(mass, factor, 0.2)
    assert leaves_open(mass, other, 1 / 11) and leaves_open(other, factor, 1 / 11)


def test_beside_a_wrong_value_nothing_is_missing_that_explains_far_less() -> None:
    """A mode 45 nats behind a mass was said beside it, with a share of 2e-20."""
    mass, mode = candidate(60.0, 20.0, name="parameter_error"), candidate(15.0, 20.0, name="structural_mode")
    assert not leaves_open(mass, mode, 2e-20) and leaves_open(mass, mode, 1e-4)
    assert leaves_open(mass, mass, 2e-20)  # another value is no other structure
    assert leaves_open(mode, mass, 2e-20) and leaves_open(mode, candidate(15.0, 20.0, name="backlash"), 2e-20)


def test_that_the_structure_is_right_is_one_claim_whichever_value_is_wrong() -> None:
    """A torque 9 % low, or one of three values that are each a little less likely."""
    torque = candidate(60.0, 20.0, name="cp_change")
    values = [candidate(60.0 - behind, 20.0, name="parameter_error") for behind in (1.4, 1.2, 1.3)]
    assert leading([torque, *values[:1]]) is torque  # beaten by more than a nat
    assert leading([torque, *values]) is values[1]
    behind = [candidate(57.5, 20.0, name="parameter_error") for _ in range(3)]
    assert leading([torque, *behind]) is torque


def test_of_two_that_are_as_good_a_wrong_value_leaves_nothing_missing() -> None:
    torque, value = candidate(60.0, 20.0, name="cp_change"), candidate(59.5, 20.0, name="parameter_error")
    assert leading([torque, value]) is value
    assert leading([torque, candidate(58.5, 20.0, name="parameter_error")]) is torque
    assert leading([torque, candidate(59.5, 20.0, name="parameter_error", parameters=2)]) is torque


def moved(name: str, value: float, std: float) -> Moved:
    """A value declared as 100."""
    return Moved(Parameter(name, 100.0, "", 10.0, 1000.0, True), value, std)


def test_one_thing_wrong_is_likelier_than_two_that_happen_to_fit() -> None:
    """A stiffness 8 % off beside an accelerometer's factor, as declared beside a mass that is 8 % off."""
    mass = candidate(60.0, 20.0, name="parameter_error", moved=(moved("k", 98.5, 0.8), moved("c", 120.0, 15.0)))
    factor = candidate(60.5, 20.0, name="sensor_scale", moved=(moved("k", 91.6, 0.2), moved("c", 110.0, 15.0)))
    assert (left_wrong(factor, mass), left_wrong(mass, factor)) == (1, 0)
    assert weights_of([mass, factor])[1] == pytest.approx(1 / (1 + 100 / np.exp(0.5)))
    backlash = candidate(61.0, 20.0, name="backlash", moved=factor.moved)
    assert leading([backlash, mass]) is mass and not leaves_open(mass, backlash, 0.04)
    assert leaves_open(mass, backlash, 0.2) and leaves_open(backlash, mass, 0.04)
    far = candidate(66.0, 20.0, name="backlash", moved=factor.moved)
    assert leading([far, mass]) is far


@pytest.mark.parametrize(
    ("own", "other", "count"),
    [
        ((91.6, 0.2), (98.5, 0.8), 1),
        ((91.6, 0.2), (94.0, 9.0), 0),  # open, not right: no nearer
        ((91.6, 0.2), (96.5, 0.5), 0),  # wrong beside the other too
        ((98.5, 0.1), (100.0, 0.1), 0),  # 15 deviations, but within what values of models are known to
        ((91.6, 4.0), (100.0, 0.1), 0),  # not surely off
    ],
)
def test_a_value_is_left_wrong_only_where_the_other_makes_it_right(
    own: tuple[float, float], other: tuple[float, float], count: int
) -> None:
    """Values from data sheets are off beside every effect: that decides nothing."""
    first, second = (candidate(60.0, 20.0, moved=(moved("k", *pair),)) for pair in (own, other))
    assert left_wrong(first, second) == count


def test_a_value_that_is_wrong_anyway_decides_nothing() -> None:
    """A motor's constant beside a spring that is wrong: its inertia would take another two values, which are right."""
    spring, load, damping = moved("k", 89.9, 0.2), moved("J", 90.3, 0.7), moved("c", 81.4, 6.0)
    constant = candidate(60.0, 20.0, name="parameter_error", moved=(spring, moved("J", 99.5, 0.7), moved("c", 99.0, 5)))
    inertia = candidate(60.0, 20.0, name="parameter_error", moved=(moved("k", 81.1, 0.3), load, damping))
    assert (left_wrong(inertia, constant), left_wrong(constant, inertia)) == (2, 0)
    other = candidate(60.0, 20.0, name="backlash", moved=(moved("k", 100.0, 0.2), load, moved("c", 100.0, 5)))
    assert (left_wrong(inertia, other), left_wrong(constant, other), left_wrong(other, constant)) == (2, 0, 0)


def test_of_sets_that_fit_alike_the_effect_last_added_decides() -> None:
    """Sticking with nothing in excess is dry friction with two values that nobody needs: rounding must not choose."""
    friction, sticking = (
        candidate(60.0 + more, 20.0, name="actuator_lag", parameters=count)
        for more, count in ((0.0, 2), (0.9, 4))
    )  # fmt: skip
    friction.attachments += (SimpleNamespace(entry="coulomb_friction"),)
    sticking.attachments += (SimpleNamespace(entry="stiction"),)
    assert leading([sticking, friction]) is friction and leading([sticking]) is sticking
    far = candidate(62.0, 20.0, name="actuator_lag", parameters=4)
    far.attachments += (SimpleNamespace(entry="stiction"),)
    assert leading([far, friction]) is far


def test_a_form_far_ahead_of_all_that_was_found_together_takes_its_place() -> None:
    """Held against the largest set: two effects that explain as much as one form keep their names."""
    form = candidate(137.0, 45.0, name="unlisted", survived=True, parameters=1)
    one, two = candidate(60.0, 20.0, name="backlash"), candidate(136.0, 44.0, name="backlash")
    anything: Any = None
    assert pipeline._better_form(anything, [one, form], [one]) is form
    assert pipeline._better_form(anything, [one, form], [one, two]) is None
    assert pipeline._better_form(anything, [one, form], []) is None
    refused = candidate(137.0, 45.0, name="unlisted", survived=True, parameters=1, plausible=False)
    assert pipeline._better_form(anything, [one, refused], [one]) is None


@pytest.mark.parametrize(("value", "form_gain", "stands"), [(0.7, 60.0, True), (1.4, 60.0, True), (0.8, 60.0, False),
                                                            (1.3, 60.0, False), (0.7, 20.0, False)])  # fmt: skip
def test_only_a_sensor_that_is_a_third_off_gives_way_to_a_form_that_fits_as_well(
    value: float, form_gain: float, stands: bool
) -> None:
    factor = candidate(60.0, 20.0, name="sensor_scale", values={"block": {"factor": (value, 0.02)}})
    factor.attachments[0].key = "block"
    form = candidate(form_gain, form_gain / 3, name="unlisted")
    assert stands_for(factor, form) is stands
    assert (outdone_by([factor, form], factor) is form) is stands
    assert not stands_for(factor, candidate(60.0, 20.0, name="sensor_bias")) and not stands_for(WINNER, form)


@pytest.mark.parametrize(("form", "stands"), [(61.3, True), (59.5, True), (55.0, False)])
def test_a_bias_is_no_finding_beside_a_form_that_fits_as_well(form: float, stands: bool) -> None:
    bias = candidate(60.0, 20.0, name="sensor_bias")
    assert stands_for(bias, candidate(form, 20.0, name="unlisted")) is stands
    assert not stands_for(bias, candidate(form, 20.0, name="structural_mode"))


def test_a_factor_that_leaves_values_wrong_gives_way_to_a_form_that_makes_them_right() -> None:
    """Heat that is radiated: beside a sensor's factor of 1.12 a loss is 27 % off, beside a loss all are as declared."""
    values = {"shell": {"factor": (1.12, 0.02)}}
    factor = candidate(60.0, 20.0, name="sensor_scale", values=values, moved=(moved("h3", 127.0, 3.5),))
    factor.attachments[0].key = "shell"
    form = candidate(60.0, 20.0, name="unlisted", moved=(moved("h3", 101.0, 3.5),))
    assert stands_for(factor, form) and outdone_by([factor, form], factor) is form
    both = candidate(60.0, 20.0, name="unlisted", moved=(moved("h3", 127.0, 3.5),))
    assert not stands_for(factor, both) and outdone_by([factor, both], factor) is None


def test_one_explanation_is_told_once_however_it_is_worked_out() -> None:
    """A sensor's lag of the reading and one in states: the winner first, then the better of two; elsewhere another."""

    def lag(score: float, name: str, place: str, equation: str) -> Any:
        part = SimpleNamespace(entry=name, location={"entry": place}, equation=equation)
        return SimpleNamespace(attachments=(part,), score=score)

    drive = lag(9.0, "actuator_lag", "input:force", "u")
    own, states = lag(5.0, "sensor_lag", "output:x", "m"), lag(6.0, "sensor_lag", "output:x", "m")
    other, bent = lag(7.0, "sensor_lag", "output:y", "n"), lag(4.0, "sensor_lag", "output:x", "m**2")
    assert one_of_each([drive, own, states, other, bent]) == [drive, states, other, bent]
    assert one_of_each([own, drive, states]) == [own, drive]
    assert one_of_each([]) == []
