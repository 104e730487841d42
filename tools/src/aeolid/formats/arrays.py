"""Turn named arrays into channels: vectors, and matrices column by column."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from aeolid.errors import DataError
from aeolid.formats.bounds import MOST_CHANNELS, guard_names, guard_size
from aeolid.formats.headings import split_heading
from aeolid.formats.table import Choose, Table, require_one_length, to_numbers


def table_of_arrays(
    path: Path, shapes: Mapping[str, Sequence[int]], load: Callable[[list[str]], Mapping[str, NDArray[Any]]],
    choose: Choose,
) -> Table:  # fmt: skip
    """Take vectors (N,), (N, 1), (1, N) and the columns y1, y2, … of matrices y (N, k) as channels.

    shapes: of every array; load: reads those that are named, once the wanted ones are known. A vector called as the
    column of a matrix is a second heading of that name, whatever their order in the file.
    """
    found: list[tuple[str, tuple[str, int | None]]] = []
    for name, shape in shapes.items():
        if len(shape) == 1 or (len(shape) == 2 and 1 in shape):
            found.append((name, (name, None)))
        elif len(shape) == 2:
            if shape[1] + len(found) > MOST_CHANNELS:
                raise DataError(f"{path}: {name} is a matrix of {shape[1]} columns; at most {MOST_CHANNELS} are read")
            found += [(f"{name}{i + 1}", (name, i)) for i in range(shape[1])]
    names, places = guard_names(path, tuple(heading for heading, _ in found)), dict(found)
    wanted = choose(names, None)
    guard_size(path, sum(8 * max(shapes[places[heading][0]][:1], default=0) for heading in wanted))
    arrays = load(list(dict.fromkeys(places[heading][0] for heading in wanted)))
    columns = {}
    for heading in wanted:
        name, index = places[heading]
        values = arrays[name].reshape(-1) if index is None else arrays[name][:, index]
        columns[heading] = to_numbers(path, heading, values)
    require_one_length(path, columns)
    units = {name: unit for name in names if (unit := split_heading(name)[1]) is not None}
    return Table(str(path), names, columns, units)
