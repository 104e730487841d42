"""Systems of third_author.py whose models are complete: whatever is named there is a false name.

Declared values are off by some per cent, and the recordings have what those of machines have: coloured noise, coarse
encoders, converters of few bits, lost rows, gaps, several recordings, loops and loads that nobody records.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from second_author_parts import Case
from third_author_electric import buck, emps
from third_author_machines import wing
from third_author_processes import brake, cell, ph, thermistor
from third_author_turbines import controller, pitch, surge, turbine

NULLS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "null_wing": (141, partial(wing, complete=True)),
    "null_emps": (142, partial(emps, complete=True)),
    "null_ph": (143, partial(ph, complete=True)),
    "null_pitch": (144, partial(pitch, complete=True)),
    "null_turbine": (145, partial(turbine, kind="null")),
    "null_surge": (146, partial(surge, complete=True)),
    "null_pi": (147, partial(controller, complete=True)),
    "null_buck": (148, partial(buck, complete=True)),
    "null_ntc": (149, partial(thermistor, complete=True)),
    "null_brake": (150, brake),
    "null_cell": (151, cell),
}
