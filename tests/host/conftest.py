"""Run the matrix routines on one thread: on small matrices a second one only waits, and tests run side by side."""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
