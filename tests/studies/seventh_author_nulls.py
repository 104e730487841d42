"""Systems of seventh_author.py whose models are complete: whatever is named there is a false name.

Declared values are up to 8 % off, and two that are not fitted a fifth to a quarter: there the right answer is a wrong
parameter. The recordings have what those of loggers have: coloured noise, converters of few bits, a jittering clock,
lost rows, a gap, several recordings, some from rest, loops that hear noise, and what drives a plant and nobody records.
One model is linear, in discrete time; one is of a wind turbine.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from second_author_parts import Case
from seventh_author_drives import decanter
from seventh_author_flows import press, receiver, sump
from seventh_author_heat import greenhouse
from seventh_author_rotors import store, tapping
from seventh_author_turbines import soft
from seventh_author_vehicles import gantry

NULLS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "null_tapping": (528, partial(tapping, complete=True)),
    "null_flywheel": (529, partial(store, complete=True)),
    "null_decanter": (530, partial(decanter, complete=True)),
    "null_receiver": (531, partial(receiver, complete=True)),
    "null_sump": (532, partial(sump, complete=True)),
    "null_greenhouse": (533, partial(greenhouse, complete=True)),
    "null_gantry": (534, partial(gantry, complete=True)),
    "null_cushion": (535, partial(press, complete=True)),
    "null_tall_tower": (536, partial(soft, complete=True)),
}
