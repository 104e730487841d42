"""Check what is given to a public function against its annotations, before anything is computed with it."""

from __future__ import annotations

import inspect
import numbers
from collections.abc import Callable, Iterable
from typing import Any

from aeolid.errors import UsageError
from aeolid.text_files import shown

_LARGEST = 1 << 1023  # of the whole numbers that double precision holds
_WORDS = {"int": "a whole number", "float": "a number", "str": "a text", "bool": "True or False"}


class Arguments:
    """Hold the parameters of a function whose annotations are numbers, texts, truth values or sequences.

    Others are taken as they are: the function says what it needs. NumPy's numbers count as Python's.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._signature = inspect.signature(function)
        self._kinds = {
            name: kinds
            for name, parameter in self._signature.parameters.items()
            if (kinds := _kinds(parameter.annotation))
        }

    def checked(self, arguments: tuple[Any, ...], settings: dict[str, Any]) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """Return the arguments with NumPy's numbers as Python's; raises UsageError that names one of a wrong type."""
        try:
            bound = self._signature.bind(*arguments, **settings)
        except TypeError as error:
            raise UsageError(f"{error}; help() shows the parameters") from None
        for name, kinds in self._kinds.items():
            if name in bound.arguments:
                bound.arguments[name] = _as_one_of(name, bound.arguments[name], kinds)
        return bound.args, bound.kwargs


def _kinds(annotation: Any) -> tuple[str, ...]:
    """Return the types of an annotation, empty where one of them is none that is checked."""
    if not isinstance(annotation, str):
        return ()
    kinds = tuple(part.strip() for part in annotation.split("|"))
    known = all(k in (*_WORDS, "None") or k.startswith("Sequence[") for k in kinds)
    return kinds if known and kinds != ("None",) else ()


def _as_one_of(name: str, value: Any, kinds: tuple[str, ...]) -> Any:
    if value is None and "None" in kinds:
        return value
    sequence = next((k for k in kinds if k.startswith("Sequence[")), None)
    if sequence is not None and isinstance(value, Iterable) and (not isinstance(value, str) or "str" in sequence):
        return value
    if isinstance(value, str) and "str" in kinds:
        return value
    if type(value).__name__ in ("bool", "bool_") and "bool" in kinds:
        return bool(value)
    truth = type(value).__name__ in ("bool", "bool_")
    if isinstance(value, numbers.Integral) and not truth:
        if "int" in kinds:
            return int(value)
        if "float" in kinds and abs(int(value)) < _LARGEST:
            return float(int(value))
    if isinstance(value, numbers.Real) and not isinstance(value, numbers.Integral) and not truth and "float" in kinds:
        return float(value)
    needed = [_WORDS[k] for k in kinds if k in _WORDS] + ([] if sequence is None else [f"a list of {_of(sequence)}"])
    raise UsageError(f"{name} = {shown(value)} is not {' or '.join(needed)}")


def _of(sequence: str) -> str:
    inner = sequence.removeprefix("Sequence[").removesuffix("]")
    return {"int": "whole numbers", "float": "numbers", "str": "names"}.get(inner, "such")
