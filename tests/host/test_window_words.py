"""What is said of a past window that is too short names poles as the list of modes does, and says where one is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aeolid.identify.choices import Choices, with_choices_made
from aeolid.identify.result import Identification
from aeolid.identify.truncation import WindowCheck, WindowFit, compare_windows
from aeolid.identify.varx import identify_varx
from aeolid.models.modes import pole_words
from aeolid.plants.lti import simulate_fourth_order

STEP = 0.1


def pair(hertz: float, damping: float = 0.05) -> tuple[complex, complex]:
    s = 2 * np.pi * hertz * complex(-damping, np.sqrt(1 - damping**2))
    return complex(np.exp(s * STEP)), complex(np.exp(s.conjugate() * STEP))


def decay(seconds: float) -> tuple[complex]:
    return (complex(np.exp(-STEP / seconds)),)


def fit(past: int, *poles: tuple[complex, ...], deviation: float = 1e-4) -> WindowFit:
    """Return a fit of a window with these poles, each known to a deviation."""
    values = np.array([p for group in poles for p in group])
    return WindowFit(past, values, np.tile(deviation**2 * np.eye(2), (len(values), 1, 1)), 0.0)


def test_a_mode_that_only_the_longer_window_shows_is_said_to_appear() -> None:
    check = compare_windows(fit(10, pair(1.0)), [fit(20, pair(1.0), pair(0.2))], STEP)
    assert check.holds is False and check.missed and check.frequency_hz == pytest.approx(0.2, rel=1e-6)
    assert (
        "with 20 samples the mode near 0.2 Hz appears" in check.reason and "slowest period is near 5 s" in check.reason
    )


def test_a_mode_that_moves_is_said_to_differ_and_the_slowest_period_is_that_of_another() -> None:
    check = compare_windows(fit(10, pair(1.0), pair(0.1)), [fit(20, pair(1.1), pair(0.1))], STEP)
    assert not check.missed and "the mode near 1 Hz differs" in check.reason
    assert "slowest period is near 10 s" in check.reason


def test_a_real_pole_is_told_as_the_list_tells_it() -> None:
    check = compare_windows(fit(10, pair(1.0), decay(5.0)), [fit(20, pair(1.0), decay(8.0))], STEP)
    assert "the real pole of 5 s differs" in check.reason and "mode near" not in check.reason
    assert pole_words(0.0, True) == "the mode near 0 Hz"  # an integrator has no time constant


@pytest.fixture(scope="module")
def found() -> Identification:
    return identify_varx([simulate_fourth_order(1500, 1)], past=10, order=4)


@pytest.mark.parametrize(
    ("factor", "missed", "why"),
    [(1.02, False, None), (3.0, True, "only models of the longer window"), (3.0, False, "models of its own")],
)
def test_a_warning_says_where_the_pole_that_it_names_is_not_listed(
    found: Identification, factor: float, missed: bool, why: str | None
) -> None:
    hertz = factor * max(m.frequency_hz for m in found.modes)
    check = WindowCheck(False, 10, 20, hertz, 9.0, "the past window is too short", missed)
    notes = with_choices_made(found, Choices(10, (), check=check)).notes
    warned = [n for n in notes if "too short" in n]
    assert len(warned) == 1 and (f"no pole near {hertz:.3g} Hz is listed" in warned[0]) == (why is not None)
    assert why is None or why in warned[0]
    power = replace(check, apart=1.0)  # the error power is lower: no pole is named
    assert not any("listed" in n for n in with_choices_made(found, Choices(10, (), check=power)).notes)
