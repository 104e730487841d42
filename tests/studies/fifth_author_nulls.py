"""Systems of fifth_author.py whose models are complete: whatever is named there is a false name.

Declared values are 1 to 8 % off, and the recordings have what those of loggers have: coloured noise, converters of few
bits, filters against aliases, lost rows, several recordings, stretches where all stands or the logger hangs, loops that
hear noise, and what drives a plant and nobody records. Two models are linear, one in continuous and one in discrete
time; two are of wind turbines.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from fifth_author_machines import clutch, pole, rov
from fifth_author_pairs import surge
from fifth_author_processes import barrel, chamber, drum, lakes
from fifth_author_rotors import bearing, darrieus
from second_author_parts import Case

NULLS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "null_upright": (341, partial(darrieus, complete=True)),
    "null_bearing": (342, partial(bearing, complete=True)),
    "null_pole": (343, partial(pole, complete=True)),
    "null_barrel": (344, barrel),
    "null_clutch": (345, partial(clutch, complete=True)),
    "null_diver": (346, partial(rov, complete=True)),
    "null_chamber": (347, partial(chamber, complete=True)),
    "null_ponds": (348, partial(lakes, complete=True)),
    "null_drum": (349, partial(drum, complete=True)),
    "null_surge_tank": (350, partial(surge, complete=True)),
}
