"""Write the samples of nodes to disk while they stream: one file for each uninterrupted run of a node."""

from __future__ import annotations

import glob
from collections.abc import Callable
from pathlib import Path

from aeolid.can.assembly import Assembly
from aeolid.can.clock import ClockPairs
from aeolid.can.limits import FILES_MAX, FILL_SHARE, RUNS_MAX
from aeolid.can.node import Configuration, Node
from aeolid.can.run import Run, channels_of, write_roles
from aeolid.can.tables import SampleTable
from aeolid.errors import DataError, UsageError
from aeolid.formats.growing import growing_suffix

KEEP = 64  # samples that stay in memory: later frames may complete them
PATIENCE = 512  # times as many that wait for a full index
LEAST = 512  # messages that are worth being taken out; what waits is shown in the files all the same
EVERY_VALUES = 1 << 16  # values of a node after which what is older goes to the disk


__all__ = ["Run", "RunRecorder", "channels_of", "with_tag", "write_roles"]


class RunRecorder:
    """Take finished samples out of an assembly and write them; what stays in memory is bounded.

    What later frames may still change is shown in the files too, so that a process that is killed leaves all that had
    come until a second before. short, refused: runs that were left out, and their samples: too short, or too many.
    """

    def __init__(self, target: Path | None, *, innovations: Path | None = None, only: int | None = None) -> None:
        """Prepare. target: name of the recording, None to count only; innovations: folder to keep them in meanwhile."""
        self.runs: dict[int, list[Run]] = {}
        self._target, self._folder, self._only = target, innovations, only
        self.clocks: Callable[[int], list[ClockPairs]] | None = None  # of a node; with it, runs that are over are ended
        self.short: dict[int, list[int]] = {}
        self.refused: dict[int, list[int]] = {}
        self._seen: dict[int, int] = {}  # node -> values that had arrived at the last look
        self._begun: dict[int, int] = {}  # node -> runs begun
        self._written: dict[int, list[Run]] = {}  # node -> its newest two runs with rows, kept or left out
        self._inside: dict[int, tuple[Run | None, int]] = {}  # node -> run of its newest innovations, their last index
        self._shown: dict[int, int] = {}  # node -> values that had arrived when its newest rows were shown

    @property
    def target(self) -> Path | None:
        """Return the name of the recording, None where only counts are kept."""
        return self._target

    @property
    def full(self) -> bool:
        """Tell whether the disk has no room left."""
        return any(run.full for runs in self.runs.values() for run in runs[-2:])

    def poll(self, assembly: Assembly, now: bool = False) -> None:
        """Write what is old enough of nodes that have sent enough since the last look, or of all. Raises DataError."""
        for node in assembly.nodes.values():
            arrived = sum(c.samples.arrived for c in node.configurations())
            stale = any(not (c.samples.is_empty() and c.innovations.is_empty()) for c in node.previous)
            if now or stale or arrived - self._seen.get(node.number, 0) >= EVERY_VALUES:
                self._seen[node.number] = arrived
                self._drain(node, KEEP)
                node.tidy()
                if now and arrived != self._shown.get(node.number):
                    self._shown[node.number] = arrived
                    self._show(node)

    def finish(self, assembly: Assembly) -> None:
        """Take all that is left; the files wait for `name`. Raises DataError."""
        for node in assembly.nodes.values():
            self._drain(node, 0)

    def _drain(self, node: Node, keep: int) -> None:
        wanted = self._only is None or node.number == self._only
        for configuration in node.configurations():
            every = configuration.description.sample_every
            amount = keep if configuration is node.now else 0
            limits = {"patience": PATIENCE, "share": FILL_SHARE, "least": LEAST}
            tables = configuration.samples.release(amount, every, **limits)
            innovations = configuration.innovations.release(amount, every, **limits)
            if wanted:
                self._append(node.number, configuration, tables)
                self._append_innovations(node.number, configuration, innovations)

    def _append(self, number: int, configuration: Configuration, tables: list[SampleTable]) -> None:
        for table in tables:
            run = None
            try:
                run = self._run_for(number, configuration, table)
                if run is not None:
                    run.append(table)
                    if run not in (written := self._written.setdefault(number, [])):
                        self._written[number] = [*written[-1:], run]
            except DataError:  # there is no file for it
                if run is not None:
                    self.runs[number].remove(run)
                raise
            except OSError as error:
                raise DataError(f"{self._target}: nothing more can be written ({error.strerror or error})") from None

    def _run_for(self, number: int, configuration: Configuration, table: SampleTable) -> Run | None:
        """Return the run that a table goes on with, or a new one; None where there are too many."""
        runs = self.runs.setdefault(number, [])
        for run in runs[-2:]:  # the last one may be shown only so far
            if run.configuration is configuration and not run.ended and run.goes_on(table):
                return run if run.rows or run is not runs[-1] else self._settled(number, run)
        if runs and not runs[-1].rows:  # shown, and something else has come of it
            runs.pop().drop()
        if not self._may_begin(number):
            count = self.refused.setdefault(number, [0, 0])
            count[0] += 1
            count[1] += len(table.index)
            return None
        return self._settled(number, self._open(number, configuration, table))

    def _may_begin(self, number: int) -> bool:
        files = sum(len(runs) for runs in self.runs.values())
        return len(self.runs.get(number, [])) < RUNS_MAX and files < FILES_MAX

    def _settled(self, number: int, run: Run) -> Run:
        """Make a run the newest one: the one before it is completed, or left out where it is too short."""
        runs = self.runs[number]
        if run in runs:
            runs.remove(run)
        if runs and runs[-1].is_short:
            short = runs.pop()
            short.drop()
            count = self.short.setdefault(number, [0, 0])
            count[0] += 1
            count[1] += short.found
        elif runs:
            self._settle(number)
        runs.append(run)
        return run

    def _open(self, number: int, configuration: Configuration, table: SampleTable) -> Run:
        first = int(table.index[0])
        run = Run(configuration, first, first)
        if self._target is not None:
            suffix = growing_suffix(self._target) or ""
            stem = self._target.name[: len(self._target.name) - len(suffix)]
            k = self._begun.get(number, 0) + 1
            while list(self._target.parent.glob(f"{glob.escape(stem)}.node{number}.run{k}.*")):
                k += 1  # what a killed reception left stays
            self._begun[number] = k
            run.path = self._target.with_name(f"{stem}.node{number}.run{k}.part{suffix}")
        return run

    def _show(self, node: Node) -> None:
        """Put what has come of a node, and may still change, on the disk."""
        configuration, runs = node.now, self.runs.setdefault(node.number, [])
        wanted = self._target is not None and (self._only is None or node.number == self._only)
        if not wanted or configuration is None:
            return
        tables = configuration.samples.tables(configuration.description.sample_every, FILL_SHARE)
        try:
            if runs and runs[-1].rows and not runs[-1].ended:
                mine = runs[-1].configuration is configuration and tables and runs[-1].goes_on(tables[0])
                runs[-1].show(tables.pop(0) if mine else None)
            elif len(runs) > 1 and tables and runs[-2].configuration is configuration and runs[-2].goes_on(tables[0]):
                runs[-2].show(tables.pop(0))
            if not tables:
                return
            if (not runs or runs[-1].rows) and self._may_begin(node.number):
                runs.append(self._open(node.number, configuration, tables[-1]))
            if not runs[-1].rows and runs[-1].configuration is configuration:
                runs[-1].show(tables[-1])
        except OSError as error:
            raise DataError(f"{self._target}: nothing more can be written ({error.strerror or error})") from None

    def _append_innovations(self, number: int, configuration: Configuration, tables: list[SampleTable]) -> None:
        runs = [run for run in self._written.get(number, []) if run.configuration is configuration]
        for table in tables if self._folder is not None and runs else ():
            first, (run, last) = int(table.index[0]), self._inside.get(number, (None, -1))
            if run not in runs or (run is not runs[-1] and (first <= last or first > run.last)):
                later = runs[runs.index(run) + 1 :] if run in runs else runs
                run = next((r for r in later if first <= r.last), runs[-1])
            self._inside[number] = run, int(table.index[-1])
            if self._folder is not None:
                run.append_innovations([table], self._folder)

    def name(self, number: int, tag: str) -> None:
        """Complete the files of a node and give them their names. Raises DataError."""
        runs = self.runs.get(number, [])
        for run in [run for run in runs if not run.rows]:  # shown, and nothing has come of it
            run.drop()
            runs.remove(run)
        for k, run in enumerate(runs):
            try:
                run.finish(with_tag(self._target, tag + (f"-run{k + 1}" if len(runs) > 1 else "")))
            except OSError as error:
                raise DataError(f"{self._target}: cannot be completed ({error.strerror or error})") from None
            except UsageError as error:  # the name was taken meanwhile: the rows stay where they are
                raise DataError(f"{error}; they are in {run.table_path}") from None

    def _settle(self, number: int) -> None:
        """Complete the file of a node's newest run: one that starts again and again must not use up all handles."""
        if self.clocks is not None:
            self.date(number, self.clocks(number))
        for run in self.runs[number][-1:]:
            run.drop_innovations()
            run.end()

    def date(self, number: int, clocks: list[ClockPairs]) -> None:
        """Give each run of a node that is not complete yet the clock whose samples are its own."""
        shifts: dict[int, int] = {}
        for run in reversed([run for run in self.runs.get(number, []) if not run.ended]):
            for pairs in reversed(clocks):
                assert pairs.last is not None
                index, _ = pairs.pairs()
                turn = round((run.last - pairs.last[0]) / 65536) * 65536
                shift = shifts.get(id(pairs), turn)
                if index[0] + shift <= run.last and index[-1] + shift >= run.first:
                    shifts[id(pairs)] = shift
                    run.clock = pairs.fit(shift)
                    break


def with_tag(path: Path | None, tag: str) -> Path | None:
    """Put a tag behind the first part of a file's name."""
    if path is None:
        return None
    stem, dot, rest = path.name.partition(".")
    return path.with_name(stem + tag + dot + rest)
