"""Look for a second effect beside a mode that the runs lack, in the outputs that hardly show the mode.

A run without a mode says nothing of an output that swings in it, whatever an actuator does; the other outputs do. What
acts on them through the mode is told by the mode: a drive train that twists hands the generator's torque on as a
second-order drive would.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aeolid.diagnose.rules import in_force
from aeolid.diagnose.run_prior.explain import Explanation, Found, chosen, limit_of, rivals_of
from aeolid.diagnose.run_prior.hypotheses import Hypothesis, all_hypotheses
from aeolid.diagnose.run_prior.modal import Modal
from aeolid.diagnose.run_prior.pair import Pair, Side
from aeolid.diagnose.run_prior.proof import prove
from aeolid.diagnose.run_prior.resonances import SEEN, resonances
from aeolid.diagnose.run_prior.search import Scored, Search

_PLACES = ("input:", "rotor")  # of effects that other outputs show as well as the mode's own
_THROUGH = {"drivetrain_torsion": re.compile(r"input:.*(torque|tq)")}  # places that act through a mode


def with_beside(
    pair: Pair, x: Explanation, context: Mapping[str, Any], units: Mapping[str, str], tick: Callable[[str], None]
) -> Explanation:  # fmt: skip
    """Return an explanation that is a missing mode alone with a second effect, where the sealed part bears it out."""
    rules = in_force().run_prior
    if len(x.found) != 1 or x.found[0].mode is None:
        return x
    mode = x.found[0].mode
    rest = without(pair, {mode.output, *mode.outputs})
    if rest is None:
        return x
    search = Search(rest)
    limit = limit_of(rest, search.unsteady())
    if search.lost <= limit:
        return x
    own = [h for h in all_hypotheses(rest, dict(units)) if acts_beside(h, mode.kind)]
    towers = [] if mode.kind != SEEN else resonances(rest, Modal((), (), ()), units, {}, context)
    best, table, search = _explained(search, own, towers, tick)
    if best is None or best.hypothesis.entry == SEEN:
        return x
    if best.weight < max(rules.held_weight, search.base.weight):
        return x  # what brings the run back makes it count more; lines of a mode that these outputs still show do not
    if best.nats < rules.explained_share * search.lost or search.lost <= limit:
        return x
    found = Found(best, None, rivals_of(best, table), seen_in=rest)
    alone = replace(x, found=(found,), change=best.change.after(search.found), weight=search.base.weight)
    if prove(rest, alone, search.ridge).interval[0] <= in_force().evidence.proven_nats:
        return x
    return replace(x, found=(*x.found, found), table=(*x.table, *table), change=best.change)


def acts_beside(h: Hypothesis, kind: str) -> bool:
    """Tell whether what a hypothesis does reaches other outputs by another way than through a mode of a kind."""
    through = _THROUGH.get(kind)
    return h.place.startswith(_PLACES) and (through is None or through.search(h.place.lower()) is None)


def _explained(
    search: Search, own: Sequence[Hypothesis], towers: Sequence[Hypothesis], tick: Callable[[str], None]
) -> tuple[Scored | None, list[Scored], Search]:  # fmt: skip
    """Return the best effect, behind what the missing tower itself does to these outputs where that comes first."""
    table = search.refine(search.screen([*own, *towers], tick), tick)
    best = chosen(search, table, search.lost)
    if best is None or best.hypothesis.entry != SEEN:
        return best, table, search
    behind = Search(search.pair, best.change)
    more = behind.refine(behind.screen(own, tick), tick)
    return chosen(behind, more, behind.lost), more, behind


def without(pair: Pair, hidden: Collection[str]) -> Pair | None:
    """Return a pair without outputs, by their names in the fixed frame; blades go as a set. None where none is left."""
    turning = {j for places in pair.blades for j in places}
    single = [j for j in range(len(pair.outputs)) if j not in turning]
    kept = [j for k, j in enumerate(single) if pair.shown[k] not in hidden]
    columns = [k for k, j in enumerate(single) if j in kept]
    sets = []
    for k, places in enumerate(pair.blades):
        parts = [len(single) + 3 * k + i for i in range(3)]
        if not any(pair.shown[p] in hidden for p in parts):
            sets.append(places)
            columns += parts
    if not columns:
        return None
    left = sorted([*kept, *(j for s in sets for j in s)])
    held = pair.held
    chosen_columns = np.r_[np.arange(held), held + np.array(columns)]

    def side(s: Side) -> Side:
        return replace(s, y=s.y[:, left])

    return replace(
        pair, outputs=tuple(pair.outputs[j] for j in left), shown=tuple(pair.shown[k] for k in columns),
        recordings=tuple(map(side, pair.recordings)), runs=tuple(map(side, pair.runs)),
        blades=tuple(tuple(left.index(j) for j in s) for s in sets),
        offset=pair.offset[:, chosen_columns], scale=pair.scale[chosen_columns],
        noise=None if pair.noise is None else pair.noise[columns],
    )  # fmt: skip
