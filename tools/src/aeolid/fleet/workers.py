"""Spread pieces of work over this process, local processes or a cluster, with one interface.

Local processes are children that this process starts, with a pipe to each: nothing listens on a port, so nobody else
can hand work in or look on. One that dies costs its piece and is replaced; memory is limited for each. A cluster is the
user's own Dask scheduler (aeolid.fleet.cluster). One worker needs none of that and works in the calling process.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from multiprocessing import connection
from pathlib import Path
from typing import Any, Protocol

from aeolid.children import guarded_children
from aeolid.errors import AeolidError

LEAST_BYTES = 1 << 30  # of memory that a worker is given, however small its share
STOP_S = 5.0  # until a worker that is told to stop is killed
# One thread for each worker: as many as cores would wait for each other (OpenBLAS, OpenMP, MKL, Numba).
ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1"
)


class WorkerLost(AeolidError):
    """Report a piece whose worker died over it, or that broke off with an error that does not travel."""


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


class Threads:
    """Hand pieces to threads of this process, where each waits for a process of its own."""

    def __init__(self, executor: ThreadPoolExecutor) -> None:
        self._executor = executor

    def run(self, function: Callable[..., Any], items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
        """Yield (index, function(items[index], *shared)) as they finish; a lost piece yields its exception."""
        futures: dict[Future[Any], int] = {
            self._executor.submit(function, item, *shared): index for index, item in enumerate(items)
        }
        try:
            while futures:
                for future in wait(futures, return_when=FIRST_COMPLETED).done:
                    error = future.exception()
                    yield futures.pop(future), future.result() if error is None else error
        finally:
            for future in futures:
                future.cancel()


class Processes:
    """Hand pieces to child processes, one at a time to each; they are started as they are needed."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._idle: list[_Worker] = []
        self._busy: dict[Any, tuple[_Worker, int]] = {}  # by the end of the pipe here

    def run(self, function: Callable[..., Any], items: Sequence[Any], *shared: Any) -> Iterator[tuple[int, Any]]:
        """Yield (index, function(items[index], *shared)) as they finish; a lost piece yields its exception."""
        waiting = iter(enumerate(items))
        self._hand_out(waiting, function, shared)
        while self._busy:
            for ready in connection.wait(list(self._busy)):
                worker, index = self._busy.pop(ready)
                result, alive = worker.receive()
                if alive:
                    self._idle.append(worker)
                self._hand_out(waiting, function, shared)
                yield index, result

    def _hand_out(self, waiting: Iterator[tuple[int, Any]], function: Callable[..., Any], shared: Any) -> None:
        while len(self._busy) < self._count:
            piece = next(waiting, None)
            if piece is None:
                return
            worker = self._take_idle() or _Worker(_share_of_memory(self._count))
            worker.send(function, piece[1], shared)
            self._busy[worker.pipe] = worker, piece[0]

    def _take_idle(self) -> _Worker | None:
        while self._idle:
            if (worker := self._idle.pop()).is_alive():
                return worker
            worker.kill()
        return None

    def close(self) -> None:
        """Let idle workers go and end those at work, whose pieces are lost."""
        for worker, _ in self._busy.values():
            worker.kill()
        for worker in self._idle:
            worker.dismiss()
        self._busy, self._idle = {}, []


class _Worker:
    """Own one child process. pipe: the end of its pipe here."""

    def __init__(self, most_bytes: int) -> None:
        context = multiprocessing.get_context("spawn")  # a fork would copy threads' locks in whatever state they are
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, most_bytes), name="aeolid worker")
        with guarded_children(ONE_THREAD), _deaf_to_interrupts():
            self._process.start()
        theirs.close()

    def send(self, function: Callable[..., Any], item: Any, shared: Any) -> None:
        """Hand a piece over; a worker that has died meanwhile is found by `receive`."""
        with suppress(OSError):
            self.pipe.send((function, item, shared))

    def receive(self) -> tuple[Any, bool]:
        """Return the result, or the exception in its place, and whether the worker is still there."""
        try:
            return self.pipe.recv(), True
        except (EOFError, OSError):
            pass
        except Exception as error:  # an exception that cannot be put together again here
            return WorkerLost(f"{type(error).__name__}: {error}"), True
        return self._bury(), False

    def _bury(self) -> WorkerLost:
        self._process.join(STOP_S)
        code = self._process.exitcode
        self.kill()
        how = "does not end" if code is None else f"ended with code {code}" if code >= 0 else _name_of(-code)
        return WorkerLost(f"its process {how}")

    def is_alive(self) -> bool:
        """Tell whether it is there."""
        return self._process.is_alive()

    def dismiss(self) -> None:
        """Let it end by itself, for it has nothing to do."""
        self.pipe.close()
        self._process.join(STOP_S)
        self.kill()

    def kill(self) -> None:
        """End it."""
        self.pipe.close()
        self._process.kill()
        self._process.join()


def _name_of(number: int) -> str:
    try:
        return f"was ended by {signal.Signals(number).name}"
    except ValueError:
        return f"was ended by signal {number}"


def _serve(pipe: Any, most_bytes: int) -> None:
    """Work until the other end of the pipe is closed, in a child process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _limit_memory(most_bytes)
    while True:
        try:
            function, item, shared = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            result = function(item, *shared)
        except Exception as error:
            result = error
        try:
            pipe.send(result)
        except (OSError, EOFError):
            return
        except Exception:  # cannot be pickled
            pipe.send(WorkerLost(f"{type(result).__name__}: {result}"))


def _limit_memory(most_bytes: int) -> None:
    """Have allocations fail beyond a share of the machine, before the system ends processes as it likes."""
    try:
        import resource
    except ImportError:
        return
    with suppress(ValueError, OSError):
        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        most = most_bytes if hard == resource.RLIM_INFINITY else min(most_bytes, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def _share_of_memory(workers: int) -> int:
    """Return the bytes for one of so many workers: all of them together stay within the machine."""
    try:
        whole = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 1 << 62
    with suppress(OSError, ValueError):  # "max" where the container has no limit of its own
        whole = min(whole, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return max(LEAST_BYTES, whole * 9 // 10 // workers)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Start children that ignore Ctrl-C, which reaches all of a terminal: this process ends them in good order."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def open_pool(workers: int, *, threads: bool = False) -> Iterator[Pool]:
    """Open a pool; workers 1 is this process. threads: workers are threads here, not processes."""
    if threads:
        with ThreadPoolExecutor(workers) as executor:
            try:
                yield Threads(executor)
            except BaseException:
                executor.shutdown(wait=False, cancel_futures=True)
                raise
    elif workers == 1:
        yield Inline()
    else:
        pool = Processes(workers)
        try:
            yield pool
        finally:
            pool.close()
