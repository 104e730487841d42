"""Identify and diagnose wind-turbine models from controller recordings."""

__version__ = "0.1.0"
