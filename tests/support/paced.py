"""A whole commissioning on the simulated drive behind a paced link, in this process and in motor time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.in_process import InProcessPort
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.course import Findings, Job, course
from commissioner.procedure.energised.excite import warm_up
from commissioner.procedure.findings import RunEnded
from commissioner.run.archive.folder import RunFolder
from commissioner.run.job import bounds, make_job, watch_limits
from commissioner.run.runner import Runner
from commissioner.settings import load_procedure
from sim.scenario import load
from sim.wire.in_process import Station
from sim.wire.pace import Pace

NAMES = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")
PLATE = (
    "rated_power_w", "rated_voltage_v", "rated_frequency_hz", "rated_current_a", "rated_speed_rpm", "power_factor",
    "pole_pairs",
)  # fmt: skip


@dataclass(frozen=True)
class Paced:
    """How a run ended, what it found, and the drive with the truth."""

    ended: RunEnded
    findings: Findings
    job: Job
    station: Station
    folder: Path

    @property
    def errors_in_std(self) -> np.ndarray:
        """(4,): what was found, off the answer key, in stated standard errors."""
        found = self.findings.identification
        assert found is not None
        truth = self.station.truth()
        rows = truth["inverse_gamma"]["over_flux"]
        flux = [row["stator_flux_wb"] for row in rows]
        true = [truth["apparent_stator_resistance_ohm"]] + [
            np.interp(found.holds_for_flux_wb, flux, [row["secant"][name] for row in rows]) for name in NAMES[1:]
        ]
        return (np.array(found.parameters.as_tuple()) - true) / np.array(found.std)

    @property
    def overruns(self) -> int:
        return self.station.drive.firmware.samples.overruns


def commissioned(
    runs: Path,
    pace: Pace,
    scenario: str = "default",
    seed: int = 1,
    axes=None,
    faults=(),
    connection: str = "star",
    seconds: float | None = None,
) -> Paced:
    """`axes`, `seconds` of tones along each: None takes the procedure's; `connection`: the plate's."""
    drawn = load(scenario)
    station, profile = Station(drawn, seed, faults, pace), load_profile("simulated")
    plate = Nameplate(**{name: getattr(drawn.plant.nameplate, name) for name in PLATE}, connection=connection)
    warm_up(plate)
    port = InProcessPort(station)
    folder = RunFolder.create(runs, "simulated")
    inverter = Inverter(
        port, profile, lambda intent: folder.journal("about_to", intent),
        sleep=station.pass_time, clock=lambda: station.now_s,
    )  # fmt: skip
    plan = load_procedure(None, axes_deg=axes)
    if seconds is not None:
        plan = replace(plan, excitation=replace(plan.excitation, seconds=seconds))
    findings = Findings()
    job = make_job(profile, plate, plan, port, write_back=True, now_s=inverter.now_s)
    folder.save("request.json", {"profile": profile.file})
    folder.journal("job", job)
    runner = Runner(inverter, folder, bounds(job), watch_limits(job), lambda _record: None)
    ended = runner.perform(course(job, findings))
    folder.write_recording({name: value for name, value in vars(plate).items() if value is not None})
    folder.close()
    return Paced(ended, findings, job, station, folder.path)
