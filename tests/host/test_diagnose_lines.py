"""Modes at the one frequency at which an input moves, and drives beside a wind that is read as held."""

from __future__ import annotations

import ast
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from aeolid.diagnose.baseline import channel_faults
from aeolid.diagnose.candidates.lines import at_a_line
from aeolid.diagnose.data.intersample import Sampling
from aeolid.diagnose.data.segments import Segment
from aeolid.diagnose.hypotheses.parts import power_level
from aeolid.diagnose.validation import unsure_reading
from aeolid.models import expressions as ex
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
STEP = 4e-4


def mains(rows: int = 1500, noise: float = 0.0) -> Segment:
    """Return a stretch with a voltage of 50 Hz that swells, beside a slow load."""
    rng, t = np.random.default_rng(3), STEP * np.arange(rows)
    voltage = (300 + 9 * np.sin(2 * np.pi * 1.3 * t)) * np.sin(2 * np.pi * 50 * t) + noise * rng.standard_normal(rows)
    return Segment(np.column_stack([voltage, rng.standard_normal(rows).cumsum()]), np.zeros((rows, 1)), STEP, "a", 0, 0)


@pytest.mark.parametrize(("hz", "noise", "refused"), [(50.02, 0.0, True), (62.0, 0.0, False), (50.02, 900.0, False)])
def test_a_mode_where_an_input_has_its_line_has_no_name(hz: float, noise: float, refused: bool) -> None:
    """A core that saturates was a mode at the frequency of the mains; a broad voltage beside the line tells them."""
    told = {"structural_mode output:primary": {"frequency_hz": (hz, 0.5), "damping": (0.016, 0.003)}}
    assert bool(at_a_line(told, [mains(40), mains(noise=noise)])) is refused
    assert at_a_line({"actuator_lag input:mains": {"tau_s": (0.1, 0.01)}}, [mains()]) == ""
    assert at_a_line(told, [mains(40)]) == ""
    assert at_a_line(told, [mains(noise=noise)], computed=[0]) == ""  # a column that nobody recorded drives nothing


@pytest.mark.parametrize(("role", "hold", "late"), [("disturbance", "zoh", True), ("disturbance", "foh", False),
                                                   ("input", "zoh", False)])  # fmt: skip
def test_a_drive_alone_late_beside_a_wind_read_as_held_may_be_the_reading(role: str, hold: str, late: bool) -> None:
    """0.106 s in rows of 0.2 s, behind anti-alias filters; a wind that is read as it moves makes it the drive's."""
    t = 0.2 * np.arange(900)
    columns = np.column_stack([np.repeat(np.sign(np.sin(t[::10])), 10), np.sin(0.1 * t) + np.sin(0.37 * t), t])
    channels = (Channel("drive", "kN", "input"), Channel("wind", "kN", role), Channel("speed", "m/s", "output"))
    record = Record(t, columns, channels, 0.2, "a.csv", "")
    sampling = Sampling((("drive", "zoh"), ("wind", hold)), 0.0, 0.0, False)
    prepared: Any = SimpleNamespace(
        records=(record,), sampling=sampling, declared=SimpleNamespace(outputs=(None, None))
    )
    lag = SimpleNamespace(entry="transport_delay", key="lag", location={"inputs": ["drive"]})
    candidate: Any = SimpleNamespace(attachments=(lag,), values={"lag": {"delay_s": (0.106, 0.004)}})
    within = unsure_reading.is_within_reading(prepared, candidate)
    assert within is (late and sampling.is_plain)
    candidate.values["lag"]["delay_s"] = (0.3, 0.004)
    assert not unsure_reading.is_within_reading(prepared, candidate)


def test_aerodynamic_terms_are_seen_behind_any_inertia() -> None:
    """The torques stood in one quotient of 1000 times the inertia, beside a force that nobody measured."""
    tree = ex.parse("(0.5*rho*wind**2 - torque - -2*om)/(1000*J) + 3*(a - b)", "speed")
    values = {"rho": 1.2, "wind": 9.0, "torque": 4.0, "om": 1.3, "J": 2.0, "a": 5.0, "b": 0.25}
    terms = power_level._forces(tree, 1)
    whole, *parts = (eval(ex.to_text(part), {}, dict(values)) for part in (tree, *(t for _, t in terms)))
    assert sum(sign * part for (sign, _), part in zip(terms, parts, strict=True)) == pytest.approx(whole)
    assert len(terms) == 5 and not any("torque" in ex.to_text(t) and "wind" in ex.to_text(t) for _, t in terms)
    assert isinstance(tree, ast.expr)


@pytest.mark.parametrize(("ids", "after", "refuted"), [
    (["sensor_sign"], 90.0, True), (["sensor_sign"], 110.0, False), (["data_channel_swap"], 90.0, True),
    (["sensor_scale"], 90.0, False), ([], 90.0, False),
])  # fmt: skip
def test_a_sign_that_makes_the_model_worse_is_not_turned(
    ids: list[str], after: float, refuted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The linear judge turned the angle of a pendulum that stands on its end, by 1,074 nats."""
    fits = {"given": 100.0, "right": after}
    monkeypatch.setattr(
        channel_faults, "prepare", lambda case: SimpleNamespace(fit=SimpleNamespace(log_posterior=fits[case]))
    )
    found: Any = [SimpleNamespace(id=i) for i in ids]
    ask: Any = channel_faults._is_refuted
    assert ask("given", "right", found) is refuted
