"""What a page draws and says of its figures: no dot left out, no share of nothing, values as they are reported."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
from matplotlib import pyplot

from aeolid.api import pictures
from aeolid.diagnose.candidates.plausible import objection
from aeolid.diagnose.hypotheses.parts.base import Slot
from aeolid.diagnose.run_prior.conclude import _stands
from aeolid.diagnose.run_prior.pair import NOTHING, Pair, Side
from aeolid.report import bode
from aeolid.report.answer import _proof
from aeolid.report.evidence import _one_stretch, _time_figure

GRID = np.geomspace(0.01, 5.0, 60)
RESONANCE = {
    "frequency_hz": [0.1, 0.5, 2.0],
    "pairs": [{
        "input": "u", "output": "y", "gain": [1.0, 80.0, 1e-3], "gain_std": [0.1, 2.0, 1e-4],
        "phase_deg": [0.0, -90.0, -170.0],
    }],
    "coherence": {"y": [1.0, 1.0, 1.0]},
}  # fmt: skip


@pytest.mark.parametrize("where", ["page", "python"])
def test_every_dot_that_disagrees_with_the_model_is_seen(where: str) -> None:
    """A resonance that the model lacks and a gain far below it: both were cut off, and are what the figure is for."""
    gain, phase, coherence = pyplot.subplots(3, 1)[1]
    g = 1.0 / (1.0 + 1j * GRID)
    gain.loglog(GRID, np.abs(g))
    gain.set_ylim(0.1, 1.2)
    if where == "page":
        bode._dots([gain, phase, coherence], RESONANCE, "u", "y", GRID, g)
    else:
        pictures._dots(gain, phase, {"spectral": RESONANCE}, ("u", "y"), (GRID, np.degrees(np.angle(g))))
    low, high = gain.get_ylim()
    pyplot.close("all")
    assert low < 1e-3 and high > 80.0


@pytest.mark.parametrize(
    ("ceiling", "said", "unsaid"),
    [
        (80.0, "78 % of what a correction of any form gains", "no more"),
        (15.4, "a correction of any form gains no more there", "% of what"),
        (None, "62", "any form"),
    ],
)
def test_a_share_is_told_only_of_what_is_more(ceiling: float | None, said: str, unsaid: str) -> None:
    """62 nats beside 15 of the comparison were "100 % of what any model could gain"."""
    sealed: dict[str, Any] = {"log_likelihood_gain": 62.0, "ceiling_gain": ceiling, "recovered_fraction": 0.775}
    text = _proof(sealed, [{"id": "coulomb_friction"}], several=False)
    assert said in text and unsaid not in text


def test_a_refused_explanation_of_a_pair_says_why() -> None:
    """The table's column is headed "not accepted because"; an accepted one has no reason."""
    assert _stands(12.3, 30.0) == {"plausible": False, "reason": "gains 12.3 nats; a name needs more than 30"}
    assert _stands(31.0, 30.0) == {"plausible": True}


def test_the_end_of_a_range_is_told_as_the_value_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """The model holds 1/ω, which ran to 0: the natural frequency is infinite, not 0 rad/s."""
    slot = Slot("inverse", "omega_rad_s", "rad/s", 0.0, -1.0, 1.0, 0.1, show=lambda v: 1 / v if v else float("inf"))
    attachment: Any = SimpleNamespace(key="actuator_second_order input:pitch", slots=(slot,))
    name = "aeolid.diagnose.candidates.plausible."
    for where, value in (
        ("_free_slots", [(slot, 0)]),
        ("_value", 0.0),
        ("at_bound", True),
        ("_is_undetermined", False),
    ):
        monkeypatch.setattr(name + where, lambda *_, value=value: value)
    said = objection([attachment], None, None, 10.0, 1)  # type: ignore[arg-type]
    assert said.endswith("ran to the end of its physical range (infinite)")


def test_means_over_blocks_are_called_so_and_stand_at_their_middle() -> None:
    """Against a run outputs are means over blocks; at the first sample's time they were half a block early."""
    step, stride = 0.05, 4
    y = np.arange(400.0)[:, None]
    side = Side(np.zeros((400, 1)), y, None, np.zeros(400, dtype=bool), step, "r", start_s=10.0)
    pair: Any = SimpleNamespace(
        blocks=lambda s, u, y: np.hstack([np.zeros((100, 4)), y.reshape(100, stride, 1).mean(axis=1)]),
        scaled=lambda s, z: z, past=2, held=4, stride=stride, block_s=step * stride, scale=np.ones(5),
        offset={side.region: np.zeros(5)},
    )  # fmt: skip
    time_s, measured, _ = Pair.predicted(pair, side, NOTHING, np.zeros((2 * 5 + 4 + 1, 1)), 0.5)
    np.testing.assert_allclose(measured[:, 0], (time_s - 10.0) / step)  # y is its own sample number
    series = {"time_s": time_s.tolist(), "measured": measured[:, 0].tolist(), "before": measured[:, 0].tolist()}
    assert "Grey: measured, in means over 0.200 s;" in _time_figure("y", series | {"mean_of_s": 0.2}, "after", 0.2, 9)
    assert "means" not in _time_figure("y", series, "after", None, 9)


def test_of_several_sealed_stretches_that_is_drawn_in_which_the_models_differ_most() -> None:
    """The times of two recordings may be the same: one line over both would go back and forth."""
    time_s, apart = np.arange(50.0), np.array([0.0, 2.0, 1.0]).repeat(50)
    series: dict[str, Any] = {
        "time_s": np.tile(time_s, 3).tolist(), "stretch": [1] * 50 + [2] * 50 + [3] * 50, "unit": "m",
        "measured": [None] * 150, "before": (100.0 + apart).tolist(), "after": [100.0] * 150,
    }  # fmt: skip
    assert "y: all 49.0 s of stretch 2 of 3. Grey" in _time_figure("y", series, "after", None, 999)
    alone = {k: v if k == "unit" else v[50:100] for k, v in series.items()}
    drawn, own = (_one_stretch(s)[0] for s in (series, alone))
    assert all(list(drawn[k]) == own[k] for k in ("time_s", "before", "after"))
    assert _one_stretch(alone) == (alone, "")
