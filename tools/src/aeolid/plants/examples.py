"""Write recordings, roles, models and cases to try every command on: a turbine and a stage with dry friction.

What is concealed in them is said here and nowhere in the files: the turbine's pitch drive follows its demand with a
first-order lag of 0.3 s, the stage rubs with 1.2 N; neither model knows.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid import output
from aeolid.errors import UsageError
from aeolid.formats import write_table
from aeolid.models.model_file import Signal
from aeolid.models.state_space import StateSpace
from aeolid.plants.concealed import PRINTED, LaggedLoop
from aeolid.plants.hawt import SAMPLE_TIME_S, build_turbine

Array = NDArray[np.float64]
LAG_S, FRICTION_N = 0.3, 1.2
RPM = 30 / math.pi
TURBINE_UNITS = (("pitch", "deg", 1.0), ("torque", "kN m", 1e-3), ("generator_speed", "rpm", RPM),
                 ("tower_fore_aft", "m/s", 1.0))  # fmt: skip
STEP_S, FINE, STAGE_SAMPLES = 0.02, 40, 1500
MASS_KG, DAMPING, STIFFNESS, GAIN = 2.0, 1.5, 80.0, 4.0  # kg, N s/m, N/m, N/V: 1 Hz, damping ratio 0.06

TURBINE_ROLES = """# roles.toml
[recording]
sample_time_s = 0.1        # optional where the time column gives it
time = "time_s"            # optional where there is none
[[channel]]
name = "pitch"
column = "BldPitch1"       # only where the heading differs from the name
unit = "deg"
role = "input"             # input, output, disturbance, scheduling, azimuth, excitation or ignore
[[channel]]
name = "torque"
unit = "kN m"
role = "input"
[[channel]]
name = "generator_speed"
unit = "rpm"
role = "output"
[[channel]]
name = "tower_fore_aft"
unit = "m/s"
role = "output"
"""
TURBINE_CASE = """# case.toml
[case]
title = "Pitch loop after the service"
[recordings]
files = ["monday.csv", "tuesday.csv"]
roles = "roles.toml"
[baseline]
kind = "state_space"       # model.json; "equations": model.toml; "run": a simulation.csv of the same channels; "fmu"
file = "model.json"
[context]
machine = "wind turbine"
blades = 3
"""
STAGE_ROLES = """# roles.toml
[recording]
time = "time_s"
[[channel]]
name = "drive"
unit = "V"
role = "input"
[[channel]]
name = "position"
unit = "m"
role = "output"
"""
STAGE_MODEL = """# model.toml
[model]
name = "positioning stage"
time = "continuous"
[parameters]
M = { value = 2.0, min = 0.5, max = 8.0, unit = "kg", free = true }
c = { value = 1.5, min = 0.0, max = 30.0, unit = "N s/m", free = true }
k = { value = 80.0, min = 5.0, max = 400.0, unit = "N/m", free = true }
g = { value = 4.0, unit = "N/V" }
[[state]]
name = "q"
derivative = "v"
unit = "m"
[[state]]
name = "v"
derivative = "(g*drive - c*v - k*q)/M"
unit = "m/s"
[[output]]
name = "position"
equation = "q"
unit = "m"
"""
STAGE_CASE = """# case.toml
[case]
title = "Positioning stage"
[recordings]
files = ["recording.csv"]
roles = "roles.toml"
[baseline]
kind = "equations"
file = "model.toml"
[context]
machine = "rig"
"""


EXAMPLE_FILES = (
    "monday.csv", "tuesday.csv", "roles.toml", "my_case/monday.csv", "my_case/tuesday.csv", "my_case/roles.toml",
    "my_case/case.toml", "my_case/model.json", "stage/roles.toml", "stage/model.toml", "stage/case.toml",
    "stage/recording.csv",
)  # fmt: skip


def write_examples(folder: str | Path, *, samples: int = 3000, seed: int = 1) -> list[Path]:
    """Write monday.csv, tuesday.csv, roles.toml and the cases my_case and stage into `folder`; returns the files.

    samples: of each turbine recording, default 3000, which are five minutes and enough to find the lag; seed: of wind,
    excitation and noise. Raises UsageError where the folder cannot be written.
    """
    if not 100 <= samples <= 1_000_000:
        raise UsageError(f"{samples} samples: 100 to 1000000 are of use")
    target = Path(folder)
    case, stage = target / "my_case", target / "stage"
    days = {"monday.csv": turbine_table(samples, 2 * seed), "tuesday.csv": turbine_table(samples, 2 * seed + 1)}
    texts = {
        target / "roles.toml": TURBINE_ROLES, case / "roles.toml": TURBINE_ROLES, case / "case.toml": TURBINE_CASE,
        case / "model.json": json.dumps(turbine_model().to_json(), indent=1) + "\n",
        stage / "roles.toml": STAGE_ROLES, stage / "model.toml": STAGE_MODEL, stage / "case.toml": STAGE_CASE,
    }  # fmt: skip
    tables = {place / name: table for place in (target, case) for name, table in days.items()}
    tables[stage / "recording.csv"] = stage_table(STAGE_SAMPLES, seed)
    for place in (case, stage):
        output.make_folder(place)
    for path, text in texts.items():
        output.write_text(path, text, durable=False)
    for path, table in tables.items():
        write_table(path, table)
    return sorted([*texts, *tables])


def turbine_table(samples: int, seed: int) -> dict[str, Array]:
    """Run the turbine with its lagging pitch drive; returns columns by heading, units as in TURBINE_UNITS."""
    loop = LaggedLoop(seed, lag_s=LAG_S, excitation=PRINTED)
    time, values = np.empty(samples), np.empty((samples, 5))
    for k in range(samples):
        time[k], values[k, :2], values[k, 2:] = loop.step()
    headings = ["BldPitch1", *(name for name, _, _ in TURBINE_UNITS[1:])]
    factors = [factor for _, _, factor in TURBINE_UNITS]
    columns = {name: np.round(factors[i] * values[:, i], 9) for i, name in enumerate(headings)}
    return {"time_s": np.round(time, 3)} | columns


def turbine_model() -> StateSpace:
    """Return the turbine's true model, which has no pitch drive, in the units of the recordings."""
    model = build_turbine().model()
    factor = np.array([f for _, _, f in TURBINE_UNITS])
    signals = tuple(Signal(name, unit) for name, unit, _ in TURBINE_UNITS)
    scaled = replace(
        model, B=model.B / factor[:2], C=factor[2:, None] * model.C[:2],
        D=factor[2:, None] * model.D[:2] / factor[:2], inputs=signals[:2], outputs=signals[2:],
    )  # fmt: skip
    assert math.isclose(SAMPLE_TIME_S, scaled.sample_time_s)
    return scaled


def stage_table(samples: int, seed: int) -> dict[str, Array]:
    """Run a mass on a spring with dry friction in a sampled position loop; returns columns by heading.

    M dv/dt = g u − c v − k q − F sign(v) + w: friction takes at most the impulse F dt and never turns the motion round;
    w is an unmeasured random force of 0.5 N with a memory of 0.5 s; the sensor's noise is 0.3 mm.
    """
    rng = np.random.default_rng(seed)
    dt = STEP_S / FINE
    q = v = push = 0.0
    keep = math.exp(-dt / 0.5)
    kicks = 0.5 * math.sqrt(1 - keep**2) * rng.standard_normal(samples * FINE)
    noise = 3e-4 * rng.standard_normal(samples)
    wanted = np.repeat(rng.uniform(-0.3, 0.3, samples // 75 + 1), 75)
    test_signal = 3.0 * np.repeat(rng.choice([-1.0, 1.0], samples // 5 + 1), 5)
    rows = np.empty((samples, 2))
    for i in range(samples):
        seen = q + noise[i]
        command = 6.0 * (wanted[i] - seen) + test_signal[i]
        rows[i] = command, seen
        for j in range(FINE):
            push = keep * push + kicks[i * FINE + j]
            q += 0.5 * dt * v  # drift, kick, drift: second order
            v += dt * (GAIN * command + push - DAMPING * v - STIFFNESS * q) / MASS_KG
            v -= math.copysign(min(abs(v), FRICTION_N * dt / MASS_KG), v)
            q += 0.5 * dt * v
    time = np.round(STEP_S * np.arange(samples), 3)
    return {"time_s": time, "drive": np.round(rows[:, 0], 6), "position": np.round(rows[:, 1], 7)}
