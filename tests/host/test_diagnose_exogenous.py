"""Channels that the model does not use are offered to the catalogue, also where a logger lost rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from study_modules import load_study

from aeolid.diagnose.baseline.prepare import prepare
from aeolid.diagnose.data.case import load_case, make_case
from aeolid.diagnose.data.exogenous import exogenous_channels, with_exogenous
from aeolid.diagnose.hypotheses.parts import unused_channel
from aeolid.diagnose.pipeline import study
from aeolid.models import equations_file
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations, Output, Parameter, State
from aeolid.models.integrate import compile_equations
from aeolid.models.model_file import Signal
from aeolid.record import Channel, Record

rig = load_study("rigs/turbine")
CHANNELS = (
    Channel("push", "N", "input"), Channel("speed", "m/s", "output"), Channel("azimuth", "deg", "azimuth"),
    Channel("wind", "m/s", "scheduling"), Channel("note", "1", "ignore"),
)  # fmt: skip
ROWS = 200


def record(missing: Sequence[tuple[int, str]]) -> Record:
    """Return a recording without these samples, by row and channel; `row` is all of it."""
    values = np.random.default_rng(1).standard_normal((ROWS, len(CHANNELS)))
    for row, name in missing:
        values[row, [c.name == name or name == "row" for c in CHANNELS]] = np.nan
    return Record(0.1 * np.arange(ROWS), values, CHANNELS, 0.1, "monday", "")


def model() -> Equations:
    """Return a mass that is pushed."""
    state = State("v", "m/s", ex.parse("(push - v)/M", "v"), 0.0)
    output = Output("speed", "m/s", ex.parse("v", "speed"))
    mass = Parameter("M", 2.0, "kg")
    return Equations("mass", 0.0, (mass,), (state,), (output,), (Signal("push", "N"),), ("push",))


@pytest.mark.parametrize(
    ("missing", "kept"),
    [
        ([], {"time_s", "azimuth", "wind"}),
        ([(50, "row"), (51, "row"), (120, "row")], {"time_s", "azimuth", "wind"}),  # cut there in any case
        ([(50, "push"), (50, "wind")], {"time_s", "azimuth", "wind"}),
        ([(50, "wind")], {"time_s", "azimuth"}),  # it alone would cut the recording
        ([(50, "row"), (51, "azimuth")], {"time_s", "wind"}),
        ([(k, "push") for k in range(ROWS)], {"time_s"}),
    ],
)
def test_a_channel_counts_where_it_cuts_nothing_that_is_whole(
    missing: Sequence[tuple[int, str]], kept: set[str]
) -> None:
    assert {c.name for c in exogenous_channels([record(missing)], model())} == kept
    beside = {c.name for c in exogenous_channels([record([]), record(missing)], model())}
    assert beside == (kept if len(missing) < ROWS else {"time_s", "azimuth", "wind"})


def test_a_lost_row_takes_no_effect_of_the_rotor_away(tmp_path: Path) -> None:
    """Two of 6,000 rows were lost, and tower shadow, sea and all that turns with the rotor were never asked."""
    trial = next(t for t in rig.trials() if t.kind == "equations")
    folder = rig.write_case(tmp_path, replace(trial, roles=(("azimuth", "azimuth"),)), 1200, 3)
    path = folder / "recording.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:500], *lines[501:900], *lines[902:]]) + "\n")
    asked = {a.entry for a in prepare(load_case(folder)).hypotheses}
    assert {"tower_shadow", "mass_imbalance", "gravity_1p"} <= asked


def test_a_recorded_speed_tells_the_angle_up_to_where_it_began(tmp_path: Path) -> None:
    """Imbalances are lines of any phase; what asks for the blade that is up is not asked without an azimuth."""
    trial = next(t for t in rig.trials() if t.kind == "equations")
    asked = {}
    for roles in ((("azimuth", "azimuth"),), ()):
        folder = rig.write_case(tmp_path / str(len(roles)), replace(trial, roles=roles), 1200, 3)
        asked[len(roles)] = {a.entry for a in prepare(load_case(folder)).hypotheses}
    assert {"tower_shadow", "mass_imbalance", "aero_imbalance", "gravity_1p", "rotational_sampling"} <= asked[0]
    assert asked[0] == asked[1]


def hostile() -> Record:
    """Return a recording with channels whose names are letters to a reader, but no identifiers of equations."""
    names = ("temp_m²", "µ temp", "a b", "a_b")
    rows = record([])
    values = np.column_stack([rows.values, np.random.default_rng(2).standard_normal((ROWS, len(names)))])
    channels = (*rows.channels, *(Channel(n, "degC", "disturbance") for n in names))
    return replace(rows, values=values, channels=channels)


def test_names_beyond_ascii_become_symbols_that_equations_read_as_they_stand() -> None:
    found = exogenous_channels([hostile()], model())
    symbols = [c.symbol for c in found]
    assert len(found) == 7 and len(set(symbols)) == 7
    for symbol in symbols:
        assert ex.names_in(ex.parse(f"2*{symbol}", symbol)) == {symbol}


def test_effects_of_channels_with_such_names_stay_apart_in_one_model() -> None:
    """All of them at once, as several effects of one diagnosis are."""
    case = make_case([hostile()], model(), title="mass", source="mass", sha256="")
    site = prepare(case).site
    extended = with_exogenous(site.model, site.exogenous)
    for number, channel in enumerate(site.exogenous):
        places = unused_channel.entrances(site)
        values = site.extra[:, number]
        told = unused_channel.attach(site, "temperature", [channel], "acts")
        assert len(told) == (1 if places and np.ptp(values) > 0 else 0)
        for attachment in told:
            extended = attachment.edit(extended)
    parameters = [p.name for p in extended.parameters]
    assert len(set(parameters)) == len(parameters) and all(n.isascii() and n.isidentifier() for n in parameters)
    compile_equations(extended)


WINDY = """
[model]
name = "mass in the wind"
time = "continuous"
[parameters]
M = { value = 2.0, unit = "kg" }
b = { value = 0.8, unit = "N s/m", min = 0.1, max = 5, free = true }
[[state]]
name = "v"
unit = "m/s"
derivative = "(push + 0.5*wind - b*v)/M"
initial = { value = 0.0, free = true }
[[state]]
name = "wind"
unit = "m/s"
derivative = "-0.5*wind"
initial = { value = 0.0, free = true }
[[output]]
name = "acceleration"
unit = "m/s^2"
equation = "(push + 0.5*wind - b*v)/M"
[[output]]
name = "speed"
unit = "m/s"
equation = "v"
"""


def in_the_wind(gain: float, rows: int = 600, fine: int = 10) -> Record:
    """Return a recording in which a mast's wind, held as the push is, is a part of the wind at the mass.

    The logger reads the outputs at the end of each sample, before the push and the mast's wind are new.
    """
    random = np.random.default_rng(5)
    push, mast = (np.zeros(rows) for _ in range(2))
    for k in range(1, rows):
        push[k] = random.choice([-2.0, 2.0]) if k % 7 == 0 else push[k - 1]
        mast[k] = 0.95 * mast[k - 1] + 0.5 * random.standard_normal()
    v, wind, step, y = 0.0, 0.0, 0.1, np.zeros((rows, 2))
    for k in range(rows):
        p, m = (push[max(k - 1, 0)], mast[max(k - 1, 0)])
        y[k] = (p + 0.5 * (wind + gain * m) - 0.8 * v) / 2, v
        for _ in range(fine):
            v += step / fine * (push[k] + 0.5 * (wind + gain * mast[k]) - 0.8 * v) / 2
            wind += step / fine * -0.5 * wind + 0.9 * np.sqrt(step / fine) * random.standard_normal()
    y += [0.02, 0.005] * random.standard_normal(y.shape)
    channels = (
        Channel("push", "N", "input"), Channel("acceleration", "m/s^2", "output"), Channel("speed", "m/s", "output"),
        Channel("mast", "m/s", "disturbance"),
    )  # fmt: skip
    return Record(step * np.arange(rows), np.column_stack([push, y, mast]), channels, step, "windy.csv", "")


@pytest.mark.diagnosis
@pytest.mark.parametrize("gain", [0.4, pytest.param(0.0, marks=pytest.mark.nightly)])
def test_a_recorded_wind_is_a_part_of_the_one_that_nobody_measured(gain: float, tmp_path: Path) -> None:
    """One gain for all that the wind does; read between its rows as the push is, else the outputs see it too early."""
    (tmp_path / "model.toml").write_text(WINDY)
    model = equations_file.load(tmp_path / "model.toml")
    case = make_case([in_the_wind(gain)], model, title="mass", source="mass", sha256="")
    found = study(case, sham=0, seed=0, progress=lambda words, share: None)
    if gain == 0:
        assert found.winner is None
        return
    assert found.winner is not None and found.winner.key == "missing_disturbance mast, in wind"
    value, deviation = found.winner.values[found.winner.key]["gain"]
    assert abs(value - gain) < 3 * deviation < 0.5 * gain
    assert found.proof is not None and found.proof.interval[0] > 0
