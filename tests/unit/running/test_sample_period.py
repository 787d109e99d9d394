"""A wrong sample period beside a measured speed is to a motor a gain of that speed: the mains tell, an inverter does not."""

from dataclasses import replace

import pytest

from commissioner.running.diagnosis import diagnose
from sim.motoring.machine import Effect
from tests.running_effects.cases import Case, taken


@pytest.mark.parametrize(
    ("stretched", "gain", "carrier_hz", "name", "equivalent"),
    [
        (1.01, 0.0, 0.0, "sample_period", ()),
        (1.0, 0.01, 0.0, "speed_sensor_gain", ()),
        (1.0, 0.01, 10e3, "speed_sensor_gain", ("sample_period",)),
    ],
)
def test_a_sample_period_is_told_from_a_gain_of_the_speed(stretched, gain, carrier_hz, name, equivalent):
    scenario = Case(5003, "null").scenario()
    effects = (Effect("speed_sensor_gain", gain),) if gain else ()
    course = replace(scenario.course, duration_s=1.5)
    recording, plate, _ = taken(replace(scenario, course=course, effects=effects), 5003)
    metadata = {**recording.metadata, "switching_frequency_hz": carrier_hz}
    time_s, period_s = stretched * recording.time_s, stretched * recording.sample_period_s
    seen = diagnose([replace(recording, time_s=time_s, sample_period_s=period_s, metadata=metadata)], plate)
    (cause,) = seen.causes
    assert (cause.name, cause.equivalent) == (name, equivalent)
    assert next(iter(cause.sizes.values()))[0] == pytest.approx(1.0 - 1.0 / (stretched * (1.0 + gain)), rel=0.02)
    assert seen.verdict == ("not_distinguishable" if equivalent else "explained")
