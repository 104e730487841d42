"""Be the confined process: take limits, then the request, then import and run what it names.

Started by its path under `python -I`, so that the folder of the caller is never searched for modules; nothing but the
standard library is imported before the limits hold.
"""

from __future__ import annotations

import importlib
import os
import resource
import signal
import sys
from collections.abc import Generator
from typing import Any, BinaryIO

_PARENT_DEATH_SIGNAL = 1


def main(arguments: list[str]) -> None:
    """Serve one request: it comes on descriptor 0, the answer leaves on descriptor 1, nothing else is open.

    arguments: memory, mapped, cpu_s, file_size and network of the limits, then folders where this package and what it
    needs are found should the interpreter not find them. Does not return.
    """
    memory, mapped, cpu_s, file_size, network = (int(word) for word in arguments[:5])
    _end_with_parent()
    _limit(memory, mapped, cpu_s, file_size)
    silent = os.open(os.devnull, os.O_RDWR)
    request, answer = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb", buffering=1 << 20)
    for descriptor in range(3):
        os.dup2(silent, descriptor)
    sys.path += [folder for folder in arguments[5:] if folder not in sys.path]
    from aeolid.confined.barrier import close_off

    close_off(writing=file_size > 0, network=bool(network))
    _serve(request, answer)
    answer.flush()
    os._exit(0)  # finalisers of damaged objects have nothing to say


def _end_with_parent() -> None:
    """Let this process be killed when the one that started it ends, however that is (Linux, prctl(2))."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PARENT_DEATH_SIGNAL, ctypes.c_ulong(signal.SIGKILL))


def _limit(memory: int, mapped: int, cpu_s: int, file_size: int) -> None:
    bounds = {
        resource.RLIMIT_DATA: memory, resource.RLIMIT_AS: memory + mapped, resource.RLIMIT_FSIZE: file_size,
        resource.RLIMIT_CORE: 0, resource.RLIMIT_NOFILE: 128, resource.RLIMIT_CPU: cpu_s,
    }  # fmt: skip
    for what, most in bounds.items():
        hard = resource.getrlimit(what)[1]
        highest = most + (what == resource.RLIMIT_CPU)  # SIGXCPU says why, a second later comes SIGKILL
        if hard != resource.RLIM_INFINITY:
            most, highest = min(most, hard), min(highest, hard)
        resource.setrlimit(what, (most, highest))


def _serve(request: BinaryIO, answer: BinaryIO) -> None:
    from aeolid.confined.channel import pack, unpack

    def fill(buffer: memoryview) -> None:
        while buffer:
            count = request.readinto(buffer)  # type: ignore[attr-defined]
            if not count:
                raise EOFError
            buffer = buffer[count:]

    def send(kind: str, facts: dict[str, Any], arrays: dict[str, Any]) -> None:
        for piece in pack({"kind": kind, "content": facts}, arrays):
            answer.write(piece)
        answer.flush()

    def hear() -> tuple[dict[str, Any], dict[str, Any]]:
        return unpack(fill, 1 << 40)[:2]  # from the parent, which is trusted

    try:
        asked, arrays = hear()
        result = _begin(asked, arrays)
        told: dict[str, Any] | None = None
        while isinstance(result, Generator):
            try:
                facts, found = result.send(told)
            except StopIteration:
                break
            send("reply", facts, found)
            told = hear()[0] if facts.get("asks") else None
        else:
            send("reply", *result)
        send("end", {}, {})
    except MemoryError:
        send("error", {"class": "MemoryError", "text": ""}, {})
    except Exception as error:
        send("error", {"class": type(error).__name__, "text": " ".join(str(error).split())[:2000]}, {})


def _begin(asked: dict[str, Any], arrays: dict[str, Any]) -> Any:
    module, _, name = asked["function"].partition(":")
    if not module.startswith("aeolid."):
        raise ImportError(f"{module} is no module of this package")
    function = getattr(importlib.import_module(module), name)
    return function(**asked["arguments"], **({"arrays": arrays} if arrays else {}))


if __name__ == "__main__":
    main(sys.argv[1:])
