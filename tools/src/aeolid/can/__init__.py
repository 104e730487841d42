"""Receive what nodes stream: any bus of python-can or a log, through the DBC, into recordings and Markov parameters."""

from __future__ import annotations

from aeolid.can.assembly import Assembly
from aeolid.can.node import Node
from aeolid.can.recorder import build_records, read_log, write_markov
from aeolid.can.runs import RunRecorder
from aeolid.can.snapshots import MarkovSnapshot
from aeolid.can.source import open_source

__all__ = [
    "Assembly",
    "MarkovSnapshot",
    "Node",
    "RunRecorder",
    "build_records",
    "open_source",
    "read_log",
    "write_markov",
]
