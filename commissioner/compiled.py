"""How the kernels of the extended model are compiled, and that none is older than what was compiled into it."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray


def njit(**options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """numba's `njit`, cached where a folder may be written; else compiled anew by every process, as in a sealed container.

    numba itself ends the import there (RuntimeError: no locator available).
    """

    def compile_later(function: Callable[..., Any]) -> Callable[..., Any]:
        compiled: Callable[..., Any]
        try:
            compiled = numba.njit(cache=True, **options)(function)
        except RuntimeError:
            compiled = numba.njit(**options)(function)
        return compiled

    return compile_later


BORROWED: Any = {"_nrt": False}
"""Of a kernel that makes no array: those it is given are its caller's, who keeps them. Else numba
counts references at every tuple that is taken apart and every row that is looked at, two calls of an atomic instruction each: a
third of the batch fit's pass."""
FAST: Any = {"fastmath": True, "error_model": "numpy", "nogil": True}
kernel: Any = njit(**FAST)
"""Cached beside its file; other threads run meanwhile."""
borrowing: Any = njit(**FAST, **BORROWED)
"""The same of what is `BORROWED`."""
inlined: Any = njit(inline="always", **FAST)
"""A part of a kernel too small to be called."""


@cache
def threads() -> ThreadPoolExecutor:
    """Of this process, for kernels on a part of the data each: a core each, at most four, which hold so many parts in memory at once."""
    return ThreadPoolExecutor(min(int(numba.get_num_threads()), 4))


if hasattr(os, "register_at_fork"):  # they stay behind in the parent
    os.register_at_fork(after_in_child=threads.cache_clear)


_FLOAT = np.dtype(np.float64)


def writable(signal: ArrayLike) -> NDArray[np.float64]:
    """As compiled code takes it: contiguous, and writable, for another signature (columns of a file are read-only) is
    compiled anew."""
    if isinstance(signal, np.ndarray) and signal.dtype is _FLOAT and signal.flags.carray:
        return signal
    return np.require(signal, np.float64, ["C", "W"])


def forget_stale_kernels(folder: str, beside: str) -> None:
    """Drop the cached kernels of a folder that are older than any source there, or than `beside` one level up.

    numba looks at a kernel's own file only: after an update it would go on with what it had inlined from another.
    Where `NUMBA_CACHE_DIR` sends the caches elsewhere, they are its owner's to drop.
    """
    here = Path(folder)
    newest = max(path.stat().st_mtime for path in (*here.glob("*.py"), here.parent / beside))
    for index in (here / "__pycache__").glob("*.nbi"):
        with suppress(OSError):
            if index.stat().st_mtime < newest:
                index.unlink()
