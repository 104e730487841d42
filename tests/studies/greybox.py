"""Fit the physics of known recordings with the missing piece included: do the bands hold what is published?

    python tests/studies/greybox.py [--cases FOLDER] [--only NAME ...] [--out FILE]

Each structure is what an engineer writes who knows the rig; `aeolid identify --structure` (here `estimate`) fits its
free values from declared ones that are well off. The table has value ± one deviation, the published value, whether it
is within 1.96 deviations, and what was left out run free, beside the run with the declared values.
Published: positioning stage, Janot, Gautier and Brunot (2019); torque law, the corrected constant of the turbine's
documentation; pendulum, the thesis it comes from (from weighing, measuring and its own fit); heaters, a fit of free
runs by another program, no measured value; tanks, the error of the published physical model with overflow, which was
fitted to one recording and run on the other, as here.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

from aeolid.diagnose.data.case import make_case
from aeolid.diagnose.estimate import Estimate, estimate
from aeolid.formats import read_record
from aeolid.models.equations_file import from_toml
from aeolid.record import Roles
from aeolid.text_files import parse_toml

NORMAL = 1.959964
HERE = Path(__file__).resolve().parents[2]
KNOWN = HERE.parent / "shared" / "cases" / "known"


@dataclass(frozen=True)
class Rig:
    """Hold a case: folder, recordings, the structure, published values, sample time in s to read at, a remark."""

    folder: str
    files: tuple[str, ...]
    structure: str
    published: dict[str, float]
    resample: float | None = None
    remark: str = ""


STAGE = """
[model]
name = "positioning stage with dry and viscous friction"
[parameters]
g = { value = 35.15, unit = "N/V" }
vs = { value = 0.0005, unit = "m/s" }
M = { value = 70.0, min = 20.0, max = 400.0, unit = "kg", free = true }
Fv = { value = 100.0, min = 0.0, max = 2000.0, unit = "N s/m", free = true }
Fc = { value = 5.0, min = 0.0, max = 200.0, unit = "N", free = true }
offset = { value = 0.0, min = -20.0, max = 20.0, unit = "N", free = true }
[[state]]
name = "q"
derivative = "v"
initial = { value = 0.0, free = true }
unit = "m"
[[state]]
name = "v"
derivative = "(g*motor_voltage + pulse_force - Fv*v - Fc*tanh(v/vs) - offset)/M"
initial = { value = 0.0, free = true }
unit = "m/s"
[[output]]
name = "position"
equation = "q"
unit = "m"
"""
TORQUE = """
[model]
name = "torque law of the variable-speed generator with the slope of its speed loop"
[parameters]
K = { value = 0.000442067, min = 0.0001, max = 0.001, unit = "N m/rpm^2", free = true }
w1 = { value = 1150.0, min = 1050.0, max = 1180.0, unit = "rpm", free = true }
w2 = { value = 1195.0, min = 1180.0, max = 1215.0, unit = "rpm", free = true }
k1 = { value = 0.5, min = 0.0, max = 50.0, unit = "N m/rpm", free = true }
k2 = { value = 2.0, min = 0.0, max = 50.0, unit = "N m/rpm", free = true }
[[output]]
name = "generator_torque"
equation = "K*generator_speed**2 + k1*max(generator_speed - w1, 0) + k2*max(generator_speed - w2, 0)"
unit = "N m"
"""
PENDULUM = """
[model]
name = "pendulum with dry and viscous friction and drag"
[parameters]
vs = { value = 0.01, unit = "rad/s" }
w2 = { value = 25.0, min = 15.0, max = 60.0, unit = "1/s^2", free = true }
c = { value = 0.1, min = 0.0, max = 5.0, unit = "1/s", free = true }
d = { value = 0.05, min = 0.0, max = 5.0, unit = "1/s^2", free = true }
[[state]]
name = "q"
derivative = "v"
initial = { value = 2.77403, free = true }
unit = "rad"
[[state]]
name = "v"
derivative = "-w2*sin(q) - c*v - d*tanh(v/vs) + 44.5*torque"
initial = { value = -0.379808, free = true }
unit = "rad/s"
[[output]]
name = "angle"
equation = "q"
unit = "rad"
"""
DRAG = PENDULUM.replace("- d*tanh", "- e*v*abs(v) - d*tanh").replace(
    "d = {", 'e = { value = 0.01, min = 0.0, max = 1.0, unit = "1", free = true }\nd = {'
)
HEATERS = """
[model]
name = "first heater with a sensor, and warmth of the second"
[parameters]
k1 = { value = 0.004, min = 0.0, max = 0.1, unit = "K/s", free = true }
k12 = { value = 0.0001, min = 0.0, max = 0.1, unit = "K/s", free = true }
a1 = { value = 0.004, min = 0.0001, max = 0.1, unit = "1/s", free = true }
T0 = { value = 22.0, min = 0.0, max = 50.0, unit = "degC", free = true }
ts = { value = 9.0, min = 1.0, max = 60.0, unit = "s", free = true }
[[state]]
name = "T"
derivative = "k1*Q1 + k12*Q2 - a1*(T - T0)"
initial = { value = 50.0, free = true }
unit = "degC"
[[state]]
name = "s"
derivative = "(T - s)/ts"
initial = { value = 50.0, free = true }
unit = "degC"
[[output]]
name = "T1"
equation = "s"
unit = "degC"
"""
TANKS = """
[model]
name = "cascaded tanks, the upper one runs over into the lower one, which is full at the sensor's end"
[parameters]
top = { value = 10.0, unit = "V" }
spill = { value = 1.0, unit = "1/s" }
full = { value = 10.0, unit = "V" }
k1 = { value = 0.054, min = 0.005, max = 0.5, unit = "V^0.5/s", free = true }
k2 = { value = 0.054, min = 0.005, max = 0.5, unit = "V^0.5/s", free = true }
k3 = { value = 0.054, min = 0.005, max = 0.5, unit = "V^0.5/s", free = true }
k4 = { value = 0.040, min = 0.005, max = 0.5, unit = "1/s", free = true }
k5 = { value = 0.2, min = 0.0, max = 1.0, unit = "1", free = true }
[[state]]
name = "h1"
derivative = "-k1*sqrt(max(h1, 0)) + k4*u - spill*max(h1 - full, 0)"
initial = { value = 6.0, free = true }
unit = "V"
[[state]]
name = "h2"
derivative = "k2*sqrt(max(h1, 0)) - k3*sqrt(max(h2, 0)) + k5*spill*max(h1 - full, 0) - spill*max(h2 - top, 0)"
initial = { value = 5.2, free = true }
unit = "V"
[[output]]
name = "y"
equation = "h2"
unit = "V"
"""

RIGS = {
    "stage": Rig(
        "emps", ("estimation.csv.gz",), STAGE, {"M": 95.1, "Fv": 203.5, "Fc": 20.4, "offset": -3.2}, 0.005,
        "published: best free run 2.64 mm on another recording",
    ),
    "torque law": Rig(
        "real_swift_gain", ("unstable_dynamics_3.csv.gz", "unstable_dynamics_4.csv.gz"), TORQUE, {"K": 3.67e-4}
    ),
    "pendulum": Rig("real_pendulum_friction", ("recording.csv.gz",), PENDULUM, {"w2": 30.99, "c": 0.0223, "d": 0.183}),
    "pendulum, drag": Rig("real_pendulum_friction", ("recording.csv.gz",), DRAG, {"w2": 30.99, "d": 0.183}),
    "heaters": Rig(
        "real_heater_coupling",
        ("closed_1.csv.gz", "closed_2.csv.gz", "prbs.csv.gz", "closed_4.csv.gz", "closed_5.csv.gz"), HEATERS,
        {"k1": 2.878e-3, "k12": 4.154e-4, "a1": 5.486e-3},
    ),
    "tanks": Rig(
        "cascaded_tanks", ("estimation.csv", "validation.csv"), TANKS, {}, None,
        "published: 0.191 V with overflow, 0.588 V linear",
    ),
}  # fmt: skip


def fitted(rig: Rig, known: Path) -> Estimate:
    """Return the fit of a case's structure to its recordings."""
    roles = replace(Roles.load(known / rig.folder / "roles.toml"), resample=rig.resample)
    records = [read_record(known / rig.folder / name, roles) for name in rig.files]
    model = from_toml(parse_toml(rig.structure, "structure"), rig.structure, "structure")
    return estimate(make_case(records, model, title=rig.folder, source="structure", sha256=""))


def told(name: str, rig: Rig, found: Estimate) -> list[str]:
    """Return a row of the table a value, and what the free run says."""
    rows, other = [], {m.parameter.name: m for m in found.others}
    for m in found.values:
        published = rig.published.get(m.parameter.name)
        beside = other.get(m.parameter.name)
        rest = "" if beside is None else f"{beside.value:.4g} ± {beside.std:.2g}"
        held = "" if published is None else "yes" if abs(m.value - published) <= NORMAL * m.std else "no"
        rows.append(
            f"| {name} | {m.parameter.name} {m.parameter.unit} | {m.value:.5g} ± {m.std:.2g}"
            f"{', parts differ' if m.parameter.name in found.apart else ''} | {'' if published is None else published} "
            f"| {held} | {rest} |"
        )
    source = "free run" if found.by_run else "predictions"
    for c in found.checks:
        rows.append(
            f"| {name} | run free, {c.output} {c.unit} | {c.fitted_free:.3g} (declared {c.declared_free:.3g}); "
            f"values of the {source} | {rig.remark} | | |"
        )
    return rows


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=Path, default=KNOWN)
    parser.add_argument("--only", nargs="*", default=list(RIGS))
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    lines = ["| case | value | fitted | published | within | the other fit |", "|---|---|---|---|---|---|"]
    print("\n".join(lines), flush=True)
    for name in given.only:
        rows = told(name, RIGS[name], fitted(RIGS[name], given.cases))
        print("\n".join(rows), flush=True)
        lines += rows
    if given.out:
        given.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
