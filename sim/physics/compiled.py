"""How kernels here are compiled: cached, IEEE division without Python's zero check, fused adds allowed.

Infinities and NaN keep their meaning; the same machine gives the same bits.
"""

from contextlib import suppress
from pathlib import Path

from numba import njit


def _forget_stale_kernels(folder: Path) -> None:
    """Drop compiled kernels older than any source here: numba's cache looks at a kernel's own file only, not at the
    laws and slots that are compiled into it."""
    newest = max(path.stat().st_mtime for path in folder.rglob("*.py"))
    for index in folder.rglob("__pycache__/*.nbi"):
        with suppress(OSError):
            if index.stat().st_mtime < newest:
                index.unlink()


_forget_stale_kernels(Path(__file__).parents[1])
FAST = {"reassoc", "arcp", "contract", "nsz"}


def cached(**options):
    """numba's `njit`, cached; compiled anew by every process where no folder may be written."""

    def compile_later(function):
        try:
            return njit(cache=True, **options)(function)
        except RuntimeError:
            return njit(**options)(function)

    return compile_later


kernel = cached(error_model="numpy", fastmath=FAST)
lent = cached(error_model="numpy", fastmath=FAST, _nrt=False)
"""The same for one that makes no array: numba does not count who holds those it is lent."""
piece = njit(forceinline=True, error_model="numpy", fastmath=FAST)
"""A part of a kernel too small to be called: it is written into its callers by the compiler."""
