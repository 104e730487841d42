"""The experiment that would show what a recording does not: what it promises comes true, and what is said of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from small_cases import SWING, SWING_CHANNELS, SWING_STEP, swinging, write_case

from aeolid.diagnose.baseline.prepare import Prepared, prepare
from aeolid.diagnose.data.case import Case, load_case
from aeolid.diagnose.experiments.closer import Closer, describe_closer, feasible, look_closer
from aeolid.diagnose.experiments.experiment import Experiment
from aeolid.diagnose.scoring.scores import Bank, score_bank

Array = NDArray[np.float64]
IDS = ("cubic_stiffness", "actuator_lag", "sensor_scale", "coulomb_friction", "deadband")


def scored(case: Case) -> tuple[Prepared, Bank]:
    prepared = prepare(case)
    return prepared, score_bank(prepared, [a for a in prepared.hypotheses if a.entry in IDS], 1)


def quiet(folder: Path, added: Array | float = 0.0) -> Case:
    """Return the swing with a tenth of its push and what is added to it; Euler's midpoint rule, 4 steps a sample."""
    swinging(folder)
    rows = np.loadtxt(folder / "recording.csv", delimiter=",", skiprows=1)[:, 1:]
    rng, x, h = np.random.default_rng(2), np.zeros(2), SWING_STEP / 4
    rows[:, 0] = 0.1 * rows[:, 0] + added
    gust = 0.4 * rng.standard_normal(len(rows))
    for i in range(len(rows)):
        rows[i, 1:] = x
        for _ in range(4):
            force = rows[i, 0] + gust[i]
            middle = x + h / 2 * np.array([x[1], force - x[1] - 40 * x[0]])
            x = x + h * np.array([middle[1], force - middle[1] - 40 * middle[0]])
    rows[:, 1:] += rng.standard_normal((len(rows), 2)) * (1e-3, 5e-3)
    return load_case(write_case(folder, SWING, SWING_STEP, SWING_CHANNELS, rows))


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> tuple[Case, Prepared, Bank]:
    case = quiet(tmp_path_factory.mktemp("calm"))
    return (case, *scored(case))


def test_what_it_promises_comes_true(calm: tuple[Case, Prepared, Bank], tmp_path: Path) -> None:
    """Record it: the inputs as they were with the test signal on top, through the same plant, and score that.

    Within a factor of 1.5: single recordings scatter, and the noise is fitted anew.
    """
    case, prepared, bank = calm
    told = look_closer(prepared, case.records[0].of("input"), bank, 1)
    assert told is not None and told.finer > 1.25 and told.experiment.channel == "push" and len(told.sizes) > 1
    louder = scored(quiet(tmp_path, told.experiment.signal(len(case.records[0]), SWING_STEP, 9)))[1]
    now, then = ({r.attachment.key: next(iter(r.std.values())) for r in b.rows if r.std} for b in (bank, louder))
    for name, *_, before, after in told.sizes:
        gains = [now[k] / then[k] for k in now if k.startswith(name) and k in then]
        assert max(gains) == pytest.approx(before / after, rel=0.5) and max(gains) > 1.25, (name, gains)


def test_the_same_input_gives_the_same_answer(calm: tuple[Case, Prepared, Bank]) -> None:
    case, prepared, bank = calm
    inputs = case.records[0].of("input")
    assert look_closer(prepared, inputs, bank, 1) == look_closer(prepared, inputs, bank, 1)
    assert look_closer(prepared, (), bank, 1) is None  # nothing can be moved


def test_of_one_kind_the_loudest_is_looked_at_and_none_that_no_drive_follows() -> None:
    menu = [Experiment("push", "N", a, "steps", d) for a in (1.0, 2.0) for d in (0.02, 0.1, 0.4)]
    ladder = Experiment("push", "N", 1.0, "ladder", 0.8)
    assert feasible([*menu, ladder], 0.02) == menu[4:]


def test_what_is_said_names_channel_size_time_and_what_it_shows() -> None:
    closer = Closer(
        Experiment("pitch", "deg", 0.8, "steps", 0.4), 10.0, 2.4, 31,
        (("actuator_lag", "tau_s", "s", 0.04, 0.012), ("sensor_scale", "factor", "", 0.03, 0.01)), ("backlash",),
    )  # fmt: skip
    entry: dict[str, Any] = describe_closer(closer)
    assert entry["minutes"] == 10.0 and entry["separates"] == []
    for part in (
        "±0.8 deg",
        "pitch for 10 min",
        "2.4 times smaller",
        "tau_s 0.04 → 0.012 s",
        "0.01)",
        "backlash, which",
    ):
        assert part in entry["text"], part
    none: dict[str, Any] = describe_closer(None)
    assert none["minutes"] == 0 and "record longer" in none["text"]
