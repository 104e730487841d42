"""The score bank: every hypothesis judged without being fitted."""
