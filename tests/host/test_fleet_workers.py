"""Pools of workers: nothing listens, nothing is imported from the current folder, and one that dies costs one piece."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pool_work import listening, look, work

from aeolid.cli.main import main
from aeolid.errors import UsageError
from aeolid.fleet import cluster, workers
from aeolid.formats import write_table

TRAPS = ("multiprocessing", "concurrent", "pickle", "socket", "numpy", "aeolid", "scipy", "encodings", "site")


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_workers_listen_nowhere_and_have_a_safe_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder with modules of well-known names: none is imported; no socket waits for anybody; one thread each."""
    for name in TRAPS:
        (tmp_path / f"{name}.py").write_text(
            f"open({str(tmp_path / 'sprung')!r}, 'a').write({name!r})\nraise SystemExit(9)\n"
        )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")  # as with `python -c`: what comes first on the path is where one happens to be
    before = dict(os.environ), list(sys.path)
    with workers.open_pool(2) as pool:
        found = [facts for _, facts in pool.run(look, range(6))]
        here = listening(os.getpid())
    assert (dict(os.environ), list(sys.path)) == before
    assert not (tmp_path / "sprung").exists()
    assert sorted(f["item"] for f in found) == list(range(6)) and 1 <= len({f["process"] for f in found}) <= 2
    for facts in found:
        assert facts["process"] != os.getpid() and facts["listening"] == [] and facts["safe"] and facts["deaf"]
        assert "" not in facts["path"] and str(tmp_path) not in facts["path"]
        assert facts["threads"] == ["1", "1", "1"]
    assert here == []
    assert not any(is_there(f["process"]) for f in found)


def test_a_worker_that_dies_costs_its_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed, out of memory, ended, results and errors that do not travel: named, and all others are done."""
    most = 1 << 30
    monkeypatch.setattr(workers, "_share_of_memory", lambda count: most)
    items = [1, -1, 2, -2, 3, -3, 4, -4, 5, -5, 6, -7, 7]
    with workers.open_pool(2) as pool:
        found = dict(pool.run(work, items, 2 * most))
        again = dict(pool.run(work, [8], 10))
    assert [found[i] for i, item in enumerate(items) if item > 0] == [2 * most * k for k in range(1, 8)]
    lost = {items[i]: found[i] for i in found if items[i] < 0}
    assert all(isinstance(error, Exception) for error in lost.values())
    assert isinstance(lost[-4], MemoryError) and str(lost[-2]) == "wrong"
    assert str(lost[-1]) == "its process was ended by SIGKILL" and str(lost[-7]) == "its process ended with code 5"
    assert again == {0: 80}


def test_workers_end_with_the_pool() -> None:
    """Whoever stops in the middle leaves no process behind, at work or idle."""
    with workers.open_pool(2) as pool, pytest.raises(KeyboardInterrupt):
        pieces = pool.run(work, [1, -6], 1)
        with closing(pieces):  # type: ignore[type-var]
            next(pieces)
            assert isinstance(pool, workers.Processes)
            running = [worker._process.pid for worker, _ in pool._busy.values()]
            raise KeyboardInterrupt
    assert running and not any(is_there(pid) for pid in running if pid is not None)


def test_threads_stop_where_they_are_asked_to() -> None:
    """What has not begun when the pool is left is not begun."""
    begun: list[int] = []

    def slow(item: int) -> int:
        begun.append(item)
        time.sleep(0.05)
        return item

    with pytest.raises(KeyboardInterrupt), workers.open_pool(2, threads=True) as pool:
        for _ in pool.run(slow, range(500)):
            raise KeyboardInterrupt
    assert len(begun) < 500
    with workers.open_pool(2, threads=True) as pool:
        assert sorted(pool.run(slow, [3, 4])) == [(0, 3), (1, 4)]


def test_a_fleet_on_processes_opens_no_port(tmp_path: Path) -> None:
    """The command itself, in a folder of traps: neither it nor any process below it listens while it works."""
    generator = np.random.default_rng(0)
    for day in range(3):
        u = generator.normal(size=3000)
        y = np.convolve(u, 0.8 ** np.arange(30))[:3000] + 0.1 * generator.normal(size=3000)
        (tmp_path / "data/T1").mkdir(parents=True, exist_ok=True)
        write_table(tmp_path / f"data/T1/{day}.csv", {"u": u, "y": y}, {})
    roles = "[recording]\nsample_time_s = 0.1\n" + "".join(
        f"[[channel]]\nname = '{name}'\nunit = 'm'\nrole = '{role}'\n"
        for name, role in (("u", "input"), ("y", "output"))
    )
    (tmp_path / "roles.toml").write_text(roles)
    (tmp_path / "multiprocessing.py").write_text("open('sprung', 'w')\n")
    words = [Path(sys.executable).with_name("aeolid"), "fleet", "data", "--roles", "roles.toml", "--past", "10"]
    words += ["--order", "2", "--workers", "2", "--out", "out"]
    running = subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    seen, open_ports = set(), []
    while running.poll() is None:
        family = list(_family(running.pid))
        for pid in family:
            try:
                open_ports += listening(pid)
            except OSError:  # has just ended
                continue
        seen |= set(family)
        time.sleep(0.1)
    assert running.returncode == 0, running.communicate()[1]
    running.communicate()
    assert len(seen) >= 3 and open_ports == [] and not (tmp_path / "sprung").exists()


def _family(process: int) -> Iterator[int]:
    yield process
    try:
        below = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    except OSError:
        return
    for child in below:
        yield from _family(int(child))


# ---- a cluster ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make an authority, a certificate of it, and one of nobody."""
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("no openssl")
    folder = tmp_path_factory.mktemp("tls")
    key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    for name in ("ca", "other"):
        command = [openssl, "req", "-x509", *key, "-subj", f"/CN={name}", "-days", "2"]
        command += ["-keyout", f"{name}.key", "-out", f"{name}.pem"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
    command = [openssl, "req", *key, "-subj", "/CN=node", "-keyout", "node.key", "-out", "node.csr"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    command = [openssl, "x509", "-req", "-in", "node.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial"]
    subprocess.run([*command, "-out", "node.pem", "-days", "2"], cwd=folder, check=True, capture_output=True)
    return folder


def trusted(folder: Path, address: str, authority: str = "ca", name: str = "node") -> cluster.Scheduler:
    return cluster.Scheduler(address, folder / f"{authority}.pem", folder / f"{name}.pem", folder / f"{name}.key")


def test_a_scheduler_over_tls(certificates: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces are done by its workers; a certificate of somebody else, on either side, is not let in."""
    distributed = pytest.importorskip("distributed")
    files = {"tls_ca_file": certificates / "ca.pem"}
    files |= {f"tls_{who}_cert": certificates / "node.pem" for who in ("client", "scheduler", "worker")}
    files |= {f"tls_{who}_key": certificates / "node.key" for who in ("client", "scheduler", "worker")}
    security = distributed.Security(require_encryption=True, **{k: str(v) for k, v in files.items()})
    monkeypatch.setattr(cluster, "CONNECT", "2s")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tls://", host="127.0.0.1", security=security,
        dashboard_address=None, silence_logs="CRITICAL",
    ) as local:  # fmt: skip
        address = local.scheduler_address
        assert address.startswith("tls://127.0.0.1:")
        with cluster.open_cluster(trusted(certificates, address.removeprefix("tls://"))) as pool:
            found = dict(pool.run(work, [1, -2, 3], 10))
        assert found[0] == 10 and found[2] == 30 and str(found[1]) == "wrong"
        for stranger in (trusted(certificates, address, "other", "other"), trusted(certificates, address, "other")):
            with pytest.raises(UsageError, match="no Dask scheduler answers"), cluster.open_cluster(stranger):
                pass


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--scheduler", "tcp://127.0.0.1:8786"], "--insecure-scheduler"),
        (["--scheduler", "tcp://10.0.0.1:8786", "--tls-ca", "ca.pem"], "--insecure-scheduler"),
        (["--scheduler", "ws://10.0.0.1:8786"], "tls://HOST:PORT is needed"),
        (["--scheduler", "10.0.0.1:8786"], "--tls-ca, --tls-cert and --tls-key are needed"),
        (["--scheduler", "tls://h:1", "--tls-ca", "ca.pem"], "--tls-cert and --tls-key: missing"),
        (["--scheduler", "tls://h:1", "--tls-ca", "a", "--tls-cert", "b", "--tls-key", "c"], "--tls-ca a: there is no"),
        (["--tls-ca", "ca.pem"], "go with --scheduler"),
        (["--insecure-scheduler"], "go with --scheduler"),
    ],
)
def test_a_scheduler_that_is_not_to_be_trusted_is_refused(
    options: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before anything is connected: plain connections, on the loopback too, and halves of a certificate."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ca.pem").write_text("")
    (tmp_path / "r.csv").write_text("u,y\n1,2\n")
    (tmp_path / "roles.toml").write_text(
        "[recording]\nsample_time_s = 1.0\n[[channel]]\nname = 'u'\nunit = 'm'\nrole = 'input'\n"
        "[[channel]]\nname = 'y'\nunit = 'm'\nrole = 'output'\n"
    )
    assert main(["fleet", "r.csv", "--roles", "roles.toml", "--past", "4", "--out", "out", *options]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert words in told and told.count("aeolid: ") == 1


def test_a_missing_dask_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is an extra: whoever names a scheduler is told what to install."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    scheduler: Any = cluster.Scheduler("tcp://127.0.0.1:1", insecure=True)
    with pytest.raises(UsageError, match=r"pip install 'aeolid\[cluster\]'"), cluster.open_cluster(scheduler):
        pass
