"""Kernels with CAN interfaces, of which the host needs none: User-Mode Linux, else a PC that QEMU emulates.

User-Mode Linux is the faster one. Where it ends without a result (before Linux 6.13 on processors with AMX, whose
registers outgrow its buffers), the emulated PC runs the same steps, on any x86-64 and without virtualisation.
AEOLID_CAN_GUEST=uml or =qemu allows one of them alone.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
USER_MODE = ROOT / "build/uml/usr/bin/linux.uml"
USER_MODE_MODULES = ROOT / "build/uml/usr/lib/uml/modules"
EMULATED = ROOT / "build/can-guest"  # Debian's kernel and some of its modules
MODULES = ("virtio_pci", "9pnet_virtio", "9p", "can_raw", "vcan", "slcan")
# A guest hangs that says nothing for so long and hardly computes meanwhile, or computes without an end; the slower one
# takes 70 s of processor, which on a loaded machine may be half an hour. One whose processes all wait
# and that computed nothing between two looks hangs too: steps look every 0.02 s, and to lack the processor is no wait.
PATIENCE_S, LEAST_PROCESSOR_S, MOST_PROCESSOR_S = 600.0, 5.0, 1200.0
STILL_S = 60.0
PR_SET_PDEATHSIG = 1
INSTALL = "sh tools/setup tests"


class NoResult(Exception):
    """A guest ended, or was ended, before its program did."""


@dataclass(frozen=True)
class Guest:
    """A way to run a script in a kernel of its own: `command` for a folder that the script may write to."""

    name: str
    missing: Callable[[], str]  # what is not there; empty where it can be used
    command: Callable[[Path], list[str]]
    modules: str = ""  # where the script finds CAN modules to load; empty where they are loaded


def user_mode_missing() -> str:
    """Name what User-Mode Linux lacks."""
    return "" if USER_MODE.exists() else f"user-mode-linux is not there ({INSTALL} fetches it)"


def user_mode_command(out: Path) -> list[str]:
    """Boot User-Mode Linux on the host's files."""
    words = [str(USER_MODE), "mem=768M", "root=/dev/root", "rootfstype=hostfs", "rw", f"init={HERE / 'init'}", "quiet"]
    return [*words, "con=null", "con0=null,fd:1", f"guest_out={out}", f"guest_python={sys.executable}"]


def emulator_missing() -> str:
    """Name what the emulated PC lacks."""
    if shutil.which("qemu-system-x86_64") is None:
        return f"qemu-system-x86 is not installed ({INSTALL})"
    if not list(EMULATED.glob("boot/vmlinuz-*")):
        return "the emulator's kernel is not there (sh tests/sil/uml/fetch qemu)"
    return ""


def emulator_command(out: Path) -> list[str]:
    """Boot Debian's kernel on an emulated PC, the host's files shared read-only and the folder writable."""
    disk = out / "initrd"
    disk.write_bytes(make_initrd(out))
    told = f"console=ttyS0 quiet panic=-1 mitigations=off nowatchdog rcupdate.rcu_cpu_stall_suppress=1 guest_out={out} "
    told += f"guest_init={HERE / 'init'} guest_python={sys.executable}"
    # Nehalem has what numpy's wheels need at least (x86-64-v2), and is the same machine under every version of QEMU.
    words = [
        "qemu-system-x86_64",
        "-accel",
        "tcg",
        "-machine",
        "pc",
        "-cpu",
        "Nehalem",
        "-m",
        "1024",
        "-no-user-config",
    ]
    words += ["-nodefaults", "-display", "none", "-serial", "stdio", "-no-reboot", "-append", told]
    words += ["-kernel", str(next(EMULATED.glob("boot/vmlinuz-*"))), "-initrd", str(disk)]
    for name, path, more in (("host", "/", ",readonly=on,multidevs=remap"), ("out", str(out), "")):
        words += ["-fsdev", f"local,id={name},path={path},security_model=none{more}"]
        words += ["-device", f"virtio-9p-pci,fsdev={name},mount_tag={name}"]
    return words


GUESTS = (
    Guest("uml", user_mode_missing, user_mode_command, str(USER_MODE_MODULES)),
    Guest("qemu", emulator_missing, emulator_command),
)


def make_initrd(scratch: Path) -> bytes:
    """Make the initial RAM disk: our first process and the kernel's modules, in the order of their dependencies."""
    program = scratch / "first"
    subprocess.run(["gcc", "-std=gnu99", "-O1", "-static", str(HERE / "first.c"), "-o", str(program)], check=True)
    parts = [pack_file(name, 0o40755) for name in ("dev", "proc", "host", "modules")]
    parts.append(pack_file("init", 0o100755, program.read_bytes()))
    for k, path in enumerate(order_modules(EMULATED)):
        parts.append(pack_file(f"modules/{k:02}-{path.name}", 0o100644, path.read_bytes()))
    return b"".join([*parts, pack_file("TRAILER!!!", 0)])


def pack_file(name: str, mode: int, data: bytes = b"") -> bytes:
    """Return one entry of a cpio archive in the kernel's format (newc)."""
    text = name.encode() + b"\0"
    fields = (0, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(text), 0)
    head = b"070701" + b"".join(b"%08X" % field for field in fields) + text
    return head + bytes(-len(head) % 4) + data + bytes(-len(data) % 4)


def order_modules(tree: Path) -> list[Path]:
    """List the files of MODULES after those that they depend on; what is built into the kernel has no file."""
    files = {path.name.removesuffix(".ko").replace("-", "_"): path for path in tree.rglob("*.ko")}
    ordered: dict[str, Path] = {}

    def add(name: str) -> None:
        if name in ordered or name not in files:
            return
        told = re.search(rb"\0depends=([^\0]*)\0", files[name].read_bytes())
        for other in (told[1].decode() if told else "").split(","):
            add(other.replace("-", "_"))
        ordered[name] = files[name]

    for name in MODULES:
        add(name)
    return list(ordered.values())


def end_with_us() -> None:
    """Have the kernel end this process when the tests' process ends, however that is."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def boot(guest: Guest, out: Path, clock: Callable[[], float] = time.monotonic) -> None:
    """Run the script in a guest to its end, as long as it goes on; raises NoResult where the guest came to none."""
    begun = clock()
    with (out / "console.log").open("wb") as console:
        process = subprocess.Popen(guest.command(out), stdin=subprocess.DEVNULL, stdout=console, preexec_fn=end_with_us,
                                   stderr=subprocess.STDOUT, start_new_session=True)  # fmt: skip
    try:
        wait_while_it_goes_on(process, out, clock)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    if not (out / "code").exists():
        told = "".join(text[-600:].decode(errors="replace") for text in read_logs(out))
        raise NoResult(f"{guest.name} ended after {clock() - begun:.0f} s without a result: {told}")


def wait_while_it_goes_on(process: subprocess.Popen[bytes], out: Path, clock: Callable[[], float]) -> None:
    """Wait for a guest's end, or until it hangs."""
    heard, said, spent = clock(), 0, 0.0
    looked, computed = clock(), -1.0
    while process.poll() is None:
        if clock() - looked >= STILL_S:
            before, computed = computed, processor_s(process.pid)
            if computed == before and all_wait(process.pid):
                return
            looked = clock()
        if (now := sum(len(text) for text in read_logs(out))) != said:
            said, heard = now, clock()
        if clock() - heard >= PATIENCE_S:
            before, spent = spent, processor_s(process.pid)
            if spent - before < LEAST_PROCESSOR_S or spent > MOST_PROCESSOR_S:
                return
            heard = clock()
        time.sleep(0.05)


def session_stats(session: int) -> Iterator[list[str]]:
    """Yield the fields of /proc/PID/stat after the name, of each process of a session."""
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = path.read_text().rpartition(")")[2].split()
            if int(fields[3]) == session:
                yield fields


def processor_s(session: int) -> float:
    """Return the processor time of a session's processes, those that have ended included, in seconds."""
    ticks = sum(sum(map(int, fields[11:15])) for fields in session_stats(session))
    return ticks / os.sysconf("SC_CLK_TCK")


def all_wait(session: int) -> bool:
    """Tell whether no process of a session runs, could run, or waits for a disk."""
    return not any(fields[0] in "RD" for fields in session_stats(session))


def read_logs(out: Path) -> list[bytes]:
    """Return what the kernel and the script have said so far."""
    return [path.read_bytes() for path in (out / "console.log", out / "guest.log") if path.exists()]


def allowed(environment: Mapping[str, str] = os.environ) -> list[Guest]:
    """List the guests to try, the faster first."""
    wanted = environment.get("AEOLID_CAN_GUEST", "")
    if wanted not in ("", *(guest.name for guest in GUESTS)):
        raise ValueError(f"AEOLID_CAN_GUEST={wanted}: uml, qemu or nothing")
    return [guest for guest in GUESTS if wanted in ("", guest.name)]


def run_first(guests: list[Guest], folder: Path, prepare: Callable[[Guest, Path], None]) -> tuple[Path | None, str]:
    """Run the script in the first guest that brings a result, each in its own folder.

    Returns the folder (None where every guest is missing or fails on this processor) and why others brought nothing.
    Raises NoResult where the last guest, which runs anywhere, is there and brings nothing.
    """
    reasons: list[str] = []
    failed = False
    for guest in guests:
        if failed and guest.missing():
            subprocess.run(["sh", str(HERE / "fetch"), guest.name], check=False)
        if lacking := guest.missing():
            reasons.append(lacking)
            continue
        out = folder / guest.name
        out.mkdir()
        prepare(guest, out)
        try:
            boot(guest, out)
            return out, "; ".join(reasons)
        except NoResult as error:
            failed = True
            reasons.append(str(error))
            if guest is GUESTS[-1]:
                raise
    return None, "; ".join(reasons)
