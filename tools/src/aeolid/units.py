"""Say how a unit is written here, where a roles file writes it in another way that programs would not understand.

Units that are not known are left as they are: a recording may hold anything. What is refused is a spelling of a known
one, since half of the code would take it for that unit and the other half for none.
"""

from __future__ import annotations

PAGE = "docs/reference/files.md, Units"  # where units and their conversion are described
_WORDS = {
    "deg": ("degree", "degrees", "degs"),
    "rad": ("radian", "radians", "rads"),
    "s": ("sec", "secs", "second", "seconds"),
    "m": ("meter", "meters", "metre", "metres"),
    "rpm": ("r/min", "rev/min", "revs/min", "u/min", "rounds per minute", "revolutions per minute"),
    "deg/s": ("deg/sec", "degree/s", "degrees/s", "degrees/sec", "deg per second", "dps"),
    "rad/s": ("rad/sec", "radian/s", "radians/s", "rads/s", "radians per second"),
    "m/s": ("m/sec", "mps", "meter/s", "metre/s", "meters/s", "metres/s", "meters per second"),
    "m/s^2": ("m/sec^2", "m/sec2", "m/s/s", "mps2", "mpss"),
    "N": ("newton", "newtons"),
    "N m": ("newtonmeter", "newtonmetre", "newton meter", "newton metre", "newton meters"),
    "kN m": ("kilonewtonmeter", "kilonewton meter", "kilonewton metre"),
    "W": ("watt", "watts"),
    "kW": ("kilowatt", "kilowatts"),
    "V": ("volt", "volts"),
    "A": ("amp", "amps", "ampere", "amperes"),
    "%": ("percent", "per cent", "pct"),
    "Hz": ("hertz",),
    "degC": ("celsius", "deg c", "°c"),
}
_RIGHT = {word: unit for unit, words in _WORDS.items() for word in words}
_CASES = {"deg": "deg", "rad": "rad", "rpm": "rpm", "deg/s": "deg/s", "rad/s": "rad/s"}  # mW is not MW, but RPM is rpm


def rightly(unit: str) -> str | None:
    """Return how this unit is written here; None where it stands right, or is not known.

    >>> rightly("degrees"), rightly("RPM"), rightly("rpm"), rightly("furlong")
    ('deg', 'rpm', None, None)
    """
    word = " ".join(unit.strip().lower().split())
    right = _RIGHT.get(word) or _CASES.get(word)
    return None if right == unit.strip() else right


_SIZES: tuple[dict[str, float], ...] = (  # units of one quantity, by their size
    {"deg": 3.141592653589793 / 180, "rad": 1.0, "rev": 2 * 3.141592653589793},
    {"rpm": 3.141592653589793 / 30, "rad/s": 1.0, "deg/s": 3.141592653589793 / 180},
    {"rad/s^2": 1.0, "deg/s^2": 3.141592653589793 / 180},
    {"N m": 1.0, "Nm": 1.0, "kN m": 1e3, "kNm": 1e3, "MN m": 1e6, "MNm": 1e6},
    {"N": 1.0, "kN": 1e3, "MN": 1e6},
    {"W": 1.0, "kW": 1e3, "MW": 1e6},
    {"m/s^2": 1.0, "m/s2": 1.0, "mm/s^2": 1e-3, "g": 9.80665},
    {"m": 1.0, "mm": 1e-3, "cm": 1e-2},
    {"m/s": 1.0, "km/h": 1 / 3.6},
)


def factor(given: str, wanted: str) -> float | None:
    """Return what a number in one unit is multiplied with to be in another; None where they are of no one quantity.

    >>> factor("kN m", "N m"), factor("deg", "deg"), factor("deg", "kW")
    (1000.0, 1.0, None)
    """
    if given == wanted:
        return 1.0
    sizes = next((s for s in _SIZES if given in s and wanted in s), None)
    return None if sizes is None else sizes[given] / sizes[wanted]


def conversion(found: str, wanted: str) -> str:
    """Return what is to be done to numbers in one unit so that they are in another, as a part of a message.

    >>> conversion("rad", "deg")
    'multiply the column by 57.2958 (docs/reference/files.md, Units)'
    >>> conversion("furlong", "m")
    'convert the column (docs/reference/files.md, Units)'
    """
    size = factor(found, wanted)
    return f"{'convert the column' if size is None else f'multiply the column by {size:.6g}'} ({PAGE})"


def known_units() -> tuple[str, ...]:
    """Return every unit that is known: of those of one quantity the sizes, of others the right spelling."""
    return tuple(dict.fromkeys([*(unit for sizes in _SIZES for unit in sizes), *_WORDS]))


def alike(unit: str) -> tuple[str, ...]:
    """Return the units of the quantity that a unit is of, itself among them."""
    return next((tuple(s) for s in _SIZES if unit in s), (unit,))
