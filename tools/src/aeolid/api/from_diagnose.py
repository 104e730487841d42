"""Gather what the public interface takes from the package of the diagnosis: here, and nowhere else in it."""

from aeolid.diagnose.candidates.moved import Moved
from aeolid.diagnose.conclude import conclude, ended
from aeolid.diagnose.data.case import Case, make_case
from aeolid.diagnose.deadline import Deadline
from aeolid.diagnose.estimate import Check, Estimate, estimate

__all__ = ["Case", "Check", "Deadline", "Estimate", "Moved", "conclude", "ended", "estimate", "make_case"]
