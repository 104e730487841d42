"""Sealed data, null simulations, output-error fits, and forms beyond the catalogue."""
