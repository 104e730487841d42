"""Say places and likelihoods on the screen and on pages as an engineer says them."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Sequence
from itertools import islice

from aeolid.display import token

_KINDS = {"input": "at the input", "output": "at the sensor of", "state": "in the equation of", "shaft": "in the shaft"}
_NAMED = {"motion": "in the motion", "parameter": "in the value of"}
_PLAIN = {"recording": "in the recording", "data": "in the recording", "rotor": "at the rotor"}
_WRITTEN = re.compile(r"(?:\b(?:at|in|of) )?\b(input|output|state|mode|motion|shaft|parameter):(\d[\d.e+-]* Hz|[\w-]+)")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_POWER = re.compile(r"(?<![\w.])-?\d(?:\.\d+)?e([+-]\d+)\b")
MOST_DECIMALS = 9  # of a value beside its deviation
_LARGE = 1e6  # from which values are told by powers of ten, or as a few digits
_WRITTEN_OUT = 9  # powers of ten from which a number is not written out
_COMPARED = 100  # characters of a name that is compared with others
_LIKE = 0.6  # share of letters in the same order from which two names are alike (difflib's own)
_LARGEST = 12  # powers of ten of odds that are written out; beyond, nobody tells one from the next


def nearest(wanted: str, names: Iterable[str]) -> str | None:
    """Return the name most like the wanted one, None where none is like it.

    Names of more than 100 characters, and those behind the first 5000, are not compared.

    >>> nearest("kk", ["M", "k"]), nearest("pitch", ["torque"])
    ('k', None)
    """
    if len(wanted) > _COMPARED:
        return None
    folded = {n.lower(): n for n in reversed(list(islice(names, 50 * _COMPARED))) if len(n) <= _COMPARED}
    return next((folded[n] for n in difflib.get_close_matches(wanted.lower(), folded, n=1, cutoff=_LIKE)), None)


def did_you_mean(wanted: str, names: Iterable[str]) -> str:
    """Return the end of a message that asks for the nearest name, empty where none is like the wanted one.

    >>> did_you_mean("kk", ["M", "k"]), did_you_mean("pitch", ["torque"])
    ("; did you mean 'k'?", '')
    """
    near = nearest(wanted, names)
    return "" if near is None else f"; did you mean {token(near)!r}?"


def place(entry: str) -> str:
    """Return where an effect enters, in words.

    >>> place("input:pitch"), place("mode:0.33 Hz"), place("shaft"), place("output:flap_moment_1")
    ('at the input pitch', 'in the mode near 0.33 Hz', 'in the shaft', 'at the sensor of flap moment 1')
    """
    kind, _, rest = entry.partition(":")
    name = rest.replace("_", " ").strip()
    if kind == "mode":
        return f"in the mode near {name}"
    if kind in _KINDS or (kind in _NAMED and name):
        return f"{(_KINDS | _NAMED)[kind]} {name}".rstrip()
    return _PLAIN.get(entry, f"at {entry.replace('_', ' ')}" if entry else "")


def odds(gain: float) -> str:
    """Return a gain in log-likelihood as odds for the corrected model, in words.

    >>> odds(3.0), odds(646.0), odds(-2.0)
    ('odds 20 : 1', 'odds beyond 10¹² : 1', 'odds 1 : 7.4')
    """
    if abs(gain) > _LARGEST * math.log(10):
        most = "10" + str(_LARGEST).translate(_RAISED)
        return f"odds beyond {most} : 1" if gain > 0 else f"odds beyond 1 : {most}"
    ratio = math.exp(abs(gain))
    told = f"{ratio:.2g}" if ratio < 100 else f"{float(f'{ratio:.2g}'):,.0f}"
    return f"odds {told} : 1" if gain >= 0 else f"odds 1 : {told}"


def plus_minus(value: float, deviation: float | None, digits: int = 4) -> str:
    """Return a value ± its standard deviation: two digits of that, and the value to the same decimal place.

    Without a deviation above zero `digits` of the value; as five and two digits where it takes more than 9 decimals, or
    one of them is of 10⁶ or more.

    >>> plus_minus(0.33012, 0.00087), plus_minus(0.33, 0.0996), plus_minus(1791.3, 112.0)
    ('0.33012 ± 0.00087', '0.33 ± 0.10', '1790 ± 110')
    >>> plus_minus(0.33012, 2e-9), plus_minus(2.0, None)
    ('0.33012 ± 2e-09', '2')
    """
    if deviation is None or not 0 < deviation < math.inf or not math.isfinite(value):
        return f"{value:.{digits}g}"
    place = last_place(deviation)
    if place < -MOST_DECIMALS or abs(value) >= _LARGE or deviation >= _LARGE:
        return f"{value:.{digits + 1}g} ± {deviation:.2g}"
    decimals = max(-place, 0)
    return f"{round(value, -place):.{decimals}f} ± {round(deviation, -place):.{decimals}f}"


def last_place(deviation: float) -> int:
    """Return the power of ten of the second digit of a standard deviation above zero, as it is rounded.

    >>> last_place(0.0212), last_place(0.0996), last_place(1300.0)
    (-3, -2, 2)
    """
    return int(f"{deviation:.1e}".partition("e")[2]) - 1


def aligned(numbers: Sequence[str]) -> list[str]:
    """Return numbers as a column of one width, their decimal points below each other.

    >>> aligned(["0.330 ± 0.012", "12.5"])
    [' 0.330 ± 0.012', '12.5          ']
    """
    whole = [len(text.partition(" ")[0].partition(".")[0]) for text in numbers]
    moved = [" " * (max(whole) - own) + text for own, text in zip(whole, numbers, strict=True)]
    width = max(map(len, moved), default=0)
    return [text.ljust(width) for text in moved]


def counted(number: int, noun: str, verbs: tuple[str, str] | None = None) -> str:
    """Return a count with its noun in the right number, and with the verb of one or of several where they are given.

    >>> counted(1, "sample"), counted(2, "sample"), counted(1, "row", ("is", "are")), counted(0, "row", ("is", "are"))
    ('1 sample', '2 samples', '1 row is', '0 rows are')
    """
    told = f"{number} {noun}{'' if number == 1 else 's'}"
    return told if verbs is None else f"{told} {verbs[number != 1]}"


def spoken(text: str) -> str:
    """Return a sentence with the places in it in words, and numbers as they are read.

    >>> spoken("1.3% more mass moves at mode:3.01 Hz than the model has")
    '1.3% more mass moves in the mode near 3.01 Hz than the model has'
    >>> spoken("the score of sensor_lag output:speed, 19.0, is above 15.0")
    'the score of sensor_lag at the sensor of speed, 19.0, is above 15.0'
    """
    return plain(_WRITTEN.sub(lambda found: place(f"{found[1]}:{found[2]}"), text))


def plain(text: str) -> str:
    """Return a text with its numbers as they are read: written out, or with a power of ten where they are long.

    >>> plain("3.02e+03 kg m, 1790 ± 1.1e+02; 4.2e+12, -1.5e-07"), plain("1e3x 2.5")
    ('3020 kg m, 1790 ± 110; 4.2·10¹², -1.5·10⁻⁷', '1e3x 2.5')
    """
    return _POWER.sub(_read, text)


def _read(found: re.Match[str]) -> str:
    exponent = int(found[1])
    if 0 <= exponent < _WRITTEN_OUT:
        return f"{float(found[0]):.0f}"
    return f"{found[0].partition('e')[0]}·10{str(exponent).translate(_RAISED)}"
