"""Damage files as transfer, disks and ill will do: bytes, lengths, pieces, text tokens, and values of a wrong type."""

from __future__ import annotations

import copy
import gzip
import io
import json
import re
import zipfile
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np

Mutate = Callable[[bytes, np.random.Generator], bytes]
LENGTHS = (0, 1, 2, 7, 8, 9, 127, 128, 255, 256, 32767, 32768, 65535, 65536, 2**24, 2**31 - 1, 2**31, 2**32 - 1,
           2**40, 2**63 - 1, 2**63, 2**64 - 1)  # fmt: skip
TOKENS = (b"", b"nan", b"inf", b"-1e400", b"1e-400", b"-", b"0x1F", b"1_0", b"9" * 400, b"\xff\xfe", b"\0", b'"', b"''",
          b"\xa0", b"a,b", b"1;5", b"\r", b"\n\n", b"[", b"=", b"#", b"\x1f\x8b")  # fmt: skip
WRONG: tuple[Any, ...] = (
    "", "a", "nan", "..", "/", "a\0b", "x" * 5000, "\x1b[2J\u202e", 0, 1, -1, 2**40, 10**400, 0.0, -0.5, 1e308,
    float("nan"), float("inf"), True, False, [], [[]], [1], ["a"], [1, "a"], [None], {}, {"a": 1}, {"name": "a"}, [{}],
    [{"name": 1}], None,
)  # fmt: skip


def damage(content: bytes, random: np.random.Generator) -> bytes:
    """Damage bytes in one to three places: flips, wrong bytes, cuts, pieces repeated, moved, left out, lengths."""
    wrong = bytearray(content)
    for _ in range(random.integers(1, 4)):
        if not wrong:
            break
        at = int(random.integers(0, len(wrong)))
        size = int(min(random.geometric(0.05), len(wrong) - at))
        piece = wrong[at : at + size]
        way = random.integers(0, 8)
        if way == 0:
            wrong[at] ^= 1 << int(random.integers(0, 8))
        elif way == 1:
            wrong[at] = int(random.integers(0, 256))
        elif way == 2 and random.random() < 0.5:
            del wrong[at:]
        elif way == 3:
            wrong[at:at] = piece * int(random.integers(1, 5))
        elif way == 4:
            del wrong[at : at + size]
        elif way == 5:
            to = int(random.integers(0, len(wrong)))
            wrong[to : to + size] = piece
        else:
            _write_length(wrong, at, random)
    return bytes(wrong)


def _write_length(wrong: bytearray, at: int, random: np.random.Generator) -> None:
    """Put a length or count, as such fields hold it, where such a field may be."""
    width = int(random.choice([1, 2, 4, 8]))
    at -= at % width
    value = int(random.choice(np.array(LENGTHS, dtype=object))) % (1 << 8 * width)
    wrong[at : at + width] = value.to_bytes(width, "little" if random.random() < 0.8 else "big")


def text(content: bytes, random: np.random.Generator) -> bytes:
    """Exchange words and numbers of a text, or damage it as bytes."""
    if random.random() < 0.4:
        return damage(content, random)
    words = re.split(rb"([\s,;=\"()\[\]]+)", content)
    for _ in range(random.integers(1, 4)):
        words[int(random.integers(0, len(words)))] = TOKENS[int(random.integers(0, len(TOKENS)))]
    return b"".join(words)


def packed_text(content: bytes, random: np.random.Generator) -> bytes:
    """Damage gzipped text, within or without."""
    if random.random() < 0.3:
        return damage(content, random)
    return gzip.compress(text(gzip.decompress(content), random), 1, mtime=0)


def archive(content: bytes, random: np.random.Generator) -> bytes:
    """Damage a NumPy archive: as bytes, or one member, packed again with a true checksum."""
    if random.random() < 0.3:
        return damage(content, random)
    target = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as source, zipfile.ZipFile(target, "w") as result:
        members = {info.filename: source.read(info) for info in source.infolist()}
        name = sorted(members)[int(random.integers(0, len(members)))]
        head = members[name][:128]
        changed = text(head, random) if random.random() < 0.5 else damage(head, random)
        members[name] = changed + members[name][128:]
        for key, value in members.items():
            method = zipfile.ZIP_DEFLATED if random.random() < 0.3 else zipfile.ZIP_STORED
            result.writestr(zipfile.ZipInfo(key), value, method)  # its date does not depend on the clock
    return target.getvalue()


def matlab(content: bytes, random: np.random.Generator) -> bytes:
    """Damage a MATLAB file, or pack a damaged element of it."""
    if random.random() < 0.6:
        return content[:128] + damage(content[128:], random)
    packed = zlib.compress(damage(content[128:], random), 1)
    return content[:128] + (15).to_bytes(4, "little") + len(packed).to_bytes(4, "little") + packed


def blf(content: bytes, random: np.random.Generator) -> bytes:
    """Damage a BLF: as bytes, or what its first container holds, packed again."""
    if random.random() < 0.3:
        return damage(content, random)
    start = int.from_bytes(content[4:8], "little")
    size = int.from_bytes(content[start + 8 : start + 12], "little")
    packed = zlib.compress(damage(zlib.decompress(content[start + 32 : start + size]), random), 1)
    sizes = (len(packed) + 32).to_bytes(4, "little")
    rest = content[start + size + size % 4 :]
    head = content[: start + 8] + sizes + content[start + 12 : start + 32]
    return head + packed + bytes((len(packed) + 32) % 4) + rest


def typed(load: Callable[[str], Any], dump: Callable[[Any], str]) -> Mutate:
    """Return what exchanges values of a structured text for ones of a wrong type, and drops or doubles entries."""

    def mutate(content: bytes, random: np.random.Generator) -> bytes:
        if random.random() < 0.2:
            return text(content, random)
        data = copy.deepcopy(load(content.decode()))
        for _ in range(random.integers(1, 3)):
            places = list(_places(data))
            if not places:
                break
            holder, key = places[int(random.integers(0, len(places)))]
            if random.random() < 0.15:
                del holder[key]
            else:
                holder[key] = copy.deepcopy(WRONG[int(random.integers(0, len(WRONG)))])
        return dump(data).encode("utf-8", "surrogatepass")

    return mutate


def _places(data: Any) -> Any:
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in list(entries):
        yield data, key
        yield from _places(value)


def to_toml(data: dict[str, Any]) -> str:
    """Write TOML with every table inline below the first level; what TOML cannot say (null) becomes a text."""
    return "".join(f"{json.dumps(key)} = {_toml(value)}\n" for key, value in data.items())


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return str(value)
    return json.dumps("null" if value is None else value).replace("\\u001b", "\\u001B")
