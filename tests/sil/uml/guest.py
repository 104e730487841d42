"""Run inside a guest kernel: nodes and listeners on real CAN interfaces; what happened goes to OUT/results.json.

python guest.py OUT; OUT/plan.json names the programs and the samples, what this node's build offers, and the steps that
somebody asks about. Every step writes its facts; judging them is left to the tests outside.
"""

from __future__ import annotations

import ctypes
import fcntl
import importlib
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import termios
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

PATIENCE_S = 1000.0  # for what has gone wrong; an emulated processor on a loaded machine is slow
LOOKS, LOOK_S = 3, 0.05  # nothing happened in so many looks, so long apart
MODULES = ("net/can/can", "net/can/can-raw", "drivers/net/can/dev/can-dev", "drivers/net/can/vcan",
           "drivers/net/can/slcan/slcan")  # fmt: skip
FINIT_MODULE, PIDFD_GETFD = 313, 438  # x86-64; a machine without kmod has no insmod
TIOCSETD, N_SLCAN, SIOCGIFNAME = 0x5423, 17, 0x8910  # set the line discipline of a terminal; ask its interface
REFUSED, BACK = "refused until it is back", "the interface is back"
SO_RCVBUFFORCE = 33
NEEDED = ("can.reception", "can.recorder", "can.runs", "can.socketcan", "can.software_node", "cli.listen_view",
          "cli.listen_facts")  # fmt: skip
ERROR_FLAG, BUS_OFF, RESTARTED = 0x20000000, 0x40, 0x100

started: list[int] = []  # processes of the step, for its end
held: list[int] = []  # pipes of the step that a fork must let go, or their readers never see the end
out = Path(sys.argv[1])
plan: dict[str, Any] = json.loads((out / "plan.json").read_text())


def load_modules() -> None:
    """Load the CAN modules in the order of their dependencies, where the guest has not done so."""
    if not plan["modules"]:
        return
    libc = ctypes.CDLL(None, use_errno=True)
    for name in MODULES:
        path = next(Path(plan["modules"]).glob(f"*/kernel/{name}.ko"))
        with path.open("rb") as file:
            if libc.syscall(FINIT_MODULE, file.fileno(), b"", 0) != 0:
                raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), str(path))


def ip(arguments: str) -> None:
    """Configure an interface."""
    done = subprocess.run(["ip", *arguments.split()], check=False, capture_output=True, text=True)
    if done.returncode != 0:
        raise OSError(f"ip {arguments}: {done.stderr}")


def wait_for(condition: Callable[[], bool], what: str, seconds: float = PATIENCE_S) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"waited in vain for {what}")
        time.sleep(0.02)


def count_sent(interface: str) -> int:
    """Return the frames that an interface has sent since it was made."""
    return int(Path(f"/sys/class/net/{interface}/statistics/tx_packets").read_text())


def receivers(kind: str, interface: str) -> int:
    """Count the receive filters of one kind (all, err, eff …) on an interface."""
    text = Path(f"/proc/net/can/rcvlist_{kind}").read_text()
    return sum(line.split()[:1] == [interface] for line in text.splitlines())


def asleep(pid: int) -> bool:
    """Tell whether every thread of a process waits for something; one that only lacks the processor does not."""
    states = [path.read_text().rpartition(")")[2].split()[0] for path in Path(f"/proc/{pid}/task").glob("*/stat")]
    return set(states) <= {"S"}


def wait_until_quiet(pid: int, interface: str) -> None:
    """Wait until a process has dealt with all it was given: it sleeps, and the interface's counters stand still."""
    counters = ("tx_packets", "rx_packets", "tx_dropped")
    folder, before, quiet = Path(f"/sys/class/net/{interface}/statistics"), [""], 0

    def look() -> bool:
        nonlocal before, quiet
        now = [(folder / name).read_text() for name in counters if folder.exists()]
        quiet = quiet + 1 if asleep(pid) and now == before else 0
        before = now
        time.sleep(LOOK_S)
        return quiet >= LOOKS

    wait_for(look, f"process {pid} to have dealt with all it was given")


class Node:
    """Own one software node; it gets the plan's samples at once, or as the step hands them over."""

    def __init__(self, name: str, bus: str, *options: str, feed: bool = True) -> None:
        self._log = out / f"{name}.node.log"
        words = [plan["node"], *plan["channels"], "--bus", bus, "--dump", f"{out}/{name}.f32", *options]
        with self._log.open("w") as log:
            self.process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log)
        assert self.process.stdout is not None and self.process.stdin is not None
        held.append(self.process.stdin.fileno())
        self.address = self.process.stdout.readline().decode().strip()
        started.append(self.process.pid)
        self._left = Path(plan["samples"]).read_bytes()
        if feed:
            self.feed()

    def feed(self, samples: int | None = None) -> None:
        """Hand over so many samples; all that are left, and the end, without a number."""
        assert self.process.stdin is not None
        size = len(self._left) if samples is None else samples * plan["sample_bytes"]
        with suppress(BrokenPipeError):
            self.process.stdin.write(self._left[:size])
            self.process.stdin.flush()
            self._left = self._left[size:]
            if samples is None:
                self.process.stdin.close()

    def wait_until_taken(self, interface: str) -> None:
        """Wait until it has read what it was fed and sent what came of it."""
        assert self.process.stdin is not None
        pipe = self.process.stdin.fileno()
        wait_for(lambda: not any(fcntl.ioctl(pipe, termios.FIONREAD, bytes(4))), "a node to read its samples")
        wait_until_quiet(self.process.pid, interface)

    def wait_until_said(self, words: str, times: int) -> None:
        """Wait until it has said something so many times."""
        wait_for(lambda: self._log.read_text().count(words) >= times, f"{words!r} of a node")

    def finish(self) -> dict[str, Any]:
        """Wait for the end; returns exit code, what it said, and the counters of its last line."""
        code = self.process.wait(PATIENCE_S)
        said = self._log.read_text().splitlines()
        counters = next((json.loads(line[7:]) for line in said if line.startswith("health ")), None)
        return {"code": code, "said": [s for s in said if not s.startswith("health ")], "counters": counters}


class Command:
    """Own one `aeolid` command, forked: the imports, which take seconds here, are done once."""

    def __init__(self, name: str, *words: str) -> None:
        self._log = out / f"{name}.{words[0]}.log"
        self.pid = os.fork()
        if self.pid == 0:
            log = os.open(self._log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
            os.dup2(log, 1)
            os.dup2(log, 2)
            for pipe in held:
                with suppress(OSError):
                    os.close(pipe)
            code = 70
            try:
                from aeolid.cli.main import main

                code = main(list(words))
                sys.stdout.flush()
            finally:
                os._exit(code)
        started.append(self.pid)

    def finish(self) -> dict[str, Any]:
        """Wait for the end; returns exit code and what it said."""
        end = time.monotonic() + PATIENCE_S
        while True:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                return {"code": os.waitstatus_to_exitcode(status), "said": self._log.read_text().splitlines()}
            if time.monotonic() > end:
                raise TimeoutError(f"a command did not end: {self._log.read_text()}")
            time.sleep(0.02)


class Listener(Command):
    """Own one `aeolid listen` that records all it can; modes would bring scipy, which takes a minute to import here."""

    def __init__(self, name: str, bus: str, *options: str) -> None:
        files = ["--record", f"{out}/{name}.csv", "--markov", f"{out}/{name}.npz", "--json", f"{out}/{name}.json"]
        super().__init__(name, "listen", "--bus", bus, "--no-modes", *files, *options)

    def wait_until_open(self, interface: str) -> None:
        """Wait until its socket takes everything from the interface."""
        wait_for(lambda: receivers("all", interface) > 0, f"a listener on {interface}")


class Capture:
    """See and put frames on an interface, as any other station."""

    def __init__(self, interface: str) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, 1 << 22)
        self._socket.bind((interface,))

    def count(self, wanted: int, seconds: float) -> int:
        """Count frames until there are so many or the time is up."""
        frames, end = 0, time.monotonic() + seconds
        while frames < wanted and (left := end - time.monotonic()) > 0:
            if select.select([self._socket], [], [], left)[0]:
                self._socket.recv(72)
                frames += 1
        return frames

    def send(self, identifier: int, data: bytes = b"") -> None:
        """Put a frame on the bus."""
        self._socket.send(struct.pack("=IB3x8s", identifier, len(data), data))

    def close(self) -> None:
        """Let go of the interface."""
        self._socket.close()


# ---- steps ----------------------------------------------------------------------------------------------------------


def one_node(name: str, interface: str, *options: str) -> dict[str, Any]:
    """Let one node stream to one listener."""
    listener = Listener(name, f"socketcan:{interface}" + ("?fd=true" if "--fd" in options else ""), "--until-end")
    listener.wait_until_open(interface)
    node = Node(name, f"can:{interface}", "--speed", "max", *options)
    return {"address": node.address, "node": node.finish(), "listener": listener.finish()}


def classic() -> dict[str, Any]:
    """Stream on a virtual classic interface."""
    return one_node("classic", "vcan0")


def fd() -> dict[str, Any]:
    """Stream CAN FD frames on a virtual interface."""
    return one_node("fd", "vcan1", "--fd")


def attach_terminal(terminal: int) -> None:
    """Make a terminal an interface of its own, as slcand does with an adapter; on "up" the driver sends S6 and O."""
    fcntl.ioctl(terminal, TIOCSETD, struct.pack("i", N_SLCAN))
    name = fcntl.ioctl(terminal, SIOCGIFNAME, bytes(16)).rstrip(b"\0").decode()
    ip(f"link set {name} name slcan0")
    ip("link set slcan0 type can bitrate 500000")
    ip("link set slcan0 txqueuelen 100 up")


def hold_terminal(node: Node) -> int:
    """Duplicate the node's end of its terminal: what the driver has not yet read does not go when the node ends."""
    pid = node.process.pid
    number = next(int(p.name) for p in Path(f"/proc/{pid}/fd").iterdir() if os.readlink(p).endswith("/ptmx"))
    process = os.pidfd_open(pid)
    held_end = int(ctypes.CDLL(None, use_errno=True).syscall(PIDFD_GETFD, process, number, 0))
    os.close(process)
    if held_end < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return held_end


def slcan() -> dict[str, Any]:
    """Stream as text to the kernel's slcan driver, which makes frames of it."""
    node = Node("slcan", "pty", "--speed", "20", feed=False)
    os.setpriority(os.PRIO_PROCESS, node.process.pid, 19)  # "close" and "open" may wait for it
    terminal = os.open(node.address.removeprefix("slcan:"), os.O_RDWR | os.O_NOCTTY)
    master = hold_terminal(node)
    try:
        attach_terminal(terminal)
        listener = Listener("slcan", "socketcan:slcan0", "--until-end")
        listener.wait_until_open("slcan0")
        node.feed()
        return {"address": node.address, "node": node.finish(), "listener": listener.finish()}
    finally:  # or the guest waits at its end for an interface that is still held
        os.close(terminal)
        os.close(master)


def two_nodes() -> dict[str, Any]:
    """Let two nodes with other filters share a bus."""
    listener = Listener("two", "socketcan:vcan0", "--until-end")
    listener.wait_until_open("vcan0")
    nodes = [
        Node("two-3", "can:vcan0", "--speed", "max", "--node-id", "3", feed=False),
        Node("two-9", "can:vcan0", "--speed", "max", "--node-id", "9", "--past", "3", "--method", "lattice"),
    ]
    nodes[0].feed()
    return {"nodes": [n.finish() for n in nodes], "listener": listener.finish()}


def down_and_up() -> dict[str, Any]:
    """Take the interface down under a running node, then away, then into bus-off; each time it comes back."""
    node = Node("down", "can:vcan2", "--speed", "max", feed=False)
    facts: dict[str, Any] = {"filters": {k: receivers(k, "vcan2") for k in ("all", "err", "fil", "inv", "eff", "sff")}}
    listeners = [Listener("down", "socketcan:vcan2", "--no-reconnect"), Listener("kept", "socketcan:vcan2")]
    wait_for(lambda: receivers("all", "vcan2") == 2, "two listeners")
    node.feed(60)
    node.wait_until_taken("vcan2")
    ip("link set vcan2 down")
    node.wait_until_said(REFUSED, 1)
    node.feed(60)
    node.wait_until_taken("vcan2")
    facts["listener"] = listeners[0].finish()
    ip("link set vcan2 up")
    node.wait_until_said(BACK, 1)
    wait_for(lambda: stays_open("vcan2"), "the listener's return")
    facts["frames_after_down"] = feed_and_count(node, 30)
    node.wait_until_taken("vcan2")
    wait_until_quiet(listeners[1].pid, "vcan2")
    os.kill(listeners[1].pid, signal.SIGINT)
    facts["kept"] = listeners[1].finish()
    ip("link del vcan2")
    node.wait_until_said(REFUSED, 2)
    node.feed(30)
    node.wait_until_taken("vcan2")
    ip("link add dev vcan2 type vcan")
    ip("link set vcan2 up")
    node.wait_until_said(BACK, 2)
    facts["frames_after_away"] = feed_and_count(node, 30)
    station = Capture("vcan2")
    station.send(ERROR_FLAG | BUS_OFF, bytes(8))
    node.wait_until_said(REFUSED, 3)
    station.count(10_000, 0.3)  # what it had sent before
    node.feed(30)
    node.wait_until_taken("vcan2")
    facts["frames_in_bus_off"] = station.count(1, 0.4)
    station.send(ERROR_FLAG | RESTARTED, bytes(8))
    node.wait_until_said(BACK, 3)
    station.close()
    facts["frames_after_restart"] = feed_and_count(node, 30)
    node.feed()
    facts["node"] = node.finish()
    return facts


def stays_open(interface: str) -> bool:
    """Tell whether a listener has opened an interface, and not just found it down."""
    before = receivers("all", interface) > 0
    time.sleep(0.5)
    return before and receivers("all", interface) > 0


def feed_and_count(node: Node, samples: int) -> int:
    """Give the node samples and count the frames on the bus, up to those of these samples alone."""
    station = Capture("vcan2")
    node.feed(samples)
    frames = station.count(samples * plan["width"], 10.0)
    station.close()
    return frames


def full_queue() -> dict[str, Any]:
    """Send to an adapter that takes nothing but its commands: the queue fills, the node is not held up."""
    master, slave = os.openpty()
    reader = threading.Thread(target=read_until_open, args=(master,))
    reader.start()
    attach_terminal(slave)
    reader.join()
    node = Node("full", "can:slcan0", "--speed", "max")
    facts = {"node": node.finish()}
    os.close(slave)
    os.close(master)
    return facts


def read_until_open(adapter: int) -> None:
    """Read commands as an adapter does, up to the one that opens its channel."""
    text = b""
    while b"O\r" not in text:
        text += os.read(adapter, 64)


def refusals() -> dict[str, Any]:
    """Ask for what cannot be."""
    ip("link add dev vcan9 type vcan")
    asked = {"missing": ["can:vcan7"], "not_can": ["can:lo"], "down": ["can:vcan9"], "wait": ["can:vcan0", "--wait"]}
    if plan["offers_fd"]:
        asked["classic_only"] = ["can:vcan0", "--fd"]
    facts = {}
    for name, options in asked.items():
        facts[name] = Node(f"refused-{name}", *options).finish()
    return facts


def command_line() -> dict[str, Any]:
    """Run `aeolid node` itself, on an interface and without one."""
    importlib.import_module("pandas")  # it reads the recording; once for both
    played = ("--recording", f"{out}/classic.csv", "--roles", f"{out}/classic.roles.toml", "--samples", "50")
    node = ("node", *played, "--past", "3", "--speed", "max", "--bus")
    before = count_sent("vcan1")
    facts = {"done": Command("played", *node, "can:vcan1").finish(), "frames": count_sent("vcan1") - before}
    return facts | {"refused": Command("refused", *node, "can:vcan7").finish()}


def wiring() -> dict[str, Any]:
    """Run the program that docs/howto/port.md shows, on its can0."""
    ip("link add dev can0 type vcan")
    ip("link set can0 up")
    listener = Listener("wiring", "socketcan:can0")
    listener.wait_until_open("can0")
    done = subprocess.run([plan["wiring"]], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    wait_until_quiet(listener.pid, "can0")
    os.kill(listener.pid, signal.SIGINT)
    return {"code": done.returncode, "said": done.stdout + done.stderr, "listener": listener.finish()}


def program() -> dict[str, Any]:
    """Run the port's own test program on vcan0."""
    done = subprocess.run([plan["program"], "vcan0"], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    return {"code": done.returncode, "said": (done.stdout + done.stderr).splitlines()}


def import_all() -> None:
    """Import what `listen` and `node` need, which takes seconds here: the forks inherit it."""
    importlib.import_module("aeolid.cli.app").build_app()
    importlib.import_module("aeolid.can.library").import_without_mdf4()  # as a listener does
    for name in NEEDED:
        importlib.import_module(f"aeolid.{name}")
    importlib.import_module("aeolid.can.wire").health_names()  # the DBC is read once
    importlib.import_module("aeolid.cli.main").main(["listen", "--bus", "socketcan:vcan7"])  # no such interface: 3


def main() -> None:
    """Run every step; one that fails leaves its traceback and the others go on."""
    begun = time.monotonic()
    load_modules()
    # An adapter comes at its baud rate; a terminal brings what waited in it at once, which must not overrun the kernel.
    Path("/proc/sys/net/core/netdev_max_backlog").write_text("100000")
    ip("link set lo up")
    for interface in ("vcan0", "vcan1", "vcan2"):
        ip(f"link add dev {interface} type vcan")
    ip("link set vcan0 mtu 16")  # classic frames only
    ip("link set vcan1 mtu 72")
    for interface in ("vcan0", "vcan1", "vcan2"):
        ip(f"link set {interface} up")
    os.environ["AEOLID_NATIVE"] = str(Path(plan["node"]).parent)
    import_all()
    print(f"imports: {time.monotonic() - begun:.1f} s", flush=True)

    steps: list[Callable[[], dict[str, Any]]] = [classic, slcan, two_nodes, down_and_up, full_queue, refusals]
    steps += [command_line, wiring, program, *([fd] if plan["offers_fd"] else [])]
    results: dict[str, Any] = {}
    for step in (step for step in steps if step.__name__ in plan["steps"]):
        begun = time.monotonic()
        try:
            results[step.__name__] = step()
        except Exception:
            results[step.__name__] = {"broken": traceback.format_exc()}
            print(traceback.format_exc(limit=2), flush=True)
        for pid in started:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        started.clear()
        held.clear()
        print(f"{step.__name__}: {time.monotonic() - begun:.1f} s", flush=True)
        (out / "results.json").write_text(json.dumps(results, indent=1))


main()
