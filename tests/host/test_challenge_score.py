"""The score counts what it says: made-up answers with known outcomes, intervals against an independent reference."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from aeolid.challenge.judge import Judged, judge
from aeolid.challenge.page import render, text
from aeolid.challenge.score import confusion, entries, failed, good, table, ways, wilson

Facts = dict[str, Any]


def hidden(sort: str, *accepted: tuple[str, ...], decidable: bool = True, value: float | None = None) -> Facts:
    """Return the sealed answer of a case."""
    quantity = None if value is None else {"label": "tau_s", "value": value}
    effects = [{"what": "w", "accepted": list(a), "quantity": quantity, "strength": 1.0} for a in accepted]
    return {"class": sort, "plant": "spring", "baseline": "equations", "effects": effects, "decidable": decidable,
            "nats": 50.0, "vaf_points": 0.1, "hides": []}  # fmt: skip


def said(verdict: str, *ids: str, rivals: tuple[str, ...] = (), tau: tuple[float, float] | None = None,
         recovered: float = 0.9) -> Facts:  # fmt: skip
    """Return the result of a case."""
    parameters = {} if tau is None else {"tau_s": {"value": tau[0], "std": tau[1], "unit": "s"}}
    effects = [{"id": i, "rivals": [{"id": r, "weight": 0.1} for r in rivals], "parameters": parameters} for i in ids]
    found = {"verdict": verdict, "effects": effects, "statement": "…", "sealed": {"recovered_fraction": recovered}}
    return {"case": "case-0001", "outcome": "done", "reason": "", "seconds": 10.0, "diagnosis": found}


def one(answer: Facts, result: Facts) -> Judged:
    return judge("case-0001", answer, result)


def value(rows: list[Facts], name: str) -> Facts:
    return next(r for r in rows if r["metric"].startswith(name))


LAG = ("actuator_lag",)


def test_a_right_name_is_right_in_every_row() -> None:
    judged = [one(hidden("single", LAG, value=0.3), said("named", "actuator_lag", tau=(0.33, 0.02)))] * 4
    rows = table(judged)
    for name in ("recall", "top-1 id", "top-1 family", "top-3", "truth inside"):
        assert value(rows, name)["value"] == 1.0, name
    assert value(rows, "size of the set")["value"] == 1.0
    assert value(rows, "parameter error")["value"] == pytest.approx(0.1)
    assert value(rows, "coverage")["value"] == 1.0  # 0.03 away, 1.645 · 0.02 allowed
    assert value(rows, "wrong but confident")["value"] == 0.0


def test_a_tolerance_of_the_truth_widens_the_interval() -> None:
    """Of a rig whose inertia is declared a little wrong: 0.05 away, 1.645 · 0.02 allowed, and a tenth of 0.3 more."""
    answer, result = hidden("single", LAG, value=0.3), said("named", "actuator_lag", tau=(0.35, 0.02))
    assert [inside for _, inside in one(answer, result).errors] == [False]
    answer["effects"][0]["quantity"]["tolerance"] = 0.1
    assert [inside for _, inside in one(answer, result).errors] == [True]


def test_each_failure_counts_in_its_own_row() -> None:
    missed = one(hidden("single", LAG), said("no_mismatch"))
    family = one(hidden("single", LAG), said("named", "transport_delay"))
    wrong = one(hidden("single", LAG), said("named", "coulomb_friction"))
    nameless = one(hidden("single", LAG), said("unnamed"))
    in_set = one(hidden("single", LAG), said("ambiguous", "transport_delay", rivals=("actuator_lag",)))
    rows = table([missed, family, wrong, nameless, in_set])
    assert value(rows, "recall")["count"] == 4
    assert value(rows, "top-1 id")["count"] == 0
    assert (value(rows, "top-1 family")["count"], value(rows, "top-1 family")["of"]) == (2, 4)
    assert value(rows, "top-3")["count"] == 1
    assert (value(rows, "truth inside")["count"], value(rows, "truth inside")["of"]) == (1, 3)
    assert value(rows, "size of the set")["value"] == pytest.approx(4 / 3)
    assert value(rows, "wrong but confident")["count"] == 2  # an ambiguous answer is not confident
    assert [good(j) for j in (missed, family, wrong, nameless, in_set)] == [False] * 4 + [True]
    assert {(c["hidden"], c["answered"]) for c in confusion([missed, wrong])} == {
        ("input_lag", "no_mismatch"), ("input_lag", "friction"),
    }  # fmt: skip


def test_nulls_allow_no_physics_and_wrong_values_only_their_own_name() -> None:
    for sort, verdict, ids, false in (
        ("null", "no_mismatch", (), False), ("null", "unnamed", (), False), ("null", "named", ("backlash",), True),
        ("null", "parameter", ("parameter_error",), True), ("parameter", "parameter", ("parameter_error",), False),
        ("parameter", "immaterial", (), False), ("parameter", "multiple", ("parameter_error", "backlash"), True),
        ("null", "data_fault", (), True), ("null", "parameter", (), True), ("parameter", "parameter", (), False),
    ):  # fmt: skip
        j = one(hidden(sort), said(verdict, *ids))
        assert (j.false_name, j.wrong_but_confident, good(j)) == (false, false, not false), (sort, verdict)


def test_outside_impossible_undecidable_and_faults() -> None:
    assert good(one(hidden("outside", ()), said("unnamed"))) and not good(one(hidden("outside", ()), said("parameter")))
    forced = one(hidden("outside", ()), said("named", "backlash"))
    assert forced.wrong_but_confident and not good(forced)
    assert good(one(hidden("impossible", LAG, decidable=False), said("not_testable")))
    assert not good(one(hidden("impossible", LAG, decidable=False), said("named", "backlash")))
    fault = one(hidden("fault", ("sensor_sign", "data_fault")), said("data_fault"))
    assert fault.right and good(fault) and not fault.wrong_but_confident
    faint = one(hidden("single", LAG, decidable=False), said("no_mismatch"))
    assert good(faint) and value(table([faint]), "recall")["of"] == 0


def test_two_effects_are_found_by_either_name() -> None:
    both = hidden("double", LAG, ("cubic_stiffness",))
    assert one(both, said("multiple", "cubic_stiffness", "actuator_lag")).right
    assert one(both, said("named", "cubic_stiffness")).right
    assert not one(both, said("named", "backlash")).in_set
    whole, half = (
        one(both, said("multiple", *ids)) for ids in (("cubic_stiffness", "actuator_lag"), ("actuator_lag",))
    )
    assert value(table([whole, half]), "two effects")["count"] == 1


def test_a_fault_recovers_nothing_and_is_not_counted_for_it() -> None:
    fault = one(hidden("fault", ("sensor_sign", "data_fault")), said("data_fault", recovered=0.0))
    named = one(hidden("fault", ("sensor_sign", "data_fault")), said("named", "sensor_sign", recovered=0.9))
    row = value(table([fault, named]), "recovered fraction, median")
    assert (row["of"], row["value"]) == (1, 0.9)


def test_a_crash_is_a_miss() -> None:
    crash = {"case": "case-0001", "outcome": "crash", "reason": "boom", "seconds": 1.0, "diagnosis": None}
    j = one(hidden("single", LAG), crash)
    rows = table([j])
    assert (value(rows, "recall")["count"], value(rows, "crashed")["count"], good(j)) == (0, 1, False)


def test_what_was_found_is_counted_by_way_and_by_entry() -> None:
    """An effect counts in each of its ways, a set in each of its entries; what nobody can decide counts in none."""
    friction = ("coulomb_friction", "stiction")
    cases = [
        ("case-0001", hidden("single", LAG), said("named", "actuator_lag"), ("aliased", "not excited")),
        ("case-0002", hidden("double", LAG, friction), said("named", "stiction"), ("aliased",)),
        ("case-0003", hidden("single", LAG), said("no_mismatch"), ("aliased",)),
        ("case-0004", hidden("single", LAG, decidable=False), said("no_mismatch"), ("aliased",)),
        ("case-0005", hidden("null"), said("no_mismatch"), ()),
    ]
    judged = [judge(name, answer, result) for name, answer, result, _ in cases]
    answers = {name: answer | {"hides": [{"what": w} for w in how]} for name, answer, _, how in cases}
    assert ways(judged, answers) == [
        {"what": "not excited", "count": 1, "of": 1}, {"what": "aliased", "count": 2, "of": 3},
    ]  # fmt: skip
    assert entries(judged) == [
        {"what": "actuator_lag", "count": 2, "of": 3}, {"what": "coulomb_friction", "count": 1, "of": 1},
    ]  # fmt: skip


@pytest.mark.parametrize(("count", "of"), [(0, 5), (3, 7), (16, 16), (40, 480)])
def test_wilson_is_wilson(count: int, of: int) -> None:
    reference = binomtest(count, of).proportion_ci(0.95, method="wilson")
    assert wilson(count, of) == pytest.approx((reference.low, reference.high), abs=1e-6)


def test_sizes_come_with_a_bootstrap_that_holds_them() -> None:
    rng = np.random.default_rng(2)
    judged = [
        one(hidden("single", LAG, value=1.0), said("named", "actuator_lag", tau=(1 + e, 0.1)))
        for e in rng.normal(0, 0.1, 60)
    ]
    row = value(table(judged), "parameter error")
    assert row["interval"][0] <= row["value"] <= row["interval"][1]
    assert row["value"] == pytest.approx(0.0674, abs=0.02)  # the median of |N(0, 0.1²)|
    coverage = value(table(judged), "coverage")
    assert coverage["interval"][0] <= 0.9 <= coverage["interval"][1]


def facts_of(judged: list[Judged]) -> Facts:
    rows = [{"case": j.case, "class": j.sort, "plant": j.plant, "baseline": j.baseline, "what": list(j.what),
             "truth": [list(t) for t in j.truth], "hides": ["narrow band"], "nats": j.nats, "vaf_points": 0.2,
             "decidable": j.decidable, "outcome": j.outcome, "verdict": j.verdict, "said": list(j.said),
             "offered": list(j.offered), "good": good(j), "seconds": j.seconds, "statement": j.statement}
            for j in judged]  # fmt: skip
    settings = {"cases": len(judged), "samples": 1000, "seed": 1, "version": 1}
    return {"seal": "ab" * 32, "settings": settings, "run": {"sham": 0}, "classes": {"single": len(judged)},
            "table": table(judged), "confusion": confusion(judged), "cases": rows, "entries": entries(judged),
            "ways": [{"what": "aliased", "count": 3, "of": 17}]}  # fmt: skip


def test_text_and_page_show_the_same_and_need_no_network(tmp_path: Path) -> None:
    judged = [one(hidden("single", LAG), said("named", i)) for i in ("actuator_lag", "coulomb_friction")]
    judged.append(one(hidden("null"), said("no_mismatch")))
    facts = facts_of(judged)
    shown = text(facts)
    assert "recall of concealed decidable effects" in shown and "2 of 2" in shown and "100.0%" in shown
    assert "w (actuator_lag, single) → named: coulomb_friction" in shown
    assert re.search(r"How it hid, named or in the set:\n  aliased +3 of 17", shown)
    assert re.search(r"What was hidden, named or in the set:\n  actuator_lag +1 of 2", shown)
    render(facts, tmp_path / "score.html")
    page = (tmp_path / "score.html").read_text()
    assert "coulomb_friction" in page and "<svg" in page and "3 of 17" in page and "1 of 2" in page
    assert 'src="http' not in page and 'href="http' not in page.replace('href="http://www.w3.org', "")
    assert failed(facts, 1.01) and not failed(facts, 0.9)
