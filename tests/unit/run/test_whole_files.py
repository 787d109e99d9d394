"""A file is there whole or not at all, and a folder that cannot be written to is said before the work."""

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


def test_a_folder_is_made_or_refused(tmp_path):
    assert folder_to_write(tmp_path / "a" / "b").is_dir() and not list((tmp_path / "a" / "b").iterdir())
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError) as refused:
        folder_to_write(tmp_path / "file")
    assert refused.value.step == "write results" and refused.value.remedy
