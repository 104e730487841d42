"""Identify models from recordings; the package is called, too: see aeolid.api.identifying.identify."""

from aeolid.calling import call_as

call_as(__name__, "aeolid.api.identifying")
