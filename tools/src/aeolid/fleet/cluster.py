"""Hand pieces to the workers of a Dask scheduler that the user runs, over TLS with certificates on both sides.

Whoever reaches a scheduler without TLS can run programs on its workers, and what it answers is unpickled here; so a
plain connection, on the loopback too, where every other user of the machine is, needs a word of its own.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aeolid.errors import UsageError
from aeolid.fleet.tasks import reason_of
from aeolid.fleet.workers import Pool

AHEAD = 4  # pieces handed out for each worker beyond the one it does: the queue stays short however large the fleet
CONNECT = "10s"


@dataclass(frozen=True)
class Scheduler:
    """Say where a scheduler is and how it is trusted.

    address: tls://HOST:PORT, without a scheme the same; tcp://HOST:PORT where `insecure`. authority, certificate, key:
    PEM files of the authority that signed every certificate of the cluster, and of this client's own; None: those of
    Dask's configuration (distributed.comm.tls).
    """

    address: str
    authority: Path | None = None
    certificate: Path | None = None
    key: Path | None = None
    insecure: bool = False

    def check(self) -> str:
        """Return the address with its scheme; raises UsageError where it is not to be trusted or a file is missing."""
        address = self.address if "://" in self.address else f"tls://{self.address}"
        scheme = address.partition("://")[0]
        if scheme == "tcp" and not self.insecure:
            raise UsageError(
                f"--scheduler {self.address}: without TLS everybody who reaches it can run programs as you; start it"
                " with certificates and name tls://HOST:PORT, or say --insecure-scheduler where only you are"
            )
        if scheme not in ("tls", "tcp"):
            raise UsageError(f"--scheduler {self.address}: tls://HOST:PORT is needed")
        given = {"--tls-ca": self.authority, "--tls-cert": self.certificate, "--tls-key": self.key}
        if scheme == "tcp" and any(given.values()):
            raise UsageError(f"--scheduler {self.address}: certificates go with tls://HOST:PORT")
        if any(given.values()) and not all(given.values()):
            missing = " and ".join(name for name, path in given.items() if path is None)
            raise UsageError(f"{missing}: missing; --tls-ca, --tls-cert and --tls-key go together")
        for name, path in given.items():
            if path is not None and not path.is_file():
                raise UsageError(f"{name} {path}: there is no such file")
        return address


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


def _distributed() -> Any:
    """Return the package, without its types: half of its calls have none. Raises UsageError where it is missing."""
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        missing = (error.name or "distributed").partition(".")[0]
        raise UsageError(
            f"--scheduler needs {missing}, which is not installed: pip install 'aeolid[cluster]'"
        ) from None


@contextmanager
def open_cluster(scheduler: Scheduler) -> Iterator[Pool]:
    """Connect to a scheduler whose workers see the same paths.

    Raises UsageError on one that is not to be trusted (`Scheduler.check`), does not answer, or has other certificates.
    """
    address = scheduler.check()
    distributed = _distributed()
    import dask

    files = {
        "tls_ca_file": scheduler.authority,
        "tls_client_cert": scheduler.certificate,
        "tls_client_key": scheduler.key,
    }
    security = distributed.Security(
        require_encryption=address.startswith("tls:"), **{k: str(v) for k, v in files.items() if v is not None}
    )
    if address.startswith("tls:") and not (security.tls_ca_file and security.tls_client_cert):
        raise UsageError(f"--scheduler {scheduler.address}: --tls-ca, --tls-cert and --tls-key are needed")
    with dask.config.set({"distributed.logging.distributed": "error", "distributed.comm.timeouts.connect": CONNECT}):
        try:
            client = distributed.Client(address, timeout=CONNECT, security=security)
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            raise UsageError(
                f"--scheduler {scheduler.address}: no Dask scheduler answers ({reason_of(error)})"
            ) from None
        with client:
            yield Dask(client)
