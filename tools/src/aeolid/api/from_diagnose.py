"""Gather what the public interface takes from the package of the diagnosis: here, and nowhere else in it."""

from aeolid.diagnose.conclude import conclude, ended
from aeolid.diagnose.data.case import Case, make_case
from aeolid.diagnose.deadline import Deadline

__all__ = ["Case", "Deadline", "conclude", "ended", "make_case"]
