"""What an inverter's legs lose beside an axis that is no multiple of 30 degrees."""

from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.identify.estimate.axis import ASLANT_SHARE, aslant_doubt

ALONG_A = np.sin(np.linspace(0.0, 60.0, 2000))


@pytest.mark.parametrize(
    ("axis_deg", "leg", "share"),
    [(45.0, "known", 0.08), (5.0, "known", 0.08), (60.0, "known", 0.0), (-30.0, "known", 0.0), (45.0, None, 0.0)],
)
def test_the_current_that_an_inverter_drives_beside_the_axis_is_in_every_standard_error(axis_deg, leg, share):
    stretch = SimpleNamespace(axis_deg=axis_deg, current_a=ALONG_A, cross_a=0.08 * ALONG_A + 0.5)
    batch = SimpleNamespace(model=SimpleNamespace(leg=leg))
    assert aslant_doubt([stretch], batch) == pytest.approx(ASLANT_SHARE * share)
