"""What a job on one drive amounts to: the link, the limits of its drive file, the bounds that no command may exceed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from commissioner.errors import RequestRefused
from commissioner.link.drive.inverter import Inverter
from commissioner.link.wire.modbus import ModbusPort, open_port
from commissioner.link.wire.port import Port
from commissioner.link.wire.url import parse_url
from commissioner.motor.circuit import PARAMETERS
from commissioner.motor.nameplate import Nameplate, believable
from commissioner.procedure.checks import DriveLimits
from commissioner.procedure.link_plan import BITS_PER_REGISTER, OVERHEAD_BITS, StreamPace
from commissioner.procedure.plan import Job, ProcedurePlan
from commissioner.registers.convention import our_values
from commissioner.registers.profile import DriveProfile
from commissioner.run.stream import GATHER_S
from commissioner.safety.commands import ALL_CHANNELS
from commissioner.safety.limits import Bounds
from commissioner.safety.watch import WatchLimits

LOST_SAMPLES_S = 0.05
"""The stream may lose this much motor time at once before the run stops."""
FLUX_FRACTION = 1.1
"""Of the guard's own limit: the guard acts first, the watch is the second line."""
LATENCY_PROBES = 20
PACE_PROBES = 5
"""Only a link whose fastest answer is too slow is surely too slow: the others of a busy host are none of its own."""
WINDOWS = 1.5
"""A sample waits for the window before its own, and for half of its own, until it is seen."""
WORST_LATENCY_FACTOR = 3.0
"""The guard predicts across this multiple of the slowest probe: later answers are slower than the first ones."""


@contextmanager
def open_drive(url: str, profile: DriveProfile, plan: ProcedurePlan) -> Iterator[ModbusPort]:
    port = open_port(parse_url(url), profile, reply_timeout_s=plan.supervision.reply_timeout_s)
    try:
        yield port
    finally:
        port.close()


def make_job(
    profile: DriveProfile,
    nameplate: Nameplate,
    plan: ProcedurePlan,
    port: Port,
    *,
    write_back: bool,
    now_s: Callable[[], float] = time.monotonic,
) -> Job:
    """The job with the link's measured latency: what the guard predicts across."""
    inverter = Inverter(port, profile)
    for _ in range(LATENCY_PROBES):
        inverter.read_status()
    names, factors = names_of(profile)
    pace = _pace(inverter, now_s)
    latency_s = port.stats.latency_s(1.0)
    sample_to_command_s = 0.0
    if pace is not None:
        sample_to_command_s = WINDOWS * pace.round_trip_s + max(GATHER_S - pace.round_trip_s, 0.0) + latency_s
    return Job(
        plan=plan,
        nameplate=nameplate,
        drive_limits=drive_limits(profile),
        parameter_names=names,
        parameter_factors=factors,
        write_back=write_back,
        link_latency_s=min(
            max(WORST_LATENCY_FACTOR * latency_s, sample_to_command_s), plan.supervision.reply_timeout_s
        ),
        pace=pace,
    )


def _pace(inverter: Inverter, now_s: Callable[[], float]) -> StreamPace | None:
    """Of reads of the whole window, which moves nothing in the drive; None of a drive that has none or does not show it now.
    A serial line takes what its rate does, at the least: a pseudo terminal passes bytes at once."""
    profile, port = inverter.profile, inverter.port
    layout = profile.window
    if layout is None:
        return None
    decimation = profile.items.get("decimation")
    most = int(decimation.maximum) if decimation is not None and decimation.maximum is not None else 1
    kept = int(inverter.read_kept_samples())
    window = (layout.data_registers // len(ALL_CHANNELS), layout.words, layout.data_registers, most, kept)
    at_least_s = 0.0
    if isinstance(port, ModbusPort) and port.bit_s is not None:
        at_least_s = (layout.words * BITS_PER_REGISTER + OVERHEAD_BITS) * port.bit_s
    times_s = []
    for _ in range(PACE_PROBES):
        began_s = now_s()
        try:
            port.read(layout.address, layout.words)
        except RequestRefused:
            return None
        times_s.append(now_s() - began_s)
    return StreamPace(
        max(min(times_s), at_least_s), *window, slowest_s=max(*times_s, at_least_s), request_s=port.stats.latency_s(0.0)
    )


def names_of(profile: DriveProfile) -> tuple[dict[str, str], dict[str, float]]:
    """Of each parameter that says one of the contract's by itself: the drive's name -> that field, and the factor by
    which the drive multiplies its SI value where that is not 1."""
    order = profile.parameter_names
    names: dict[str, str] = {}
    factors: dict[str, float] = {}
    for name, ours in our_values(profile, dict.fromkeys(order, 1.0), None).items():
        if ours.field in PARAMETERS and not ours.is_of_a_set:
            names[name] = ours.field
            if ours.value != 1.0:
                factors[name] = 1.0 / ours.value
    return names, factors


def drive_limits(profile: DriveProfile) -> DriveLimits:
    """What the drive file does not claim is not judged."""
    limits = profile.limits
    return DriveLimits(
        dc_link_min_v=-math.inf if limits.dc_link_min_v is None else limits.dc_link_min_v,
        dc_link_max_v=math.inf if limits.dc_link_max_v is None else limits.dc_link_max_v,
        heatsink_max_degc=math.inf if limits.heatsink_max_degc is None else limits.heatsink_max_degc,
        winding_max_degc=math.inf if limits.winding_max_degc is None else limits.winding_max_degc,
    )


def bounds(job: Job) -> Bounds:
    """What the last gate before the wire lets through."""
    return Bounds(
        max_watchdog_s=job.plan.supervision.max_watchdog_s,
        drive_current_a=job.trip_current_a,
        test_voltage_v=job.test_voltage_v,
        axis_time_s=job.axis_time_s,
        total_time_s=job.total_time_s,
        parameters=believable(job.nameplate),
    )


def watch_limits(job: Job) -> WatchLimits:
    """Where the runner stops by itself."""
    limits = job.drive_limits
    return WatchLimits(
        current_a=job.trip_current_a,
        flux_fraction=FLUX_FRACTION,
        axis_time_s=job.axis_time_s,
        lost_samples_s=LOST_SAMPLES_S,
        age_s=job.watchdog_s,
        dc_link_v=(limits.dc_link_min_v, limits.dc_link_max_v),
        heatsink_degc=limits.heatsink_max_degc,
        winding_degc=limits.winding_max_degc,
    )
