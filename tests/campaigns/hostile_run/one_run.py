"""One commissioning run in motor time through a man in the middle, judged by the simulator's log and answer key alone.

The run is the product's own from the Modbus port up: course, runner, guards, verdict and write-back; the archive and the closing
diagnosis are left out.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import patch

from commissioner.errors import CommissionerError
from commissioner.identify.analysis import identify
from commissioner.identify.excite import tones as excitation
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire import clients
from commissioner.link.wire.modbus import ModbusPort
from commissioner.link.wire.url import parse_url
from commissioner.motor.circuit import PARAMETERS
from commissioner.motor.nameplate import Nameplate, rated_flux
from commissioner.procedure.course import Findings, course
from commissioner.procedure.energised import excite
from commissioner.procedure.findings import RunEnded
from commissioner.run import runner as running
from commissioner.run.job import bounds, make_job, watch_limits
from commissioner.settings import load_procedure
from commissioner.study.commissioning import NoArchive
from sim.scenario import Scenario, build, read_document
from sim.truth import answer_key
from tests.campaigns.combinations import CASES, scenario
from tests.campaigns.hostile_run.motor_time import Socket, World
from tests.campaigns.hostile_run.troubles import LINKS, SENSORS, Link, Trouble
from tests.support.command_line import at_flux

MOTORS = (
    "default",
    "0k37_large_drive",
    "1k1_fast_switching",
    "2k2_ideal_devices",
    "4k_slow_switching",
    "0k18_small_inverter",
)
"""Of `tests.campaigns.combinations`."""
MOST_FLUX, WRONG, SIGMAS = 1.02, 0.03, 3.0
SETTLES_S = 5.0
"""After the run's end the drive's own watchdog has acted, whatever became of the link."""
TOKEN = 0x5EED


@dataclass(frozen=True)
class Judged:
    """`flux`: largest true stator or rotor flux over the limit of the plan; `current`: largest true current over its trip
    limit; `told`: the largest flux that the run knows of; `wrong`: parameters of a commissioned run that are wrong."""

    seed: int
    motor: str
    link: str
    trouble: Trouble
    ended: str
    reason: str
    flux: float
    current: float
    told: float
    wrong: tuple[str, ...]
    is_live: bool
    seconds: float

    @property
    def broken(self) -> tuple[str, ...]:
        out = [f"true flux {self.flux:.3f} of its limit"] if self.flux > MOST_FLUX else []
        out += [f"wrong and commissioned: {name}" for name in self.wrong]
        if self.trouble.kind in SENSORS and self.current > 1.0:
            out.append(f"a false sensor let the true current to {self.current:.2f} of its limit")
        if self.ended == "none" or "defect" in self.reason:
            out.append(self.reason)
        return (*out, "the drive is live after the end") if self.is_live else tuple(out)


def plan(axes: tuple[float, ...] = (0.0,)) -> Any:
    """One axis, a short multitone: every stage of a run, energised for about twelve seconds."""
    whole = load_procedure(None, axes)
    return replace(
        whole, repeat_first=False, excitation=replace(whole.excitation, seconds=2.5),
        supervision=replace(whole.supervision, standstill_dwell_s=0.05),
    )  # fmt: skip


def run_one(seed: int, motor: str, trouble: Trouble, folder: Path, link: Link = LINKS[0]) -> Judged:
    """`seed` is the trouble's; motor and link have a noise of their own, so that runs are alike until it strikes.
    `seconds` are CPU seconds of this process."""
    began_s = time.process_time()
    drawn, noise_seed = _scenario(motor, folder, link), 1 + len(LINKS) * MOTORS.index(motor) + LINKS.index(link)
    key = answer_key(drawn, noise_seed)
    plate = Nameplate(**key["nameplate"], connection="star")
    log = folder / "log.jsonl"
    world, findings = World(drawn, trouble, link, seed, noise_seed, log), Findings()
    with _motor_time(world):
        ended = _perform(world, plate, findings)
        world.live(world.now_s + SETTLES_S)
    is_live = world.firmware.is_energised
    world.firmware.power_off()
    world.firmware.log.close()
    rows = [json.loads(line) for line in log.read_text("utf-8").splitlines()]
    return _judge(seed, motor, link, trouble, key, plate, rows, ended, findings, is_live, time.process_time() - began_s)


def _scenario(motor: str, folder: Path, link: Link) -> Scenario:
    case = next(case for case in CASES if case.name == motor)
    name = case.name
    if case.machine:
        file = folder / f"{case.name}.toml"
        file.write_text(scenario(case), encoding="utf-8")
        name = str(file)
    document = read_document(name)
    return build({**document, "drive": {**document.get("drive", {}), "control_period_s": link.period_s}}, name)


def _remembered(function: Callable[..., Any]) -> Callable[..., Any]:
    """A pure function, which runs that are alike up to their trouble ask the same: answered once."""

    def asked(*given: Any, **options: Any) -> Any:
        key = hashlib.sha256(pickle.dumps((function.__name__, given, options))).digest()
        if key not in _ANSWERS:
            _ANSWERS[key] = function(*given, **options)
        return _ANSWERS[key]

    return asked


_ANSWERS: dict[bytes, Any] = {}


@contextmanager
def _motor_time(world: World) -> Iterator[None]:
    """pymodbus's socket is ours, its clock the world's; no priority is asked for where nothing runs in real time."""
    clock = SimpleNamespace(monotonic=lambda: world.now_s)
    with (
        patch.object(clients, "_open_socket", lambda _client: Socket(world)),
        patch.object(clients, "time", clock),
        patch.object(running, "raised_priority", nullcontext),
        patch.object(excite, "identify", _remembered(identify)),
        patch.object(excitation, "design", _remembered(excitation.design)),
    ):
        yield


def _perform(world: World, plate: Nameplate, findings: Findings) -> RunEnded:
    """As `run.commission.carry_out`, with the claim in the drive and without lock and folder."""
    profile, planned = load_profile("simulated"), plan()

    def clock() -> float:
        return world.now_s

    port = ModbusPort(
        parse_url("tcp://drive:502?device=1"), profile, reply_timeout_s=planned.supervision.reply_timeout_s,
        connect_timeout_s=2.0, sleep=world.sleep, clock=clock,
    )  # fmt: skip
    try:
        port.connect()
        inverter = Inverter(port, profile, sleep=world.sleep, clock=clock)
        job = make_job(profile, plate, planned, port, write_back=True, now_s=clock)
        inverter.identify()
        inverter.claim.take(TOKEN, "hostile campaign")
        archive = cast("Any", NoArchive())
        runner = running.Runner(inverter, archive, bounds(job), watch_limits(job), lambda _record: None)
        return runner.perform(course(job, findings))
    except CommissionerError as error:
        return RunEnded(error.outcome, error.what, 0.0, error.as_dict())


def _judge(
    seed: int, motor: str, link: Link, trouble: Trouble, key: Any, plate: Nameplate, rows: list[Any], ended: RunEnded,
    findings: Findings, is_live: bool, seconds: float,
) -> Judged:  # fmt: skip
    limits = plan().limits
    limit_wb = limits.flux_fraction * rated_flux(plate, key["apparent_stator_resistance_ohm"]).stator_peak_wb
    peaks = [row for row in rows if row["event"] == "peaks"]
    flux_wb = max((max(row["stator_flux_wb"], row["rotor_flux_wb"]) for row in peaks), default=0.0)
    current_a = max((row["current_a"] for row in peaks), default=0.0)
    return Judged(
        seed, motor, link.name, trouble, ended.outcome, ended.reason, flux_wb / limit_wb,
        current_a / (limits.trip_fraction * plate.rated_current_peak_a), findings.peak_flux_fraction,
        _wrong(findings, key) if findings.written or ended.outcome == "commissioned" else (), is_live, seconds,
    )  # fmt: skip


def _wrong(findings: Findings, key: Any) -> tuple[str, ...]:
    """Parameters further off than three standard errors and than three per cent."""
    found = findings.identification
    assert found is not None
    true, out = at_flux(key, found.holds_for_flux_wb), []
    for name, value, std in zip(PARAMETERS, found.parameters.as_tuple(), found.std, strict=True):
        off = abs(value - true[name])
        if off > SIGMAS * std and off > WRONG * true[name]:
            out.append(f"{name} {100 * (value / true[name] - 1):+.1f} %")
    return tuple(out)
