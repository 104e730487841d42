"""Follow the modes of many turbines over months."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aeolid.api import markup
from aeolid.api.progress import Progress, shown
from aeolid.api.session import in_python, public
from aeolid.api.table import Table
from aeolid.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

    from aeolid.record import Roles


class Fleet:
    """Hold the modes of each turbine and period, and which of them moved.

    Attributes
    ----------
    facts : mapping
        The content of fleet.json.
    folder : pathlib.Path
        Where the cache lies, and where `report` writes.
    """

    def __init__(self, facts: Mapping[str, Any], folder: Path) -> None:
        """Hold the facts of a fleet.

        Parameters
        ----------
        facts : mapping
            The content of fleet.json.
        folder : pathlib.Path
            Where the cache lies.
        """
        self.facts, self.folder = facts, folder

    @property
    def modes(self) -> Table[dict[str, Any]]:
        """Return a row for each mode of each period: frequency, damping, deviations, track."""
        from aeolid.fleet.tables import mode_rows

        return Table("modes", mode_rows(self.facts["periods"]), dict)

    @property
    def skipped(self) -> Table[dict[str, Any]]:
        """Return what was left out and why."""
        return Table("left out", self.facts["skipped"], dict)

    @property
    def moved(self) -> tuple[str, ...]:
        """Return the modes that moved by more than chance, a sentence for each."""
        return tuple(self.facts["moved"])

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what to beware of."""
        return tuple(map(in_python, self.facts["notes"]))

    def to_frame(self) -> pd.DataFrame:
        """Return the modes as a pandas.DataFrame."""
        return self.modes.to_frame()

    def to_json(self) -> dict[str, Any]:
        """Return the content of fleet.json."""
        return dict(self.facts)

    @public
    def save(self, path: str | Path) -> None:
        """Write the facts as JSON.

        Parameters
        ----------
        path : str or pathlib.Path
            The file; another of this name is replaced.
        """
        from aeolid import output

        output.write_json(path, self.to_json())

    @public
    def report(self, folder: str | Path | None = None) -> Path:
        """Write report.html, fleet.json and modes.parquet.

        Parameters
        ----------
        folder : str or pathlib.Path, optional
            Where to; default the folder of the cache.

        Returns
        -------
        pathlib.Path
            The page.
        """
        from aeolid import output
        from aeolid.fleet.tables import mode_rows, write_modes
        from aeolid.report.fleet import render_fleet

        target = self.folder if folder is None else Path(folder)
        output.make_folder(target)
        write_modes(target / "modes.parquet", mode_rows(self.facts["periods"]))
        output.write_json(target / "fleet.json", self.to_json())
        render_fleet(self.to_json(), target / "report.html")
        return target / "report.html"

    @public
    def plot_modes(self, axes: Any = None) -> Any:
        """Draw the frequency of each track over time, with one standard deviation.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; default a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from aeolid.api import axes as places

        place = places.one(axes)
        frame = self.to_frame()
        for (turbine, track), rows in frame[frame["track"].notna()].groupby(["turbine", "track"]):
            days = (rows["start_s"] - frame["start_s"].min()) / 86400
            spread = rows["frequency_std_hz"].astype(float).fillna(0.0)
            place.errorbar(
                days, rows["frequency_hz"], spread, marker=".", linewidth=0.8,
                label=places.label(f"{turbine} {int(track)}"),
            )  # fmt: skip
        place.set_xlabel("days since the first period")
        place.set_ylabel("frequency (Hz)")
        place.legend(loc="best", fontsize="small")
        return place

    def __repr__(self) -> str:
        turbines, periods = self.facts["turbines"], len(self.facts["periods"])
        moved = markup.count(len(self.moved), "mode")
        return f"<Fleet: {markup.count(turbines, 'turbine')}, {markup.count(periods, 'period')}, {moved} moved>"

    def _repr_html_(self) -> str:
        return markup.shown(repr(self)[1:-1], self.modes._repr_html_(), lines=[*self.moved, *self.notes])


@public
def fleet(
    recordings: str | Path | Sequence[str | Path],
    roles: str | Path | Roles,
    *,
    past: int,
    out: str | Path,
    order: int | str | None = "auto",
    group: str | None = None,
    window: str | None = None,
    feedthrough: Sequence[str] = (),
    workers: int = 1,
    progress: Progress = None,
) -> Fleet:
    """Map recordings to models of each turbine and period and follow their modes; a second call does what is new.

    Parameters
    ----------
    recordings : str, pathlib.Path or sequence of them
        Folders (searched to the bottom), patterns or files.
    roles : str, pathlib.Path or aeolid.record.Roles
        What the channels are.
    past : int
        Past window p in samples.
    out : str or pathlib.Path
        Folder for the cache of factors.
    order : int or "auto"
        Number of states; by default one is chosen for each turbine.
    group : str, optional
        Regular expression on the path with (?P<turbine>…), (?P<period>…) or (?P<start>…); turbine is by default the
        name of the folder.
    window : str, optional
        Length of a period, for example "1d", "6h", "30min"; default a day.
    feedthrough : sequence of str
        Inputs that act within the sample.
    workers : int
        Processes, 1 to 1024; with more than one a script needs `if __name__ == "__main__":` around the call.
    progress : bool or callable, optional
        By default a bar on a terminal and in a notebook; True shows it always, False never; a function is called with
        a text and the share done.

    Returns
    -------
    Fleet

    Raises
    ------
    DataError
        Where nothing is usable.
    UsageError
        Where a setting is wrong or the folder cannot be written to.
    """
    from aeolid.fleet.plan import Plan, find_recordings, names_period, parse_window
    from aeolid.fleet.run import run_fleet
    from aeolid.fleet.workers import open_pool
    from aeolid.identify.request_checks import read_order
    from aeolid.record import Roles

    if not isinstance(workers, int) or not 1 <= workers <= 1024:
        raise UsageError(f"workers = {workers!r} is not 1 to 1024 processes")
    length = None if window is None and names_period(group) else parse_window(window or "1d")
    table = roles if isinstance(roles, Roles) else Roles.load(roles)
    plan = Plan(table, past, read_order(order), tuple(feedthrough), group, length)
    given = [recordings] if isinstance(recordings, str | Path) else list(recordings)
    target = Path(out)
    paths = find_recordings([str(entry) for entry in given], target)
    with open_pool(min(workers, len(paths))) as pool, shown(progress) as show:
        facts = run_fleet(paths, plan, target, pool, lambda stage, done, of: show(stage, done / max(of, 1)))
    return Fleet(facts, target)
