"""Figures beside a peer's in the same run, as ratios: `python -m tests.benchmarks` measures all pairs in one table; each `bench_*` has more
figures of its own. CPU seconds on both sides, taking turns, one thread for linear algebra (said before numpy is imported)."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
