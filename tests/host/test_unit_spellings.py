"""Spellings of units: what a heading says is understood, and two units that differ in an exponent stay two."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aeolid.cli.main import main
from aeolid.errors import DataError
from aeolid.formats import read_record
from aeolid.record import Channel, Roles
from aeolid.units import _CASES, _WORDS, conversion, factor, known_units, plain_unit, rightly, same_unit

SPELT = sorted({(w, unit) for unit, words in _WORDS.items() for w in (unit, *words)} | set(_CASES.items()))
CASES = sorted(
    {(w.upper(), u) for w, u in SPELT if rightly(w.upper())} | {(w.title(), u) for w, u in SPELT if w in _CASES}
)


def read(folder: Path, heading: str, unit: str) -> None:
    (folder / "a.csv").write_text(f"time_s,u [{heading}]\n0,1\n0.1,2\n")
    record = read_record(folder / "a.csv", Roles((Channel("u", unit, "output"),), None, None, "roles.toml"))
    assert record.column("u").tolist() == [1, 2] and record.channels[0].unit == unit


@pytest.mark.parametrize(("word", "unit"), [*SPELT, *CASES])
def test_every_spelling_in_a_heading_reads_with_the_unit_it_is_of(word: str, unit: str, tmp_path: Path) -> None:
    """A roles file may not write it, so the heading is the only place that it can stand in."""
    assert unit == (rightly(word) or word)
    read(tmp_path, word, unit)
    for other in known_units():
        if not same_unit(other, unit):
            assert not same_unit(word, other), (word, other)


def test_roles_that_init_writes_are_those_that_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    rows = np.column_stack([0.1 * np.arange(300), 5 + rng.normal(size=300), 1170 + 9 * rng.normal(size=300)])
    body = "\n".join(",".join(f"{x:.3f}" for x in row) for row in rows)
    Path("t.csv").write_text("Time [s],Pitch [Deg],Generator speed [RPM]\n" + body + "\n")
    assert main(["init", "t.csv"]) == 0
    record = read_record("t.csv", Roles.load("roles.toml"))
    assert {c.name: c.unit for c in record.channels} == {"pitch": "deg", "generator_speed": "rpm"}


ALIKE = [
    ("s^-1", "1/s"), ("rad s^-1", "rad/s"), ("rad·s⁻¹", "rad/s"), ("m s-2", "m/s²"), ("m/s/s", "m/s^2"),
    ("ms^-2", "m/s^2"), ("N·m", "Nm"), ("kN-m", "kN m"), ("kN.m", "kNm"), ("Nm/rad", "N m rad^-1"),
    ("N/(m/s)", "N s/m"), ("J/kg/K", "J/(kg K)"), ("m s^-1", "ms^-1"),
    ("10^3 N", "1e3 N"), ("10³ N", "1000 N"), ("100 ns", "100ns"), ("10 E3", "10*E^3"),
    ("1/min", "rpm"), ("min^-1", "rpm"), ("U/min", "rpm"), ("°/s", "deg/s"),
    ("deg/sec^2", "deg/s^2"), ("newton meters per radian", "N m/rad"), ("µm", "um"), ("m**2", "m2"),
    ("kg·m²", "kg m^2"),
]  # fmt: skip
APART = [
    ("10^3 N", "10^-3 N"), ("kg m^2", "kg m^-2"), ("s^-2", "s^2"), ("m s", "ms"), ("1/ms", "m/s"), ("m/s", "s/m"),
    ("mW", "MW"), ("mN m", "MN m"), ("1/s", "Hz"), ("N", "10 N"), ("m/m", ""), ("V/sqrt(Hz)", "V/Hz"),
    ("dB(A)", "dB A"), ("deg", "degC"), ("N m", "N/m"), ("J/kg K", "J/(kg K)"),
]  # fmt: skip


@pytest.mark.parametrize(("first", "second"), ALIKE)
def test_one_unit_in_two_spellings(first: str, second: str, tmp_path: Path) -> None:
    assert same_unit(first, second)
    if not rightly(second):
        read(tmp_path, first, second)


@pytest.mark.parametrize(("first", "second"), APART)
def test_two_units_that_look_alike(first: str, second: str, tmp_path: Path) -> None:
    assert not same_unit(first, second)
    if second:
        with pytest.raises(DataError, match="in the file and in"):
            read(tmp_path, first, second)


SYMBOLS = ("m", "s", "kg", "rad", "A", "N", "K", "bar")
POWERS = st.dictionaries(st.sampled_from(SYMBOLS), st.integers(-3, 3).filter(bool), max_size=4)


@st.composite
def spelt(draw: st.DrawFn, powers: dict[str, int]) -> str:
    """Write a product in one of its ways: any order, a slash or a negative exponent, any sign of a product."""
    text = ""
    for symbol in draw(st.permutations(sorted(powers))):
        power = powers[symbol]
        below = power < 0 and draw(st.booleans())
        size = abs(power) if below else power
        signs = ("^{}", "**{}", "^({})") if size != 1 else ("", "^1", "^{}")
        text += "/" if below else draw(st.sampled_from((" ", " · ", "*"))) if text else ""
        text += symbol + draw(st.sampled_from(signs)).format(size)
    return text


@given(st.data(), POWERS, POWERS)
def test_units_are_the_same_where_their_exponents_are(
    data: st.DataObject, first: dict[str, int], second: dict[str, int]
) -> None:
    one, other = data.draw(spelt(first)), data.draw(spelt(second))
    again = data.draw(spelt(first))
    assert same_unit(one, again), (one, again)
    assert same_unit(one, other) == (first == second), (one, other)


@given(st.text("mskNradegC°%µ²⁻¹^*/·-_.()0123456789e ", max_size=14))
def test_the_plain_form_stays_itself(unit: str) -> None:
    assert plain_unit(plain_unit(unit)) == plain_unit(unit)


@pytest.mark.parametrize(
    "unit", ["(" * 50_000, "m" * 50_000, "m^9" * 20, "10^999 N", "1/0 N", "1e999 N", "m^" + "9" * 90]
)
def test_a_text_that_is_no_unit_is_compared_as_it_stands(unit: str) -> None:
    assert same_unit(unit, unit) and not same_unit(unit, "m")


def test_a_factor_does_not_depend_on_the_spelling() -> None:
    sizes = {"Deg": Fraction(1), "degrees": Fraction(1), "rev": Fraction(360), "REV": None}
    for unit, size in sizes.items():
        found = factor(unit, "°")
        assert found is None if size is None else abs(found / float(size) - 1) < 1e-12  # type: ignore[operator]
    assert factor("kN·m", "N m") == 1000 and "57.2958" in conversion("Radians", "degrees")
