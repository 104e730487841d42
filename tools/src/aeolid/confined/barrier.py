"""Forbid this process, for good, to start programs, to open connections and to change files (Linux, seccomp).

A list of system calls that fail with "not permitted", installed after no_new_privs, so no right is needed for it. On
other kernels and processors nothing is installed; the limits of the process hold all the same. Imports the standard
library alone: it runs before anything else is loaded.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct

_NO_NEW_PRIVS, _SECCOMP, _FILTER = 38, 22, 2  # prctl(2)
_LOAD, _EQUAL, _ANY_BIT, _AT_LEAST, _RETURN = 0x20, 0x15, 0x45, 0x35, 0x06  # classic BPF
_ALLOW, _KILL, _ERRNO = 0x7FFF0000, 0x80000000, 0x00050000
_EPERM, _ENOSYS = 1, 38
_NUMBER_AT, _ARCH_AT, _ARGUMENT_AT = 0, 4, 16  # struct seccomp_data
_THREAD = 0x10000  # CLONE_THREAD
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND

# name: (x86-64, arm64); -1 where the processor does not have the call
_PROGRAMS = {"execve": (59, 221), "execveat": (322, 281), "fork": (57, -1), "vfork": (58, -1), "ptrace": (101, 117),
             "process_vm_writev": (311, 271), "bpf": (321, 280), "io_uring_setup": (425, 425), "kill": (62, 129),
             "tkill": (200, 130), "pidfd_open": (434, 434), "unshare": (272, 97), "setns": (308, 268),
             "mount": (165, 40)}  # fmt: skip
_SOCKETS = {"socket": (41, 198), "socketpair": (53, 199)}
_CHANGES = {"creat": (85, -1), "truncate": (76, 45), "rename": (82, -1), "renameat": (264, 38), "renameat2": (316, 276),
            "mkdir": (83, -1), "mkdirat": (258, 34), "rmdir": (84, -1), "link": (86, -1), "linkat": (265, 37),
            "unlink": (87, -1), "unlinkat": (263, 35), "symlink": (88, -1), "symlinkat": (266, 36), "mknod": (133, -1),
            "mknodat": (259, 33), "chmod": (90, -1), "fchmodat": (268, 53), "chown": (92, -1), "fchownat": (260, 54),
            "utimensat": (280, 88), "setxattr": (188, 5)}  # fmt: skip
_CLONE, _CLONE3, _OPEN, _OPENAT, _OPENAT2 = (56, 220), (435, 435), (2, -1), (257, 56), (437, 437)
_ARCHES = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}


def close_off(*, writing: bool, network: bool) -> bool:
    """Install the barrier; returns whether it stands. writing, network: what stays allowed."""
    if platform.system() != "Linux" or platform.machine() not in _ARCHES or struct.calcsize("P") != 8:
        return False
    code = b"".join(_program(writing, network))
    buffer = ctypes.create_string_buffer(code, len(code))
    head = struct.pack("HxxxxxxP", len(code) // 8, ctypes.addressof(buffer))
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    zero = ctypes.c_ulong(0)
    if prctl(_NO_NEW_PRIVS, ctypes.c_ulong(1), zero, zero, zero) != 0:
        return False
    return bool(prctl(_SECCOMP, ctypes.c_ulong(_FILTER), ctypes.create_string_buffer(head, len(head)), zero, zero) == 0)


def _program(writing: bool, network: bool) -> list[bytes]:
    """Write the filter: a call that is listed fails, every other passes."""
    column, arch = _ARCHES[platform.machine()]
    code = [_step(_LOAD, _ARCH_AT), _step(_EQUAL, arch, 1, 0), _step(_RETURN, _KILL), _step(_LOAD, _NUMBER_AT)]
    if column == 0:  # the 32-bit pointers of x32 have numbers of their own
        code += [_step(_AT_LEAST, 0x40000000, 0, 1), _step(_RETURN, _ERRNO | _ENOSYS)]
    denied = _PROGRAMS | ({} if network else _SOCKETS) | ({} if writing else _CHANGES)
    for numbers in denied.values():
        code += _deny(numbers[column], _EPERM)
    code += _deny(_CLONE3[column], _ENOSYS) + _deny_bits(_CLONE[column], 0, _THREAD, when_set=False)
    if not writing:
        code += _deny(_OPENAT2[column], _ENOSYS)
        code += _deny_bits(_OPEN[column], 1, _WRITES, when_set=True)
        code += _deny_bits(_OPENAT[column], 2, _WRITES, when_set=True)
    return [*code, _step(_RETURN, _ALLOW)]


def _step(operation: int, value: int, yes: int = 0, no: int = 0) -> bytes:
    return struct.pack("HBBI", operation, yes, no, value)


def _deny(number: int, error: int) -> list[bytes]:
    return [] if number < 0 else [_step(_EQUAL, number, 0, 1), _step(_RETURN, _ERRNO | error)]


def _deny_bits(number: int, argument: int, bits: int, *, when_set: bool) -> list[bytes]:
    """Let a call fail when one of these bits of its argument is set, or when none is."""
    if number < 0:
        return []
    test = _step(_ANY_BIT, bits, 0, 1) if when_set else _step(_ANY_BIT, bits, 1, 0)
    return [
        _step(_EQUAL, number, 0, 4), _step(_LOAD, _ARGUMENT_AT + 8 * argument), test,
        _step(_RETURN, _ERRNO | _EPERM), _step(_LOAD, _NUMBER_AT),
    ]  # fmt: skip
