"""Say where sensors are and which way they point, and the wire frame that is drawn through them.

Read from a roles file: `position` and `direction` of a [[channel]], [[point]] tables without a sensor, [[line]] tables
that join two names. Coordinates are in m, in one right-handed frame of the user's choice.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from aeolid.display import has_unseen, token
from aeolid.errors import DataError
from aeolid.text_files import MOST_LETTERS, check_keys, is_number, is_short, shown

Triple = tuple[float, float, float]
MOST_POINTS = 1000  # a drawing of more cannot be read; interpolation between them solves a matrix of this size
MOST_LINES = 1000
FARTHEST = 1e5  # m from the origin: beyond every structure, but coordinates of a map belong to no drawing
AXES: dict[str, Triple] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_WORDS = {sign + axis for axis in AXES for sign in ("", "+", "-")}
_SIZES = (1e-9, 1e9)  # of a vector that only its direction counts of
_UNIT = 1e-12  # a vector this near to length one is not divided again, so that what is written is what is read


@dataclass(frozen=True)
class Sensor:
    """Name a channel with its unit, its position (x, y, z) in m and the direction it measures along, of length 1."""

    name: str
    unit: str
    position: Triple
    direction: Triple


@dataclass(frozen=True)
class Point:
    """Name a place without a sensor; fixed: it stays where it is, whatever moves around it."""

    name: str
    position: Triple
    fixed: bool = False


@dataclass(frozen=True)
class Geometry:
    """Hold sensors, points without one, and lines as pairs of their names."""

    sensors: tuple[Sensor, ...]
    points: tuple[Point, ...] = ()
    lines: tuple[tuple[str, str], ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the geometry as JSON facts, coordinates in m."""
        return {
            "sensors": [
                {"name": s.name, "unit": s.unit, "position": list(s.position), "direction": list(s.direction)}
                for s in self.sensors
            ],
            "points": [{"name": p.name, "position": list(p.position), "fixed": p.fixed} for p in self.points],
            "lines": [list(line) for line in self.lines],
        }

    @classmethod
    def from_json(cls, facts: Mapping[str, Any]) -> Geometry:
        """Return the geometry that `to_json` wrote."""
        sensors = tuple(
            Sensor(s["name"], s["unit"], _three(s["position"]), _three(s["direction"])) for s in facts["sensors"]
        )
        points = tuple(Point(p["name"], _three(p["position"]), bool(p["fixed"])) for p in facts["points"])
        return cls(sensors, points, tuple((a, b) for a, b in facts["lines"]))


def united(geometries: Iterable[Geometry | None]) -> Geometry | None:
    """Return what several recordings of one structure say together; None where none says anything.

    Raises DataError where they put one name at two places.
    """
    sensors: dict[str, Sensor] = {}
    points: dict[str, Point] = {}
    lines: dict[tuple[str, str], None] = {}
    for one in geometries:
        if one is None:
            continue
        for sensor in one.sensors:
            _agree(sensors.setdefault(sensor.name, sensor), sensor)
        for point in one.points:
            _agree(points.setdefault(point.name, point), point)
        lines |= dict.fromkeys(one.lines)
    _require_few((True for _ in sensors), "the set-ups")
    double = next((name for name in points if name in sensors), None)
    if double is not None:
        raise DataError(f"{double!r} is a point in one roles file and a channel in another; rename one of them")
    return Geometry(tuple(sensors.values()), tuple(points.values()), tuple(lines)) if sensors else None


def _agree(known: Sensor | Point, other: Sensor | Point) -> None:
    if known != other:
        raise DataError(
            f"{known.name!r} is at {list(known.position)} in one roles file and at {list(other.position)} in another, "
            "or differs in direction, unit or fixed; give each place a name of its own"
        )


def read_placement(entry: Mapping[str, Any], where: str) -> tuple[Triple | None, Triple | None]:
    """Return position and direction of a [[channel]]: both, or neither; the direction has length 1."""
    if "position" not in entry and "direction" not in entry:
        return None, None
    for key, other in (("direction", "position"), ("position", "direction")):
        if key not in entry:
            raise DataError(
                f"{where}: {other} without {key}; a drawing needs where a sensor is and which way it points"
            )
    return _position(entry["position"], where), _direction(entry["direction"], where)


def read_frame(
    points: Any, lines: Any, channels: Mapping[str, bool], source: str
) -> tuple[tuple[Point, ...], tuple[tuple[str, str], ...]]:
    """Return the [[point]] and [[line]] tables of a roles file; channels: by name, whether each has a position."""
    _require_few(channels.values(), source)
    tables = []
    for what, entries, most in (("point", points, MOST_POINTS), ("line", lines, MOST_LINES)):
        if not isinstance(entries, list):
            raise DataError(f"{source}: {what} is a list of tables, each headed [[{what}]]")
        if len(entries) > most:
            raise DataError(f"{source}: {len(entries)} [[{what}]] entries; at most {most} are drawn")
        tables.append(entries)
    found: dict[str, Point] = {}
    for i, entry in enumerate(tables[0]):
        where = f"{source} [[point]] {i + 1}"
        point = _read_point(entry, where)
        if point.name in found or point.name in channels:
            what = "point" if point.name in found else "channel"
            raise DataError(f"{where}: there is a {what} {point.name!r} already; give it another name")
        found[point.name] = point
    known = {**channels, **dict.fromkeys(found, True)}
    joined = [_read_line(entry, known, f"{source} [[line]] {i + 1}") for i, entry in enumerate(tables[1])]
    return tuple(found.values()), tuple(dict.fromkeys(joined))


def _require_few(placed: Iterable[bool], source: str) -> None:
    count = sum(placed)
    if count > MOST_POINTS:
        raise DataError(f"{source}: {count} channels with a position; at most {MOST_POINTS} are drawn")


def _read_point(entry: Any, where: str) -> Point:
    check_keys(entry, {"name", "position", "fixed"}, where)
    name = entry.get("name")
    if not is_short(name) or not name:
        raise DataError(f"{where}: name = {shown(name)} is no text of 1 to {MOST_LETTERS} characters")
    if has_unseen(name):
        raise DataError(f"{where}: the name {token(name)!r} holds a control character; rename it")
    if "position" not in entry:
        raise DataError(f"{where}: position is missing; write position = [x, y, z] in m")
    fixed = entry.get("fixed", False)
    if not isinstance(fixed, bool):
        raise DataError(f"{where}: fixed = {shown(fixed)} is neither true nor false")
    return Point(name, _position(entry["position"], where), fixed)


def _read_line(entry: Any, known: Mapping[str, bool], where: str) -> tuple[str, str]:
    check_keys(entry, {"from", "to"}, where)
    ends = []
    for key in ("from", "to"):
        name = entry.get(key)
        if not isinstance(name, str) or name not in known:
            raise DataError(f"{where}: {key} = {shown(name)} names no [[channel]] and no [[point]]")
        if not known[name]:
            raise DataError(f"{where}: {key} = {shown(name)} is a channel without a position; give it one")
        ends.append(name)
    if ends[0] == ends[1]:
        raise DataError(f"{where}: a line from {shown(ends[0])} to itself; name two places")
    return ends[0], ends[1]


def _position(value: Any, where: str) -> Triple:
    numbers = _numbers(value)
    if numbers is None or max(map(abs, numbers)) > FARTHEST:
        raise DataError(
            f"{where}: position = {shown(value)} is not [x, y, z], three numbers in m within ±{FARTHEST:.0e}"
        )
    return numbers


def _direction(value: Any, where: str) -> Triple:
    if isinstance(value, str) and value in _WORDS:
        x, y, z = AXES[value[-1]]
        return (-x, -y, -z) if value[0] == "-" else (x, y, z)
    numbers = _numbers(value)
    size = math.hypot(*numbers) if numbers is not None else 0.0
    if numbers is None or not _SIZES[0] <= size <= _SIZES[1]:
        raise DataError(
            f'{where}: direction = {shown(value)} is neither an axis, such as "x" or "-y", nor a vector [dx, dy, dz] '
            f"of a length from {_SIZES[0]:.0e} to {_SIZES[1]:.0e}"
        )
    if abs(size - 1) < _UNIT:
        return numbers
    x, y, z = (n / size for n in numbers)
    return x, y, z


def _numbers(value: Any) -> Triple | None:
    if not isinstance(value, list) or len(value) != 3 or not all(map(is_number, value)):
        return None
    return _three(value)


def _three(value: Sequence[float]) -> Triple:
    x, y, z = map(float, value)
    return x, y, z


def placement_lines(position: Triple | None, direction: Triple | None) -> list[str]:
    """Return position and direction as lines of a roles file, which read as the same numbers; none for None."""
    if position is None or direction is None:
        return []
    axis = next((w for w in sorted(_WORDS) if "+" not in w and _direction(w, "") == direction), None)
    return [f"position = {list(position)!r}", f"direction = {json.dumps(axis) if axis else repr(list(direction))}"]


def frame_lines(points: Iterable[Point], lines: Iterable[tuple[str, str]]) -> list[str]:
    """Return points and lines as lines of a roles file."""
    out = []
    for p in points:
        out += ["[[point]]", f"name = {quoted(p.name)}", f"position = {list(p.position)!r}"]
        out += ["fixed = true", ""] if p.fixed else [""]
    for start, end in lines:
        out += ["[[line]]", f"from = {quoted(start)}", f"to = {quoted(end)}", ""]
    return out


def quoted(text: str) -> str:
    """Return a text as a TOML string: a JSON string without pairs of \\u is one, once DEL is escaped as well."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
