"""The search's own lines become words."""

from commissioner.cli.screens.diagnosis_progress import Progress


def test_the_searchs_arithmetic_becomes_words():
    told = Progress(is_quiet=True)
    assert told.translated("nominal fit: 20.6 times the noise") == "the plain simulation's error is 20.6 x the noise"
    assert told.translated("  try dead_time: promised 2.5e+07, gained 2.8e+07").startswith("trying dead time")
    assert told.translated("  try dead_time: promised 1, gained 2") == ""
    assert told.translated("accepted dead_time: 1.145 times the noise") == "dead time helps"
    assert told.translated("  instead of iron_loss sensor_lag: gained 3 more") == ""
    assert told.translated("round 3: chi2 12.0") == ""
