"""Forbid this process, for good, to reach beyond itself: programs, processes, connections, files (Linux, seccomp).

A list of families of system calls that fail, installed after no_new_privs, so no right is needed for it, and every call
that is newer than the list. Not a list of what may be called: libraries of other parties run behind it, and which
harmless calls they and the C library below make is theirs and changes with each version; a newer call that does not
exist has a substitute in all of them. On other kernels and processors nothing is installed; the limits of the process
hold all the same. Imports the standard library alone: it runs before anything else is loaded.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct

_NO_NEW_PRIVS, _SECCOMP, _FILTER = 38, 22, 2  # prctl(2)
_LOAD, _EQUAL, _ANY_BIT, _AT_LEAST, _RETURN = 0x20, 0x15, 0x45, 0x35, 0x06  # classic BPF
_ALLOW, _KILL, _ERRNO = 0x7FFF0000, 0x80000000, 0x00050000
_EPERM, _ENOTTY, _ENOSYS = 1, 25, 38
_NUMBER_AT, _ARCH_AT, _ARGUMENT_AT, _HIGH = 0, 4, 16, 4  # struct seccomp_data
_THREAD = 0x10000  # CLONE_THREAD
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_NEWER = 451  # the first number that this list does not know; what came later has the same number on both processors

# name: (x86-64, arm64); -1 where the processor does not have the call
_PROGRAMS = {"execve": (59, 221), "execveat": (322, 281), "fork": (57, -1), "vfork": (58, -1), "uselib": (134, -1),
             "memfd_create": (319, 279), "memfd_secret": (447, 447)}  # fmt: skip
_PROCESSES = {"rt_sigqueueinfo": (129, 138), "rt_tgsigqueueinfo": (297, 240), "pidfd_send_signal": (424, 424),
              "pidfd_open": (434, 434), "pidfd_getfd": (438, 438), "process_madvise": (440, 440),
              "process_mrelease": (448, 448), "ptrace": (101, 117), "process_vm_readv": (310, 270),
              "process_vm_writev": (311, 271), "kcmp": (312, 272), "perf_event_open": (298, 241),
              "setpriority": (141, 140), "ioprio_set": (251, 30), "migrate_pages": (256, 238),
              "move_pages": (279, 239), "setrlimit": (160, 164)}  # fmt: skip
_SHARED = {"shmget": (29, 194), "shmat": (30, 196), "shmctl": (31, 195), "semget": (64, 190), "semop": (65, 193),
           "semctl": (66, 191), "semtimedop": (220, 192), "msgget": (68, 186), "msgsnd": (69, 189),
           "msgrcv": (70, 188), "msgctl": (71, 187), "mq_open": (240, 180), "mq_unlink": (241, 181),
           "mq_timedsend": (242, 182), "mq_timedreceive": (243, 183), "mq_notify": (244, 184),
           "mq_getsetattr": (245, 185)}  # fmt: skip
_KERNEL = {"bpf": (321, 280), "io_uring_setup": (425, 425), "io_uring_enter": (426, 426),
           "io_uring_register": (427, 427), "userfaultfd": (323, 282), "add_key": (248, 217),
           "request_key": (249, 218), "keyctl": (250, 219), "init_module": (175, 105), "finit_module": (313, 273),
           "create_module": (174, -1), "delete_module": (176, 106), "kexec_load": (246, 104),
           "kexec_file_load": (320, 294), "iopl": (172, -1), "ioperm": (173, -1), "syslog": (103, 116),
           "vhangup": (153, 58), "reboot": (169, 142), "sethostname": (170, 161), "setdomainname": (171, 162),
           "settimeofday": (164, 170), "clock_settime": (227, 112), "adjtimex": (159, 171),
           "clock_adjtime": (305, 266)}  # fmt: skip
_IDENTITY = {"setuid": (105, 146), "setgid": (106, 144), "setreuid": (113, 145), "setregid": (114, 143),
             "setgroups": (116, 159), "setresuid": (117, 147), "setresgid": (119, 149), "setfsuid": (122, 151),
             "setfsgid": (123, 152), "capset": (126, 91)}  # fmt: skip
_MOUNTS = {"mount": (165, 40), "umount2": (166, 39), "pivot_root": (155, 41), "chroot": (161, 51),
           "unshare": (272, 97), "setns": (308, 268), "open_tree": (428, 428), "move_mount": (429, 429),
           "fsopen": (430, 430), "fsconfig": (431, 431), "fsmount": (432, 432), "fspick": (433, 433),
           "mount_setattr": (442, 442), "swapon": (167, 224), "swapoff": (168, 225), "acct": (163, 89),
           "quotactl": (179, 60), "quotactl_fd": (443, 443), "open_by_handle_at": (304, 265),
           "fanotify_init": (300, 262), "fanotify_mark": (301, 263), "nfsservctl": (180, 42)}  # fmt: skip
_ATTRIBUTES = {"chmod": (90, -1), "fchmod": (91, 52), "fchmodat": (268, 53), "chown": (92, -1), "fchown": (93, 55),
               "lchown": (94, -1), "fchownat": (260, 54), "utime": (132, -1), "utimes": (235, -1),
               "futimesat": (261, -1), "utimensat": (280, 88), "setxattr": (188, 5), "lsetxattr": (189, 6),
               "fsetxattr": (190, 7), "removexattr": (197, 14), "lremovexattr": (198, 15),
               "fremovexattr": (199, 16)}  # fmt: skip
_ALWAYS = _PROGRAMS | _PROCESSES | _SHARED | _KERNEL | _IDENTITY | _MOUNTS | _ATTRIBUTES
_SOCKETS = {"socket": (41, 198), "socketpair": (53, 199)}
_CHANGES = {"creat": (85, -1), "truncate": (76, 45), "rename": (82, -1), "renameat": (264, 38), "renameat2": (316, 276),
            "mkdir": (83, -1), "mkdirat": (258, 34), "rmdir": (84, -1), "link": (86, -1), "linkat": (265, 37),
            "unlink": (87, -1), "unlinkat": (263, 35), "symlink": (88, -1), "symlinkat": (266, 36), "mknod": (133, -1),
            "mknodat": (259, 33)}  # fmt: skip
_CLONE, _CLONE3, _OPEN, _OPENAT, _OPENAT2 = (56, 220), (435, 435), (2, -1), (257, 56), (437, 437)
_TO_ITSELF = ((62, 129), (200, 130), (234, 131))  # kill, tkill, tgkill: how C libraries abort
_OF_ITSELF = ((142, 118), (144, 119), (203, 122), (314, 274))  # sched_setparam, _setscheduler, _setaffinity, _setattr
_PRLIMIT, _FCNTL, _IOCTL = (302, 261), (72, 25), (16, 29)
_SIGNALLING = (8, 10, 15)  # F_SETOWN, F_SETSIG, F_SETOWN_EX: a signal of choice to another process when data come
# what runs behind it asks of descriptors: TCGETS, TCGETS2, TIOCGPGRP, TIOCGWINSZ, FIONREAD, FIONBIO, FIONCLEX, FIOCLEX;
# others give files attributes, type at terminals, name the receiver of signals
_ASKED_OF_FILES = (0x5401, 0x802C542A, 0x540F, 0x5413, 0x541B, 0x5421, 0x5450, 0x5451)
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
    """Write the filter: a call that is listed, or newer than the list, fails; every other passes."""
    column, arch = _ARCHES[platform.machine()]
    code = [_step(_LOAD, _ARCH_AT), _step(_EQUAL, arch, 1, 0), _step(_RETURN, _KILL), _step(_LOAD, _NUMBER_AT)]
    code += [_step(_AT_LEAST, _NEWER, 0, 1), _step(_RETURN, _ERRNO | _ENOSYS)]  # x32's numbers, too
    denied = _ALWAYS | ({} if network else _SOCKETS) | ({} if writing else _CHANGES)
    for numbers in denied.values():
        code += _deny(numbers[column], _EPERM)
    code += _deny(_CLONE3[column], _ENOSYS) + _deny_bits(_CLONE[column], 0, _THREAD, when_set=False)
    own = os.getpid()
    for numbers in _TO_ITSELF:
        code += _allow_only(numbers[column], 0, (own,))
    for numbers in _OF_ITSELF:
        code += _allow_only(numbers[column], 0, (0, own))
    for part in (0, _HIGH):  # the address of new limits
        code += _allow_only(_PRLIMIT[column], 2, (0,), part=part)
    for command in _SIGNALLING:
        code += _deny_value(_FCNTL[column], 1, command)
    code += _allow_only(_IOCTL[column], 1, _ASKED_OF_FILES, error=_ENOTTY)
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


def _allow_only(
    number: int, argument: int, values: tuple[int, ...], *, part: int = 0, error: int = _EPERM
) -> list[bytes]:
    """Let a call fail unless an argument has one of these values; part: its lower or its higher 32 bits."""
    if number < 0:
        return []
    tests = [_step(_EQUAL, value, len(values) - i, 0) for i, value in enumerate(values)]
    return [
        _step(_EQUAL, number, 0, len(values) + 3), _step(_LOAD, _ARGUMENT_AT + 8 * argument + part), *tests,
        _step(_RETURN, _ERRNO | error), _step(_LOAD, _NUMBER_AT),
    ]  # fmt: skip


def _deny_value(number: int, argument: int, value: int) -> list[bytes]:
    """Let a call fail when the lower 32 bits of an argument are this."""
    return [
        _step(_EQUAL, number, 0, 4), _step(_LOAD, _ARGUMENT_AT + 8 * argument), _step(_EQUAL, value, 0, 1),
        _step(_RETURN, _ERRNO | _EPERM), _step(_LOAD, _NUMBER_AT),
    ]  # fmt: skip
