"""Say how a unit is written here, where a roles file writes it in another way that programs would not understand.

Units that are not known are left as they are: a recording may hold anything. What is refused in a roles file is a
spelling of a known one, since half of the code would take it for that unit and the other half for none. A heading is
another's, so there every spelling is understood: two units are compared by their factors and exponents.
"""

from __future__ import annotations

import math
import re
from functools import lru_cache

PAGE = "docs/reference/files.md, Units"  # where units and their conversion are described
_WORDS = {
    "deg": ("degree", "degrees", "degs"),
    "rad": ("radian", "radians", "rads"),
    "s": ("sec", "secs", "second", "seconds"),
    "m": ("meter", "meters", "metre", "metres"),
    "rpm": (
        "r/min", "rev/min", "revs/min", "u/min", "umdr/min", "umdr./min", "rounds per minute", "revolutions per minute",
    ),
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
}  # fmt: skip
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


_LONGEST = 100  # characters of a unit that is parsed; a longer text is none
_SYMBOLS = {w: unit for w, unit in _RIGHT.items() if w.isalpha()} | _CASES | {"°": "deg"}
_SHORT = {
    "Nm": "N m", "mNm": "mN m", "kNm": "kN m", "MNm": "MN m", "Nms": "N m s", "kNms": "kN m s", "kgm": "kg m",
    "Wh": "W h", "kWh": "kW h", "MWh": "MW h", "VA": "V A", "kVA": "kV A", "MVA": "MV A", "Ah": "A h",
}  # fmt: skip # symbols that are written as one word; others, such as ms, are another unit then
_JOINED = {" ".join(sorted(product.split())): word for word, product in _SHORT.items()}
_NONE = ("1", "none", "unitless")
_OTHERWISE = {"1/min": "rpm", "rev/min": "rpm"}  # of the canonical form
_METEOROLOGICAL = re.compile(r"ms\^?-([12])")  # m s^-1 and m s^-2 without the blank; nobody counts per millisecond so
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
_NUMBER, _SYMBOL, _POWER = r"\d+(?:\.\d+)?(?:[eE][+-]?\d+)?", r"[^\W\d_]+|[%‰°]", r"[+-]?\d+(?:\.\d+)?"
_FACTOR = re.compile(
    rf"(?:(?P<number>{_NUMBER})|(?P<symbol>{_SYMBOL}))(?:(?:\^|\*\*)(?:(?P<power>{_POWER})|\((?P<held>{_POWER})\))"
    r"|(?<=[^\W\d_])(?P<digits>[+-]?\d+))?"
)


@lru_cache(maxsize=1024)
def plain_unit(unit: str) -> str:
    """Reduce the spellings of one unit to one; empty for none ("-", "1").

    A unit is a product of symbols with exponents, behind / of their inverse, perhaps with a number before them; blanks,
    · and * stand between factors, and so does a hyphen between letters. Other texts are compared as they stand.

    >>> [plain_unit(u) for u in ("kN·m", "kN-m", "m/s²", "m s^-2", "s^-1", "1/min", "RPM", "10^3 N", "dB(A)", "-")]
    ['kNm', 'kNm', 'm/s2', 'm/s2', '1/s', 'rpm', 'rpm', '1000N', 'dB(A)', '']
    """
    text = " ".join(unit.replace("_", " ").split())
    if not text.strip(" -") or text.lower() in _NONE:
        return ""
    whole = rightly(text) or text
    if len(whole) > _LONGEST:
        return text
    written = _written(*(_parsed(_prepared(whole)) or (1.0, {}))) or text  # m/m is a unit, too: not that of no unit
    return _OTHERWISE.get(written, written)


def same_unit(first: str, second: str) -> bool:
    """Tell whether two spellings mean the same unit; the case counts, since mW is not MW.

    >>> same_unit("rad s^-1", "rad/s"), same_unit("Deg", "deg"), same_unit("m s", "ms"), same_unit("m^2", "m^-2")
    (True, True, False, False)
    """
    return plain_unit(first) == plain_unit(second)


def _prepared(text: str) -> str:
    """Write raised figures, signs of products and prefixes in one way each."""
    text = re.sub("[⁻⁺]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda found: f"^{found[0].translate(_RAISED)} ", text)
    text = text.replace("µ", "u").replace("μ", "u").replace("º", "°").replace("⋅", "·")
    text = re.sub(r"°\s*C\b", "degC", text)
    text = re.sub(r"\s+per\s+", "/", text, flags=re.IGNORECASE)
    text = re.sub(r"(?<=[^\W_])-(?=[^\W\d_])|(?<=[^\W\d_])\.(?=[^\W\d_])", " ", text)
    return _METEOROLOGICAL.sub(r"m s^-\1", text) if _METEOROLOGICAL.fullmatch(text) else text


def _parsed(text: str) -> tuple[float, dict[str, float]] | None:
    """Return the number and the exponent of each symbol of a unit, None for a text that is no product of symbols."""
    scale, powers = 1.0, dict[str, float]()
    signs, sign, at, closed = [1], 1, 0, False  # of the open brackets, of the next factor; whether a symbol ends here
    try:
        while at < len(text):
            found = _FACTOR.match(text, at)
            if closed and (found or text[at] == "("):
                return None
            if found is not None:
                power = signs[-1] * sign * float(found["power"] or found["held"] or found["digits"] or 1)
                scale *= _add(found, power, powers)
                sign, at, closed = 1, found.end(), found["number"] is None
                continue
            if text[at] == "(":
                signs, sign = [*signs, signs[-1] * sign], 1
            elif text[at] == ")" and len(signs) > 1 and sign == 1:
                signs.pop()
            elif text[at] == "/" and sign == 1:
                sign = -1
            elif text[at] not in " ·*":
                return None
            at, closed = at + 1, text[at] == ")"
    except (OverflowError, ZeroDivisionError):
        return None
    sound = len(signs) == 1 and sign == 1 and math.isfinite(scale) and scale > 0
    return (scale, {s: p for s, p in powers.items() if p}) if sound else None


def _add(found: re.Match[str], power: float, powers: dict[str, float]) -> float:
    """Add the exponents of one factor to those of the unit; returns the number that it is, 1 for a symbol."""
    if found["number"]:
        return float(float(found["number"]) ** power)
    symbol = found["symbol"]
    known = _SHORT.get(symbol) or _SYMBOLS.get(symbol.lower()) or symbol
    inside = {symbol: 1.0} if known == symbol else (_parsed(known) or (1.0, {}))[1]
    for name, own in inside.items():
        powers[name] = powers.get(name, 0.0) + own * power
    return 1.0


def _written(scale: float, powers: dict[str, float]) -> str:
    """Write a unit in its canonical form: symbols in the order of their letters, those with negative exponents last."""
    above = " ".join(s + (f"{p:.6g}" if p != 1 else "") for s, p in sorted(powers.items()) if p > 0)
    below = "".join(f"/{s}" + (f"{-p:.6g}" if p != -1 else "") for s, p in sorted(powers.items()) if p < 0)
    number = f"{scale:.12g}" if scale != 1 or (below and not above) else ""
    gap = " " if number and above[:1] in ("e", "E") else ""  # not an exponent of ten
    return number + gap + _JOINED.get(above, above) + below


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
_BY_FORM = tuple({plain_unit(unit): size for unit, size in sizes.items()} for sizes in _SIZES)


def factor(given: str, wanted: str) -> float | None:
    """Return what a number in one unit is multiplied with to be in another; None where they are of no one quantity.

    >>> factor("kN m", "N m"), factor("deg", "deg"), factor("deg", "kW"), factor("Deg", "rad") == factor("deg", "rad")
    (1000.0, 1.0, None, True)
    """
    found, asked = plain_unit(given), plain_unit(wanted)
    if found == asked:
        return 1.0
    sizes = next((s for s in _BY_FORM if found in s and asked in s), None)
    return None if sizes is None else sizes[found] / sizes[asked]


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
