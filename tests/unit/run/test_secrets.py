"""What a run keeps on the disk leads to the drive and to no secret."""

import json

import pytest

from commissioner.errors import UsageError
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.summary import summarise
from commissioner.run.commission import commission
from commissioner.run.restore import restore
from commissioner.settings import load_motor, load_procedure


def test_a_run_over_tls_leaves_no_certificate_or_key_in_its_folder(tmp_path):
    files = {name: tmp_path / f"{name}-of-ours.pem" for name in ("ca", "cert", "key")}
    for file in files.values():
        file.write_text("top secret")
    url = "tls://127.0.0.1:1?" + "&".join(f"{name}={file}" for name, file in files.items())
    with pytest.raises(UsageError, match="TLS files"):
        commission(
            url, "simulated", load_motor("motor_2kw2"), load_procedure(), write_back=False, runs=tmp_path / "runs",
            present=lambda record: None,
        )  # fmt: skip
    (folder,) = (tmp_path / "runs").iterdir()
    assert summarise(folder).outcome == "aborted"
    archived = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert b"tls://127.0.0.1:1" in archived["request.json"]
    for content in archived.values():
        for secret in (b"top secret", b"cert-of-ours", b"key-of-ours"):
            assert secret not in content


def test_restore_of_a_run_over_tls_asks_for_the_whole_address(tmp_path):
    folder = RunFolder.create(tmp_path, "x")
    folder.save("request.json", {"url": "tls://drive", "profile": "simulated"})
    folder.save("snapshot.json", {})
    folder.close()
    with pytest.raises(UsageError, match="keeps no TLS files") as caught:
        restore(summarise(folder.path), None)
    assert "--drive" in caught.value.remedy
    assert json.loads((folder.path / "request.json").read_text())["url"] == "tls://drive"
