"""TOML, JSON and equations written by others: refused in one sentence, before they cost memory or time."""

from __future__ import annotations

import contextlib
import copy
import json
import os
import random
import struct
import tomllib
import tracemalloc
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aeolid.diagnose.data.case import load_case
from aeolid.errors import AeolidError, DataError
from aeolid.models import equations_file
from aeolid.models.equations_size import MOST_OPERATIONS, MOST_STATES
from aeolid.models.exchange import matlab
from aeolid.models.integrate import compile_equations
from aeolid.models.load import load_model
from aeolid.plants.examples import write_examples
from aeolid.record import Roles
from aeolid.text_files import MOST_DEPTH, MOST_JSON, MOST_TOML, load_json, load_toml

MEMORY = 150 << 20  # bytes that reading such a file may take: what the stated counts of tables and lists amount to


def bombs() -> Iterator[tuple[str, str]]:
    """Yield names and texts that are small and cost much, each by another way into the parsers."""
    yield "dotted.toml", "a." * 50_000 + "b = 1\n"
    yield "dotted-heading.toml", "[" + "a." * 50_000 + "b]\n"
    yield "dotted-quoted.toml", '"a" . ' * 50_000 + "b = 1\n"
    yield "dotted-inline.toml", "x = {" + "'a'." * 50_000 + "b = 1}\n"
    yield "dotted-array.toml", "[[" + "a." * 50_000 + "b]]\n"
    yield "many-dotted.toml", "".join(f"a{i}.a.a.a.a.a.a = 1\n" for i in range(40_000))
    yield "many-tables.toml", "[[x]]\n" * 170_000
    yield "deep.toml", "a = " + "[" * 5000 + "]" * 5000
    yield "deep-inline.toml", "a = " + "{a=" * 5000 + "1" + "}" * 5000
    yield "integer.toml", "[recording]\nsample_time_s = " + "9" * 5000 + "\n"
    yield "large.toml", "#" * (MOST_TOML + 1)
    yield "unclosed.toml", '"""\\' * 200_000
    yield "deep.json", "[" * 200_000
    yield "deep-object.json", '{"a":' * 900 + "1" + "}" * 900
    yield "many-lists.json", "[" + "[]," * 5_000_000 + "[]]"
    yield "integer.json", "9" * 5000
    yield "large.json", " " * (MOST_JSON + 1)


@pytest.mark.parametrize(("name", "text"), list(bombs()), ids=lambda v: v if len(v) < 40 else "")
def test_bombs_are_refused_before_they_cost(name: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text(text)
    tracemalloc.start()
    try:
        with pytest.raises(DataError) as refused:
            (load_toml if name.endswith("toml") else load_json)(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert str(refused.value).startswith(f"{path}: ") and len(str(refused.value)) < 400
    assert peak < MEMORY


def test_dots_and_brackets_in_strings_and_comments_do_not_count(tmp_path: Path) -> None:
    text = f"""# {"a." * 100}{"[" * 100}
a = "{"b." * 100}{"[" * 100}" # {"{" * 50}
b = '''
{"[." * 200}'''
c = {"[" * MOST_DEPTH + "]" * MOST_DEPTH}
d = [1.5, 2.25, 1e3]
x.y.z = 1979-05-27T07:32:00.999
"""
    path = tmp_path / "f.toml"
    path.write_text(text)
    assert load_toml(path) == tomllib.loads(text)


@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "missing", "no text"])
@pytest.mark.parametrize("read", [Roles.load, load_model, load_case], ids=lambda f: f.__qualname__)
def test_only_regular_files_are_read(read: Callable[[Path], object], kind: str, tmp_path: Path) -> None:
    path = tmp_path / ("case.toml" if read is load_case else "file.toml")
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "no text":
        path.write_bytes(b"a = '\xff'")
    with pytest.raises(DataError, match=path.name):
        read(tmp_path if read is load_case else path)


def model(state: str = "v", auxiliaries: str = "", more: str = "") -> str:
    return (
        f'[model]\nname = "m"\n[parameters]\nk = 2.0\n{auxiliaries}[[state]]\nname = "q"\nderivative = "{state}"\n'
        f'[[state]]\nname = "v"\nderivative = "drive - k*q - v"\n{more}[[output]]\nname = "y"\nequation = "q"\n'
    )


def auxiliary(name: str, equation: str) -> str:
    return f'[[auxiliary]]\nname = "{name}"\nequation = "{equation}"\n'


def chain(link: str, count: int) -> str:
    return "".join(auxiliary(f"a{i}", link.replace("#", f"a{i - 1}") if i else "drive") for i in range(count))


WIDE = "".join(auxiliary(f"b{i}", "+".join(f"sin({j}.{i}*q)" for j in range(90))) for i in range(60))
TOO_LARGE = {
    "states": (model(more="".join(f'[[state]]\nname = "s{i}"\nderivative = "-s{i}"\n' for i in range(MOST_STATES))),
               f"more than the {MOST_STATES}"),
    "auxiliaries": (model("v + a2999", chain("#+1", 3000)), "more than the 2000"),
    "operations": (model("v", WIDE), f"more than the {MOST_OPERATIONS}"),
    "parameters": (model().replace("k = 2.0", "\n".join(f"k{i} = 2.0" for i in range(2001))), "more than the 2000"),
    "attributes": (model("v" + ".a" * 9000), "line"),
    "number": (model("v + 1" + "0" * 400), "too large"),
}  # fmt: skip


@pytest.mark.parametrize("case", TOO_LARGE)
def test_equations_beyond_the_stated_size_are_refused(case: str, tmp_path: Path) -> None:
    text, reason = TOO_LARGE[case]
    path = tmp_path / "model.toml"
    path.write_text(text)
    with pytest.raises(DataError, match=reason) as refused:
        load_model(path)
    assert str(path) in str(refused.value) and len(str(refused.value)) < 400


@pytest.mark.parametrize(("link", "count"), [("#+#*q", 40), ("max(#, #, #, q)", 300), ("#+1", 1900)])
def test_a_chain_of_intermediates_is_computed_once_each_and_never_written_out(
    link: str, count: int, tmp_path: Path
) -> None:
    """Written out it has 2^40 and 3^300 operations, or 1,900 levels: it runs, but a diagnosis cannot take it apart."""
    folder = tmp_path / "case"
    write_examples(tmp_path, samples=200)
    (tmp_path / "stage").rename(folder)
    (folder / "model.toml").write_text(model(f"v + 0*a{count - 1}", chain(link, count)).replace('"y"', '"position"'))
    found = compile_equations(equations_file.load(folder / "model.toml"))
    assert len(found.model.auxiliaries) == count
    with pytest.raises(DataError, match="written out"):
        load_case(folder)


VALUES: list[Any] = [
    "", "x", "a" * 5000, "é\u202e", 0, -1, 3.5, float("inf"), float("nan"), 10**400, True, [], {}, [[]], [1], ["a"],
    [{}], {"a": 1}, [[[1.0]]], [1, "a", {}], "1.0", 2**63, None,
]  # fmt: skip


def places(data: Any, before: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield where a value stands, of each list the first two entries."""
    yield before
    for key in data if isinstance(data, dict) else range(min(len(data), 2)) if isinstance(data, list) else ():
        yield from places(data[key], (*before, key))


def with_value(data: Any, place: tuple[Any, ...], value: Any) -> Any:
    """Return a copy with one value exchanged, or taken out for None."""
    result = copy.deepcopy(data)
    target = result
    for key in place[:-1]:
        target = target[key]
    if value is None:
        del target[place[-1]]
    else:
        target[place[-1]] = value
    return result


def toml(value: Any) -> str:
    """Write a value as TOML, tables inline."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value).replace("Infinity", "inf").replace("NaN", "nan") if value is not None else '""'


def test_a_value_of_a_wrong_type_is_refused_in_one_sentence(tmp_path: Path) -> None:
    """Each of 23 values in each place of roles, case, equations and both kinds of state-space model."""
    write_examples(tmp_path, samples=200)
    draw, calls = random.Random(7), 0
    for name in ("my_case/roles.toml", "stage/case.toml", "stage/model.toml", "my_case/model.json", "lpv.json"):
        path = tmp_path / name
        if name == "lpv.json":
            data = json.loads((tmp_path / "my_case/model.json").read_text())
            for key in ("A", "B", "K"):
                data[key] = [data[key], data[key]] if data.get(key) else None
            data["scheduling"] = {"channels": ["torque"], "units": ["kN m"], "first_is_one": True}
        else:
            data = json.loads(path.read_text()) if path.suffix == ".json" else tomllib.loads(path.read_text())
        if name == "stage/model.toml":
            data["auxiliary"] = [{"name": "a1", "equation": "drive*2"}]
            data["memory"] = [{"name": "mm", "next": "q", "settled": "q"}]
            data["input_filter"] = [{"input": "drive", "kind": "delay", "delay": "k"}]
        original = path.read_text() if path.exists() else ""
        for place in places(data):
            for value in VALUES if place else []:
                if draw.random() > 0.12:
                    continue
                changed = with_value(data, place, value)
                text = "".join(f"{json.dumps(k)} = {toml(v)}\n" for k, v in changed.items())
                path.write_text(json.dumps(changed) if path.suffix == ".json" else text)
                calls += 1
                try:
                    {"roles": Roles.load, "case": lambda p: load_case(p.parent)}.get(path.stem, load_model)(path)
                except AeolidError as error:
                    assert error.exit_code in (2, 3) and "\n" not in str(error) and len(str(error)) < 700, place
        path.write_text(original)
    assert calls > 250


def test_text_that_looks_like_numbers_and_truth_values_are_no_matrix(tmp_path: Path) -> None:
    write_examples(tmp_path, samples=200)
    data = json.loads((tmp_path / "my_case/model.json").read_text())
    path = tmp_path / "model.json"
    for value in ("1.0", True, None, 10**400):
        data["A"][0][0] = value
        path.write_text(json.dumps(data))
        with pytest.raises(DataError, match="A is not a matrix of numbers"):
            load_model(path)


SHAPES = ('"""a', "a" * 4, "'''", '"\\"a', "a .", "a\t\t\t.", "#[.{", '"a"."b" ', "'", "1.0,")


@pytest.mark.parametrize("shape", SHAPES)
def test_no_text_takes_longer_than_its_length(shape: str, tmp_path: Path) -> None:
    """A scan that starts anew at every character of a megabyte would run for hours; this one ends."""
    path = tmp_path / "f.toml"
    path.write_text((shape * MOST_TOML)[: MOST_TOML - 1])
    with contextlib.suppress(DataError):
        load_toml(path)


def test_a_matlab_model_that_unpacks_to_far_more_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A matrix of 300 MB, all zeros, in 1.4 MB; the reader may have 200 MB here."""
    rows = 300 << 17
    body = struct.pack("<IIIIIIiiHH4sII", 6, 8, 6, 0, 5, 8, rows, 1, 1, 1, b"A", 9, 8 * rows)
    packer = zlib.compressobj(1)
    packed = packer.compress(struct.pack("<II", 14, len(body) + 8 * rows) + body)
    packed += b"".join(packer.compress(bytes(1 << 20)) for _ in range(300)) + packer.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + struct.pack("<H", 0x0100) + b"IM"
    path = tmp_path / "model.mat"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    monkeypatch.setattr(matlab, "_LIMITS", replace(matlab._LIMITS, memory=200 << 20))
    with pytest.raises(DataError, match="unpacks to more than a model may take"):
        load_model(path)
