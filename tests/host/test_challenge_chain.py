"""Our own plants behind a measurement chain: what it leaves alone, what it changes, and what answers tell of it."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aeolid.challenge.chain import NONE, Chain
from aeolid.challenge.draw import Draw, _late_enough, build
from aeolid.challenge.menu_turbine import singles
from aeolid.challenge.models import PLANTS
from aeolid.challenge.plants import Setup, simulate
from aeolid.challenge.worth import discrete, linearise
from aeolid.challenge.write import VERSION, answer_of, make, names_of, open_answers, write_case
from aeolid.cli.main import main

SAMPLES = 600


def calm(name: str, chain: Chain) -> Setup:
    """Return a plant in the open loop that nothing disturbs."""
    plant = PLANTS[name]
    outputs = tuple(c.name for c in plant.outputs)
    return Setup(plant, plant.physics, plant.physics, outputs=outputs, gusts=0.0, chain=chain)


@pytest.mark.parametrize("name", ["spring", "turbine"])
def test_a_chain_that_does_nothing_leaves_every_bit(name: str) -> None:
    plain, passed = (simulate(calm(name, chain), SAMPLES, 4) for chain in (NONE, Chain()))
    assert plain.keys() == passed.keys()
    for column, values in plain.items():
        np.testing.assert_array_equal(passed[column], values, err_msg=column)


def test_an_analogue_command_acts_between_its_samples() -> None:
    """Filters of inputs and outputs of a linear plant commute: straight lines between samples explain it, not steps.

    A hold comes half a sample late; lines err by the curvature of a signal below half of the band, which is less.
    """
    setup = calm("shaft", Chain(analogue=True, corner=0.4))
    seen = simulate(setup, SAMPLES, 5)
    model, parts = linearise(setup, setup.base), 20
    A, B, _ = discrete(model, setup.plant.step_s / parts)
    u = seen["voltage"]
    lines = np.interp(np.arange(SAMPLES * parts) / parts, np.arange(SAMPLES), u)
    errors = {}
    for name, acting in (("lines", lines), ("held", np.repeat(u, parts))):
        x, found = np.zeros(len(A)), []
        for k, value in enumerate(acting):
            if k % parts == 0:
                found.append(model.C @ x)
            x = A @ x + B[:, 0] * value
        errors[name] = np.std(np.array(found)[:, 1] - seen["load_speed"])
    noise = setup.plant.outputs[1].noise
    assert errors["lines"] ** 2 - noise**2 < 0.25 * (errors["held"] ** 2 - noise**2)


def test_imperfections_are_small_and_told_with_what_matters(tmp_path: Path) -> None:
    draw = build("null", (), 44, 1000, chained=True)
    answer = answer_of(draw, 1000)
    off = np.array(list(answer["imperfections"]["declared"].values()))
    assert answer["matters"] == [] and np.all((np.abs(off - 1) >= 0.01) & (np.abs(off - 1) <= 0.03))
    assert draw.setup.truth == draw.setup.base != draw.setup.believed.base
    write_case(tmp_path / "case", draw, 1000)
    rows = (tmp_path / "case" / "recording.csv").read_text().count("\n") - 1
    assert 1000 - draw.setup.chain.lost == rows


def test_without_a_chain_nothing_is_drawn_for_it() -> None:
    draw = build("null", (), 44, 1000)
    assert draw.setup.chain is NONE and not draw.setup.off and not draw.setup.weak and draw.runs == 1
    assert "chain" not in answer_of(draw, 1000)
    assert draw.setup.believed == replace(draw.setup, truth=draw.setup.base)


def test_some_cases_are_many_short_recordings(tmp_path: Path) -> None:
    draw = next(d for d in (build("null", (), s, 3000, chained=True) for s in range(40)) if d.runs > 1)
    write_case(tmp_path / "case", draw, 3000)
    told = tomllib.loads((tmp_path / "case" / "case.toml").read_text())["recordings"]["files"]
    assert told == names_of(draw.runs) and 6 <= draw.runs <= 12
    tables = [(tmp_path / "case" / name).read_text() for name in told]
    assert len(set(tables)) == draw.runs and all(t.count("\n") <= 3000 // draw.runs + 1 for t in tables)


@pytest.mark.parametrize("what", ["drive lags", "drive rings", "drive is late", "clock offset"])
def test_what_a_chain_makes_late_too_is_hidden_only_where_it_is_later(what: str) -> None:
    """Late by less than a sample in all outputs is a habit of the recording, whatever makes it so."""
    item = next(i for i in singles() if i.plant == "shaft" and i.what == what)
    for chain, least in ((NONE, 0.0), (Chain(corner=0.4), 1.5), (Chain(analogue=True), 2.0)):
        draw = Draw("single", (item,), calm("shaft", chain), 0, "equations", 1, (), None)
        strength = _late_enough(draw, 0.5)
        assert item.quantity is not None
        label, value = item.quantity
        told = abs(value(item.put(draw.setup, strength, 0)))
        late = 2 * 0.7 / told if label == "omega_rad_s" else told
        assert late >= least * draw.setup.plant.step_s
        assert (strength == 0.5) is (chain is NONE)


def test_the_command_line_offers_both(tmp_path: Path) -> None:
    words = ["challenge", "make", "--cases", "2", "--seed", "8", "--samples", "1000"]
    assert main([*words, str(tmp_path / "full")]) == 0
    assert main([*words, str(tmp_path / "none"), "--chain", "none"]) == 0
    make(tmp_path / "again", cases=2, seed=8, samples=1000)
    for folder, chain in (("full", True), ("none", False), ("again", True)):
        found = open_answers(tmp_path / folder)
        assert found["settings"]["chain"] is chain and found["settings"]["version"] == VERSION
        assert all(("chain" in a) is chain for a in found["answers"].values())
    full, again = ((tmp_path / f / "seal.json").read_bytes() for f in ("full", "again"))
    assert full == again
    assert main([*words, str(tmp_path / "x"), "--chain", "half"]) == 2
    assert main([*words, str(tmp_path / "x"), "--chain", "none", "--physics", "foreign"]) == 2
