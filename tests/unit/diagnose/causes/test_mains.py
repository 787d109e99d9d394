"""Hum in the current channels: its base frequency is told in segments so short that a line fills the search for it."""

import numpy as np
import pytest

from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.plant.prediction import predict
from tests.unit.diagnose.conftest import recording, setting_of


@pytest.mark.parametrize("seconds", [1.2, 3.0])
@pytest.mark.parametrize(("base", "hertz"), [(50, 49.93), (60, 60.04)])
def test_hum_is_named_with_its_base_frequency(nominal, seconds, base, hertz):
    setting = setting_of(nominal, seconds=seconds)
    random = np.random.default_rng(5)
    rows = []
    for k, segment in enumerate(setting.record.segments):
        angle = 2.0 * np.pi * hertz * segment.time_s + np.array([[0.0], [1.0], [2.0]])
        clean = predict(nominal, setting.record, k, setting.layout).currents_a
        rows.append(clean + 0.02 * np.sin(angle) + 0.01 * random.standard_normal(clean.shape))
    seen = diagnose([recording(currents=np.concatenate(rows, axis=1), seconds=seconds)])
    assert [c.name for c in seen.causes] == ["mains_pickup"]
    assert seen.causes[0].sizes[f"amplitude_{base}_hz_a"][0] == pytest.approx(0.02, rel=0.02)
