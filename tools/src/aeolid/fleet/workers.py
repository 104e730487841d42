"""Spread pieces of work over this process, local processes or a cluster, with one interface.

Dask carries the work to processes and clusters: the same call runs on a laptop and on a scheduler's address, a worker
that dies is replaced and its piece repeated, and memory is limited for each. One worker needs none of that and works
in the calling process.
"""

from __future__ import annotations

import importlib
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from aeolid.children import guard_children
from aeolid.errors import UsageError
from aeolid.fleet.tasks import reason_of

AHEAD = 4  # pieces handed out for each worker beyond the one it does: the queue stays short however large the fleet


class Pool(Protocol):
    """Do pieces of work in any order."""

    def run(self, function: Callable[..., Any], items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
        """Yield (index, function(items[index], *shared)) as they finish; a lost piece yields its exception."""
        ...


class Inline:
    """Do everything in this process, one after another."""

    def run(self, function: Callable[..., Any], items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
        """Yield (index, function(items[index], *shared)) in order."""
        for index, item in enumerate(items):
            yield index, function(item, *shared)


def _distributed() -> Any:
    """Return the package, without its types: half of its calls have none."""
    return importlib.import_module("distributed")


class Dask:
    """Hand pieces to a Dask client, a few ahead for each worker."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def run(self, function: Callable[..., Any], items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
        """Yield (index, function(items[index], *shared)) as they finish; a lost piece yields its exception."""
        waiting = iter(enumerate(items))
        index_of: dict[str, int] = {}
        running = _distributed().as_completed()

        def hand_out(count: int) -> None:
            for _, (index, item) in zip(range(count), waiting, strict=False):
                future = self.client.submit(function, item, *shared, pure=False)
                index_of[future.key] = index
                running.add(future)

        hand_out((1 + AHEAD) * max(1, len(self.client.ncores())))
        for future in running:
            error = future.exception()
            yield index_of.pop(future.key), future.result() if error is None else error
            hand_out(1)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Let processes started here ignore Ctrl-C, which reaches all of a terminal: this one stops them in good order."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def open_pool(workers: int, scheduler: str | None = None, *, threads: bool = False) -> Iterator[Pool]:
    """Open a pool; workers 1 without a scheduler is this process.

    scheduler: address of a Dask scheduler whose workers see the same paths. threads: workers are threads here, not
    processes. Raises UsageError on an address that does not answer.
    """
    if scheduler is None and workers == 1 and not threads:
        yield Inline()
        return
    import dask

    guard_children()
    distributed = _distributed()
    with dask.config.set({"distributed.logging.distributed": "error", "distributed.comm.timeouts.connect": "10s"}):
        if scheduler is not None:
            try:
                client = distributed.Client(scheduler, timeout="10s")
            except (OSError, ValueError, TypeError) as error:
                raise UsageError(f"--scheduler {scheduler}: no Dask scheduler answers ({reason_of(error)})") from None
            with client:
                yield Dask(client)
            return
        with _deaf_to_interrupts():
            cluster = distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=not threads, dashboard_address=":0",
                silence_logs="ERROR",
            )  # fmt: skip
        with cluster, distributed.Client(cluster) as client:
            yield Dask(client)
