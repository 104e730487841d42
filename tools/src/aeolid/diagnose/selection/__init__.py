"""Which explanation: rivals, further effects, exchanges."""
