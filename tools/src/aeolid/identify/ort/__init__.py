"""Identify a plant in closed loop from a measured disturbance: paper 002."""

from aeolid.identify.ort.identify import identify_ort
from aeolid.identify.ort.result import OrtIdentification

__all__ = ["OrtIdentification", "identify_ort"]
