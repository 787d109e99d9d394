"""The forty files of instruments: each read right, or its channels asked for; what was once wrong stays right."""

from pathlib import Path

import pytest

from tests.campaigns.intake.forty import FILES, verdict

ASKED = {"hantek_bare", "keysight_infiniivision_bare"}
"""Neither names nor units; names that are numbers."""


@pytest.mark.parametrize("name", FILES)
def test_a_file_as_its_instrument_writes_it_is_right_or_asked_for(tmp_path: Path, name: str) -> None:
    assert verdict(name, tmp_path) == ("asked" if name in ASKED else "right")


def test_there_are_forty() -> None:
    assert len(FILES) == 40
