"""Stops: a stiff spring that is touched only near the ends of the travel."""

from __future__ import annotations

from aeolid.diagnose.hypotheses.parts.base import Attachment, Entry, Quantity, Site, Slot
from aeolid.diagnose.hypotheses.parts.forces import force_on, natural, per, say, travel, with_spring
from aeolid.diagnose.structure.anatomy import Motion

_ENDS = (0.95, 0.85, 0.7, 0.5)  # of the travel seen, where both stops are tried
_WITHIN = (0.6, 0.35, 0.1)  # the same where one stop is tried at a recorded position
_STIFF = 1e4  # times the natural stiffness: beyond that a sample cannot tell


def _attach(site: Site) -> list[Attachment]:
    return [_on(site, motion, i) for i, motion in with_spring(site)]


def _on(site: Site, motion: Motion, number: int) -> Attachment:
    middle, half = travel(site, motion)
    size, unit, length = natural(motion), per(motion, 1), motion.position_unit
    stop, low, high = (f"stop_{number + 1}_{what}" for what in ("stiffness", "low", "high"))
    least, most = middle - 2 * half, middle + 2 * half
    ends = [(-share, share) for share in _ENDS] + [(-1.5, 0.85), (-0.85, 1.5)]  # both, only above, only below
    if motion.recorded is not None:  # no force drives it back: it may be anywhere beyond a stop
        ends += [pair for share in _WITHIN for pair in ((-1.5, share), (-share, 1.5))]
    return force_on(
        motion, number, "end_stop",
        (
            Slot(stop, "stop_stiffness", unit, 0.0, 0.0, _STIFF * size, 1e-3 * size),
            Slot(low, "low_stop", length, middle - half, least, middle, 0.1 * half, local=False),
            Slot(high, "high_stop", length, middle + half, middle, most, 0.1 * half, local=False),
        ),
        f"-{stop}*(max({{q}} - {high}, 0) + min({{q}} - {low}, 0))",
        grid=tuple({low: middle + a * half, high: middle + b * half} for a, b in ends),
        starts=({}, {stop: size}, {stop: 10 * size}),
        equation="F = -stop_stiffness*(max(q - high_stop, 0) + min(q - low_stop, 0))",
        statement=say(
            f"stops at {{low_stop:.3g}} {length} and {{high_stop:.3g}} {length} bound the motion at {motion.location}"
            f" ({{stop_stiffness:.3g}} {unit}); the model has none"
        ),
    )  # fmt: skip


ENTRY = Entry(
    id="end_stop",
    family="nonlinear_stiffness",
    name="end stops",
    equation="F = -stop_stiffness*(max(q - high_stop, 0) + min(q - low_stop, 0))",
    source="Shaw and Holmes 1983, J. Sound Vib. 90(1), piecewise linear oscillator",
    quantities=(
        Quantity("stop_stiffness", "N/m (1/s^2 without a mass)", 0.0, 1e12, 0.0, "stiffness of the stops"),
        Quantity("low_stop", "m", -1e6, 1e6, float("nan"), "where the lower stop is touched"),
        Quantity("high_stop", "m", -1e6, 1e6, float("nan"), "where the upper stop is touched"),
    ),
    attaches_to="every position with an equation of motion, every oscillatory mode, every recorded one of a static law",
    signature="large strokes are cut short, small ones are as modelled",
    confused_with=(
        ("cubic_stiffness", "a cubic spring hardens from the middle on, a stop all at once"),
        ("clearance", "a clearance lacks force in the middle, a stop adds it at the ends"),
        ("input_saturation", "excite less: a stop is not reached, a saturated drive is as modelled"),
    ),
    attach=_attach,
    rank=170,
)
