"""Laws of a body that is driven through play: two inertias with a dead zone between them, solved here by themselves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import aeolid.diagnose.candidates.race as race
from aeolid.diagnose.hypotheses.parts.base import Attachment, Site
from aeolid.diagnose.hypotheses.parts.driven_through_play import driven_through_play
from aeolid.diagnose.structure.anatomy import motions_of_equations
from aeolid.models import equations_file
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate

Array = NDArray[np.float64]
INERTIA, STIFF, DAMPER, STEP = 0.03, 10.0, 0.8, 0.01  # kg m^2, N m/rad, N m s/rad, s
SHARE, WIDTH, FILM, DRAG = 0.4, 0.05, 80.0, 2.0  # of the inertia; rad; 1/s; 1/s
MODEL = """[model]
name = "geared motor"
[parameters]
J = { value = 0.03, unit = "kg m^2" }
k = { value = 10.0, unit = "N m/rad", min = 2.0, max = 50.0, free = true }
d = { value = 0.8, unit = "N m s/rad", min = 0.1, max = 4.0, free = true }
[[input]]
name = "command"
unit = "rad"
[[state]]
name = "q"
derivative = "w"
unit = "rad"
[[state]]
name = "w"
derivative = "(k*(command - q) - d*w)/J"
unit = "rad/s"
[[output]]
name = "angle"
equation = "q"
unit = "rad"
[[output]]
name = "speed"
equation = "w"
unit = "rad/s"
"""


def motor(folder: Path) -> Equations:
    path = folder / "model.toml"
    path.write_text(MODEL)
    return equations_file.load(path)


def plays(model: Equations, **context: str) -> list[Attachment]:
    u, y = np.random.default_rng(1).standard_normal((4000, 1)), np.random.default_rng(2).standard_normal((4000, 2))
    motions = tuple(motions_of_equations(model, np.ones(2), np.full(2, 5.0)))
    site = Site(
        model, None, motions, STEP, STEP, u, y, ("command",), ("angle", "speed"), model.symbols, (),
        np.zeros((4000, 0)), context,
    )  # fmt: skip
    return driven_through_play(site)


def commands(samples: int) -> Array:
    return np.repeat(np.random.default_rng(3).uniform(-0.4, 0.4, samples // 25 + 1), 25)[:samples]


def two_bodies(command: Array, step: float) -> Array:
    """Return angle and speed (N, 2) of the load, with the servo at the motor and what touches between the two."""
    load, drive, contact = SHARE * INERTIA, (1 - SHARE) * INERTIA, 2.5 / STEP

    def rates(t: float, z: Array, u: float) -> Array:
        q, v, p, w = z
        x, rate = p - q, w - v
        touches = np.clip((abs(x) - WIDTH / 2) / (0.02 * WIDTH + 1e-9), 0.0, 1.0)
        pull = contact**2 * (x - np.clip(x, -WIDTH / 2, WIDTH / 2)) + (contact * touches + FILM) * rate
        torque = INERTIA * SHARE * (1 - SHARE) * pull
        drag = DRAG * load  # the model's damper acts at the drive, but for what is the load's own
        return np.array([v, (torque - drag * v) / load, w, (STIFF * (u - p) - DAMPER * w + drag * w - torque) / drive])

    z, found = np.zeros(4), np.empty((len(command), 2))
    for i, u in enumerate(command):
        found[i] = z[:2]
        z = solve_ivp(rates, (0.0, step), z, args=(u,), rtol=1e-8, atol=1e-11, max_step=step / 2).y[:, -1]
    return found


def run(model: Equations, a: Attachment, values: dict[str, float], command: Array, step: float) -> Array:
    compiled = compile_equations(a.edit(model))
    set_to = {s.name: values[s.name.split("_")[-1]] for s in a.slots}
    theta = np.array([set_to.get(p.name, p.value) for p in compiled.model.parameters])
    return simulate(compiled, command[:, None], theta, compiled.model.x0, step)


def test_the_load_follows_two_inertias_with_a_dead_zone_between_them(tmp_path: Path) -> None:
    """At a fortieth of the row's step: across the corners of the contact the integration is of first order."""
    model, command, step = motor(tmp_path), np.repeat(commands(100), 40), STEP / 40
    play = plays(model)[0]
    assert play.key == "backlash state:w" and play.rugged
    true = {"blend": 1.0, "width": WIDTH, "share": SHARE, "film": FILM, "drag": DRAG}
    exact = two_bodies(command, step)
    scale = np.abs(exact).max(axis=0)
    np.testing.assert_allclose(run(model, play, true, command, step) / scale, exact / scale, atol=1e-3)
    apart = np.abs(run(model, play, true | {"blend": 0.0}, command, step) - exact).max(axis=0) / scale
    assert np.all(apart > 0.05)  # the rigid one is another machine


def test_no_play_is_looked_for_where_none_can_be(tmp_path: Path) -> None:
    """On a turbine, in discrete time, and where no input moves the body, or no output reads it."""
    model = motor(tmp_path)
    assert len(plays(model)) == 1
    assert plays(model, machine="wind turbine") == []
    assert plays(replace(model, sample_time_s=STEP)) == []
    still = replace(model, states=(model.states[0], replace(model.states[1], derivative=model.states[0].derivative)))
    assert plays(still) == []
    unread = tuple(replace(o, equation=model.states[0].derivative) for o in model.outputs)
    assert len(plays(replace(model, outputs=unread))) == 1  # the speed alone shows the body, too


@pytest.mark.parametrize(("width", "told"), [(1e-4, False), (0.03, False), (0.3, True)])
def test_a_play_that_a_contact_stands_for_is_none(width: float, told: bool, tmp_path: Path) -> None:
    """A complete gear, its constants 3 % off, had a play of 1.9 mrad where it moves by 370; here it moves by 3 rad."""
    said = plays(motor(tmp_path))[0].credible({"width": width, "share": 0.5})
    assert (said == "") is told


@pytest.mark.parametrize(("rugged", "gain", "again"), [(True, 40.0, True), (True, 20.0, False), (False, 40.0, False)])
def test_a_rugged_fit_starts_from_the_simulation_too(
    rugged: bool, gain: float, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A gear's play, 204 nats one step ahead, has 1,265 from there; what is far behind costs no seconds."""
    asked: list[bool] = []

    def begin(prepared: Any, base: Any, rows: Any, simulated: bool = False) -> Any:
        asked.append(simulated)
        return SimpleNamespace(gain=90.0)

    monkeypatch.setattr(race, "begin", begin)
    own = SimpleNamespace(key="backlash state:w", rugged=rugged)
    begun: Any = SimpleNamespace(
        attachments=(own,), gain=gain, base=None,
        prepared=SimpleNamespace(deadline=SimpleNamespace(skips=lambda what: False)),
    )  # fmt: skip
    row: Any = SimpleNamespace(attachment=own)
    found = race._simulated_too(begun, [row], 100.0)
    assert (found.gain, asked) == ((90.0, [True]) if again else (gain, []))
