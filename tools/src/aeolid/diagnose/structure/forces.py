"""Say what unmeasured forces and their memories are called in an extended model."""

from __future__ import annotations

FORCE = "unmeasured_"  # before the name of the state that the force drives: its own state
RATE = "unmeasured_rate_"  # before the same: the parameter by which it forgets
