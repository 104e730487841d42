"""The end of the test command's log: which tests failed, and what each of them said last."""

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]

CTEST = """<testsuite><testcase name="gate_fuzz" classname="gate_fuzz" status="fail"><failure message=""/>
<system-out>first
invariants broken by samples</system-out></testcase>
<testcase name="sound" status="run"><system-out>all is well</system-out></testcase></testsuite>"""
PYTEST = """<testsuites><testsuite>
<testcase classname="tests.host.test_x" name="test_a"><failure message="short">one
two
three
four
five
six
seven</failure></testcase>
<testcase classname="tests.host.test_x" name="test_b"><error message="said without a text"></error></testcase>
<testcase classname="tests.host.test_x" name="test_c"><error message="said without a text"></error></testcase>
<testcase classname="tests.host.test_x" name="test_d"><skipped message="why"/></testcase></testsuite></testsuites>"""


def show(*files: Path) -> list[str]:
    command = [sys.executable, str(TESTS / "junit_failures.py"), *map(str, files)]
    environment = os.environ | {"PYTHONSAFEPATH": "1"}  # as tests that ran before in this process may have it
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout.splitlines()


def test_failed_tests_are_named_with_what_they_said_last(tmp_path: Path) -> None:
    (tmp_path / "ctest.xml").write_text(CTEST)
    (tmp_path / "pytest.xml").write_text(PYTEST)
    assert show(tmp_path / "ctest.xml") == [
        "failed: gate_fuzz.gate_fuzz",
        "    first",
        "    invariants broken by samples",
    ]
    shown = show(tmp_path / "pytest.xml")
    assert shown[:7] == [
        "failed: tests.host.test_x.test_a",
        *(f"    {w}" for w in ("two", "three", "four", "five", "six", "seven")),
    ]
    assert shown[7:] == [
        "failed: tests.host.test_x.test_b",
        "    said without a text",
        "failed: tests.host.test_x.test_c",
        "    as before",
    ]


def test_files_that_are_missing_or_damaged_are_passed_over(tmp_path: Path) -> None:
    (tmp_path / "damaged.xml").write_text("<testsuite>")
    assert show(tmp_path / "none.xml", tmp_path / "damaged.xml") == []


def test_a_long_list_is_cut_and_counted(tmp_path: Path) -> None:
    cases = "".join(f'<testcase name="t{k}"><failure message="m{k}"/></testcase>' for k in range(23))
    (tmp_path / "pytest.xml").write_text(f"<testsuite>{cases}</testsuite>")
    shown = show(tmp_path / "pytest.xml")
    assert sum(line.startswith("failed:") for line in shown) == 20
    assert shown[-1] == "and 3 more in pytest.xml"
