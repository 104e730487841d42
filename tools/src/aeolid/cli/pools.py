"""Options for work on several processes or a cluster, the same for every command that has them."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aeolid.errors import UsageError

if TYPE_CHECKING:
    from aeolid.fleet.workers import Pool

MOST_WORKERS = 1024

WorkersOption = Annotated[
    int | None, typer.Option("--workers", help="Local processes; default one a core, 1 is this process.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option("--scheduler", help="tls://HOST:PORT of a Dask scheduler whose workers see the same paths."),
]
TlsCaOption = Annotated[
    Path | None, typer.Option("--tls-ca", help="Certificate of the authority of that cluster, PEM.")
]
TlsCertOption = Annotated[Path | None, typer.Option("--tls-cert", help="Certificate to show to it, PEM.")]
TlsKeyOption = Annotated[Path | None, typer.Option("--tls-key", help="Its key, PEM.")]
InsecureOption = Annotated[
    bool,
    typer.Option("--insecure-scheduler", help="Take tcp://HOST:PORT too: whoever reaches it runs programs as you."),
]


def cores() -> int:
    """Return the cores that this process may use; where the system does not say, all there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Where:
    """Say where pieces of work are done, as the options have it."""

    workers: int | None
    scheduler: str | None
    authority: Path | None
    certificate: Path | None
    key: Path | None
    insecure: bool

    def check(self) -> None:
        """Raise UsageError on options that do not go together."""
        if self.workers is not None and (self.scheduler is not None or not 1 <= self.workers <= MOST_WORKERS):
            raise UsageError(f"--workers is 1 to {MOST_WORKERS} local processes, and goes without --scheduler")
        if self.scheduler is None and (self.authority or self.certificate or self.key or self.insecure):
            raise UsageError("--tls-ca, --tls-cert, --tls-key and --insecure-scheduler go with --scheduler")

    def open(self, pieces: int, usual: int | None = None) -> AbstractContextManager[Pool]:
        """Open the pool for so many pieces; usual: workers where none are asked for, None for one a core."""
        if self.scheduler is None:
            from aeolid.fleet.workers import open_pool

            return open_pool(max(1, min(self.workers or usual or cores(), pieces)))
        from aeolid.fleet.cluster import Scheduler, open_cluster

        return open_cluster(Scheduler(self.scheduler, self.authority, self.certificate, self.key, self.insecure))
