"""What the foreign rigs may hide: how each effect is told to the engine, and what a right answer calls it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from aeolid.challenge.rigs import Values, free_frequency

TOLERANCE = 0.05  # of a size: declared inertias are up to 3 % off, and the engine's frictions and stops give a little


@dataclass(frozen=True)
class Effect:
    """Hold one effect on one rig (`plant`).

    accepted: ids that name it rightly, the best first (none: outside the catalogue); sizes: constants of the rig at a
    strength of 1; label, size: parameter of the diagnosis and its true value; inverse: a smaller number is the stronger
    effect; flags: how the model is written; fixed: it has no size.
    """

    plant: str
    accepted: tuple[str, ...]
    what: str
    sizes: Mapping[str, float]
    label: str = ""
    size: Callable[[Values], float] | None = None
    inverse: bool = False
    flags: Mapping[str, float] = field(default_factory=dict)
    fixed: bool = False
    tolerance: float = TOLERANCE

    def put(self, values: Values, strength: float) -> Values:
        """Return the rig's constants with the effect."""
        grown = {k: v / strength if self.inverse else v * strength for k, v in self.sizes.items()}
        return {**values, **grown}


def _of(name: str) -> Callable[[Values], float]:
    return lambda v: v[name]


def _sized(
    rig: str, accepted: str, what: str, name: str, size: float, label: str, *, inverse: bool = False
) -> Effect:  # fmt: skip
    return Effect(rig, tuple(accepted.split()), what, {name: size}, label, _of(name), inverse)


def _dry(rig: str, size: float) -> Effect:
    label = "force_N" if rig in ("cart", "cable", "damper") else "torque_N_m"
    return _sized(rig, "coulomb_friction", "joint with dry friction", "dry", size, label)


def effects() -> list[Effect]:
    """List every effect of the catalogue that the engine makes of its own."""
    found = []
    for rig, dry, drag, lag, most in (
        ("gears", 0.25, 0.15, 0.03, 0.35), ("pendulum", 0.06, 0.03, 0.08, 0.7), ("cart", 0.8, 2.0, 0.06, 1.3),
        ("arm", 0.06, 0.08, 0.03, 0.6), ("cable", 1.5, 0.0, 0.03, 1.2), ("masses", 0.08, 0.008, 0.015, 0.55),
    ):  # fmt: skip
        found.append(_dry(rig, dry))
        if drag:
            found.append(_sized(rig, "quadratic_damping", "joint with drag", "drag", drag, "c2"))
        found.append(_sized(rig, "actuator_lag", "drive behind a filter", "lag", lag, "tau_s"))
        late = "transport_delay data_time_offset"  # of a single input they are one model
        found.append(_sized(rig, late, "command comes late", "late", lag, "delay_s"))
        found.append(_sized(rig, "input_saturation", "command has a range", "most", most, "high", inverse=True))
    return found + _springs() + _sensors() + _forces()


def _springs() -> list[Effect]:
    stop = "end stop in the joint"
    rigid = {"rigid": 1.0}
    modes = ("structural_mode", "drivetrain_torsion")
    return [
        Effect("gears", ("backlash", "clearance"), "play between the teeth", {"gap": 0.03}, "width",
               lambda v: 2 * v["gap"]),
        _sized("pendulum", "end_stop", stop, "stop", 1.4, "high_stop", inverse=True),
        _sized("cart", "end_stop", stop, "stop", 0.24, "high_stop", inverse=True),
        _sized("cart", "cubic_stiffness", "hardening spring", "cubic", 300.0, "k3"),
        Effect("cart", ("structural_mode",), "load that swings", {"swing": 0.25}),
        _sized("arm", "cubic_stiffness", "hardening joint", "cubic", 8000.0, "k3"),
        Effect("arm", modes, "joint that bends", {}, "frequency_hz", free_frequency, flags=rigid, fixed=True),
        _sized("cable", "clearance backlash", "play at the hook", "gap", 0.004, "half_gap"),
        Effect("cable", ("clearance", "quadratic_stiffness"), "cable that slackens", {"slack": 1.0}, fixed=True),
        Effect("masses", ("gravity_1p",), "load out of balance", {"uneven": 0.006}),
        _sized("masses", "clearance", "play in the coupling", "gap", 0.01, "half_gap"),
        Effect("masses", modes, "shaft that twists", {}, "frequency_hz", free_frequency, flags=rigid, fixed=True),
    ]  # fmt: skip


def _sensors() -> list[Effect]:
    clipped = "sensor with a range"
    return [
        _sized("gears", "sensor_saturation", clipped, "clip", 0.4, "high", inverse=True),
        _sized("pendulum", "sensor_saturation", clipped, "clip", 1.0, "high", inverse=True),
        _sized("cart", "sensor_saturation", clipped, "clip", 0.25, "high", inverse=True),
        _sized("masses", "sensor_saturation", clipped, "clip", 6.0, "high", inverse=True),
    ]


def _forces() -> list[Effect]:
    """List what hides where a force is the output."""
    found = []
    for rig, dry, drag in (("damper", 8.0, 200.0), ("balance", 0.2, 0.04)):
        found.append(_dry(rig, dry))
        found.append(_sized(rig, "quadratic_damping", "joint with drag", "drag", drag, "c2"))
    found.append(_sized("damper", "end_stop", "end stop in the joint", "stop", 0.022, "high_stop", inverse=True))
    return [*found, _sized("damper", "cubic_stiffness", "hardening spring", "cubic", 2e5, "k3")]


def outside() -> list[Effect]:
    """List effects that the catalogue has no name for on a rig."""
    return [Effect("masses", (), "inertia that grows with the speed", {"loose": 0.2})]
