"""Identify and diagnose wind-turbine models from controller recordings."""

from importlib.metadata import version

__version__ = version("aeolid")  # of the C library's header, include/aeolid/aeolid.h, when the package was built
