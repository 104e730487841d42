"""Know the free parameters that the diagnosis adds to a model and that are no physics: offsets, noise, timing."""

from __future__ import annotations

import re

from aeolid.diagnose.structure import modal
from aeolid.diagnose.structure.forces import RATE
from aeolid.models.intersample import FILTER, OFFSET

WIND = ("share", "level", "rate")  # behind the prefix: how the wind of a model follows a recorded one
WIND_PREFIX = "recorded_wind_"
# exactly the names that are given, so that a user's own name that begins alike remains a constant of the model
_NAMES = re.compile(
    rf"bias_[uy]\d+|noise_pole\d+|{RATE}\w+|{WIND_PREFIX}({'|'.join(WIND)})|{OFFSET}|{FILTER}"
    rf"|{modal.PREFIX}([aw]\d+|[bc]\d+_\d+)",
    re.ASCII,
)


def is_nuisance(name: str) -> bool:
    """Tell whether a parameter of this name is one that the diagnosis has added to a model for itself."""
    return _NAMES.fullmatch(name) is not None
