"""Recordings that are no answer of a motor at rest are refused by name; what is only odd is diagnosed without a crash."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.intake.audit import prepare
from commissioner.diagnose.intake.noise import measure_noise
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.verdict.lack_of_fit import lack_of_fit
from tests.unit.diagnose.conftest import NOMINAL, PERIOD_S, recording


@pytest.fixture(scope="module")
def plain(setting, nominal):
    """The conftest machine as a recording with white noise."""
    record, layout = setting.record, setting.layout
    currents = np.concatenate([predict(nominal, record, k, layout).currents_a for k in range(3)], axis=1)
    noise = 0.01 * np.random.default_rng(5).standard_normal(currents.shape)
    return recording(currents=currents + noise)


def turning(source):
    angle = 2.0 * np.pi * 48.3 * source.time_s
    rows = [5.0 * np.sin(angle - k * 2.0944) for k in range(3)]
    return replace(
        source, current_u_a=source.current_u_a + rows[0], current_v_a=source.current_v_a + rows[1],
        current_w_a=source.current_w_a + rows[2],
    )  # fmt: skip


def scaled(source, u, v, w):
    return replace(source, current_u_a=u * source.current_u_a, current_v_a=v * source.current_v_a,
                   current_w_a=w * source.current_w_a)  # fmt: skip


REFUSED = {
    "phase v stands still": lambda r: scaled(r, 1.0, 0.0, 1.0),
    "against the voltage": lambda r: scaled(r, -1.0, -1.0, -1.0),
    "does not follow the excited axis": turning,
    "do not belong together": lambda r: replace(
        r, voltage_axis_v=np.random.default_rng(1).permutation(r.voltage_axis_v)
    ),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_what_no_motor_at_rest_can_answer_is_refused_by_name(plain, reason):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen = diagnose([REFUSED[reason](plain)])
    assert seen.verdict == "refused"
    assert reason in seen.reason


TONES_HZ = {"three": (2.3, 41.9, 331.7), "high": (331.7,), "with a direct part": (0.0, 331.7)}
LATE_S = {"at once": 0.0, "150 us": 150e-6, "two periods": 2.0 * PERIOD_S}


def answered(tones_hz, late_s=0.0):
    """The steady answer of the conftest machine to tones of 1 A each, read late; at the highest 45 ohm of reactance beside 5.9 of resistance."""
    source = recording(axes=(0.0,))
    r_s, r_r, l_sigma, l_m = NOMINAL
    t = source.time_s
    volts, amps = np.zeros((2, t.size))
    for hz in tones_hz:
        s = 2j * np.pi * hz
        impedance = r_s + s * l_sigma + r_r * s * l_m / (r_r + s * l_m)
        volts += (impedance * np.exp(s * t)).real
        amps += np.exp(s * (t - late_s)).real
    rows = np.array([1.0, -0.5, -0.5])[:, None] * amps
    return replace(source, voltage_axis_v=volts, current_u_a=rows[0], current_v_a=rows[1], current_w_a=rows[2])


@pytest.mark.parametrize("late", LATE_S)
@pytest.mark.parametrize("tones", TONES_HZ)
def test_a_current_read_late_is_not_taken_for_one_of_the_wrong_sign(tones, late):
    seen = answered(TONES_HZ[tones], LATE_S[late])
    assert prepare([seen])[1].refusal is None
    assert "against the voltage" in prepare([scaled(seen, -1.0, -1.0, -1.0)])[1].refusal.what


ODD = {
    "no noise at all": lambda r: r,
    "microamperes": lambda r: replace(scaled(r, 1e-6, 1e-6, 1e-6), metadata={**r.metadata, "rated_current_a": 5e-6}),
    "a third of a second": lambda r: replace(
        r, **{n: getattr(r, n)[:1650] for n in ("time_s", "segment", "axis_deg", "voltage_axis_v", "current_u_a",
                                                 "current_v_a", "current_w_a", "dc_link_v")}
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", ODD)
def test_an_odd_recording_ends_in_a_verdict_with_finite_numbers(plain, setting, nominal, kind):
    source = plain
    if kind == "no noise at all":
        record, layout = setting.record, setting.layout
        source = recording(
            currents=np.concatenate([predict(nominal, record, k, layout).currents_a for k in range(3)], axis=1)
        )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen = diagnose([ODD[kind](source)])
    assert seen.causes == ()
    assert all(np.isfinite(q.value) and np.isfinite(q.std) for q in seen.parameters_after.values())
    assert seen.verdict == "nothing_significant"


def test_a_weak_structure_around_the_tones_is_seen_and_noise_is_not(plain, setting, nominal):
    """A tenth of a per cent too much resistance: a fifteenth of the noise in all, and plainly there at the lowest tone."""
    record, audit = prepare([plain])
    noise = measure_noise(record)
    layout = setting.layout
    r_s, r_r, l_sigma, l_m = nominal.nominal
    wrong = replace(nominal, nominal=(1.0013 * r_s, r_r, l_sigma, l_m))
    right, missed = (lack_of_fit(m, record, layout, noise, 4, audit.excited_hz) for m in (nominal, wrong))
    assert right.sigma == right.from_tones_sigma == 0.0
    assert 0.02 < missed.from_tones_sigma < 0.3


def test_a_law_met_in_two_samples_of_a_thousand_is_seen_and_no_cause_is_named_for_it(plain, setting, nominal):
    """A sensor that cannot follow the steepest instants: 6 sigma there, nothing elsewhere, 0.27 of the noise in all."""
    expected = np.concatenate(
        [predict(nominal, setting.record, k, setting.layout).currents_a for k in range(3)], axis=1
    )
    slope = np.gradient(expected, axis=1)
    steep = np.abs(slope) > np.quantile(np.abs(slope), 0.998)
    rows = [plain.current_u_a, plain.current_v_a, plain.current_w_a] - 0.06 * np.sign(slope) * steep
    seen = diagnose([replace(plain, current_u_a=rows[0], current_v_a=rows[1], current_w_a=rows[2])])
    assert seen.verdict == "unexplained"
    assert not [c for c in seen.causes if c.confidence > 0.8]
    assert seen.left.from_states_sigma > 0.05
    assert diagnose([plain]).left.from_states_sigma == 0.0
