"""Turn what nodes sent into recordings and Markov parameter files."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid.can.logs import open_log
from aeolid.can.messages import split_errors
from aeolid.can.node import Assembly, Configuration, Node
from aeolid.can.snapshots import MarkovSnapshot
from aeolid.errors import DataError
from aeolid.filters import COUNTERS, FilterSettings
from aeolid.record import Channel, Record

Array = NDArray[np.float64]
_HEALTH_ITEMS = ("Accepted", "NotFinite", "OutOfRange", "TimeFault", "Gaps", "", "", "Withheld", "Bounded",
                 "Reinitialised")  # fmt: skip


def channels_of(configuration: Configuration) -> tuple[Channel, ...]:
    """Return the channels a node described."""
    d = configuration.description
    roles = ["input"] * d.inputs + ["output"] * d.outputs + ["scheduling"] * d.scheduling
    return tuple(Channel(n, u, r) for n, u, r in zip(d.names, d.units, roles, strict=True))


def build_records(node: Node, source: str) -> list[tuple[Record, int]]:
    """Build one recording for each uninterrupted run of a node, with the count of lost values.

    Values are the binary32 numbers that were sent; NaN where lost or missing in the controller. time_s is the sample
    index times the sample time.
    """
    records = []
    for configuration in node.configurations():
        d = configuration.description
        for table in configuration.samples.tables(d.sample_every):
            record = _record(configuration, table.index, table.values, f"{source}, node {node.number}")
            records.append((record, table.lost))
    return records


def _record(configuration: Configuration, index: NDArray[np.int64], values: Array, source: str) -> Record:
    d = configuration.description
    digest = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
    sample_time = round(d.sample_time_s * max(d.sample_every, 1), 12)
    time_s: Array = np.round(index * d.sample_time_s, 9)
    return Record(time_s, values, channels_of(configuration), sample_time, source, digest)


def write_record(path: Path, record: Record) -> Path:
    """Write a recording (.csv, .csv.gz, .parquet) and beside it NAME.roles.toml; returns the path of the roles file.

    Raises UsageError on another suffix or a folder that cannot be written to.
    """
    from aeolid.formats.writing import write_table

    columns = {"time_s": record.time_s} | {c.name: record.column(c.name) for c in record.channels}
    units = {"time_s": "s"} | {c.name: c.unit for c in record.channels}
    write_table(path, columns, units)
    roles = path.with_name(path.name.split(".")[0] + ".roles.toml")
    lines = ["[recording]", f"sample_time_s = {record.sample_time_s!r}", 'time = "time_s"', ""]
    for c in record.channels:
        lines += ["[[channel]]"] + [f"{key} = {_quote(getattr(c, key))}" for key in ("name", "unit", "role")] + [""]
    roles.write_text("\n".join(lines), encoding="utf-8")
    return roles


def _quote(text: str) -> str:
    return json.dumps(text)  # a JSON string without control characters is a TOML one


def write_markov(path: Path, node: Node, snapshot: MarkovSnapshot, record: Record | None, source: str) -> None:
    """Write markov.npz as `aeolid filter` does, from one snapshot; further keys: sample_index, complete, missing.

    Innovations (N, l) line up with the rows of `record` and are NaN where the node did not send them.
    """
    d = snapshot.description
    settings = FilterSettings(
        d.method, "f32", d.past, d.forgetting, d.regularisation, d.feedthrough, 0.0, 0.0,
        d.sample_time_s, tuple(d.offset.tolist()), tuple(d.scale.tolist()), d.model_set,
    )  # fmt: skip
    names, units = np.array(d.names), np.array(d.units)
    rows = 0 if record is None else len(record)
    innovation = _innovations(node, record, d.outputs)
    told = zip(COUNTERS, _HEALTH_ITEMS, strict=True)  # two of them are not on the wire
    counters = {name: node.counters[item] for name, item in told if item in node.counters}
    try:
        with open(path, "wb") as handle:
            np.savez_compressed(
                handle,
                theta=snapshot.theta,
                theta_scaled=snapshot.theta_scaled.astype(np.float64),
                innovation=innovation,
                residual=np.full((rows, d.outputs), np.nan),
                status=np.zeros(rows, np.int8),
                health=np.uint32(node.flags),
                counters=json.dumps(counters),
                # the wire does not carry the guards of the filter
                settings=json.dumps(asdict(settings) | {"excitation_min": None, "growth_max": None}),
                inputs=names[: d.inputs],
                outputs=names[d.inputs : d.inputs + d.outputs],
                input_units=units[: d.inputs],
                output_units=units[d.inputs : d.inputs + d.outputs],
                source=f"{source}, node {node.number}",
                sha256="" if record is None else record.sha256,
                sample_index=np.int64(-1 if snapshot.sample_index is None else snapshot.sample_index),
                complete=np.bool_(snapshot.complete),
                missing=np.array(snapshot.missing, np.int64),
            )
    except OSError as error:
        raise DataError(f"{path}: cannot be written: {error.strerror}") from None


def _innovations(node: Node, record: Record | None, outputs: int) -> Array:
    """Return the innovations (N, outputs) in the channels' units at the samples of `record`."""
    if record is None or node.now is None:
        return np.zeros((0, outputs))
    d = node.now.description
    result = np.full((len(record), outputs), np.nan)
    tables = node.now.innovations.tables(d.sample_every)
    if tables:
        every = max(d.sample_every, 1)
        first = round(record.time_s[0] / d.sample_time_s)
        row = (tables[-1].index - first) // every
        inside = (row >= 0) & (row < len(record))
        result[row[inside]] = tables[-1].values[inside]
    scale: Array = d.scale[d.inputs : d.inputs + d.outputs]
    return result * scale


def read_log(path: str | Path) -> tuple[dict[str, Array], dict[str, str]]:
    """Decode a CAN log: columns by channel name, among them time_s, and their units.

    Raises DataError when the log is damaged, or holds no samples of a node of ours, or those of several nodes or runs.
    """
    source = open_log(str(path))
    assembly = Assembly()
    while source.ended is None:
        assembly.feed(split_errors(source.read(0.0)))
    assembly.close()
    source.close()
    if source.ended.startswith("damaged"):
        raise DataError(
            f"{path}: the log is {source.ended}; what came before is kept with"
            f" aeolid listen --bus {path} --record recording.csv"
        )
    records = [r for node in assembly.nodes.values() for r in build_records(node, str(path))]
    if not records:
        problems = [f"node {n.number} {n.problem}" for n in assembly.nodes.values() if n.problem]
        why = problems[0] if problems else f"{assembly.frames} frames, none of them a described sample"
        raise DataError(f"{path}: no samples in this CAN log ({why})")
    if len(records) > 1:
        raise DataError(
            f"{path}: {len(records)} runs or nodes in one log; split them with"
            f" aeolid listen --bus {path} --record recording.csv"
        )
    record = records[0][0]
    columns = {"time_s": record.time_s} | {c.name: record.column(c.name) for c in record.channels}
    return columns, {"time_s": "s"} | {c.name: c.unit for c in record.channels}
