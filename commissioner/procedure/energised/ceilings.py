"""What the drive itself holds a session to: current, voltage and time, just what that session needs.

These are the limits that no link can delay. A direct current I gives any machine at most L_s I of stator flux, so a drive
that trips at I keeps the flux whatever else is commanded or lost (`identify.excite.current_flux`).
"""

from __future__ import annotations

from commissioner.procedure.plan import Job
from commissioner.procedure.steps import Findings
from commissioner.safety.commands import SetDriveLimits

SENSORS = 0.015
"""Of the drive's rated peak current: what offset and noise may add to a small current before the drive trips on it."""
FIRST_OVER = 2.5
"""Current that the drive ends a first small test at, of what is aimed at."""
LOOK_CURRENT = 0.6
"""Of the test current and of the drive's limit: for a first look at a motor, or through sensors, that nothing has
confirmed."""


def for_current(job: Job, findings: Findings, current_a: float, voltage_v: float) -> SetDriveLimits:
    """A direct current of at most `current_a`, at voltages of at most `voltage_v`."""
    assert findings.identity is not None
    sensors_a = SENSORS * findings.identity.rated_drive_current_a * 2**0.5
    trip_a = min(findings.trip_current_a(job), current_a + sensors_a)
    return SetDriveLimits(trip_a, min(voltage_v, job.test_voltage_v), job.axis_time_s)


def aimed_current_a(job: Job, findings: Findings) -> float:
    """The largest axis current that a multitone test aims at, peak."""
    return _share(findings) * findings.test_current_a(job)


def tripping_current_a(job: Job, findings: Findings) -> float:
    """The phase current at which the drive ends a multitone test, peak."""
    return _share(findings) * findings.trip_current_a(job)


def _share(findings: Findings) -> float:
    return 1.0 if findings.is_measured else LOOK_CURRENT


def for_tones(job: Job, findings: Findings) -> SetDriveLimits:
    """A multitone test; on an unknown motor the smaller part of it."""
    return SetDriveLimits(tripping_current_a(job, findings), job.test_voltage_v, job.axis_time_s)
