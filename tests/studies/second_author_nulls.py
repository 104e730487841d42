"""Systems of second_author.py whose models are complete: whatever is named there is a false name.

Declared values are off by some per cent, and the recordings have what those of machines have: coloured noise,
converters of few bits, samples between the rows, filters against aliases, lost rows, gaps, several recordings, loops.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from second_author_machines import gimbal, plates, reactor
from second_author_parts import Case
from second_author_plants import cylinder, damper, magnet, motor, vehicle
from second_author_turbines import above_rated

NULLS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "null_hyd": (15, partial(cylinder, complete=True)),
    "null_motor": (16, partial(motor, complete=True)),
    "null_vehicle": (18, partial(vehicle, complete=True)),
    "null_maglev": (43, partial(magnet, complete=True)),
    "null_wt": (44, partial(above_rated, name="null_wt", rows=1500, cuts=(500, 1000))),
    "null_cstr": (46, partial(reactor, complete=True)),
    "null_damper": (47, partial(damper, complete=True)),
    "null_gimbal": (48, partial(gimbal, kind="null", rows=1000)),
    "null_chain": (49, partial(plates, kind="null", rows=800)),
}
