"""Let a package be called: `aeolid.identify` holds the modules of identification and is also a function."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any


class CallablePackage(ModuleType):
    """Pass calls on to a function, which is imported at the first one."""

    _place: str

    @property
    def __signature__(self) -> inspect.Signature:
        return inspect.signature(self._function())

    def __call__(self, *arguments: Any, **settings: Any) -> Any:
        """Call the function of the public interface, see help(package.__wrapped__)."""
        return self._function()(*arguments, **settings)

    @property
    def __wrapped__(self) -> Callable[..., Any]:
        return self._function()

    def _function(self) -> Callable[..., Any]:
        function: Callable[..., Any] = getattr(import_module(self._place), self.__name__.rpartition(".")[2])
        return function


def call_as(package: str, place: str) -> None:
    """Make the package `package` callable as the function of its own name in the module `place`.

    A package of the name of a function takes its place in `aeolid` as soon as one of its modules is imported, so it
    must be the function too. The module is named, not imported: it stands above the package.
    """
    module = sys.modules[package]
    module.__class__ = CallablePackage
    module._place = place  # type: ignore[attr-defined]
