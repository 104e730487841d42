"""Systems of ninth_author.py whose models are complete: whatever is named there is a false name.

They are the plants of the other modules with nothing hidden, at other working points, lengths and random streams.
Declared values are 1 to 3 % off. Four models are equations, two are linear and two are simulator's runs.
"""

from __future__ import annotations

from functools import partial

from ninth_author_axes import belt, frame
from ninth_author_floating import moored
from ninth_author_geared import simulated
from ninth_author_large import thin, waking
from ninth_author_motion import levitated
from ninth_author_parts import Makers
from ninth_author_process import chamber

NULL_MAKERS: Makers = {
    "null_direct_drive": (981, partial(thin, complete=True)),
    "null_afloat": (982, partial(moored, complete=True)),
    "null_levitated": (983, partial(levitated, complete=True)),
    "null_chamber_hall": (984, partial(chamber, complete=True)),
    "null_direct_linear": (985, partial(waking, complete=True)),
    "null_frame": (986, partial(frame, complete=True)),
    "null_geared_run": (987, partial(simulated, complete=True)),
    "null_belt_run": (988, partial(belt, complete=True)),
}
