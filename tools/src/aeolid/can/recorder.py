"""Turn what nodes sent into recordings and Markov parameter files."""

from __future__ import annotations

import hashlib
import json
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aeolid import output
from aeolid.can.assembly import Assembly
from aeolid.can.logs import open_log
from aeolid.can.node import Configuration, Node
from aeolid.can.runs import Run, channels_of
from aeolid.can.snapshots import MarkovSnapshot
from aeolid.errors import DataError, UsageError
from aeolid.filters import COUNTERS, FilterSettings
from aeolid.record import Record

Array = NDArray[np.float64]
_HEALTH_ITEMS = ("Accepted", "NotFinite", "OutOfRange", "TimeFault", "Gaps", "", "", "Withheld", "Bounded",
                 "Reinitialised", "Released")  # fmt: skip


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


def write_markov(path: Path, node: Node, snapshot: MarkovSnapshot, run: Run | None, source: str) -> None:
    """Write markov.npz as `aeolid filter` does, from one snapshot; further keys: sample_index, complete, missing.

    Innovations (N, l) line up with the rows of `run` and are NaN where the node did not send them. Raises DataError.
    """
    d = snapshot.description
    settings = FilterSettings(
        d.method, "f32", d.past, d.forgetting, d.regularisation, d.feedthrough, 0.0, 0.0,
        d.sample_time_s, tuple(d.offset.tolist()), tuple(d.scale.tolist()), d.model_set,
    )  # fmt: skip
    names, units = np.array(d.names), np.array(d.units)
    rows = 0 if run is None else run.rows
    innovation = np.zeros((0, d.outputs)) if run is None else run.innovations(d.scale[d.inputs : d.inputs + d.outputs])
    told = zip(COUNTERS, _HEALTH_ITEMS, strict=True)  # two of them are not on the wire
    counters = {name: node.counters[item] for name, item in told if item in node.counters}
    try:
        with output.replacing(path) as handle:
            np.savez_compressed(
                handle,
                theta=snapshot.theta,
                theta_scaled=snapshot.theta_scaled.astype(np.float64),
                innovation=innovation,
                residual=np.broadcast_to(np.nan, (rows, d.outputs)),
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
                sha256="" if run is None else run.sha256,
                sample_index=np.int64(-1 if snapshot.sample_index is None else snapshot.sample_index),
                complete=np.bool_(snapshot.complete),
                missing=np.array(snapshot.missing, np.int64),
            )
    except UsageError as error:  # it could be written when the reception began
        raise DataError(str(error)) from None


def say_twins(source: str, number: int, why: str) -> str:
    """Return the sentence on two nodes of one number."""
    return (
        f"{source}: two nodes seem to bear the number {number}: {why}; give each a number of its own. What could not be"
        f" told apart was left out, other nodes are recorded whole"
    )


def read_log(path: str | Path) -> tuple[dict[str, Array], dict[str, str]]:
    """Decode a CAN log: columns by channel name, among them time_s, and their units.

    Raises DataError when the log is damaged, or holds no samples of a node of ours, or those of several nodes or runs,
    or of two nodes of one number.
    """
    assembly = Assembly()
    with closing(open_log(str(path))) as source:
        while source.ended is None:
            assembly.feed(source.read(0.0))
    assembly.close()
    if source.ended.startswith("damaged"):
        raise DataError(
            f"{path}: the log is {source.ended}; what came before is kept with"
            f" aeolid listen --bus {path} --record recording.csv"
        )
    for node in assembly.nodes.values():
        for configuration in node.configurations():
            configuration.samples.judge(configuration.description.sample_every)
        if node.contested:
            raise DataError(say_twins(str(path), node.number, node.contested))
    records = [r for node in assembly.nodes.values() for r in build_records(node, str(path))]
    if not records:
        problems = [f"node {n.number} {n.problem}" for n in assembly.nodes.values() if n.problem]
        if problems:
            raise DataError(f"{path}: no samples in this CAN log ({problems[0]})")
        raise DataError(
            f"{path}: no samples in this CAN log ({assembly.frames} frames, none of them a described sample); of a"
            f" node with another base make a recording: aeolid listen --bus {path} --base … --record recording.csv"
        )
    if len(records) > 1:
        raise DataError(
            f"{path}: {len(records)} runs or nodes in one log; split them with"
            f" aeolid listen --bus {path} --record recording.csv"
        )
    record = records[0][0]
    columns = {"time_s": record.time_s} | {c.name: record.column(c.name) for c in record.channels}
    return columns, {"time_s": "s"} | {c.name: c.unit for c in record.channels}
