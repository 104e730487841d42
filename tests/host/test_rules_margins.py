"""Margins of decision rules: inside them every comparison ends as before, outside a single one it does not."""

from __future__ import annotations

import json
import math
import operator
import pickle
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_cases import SWING, SWING_CHANNELS, write_case

from aeolid.cli.diagnose_many import settings_of
from aeolid.cli.diagnose_piece import Asked
from aeolid.cli.main import main
from aeolid.diagnose.rules import DecisionRules, differing, in_force, rules_of, with_rules
from aeolid.diagnose.rules.declaring import quoted
from aeolid.diagnose.rules.margins import Margins, noting_margins

# Sizes at which neither a product nor a difference of these loses all its digits.
NUMBERS = st.floats(-1e3, 1e3).filter(lambda x: x == 0 or abs(x) > 1e-3)
COMPARISONS = (operator.gt, operator.ge, operator.lt, operator.le)
NATS, SHARE, Z = "evidence.clear_nats", "selection.further_share", "evidence.one_percent_z"


def noted(decide: Callable[[], Any]) -> tuple[Any, Margins]:
    with noting_margins(DecisionRules()) as margins:
        found = decide()
    return found, margins


def under(values: dict[str, float], decide: Callable[[], Any]) -> Any:
    tables: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        section, own = name.split(".")
        tables.setdefault(section, {})[own] = value
    with with_rules(rules_of(tables, "test")):
        return decide()


@given(st.lists(st.tuples(st.sampled_from(COMPARISONS), NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=6), st.data())
def test_inside_the_margins_every_comparison_ends_as_before(
    steps: list[tuple[Callable[[Any, Any], Any], float, float, float]], data: st.DataObject
) -> None:
    """Of three rules in linear expressions, alone and together; each value drawn anywhere in its own interval."""

    def decide() -> list[bool]:
        rules = in_force()
        nats, share, z = rules.evidence.clear_nats, rules.selection.further_share, rules.evidence.one_percent_z
        return [
            bool(end)
            for holds, a, b, c in steps
            for end in (
                holds(a * nats + b, c), holds(c - z / 2, np.float64(b)), holds(max(nats, a * share), c),
                holds(b * share - c, a * z + nats), np.all(holds(np.array([a, b, c]), nats)), holds(abs(z - c), b),
            )
        ]  # fmt: skip

    plain = under({}, decide)
    ends, margins = noted(decide)
    assert ends == plain
    values = {}
    for name in (NATS, SHARE, Z):
        low, high = margins.low[name], margins.high[name]
        assert low <= margins.values[name] <= high
        least, most = (0.0, 1.0) if name == SHARE else (1e-6, 1e4)
        if max(low, least) < min(high, most):
            values[name] = data.draw(st.floats(max(low, least), min(high, most)), name)
    assert under(values, decide) == plain


@given(st.floats(0.1, 1e3), st.floats(0.1, 10))
def test_beyond_the_margins_of_one_comparison_it_ends_otherwise(gain: float, factor: float) -> None:
    def decide() -> bool:
        return bool(gain > factor * in_force().evidence.clear_nats)

    before, margins = noted(decide)
    end = margins.high[NATS] if before else margins.low[NATS]
    inward = 1e-7 * max(1.0, gain / factor)  # a margin ends short of the comparison by 1e-9 of the distance to it
    assert math.isfinite(end) and end == pytest.approx(gain / factor, abs=inward)
    beyond = gain / factor + (inward if before else -inward)
    assert under({NATS: beyond}, decide) is not before


USES: tuple[Callable[[Any], Any], ...] = (
    float, int, bool, round, hash, math.sqrt, str, repr, np.exp, np.asarray, math.floor, math.ceil,
    lambda x: f"{x:.2f}", lambda x: x**2, lambda x: 2**x, lambda x: 3 / x, lambda x: 7 // x, lambda x: x // 3,
    lambda x: 7 % x, lambda x: x % 3, lambda x: np.ones(3) * x, lambda x: np.where([True, False], x, 0.0),
    lambda x: np.clip([30.0, 1.0], 0.0, x), lambda x: np.array([1.0, x]), lambda x: np.full(2, x),
    lambda x: float(x * x), lambda x: x * np.inf, lambda x: np.quantile([1.0, 2.0], x / (2 * x)), lambda x: x == 20.0,
)  # fmt: skip


@pytest.mark.parametrize("use", USES)
def test_a_value_that_enters_a_calculation_pins_its_rule(use: Callable[[Any], Any]) -> None:
    found, margins = noted(lambda: use(in_force().evidence.clear_nats))
    plain = use(in_force().evidence.clear_nats)
    assert type(found) is type(plain) and np.array_equal(np.asarray(found), np.asarray(plain))
    assert margins.low[NATS] == margins.high[NATS] == DecisionRules().evidence.clear_nats


def test_a_count_is_followed_until_it_counts() -> None:
    name = "localise.fewest_bins"
    own = DecisionRules().localise.fewest_bins
    _, margins = noted(lambda: own + 5 > in_force().localise.fewest_bins)
    assert margins.high[name] == pytest.approx(own + 5) and math.isinf(margins.low[name])
    found, margins = noted(lambda: (len(range(in_force().localise.fewest_bins)), [0] * 99 + [1])[0])
    assert found == own and margins.low[name] == margins.high[name] == own


def compared(other: Any) -> Any:
    return other > in_force().evidence.clear_nats


def test_what_is_no_number_bounds_nothing_and_an_equal_one_pins() -> None:
    for other in (math.nan, np.array([np.nan, np.nan])):
        _, margins = noted(partial(compared, other))
        assert margins.to_json()[NATS] == [None, None]
    own = DecisionRules().evidence.clear_nats
    ends, margins = noted(lambda: own >= in_force().evidence.clear_nats)
    assert ends is True and margins.to_json()[NATS] == [own, own]
    _, margins = noted(lambda: math.inf > in_force().evidence.clear_nats)
    assert margins.to_json()[NATS] == [None, None]


def test_a_rule_that_is_only_told_stays_free() -> None:
    found, margins = noted(lambda: f"{quoted(in_force().evidence.clear_nats):g}")
    assert found == f"{DecisionRules().evidence.clear_nats:g}" and margins.to_json()[NATS] == [None, None]
    assert noted(lambda: differing(in_force()))[0] == {}


def test_a_followed_rule_goes_nowhere_unseen() -> None:
    with noting_margins(DecisionRules()):
        followed = in_force().evidence.clear_nats
        with pytest.raises(TypeError):
            pickle.dumps(followed)
        with pytest.raises(TypeError):
            json.dumps(followed)
        with pytest.raises(TypeError):
            operator.gt(followed, "high")


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """Write a case whose position reads a code for a missing value in three samples of ten."""
    rng = np.random.default_rng(5)
    rows = rng.standard_normal((400, 3))
    rows[rng.random(400) < 0.3, 1] = -9999.0
    folder = tmp_path / "swing"
    folder.mkdir()
    write_case(folder, SWING, 0.05, SWING_CHANNELS, rows)
    return folder


def diagnosed(case: Path, out: Path, *options: str) -> dict[str, Any]:
    assert main(["diagnose", str(case), "--out", str(out), "--no-report", "--sham", "0", *options]) == 0
    found: dict[str, Any] = json.loads((out / "diagnosis.json").read_text())
    found.pop("time_limit", None)  # what has passed of it
    return found


def test_a_diagnosis_stays_inside_its_margins_and_says_where_they_end(case: Path, tmp_path: Path) -> None:
    """The share of missing codes is the only thing that decides on this rule: it ends the margin."""
    plain = diagnosed(case, tmp_path / "plain")
    assert not (tmp_path / "plain" / "margins.json").exists()
    assert diagnosed(case, tmp_path / "noted", "--margins") == plain
    facts = json.loads((tmp_path / "noted" / "margins.json").read_text())
    low, high = facts["margins"]["data.missing_share"]
    assert facts["rules"] == {} and low == pytest.approx(0.3, abs=0.07) and high is None
    for value, same in ((low * 1.01, True), (low * 0.99, False)):
        (tmp_path / "moved.toml").write_text(f"[data]\nmissing_share = {value}\n")
        moved = diagnosed(case, tmp_path / "moved", "--rules", str(tmp_path / "moved.toml"))
        assert moved.pop("rules") == {"data": {"missing_share": value}}
        assert (moved == plain) is same
    assert (moved["verdict"], plain["verdict"] == "data_fault") == ("data_fault", False)


def test_margins_of_an_earlier_diagnosis_do_not_stay_beside_another(case: Path, tmp_path: Path) -> None:
    diagnosed(case, tmp_path / "out", "--margins")
    diagnosed(case, tmp_path / "out")
    assert not (tmp_path / "out" / "margins.json").exists()


def test_a_stored_diagnosis_of_several_cases_knows_whether_it_has_margins() -> None:
    plain = Asked(0, 1, 60.0, False, False, None, False)
    noted_ = Asked(0, 1, 60.0, False, False, None, False, margins=True)
    assert "margins" not in settings_of(plain) and settings_of(noted_) == settings_of(plain) | {"margins": True}
