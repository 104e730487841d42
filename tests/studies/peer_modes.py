"""Find the modes of saved records with pyOMA2, for the comparison of output_only.py.

    python -m venv FOLDER && FOLDER/bin/pip install pyOMA-2==1.4.3
    FOLDER/bin/python tests/studies/peer_modes.py RECORDS --out FILE [--bands] [--blocks 30] [--largest 40]
                                                  [--clustering hier_avg]

RECORDS is the folder that output_only.py --save wrote. Covariance-driven subspace identification, with first-order
uncertainty where --bands is given, and one of the automatic clusterings that the package brings. Needs the package
named, and nothing of ours. Processor seconds of one record, on one thread.
"""

import argparse
import json
import logging
import time
from pathlib import Path

import numpy as np
from pyoma2.algorithms import SSI
from pyoma2.algorithms.data.run_params import Clustering
from pyoma2.setup import SingleSetup


def modes_of(y, step, blocks, largest, clustering, bands):
    """Return the modes of one record as facts."""
    setup = SingleSetup(y, fs=1 / step)
    method = SSI(name="ssi", method="cov", br=blocks, ordmax=largest, calc_unc=bands)
    setup.add_algorithms(method)
    setup.run_by_name("ssi")
    method.add_clustering(Clustering(name="auto", quick=clustering))
    method.run_clustering("auto")
    found = method.result.clustering_results["auto"]
    out = []
    for i, hertz in enumerate(found.Fn):
        shape = np.asarray(found.Phi)[:, i]
        mode = {"frequency_hz": float(hertz), "damping": float(found.Xi[i])}
        mode |= {"shape_re": shape.real.tolist(), "shape_im": shape.imag.tolist()}
        if bands and found.Fn_std is not None:
            mode |= {"frequency_std_hz": float(found.Fn_std[i]), "damping_std": float(found.Xi_std[i])}
        out.append(mode)
    return out


def main():
    """Run it on all records."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("records", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--bands", action="store_true")
    parser.add_argument("--blocks", type=int, default=30)
    parser.add_argument("--largest", type=int, default=40)
    parser.add_argument("--clustering", default="hier_avg")
    given = parser.parse_args()
    logging.disable(logging.CRITICAL)
    results = {}
    for path in sorted(given.records.glob("*.npz")):
        held = np.load(path)
        began = time.process_time()
        modes = modes_of(
            held["y"], float(held["step"]), given.blocks, given.largest, given.clustering, given.bands
        )  # fmt: skip
        results[str(int(path.stem))] = {"modes": modes, "seconds": time.process_time() - began}
        given.out.write_text(json.dumps(results) + "\n")


if __name__ == "__main__":
    main()
