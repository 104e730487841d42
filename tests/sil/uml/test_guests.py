"""Which kernel runs the tests on CAN interfaces: one that ends without a result gives way to the next."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import count
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))
import guests
from guests import (
    GUESTS,
    LEAST_PROCESSOR_S,
    MOST_PROCESSOR_S,
    PATIENCE_S,
    STILL_S,
    Guest,
    NoResult,
    allowed,
    boot,
    pack_file,
    run_first,
)

PANIC = "echo 'Kernel panic - not syncing: put_fp_registers failed'; exit 6"


def imitate(name: str, script: str, missing: str = "") -> Guest:
    """Make a guest of a shell script, which gets its folder as $1."""
    return Guest(name, lambda: missing, lambda out: ["sh", "-c", script, "sh", str(out)])


def prepare(guest: Guest, out: Path) -> None:
    """Put a file where the guest's script looks for it."""
    (out / "plan.json").write_text(guest.name)


WELL = imitate("well", 'cp "$1/plan.json" "$1/booted"; echo 0 >"$1/code"')


@pytest.mark.parametrize(
    "script",
    [
        PANIC,
        f': >"$1/booted"; {PANIC}',
        f': >"$1/booted"; echo half >"$1/results.json"; {PANIC}',
        f': >"$1/booted"; {PANIC.replace("exit 6", "kill -SEGV $$")}',
        "exit 0",
    ],
    ids=["before the first process", "in it", "in the middle of a step", "by a signal", "ends well with nothing done"],
)
def test_a_panic_leads_to_the_next_guest(script: str, tmp_path: Path) -> None:
    """Wherever the first ends without a result, the next one starts afresh and the reason is kept."""
    out, reasons = run_first([imitate("ill", script), WELL], tmp_path, prepare)
    assert out == tmp_path / "well" and (out / "booted").read_text() == "well"
    assert not (out / "results.json").exists() and reasons.startswith("ill ended after 0 s without a result")
    assert ("put_fp_registers" in reasons) == ("put_fp" in script)


def test_a_guest_that_hangs_is_ended_with_its_children(tmp_path: Path) -> None:
    """One that says nothing for so long, on a clock of the test's; what it started ends with it."""
    child, looks = tmp_path / "child", count()

    def clock() -> float:
        begins = next(looks) < 3  # before it boots and before it waits, whatever the guest has done
        return 0.0 if begins or not child.exists() else PATIENCE_S

    script = 'sleep 1000 & echo $! >"$1/new"; mv "$1/new" "$1/child"; wait'
    with pytest.raises(NoResult, match=f"hangs ended after {PATIENCE_S:.0f} s"):
        boot(imitate("hangs", script), tmp_path, clock=clock)
    number = int(child.read_text())
    with pytest.raises(ProcessLookupError):
        for _ in range(1000):  # the signal has been sent; the kernel takes a moment
            os.kill(number, 0)
            subprocess.run(["sleep", "0.01"], check=True)


@pytest.mark.parametrize("says", [True, False])
def test_a_guest_that_goes_on_is_left_alone(says: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long it takes: on this clock each look is a patience after the last, and finds a word or work done."""
    looks = 0

    def clock() -> float:
        nonlocal looks
        looks += 1
        with (tmp_path / "guest.log").open("a") as file:
            file.write("step\n" * says)
        (tmp_path / "looks").write_text(str(looks))
        return looks * PATIENCE_S

    monkeypatch.setattr(guests, "processor_s", lambda _: LEAST_PROCESSOR_S * looks)
    waits = 'until [ "$(cat "$1/looks")" -gt 20 ]; do sleep 0.01; done; echo 0 >"$1/code"'
    boot(imitate("slow", waits), tmp_path, clock=clock)
    assert looks > 20


def test_a_guest_that_computes_without_an_end_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work done is no excuse for ever."""
    spent = iter(range(0, 10**6, int(MOST_PROCESSOR_S / 3)))
    monkeypatch.setattr(guests, "processor_s", lambda _: next(spent) + LEAST_PROCESSOR_S)
    looks = iter(range(10**6))
    with pytest.raises(NoResult):
        boot(imitate("spins", "while :; do sleep 1; done"), tmp_path, clock=lambda: next(looks) * PATIENCE_S)
    assert next(spent) > MOST_PROCESSOR_S


def test_a_guest_whose_processes_all_wait_is_ended_early(tmp_path: Path) -> None:
    """Not a tick of the processor between two looks, and nothing that could run: long before the patience ends."""
    looks = 0.0

    def clock() -> float:
        nonlocal looks
        looks += 2.0
        return looks

    with pytest.raises(NoResult):
        boot(imitate("stopped", "kill -STOP $$"), tmp_path, clock=clock)
    assert 2 * STILL_S <= looks < PATIENCE_S


def test_a_guest_that_lacks_the_processor_is_no_hung_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that could run but gets no tick, as on a machine with much other work, is waited for."""
    monkeypatch.setattr(guests, "processor_s", lambda _: 0.0)
    looks = 0.0

    def clock() -> float:
        nonlocal looks
        looks += STILL_S
        if looks >= 8 * STILL_S:
            (tmp_path / "end").touch()
        return looks

    spins = 'while [ ! -e "$1/end" ]; do :; done; echo 0 >"$1/code"'
    boot(imitate("starved", spins), tmp_path, clock=clock)
    assert looks >= 8 * STILL_S


def test_processor_time_counts_a_session() -> None:
    """With the children that have ended; none of ours."""
    work = "i=0; while [ $i -lt 60000 ]; do i=$((i+1)); done"
    words = ["sh", "-c", f"sh -c '{work}'; {work}; echo done; read line"]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True) as process:
        assert process.stdin is not None and process.stdout is not None
        process.stdout.readline()
        both = guests.processor_s(process.pid)
        process.stdin.write(b"\n")
    assert 0.02 < both < 60 and guests.processor_s(process.pid) == 0


def test_none_is_there(tmp_path: Path) -> None:
    """What is missing is named; nothing is started."""
    out, reasons = run_first([imitate("a", "false", "a is missing"), imitate("b", "false", "b too")], tmp_path, prepare)
    assert out is None and reasons == "a is missing; b too" and not list(tmp_path.iterdir())


def test_a_failure_of_the_guest_that_runs_anywhere_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The emulated PC has no excuse: it is there and ends without a result, so the tests fail."""
    last = imitate("qemu", PANIC)
    monkeypatch.setattr(guests, "GUESTS", (last,))
    with pytest.raises(NoResult, match="put_fp_registers"):
        run_first([imitate("uml", PANIC), last], tmp_path, prepare)


def test_one_guest_can_be_asked_for() -> None:
    """By its name; another name is refused."""
    assert allowed({}) == list(GUESTS) and [g.name for g in allowed({"AEOLID_CAN_GUEST": "qemu"})] == ["qemu"]
    with pytest.raises(ValueError, match="AEOLID_CAN_GUEST=kvm: uml, qemu or nothing"):
        allowed({"AEOLID_CAN_GUEST": "kvm"})


def test_the_archive_is_what_cpio_reads() -> None:
    """The header's 13 numbers and the two paddings to four bytes, as the kernel's documentation has them."""
    packed = pack_file("init", 0o100755, b"abcde")
    assert packed[:6] == b"070701" and len(packed) == 110 + 5 + 1 + 5 + 3
    assert packed[110:116] == b"init\0\0" and packed[116:] == b"abcde\0\0\0"
    assert (int(packed[14:22], 16), int(packed[54:62], 16), int(packed[94:102], 16)) == (0o100755, 5, 5)


def test_the_fetch_script_names_its_words() -> None:
    """A wrong word is wrong usage."""
    script = Path(guests.__file__).parent / "fetch"
    done = subprocess.run(["sh", str(script), "kvm"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "usage" in done.stderr
