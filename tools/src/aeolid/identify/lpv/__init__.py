"""Identify models that depend on a measured scheduling sequence: paper 001."""

from aeolid.identify.lpv.identify import identify_lpv
from aeolid.identify.lpv.result import LpvIdentification

__all__ = ["LpvIdentification", "identify_lpv"]
