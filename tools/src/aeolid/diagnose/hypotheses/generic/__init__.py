"""Forms that no entry has and that get no name."""
