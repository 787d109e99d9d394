"""A sensor that is still settling: named with its size and nothing beside it; none is named where there is none."""

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.plant.prediction import predict
from tests.unit.diagnose.conftest import recording

RIVALS = ("sensor_switch_on", "sensor_offset", "sensor_drift", "remanence", "sensor_nonlinearity")


@pytest.mark.parametrize("size_a", [0.1, 0.0])
def test_it_is_named_with_its_size_and_not_where_there_is_none(nominal, setting, size_a):
    """With 45 ms, which no course of the dictionary has."""
    random = np.random.default_rng(3)
    begins = setting.record.segments[0].time_s[0]
    rows = []
    for k, segment in enumerate(setting.record.segments):
        clean = predict(nominal, setting.record, k, setting.layout).currents_a
        settling = np.exp(-(segment.time_s - begins) / 0.045) * np.array([[1.0], [0.4], [-0.7]])
        rows.append(clean + size_a * settling + 0.01 * random.standard_normal(clean.shape))
    excluded = [n for n in CATALOGUE if n not in RIVALS]
    seen = diagnose([recording(currents=np.concatenate(rows, axis=1))], excluded=excluded)
    assert [c.name for c in seen.causes] == (["sensor_switch_on"] if size_a else [])
    if size_a:
        value, std, _ = seen.causes[0].sizes["offset_u_at_start_a"]
        assert value == pytest.approx(size_a, abs=max(4.0 * std, 0.05 * size_a)) and std < 0.1 * size_a


def test_what_settles_between_two_courses_is_in_the_dictionary(setting):
    courses = np.array([np.concatenate(c) for c in CATALOGUE["sensor_switch_on"].regressors(setting.record).values()])
    since = np.concatenate([s.time_s for s in setting.record.segments]) - setting.record.segments[0].time_s[0]
    for settle_s in np.geomspace(0.008, 0.12, 12):
        wanted = np.exp(-since / settle_s)
        left = wanted - np.linalg.lstsq(courses.T, wanted, rcond=None)[0] @ courses
        assert left @ left < 0.01 * (wanted @ wanted)
