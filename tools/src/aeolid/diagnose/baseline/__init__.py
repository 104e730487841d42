"""The baseline of either kind, of a simulator's run or a unit, extended and fitted."""
