"""What the gates share about linking: which objects of the library a program takes when it calls one of its parts."""

from pathlib import Path

import gate

# What a program of each part names; the linker adds what these call.
PARTS = {
    "rls": {"rls", "regressor"},
    "rls_with_saving": {"rls", "rls_saved", "regressor", "regressor_saved"},
    "els": {"els", "regressor", "regressor_saved"},
    "fast_rls": {"fast_rls", "regressor"},
    "fast_rls_with_saving": {"fast_rls", "fast_rls_saved", "regressor", "regressor_saved"},
    "lattice": {"lattice", "lattice_read", "regressor"},
    "lattice_with_saving": {"lattice", "lattice_read", "lattice_saved", "regressor", "regressor_saved"},
    "stream": {"stream", "stream_values"},
    "estimator": {"estimator", "estimator_rls"},  # rls by one description, saving included
}


def read_needs(objects: list[Path]) -> dict[str, set[str]]:
    """Return for each object the objects that define what it calls."""
    defined, called = {}, {}
    for path in objects:
        lines = [line.split() for line in gate.output("arm-none-eabi-nm", path).splitlines()]
        called[path.stem] = {words[1] for words in lines if words[0] == "U"}
        defined.update({words[2]: path.stem for words in lines if len(words) == 3 and words[1] == "T"})
    return {stem: {defined[symbol] for symbol in symbols if symbol in defined} for stem, symbols in called.items()}


def add_text(objects: list[Path], sizes: dict[str, int]) -> dict[str, int]:
    """Return the text of each part as linked, all it needs included."""
    needs, text = read_needs(objects), {}
    for part, named in PARTS.items():
        wanted, seen = set(named), set[str]()
        while wanted:
            seen |= wanted
            wanted = set().union(*(needs[n] for n in wanted)) - seen
        text[part] = sum(sizes[n] for n in seen)
    return text
