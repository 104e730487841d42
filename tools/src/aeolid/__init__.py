"""Identify and diagnose wind-turbine models from controller recordings.

    import aeolid as ae

    rec = ae.read("monday.csv", roles="roles.toml")
    model = ae.identify(rec, past=30)

What is named here is imported when it is first used. identify, diagnose and fleet are packages, and called.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from aeolid import arithmetic

if TYPE_CHECKING:
    from aeolid.api.campbell import CampbellDiagram as CampbellDiagram
    from aeolid.api.campbell import campbell as campbell
    from aeolid.api.designing import Excitation as Excitation
    from aeolid.api.designing import design as design
    from aeolid.api.diagnosing import diagnose as diagnose
    from aeolid.api.diagnosis import Diagnosis as Diagnosis
    from aeolid.api.diagnosis import Effect as Effect
    from aeolid.api.equations import Equations as Equations
    from aeolid.api.fitted import EquationsFit as EquationsFit
    from aeolid.api.following import Fleet as Fleet
    from aeolid.api.following import fleet as fleet
    from aeolid.api.identifying import identify as identify
    from aeolid.api.linear import LinearModel as LinearModel
    from aeolid.api.modal import ModalAnalysis as ModalAnalysis
    from aeolid.api.modal import modes as modes
    from aeolid.api.models import load_model as load_model
    from aeolid.api.reading import read as read
    from aeolid.api.record import Record as Record
    from aeolid.api.scheduled import ScheduledModel as ScheduledModel
    from aeolid.api.setups import MergedModes as MergedModes
    from aeolid.api.setups import merge_setups as merge_setups
    from aeolid.api.simulation import Simulation as Simulation
    from aeolid.api.simulation import simulate as simulate
    from aeolid.api.table import Table as Table
    from aeolid.api.validation import Validation as Validation
    from aeolid.api.validation import validate as validate
    from aeolid.errors import AeolidError as AeolidError
    from aeolid.errors import DataError as DataError
    from aeolid.errors import NotIdentifiable as NotIdentifiable
    from aeolid.errors import UsageError as UsageError

    __version__: str

arithmetic.settle()  # before numpy is loaded

_CALLED = ("diagnose", "fleet", "identify")
_PLACES = {
    "AeolidError": "errors", "DataError": "errors", "NotIdentifiable": "errors", "UsageError": "errors",
    "Diagnosis": "api.diagnosis", "Effect": "api.diagnosis", "Equations": "api.equations",
    "EquationsFit": "api.fitted", "Excitation": "api.designing", "Fleet": "api.following",
    "LinearModel": "api.linear", "ModalAnalysis": "api.modal", "Record": "api.record",
    "ScheduledModel": "api.scheduled", "CampbellDiagram": "api.campbell", "campbell": "api.campbell",
    "Simulation": "api.simulation", "Table": "api.table", "Validation": "api.validation", "load_model": "api.models",
    "modes": "api.modal", "read": "api.reading", "simulate": "api.simulation", "validate": "api.validation",
    "design": "api.designing", "MergedModes": "api.setups", "merge_setups": "api.setups",
}  # fmt: skip

__all__ = ["__version__", *_CALLED, *_PLACES]


def __getattr__(name: str) -> Any:
    """Import what is asked for the first time."""
    if name in _CALLED:
        return import_module(f"aeolid.{name}")
    if name == "__version__":  # of the C library's header, include/aeolid/aeolid.h, when the package was built
        from importlib.metadata import version

        return globals().setdefault(name, version("aeolid"))
    if name not in _PLACES:
        raise AttributeError(f"module 'aeolid' has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(f"aeolid.{_PLACES[name]}"), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
