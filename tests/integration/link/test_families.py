"""Every family that has a file, worn by an emulated drive over TCP: what its file describes works, the rest refuses by name."""

from contextlib import closing

import pytest

from commissioner.errors import UsageError
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import known_drives, load_profile
from commissioner.link.wire.modbus import open_port
from commissioner.link.wire.url import parse_url
from commissioner.operations.check import CheckRequest, check
from commissioner.run.tuning.tune import require_tuning
from tests.support.vendor_process import MADE_UP, Vendor

FAMILIES = [name for name in known_drives() if load_profile(name).kind == "commercial"]
VERBS = ("excite", "stream", "write_back", "restore")


@pytest.mark.parametrize("name", [*FAMILIES, *MADE_UP], ids=lambda name: name.rpartition("/")[2])
def test_a_family_is_checked_and_its_snapshot_taken_as_far_as_its_file_goes(name):
    profile = load_profile(name)
    with Vendor(name, "--turnaround", "0") as drive:
        done = check(CheckRequest(drive.url, name, "motor_2kw2"))
        with closing(open_port(parse_url(drive.url), profile)) as port:
            inverter = Inverter(port, profile)
            found, plate = inverter.snapshot(), inverter.read_nameplate()
    readable = any("r" in item.access for item in profile.items.values())
    assert done.outcome == ("passed" if readable else "rejected"), done.reason
    assert done.not_checked
    held = {n: drive.truth["held"][n] for n in (profile.parameters.order if profile.parameters else ())}
    assert found.in_use == pytest.approx(held)
    assert set(plate) <= {*profile.items, "pole_pairs"}


@pytest.mark.parametrize("name", FAMILIES)
def test_what_no_source_told_is_refused_with_what_to_look_up(name):
    profile = load_profile(name)
    for verb in VERBS:
        if verb in profile.capabilities:
            profile.require(verb)
            continue
        with pytest.raises(UsageError) as refused:
            profile.require(verb)
        assert refused.value.remedy == profile.unknown[verb]
        assert len(profile.unknown[verb].split()) >= 4
    if profile.tuning is None:
        with pytest.raises(UsageError) as refused:
            require_tuning(profile)
        assert refused.value.remedy == profile.unknown["tune"]
