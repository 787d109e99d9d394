"""Every seeded defect is caught, by the rule that is about it."""

import pytest

from commissioner.conformance.kit import run_conformance
from commissioner.conformance.records import Outcome
from commissioner.conformance.rules import RULES
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.url import parse_url
from tests.conformance.defects import DEFECTS, ON_A_SERIAL_LINE
from tests.conformance.test_conformance import NEEDS_A_HAND
from tests.conformance.test_independent_peers import null_modem
from tests.support.reference_firmware import FirmwareProcess, build_with, needs_libmodbus

pytestmark = needs_libmodbus


@pytest.mark.parametrize("defect", DEFECTS, ids=lambda defect: defect.name.replace(" ", "-"))
def test_a_seeded_defect_is_caught_by_the_rule_that_names_it(defect, tmp_path):
    with FirmwareProcess(build_with(defect.file, defect.changes, tmp_path)) as drive:
        done = run_conformance(parse_url(drive.url), load_profile("simulated"), energise=True, only=[defect.rule])
    result = next(result for result in done.results if result.name == defect.rule)
    assert result.outcome is Outcome.FAIL, result
    assert result.reason
    assert result.evidence


def test_a_drive_that_answers_for_others_on_a_serial_line_is_caught(tmp_path):
    program = build_with(ON_A_SERIAL_LINE.file, ON_A_SERIAL_LINE.changes, tmp_path)
    with null_modem() as (theirs, ours), FirmwareProcess(program, line=("--rtu", theirs)):
        url = parse_url(f"rtu://{ours}?parity=N&stop=1&baud=115200")
        done = run_conformance(url, load_profile("simulated"), energise=False, only=[ON_A_SERIAL_LINE.rule])
    result = next(result for result in done.results if result.name == ON_A_SERIAL_LINE.rule)
    assert result.outcome is Outcome.FAIL, result


def test_at_least_forty_defects_are_told_apart_and_every_rule_that_can_fail_is_made_to():
    assert len({defect.name for defect in DEFECTS}) == len(DEFECTS) >= 40
    caught = {defect.rule for defect in (*DEFECTS, ON_A_SERIAL_LINE)}
    assert caught == {rule.name for rule in RULES} - NEEDS_A_HAND
