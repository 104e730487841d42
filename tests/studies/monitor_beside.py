"""Run the monitor beside an MQTT broker and a time-series database, and count what arrives at each.

    python tests/studies/monitor_beside.py FOLDER [--minutes 30] [--every 10]

A node with the built-in turbine streams over TCP; `aeolid monitor` publishes to mosquitto and to InfluxDB, both
started here on the loopback, and is scraped by this script as Prometheus would. A third into the run the broker is
stopped for a sixth of it: the monitor must lose no frame and come back. Written: a line a minute (memory of the
monitor, its processor time, messages, points, frames), and a summary as JSON. Ends with 1 where something did not
arrive.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import threading
import time
import urllib.parse
import urllib.request
from pathlib import Path
from typing import Any

AEOLID = Path(sys.executable).with_name("aeolid")
TICK_S = 0.5
RATE_HZ = 10  # samples a second of the built-in turbine
PATIENCE_S = 3600.0  # what waits in vain is ended; a busy machine is not
Process = subprocess.Popen[Any]


def free_port() -> int:
    """Return a port of the loopback that nobody listens on."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        return int(held.getsockname()[1])


def started(command: list[str], port: int, log: Path) -> Process:
    """Start a server and wait until it listens."""
    with log.open("ab") as out:
        process: Process = subprocess.Popen(command, stdout=out, stderr=out)
    while process.poll() is None:
        with socket.socket() as asked:
            if asked.connect_ex(("127.0.0.1", port)) == 0:
                return process
        time.sleep(0.1)
    sys.exit(f"{command[0]} ended with {process.returncode}; {log} says why")


def program(name: str) -> str:
    """Return where a server's program is."""
    found = shutil.which(name) or shutil.which(name, path="/usr/sbin")
    return found or sys.exit(f"{name} is not installed; tools/apt-packages.txt has it")


class Reader(threading.Thread):
    """Subscribe to everything at a broker, anew when it has gone; count messages by their first level."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.port, self.count = port, dict[str, int]()
        self.start()

    def run(self) -> None:
        """Read until the program ends."""
        while True:
            try:
                self._read()
            except (OSError, IndexError, struct.error):  # the broker has gone
                time.sleep(TICK_S)

    def _read(self) -> None:
        name = b"counter"
        with socket.create_connection(("127.0.0.1", self.port)) as link:
            body = b"\0\4MQTT" + bytes([4, 2, 0, 0]) + struct.pack(">H", len(name)) + name
            link.sendall(bytes([0x10, len(body)]) + body)
            link.sendall(bytes([0x82, 8]) + b"\0\1\0\3t/#\0")
            stream = link.makefile("rb")
            while True:
                kind, length, shift, more = stream.read(1)[0], 0, 0, True
                while more:
                    digit = stream.read(1)[0]
                    length, shift, more = length | (digit & 127) << shift, shift + 7, digit > 127
                content = stream.read(length)
                if kind & 0xF1 == 0x30:  # what is retained comes again with every subscription and does not count
                    topic = content[2 : 2 + struct.unpack(">H", content[:2])[0]].decode()
                    level = topic.split("/")[1]
                    self.count[level] = self.count.get(level, 0) + 1


def points(server: str) -> dict[str, int]:
    """Return how many points the database has, by measurement."""
    query = urllib.parse.urlencode({"db": "park", "q": "SELECT count(*) FROM /.*/"})
    with urllib.request.urlopen(f"{server}/query?{query}", timeout=PATIENCE_S) as answer:
        series = json.load(answer)["results"][0].get("series", [])
    return {s["name"]: max(v for v in s["values"][0][1:] if isinstance(v, int)) for s in series}


def scraped(page: str) -> dict[str, float]:
    """Return what a scraper reads, summed over labels."""
    with urllib.request.urlopen(f"{page}/metrics", timeout=PATIENCE_S) as answer:
        text = answer.read().decode()
    found: dict[str, float] = {}
    for name, value in re.findall(r"^(\w+)(?:\{.*\})? (\S+)", text, re.M):
        found[name] = found.get(name, 0.0) + float(value)
    return found


def used(process: Process) -> tuple[float, float]:
    """Return memory in MB and processor time in s of a process."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    words = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    resident = int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024  # type: ignore[index]
    return resident, (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


class Run:
    """Hold the five programs of a run."""

    def __init__(self, folder: Path, minutes: float, every: float) -> None:
        self.folder = folder
        self.ports = {name: free_port() for name in ("bus", "broker", "database", "internal", "page")}
        self.server = f"http://127.0.0.1:{self.ports['database']}"
        (folder / "broker.conf").write_text(f"listener {self.ports['broker']} 127.0.0.1\nallow_anonymous true\n")
        (folder / "influx.conf").write_text(
            f'reporting-disabled = true\nbind-address = "127.0.0.1:{self.ports["internal"]}"\n'
            f'[meta]\ndir = "{folder}/meta"\n[data]\ndir = "{folder}/data"\nwal-dir = "{folder}/wal"\n'
            f'[http]\nbind-address = "127.0.0.1:{self.ports["database"]}"\n'
        )
        self.database = started(
            [program("influxd"), "run", "-config", str(folder / "influx.conf")], self.ports["database"],
            folder / "influxd.log",
        )  # fmt: skip
        urllib.request.urlopen(f"{self.server}/query", b"q=CREATE+DATABASE+park", timeout=PATIENCE_S).close()
        self.broker = self.new_broker()
        self.reader = Reader(self.ports["broker"])
        samples = str(int(60 * RATE_HZ * (minutes + 5)))  # it must outlive the run
        node = [str(AEOLID), "node", "--turbine", "--samples", samples, "--past", "20", "--innovations"]
        node += ["--bus", f"tcp:{self.ports['bus']}"]
        self.node = started(node, self.ports["bus"], folder / "node.log")
        monitor = [
            str(AEOLID), "monitor", "--bus", f"slcan:socket://127.0.0.1:{self.ports['bus']}", "--no-browser",
            "--port", str(self.ports["page"]), "--publish-every", str(every),
            "--publish", f"mqtt://127.0.0.1:{self.ports['broker']}/t", "--publish", f"{self.server}/write?db=park",
        ]  # fmt: skip
        self.monitor = started(monitor, self.ports["page"], folder / "monitor.log")
        self.page = f"http://127.0.0.1:{self.ports['page']}"

    def new_broker(self) -> Process:
        """Start the broker."""
        command = [program("mosquitto"), "-c", str(self.folder / "broker.conf")]
        return started(command, self.ports["broker"], self.folder / "broker.log")

    def line(self, begun: float) -> dict[str, Any]:
        """Return where everything stands."""
        memory, seconds = used(self.monitor)
        told = scraped(self.page)
        return {
            "minute": round((time.monotonic() - begun) / 60, 1), "memory_mb": round(memory, 1),
            "processor_s": round(seconds, 1), "messages": sum(self.reader.count.values()),
            "points": sum(points(self.server).values()), "frames": told.get("aeolid_bus_frames", 0.0),
            "lost_share": told.get("aeolid_node_lost_share", 0.0), "running": told.get("aeolid_node_running", 0.0),
        }  # fmt: skip

    def end(self) -> None:
        """End what was started, the monitor first."""
        for process in (self.monitor, self.node, self.broker, self.database):
            process.terminate()
            process.wait()


def watched(run: Run, minutes: float) -> list[dict[str, Any]]:
    """Follow a run, the broker away from a third on for a sixth of it; returns a line a minute."""
    begun, lines = time.monotonic(), []
    away, back = begun + 20 * minutes, begun + 30 * minutes
    following = begun
    while time.monotonic() < begun + 60 * minutes:
        if run.broker.poll() is None and away <= time.monotonic() < back:
            run.broker.terminate()
            run.broker.wait()
        if run.broker.poll() is not None and time.monotonic() >= back:
            run.broker = run.new_broker()
        if time.monotonic() >= following:
            lines.append(run.line(begun))
            print(json.dumps(lines[-1]), flush=True)
            following += 60.0
        time.sleep(TICK_S)
    return [*lines, run.line(begun)]


def summary(run: Run, lines: list[dict[str, Any]], minutes: float, every: float) -> dict[str, Any]:
    """Return what is told of a run; `whole` says whether everything arrived."""
    expected = 60 * minutes / every
    sent = {"messages": run.reader.count, "points": points(run.server)}
    settled = lines[len(lines) // 3]
    facts = {
        "minutes": minutes, "every_s": every, **sent,
        "memory_mb": [lines[0]["memory_mb"], settled["memory_mb"], lines[-1]["memory_mb"]],
        "processor_share": round(lines[-1]["processor_s"] / (60 * minutes), 4), "frames": lines[-1]["frames"],
        "lost_share": lines[-1]["lost_share"],
    }  # fmt: skip
    arrived = min(sent["points"].get(f"aeolid_{k}", 0) for k in ("mode", "node", "bus")) >= 0.9 * expected
    told = min(sent["messages"].get(k, 0) for k in ("mode", "node", "bus")) >= 0.9 * 5 / 6 * expected
    return facts | {"whole": bool(arrived and told and lines[-1]["lost_share"] == 0 and lines[-1]["running"] == 1)}


def main() -> None:
    """Run, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--every", type=float, default=10.0, help="seconds between two messages of a kind")
    asked = parser.parse_args()
    folder = asked.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    run = Run(folder, asked.minutes, asked.every)
    try:
        facts = summary(run, watched(run, asked.minutes), asked.minutes, asked.every)
    finally:
        run.end()
    (folder / "summary.json").write_text(json.dumps(facts, indent=1) + "\n")
    print(json.dumps(facts))
    sys.exit(0 if facts["whole"] else 1)


if __name__ == "__main__":
    main()
