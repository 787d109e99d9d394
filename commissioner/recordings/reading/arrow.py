"""Text for Arrow's CSV reader in Arrow's own memory.

A thread of Arrow's pool that still holds a Python object when the process ends needs the interpreter to let go of it, is cut
off there, and ends the process with "terminate called" and code -6 in place of the verb's own.
"""

from __future__ import annotations

import pyarrow as pa


def arrow_owned(data: bytes | memoryview) -> pa.BufferReader:
    """A reader of a copy that no Python object stands behind."""
    copy = pa.BufferOutputStream()
    copy.write(data)
    return pa.BufferReader(copy.getvalue())
