"""A second effect beside a missing mode: what groups of outputs must tell alike, as tables of numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from aeolid.diagnose.run_prior.hypotheses import Hypothesis
from aeolid.diagnose.run_prior.pair import NOTHING, Pair
from aeolid.diagnose.run_prior.replicated import Heard, agreeing, groups_of
from aeolid.diagnose.run_prior.search import Scored

DELAY, SECOND = "transport_delay input:pitch", "actuator_second_order input:pitch"


def scored(key: str, nats: float, *values: float) -> Scored:
    """Return an effect with its gain and values."""
    entry, place = key.split()
    names = tuple(f"v{k}" for k in range(len(values)))
    h = Hypothesis(entry, place, names, names, values, values, (values,), lambda v: NOTHING)
    return Scored(h, values, nats, nats, 0.1)


def heard(*tables: tuple[Scored, ...]) -> list[Heard]:
    """Return what groups a, b, c … tell."""
    return [Heard((name,), table) for name, table in zip("abcdef", tables, strict=False)]


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        # one delay in all outputs
        (((scored(DELAY, 186, 0.301),), (scored(DELAY, 35, 0.315),)), "ab"),
        # the output that swings in the mode tells another one, and has no say
        (((scored(DELAY, 29, 0.223),), (scored(DELAY, 35, 0.315),), (scored(DELAY, 186, 0.301),)), "bc"),
        # each output has a value of its own: what a missing mode leaves, a little of it explained
        (((scored(DELAY, 22, 0.2),), (scored(DELAY, 23, 0.28),), (scored(DELAY, 99, 0.38),)), "c"),
        # both ran to the end of what was looked through
        (((scored(DELAY, 48, 1.2),), (scored(DELAY, 25, 1.2),)), ""),
        # a group that puts another effect first says nothing of this one
        (((scored(SECOND, 99, 0.3, 1.2), scored(DELAY, 60, 0.3)), (scored(DELAY, 35, 0.3),)), "b"),
        # too little, or nothing at all, is not told
        (((scored(DELAY, 186, 0.3),), (scored(DELAY, 14, 0.3),), ()), "a"),
        ((), ""),
        # a richer form does not take the first place by what its second value gains
        (((scored(SECOND, 40, 0.3, 1.2), scored(DELAY, 35, 0.3)), (scored(DELAY, 60, 0.31),)), "ab"),
    ],
)
def test_groups_agree_on_one_value(tables: tuple[tuple[Scored, ...], ...], told: str) -> None:
    assert "".join(h.names[0] for h in agreeing(scored(DELAY, 131, 0.299), heard(*tables))) == told


def test_blades_of_a_set_are_one_group() -> None:
    shown = ("speed", "fore_aft", "flap_collective", "flap_cosine", "flap_sine")
    pair = cast(Pair, SimpleNamespace(shown=shown, blades=((2, 3, 4),)))
    assert groups_of(pair) == [("speed",), ("fore_aft",), shown[2:]]
    bare: Any = SimpleNamespace(shown=shown[:2], blades=())
    assert groups_of(bare) == [("speed",), ("fore_aft",)]
