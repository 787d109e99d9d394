"""The whole procedure on a firmware, a motor and a Modbus stack of other authors, judged by that motor's own answer key."""

import pytest

from tests.support.command_line import at_flux, call
from tests.support.reference_firmware import FirmwareProcess, build, needs_libmodbus

pytestmark = needs_libmodbus


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    runs = tmp_path_factory.mktemp("archive") / "runs"
    with FirmwareProcess(build(), "--seed", "7") as drive:
        arguments = ("--motor", "motor_2kw2", "--yes", "--write-back", "--json", "--runs", str(runs))
        answer = call("run", "--drive", drive.url, *arguments)
        checked = call("check", "--drive", drive.url, "--motor", "motor_2kw2", "--json")
    return {"answer": answer, "truth": drive.truth, "checked": checked}


def test_the_run_ends_commissioned(job):
    assert job["answer"].code == 0, job["answer"].stdout[:2000]
    assert job["answer"].json["outcome"] == "commissioned"


def test_every_parameter_is_within_three_per_cent_of_the_motors_own_at_the_flux_it_names(job):
    result = job["answer"].json
    for name, true in at_flux(job["truth"], result["holds_for_stator_flux_wb"]).items():
        assert result["parameters"][name]["value"] == pytest.approx(true, rel=0.03), name


def test_the_legs_lost_voltage_is_found_and_the_flux_limit_held(job):
    result = job["answer"].json
    assert result["inverter"]["leg_error_v"]["value"] == pytest.approx(job["truth"]["leg_error_v"], rel=0.08)
    limit = result["flux_guard"]["limit_wb"]
    assert 0.6 * limit < job["truth"]["peak_stator_flux_wb"] <= 1.02 * limit


def test_what_was_written_is_in_use_afterwards(job):
    written = {row["name"]: row["after"] for row in job["answer"].json["written"]}
    assert len(written) == 4
    assert job["checked"].json["parameters_in_drive"] == pytest.approx(written, rel=1e-6)
