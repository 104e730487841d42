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
