"""Read a case directory: recordings, roles, baseline model, context."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from aeolid.diagnose.data.inside import resolve
from aeolid.diagnose.data.machine import MOST_BLADES
from aeolid.diagnose.data.match import matched
from aeolid.diagnose.rules import in_force
from aeolid.errors import Contradiction, DataError, UsageError
from aeolid.file_kinds import check_tables, require_case
from aeolid.formats import read_record
from aeolid.models import equations_file
from aeolid.models.angles import turn_of
from aeolid.models.equations import Equations
from aeolid.models.equations_names import unmatched
from aeolid.models.equations_size import require_few, require_readable
from aeolid.models.exchange.files import read_state_space
from aeolid.models.exchange.fmu import Fmu, open_fmu
from aeolid.models.rate import at_rate_of
from aeolid.models.state_space import StateSpace
from aeolid.record import Record, Roles, check_keys, file_sha256, require_distinct, require_same_layout
from aeolid.text_files import is_number, load_toml, shown
from aeolid.units import conversion

CONTEXT: dict[str, tuple[Callable[[Any], bool], str]] = {  # what is known of the machine: check, and its wording
    "machine": (lambda v: isinstance(v, str), "a text"),
    "blades": (
        lambda v: isinstance(v, int) and not isinstance(v, bool) and 1 <= v <= MOST_BLADES,
        f"a whole number of 1 … {MOST_BLADES}",
    ),
    "rated_speed_rad_s": (lambda v: is_number(v) and 0 < v < 1e6, "a speed in rad/s above 0"),
    "gearbox_ratio": (lambda v: is_number(v) and 0 < v < 1e6, "a ratio of speeds above 0"),
    "offshore": (lambda v: isinstance(v, bool), "true or false"),
    "closed_loop": (lambda v: isinstance(v, bool), "true or false"),
}
MOST_STATES = 40  # of a baseline: beyond that compiling and fitting take minutes
_MOST_FREE = 200  # parameters of a baseline: their sensitivities of 12,000 samples of three channels take 60 MB
ONE_RUN = "same_inputs compares one run with the recordings sample by sample; give one file"
RUN_ONLY = (
    "same_inputs = true says that a simulator's run was made with the recorded inputs and acts for a run only; a model"
    " is always given the recorded inputs: leave it out"
)
KINDS = ("state_space", "equations", "run", "fmu")


@dataclass(frozen=True, eq=False)
class Case:
    """Hold what a diagnosis starts from.

    more_runs: further runs of the simulator, in other wind. around: the fit data lie on both sides of the selection
    data, where the baseline of the first half does not last.
    """

    title: str
    records: tuple[Record, ...]
    kind: str
    baseline: StateSpace | Equations | Record | Fmu
    baseline_file: str
    baseline_sha256: str
    context: dict[str, Any]
    directory: Path
    same_inputs: bool = False
    more_runs: tuple[Record, ...] = ()
    around: bool = False

    @property
    def runs(self) -> tuple[Record, ...]:
        """Return all runs of the simulator that the baseline is, none of another kind."""
        return (self.baseline, *self.more_runs) if isinstance(self.baseline, Record) else ()


def load_case(
    directory: str | Path, *, allow_outside: bool = False, allow_fmu: bool = False, resample: float | str | None = None
) -> Case:
    """Read `case.toml` and all it names; raises DataError that names the file and the key.

    allow_outside: files may lie outside the folder too; default no, a case from elsewhere could name any of this
    machine's. allow_fmu: the native library of a functional mock-up unit may be run, confined; default no. resample:
    goes before what the roles files say of the clock, None leaves it to them.
    """
    folder = Path(directory)
    find = partial(resolve, folder, allow_outside=allow_outside)
    data, head, files, source = _tables(find, folder)
    kind, listed = _baseline(data.get("baseline"), source)
    context = _context(data.get("context", {}), source)
    roles, records = _recordings(find, files, source, resample)
    _require_possible(context, records, source)
    paths = [find(file, f"{source} [baseline] file") for file in listed]
    _require_there(paths)
    path = paths[0]
    more: tuple[Record, ...] = ()
    baseline: StateSpace | Equations | Record | Fmu
    if kind == "run":
        own = data["baseline"].get("roles")
        own = None if own is None else _roles(find(own, f"{source} [baseline] roles"), resample)
        records, (baseline, *others) = _runs(paths, records, roles, own)
        more = tuple(others)
    elif kind == "fmu":
        baseline = _unit(path, records[0], allow_fmu)
    else:
        records, baseline = _model(kind, path, records)
    same = data["baseline"].get("same_inputs", False)
    return Case(
        str(head.get("title", folder.name)), records, kind, baseline, listed[0],
        baseline.sha256 if isinstance(baseline, Record) else file_sha256(path), context, folder, same, more,
    )  # fmt: skip


Find = Callable[[str, str], Path]


def _require_there(paths: Sequence[Path]) -> None:
    """Raise DataError on a baseline that is not there, with what makes one."""
    for path in paths:
        if not path.exists():
            raise DataError(
                f"{path}: no such file; the case has it as its baseline: aeolid identify --out makes a model, a"
                " simulation is named by aeolid init --baseline"
            )


def load_recordings(
    directory: str | Path, *, allow_outside: bool = False, resample: float | str | None = None
) -> tuple[Record, ...]:
    """Read the recordings of a case, not its baseline; arguments and errors as of `load_case`."""
    find = partial(resolve, Path(directory), allow_outside=allow_outside)
    _, _, files, source = _tables(find, Path(directory))
    return _recordings(find, files, source, resample)[1]


def _tables(find: Find, folder: Path) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any], str]:
    """Return the content of case.toml, its tables [case] and [recordings], and its name."""
    require_case(folder)
    source = str(find("case.toml", str(folder)))
    data = load_toml(source)
    check_tables(data, "case", source)
    head, files = data.get("case", {}), data.get("recordings", {})
    check_keys(head, {"title"}, f"{source} [case]")
    check_keys(files, {"files", "roles"}, f"{source} [recordings]")
    if not isinstance(head.get("title", ""), str):
        raise DataError(f"{source} [case]: title = {shown(head['title'])} is not a text")
    return data, head, files, source


def _recordings(
    find: Find, files: dict[str, Any], source: str, resample: float | str | None
) -> tuple[Roles, tuple[Record, ...]]:
    names = files.get("files")
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise DataError(f"{source} [recordings]: files must list at least one recording")
    if not isinstance(files.get("roles"), str):
        raise DataError(f"{source} [recordings]: roles is missing (the roles TOML file)")
    roles = _roles(find(files["roles"], f"{source} [recordings] roles"), resample)
    records = tuple(read_record(find(n, f"{source} [recordings] files"), roles) for n in names)
    require_same_layout(records)
    require_distinct(records)
    return roles, records


def _require_possible(context: Mapping[str, Any], records: Sequence[Record], source: str) -> None:
    """Refuse a rated speed that, read in rpm, is the one at which the recorded rotor angle shows a turbine at work."""
    rules = in_force().run_prior
    rated = context.get("rated_speed_rad_s")
    turning = _turning(records[0]) if rated else None
    if not rated or not turning:
        return
    share = turning / (rated * math.pi / 30)  # of the rated speed, were it in rpm
    if rules.slowest_turning < share < rules.fastest_turning:
        raise DataError(
            f"{source} [context]: rated_speed_rad_s = {rated:g}, but the rotor turns at {turning:.3g} rad/s"
            f" ({turning * 30 / math.pi:.3g} rpm) in {records[0].source}; rad/s are wanted, not rpm"
        )


def _turning(record: Record) -> float | None:
    """Return the median speed in rad/s that a recorded rotor angle shows; None where there is none."""
    channel = next(iter(record.of("azimuth")), None)
    turn = None if channel is None else turn_of(channel.unit)
    if channel is None or turn is None:
        return None
    steps = np.diff(record.column(channel.name)) / turn
    rates = np.abs(steps - np.rint(steps)) * 2 * math.pi / record.sample_time_s
    return float(np.nanmedian(rates)) if np.isfinite(rates).any() else None


def _roles(path: Path, resample: float | str | None) -> Roles:
    roles = Roles.load(path)
    return roles if resample is None else replace(roles, resample=resample)


def make_case(
    records: Sequence[Record], baseline: StateSpace | Equations | Record, *, title: str, source: str, sha256: str,
    context: Mapping[str, Any] | None = None, same_inputs: bool = False, more_runs: Sequence[Record] = (),
) -> Case:  # fmt: skip
    """Build a case without a folder, with the checks of `load_case`.

    source: what messages call the baseline; context: facts about the machine, as in case.toml; same_inputs: whether a
    simulator's run had the recorded inputs; more_runs: further runs beside the baseline. Raises DataError, and
    UsageError on same_inputs of a baseline that is no run or of several runs.
    """
    require_same_layout(records)
    require_distinct(records)
    facts, found = _context(dict(context or {}), "context"), tuple(records)
    _require_possible(facts, found, source)
    kind, more = "run", tuple(more_runs)
    if isinstance(baseline, Record):
        if more and same_inputs:
            raise UsageError(ONE_RUN)
        found, (baseline, *others) = matched(found, (baseline, *more))
        more = tuple(others)
        require_same_layout((*found, baseline, *more))
    else:
        if same_inputs:
            raise UsageError(RUN_ONLY)
        kind = "equations" if isinstance(baseline, Equations) else "state_space"
        if isinstance(baseline, Equations):
            _require_fitting(baseline, source)
        found = tuple(at_rate_of(baseline.sample_time_s, r) for r in found)
        _check_channels(baseline, found[0], source)
    return Case(title, found, kind, baseline, source, sha256, facts, Path(), same_inputs, more)


def _runs(
    paths: Sequence[Path], records: tuple[Record, ...], roles: Roles, own: Roles | None
) -> tuple[tuple[Record, ...], tuple[Record, ...]]:
    """Read a simulator's runs by the recordings' roles, or by their own and then brought together with them."""
    runs = tuple(read_record(p, roles if own is None else own) for p in paths)
    if own is not None:
        records, runs = matched(records, runs)
    require_same_layout((*records, *runs))
    return records, runs


def _unit(path: Path, record: Record, allowed: bool) -> Fmu:
    """Open a functional mock-up unit that may be run; UsageError names it and its hash where it was not allowed."""
    unit = open_fmu(path)
    if not allowed:
        raise UsageError(
            f"{path}: a diagnosis would run the native library in this unit, SHA-256 {file_sha256(path)};"
            " if you trust whom it comes from, say so with --allow-fmu"
        )
    _check_unit(unit, record)
    return unit


def _equations(path: Path) -> Equations:
    """Read equations that a diagnosis can take apart and fit."""
    model = equations_file.load(path)
    _require_fitting(model, str(path))
    return model


def _require_fitting(model: Equations, source: str) -> None:
    """Refuse equations that are too many to be taken apart and fitted."""
    require_readable(model, source)
    require_few(len(model.states), "states", source, MOST_STATES, " by a diagnosis; reduce the model")
    free = sum(p.free for p in model.parameters)
    require_few(free, "free parameters", source, _MOST_FREE, " by a diagnosis; hold what the recording cannot move")


def _baseline(table: Any, source: str) -> tuple[str, list[str]]:
    """Return the kind and the files of a baseline: one, or several runs of a simulator."""
    where = f"{source} [baseline]"
    if not isinstance(table, dict):
        raise DataError(f"{where}: the table is missing; give kind and file")
    check_keys(table, {"kind", "file", "files", "same_inputs", "roles"}, where)
    kind = table.get("kind")
    if kind not in KINDS:
        raise DataError(f"{where}: kind = {shown(kind)} is none of {', '.join(KINDS)}")
    if not isinstance(table.get("same_inputs", False), bool):
        raise DataError(f"{where}: same_inputs is true or false")
    files = table.get("files", [table.get("file")])
    if ("file" in table) == ("files" in table) or not isinstance(files, list) or not files:
        raise DataError(f"{where}: give file, or files = [...] for several runs of a simulator")
    if not all(isinstance(n, str) for n in files):
        raise DataError(f"{where}: names of files are texts")
    if len(files) > 1 and kind != "run":
        raise DataError(f'{where}: several files are for kind = "run"; give one file')
    if kind != "run" and table.get("same_inputs", False):
        raise DataError(f'{where}: {RUN_ONLY}, or give kind = "run"')
    if len(files) > 1 and table.get("same_inputs", False):
        raise DataError(f"{where}: {ONE_RUN}")
    if "roles" in table and (kind != "run" or not isinstance(table["roles"], str)):
        raise DataError(f'{where}: roles names the roles file of a run\'s own file; it is for kind = "run"')
    return kind, files


def _context(table: Any, source: str) -> dict[str, Any]:
    """Check the facts about the machine: each by its type and range; a key that nobody reads is refused."""
    if not isinstance(table, dict):
        raise DataError(f"{source}: [context] is not a table")
    check_keys(table, set(CONTEXT), f"{source} [context]")
    for key, value in table.items():
        fits, wanted = CONTEXT[key]
        if not fits(value):
            raise DataError(f"{source} [context]: {shown(key)[1:-1]} = {shown(value)} is not {wanted}")
    return table


def _check_unit(unit: Fmu, record: Record) -> None:
    units = {c.name: c.unit for c in record.channels}
    unit.require(record.names("input"), "input", units)
    unit.require(record.names("output"), "output", units)


def _model(kind: str, path: Path, records: tuple[Record, ...]) -> tuple[tuple[Record, ...], StateSpace | Equations]:
    """Read a model whose channels the recordings have, and bring them to its sample time."""
    model = read_state_space(path) if kind == "state_space" else _equations(path)
    found = tuple(at_rate_of(model.sample_time_s, r) for r in records)
    _check_channels(model, found[0], str(path))
    return found, model


def _check_channels(model: StateSpace | Equations, record: Record, source: str) -> None:
    units = {c.name: (c.unit, c.role) for c in record.channels}
    for what, signals in (("input", model.inputs), ("output", model.outputs)):
        for signal in signals:
            if signal.name not in units:
                raise DataError(f"{source}: {unmatched(model, what, signal.name, record)}")
            unit, role = units[signal.name]
            if signal.unit and unit and signal.unit.replace(" ", "") != unit.replace(" ", ""):
                raise Contradiction(
                    f"{source}: {signal.name} is in {signal.unit!r}, the roles file says {unit!r};"
                    f" {conversion(unit, signal.unit)}, or correct its unit in the roles file"
                )
            if what == "input" and role == "output":
                raise DataError(f"{source}: input {signal.name!r} has the role 'output' in the roles file")
            if what == "output" and role != "output":
                raise DataError(f"{source}: output {signal.name!r} has the role {role!r} in the roles file")
