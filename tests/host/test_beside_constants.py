"""Which effect leads once a linear model's constants are settled beside each of them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from aeolid.diagnose.selection import beside_constants, several
from aeolid.diagnose.selection.beside_constants import settled_beside_constants

CONSTANT = SimpleNamespace(entry="parameter_error", key="frequency", location={"entry": "mode:2.4 Hz"}, beside={})
PREPARED: Any = SimpleNamespace(linear=1, surrogate=None, deadline=SimpleNamespace(skips=lambda what: False))


def single(entry: str, score: float, place: str = "mode:2.4 Hz", **more: Any) -> Any:
    attachment = SimpleNamespace(entry=entry, key=entry, location={"entry": place}, beside={})
    usual = {"plausible": True, "complete": True, "unlisted": False, "values": {entry: {"k3": (1.0, 0.1)}}}
    return SimpleNamespace(attachments=(attachment,), key=entry, score=score, **(usual | more))


def constant(score: float, change: float = -0.015) -> Any:
    found = single("parameter_error", score, values={"frequency": {"frequency_change": (change, 0.001)}})
    found.attachments = (CONSTANT,)
    return found


@pytest.fixture
def settle(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Settle with constants that add so many nats to each effect; `apart`: whether the data tell the sets apart."""

    def run(first: Any, others: list[Any], added: dict[str, float], apart: bool = True, model: Any = PREPARED) -> Any:
        def grown(prepared: Any, chosen: Any, rows: Any, helps: Any) -> Any:
            gain = added.get(chosen.attachments[0].entry)
            if gain is None or CONSTANT in chosen.attachments[1:]:
                return None
            told = {**chosen.values, "frequency": {"frequency_change": (-0.015, 0.001)}}
            return SimpleNamespace(attachments=(*chosen.attachments, CONSTANT), score=chosen.score + gain, values=told)

        monkeypatch.setattr(beside_constants, "_constants", lambda *_: [])
        monkeypatch.setattr(beside_constants, "grown", grown)
        monkeypatch.setattr(beside_constants, "tells_apart", lambda one, other: apart)
        return settled_beside_constants(model, [first], others, 1)

    return run


STOPS, SPRING = single("end_stop", 118.0), single("cubic_stiffness", 91.0)


def test_the_effect_that_leads_beside_constants_leads(settle: Any) -> None:
    """Stops had 118 nats and 129 beside the frequency, the hardening spring 91 and 133: it was the spring."""
    chain, others = settle(STOPS, [STOPS, SPRING], {"end_stop": 11.0, "cubic_stiffness": 42.0})
    assert [c.attachments[0].entry for c in chain] == ["cubic_stiffness"] * 2 and chain[0] is SPRING and others == ()
    chain, others = settle(STOPS, [STOPS, SPRING], {"end_stop": 11.0, "cubic_stiffness": 42.0}, apart=False)
    assert [(a.replaces, a.attachment.key) for a in others] == [("cubic_stiffness", "end_stop")]


@pytest.mark.parametrize(
    "other",
    [
        single("cubic_stiffness", 50.0), single("cubic_stiffness", 91.0, "mode:9 Hz"),
        single("cubic_stiffness", 91.0, plausible=False), single("cubic_stiffness", 91.0, unlisted=True),
    ],
    ids=["not half of it", "elsewhere", "refused", "a form"],
)  # fmt: skip
def test_only_what_may_lead_at_its_place_is_asked(settle: Any, other: Any) -> None:
    chain, others = settle(STOPS, [STOPS, other], {"end_stop": 11.0, "cubic_stiffness": 420.0})
    assert [c.attachments[0].entry for c in chain] == ["end_stop"] and others == ()


def test_constants_alone_lead_where_they_are_as_good(settle: Any) -> None:
    loop = single("bouc_wen_hysteresis", 535.0)
    chain, others = settle(loop, [loop, constant(506.0)], {"parameter_error": 60.0})
    assert all(a is CONSTANT for c in chain for a in c.attachments) and others == ()
    chain, _ = settle(loop, [loop, constant(506.0)], {"parameter_error": 10.0})
    assert chain == [loop]
    chain, _ = settle(loop, [loop, constant(506.0)], {"parameter_error": 10.0}, apart=False)
    assert chain[0].attachments == (CONSTANT,)  # 167 nats for 163 of a frequency 1.2 % off


def test_equations_and_wrong_values_are_left_as_they_are(settle: Any) -> None:
    added = {"end_stop": 11.0, "cubic_stiffness": 42.0}
    equations: Any = SimpleNamespace(linear=None, surrogate=None)
    assert settle(STOPS, [STOPS, SPRING], added, model=equations) == ([STOPS], ())
    slight = constant(118.0)
    assert settle(slight, [slight, SPRING], added) == ([slight], ())


@pytest.mark.parametrize(("change", "first"), [(-0.015, "parameter_error"), (-0.08, "structural_mode")])
def test_a_constant_that_is_a_little_off_comes_before_further_effects(
    monkeypatch: pytest.MonkeyPatch, change: float, first: str
) -> None:
    """Beside a rope's friction a mass on a spring gained more than each of two frequencies 1.5 % off, and was named."""
    found = {"mode": single("structural_mode", 90.0), "frequency": constant(60.0, change)}
    best = grown_with(monkeypatch, found)
    assert best is not None and best.attachments[-1].entry == first


@pytest.mark.parametrize(("sticks", "named"), [(True, "stiction"), (False, "coulomb_friction")])
def test_another_of_a_family_is_added_where_the_best_has_values_that_cannot_be(
    monkeypatch: pytest.MonkeyPatch, sticks: bool, named: str
) -> None:
    """Stiction that sticks by none of its friction scored 0.1 more than dry friction, and neither was added."""
    friction = single("coulomb_friction", 60.0)
    best = grown_with(monkeypatch, {"stiction": single("stiction", 61.0, plausible=sticks)}, {"dry": friction})
    assert best is not None and best.attachments[-1].entry == named


def grown_with(monkeypatch: pytest.MonkeyPatch, found: dict[str, Any], instead: dict[str, Any] | None = None) -> Any:
    """Return the set that one more effect of those found grows a hardening spring to; instead: others of a family."""
    every = {c.attachments[-1].key: c for c in (*found.values(), *(instead or {}).values())}
    for c in every.values():
        c.attachments = (SPRING.attachments[0], *c.attachments)
        c.values, c.beyond, c.predictor, c.fit = {**SPRING.values, **c.values}, lambda w, c=c: c, None, None
    prepared: Any = SimpleNamespace(
        deadline=SimpleNamespace(skips=lambda what: False, doing=lambda what: None),
        only=lambda attachments: SimpleNamespace(extended=None, free=None, key=attachments[-1].key),
    )
    monkeypatch.setattr(several, "refit", lambda stage, *_, **__: every[stage.key])
    for name, value in (("select_density", None), ("carry_point", None), ("as_rows", []), ("replace", None)):
        monkeypatch.setattr(several, name, lambda *_, value=value, **__: value)
    monkeypatch.setattr(several, "is_worth_a_name_beside", lambda *_: True)
    monkeypatch.setattr(several, "survives_control", lambda *_: True)
    monkeypatch.setattr(several, "leading", lambda sets: max(sets, key=lambda c: c.score, default=None))
    winner: Any = SimpleNamespace(
        attachments=SPRING.attachments, key="friction", fit=SimpleNamespace(point=None),
        predictor=SimpleNamespace(compiled=SimpleNamespace(model=None)),
    )  # fmt: skip
    rows, others = ([SimpleNamespace(attachment=c.attachments[-1]) for c in s.values()] for s in (found, instead or {}))
    return several.grown(prepared, winner, rows, lambda fewer, more: True, instead=others)
