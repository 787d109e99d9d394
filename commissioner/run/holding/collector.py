"""Python's cyclic collector, kept short while a drive waits.

A full collection stops every thread until it has looked at each object of the process: 0.3 s in a process that has just
compiled its kernels, more on a slow host, and a drive's watchdog is 0.5 s. What is there before the output goes on is set
aside (`gc.freeze`), so that a collection looks only at what came since.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def short_collections() -> Iterator[None]:
    """What exists now is left alone until the end; what came later is, too, from `set_aside` on."""
    set_aside()
    try:
        yield
    finally:
        gc.unfreeze()


def set_aside() -> None:
    """What has come by now is not looked at again before the end."""
    gc.freeze()
