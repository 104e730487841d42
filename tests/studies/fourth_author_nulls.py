"""Systems of fourth_author.py whose models are complete: whatever is named there is a false name.

Declared values are 1 to 8 % off, and the recordings have what those of loggers have: coloured noise, converters of few
bits, filters against aliases, lost rows, several recordings, loops that hear noise, and what drives a plant and nobody
records.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from fourth_author_electric import boost, web
from fourth_author_machines import drone, pendulum
from fourth_author_processes import glucose, room
from fourth_author_rotors import cooled, drivetrain
from fourth_author_towers import damped, platform
from fourth_author_vibration import seat, wheelset
from second_author_parts import Case

NULLS: dict[str, tuple[int, Callable[[np.random.Generator], Case]]] = {
    "null_tmd": (241, damped),
    "null_platform": (242, platform),
    "null_drivetrain": (243, drivetrain),
    "null_cooling": (244, cooled),
    "null_pendulum": (245, partial(pendulum, complete=True)),
    "null_drone": (246, partial(drone, complete=True)),
    "null_seat": (247, partial(seat, complete=True)),
    "null_wheelset": (248, wheelset),
    "null_room": (249, partial(room, complete=True)),
    "null_blood": (250, partial(glucose, complete=True)),
    "null_web": (251, partial(web, complete=True)),
    "null_boost": (252, boost),
}
