"""Diagnose a model against recordings: locate, name, model and prove what it leaves out.

The package is called, too: see aeolid.api.diagnosing.diagnose.
"""

from aeolid.calling import call_as

call_as(__name__, "aeolid.api.diagnosing")
