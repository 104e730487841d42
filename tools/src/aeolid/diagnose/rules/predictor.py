"""What noise is moved to another start, and what is kept of it."""

from __future__ import annotations

from dataclasses import dataclass

from aeolid.diagnose.rules.declaring import rule


@dataclass(frozen=True)
class PredictorRules:
    """Hold the numbers of this section; each says what it means."""

    quiet_process_sizes: float = rule(0.3, "sizes", "process noise below which a fit is tried from a larger one")
    loud_sensor_sizes: float = rule(10.0, "sizes", "sensor noise above which a fit is tried from a smaller one")
    moved_noise_nats: float = rule(0.5, "nats", "gain that a fit from another noise must bring")
    unheard_noise_nats: float = rule(0.1, "nats", "what all noise that is made quieter together may cost")
