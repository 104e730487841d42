"""What is held against a name: loads of the runs, a second effect that brings nothing back, what looks alike."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from aeolid.diagnose.deadline import unlimited
from aeolid.diagnose.rules import in_force, with_rules
from aeolid.diagnose.run_prior import beside, explain
from aeolid.diagnose.run_prior.beside import acts_beside
from aeolid.diagnose.run_prior.build import pair_of
from aeolid.diagnose.run_prior.conclude import is_habit
from aeolid.diagnose.run_prior.explain import Explanation, Found, with_standing
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, all_hypotheses
from aeolid.diagnose.run_prior.modal import Absent, Modal
from aeolid.diagnose.run_prior.naming import Name, names_of, statement, without_mean_offset
from aeolid.diagnose.run_prior.pair import NOTHING, Change, Pair
from aeolid.diagnose.run_prior.search import Scored, Search
from aeolid.diagnose.run_prior.standing import Standing
from aeolid.diagnose.run_prior.steady_lines import grown_line
from aeolid.record import Channel, Record

STEP, SAMPLES, SPEED = 0.1, 6000, 1.2
CONTEXT = {"machine": "wind turbine", "blades": 3, "rated_speed_rad_s": SPEED}
CHANNELS = (
    Channel("pitch", "deg", "input"), Channel("acceleration", "m/s^2", "output"), Channel("azimuth", "rad", "azimuth"),
)  # fmt: skip


def shadowed(seed: int, load: float, short: bool = False) -> Record:
    """Return a recording whose output answers the pitch, wind, and a load three times a revolution; or short ones."""
    rng = np.random.default_rng(seed)
    pitch, wind = rng.standard_normal((2, SAMPLES))
    azimuth = np.cumsum(SPEED + 0.02 * np.sin(0.02 * np.arange(SAMPLES))) * STEP
    answer = np.convolve(pitch, [0.0, 0.5, 0.3, 0.1])[:SAMPLES]
    turning = np.exp(6 * (np.cos(3 * azimuth) - 1)) if short else np.cos(3 * azimuth)
    output = answer + 0.5 * wind + load * turning
    return Record(STEP * np.arange(SAMPLES), np.column_stack([pitch, output, azimuth]), CHANNELS, STEP, "made", "")


def told(recording: Record, run: Record) -> list[str]:
    """Return the names, rivals among them, of what a pair is explained by."""
    found = explain.explain(pair_of([recording], [run], CONTEXT), CONTEXT, {}, unlimited())
    names = [names_of(f, {}, found, CONTEXT) for f in found.found]
    return [n.entry for group in names for n in group]


def test_short_loads_as_blades_pass_are_a_shadow_and_a_wave_may_be_sampled_turbulence() -> None:
    """What a tower takes from a blade lasts a small part of the turn: waves of six and nine to a revolution, too."""
    run = shadowed(2, 0.0)
    assert told(shadowed(1, 0.6, short=True), run) == ["tower_shadow"]
    assert sorted(told(shadowed(1, 0.3), run)) == ["rotational_sampling", "tower_shadow"]
    assert told(shadowed(1, 0.0), run) == []


def test_a_load_that_the_simulation_has_and_the_machine_lacks_is_no_shadow_left_out() -> None:
    """Beside a lag and a rate limit lines that had shrunk were told as a shadow that the simulation lacks."""
    run = shadowed(2, 0.6, short=True)
    assert grown_line(pair_of([shadowed(1, 0.3, short=True)], [run], CONTEXT), 3) == pytest.approx(0.5, abs=0.1)
    assert "tower_shadow" not in told(shadowed(1, 0.0), run)
    assert grown_line(pair_of([shadowed(1, 0.3)], [shadowed(2, 0.0)], CONTEXT), 3) > 5  # against what noise leaves


def gained(recording: Record, run: Record) -> tuple[float, float]:
    """Return what a load three times a revolution gains, and what is held against it."""
    search = Search(pair_of([recording], [run], CONTEXT))
    shadow = next(h for h in all_hypotheses(search.pair, {}) if h.entry == "rotational_sampling")
    return search.gain(shadow, ())[0], search.control(shadow, ())


def test_a_load_that_the_run_has_itself_counts_three_times_against_the_name() -> None:
    """How large it is goes with the wind, so that one recording gains more by it than another of the same machine."""
    both = shadowed(1, 0.12), shadowed(2, 0.1)
    gain, control = gained(*both)
    rules = in_force()
    with with_rules(replace(rules, run_prior=replace(rules.run_prior, own_load_times=1.0))):
        once = gained(*both)[1]
    assert once > 5
    assert control == pytest.approx(rules.run_prior.own_load_times * once)
    assert gain - control < rules.run_prior.named_nats
    gain, control = gained(shadowed(1, 0.2), shadowed(2, 0.0))
    assert gain - control > rules.run_prior.named_nats


def hypothesis(place: str) -> Hypothesis:
    """Return an effect at a place."""
    return Hypothesis("sensor_scale", place, ("factor",), ("1",), (0.1,), (9.0,), ((1.2,),), lambda v: NOTHING)


class _Second:
    """Stand in for the search behind the first effect, after which the run weighs 0.1 and 300 nats are lost."""

    def __init__(self, found: Scored, *_: object) -> None:
        self.base, self.lost, self.evaluations = SimpleNamespace(weight=0.1), 300.0, 1
        self._found = found

    def screen(self, *_: object) -> list[Scored]:
        return [self._found]

    def refine(self, *_: object) -> list[Scored]:
        return [self._found]


@pytest.mark.parametrize(("nats", "weight", "count"), [(37.0, 0.1, 1), (37.0, 0.316, 2), (200.0, 0.1, 2)])
def test_a_second_effect_brings_the_run_back_or_explains_half(
    nats: float, weight: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stiffness that moved left 300 nats over, of which a sensor's factor gained 37 and brought nothing back."""
    first = Scored(hypothesis("output:speed"), (1.5,), 137.0, 137.0, 0.1)
    other = Scored(hypothesis("output:acceleration"), (1.2,), nats, nats, weight)
    monkeypatch.setattr(explain, "Search", partial(_Second, other))
    x = Explanation(454.0, 0.03, {}, (Found(first, None),), (first,), Modal((), (), ()))
    told = explain._with_further(cast(Pair, None), x, first, cast(Any, [other.hypothesis]), lambda _: None)
    assert len(told.found) == count


@pytest.mark.parametrize(
    ("weight", "before", "lost", "count"),
    [(0.316, 0.316, 318.0, 0), (1.0, 0.316, 318.0, 1), (1.0, 1.0, 0.0, 1), (0.316, 0.316, 60.0, 1)],
)
def test_an_effect_that_leaves_the_run_as_it_was_must_explain_half(
    weight: float, before: float, lost: float, count: int
) -> None:
    """A wake of its own time cost 318 nats; a limit on the torque's rate gained 32 of them and had the name."""
    scored = Scored(hypothesis("input:torque"), (6.2,), 33.0, 33.0, weight)
    search = cast(Any, SimpleNamespace(base=SimpleNamespace(weight=before)))
    assert (explain.chosen(search, [scored], lost) is not None) == bool(count)


@pytest.mark.parametrize(
    ("once", "names"),
    [
        ({"tower_acc_side_side": 3.6, "flap_cosine": -0.8, "flap_sine": -0.6}, ["mass_imbalance"]),
        ({"tower_acc_side_side": 0.7, "flap_cosine": 2.1, "flap_sine": 5.7}, ["aero_imbalance"]),
        ({"generator_speed": 0.8, "tower_acc_fore_aft": 0.5}, ["mass_imbalance", "aero_imbalance"]),
    ],
)
def test_the_loads_once_a_revolution_tell_which_imbalance(once: dict[str, float], names: list[str]) -> None:
    """Both were left open, mass first, where tilt and yaw moments turned 300 times as strongly as the tower swayed."""
    turning = replace(hypothesis("rotor"), entry="mass_imbalance", names=(), units=())
    scored = Scored(turning, (), 60.0, 60.0, 1.0)
    told = names_of(Found(scored, None), {}, replace(NONE, once=once), CONTEXT)
    assert [n.entry for n in told] == names


@pytest.mark.parametrize(("nats", "count"), [(256.0, 2), (700.0, 1)])
def test_a_mode_that_moved_and_leaves_most_unexplained_has_two_names(nats: float, count: int) -> None:
    """A blade's edgewise mode was missing, which moves the drive train's; another mass alone was told, and surely."""
    moved = replace(hypothesis("output:generator_speed"), entry="added_mass", names=("frequency_hz", "damping"),
                    units=("Hz", "1"), of=(0.691, 0.047))  # fmt: skip
    scored = Scored(moved, (0.651, 0.04), nats, nats, 0.1)
    values = {"frequency_hz": (0.651, 0.003), "damping": (0.04, 0.002)}
    told = names_of(Found(scored, None), values, replace(NONE, lost=1015.0), CONTEXT)
    assert len(told) == count
    assert told[0].entry == "added_mass"


@pytest.mark.parametrize(("place", "nats", "shown", "names"), [
    ("input:torque_demand", 59.0, ["generator_speed", "tower_acc_fore_aft"],
     ["actuator_lag", "tower_side_side", "blade_edge"]),
    ("input:torque_demand", 59.0, ["generator_speed", "tower_acc_side_side"], ["actuator_lag", "blade_edge"]),
    ("input:torque_demand", 260.0, ["generator_speed"], ["actuator_lag"]),
    ("input:pitch_demand", 59.0, ["generator_speed"], ["actuator_lag"]),
])  # fmt: skip
def test_a_drive_of_the_torque_that_explains_little_may_be_a_mode_that_no_output_shows(
    place: str, nats: float, shown: list[str], names: list[str]
) -> None:
    """A missing side-side mode, seen in the speed alone, was a drive of the torque that explained a fifth, and sure."""
    lag = replace(hypothesis(place), entry="actuator_lag", names=("tau_s",), units=("s",), words="a lag of {tau_s:.2g}")
    found = replace(NONE, lost=293.0, moved={n: 1.5 - 0.1 * k for k, n in enumerate(shown)})
    told = names_of(Found(Scored(lag, (0.04,), nats, nats, 0.3), None), {"tau_s": (0.04, 0.01)}, found, CONTEXT)
    assert [n.entry for n in told] == names
    assert sum(n.weight for n in told) == pytest.approx(1.0)
    assert all("no output shows" in statement(n, {}) for n in told[1:])


NONE = Explanation(454.0, 0.03, {}, (), (), Modal((), (), ()))


@pytest.mark.parametrize(("kind", "answers", "kept"), [("", True, 0), ("", False, 1), ("drivetrain_torsion", True, 0)])
def test_a_mode_is_part_of_how_the_rotor_answers(kind: str, answers: bool, kept: int) -> None:
    """Rigid blades moved a mode of 3 Hz at one tower's top, of 1.75 Hz in another rotor's speed: told instead."""
    mode = Absent(2.98, 0.02, 0.021, 0.003, "tower_acc_fore_aft", kind=kind)
    told = Standing(("blade_flap",), {"blade_flap": "rotor"}, {}, {"blade_flap": "blades bend"}, 100.0, answers=answers)
    found = with_standing(replace(NONE, found=(Found(None, mode),)), (told,)).found
    assert sum(f.mode is not None for f in found) == kept
    assert sum(f.standing is not None for f in found) == 1 - kept


@pytest.mark.parametrize(
    ("output", "kind", "late", "kept"),
    [
        ("flap_sine", "", False, 0), ("flap_sine", "blade_edge", False, 1), ("tower", "", False, 1),
        ("speed", "drivetrain_torsion", True, 0), ("speed", "drivetrain_torsion", False, 1),
        ("tower", "tower_fore_aft", True, 1), ("tower", "", True, 0),
    ],
)  # fmt: skip
def test_no_mode_is_missing_that_a_rotor_moves_which_answers_otherwise(
    output: str, kind: str, late: bool, kept: int
) -> None:
    """Without lift that builds up blades swung at 1.5 Hz, with rigid blades a shaft at 1.77 Hz, and had the names."""
    pair = cast(
        Pair, SimpleNamespace(shown=("tower", "flap_collective", "flap_cosine", "flap_sine"), blades=((1, 2, 3),))
    )
    mode = Found(None, Absent(1.5, 0.014, 0.033, 0.008, output, kind=kind))
    assert len(explain.without_blades_mode(pair, replace(NONE, found=(mode,)), late).found) == kept


@pytest.mark.parametrize(("entry", "kept"), [("actuator_lag", 2), ("unsteady_aero", 1)])
def test_a_late_drive_leaves_a_missing_mode_and_late_lift_does_not(entry: str, kept: int) -> None:
    pair = cast(Pair, SimpleNamespace(shown=("speed", "tower"), blades=()))
    late = Found(Scored(replace(hypothesis("input:pitch"), entry=entry), (0.3,), 90.0, 90.0, 0.3), None)
    mode = Found(None, Absent(1.77, 0.01, 0.03, 0.004, "speed", kind="drivetrain_torsion"))
    told = explain.without_blades_mode(pair, replace(NONE, found=(mode, late)), True)
    assert len(told.found) == kept and late in told.found


@pytest.mark.parametrize(("entry", "told"), [("actuator_lag", False), ("unsteady_aero", True), ("", True)])
def test_blades_that_bend_are_told_where_nothing_but_lift_was_found(entry: str, told: bool) -> None:
    """In a full field late lift with a share of 0.6, 28 nats worse on the sealed part, stood where blades bend."""
    drive = Found(Scored(replace(hypothesis("input:pitch"), entry=entry), (0.3,), 90.0, 90.0, 0.3), None)
    bent = Standing(("blade_flap",), {"blade_flap": "output:thrust"}, {}, {"blade_flap": "bent"}, 90.0, answers=True)
    found = explain.with_late_blades(replace(NONE, found=(drive,) if entry else ()), bent).found
    assert [f.standing for f in found] == ([bent] if told else [None])


@pytest.mark.parametrize(("delay", "kept"), [(0.026, 0), (0.2, 1)])
def test_what_answers_tell_comes_before_a_lateness_that_loggers_have(delay: float, kept: int) -> None:
    """Missing late lift at 15 MW was a delay of half a row, which is no finding; a delay of a drive stays."""
    h = Hypothesis("transport_delay", "input:pitch", ("delay_s",), ("s",), (0.0,), (1.0,), ((0.1,),), lambda v: NOTHING)
    late = Found(Scored(h, (delay,), 90.0, 90.0, 0.3), None)
    told = Standing(("unsteady_aero",), {"unsteady_aero": "rotor"}, {}, {"unsteady_aero": "late"}, 90.0, answers=True)
    found = with_standing(replace(NONE, found=(late,), change=Change()), (told,), 0.065).found
    assert sum(f.scored is not None for f in found) == kept
    assert sum(f.standing is not None for f in found) == 1 - kept


@pytest.mark.parametrize(
    ("place", "kind", "apart"),
    [
        ("input:torque_demand", "drivetrain_torsion", False), ("input:GenTq", "drivetrain_torsion", False),
        ("input:pitch", "drivetrain_torsion", True), ("input:torque_demand", "tower_side_side", True),
        ("rotor", "", True), ("output:speed", "", False),
    ],
)  # fmt: skip
def test_a_drive_train_hands_the_torque_on_as_a_drive_would(place: str, kind: str, apart: bool) -> None:
    """Beside a missing torsion of 1.68 Hz a second-order drive of 21.6 rad/s of the torque had a name."""
    assert acts_beside(hypothesis(place), kind) is apart


@pytest.mark.parametrize(("weight", "turns", "count"), [(0.316, True, 0), (1.0, True, 1), (0.316, False, 1)])
def test_a_load_that_turns_must_bring_the_run_back(weight: float, turns: bool, count: int) -> None:
    """A wake of its own time cost 74 nats; lines three times a revolution gained 127 and left the run as it was."""
    load = Change(extra=lambda side: np.cos(side.azimuth)[:, None]) if turns else NOTHING
    scored = Scored(replace(hypothesis("rotor"), change=lambda v: load), (1.0,), 127.0, 127.0, weight)
    search = cast(Any, SimpleNamespace(base=SimpleNamespace(weight=0.316)))
    assert (explain.chosen(search, [scored], 74.0) is not None) == bool(count)


@pytest.mark.parametrize(
    ("once", "kept"), [({"flap_sine": 3.1, "side_side": 0.2}, 1), ({"flap_sine": 0.1, "side_side": 2.0}, 2)]
)
def test_the_angle_of_one_blade_is_not_told_again_as_that_of_all(once: dict[str, float], kept: int) -> None:
    """A blade of three that is twisted by 0.6 degrees moves the mean angle by 0.2; a heavy one moves none."""
    load = Scored(replace(hypothesis("rotor"), entry="mass_imbalance"), (), 165.0, 165.0, 1.0)
    place, words = {"sensor_bias": "input:pitch"}, {"sensor_bias": "the angle is off"}
    offset = Standing(("sensor_bias",), place, {"sensor_bias": {"bias": (-0.21, 0.07)}}, words, 30.0)
    found = (Found(load, None), Found(None, None, standing=offset))
    x = replace(NONE, found=found, once=once)
    assert len(without_mean_offset(x, CONTEXT).found) == kept
    alone = replace(NONE, found=found[1:], once=once)
    assert without_mean_offset(alone, CONTEXT) is alone


@pytest.mark.parametrize(("after", "count"), [(0.1, 1), (0.316, 2), (1.0, 2)])
def test_what_takes_trust_from_the_run_is_no_second_effect(
    after: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines that a missing side-side mode leaves in other outputs gained 168 nats where the run lost 140."""
    line = Scored(hypothesis("rotor"), (), 168.0, 174.0, after)
    search = partial(_Second, line)
    monkeypatch.setattr(beside, "Search", lambda *a: _weighed(search(*a)))
    for name, value in {"without": NONE, "all_hypotheses": [line.hypothesis], "limit_of": 30.0}.items():
        monkeypatch.setattr(beside, name, lambda *_, v=value: v)
    proof = SimpleNamespace(interval=(9.0, 20.0))
    monkeypatch.setattr(beside, "prove", lambda *_: proof)
    mode = Absent(0.24, 0.001, 0.004, 0.002, "side_side", kind="tower_side_side")
    x = replace(NONE, found=(Found(None, mode),))
    assert len(beside.with_beside(cast(Pair, None), x, {}, {}, lambda _: None).found) == count


def _weighed(search: _Second) -> Any:
    search.base.weight, search.lost = 0.316, 140.0
    return SimpleNamespace(**vars(search), unsteady=lambda: 0.0, found=NOTHING, ridge=None, screen=search.screen,
                           refine=search.refine)  # fmt: skip


@pytest.mark.parametrize(("output", "factor", "names"), [
    ("tower_acc_fore_aft", 0.954, ["sensor_scale", "added_mass"]),
    ("tower_acc_fore_aft", 0.5, ["sensor_scale"]),
    ("generator_speed", 0.954, ["sensor_scale"]),
])  # fmt: skip
def test_a_tower_that_moves_a_little_less_may_be_heavier(output: str, factor: float, names: list[str]) -> None:
    """A nacelle heavier by 8 % was told as a sensor's factor of 0.954, and sure of it."""
    scored = Scored(hypothesis(f"output:{output}"), (factor,), 60.0, 60.0, 0.3)
    told = names_of(Found(scored, None), {"factor": (factor, 0.03)}, NONE, CONTEXT)
    assert [n.entry for n in told] == names
    assert all(f"{factor:.3g}" in statement(n, {}) for n in told)


@pytest.mark.parametrize(
    ("told", "habit"),
    [
        ([("data_time_offset", {"offset_s": 0.104}), ("transport_delay", {"delay_s": 0.109})], True),
        ([("data_time_offset", {"offset_s": -0.12})], True),
        ([("transport_delay", {"delay_s": 0.2})], False),
        ([("actuator_lag", {"tau_s": 0.1})], True),
        ([("transport_delay", {"delay_s": 0.05}), ("sensor_lag", {"tau_s": 0.05})], False),
        ([("transport_delay", {"delay_s": 0.09}), ("sensor_lag", {"tau_s": 0.02})], True),
        ([("sensor_lag", {"tau_s": 0.02})], False),
        ([], False),
    ],
)
def test_what_is_late_by_about_a_row_is_how_rows_are_taken(
    told: list[tuple[str, dict[str, float]]], habit: bool
) -> None:
    """Held commands, filters against aliases and clocks: 1.04 rows of 0.1 s had a name on a machine like its run."""
    names = [[Name(entry, "data", {k: (v, 0.01) for k, v in values.items()}, {}, 1.0)] for entry, values in told]
    assert is_habit(names, 0.1) is habit
