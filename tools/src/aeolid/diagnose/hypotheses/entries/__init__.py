"""The catalogue's entries, one module an effect."""
