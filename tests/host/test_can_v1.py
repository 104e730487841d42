"""A stream of wire version 1 that was recorded once decodes to the same samples and parameters for ever."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aeolid.can import Assembly, build_records, open_source

VECTORS = Path(__file__).resolve().parents[1] / "vectors/wire_v1"


def test_version_1_is_still_read() -> None:
    """Samples, units and theta of the recorded stream, bit for bit; nothing damaged, nothing unknown."""
    source, assembly = open_source(str(VECTORS / "stream.log")), Assembly()
    while source.ended is None:
        assembly.feed(source.read(0.0))
    assembly.close()
    source.close()
    assert (assembly.damaged, assembly.foreign, list(assembly.nodes)) == (0, 0, [7])
    node = assembly.nodes[7]
    assert node.now is not None and node.now.description.wire_version == 1 and node.stopped
    ((record, lost),) = build_records(node, "v1")
    table = np.loadtxt(VECTORS / "samples.csv", delimiter=",", skiprows=1)
    header = (VECTORS / "samples.csv").read_text().split("\n", 1)[0]
    assert lost == 0 and header.split(",") == ["time_s", *(c.name for c in record.channels)]
    np.testing.assert_array_equal(record.values, table[:, 1:])
    np.testing.assert_allclose(record.time_s, table[:, 0], atol=1e-9)
    snapshot = node.latest_complete()
    assert snapshot is not None and snapshot.sample_index == len(table) - 1
    theta = np.fromfile(VECTORS / "theta.bin", "<u4")
    assert snapshot.theta_scaled.ravel().view(np.uint32).tolist() == theta.tolist()
