"""Whatever machine is drawn, conversions lose nothing and factors stay factors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from commissioner.identify.excite.tones import separated
from commissioner.identify.observer.coordinates import ud_factors
from commissioner.motor.circuit import Gamma, InverseGamma, from_t_model, to_t_model
from tests.support.exact.pulse_transfer import from_pulse_transfer, pulse_transfer

positive = st.floats(1e-3, 1e2)
machines = st.builds(
    lambda r_s, ratio, tau, share: InverseGamma(r_s, ratio * r_s, share * tau * ratio * r_s, tau * ratio * r_s),
    positive,
    st.floats(0.2, 3.0),
    st.floats(0.02, 2.0),
    st.floats(0.02, 0.3),
)


@given(machines)
def test_gamma_and_back_is_the_same_machine(machine):
    assert Gamma.from_inverse_gamma(machine).as_inverse_gamma().as_tuple() == pytest.approx(
        machine.as_tuple(), rel=1e-10
    )


@given(machines)
def test_t_and_back_is_the_same_machine(machine):
    t = to_t_model(machine)
    back = from_t_model(
        t.stator_resistance_ohm.value,
        t.rotor_resistance_ohm.value,
        t.stator_leakage_h.value,
        t.rotor_leakage_h.value,
        t.magnetizing_inductance_h.value,
    )
    assert back.as_tuple() == pytest.approx(machine.as_tuple(), rel=1e-9)


@given(machines, st.sampled_from([1e-4, 3e-4, 1e-3]))
def test_pulse_transfer_and_back_is_the_same_machine(machine, period_s):
    found = from_pulse_transfer(pulse_transfer(machine, period_s), period_s)
    assert found is not None
    assert found.as_tuple() == pytest.approx(machine.as_tuple(), rel=1e-3)


@given(st.integers(0, 2**32 - 1))
def test_ud_factors_give_the_covariance_back(seed):
    root = np.random.default_rng(seed).standard_normal((4, 4))
    covariance = root @ root.T + 1e-3 * np.eye(4)
    upper, diagonal = ud_factors(covariance)
    assert np.allclose(upper * diagonal @ upper.T, covariance)
    assert np.allclose(np.tril(upper, -1), 0.0)
    assert np.all(diagonal > 0)


@settings(max_examples=50)
@given(st.lists(st.floats(0.3, 150.0), min_size=4, max_size=6))
def test_no_harmonic_or_third_order_mix_of_the_tones_falls_on_a_tone(frequencies):
    tones = [round(f / 0.1) for f in separated(frequencies, 0.1)]
    assert len(set(tones)) == len(frequencies)
    lines = {k * n for n in tones for k in range(2, 8)}
    lines |= {abs(2 * n + s * m) for n in tones for m in tones if n != m for s in (1, -1)}
    assert not lines.intersection(tones)
