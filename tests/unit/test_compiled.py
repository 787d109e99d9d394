"""A cached kernel goes when a source it may have been made of is younger; the others stay."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from commissioner.compiled import BORROWED, forget_stale_kernels

HOUSE = Path(__file__).parents[2]
NAMES = ("kernels/one.py", "kernels/two.py", "numbers.py")


@pytest.fixture
def package(tmp_path):
    """Sources of an instant, and kernels cached a second later."""
    cache = tmp_path / "kernels" / "__pycache__"
    cache.mkdir(parents=True)
    for name in (*NAMES, "kernels/__pycache__/one.f-1.py311.nbi"):
        path = tmp_path / name
        path.touch()
        os.utime(path, (1000.0, 1001.0 if path.suffix == ".nbi" else 1000.0))
    return tmp_path


def cached(package):
    forget_stale_kernels(str(package / "kernels"), "numbers.py")
    return [path.name for path in (package / "kernels" / "__pycache__").iterdir()]


def test_kernels_younger_than_every_source_stay(package):
    assert cached(package) == ["one.f-1.py311.nbi"]


@pytest.mark.parametrize("name", NAMES)
def test_a_younger_source_drops_them(package, name):
    os.utime(package / name, (1002.0, 1002.0))
    assert cached(package) == []


def test_a_folder_without_a_cache_is_left_alone(tmp_path):
    (tmp_path / "kernels").mkdir()
    (tmp_path / "numbers.py").touch()
    forget_stale_kernels(str(tmp_path / "kernels"), "numbers.py")


def test_what_borrows_its_arrays_may_make_none():
    @numba.njit(**BORROWED)
    def makes(n):
        return np.zeros(n).sum()

    @numba.njit(**BORROWED)
    def lends(rows):
        return rows[1].sum()

    assert numba.njit(makes.py_func)(3) == 0.0
    with pytest.raises(numba.errors.NumbaError):
        makes(3)
    assert lends(np.ones((2, 3))) == 3.0


def compiling(package):
    """Modules of a package with anything that is compiled."""
    return [
        ".".join(path.relative_to(HOUSE).with_suffix("").parts)
        for path in sorted((HOUSE / package).rglob("*.py"))
        if re.search(r"import .*\b(njit|kernel)\b", path.read_text("utf-8"))
    ]


@pytest.mark.parametrize("package", ["commissioner", "sim"])
def test_without_a_folder_to_write_kernels_are_compiled_anew_and_no_import_fails(package):
    """As in a container whose root is read-only: numba finds no place for its cache."""
    modules = compiling(package)
    assert len(modules) > 3
    script = (
        "import tempfile\n"
        "def refuse(*a, **k): raise OSError(30, 'Read-only file system')\n"
        "tempfile.TemporaryFile = refuse\n"
        f"import {', '.join(modules)}\n"
        "from numba import njit\n"
        "try:\n    njit(cache=True)(refuse)\nexcept RuntimeError:\n    print('no cache, imported')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "no cache, imported", done.stderr


def test_a_kernel_without_a_cache_computes_the_same(monkeypatch):
    import tempfile

    from commissioner.compiled import njit

    def refuse(*_args, **_more):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)

    @njit()
    def twice(x):
        return 2.0 * x

    assert twice(3.0) == 6.0 and twice.stats.cache_path is None
