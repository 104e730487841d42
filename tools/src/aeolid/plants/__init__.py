"""plants."""
