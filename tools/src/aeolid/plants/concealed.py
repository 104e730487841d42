"""Make a diagnosis case whose recording holds an effect that its model lacks.

The built-in turbine runs in its closed loop; between the recorded pitch demand and the blades lies a pitch drive that
follows with a first-order lag. The blade angle is not recorded, and the model given with the case is the turbine
without the drive.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid import output
from aeolid.errors import UsageError
from aeolid.formats import write_table
from aeolid.plants.hawt import SAMPLE_TIME_S, ClosedLoop, Excitation, build_turbine, roles

Array = NDArray[np.float64]

_CASE = """[case]
title = "{title}"

[recordings]
files = ["recording.csv"]
roles = "roles.toml"

[baseline]
kind = "state_space"
file = "model.json"

[context]
machine = "wind turbine"
blades = 3
"""


class LaggedLoop(ClosedLoop):
    """Step the turbine in its closed loop with a pitch drive τ dβ/dt = β_demand − β, by the plant's bilinear rule.

    β_k = a β_{k−1} + b (β_demand,k + β_demand,k−1), a = (2τ − h)/(2τ + h), b = h/(2τ + h). What `advance` returns as
    pitch is the demand, as a controller's log has it; the blade angle β stays inside. lag_s = 0 is no drive at all.
    """

    def __init__(self, seed: int, *, lag_s: float, excitation: Excitation | None = None) -> None:
        super().__init__(seed, excitation=excitation)
        if not 0 <= lag_s <= 5:
            raise UsageError(f"lag {lag_s} s: 0 to 5 s is the range of pitch drives")
        h = SAMPLE_TIME_S
        self._lag_s, self._a, self._b = lag_s, (2 * lag_s - h) / (2 * lag_s + h), h / (2 * lag_s + h)
        self._blade = self._demand = 0.0

    def advance(self, excitation: Array, wind: Array, noise: Array) -> tuple[float, Array, Array]:
        """Advance one sample; returns time in s, demand and torque (2,) in deg and N m, y (3,) in rad/s and m/s."""
        if self._lag_s == 0:
            return super().advance(excitation, wind, noise)
        demand = excitation[0] - self._pitch.memory
        self._blade = self._a * self._blade + self._b * (demand + self._demand)
        self._demand = demand
        shifted = np.array([excitation[0] + self._blade - demand, excitation[1]])  # so the plant gets the blade angle
        time, u, y = super().advance(shifted, wind, noise)
        return time, np.array([demand, u[1]]), y


PRINTED = Excitation(noise=0.1)
"""Excitation and wind as printed in paper 000 section III, measurement noise of 10 % of the outputs' usual motion."""


def write_case(
    folder: str | Path, *, lag_s: float = 0.3, samples: int = 6000, seed: int = 7, excitation: Excitation = PRINTED
) -> Path:
    """Write recording.csv, roles.toml, model.json and case.toml; returns the folder.

    lag_s: time constant of the concealed drive in s (0: nothing is concealed); samples: length, 6000 are 10 minutes.
    """
    target = Path(folder)
    output.make_folder(target)
    loop = LaggedLoop(seed, lag_s=lag_s, excitation=excitation)
    values, time = np.empty((samples, 7)), np.empty(samples)
    for k in range(samples):
        time[k], values[k, :2], values[k, 2:5] = loop.step()
        values[k, 5:] = loop.last_excitation()
    table = roles()
    columns = {channel.name: values[:, i] for i, channel in enumerate(table.channels)}
    write_table(target / "recording.csv", {"time_s": np.round(time, 3)} | columns)
    lines = [f'[recording]\nsample_time_s = {SAMPLE_TIME_S}\ntime = "time_s"\n']
    lines += [f'[[channel]]\nname = "{c.name}"\nunit = "{c.unit}"\nrole = "{c.role}"\n' for c in table.channels]
    output.write_text(target / "roles.toml", "\n".join(lines))
    output.write_json(target / "model.json", build_turbine().model().to_json())
    output.write_text(target / "case.toml", _CASE.format(title="Built-in turbine against its model"))
    return target
