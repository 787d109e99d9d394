"""A file is there whole or not at all, and a folder that cannot be written to is said before the work."""

import errno
import os
from pathlib import Path

import pytest

from commissioner.errors import UsageError
from commissioner.recordings.whole import folder_to_write, whole_file


@pytest.mark.parametrize("failure", [OSError("no space left"), KeyboardInterrupt()])
def test_a_write_that_fails_leaves_what_was_there_and_nothing_else(tmp_path, failure):
    path = tmp_path / "report.html"
    path.write_text("old")
    with pytest.raises(type(failure)), whole_file(path) as temporary:
        temporary.write_text("ne")
        raise failure
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"] and path.read_text() == "old"
    with whole_file(path) as temporary:
        temporary.write_text("new")
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"] and path.read_text() == "new"


@pytest.mark.parametrize("of", ["x.csv.part", Path("x.csv.part"), None])
def test_a_write_that_the_system_refuses_names_the_file_that_was_meant(tmp_path, of):
    where = str(tmp_path / of) if isinstance(of, str) else tmp_path / of if of else None
    with pytest.raises(OSError, match="No space left") as refused, whole_file(tmp_path / "x.csv"):
        raise OSError(errno.ENOSPC, "Failed to write 'x.csv.part'. Detail: No space left", where)
    assert (refused.value.filename, refused.value.strerror) == (str(tmp_path / "x.csv"), os.strerror(errno.ENOSPC))


def test_a_folder_is_made_or_refused(tmp_path):
    assert folder_to_write(tmp_path / "a" / "b").is_dir() and not list((tmp_path / "a" / "b").iterdir())
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError) as refused:
        folder_to_write(tmp_path / "file")
    assert refused.value.step == "write results" and refused.value.remedy
