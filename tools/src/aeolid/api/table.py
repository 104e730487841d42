"""Hold rows that print as a table: modes, scores, effects, fits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

if TYPE_CHECKING:
    import pandas as pd

T = TypeVar("T")


class Table(Sequence[T], Generic[T]):
    """Hold items of one kind in order; iterate, index, or take them as a pandas.DataFrame."""

    def __init__(
        self, what: str, items: Sequence[T], row: Callable[[T], dict[str, Any]], columns: Sequence[str] = ()
    ) -> None:
        """Hold items.

        Parameters
        ----------
        what : str
            What the items are, in the plural: "modes".
        items : sequence
            The items.
        row : callable
            Turns an item into a row: column to value.
        columns : sequence of str
            The columns of a table without items.
        """
        self._what, self._items, self._row, self._columns = what, tuple(items), row, tuple(columns)

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> Table[T]: ...
    def __getitem__(self, index: int | slice) -> T | Table[T]:
        """Return one item, or a table of some."""
        if isinstance(index, slice):
            return Table(self._what, self._items[index], self._row, self._columns)
        return self._items[index]

    def __len__(self) -> int:
        return len(self._items)

    def __iter__(self) -> Iterator[T]:
        return iter(self._items)

    def to_frame(self) -> pd.DataFrame:
        """Return the rows as a pandas.DataFrame, one an item; without items it has the columns all the same."""
        import pandas as pd

        rows = [self._row(item) for item in self._items]
        return pd.DataFrame(rows) if rows else pd.DataFrame(columns=list(self._columns))

    def __repr__(self) -> str:
        columns = ", ".join(self._row(self._items[0])) if self._items else ""
        return f"<Table: {len(self._items)} {self._what}{': ' if columns else ''}{columns}>"

    def _repr_html_(self) -> str:
        html: str = self.to_frame().to_html(index=False, na_rep="", float_format=lambda v: f"{v:.4g}")
        return html
