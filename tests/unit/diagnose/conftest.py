"""A small standstill record of a known machine, and the setting its effects are built in."""

import numpy as np
import pytest

from commissioner.diagnose.causes import Setting
from commissioner.diagnose.causes.regressors import add_channels
from commissioner.diagnose.intake.audit import prepare
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.search.nominal import layout_for
from commissioner.records import StandstillRecording

NOMINAL = (3.7, 2.2, 0.021, 0.3)
PERIOD_S = 2e-4
PLATE = {
    "rated_power_w": 2200.0, "rated_voltage_v": 400.0, "rated_frequency_hz": 50.0, "rated_current_a": 5.0,
    "switching_frequency_hz": 5000.0, "sample_period_s": PERIOD_S,
}  # fmt: skip
WHITE = Noise(np.full(3, 0.01), np.array([1.0, 1000.0]), np.ones((3, 2)), "given", True, 0.0, True)


def recording(axes=(0.0, 60.0, 120.0), seconds=1.2, currents=None, link_v=540.0):
    """A three-tone command on every axis; `currents` (3, n) or just something."""
    n = round(seconds / PERIOD_S)
    t = np.arange(n) * PERIOD_S
    ramp = np.clip((t - 0.1) / 0.1, 0.0, 1.0)
    command = ramp * sum(a * np.cos(2 * np.pi * f * t + f) for a, f in ((14.0, 2.3), (20.0, 41.9), (30.0, 331.7)))
    total = n * len(axes)
    currents = 4.0 * np.ones((3, 1)) * np.cos(np.arange(total)) if currents is None else currents
    return StandstillRecording(
        np.concatenate([t + k * (seconds + 1.0) for k in range(len(axes))]), np.repeat(np.arange(len(axes)), n),
        np.repeat(axes, n), np.tile(command, len(axes)), *currents, np.full(total, link_v), PERIOD_S, PLATE,
    )  # fmt: skip


def setting_of(model, **about):
    """The record filled with the model's own currents, and dictionaries scaled to it."""
    blank, _ = prepare([recording(**about)])
    layout, _ = layout_for(blank, model)
    currents = np.concatenate([predict(model, blank, k, layout).currents_a for k in range(len(blank.segments))], axis=1)
    record, _ = prepare([recording(currents=currents, **about)])
    layout, flux = layout_for(record, model)
    record, lines = add_channels(record, model, layout, WHITE)
    return Setting(record, layout, flux, record.facts.current_peak_a * model.nominal[2], model.nominal, lines)


def currents(model, setting, segment=1):
    return predict(model, setting.record, segment, setting.layout).currents_a


def central_slope(model, setting, row, h, segment=1):
    """d current / d theta[row] by a central difference."""
    step = h * np.eye(model.theta.size)[row]
    more, less = (currents(model.moved(model.theta + sign * step), setting, segment) for sign in (1.0, -1.0))
    return (more - less) / (2.0 * h)


@pytest.fixture(scope="session")
def nominal():
    return Model(NOMINAL)


@pytest.fixture(scope="session")
def setting(nominal):
    return setting_of(nominal)
