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
from aeolid.report import bode
from aeolid.report.answer import _proof

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
