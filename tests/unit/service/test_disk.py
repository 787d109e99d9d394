"""What the disk refuses is told as what it is, and leaves neither half an entry nor a file in place of another."""

import errno
import json
import os

import pytest

from commissioner.service import audit, recordings
from commissioner.service.problems import disk_refuses


@pytest.mark.parametrize(
    ("number", "status", "word"),
    [(errno.ENOSPC, 507, "takes no more"), (errno.EROFS, 507, "may not write"), (errno.EACCES, 507, "may not write"),
     (errno.ENOENT, 409, "gone"), (errno.EIO, 507, "did not do"), (errno.ENAMETOOLONG, 422, "too long")],
)  # fmt: skip
def test_each_refusal_of_the_disk_has_its_own_words(number, status, word):
    problem = disk_refuses(OSError(number, os.strerror(number), "/archive/name")).problem
    assert problem.status == status and word in problem.title and problem.remedy


def test_an_entry_that_found_no_room_leaves_the_chain_whole(tmp_path, monkeypatch):
    log = audit.Audit(tmp_path / "audit.jsonl")
    log.write("anna", "", "logged in")

    def full(_file):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            log.write("anna", "", "asked to energise")
    log.write("anna", "", "logged out")
    assert log.verify().is_intact
    assert [json.loads(line)["what"] for line in (tmp_path / "audit.jsonl").read_text().splitlines()] == [
        "logged in",
        "logged out",
    ]


def test_files_of_one_name_are_kept_beside_each_other_and_none_is_the_log(tmp_path):
    for name in ("a.csv", "A.csv", "2_a.csv", "a.csv"):
        (tmp_path / recordings._unused(tmp_path, name)).write_text(name)
    assert len(list(tmp_path.iterdir())) == 4
    assert not recordings.LOG.endswith(recordings.ENDINGS)
