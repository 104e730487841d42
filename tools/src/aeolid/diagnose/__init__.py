"""Diagnose a model against recordings: locate, name, model and prove what it leaves out."""
