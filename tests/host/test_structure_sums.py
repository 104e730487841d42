"""A position that an output shows in another unit: stops are looked for where the recording has it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.data.case import Case
from aeolid.diagnose.selection.first_effect import find_first
from aeolid.diagnose.structure.sums import straight_in
from aeolid.models import equations_file
from aeolid.models import expressions as ex
from aeolid.models.equations import Equations
from aeolid.models.integrate import compile_equations, simulate
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP = 0.004
MOUNT = """
[model]
name = "mount"
time = "continuous"
[parameters]
w = { value = 19.2, min = 8.0, max = 50.0, unit = "rad/s", free = true }
z = { value = 0.08, min = 0.01, max = 0.5, free = true }
scale = { value = 1000.0 }
[[auxiliary]]
name = "twice"
equation = "2*q"
[[state]]
name = "q"
derivative = "v"
unit = "m"
[[state]]
name = "v"
derivative = "-w*w*q - 2*z*w*v - base STOPS"
unit = "m/s"
[[output]]
name = "stroke"
equation = "scale*q"
unit = "mm"
[[output]]
name = "acceleration"
equation = "-w*w*q - 2*z*w*v STOPS"
unit = "m/s2"
"""


def mount(stops: str = "") -> Equations:
    text = MOUNT.replace("STOPS", stops)
    return equations_file.from_toml(tomllib.loads(text), text, "mount.toml")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1000*q", (1000.0, 0.0)), ("scale*q - 3", (1000.0, -3.0)), ("twice/4 + 1", (0.5, 1.0)), ("-q", (-1.0, 0.0)),
        ("q*q", None), ("q + v", None), ("sin(q)", None), ("7", None), ("v", None), ("q - q", None),
    ],
)  # fmt: skip
def test_what_shows_one_quantity_alone_says_how(text: str, expected: tuple[float, float] | None) -> None:
    assert straight_in(ex.parse(text, "test"), "q", mount()) == expected


def test_soft_stops_within_a_third_of_the_stroke_are_named_where_they_are() -> None:
    """The stroke is in mm, the state in m, and the accelerometer does not feel the base; 12 mm of 32, 750 per s²."""
    rng, rows = np.random.default_rng(8), 1500
    time = STEP * np.arange(rows)
    tones = [
        np.sin(2 * np.pi * (f * time + p)) for f, p in zip(np.linspace(1, 12, 24), rng.uniform(0, 1, 24), strict=True)
    ]
    base = 4.5 * np.sum(tones, axis=0)[:, None] / np.sqrt(12)
    true = mount("- 750*(max(q - 0.012, 0) + min(q + 0.012, 0))")
    y = simulate(compile_equations(true), base, true.theta, true.x0, STEP)
    y += 0.01 * y.std(axis=0) * rng.standard_normal(y.shape)
    channels = (
        Channel("base", "m/s2", "input"),
        Channel("stroke", "mm", "output"),
        Channel("acceleration", "m/s2", "output"),
    )
    record = Record(time, np.hstack([base, y]), channels, STEP, "a.csv", "")
    case = Case("mount", (record,), "equations", mount(), "mount.toml", "", {}, Path())
    winner = find_first(case, 1, lambda name, share: lambda: None).winner
    assert winner is not None
    ((attachment,),) = (winner.attachments,)
    assert attachment.entry == "end_stop"
    values = winner.values[attachment.key]
    for name, expected in (("stop_stiffness", 750.0), ("low_stop", -0.012), ("high_stop", 0.012)):
        value, std = values[name]
        assert abs(value - expected) < max(4 * std, 0.02 * abs(expected))
