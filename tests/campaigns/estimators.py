"""Scatter, bias and coverage of the fast law over seeds, and the seed's story: `python -m tests.campaigns.estimators`.

10 % noise, 10 s (or five rotor time constants), the product's own first excitation, only the plate known.
"""

from __future__ import annotations

import sys

import numpy as np

from tests.certified.test_fast_law import MOTORS, scattered
from tests.certified.test_lyapunov_story import NOISE_PERCENT, story

NAMES = (
    "db_0k18",
    "lab_1k1",
    "abb_2k2",
    "haumer_112m04",
    "br_10hp_6p",
    "sps_50hp_400v_50hz",
    "siemens_1tb1817",
    "krause_2250hp",
)


def main(seeds: int = 100) -> None:
    print(f"fast law, 10 % noise, {seeds} seeds: R_s / R_R / L_sigma / L_M")
    covered = []
    for name in NAMES:
        errors, stated, bound = scattered(name, seeds, max(10.0, 5.0 * MOTORS[name].rotor_time_constant_s))
        ratio, bias = np.std(errors, axis=0, ddof=1) / bound, np.mean(errors, axis=0) / bound
        covered.append(np.mean(np.abs(errors) < 1.96 * stated, axis=0))
        values = (np.array2string(x, precision=2) for x in (ratio, bias, 100 * covered[-1]))
        print(f"{name:20s} scatter/bound {next(values)}  bias/bound {next(values)}  covered {next(values)} %")
    print(f"all: 95 % intervals cover {100 * np.mean(covered):.1f} %")
    print("Lyapunov law, 180 s, averages over 150-180 s")
    for noise in NOISE_PERCENT:
        error, statistic, largest = story(noise)
        print(
            f"noise {noise:4.1f} %: E {error:.4f} %, worst parameter {100 * largest:.4f} %, whiteness {statistic:.1f}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
