"""What is handed on arrives as it was: at a broker, in a database, at a scraper; and nobody waits for any of them."""

from __future__ import annotations

import json
import re
import shutil
import socket
import struct
import subprocess
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_monitor import fill, get

from aeolid.cli.main import main
from aeolid.cli.publishing import publish_once
from aeolid.errors import UsageError
from aeolid.monitor.board import Board
from aeolid.monitor.server import PageServer
from aeolid.publish.mqtt import MqttClient, packet
from aeolid.publish.rows import Row, line_protocol, prometheus_text, rows_of_fleet, rows_of_monitor
from aeolid.publish.target import Publisher, target_of

PATIENCE_S = 7200.0  # what waits in vain is ended; a busy machine is not
MODE = Row("mode", {"node": "3", "mode": "1", "mostly_in": "tower fore-aft"}, {"frequency_hz": 0.325, "damping": 0.01})


def free_port() -> int:
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        return int(held.getsockname()[1])


def wait_for(port: int, process: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        assert process.poll() is None, process.returncode
        with socket.socket() as asked:
            if asked.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise AssertionError("it does not listen")


@contextmanager
def running(command: list[str], port: int) -> Iterator[None]:
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_for(port, process)
        yield
    finally:
        process.terminate()
        process.wait()


@contextmanager
def broker(folder: Path, port: int, more: str = "allow_anonymous true") -> Iterator[None]:
    found = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if found is None:
        pytest.skip("mosquitto is not installed")
    (folder / "mosquitto.conf").write_text(f"listener {port} 127.0.0.1\n{more}\n")
    with running([found, "-c", str(folder / "mosquitto.conf")], port):
        yield


def subscribed(port: int, topic: str, count: int) -> dict[str, Any]:
    """Subscribe as another program and return so many messages, retained ones too, by topic."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as link:
        text = lambda t: struct.pack(">H", len(t)) + t.encode()  # noqa: E731
        link.sendall(packet(0x10, text("MQTT") + bytes([4, 2, 0, 0]) + text("reader")))
        link.sendall(packet(0x82, b"\0\1" + text(topic) + b"\0"))
        stream, found = link.makefile("rb"), {}
        while len(found) < count:
            kind, length, shift = stream.read(1)[0], 0, 0
            while True:
                digit = stream.read(1)[0]
                length, shift = length | (digit & 127) << shift, shift + 7
                if digit < 128:
                    break
            body = stream.read(length)
            if kind & 0xF0 == 0x30:
                size = struct.unpack(">H", body[:2])[0]
                found[body[2 : 2 + size].decode()] = json.loads(body[2 + size :])
        return found


@pytest.mark.parametrize(("size", "told"), [(0, b"\0"), (127, b"\x7f"), (128, b"\x80\x01"), (16384, b"\x80\x80\x01")])
def test_the_length_of_a_packet_is_that_of_the_standard(size: int, told: bytes) -> None:
    """The examples of section 2.2.3."""
    assert packet(0x30, b"x" * size) == b"\x30" + told + b"x" * size


def test_a_broker_has_every_row_and_keeps_the_newest(tmp_path: Path) -> None:
    port = free_port()
    with broker(tmp_path, port):
        target = target_of(f"mqtt://127.0.0.1:{port}/park/turbine 7")
        target.send([MODE], 1.0)
        target.send([MODE, Row("bus", {"source": "a/b#"}, {"load": 0.5})], 2.0)
        found = subscribed(port, "park/#", 2)
        target.close()
    # tags in the order of their names: mode, mostly_in, node
    assert found["park/turbine 7/mode/1/tower fore-aft/3"] == {"time_s": 2.0, **MODE.tags, **MODE.values}
    assert found["park/turbine 7/bus/a_b_"]["load"] == 0.5


def test_a_broker_that_refuses_says_why_and_is_asked_again(tmp_path: Path) -> None:
    port, said = free_port(), []
    name = f"mqtt://127.0.0.1:{port}/x"
    publisher = Publisher([("here", target_of(name))], lambda: [MODE], said.append, every_s=3600.0)
    publisher.turn()
    publisher.turn()
    assert len(said) == 1 and "not sent" in said[0] and publisher.failed["here"] == 2
    with (
        broker(tmp_path, port, "allow_anonymous false"),
        pytest.raises(OSError, match=r"no right to connect|wrong user"),
    ):
        MqttClient("127.0.0.1", port)
    with broker(tmp_path, port):
        publisher.turn()
        assert said[-1] == "--publish here: arrives again" and publisher.sent["here"] == 1
        publisher.close()
    assert publisher.sent["here"] == 2  # the last state, at the end


@contextmanager
def database(folder: Path) -> Iterator[str]:
    found = shutil.which("influxd")
    if found is None:
        pytest.skip("influxd is not installed")
    port, other = free_port(), free_port()
    (folder / "influx.conf").write_text(
        f'reporting-disabled = true\nbind-address = "127.0.0.1:{other}"\n[meta]\ndir = "{folder}/meta"\n[data]\n'
        f'dir = "{folder}/data"\nwal-dir = "{folder}/wal"\n[http]\nbind-address = "127.0.0.1:{port}"\n'
    )
    with running([found, "run", "-config", str(folder / "influx.conf")], port):
        yield f"http://127.0.0.1:{port}"


def asked(server: str, query: str, method: str = "GET") -> Any:
    address = f"{server}/query?" + urllib.parse.urlencode({"db": "park", "q": query, "epoch": "ms"})
    with urllib.request.urlopen(urllib.request.Request(address, method=method), timeout=PATIENCE_S) as answer:
        return json.load(answer)["results"][0]


def test_a_database_has_every_value_at_its_time(tmp_path: Path) -> None:
    awkward = Row("mode", {"node": "3", "mostly_in": 'a b,c=d"é'}, {"frequency_hz": 1.5}, time_s=1709290800.25)
    with database(tmp_path) as server:
        asked(server, "CREATE DATABASE park", "POST")
        target_of(f"{server}/write?db=park").send([MODE, awkward], 1709290801.0)
        (series,) = asked(server, "SELECT * FROM aeolid_mode")["series"]
        with pytest.raises(OSError, match="404"):
            target_of(f"{server}/write?db=none").send([MODE], 1.0)
    rows = [dict(zip(series["columns"], values, strict=True)) for values in series["values"]]
    assert [r["time"] for r in rows] == [1709290800250, 1709290801000]
    assert rows[0]["mostly_in"] == 'a b,c=d"é' and rows[0]["frequency_hz"] == 1.5
    assert (rows[1]["damping"], rows[1]["mode"]) == (0.01, "1")


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=30), st.floats(allow_nan=False, allow_infinity=False))
def test_no_text_becomes_another_line_or_metric(text: str, value: float) -> None:
    row = Row("mode", {"mostly_in": text}, {"frequency_hz": value})
    assert line_protocol([row], 1.0).count("\n") == 1
    lines = prometheus_text([row]).split("\n")
    assert len(lines) == 3 and lines[2] == "" and float(lines[1].rpartition(" ")[2]) == value


def test_a_scraper_reads_the_monitor() -> None:
    board = Board()
    fill(board)
    server = PageServer(board, "127.0.0.1", 0)
    code, headers, text = get(server, "metrics")
    refused = get(server, "metrics", "evil.example")[0]
    server.close()
    assert code == 200 and headers["Content-Type"].startswith("text/plain; version=0.0.4") and refused == 421
    pattern = r'(# TYPE [a-z_0-9]+ gauge|[a-z_0-9]+\{([a-z_]+="[^"]*",?)*\} -?[0-9.e+-]+)'
    assert all(re.fullmatch(pattern, line) for line in text.splitlines()), text
    assert re.search(r'^aeolid_node_running\{node="\d+"\} [01]$', text, re.M) and "aeolid_bus_load" in text
    names = re.findall(r"# TYPE (\S+)", text)
    assert len(names) == len(set(names))


def test_periods_of_a_fleet_keep_their_time() -> None:
    mode = {"frequency_hz": 0.3, "frequency_std_hz": None, "damping": 0.02, "damping_std": 0.001, "track": 2,
            "name": "tower fore-aft"}  # fmt: skip
    period = {"turbine": "T1", "middle_s": 19000 * 86400.0, "modes": [mode, mode | {"damping": 1.0}]}
    (row,) = rows_of_fleet({"periods": [period]})
    assert (
        row.time_s == 19000 * 86400.0 and row.tags["name"] == "tower fore-aft" and "frequency_std_hz" not in row.values
    )
    assert rows_of_fleet({"periods": [period | {"middle_s": 5.0}]})[0].time_s is None
    still = {"turbine": "T1", "track": 2, "name": "", "frequency_hz": {"onset": None}, "moved": False, "until_s": 5.0}
    (change,) = rows_of_fleet({"tracks": [still]})
    assert change.values == {"moved": 0} and change.time_s is None and change.measurement == "fleet_change"
    assert rows_of_monitor({}) == () and prometheus_text([]) == line_protocol([], 0.0) == ""


@pytest.mark.parametrize(
    ("url", "told"),
    [("ftp://x/y", "not understood"), ("mqtt://", "not understood"), ("mqtt://u:p@h/t", "AEOLID_PUBLISH_PASSWORD"),
     ("mqtt://h/a/+/b", "for those who subscribe"), ("http://h:port/", "no address"),
     ("http://h/write?db=my park", "write %20"), ("http://h/write?db=x\n", "no blanks")],
)  # fmt: skip
def test_a_target_that_is_none_is_refused_before_anything_is_opened(
    url: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(UsageError, match=re.escape(told)):
        target_of(url)
    assert main(["listen", "--bus", "virtual:none", "--publish", url, "--for", "1"]) == 2
    assert told in capsys.readouterr().err


def test_dashboard_and_alarms_ask_for_what_there_is() -> None:
    """Every metric that Grafana's panels and Prometheus' rules name is one that the monitor has."""
    root = Path(__file__).resolve().parents[2] / "packaging"
    board = Board()
    fill(board)
    board.tick()
    known = set(re.findall(r"# TYPE (\S+)", prometheus_text(rows_of_monitor(board.facts))))
    known |= {f"aeolid_mode_{k}" for k in ("frequency_hz", "frequency_std_hz", "damping", "damping_std")}
    known |= {f"aeolid_innovation_{k}" for k in ("deviation", "whiteness", "ratio")}
    known |= {"aeolid_node_snapshots", "aeolid_node_snapshot_age_s", "aeolid_node_snapshots_incomplete"}
    board_file = json.loads((root / "grafana" / "aeolid.json").read_text())
    asked = [t["expr"] for panel in board_file["panels"] for t in panel["targets"]]
    rules = (root / "prometheus" / "alarms.yml").read_text()
    asked += re.findall(r"expr: (.*)", rules)
    used = set(re.findall(r"aeolid_\w+", " ".join(asked)))
    assert len(asked) > 10 and used <= known, used - known


@contextmanager
def talker(answer: bytes) -> Iterator[int]:
    """Serve this answer, which is no HTTP, to whoever asks; yields the port."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()

        def serve() -> None:
            while True:
                try:
                    taken, _ = listening.accept()
                except OSError:
                    return
                with taken:
                    taken.recv(4096)
                    taken.sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        yield listening.getsockname()[1]
        listening.shutdown(socket.SHUT_RDWR)


def test_an_answer_that_is_no_http_is_a_failure_like_others() -> None:
    """The attempt goes on, other targets have their rows, and what is sent once is told as not sent."""

    class Odd:
        def send(self, rows: Any, now_s: float) -> None:
            raise RuntimeError("odd")

        def close(self) -> None:
            return None

    with talker(b"SSH-2.0-OpenSSH\r\n") as port:
        target = target_of(f"http://127.0.0.1:{port}/write?db=x")
        with pytest.raises(OSError, match="no HTTP"):
            target.send([MODE], 1.0)
        said: list[str] = []
        publisher = Publisher([("odd", Odd()), ("here", target)], lambda: [MODE], said.append, every_s=3600.0)
        publisher.turn()
        publisher.turn()
        assert publisher.failed == {"odd": 2, "here": 2} and len(said) == 2
        publish_once([("odd", Odd()), ("here", target)], [MODE])
        publisher.close()


def test_a_connection_that_went_between_two_messages_loses_none() -> None:
    """A broker that closes after every ping: the next message comes on a fresh connection; no keep-alive ends one."""
    heard: list[bytes] = []

    def serve(listening: socket.socket) -> None:
        while True:
            try:
                taken, _ = listening.accept()
            except OSError:
                return
            with taken:
                heard.append(taken.recv(4096))
                taken.sendall(b"\x20\x02\x00\x00")
                said = b""
                while not said.endswith(b"\xc0\x00"):
                    said += taken.recv(4096)
                heard.append(said)
                taken.sendall(b"\xd0\x00")

    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        threading.Thread(target=serve, args=(listening,), daemon=True).start()
        target = target_of(f"mqtt://127.0.0.1:{listening.getsockname()[1]}/park")
        for k in range(3):
            target.send([MODE], float(k))
            time.sleep(0.05)
        target.close()
        listening.shutdown(socket.SHUT_RDWR)
    assert len(heard) == 6 and all(b'"time_s": %d.0' % k in heard[2 * k + 1] for k in range(3))
    assert all(first[10:12] == b"\0\0" for first in heard[::2])
