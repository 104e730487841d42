"""The wind inside a model: where it is found, what feels it, and turbulence that the blades sample."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from study_modules import load_study
from test_catalogue_turbine import site_of

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.data.case import load_case
from aeolid.diagnose.hypotheses.entries import rotational_sampling
from aeolid.diagnose.hypotheses.parts import rotor
from aeolid.diagnose.hypotheses.parts.wind import wind
from aeolid.diagnose.scoring.scores import score_bank
from aeolid.models import expressions as ex
from aeolid.models.integrate import compile_equations, simulate

rig = load_study("rigs/turbine")
KINDS = ("equations", "state_space")


def trial(kind: str, **effect: float):  # type: ignore[no-untyped-def]
    return rig.Trial("wind", kind, rig.Effect(**effect))


@pytest.mark.parametrize("kind", KINDS)
def test_more_wind_is_felt_as_the_wind_is(kind: str, tmp_path: Path) -> None:
    """A constant added to a wind that stays where it starts is the same as starting there."""
    site = site_of(tmp_path, trial(kind))
    found = wind(site, "tower_fore_aft")
    assert found is not None
    name = found.location.removeprefix("state:")
    lasting = {name: ex.parse(name, "a wind that lasts")} if site.model.sample_time_s else {name: ex.parse("0.0", "")}
    states = tuple(replace(s, derivative=lasting.get(s.name, s.derivative)) for s in site.model.states)
    model = replace(site.model, states=states)
    blown = rotor.push(model, found.add, ex.parse("0.7", "more"), "more")
    start = model.x0 + 0.7 * np.array([s.name == name for s in model.states])
    want = simulate(compile_equations(model), site.u, model.theta, start, site.step)
    got = simulate(compile_equations(blown), site.u, model.theta, model.x0, site.step)
    np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-9)
    assert np.std(want[:, 0]) > 0


@pytest.mark.parametrize("kind", KINDS)
def test_its_size_moves_the_output_by_its_spread(kind: str, tmp_path: Path) -> None:
    site = site_of(tmp_path, trial(kind))
    found = wind(site, "tower_fore_aft")
    assert found is not None
    at, name = site.output_names.index("tower_fore_aft"), found.location.removeprefix("state:")
    compiled, start = compile_equations(site.model), site.model.x0
    moved = start + found.size * np.array([s.name == name for s in site.model.states])
    first = [simulate(compiled, site.u[:2], site.model.theta, x, site.step)[0, at] for x in (start, moved)]
    assert abs(first[1] - first[0]) == pytest.approx(np.std(site.y[:, at]), rel=0.05)  # the load is a curve


def test_a_force_on_one_body_is_no_wind(tmp_path: Path) -> None:
    """Without its wind the model still has unmeasured forces, each on a body of its own."""
    site = site_of(tmp_path, trial("equations"))
    found = wind(site, "tower_fore_aft")
    assert found is not None
    name = found.location.removeprefix("state:")
    calm = {name: ex.parse("0.0", "calm")}
    model = site.model
    for part in ("states", "outputs", "auxiliaries"):
        key = "derivative" if part == "states" else "equation"
        replaced = (replace(x, **{key: ex.substitute(getattr(x, key), calm)}) for x in getattr(model, part))
        model = replace(model, **{part: tuple(replaced)})
    assert any(s.name.startswith("unmeasured_") for s in model.states)
    assert wind(replace(site, model=model), "tower_fore_aft") is None


@pytest.mark.parametrize("kind", KINDS)
def test_sampled_turbulence_stands_out_as_wind_and_not_as_a_thrust(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Torque and thrust feel the same eddies; as a thrust alone the rotor's speed contradicts them."""
    prepared = prepare(load_case(rig.write_case(tmp_path, trial(kind, sampling=0.15), 3000, 3)))
    (as_wind,) = rotational_sampling.ENTRY.attach(prepared.site)
    monkeypatch.setattr(rotational_sampling, "wind", lambda site, output: None)
    (as_thrust,) = rotational_sampling.ENTRY.attach(prepared.site)
    assert as_wind.location["entry"].startswith("state:")
    blown, pushed = (score_bank(prepared, [a], 1) for a in (as_wind, as_thrust))
    assert blown.rows[0].z > 2 * blown.limit(blown.rows[0])  # 10.9 and 8.0, of a threshold near 2.3 for one alone
    assert blown.rows[0].z > 3 * pushed.rows[0].z  # 0.9 and 1.8
