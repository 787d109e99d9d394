"""Self-commissioning of induction motors at standstill, and self-sensing of running ones."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    # The matrices here are small: a second BLAS thread only waits for the first, a hundred times longer on a busy host.
    os.environ.setdefault(_name, "1")
