"""Accept a second effect beside a mode that the runs lack where outputs that share no sensor tell the same of it.

What a missing mode leaves unexplained is large, and many operators explain a little of it, each in its own way. What an
actuator does reaches every output with one value: it is an effect where groups of outputs, each alone with its own
predictor and prior, put it first and agree on its value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.beside import acts_beside, without
from aeolid.diagnose.run_prior.explain import Explanation, Found, rivals_of
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, Values, all_hypotheses
from aeolid.diagnose.run_prior.pair import Pair
from aeolid.diagnose.run_prior.proof import prove
from aeolid.diagnose.run_prior.search import Scored, Search

_MOST = 4  # effects that are asked about, the best on all outputs
_AROUND = (0.5, 0.7, 1.0, 1.4, 2.0)  # times the value on all outputs: where a group looks for its own


@dataclass(frozen=True, eq=False)
class Heard:
    """Hold what one group of outputs tells: its names in the fixed frame, and its table, best first."""

    names: tuple[str, ...]
    table: tuple[Scored, ...]


def with_replicated(
    pair: Pair, x: Explanation, units: Mapping[str, str], tick: Callable[[str], None]
) -> Explanation:  # fmt: skip
    """Return an explanation that is a missing mode alone with an effect of an input that several groups tell alike.

    The sealed part of those groups must bear it out. Cost: some 25 evaluations a group of outputs.
    """
    rules = in_force().run_prior
    if len(x.found) != 1 or x.found[0].mode is None:
        return x
    mode = x.found[0].mode
    beside = [s for s in x.table if acts_beside(s.hypothesis, mode.kind) and s.nats > rules.named_nats]
    asked = [s for s in beside if s.hypothesis.place.startswith("input:")][:_MOST]
    groups = [names for names in groups_of(pair) if mode.output not in names]
    if not asked or len(groups) < rules.agreeing_groups:
        return x
    heard = [Heard(names, _table(pair, names, asked, tick)) for names in groups]
    for s in asked:
        agreed = agreeing(s, heard)
        if len(agreed) >= rules.agreeing_groups:
            return _proven(pair, x, s, {n for h in agreed for n in h.names}, units, tick)
    return x


def groups_of(pair: Pair) -> list[tuple[str, ...]]:
    """Return the outputs by what they are read from, as names in the fixed frame: the blades of a set are one group."""
    single = len(pair.shown) - 3 * len(pair.blades)
    rest = range(single, len(pair.shown), 3)
    return [*((name,) for name in pair.shown[:single]), *(pair.shown[k : k + 3] for k in rest)]


def agreeing(asked: Scored, heard: Sequence[Heard]) -> list[Heard]:
    """Return the groups that put an effect first and have the value of the one that tells most, that one included.

    A group whose value lies at an end of what was looked through has none.
    """
    rules = in_force().run_prior
    least, room = rules.group_nats, rules.agreeing_ratio
    told = [(h, max(h.table, key=_worth)) for h in heard if h.table]
    told = [(h, s) for h, s in told if s.hypothesis.key == asked.hypothesis.key and s.nats > least and s.values]
    told = [(h, s) for h, s in told if _AROUND[0] < s.values[0] / asked.values[0] < _AROUND[-1]]
    if not told:
        return []
    most = max((s for _, s in told), key=lambda s: s.nats)
    if most.nats < rules.sure_group_nats:
        return []
    return [h for h, s in told if 1 / room < s.values[0] / most.values[0] < room]


def _worth(s: Scored) -> float:
    """Return what an effect gains, less what a richer form must gain over a simpler one."""
    return s.nats - in_force().run_prior.richer_nats * max(len(s.values) - 1, 0)


def _table(
    pair: Pair, names: tuple[str, ...], asked: Sequence[Scored], tick: Callable[[str], None]
) -> tuple[Scored, ...]:  # fmt: skip
    rest = without(pair, set(pair.shown) - set(names))
    if rest is None:
        return ()
    search = Search(rest)
    return tuple(search.refine(search.screen([_near(s) for s in asked], tick), tick))


def _near(s: Scored) -> Hypothesis:
    """Return a hypothesis that is looked for near the values that it has on all outputs."""
    grid = tuple(tuple(k * v for v in s.values[:1]) + s.values[1:] for k in _AROUND) if s.values else ((),)
    inside = tuple(v for v in grid if _within(s.hypothesis, v))
    return replace(s.hypothesis, grid=inside or (s.values,))


def _within(h: Hypothesis, values: Values) -> bool:
    return all(a <= v <= b for a, v, b in zip(h.low, values, h.high, strict=True))


def _proven(
    pair: Pair, x: Explanation, s: Scored, names: set[str], units: Mapping[str, str], tick: Callable[[str], None]
) -> Explanation:  # fmt: skip
    """Return the explanation with the effect as the groups together tell it, where their sealed part bears it out."""
    rest = without(pair, set(pair.shown) - names)
    assert rest is not None
    search = Search(rest)
    kin = [h for h in all_hypotheses(rest, dict(units)) if h.place == s.hypothesis.place]
    table = search.refine(search.screen(kin, tick), tick)
    best = max(table, key=_worth, default=None)
    if best is None or best.hypothesis.key != s.hypothesis.key or best.nats < in_force().run_prior.named_nats:
        return x
    found = Found(best, None, rivals_of(best, table), seen_in=rest)
    alone = replace(x, found=(found,), change=best.change, weight=search.base.weight)
    if prove(rest, alone, search.ridge).interval[0] <= in_force().evidence.proven_nats:
        return x
    return replace(x, found=(*x.found, found), table=(*x.table, *table), change=best.change)
