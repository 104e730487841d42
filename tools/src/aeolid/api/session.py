"""Enter and leave the public interface: threads as on the command line, messages in the words of Python."""

from __future__ import annotations

import functools
import os
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, ParamSpec, TypeVar

from aeolid.api.arguments import Arguments
from aeolid.errors import AeolidError

P = ParamSpec("P")
R = TypeVar("R")
VARIABLE = "OPENBLAS_NUM_THREADS"  # what the user sets there holds, as on the command line
_OPTION = re.compile(r"(?<![\w-])--(no-)?([a-z][a-z-]*)")


class _Entered:
    """Count the calls under way: threads are limited by the first and given back by the last of them."""

    lock = threading.Lock()
    calls = 0
    limit: Any = None


@contextmanager
def one_thread() -> Iterator[None]:
    """Let linear algebra run on one thread while the block runs: on matrices this small a second one only waits.

    Calls may nest and run side by side in several threads. Where OPENBLAS_NUM_THREADS is set, that holds instead, and
    so does a limit of threadpoolctl that the caller is within.
    """
    if VARIABLE in os.environ:
        yield
        return
    with _Entered.lock:
        _Entered.calls += 1
        if _Entered.calls == 1:
            _Entered.limit = _aside(_limit)
    try:
        yield
    finally:
        with _Entered.lock:
            _Entered.calls -= 1
            if _Entered.calls == 0:
                _aside(_Entered.limit.restore_original_limits)


def _limit() -> Any:
    import scipy.linalg  # noqa: F401 - a library that is loaded later would keep its threads
    from threadpoolctl import threadpool_limits

    return threadpool_limits(1, user_api="blas")


def _aside(function: Callable[[], Any]) -> Any:
    """Return what a function gives in a thread of its own.

    threadpoolctl lets the thread that limits first, and no other as long as it lives, change the number; the first and
    the last of several calls may be in different ones.
    """
    found = []
    thread = threading.Thread(target=lambda: found.append(function()))
    thread.start()
    thread.join()
    return found[0]


def in_python(text: str) -> str:
    """Return a message with the options of the command line as parameters: --order-criterion is order_criterion."""
    return _OPTION.sub(lambda found: found[2].replace("-", "_") + ("=False" if found[1] else ""), text)


def public(function: Callable[P, R]) -> Callable[P, R]:
    """Wrap a function of the public interface: arguments checked, one thread, and errors that speak of parameters."""
    given = Arguments(function)

    @functools.wraps(function)
    def wrapped(*arguments: P.args, **settings: P.kwargs) -> R:
        own, named = given.checked(arguments, settings)
        with one_thread():
            try:
                return function(*own, **named)
            except AeolidError as error:
                error.args = tuple(in_python(a) if isinstance(a, str) else a for a in error.args)
                raise

    return wrapped
