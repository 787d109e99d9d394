"""Files rewritten by editors and torn by cables: the values stay right, or the file is refused, or it is said. Some of the forty."""

from pathlib import Path

import pytest

from tests.campaigns.intake.rewritten import REWRITINGS, verdict

SOME = (
    "tektronix_mso_labels",
    "rigol_ds_bare",
    "picoscope_german",
    "yokogawa_dl_no_time",
    "labview_lvm",
    "excel_unicode_footer",
)


@pytest.mark.parametrize("how", REWRITINGS)
@pytest.mark.parametrize("name", SOME)
def test_nothing_is_wrong_without_a_word(tmp_path: Path, name: str, how: str) -> None:
    said = verdict(name, how, tmp_path)
    assert said in ("right", "refused", "said")
    if how in ("windows lines", "empty rows", "packed"):
        assert said == "right"
