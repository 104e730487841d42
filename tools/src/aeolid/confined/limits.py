"""State what a confined function may use."""

from __future__ import annotations

from dataclasses import dataclass

MIB = 1 << 20


@dataclass(frozen=True)
class Limits:
    """Bound one run of a confined function; None of the values is a guess of the child, all hold from outside.

    memory: bytes it may allocate beyond its code (RLIMIT_DATA; the address space, RLIMIT_AS, has `mapped` more for
    libraries and mapped files). cpu_s: processor seconds, all its threads together. patience_s: seconds without a word
    from it. result: bytes of everything it sends back. file_size: bytes of the largest file it may write; 0 forbids
    writing. network: whether it may open sockets.
    """

    memory: int = 1024 * MIB
    cpu_s: int = 30
    patience_s: float = 300.0
    result: int = 256 * MIB
    file_size: int = 0
    mapped: int = 2048 * MIB
    network: bool = False
