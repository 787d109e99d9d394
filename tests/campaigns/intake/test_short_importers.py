"""A short piece of the importers' campaign, and a file cut off in its configuration by itself."""

import warnings

import pytest

from commissioner.errors import DataRefused
from commissioner.recordings.importers import contract_table
from tests.campaigns.intake.importers import FORMATS, campaign, report, sound_files

MUTANTS, SEED = 300, 7


@pytest.mark.parametrize("form", FORMATS)
def test_damaged_recordings_are_tables_or_typed_refusals(form):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outcomes = list(campaign([form], MUTANTS, SEED))
    print(f"repeat: python -m tests.campaigns.intake.importers --mutants {MUTANTS} --seed {SEED} --format {form}")
    print(report(outcomes))
    assert not [outcome for outcome in outcomes if outcome.broken]
    assert len(outcomes) == MUTANTS
    assert any(outcome.was_read for outcome in outcomes) and not all(outcome.was_read for outcome in outcomes)


@pytest.mark.parametrize("lines", range(13))
def test_a_comtrade_configuration_that_is_cut_off_is_refused(tmp_path, lines):
    configuration = sound_files(tmp_path)["comtrade"][0][0]
    kept = configuration.read_text().splitlines()[:lines]
    configuration.write_text("\n".join(kept))
    with pytest.raises(DataRefused, match=r"configuration|COMTRADE"):
        contract_table(configuration)
