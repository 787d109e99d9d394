"""What a longer test buys follows from the share of noise in the standard errors."""

import pytest

from commissioner.identify.excite.duration import longer_test
from commissioner.identify.excite.tones import DesignedExcitation, Excitation
from commissioner.motor.circuit import InverseGamma

MACHINE = InverseGamma(3.7, 2.1, 0.021, 0.224)
TEST = DesignedExcitation(Excitation((), 0.0, 4.0), 0.8, 5.0, (0.001, 0.002, 0.003, 0.004), 4.0, 0.02)


def predict(std, tests=(TEST,), noise_a=(0.02,)):
    return longer_test(MACHINE, [s * v for s, v in zip(std, MACHINE.as_tuple(), strict=True)], tests, noise_a)


def test_errors_of_noise_alone_fall_with_the_root_of_the_time():
    longer = predict((0.001, 0.002, 0.003, 0.004))
    assert longer.seconds == 8.0
    assert longer.then == pytest.approx([s / 2**0.5 for s in (0.001, 0.002, 0.003, 0.004)])
    assert "95 % intervals (±): R_s 0.2 -> 0.14 %, " in longer.sentence


def test_errors_that_are_not_noise_stay_and_the_sentence_says_so():
    longer = predict((0.02, 0.02, 0.03, 0.04))
    assert longer.then == pytest.approx(longer.now, rel=0.01)
    assert "would buy nothing" in longer.sentence


def test_four_tests_have_half_the_noise_of_one_and_twice_the_noise_undoes_it():
    std = (0.01, 0.01, 0.01, 0.01)
    assert predict(std, (TEST,) * 4, (0.04,) * 4).then == pytest.approx(predict(std).then)
