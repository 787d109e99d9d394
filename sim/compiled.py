"""How kernels here are compiled: cached, IEEE division without Python's zero check, fused adds allowed.

Infinities and NaN keep their meaning; the same machine gives the same bits.
"""

from numba import njit

kernel = njit(cache=True, error_model="numpy", fastmath={"reassoc", "arcp", "contract", "nsz"})
piece = njit(inline="always")
"""A part of a kernel too small to be called: it is written into its callers (and compiled with them)."""
