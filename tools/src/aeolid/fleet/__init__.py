"""Follow the modes of many turbines over months: recordings to factors, factors to models, models to drift.

The package is called, too: see aeolid.api.following.fleet.
"""

from aeolid.calling import call_as

call_as(__name__, "aeolid.api.following")
