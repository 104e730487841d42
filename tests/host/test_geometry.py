"""Positions, directions, points and lines of roles files: read, refused in one sentence, written back exactly."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aeolid.can.runs import write_roles
from aeolid.errors import DataError
from aeolid.formats import read_record, write_table
from aeolid.formats.partly import read_setups
from aeolid.geometry import MOST_LINES, MOST_POINTS, Point, Sensor, united
from aeolid.record import Channel, Roles

TOP = '[[channel]]\nname = "top"\nunit = "m/s2"\nrole = "output"\nposition = [0, 0, 87.6]\ndirection = "x"\n'
PLAIN = '[[channel]]\nname = "plain"\nunit = "m"\nrole = "output"\n'
FOOT = '[[point]]\nname = "foot"\nposition = [0.0, 0.0, 0.0]\nfixed = true\n'
LINE = '[[line]]\nfrom = "foot"\nto = "top"\n'


def loaded(text: str, folder: Path) -> Roles:
    """Return the roles that a text says."""
    path = folder / "roles.toml"
    path.write_text(text, encoding="utf-8")
    return Roles.load(path)


def test_a_tower_is_read(tmp_path: Path) -> None:
    roles = loaded(TOP + PLAIN + FOOT + LINE, tmp_path)
    geometry = roles.geometry
    assert geometry is not None
    assert geometry.sensors == (Sensor("top", "m/s2", (0.0, 0.0, 87.6), (1.0, 0.0, 0.0)),)
    assert geometry.points == (Point("foot", (0.0, 0.0, 0.0), True),)
    assert geometry.lines == (("foot", "top"),)
    assert roles.channels[1].position is None
    assert type(geometry).from_json(geometry.to_json()) == geometry


def test_a_file_without_the_keys_has_no_geometry(tmp_path: Path) -> None:
    roles = loaded(PLAIN, tmp_path)
    assert roles.geometry is None and roles.points == () and roles.lines == ()


@pytest.mark.parametrize(
    ("given", "vector"),
    [
        ('"x"', (1, 0, 0)),
        ('"+y"', (0, 1, 0)),
        ('"-z"', (0, 0, -1)),
        ("[0, 3, 4]", (0, 0.6, 0.8)),
        ("[-1e-8, 0.0, 0]", (-1, 0, 0)),
    ],
)
def test_directions_have_length_one(given: str, vector: tuple[float, ...], tmp_path: Path) -> None:
    direction = loaded(TOP.replace('"x"', given), tmp_path).channels[0].direction
    assert direction == pytest.approx(vector, abs=1e-15)


HOSTILE = {
    "two numbers": (TOP.replace("[0, 0, 87.6]", "[0, 87.6]"), "position = .* three numbers"),
    "four numbers": (TOP.replace("[0, 0, 87.6]", "[0, 0, 0, 0]"), "position = .* three numbers"),
    "text": (TOP.replace("[0, 0, 87.6]", '["0", 0, 1]'), "position = .* three numbers"),
    "no list": (TOP.replace("[0, 0, 87.6]", "87.6"), "position = 87.6"),
    "NaN": (TOP.replace("87.6", "nan"), "position = "),
    "infinity": (TOP.replace("87.6", "inf"), "position = "),
    "huge": (TOP.replace("87.6", "1e300"), "position = "),
    "huge integer": (TOP.replace("87.6", "9" * 400), "position = "),
    "a truth": (TOP.replace("87.6", "true"), "position = "),
    "no such axis": (TOP.replace('"x"', '"w"'), "direction = 'w'"),
    "two axes": (TOP.replace('"x"', '"xy"'), "direction = 'xy'"),
    "no axis": (TOP.replace('"x"', '""'), "direction = ''"),
    "no direction at all": (TOP.replace('"x"', "[0, 0, 0]"), "direction = "),
    "direction of NaN": (TOP.replace('"x"', "[nan, 0, 1]"), "direction = "),
    "direction beyond numbers": (TOP.replace('"x"', "[1e308, 1e308, 1e308]"), "direction = "),
    "position alone": (TOP.replace('direction = "x"\n', ""), "position without direction"),
    "direction alone": (TOP.replace("position = [0, 0, 87.6]\n", ""), "direction without position"),
    "point without place": (TOP + '[[point]]\nname = "foot"\n', "position is missing"),
    "point without name": (TOP + "[[point]]\nposition = [0, 0, 0]\n", "name = None"),
    "long name": (TOP + f'[[point]]\nname = "{"a" * 300}"\nposition = [0, 0, 0]\n', "1 to 200 characters"),
    "unseen name": (TOP + '[[point]]\nname = "a\\u0007"\nposition = [0, 0, 0]\n', "control character"),
    "point called as a channel": (TOP + FOOT.replace("foot", "top"), "there is a channel 'top' already"),
    "point twice": (TOP + FOOT + FOOT, "there is a point 'foot' already"),
    "fixed in words": (TOP + FOOT.replace("true", '"yes"'), "fixed = 'yes'"),
    "mistyped": (TOP + FOOT.replace("position", "place"), "unknown key 'place'"),
    "line to nowhere": (TOP + LINE, "from = 'foot' names no"),
    "line of a list": (TOP + FOOT + LINE.replace('"foot"', '["foot"]'), "names no"),
    "line to a channel without a place": (TOP + PLAIN + FOOT + LINE.replace("top", "plain"), "without a position"),
    "line to itself": (TOP + FOOT + LINE.replace("top", "foot"), "to itself"),
    "line with three ends": (TOP + FOOT + LINE + 'over = "top"\n', "unknown key 'over'"),
    "line without an end": (TOP + FOOT + '[[line]]\nfrom = "foot"\n', "to = None names no"),
    "lines of numbers": ("line = [1, 2]\n" + TOP, "a table is needed here, found int"),
    "line as a table": (TOP + '[line]\nfrom = "top"\nto = "top"\n', "line is a list of tables"),
    "too many points": (TOP + "[[point]]\n" * (MOST_POINTS + 1), f"{MOST_POINTS + 1} .*point.* entries"),
    "too many lines": (TOP + "[[line]]\n" * (MOST_LINES + 1), f"{MOST_LINES + 1} .*line.* entries"),
    "too many sensors": (
        "".join(TOP.replace("top", f"s{i}") for i in range(MOST_POINTS + 1)),
        f"{MOST_POINTS + 1} channels with a position",
    ),
    "hundreds of thousands of lines": (TOP + "[[line]]\n" * 100_000, "tables and lists"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_what_makes_no_sense_is_refused_in_one_sentence(case: str, tmp_path: Path) -> None:
    text, words = HOSTILE[case]
    with pytest.raises(DataError, match=words) as told:
        loaded(text, tmp_path)
    assert "roles.toml" in str(told.value) and "\n" not in str(told.value) and len(str(told.value)) < 500


NUMBERS = st.floats(-1e5, 1e5, allow_nan=False)
VECTORS = st.tuples(*[st.floats(-1e3, 1e3, allow_nan=False)] * 3).filter(lambda v: math.hypot(*v) > 1e-6)
NAMES = st.text(st.characters(categories=["L", "N", "P", "S", "Zs"]), min_size=1, max_size=20)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_roles_are_written_as_they_were_read(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Two passes: what is read from what was written is the same to the last bit, every key of every table."""
    folder = tmp_path_factory.mktemp("roles")
    names = data.draw(st.lists(NAMES, min_size=4, max_size=6, unique=True))
    units, roles = ["m/s2", "deg", "", "kN m"], ["output", "input", "ignore", "scheduling"]
    channels = []
    for i, name in enumerate(names[:3]):
        vector = data.draw(VECTORS)
        size = math.hypot(*vector)
        direction = tuple(v / size for v in vector)
        direction = tuple(v / math.hypot(*direction) for v in direction)
        place = tuple(data.draw(NUMBERS) for _ in range(3))
        placed = i == 0 or data.draw(st.booleans())
        role = data.draw(st.sampled_from(roles))
        hold = data.draw(st.sampled_from(["auto", "zoh"])) if role in ("input", "scheduling") else "auto"
        column = data.draw(st.none() | NAMES)
        blade = data.draw(st.sampled_from([0, 2]))
        channels.append(
            Channel(
                name,
                data.draw(st.sampled_from(units)),
                role,
                column,
                hold,
                blade,
                place if placed else None,
                direction if placed else None,
            )
        )
    points = tuple(Point(n, tuple(data.draw(NUMBERS) for _ in range(3)), data.draw(st.booleans())) for n in names[3:])
    ends = [names[0], *(p.name for p in points)]
    lines = tuple((a, b) for a in ends for b in ends if a < b)
    resample = data.draw(st.sampled_from([None, "auto", 0.1]))
    first = Roles(tuple(channels), 0.1, data.draw(st.none() | NAMES), "r", None, resample, points, lines)
    read = loaded(first.to_toml(), folder)
    again = loaded(read.to_toml(), folder)
    assert again == read == replace(first, source=read.source, channels=read.channels)
    for c, d in zip(first.channels, read.channels, strict=True):
        assert replace(d, direction=c.direction) == c
        if c.direction is not None:  # a vector off length one by rounding is taken as it is
            assert d.direction == c.direction


def test_reception_writes_positions_that_channels_have(tmp_path: Path) -> None:
    roles = loaded(TOP + PLAIN, tmp_path)
    path = write_roles(tmp_path / "received.csv", roles.channels, 0.1, None)
    assert Roles.load(path).channels == roles.channels


def test_recordings_carry_the_geometry_of_all_set_ups(tmp_path: Path) -> None:
    """A recording without a roaming sensor still knows where it is; slices and the public class keep it."""
    import aeolid as ae

    low = TOP.replace("top", "low").replace("87.6", "40")
    roles = loaded(TOP + low + FOOT + LINE, tmp_path)
    t = [0.0, 0.1, 0.2, 0.3]
    write_table(tmp_path / "a.csv", {"time_s": t, "top": [0.0, 1.0, 0.0, 1.0]})
    write_table(tmp_path / "b.csv", {"time_s": t, "top": [0.0, 1.0, 0.0, 1.0], "low": [1.0, 1.0, 0.0, 1.0]})
    first, second = read_setups([tmp_path / "a.csv", tmp_path / "b.csv"], roles)
    assert first.names("output") == ("top",) and first.geometry == second.geometry == roles.geometry
    assert first.slice(0, 2).geometry == roles.geometry
    assert ae.read(tmp_path / "b.csv", roles=tmp_path / "roles.toml").geometry == roles.geometry
    ignored = loaded((TOP + low + FOOT + LINE).replace('"output"', '"ignore"', 1), tmp_path)
    record = read_record(tmp_path / "b.csv", ignored)
    assert record.names("output") == ("low",) and record.geometry is not None
    assert [s.name for s in record.geometry.sensors] == ["top", "low"]


def test_one_name_at_two_places_is_refused(tmp_path: Path) -> None:
    here, there = (loaded(TOP.replace("87.6", z), tmp_path).geometry for z in ("87.6", "80"))
    with pytest.raises(DataError, match=r"'top' is at .*87\.6.* and at .*80"):
        united([here, there])
    foot = loaded(TOP.replace("top", "other") + FOOT.replace("foot", "top"), tmp_path).geometry
    with pytest.raises(DataError, match="a point in one roles file and a channel in another"):
        united([here, foot])
    crowd = [replace(here, sensors=tuple(replace(here.sensors[0], name=f"{k}{i}") for i in range(600))) for k in "ab"]
    assert len(united(crowd[:1]).sensors) == 600
    with pytest.raises(DataError, match="1200 channels with a position"):
        united(crowd)
    assert united([None, here, here]) == here and united([None]) is None
